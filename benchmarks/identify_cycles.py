"""What more cycles in a log buy: identifications of the first cycles of a recording, judged on all that follows.

The recordings of ``../shared/data`` (cable and cable_load) are cut behind 1 to 5 whole cycles. The recommended model of
each cut, fitted to the whole of it, is simulated straight through the recording. Its error after the cut, over at least
one whole cycle, is set beside what the fit states: the error on the second half of the cut.

    python benchmarks/identify_cycles.py
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import results
from bowden import identify, read_log
from bowden.core.units import DEGREES
from bowden.identify.cable import path as cable_path
from bowden.identify.cable.fit import follow
from bowden.identify.log.read import Log
from bowden.records.metrics import rmse
from measure import machine

DATA = Path(__file__).parents[2] / "shared" / "data"
TITLE = "What more cycles in a log buy"
KEPT = Path("out/bench/identify_cycles.json")
CUTS = (1, 2, 3, 4, 5)
"""Whole cycles that are fitted."""
LONG = 0.5
"""Share of the motor's range from which on a stroke counts."""
AFTER = 0.9
"""Cycles that must be left to judge on; logs of six cycles end a little before the sixth is whole."""


class Judged(NamedTuple):
    """One cut of one recording."""

    name: str
    cycles: int
    stated: float
    """Error on the second half of the cut [°]."""
    later: float
    """Error on all that follows the cut [°]."""
    last: float
    """Error on the recording's last cycle [°]."""
    left: float
    """Cycles after the cut."""


def travelled(path: cable_path.Path) -> NDArray[np.float64]:
    """Cycles behind each node (n,), whole and parts [–]: the way of all long strokes over twice the motor's range."""
    ways = np.abs(np.diff(path.turning))
    ways = np.where(ways >= LONG * path.span, ways, 0.0)
    before = np.concatenate([[0.0], np.cumsum(ways)])[path.stroke]
    begun = np.abs(path.motor - path.turning[path.stroke])
    return np.asarray((before + np.where(ways[path.stroke] > 0.0, begun, 0.0)) / (2.0 * path.span))


def judge(name: str, log: Log, cycles: int) -> Judged | None:
    """Identify the first cycles, and judge the model on what follows; None where too little does."""
    path = cable_path.path_of(log.time, log.motor, log.joint, len(log.time))
    gone = np.interp(log.time, path.time, travelled(path))
    cut = int(np.searchsorted(gone, cycles))
    if gone[-1] - cycles < AFTER:
        return None
    fit = identify(log.time[:cut], log.motor[:cut], log.joint[:cut], name=log.name)
    error = (follow(fit.best, path, log.time) - log.joint) * DEGREES
    stated = fit.chosen.test_rms * DEGREES
    last = rmse(error[gone > gone[-1] - 1.0])
    return Judged(name, cycles, stated, rmse(error[cut:]), last, float(gone[-1] - cycles))


def three(values: list[float]) -> str:
    """Median, 90 % and largest."""
    return ", ".join(f"{one:.3g}" for one in (np.median(values), np.quantile(values, 0.9), max(values)))


def rows(found: list[Judged]) -> list[str]:
    """Of the table, one for each number of cycles."""
    longest = {one.name: one.last for one in found if one.cycles == max(CUTS)}
    lines = []
    for cycles in CUTS:
        here = [one for one in found if one.cycles == cycles]
        same = [one.last for one in here if one.name in longest]
        gains = [longest[one.name] / one.last for one in here if one.name in longest]
        ratios = [one.later / one.stated for one in here]
        lines.append(
            f"| {cycles} | {len(here)} | {three([one.stated for one in here])} | {three([one.later for one in here])} "
            f"| {three(ratios)} | {three(same)} | {three(gains)} |"
        )
    return lines


def main() -> None:
    """The command."""
    files = sorted(path for folder in ("cable", "cable_load") for path in (DATA / folder).glob("*.csv.gz"))
    if not files:
        raise SystemExit(f"no recordings in {DATA}")
    found = []
    for file in files:
        log = read_log(file)
        found += [judge(f"{file.parent.name}/{file.name}", log, cycles) for cycles in CUTS]
    judged = [one for one in found if one is not None]
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    KEPT.write_text(json.dumps([one._asdict() for one in judged]), encoding="utf-8")
    longest = len({one.name for one in judged if one.cycles == max(CUTS)})
    head = (
        "Errors of the joint [°], root mean square: median, 90 % and largest.\n\n"
        "| whole cycles | recordings | stated: on the second half of the cut | on all that follows "
        f"| the latter over the former | on the last cycle, the {longest} recordings of all cuts "
        "| with five cycles over that |\n|---|---|---|---|---|---|---|\n"
    )
    text = head + "\n".join(rows(judged)) + "\n\n" + "\n".join(f"- {note}" for note in machine())
    print(text)
    results.write(TITLE, text)


if __name__ == "__main__":
    main()
