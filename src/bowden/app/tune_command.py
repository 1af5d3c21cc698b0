"""``bowden tune``: gains with margins for a rig.toml, written back into it with their evidence."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from bowden.app.console import print_json, progress_bar, seconds


def tune(
    rig: Annotated[Path, typer.Argument(help="The bench, law and scenario; its [control.gains] are rewritten.")],
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Leave the file as it is.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Find gains of the rig's law that keep 6 dB and 45° and follow best in the worst case, and write them back."""
    from bowden.app import compose, gains_text, ranges
    from bowden.app.workers import two_workers
    from bowden.control import user_law
    from bowden.core.files import whole_file
    from bowden.core.units import DEGREES
    from bowden.design.tune import tune as search

    setup, description = compose.setup(rig)
    law = compose.law_for(description.control.law, description, setup.bench, rig.parent)
    low, high = ranges.bends(setup)
    bends = (low, high) if high > low else (low, 2.0 * low)  # a sheath that nobody moves in the file is moved in use
    with (
        progress_bar(quiet=json) as report,
        user_law.explained(law),
        two_workers(description.control.law, rig.parent) as workers,
    ):
        found = search(
            setup.bench, law, bends=bends, stroke=ranges.stroke(setup), seed=seed, workers=workers, report=report
        )
    for note in setup.notes:
        print(f"bowden: note: {note}", file=sys.stderr)
    document = {
        "law": law.name,
        "gains": dict(found.changed),
        "before": {name: getattr(law.gains, name) for name in found.changed},
        "verdict": found.found.verdict,
        "verdict_before": found.before.verdict,
        "gain_margin_db": found.found.gain_margin_db,
        "phase_margin_deg": found.found.phase_margin_deg,
        "delay_margin_s": found.found.delay_margin_s,
        "worst_rmse_deg": found.worst_rmse * DEGREES,
        "worst_rmse_before_deg": None if found.worst_before is None else found.worst_before * DEGREES,
    }
    before = "unstable" if found.worst_before is None else f"{found.worst_before * DEGREES:.3g}°"
    before += f", {found.before.verdict}"
    margins = [
        f"{value:.1f} {unit}"
        for value, unit in ((found.found.gain_margin_db, "dB"), (found.found.phase_margin_deg, "°"))
        if value is not None
    ]
    evidence = [
        f"found by bowden tune; margins over bends of {bends[0] * DEGREES:.0f} to {bends[1] * DEGREES:.0f}°: "
        f"{' and '.join(margins) or 'no feedback'}",
        f"largest RMSE over nine runs of 20 s: {found.worst_rmse * DEGREES:.3g}° (before: {before})",
    ]
    if not dry_run and found.changed:
        text = gains_text.with_gains(rig.read_text(encoding="utf-8"), found.changed, evidence, rig)
        with whole_file(rig) as part:
            part.write_text(text, encoding="utf-8")
    files = [str(rig)] if not dry_run and found.changed else []
    if json:
        print_json(document | {"files": files, "seconds": seconds()})
        return
    for line in evidence:
        print(line)
    for name, value in found.changed.items():
        print(f"  {name} = {value:g}  (was {getattr(law.gains, name):g})")
    print(f"{'Wrote ' + str(rig) if files else 'Nothing written'}  ({seconds():.1f} s)")
