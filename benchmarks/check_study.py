"""How far `bowden check` can be trusted: its verdicts against ten-minute simulations of 500 random rigs."""

import numpy as np

from bowden.plants.presets.bench import default_bench
from kept import Kept
from measure import Figure
from study import Case, Study, study

COUNT, SEED, SEED_OF_TRIES = 500, 20261122, 0


def figures(count: int = COUNT, seed: int = SEED) -> tuple[list[Figure], list[str]]:
    """The shares, beside what is wanted of them."""
    kept = Kept(f"study_{seed}")
    missing = study(default_bench(), count, seed, skip=len(kept.rows()))
    rows = kept.filled(([c.number, c.verdict, c.stable, c.calm, c.phase_margin_deg] for c in missing), count)
    found = Study(tuple(Case(*row) for row in rows[:count]))
    stable = [case for case in found.cases if case.stable]
    narrow = [case for case in stable if case.phase_margin_deg < 30.0]
    enough = [case for case in stable if case.phase_margin_deg >= 30.0 and case.calm]
    verdicts = [case.verdict for case in found.cases]
    return [
        Figure("the verdict agrees with the simulation", _percent(found.agreement), "≥ 98 %"),
        Figure("unsafe: `holds`, and unstable", str(found.unsafe), "0"),
        Figure("`little_margin`", _percent(found.little_margin), "≤ 10 %"),
        Figure(
            "`holds`, of the rigs calm at rest with 6 dB and 45° in simulation", _percent(found.recognised), "≥ 95 %"
        ),
        Figure(
            "`holds`, of those with 6 dB and 30°", _percent(np.mean([case.verdict == "holds" for case in enough])), "–"
        ),
        Figure("stable in simulation without 6 dB and 30°", _percent(len(narrow) / len(verdicts)), "–"),
    ], [
        f"{len(verdicts)} rigs of seed {seed}: servo, delay, slope and gains drawn as `study.py` says; "
        f"{len(stable)} stable in ten minutes of motion; verdicts: "
        + ", ".join(
            f"{verdicts.count(name)} `{name}`" for name in ("holds", "little_margin", "limit_cycle", "does_not_hold")
        )
        + "."
    ]


def _percent(share: float | np.floating) -> str:
    return f"{100.0 * share:.1f} %"
