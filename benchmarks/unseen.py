"""Every law on cells that nobody tuned for: ``python benchmarks/unseen.py --set development``.

See docs/background/unseen.md.

Each law knows the same of a rig by the one rule of `bowden.control.knowledge`, and has its own gains for all cells.
A law's cost in a cell is its RMSE over the whole run, from rest; an unstable run costs more than any other. Looks at
the validation and judging sets are counted in ``unseen_looks.toml`` before anything is run.
"""

import argparse
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bowden.control import LAWS
from bowden.control.knowledge import configured
from bowden.control.law import Law
from bowden.control.law_file import loaded, named
from bowden.core.units import DEGREES
from bowden.sim.many import Outcome, simulate_many
from kept import counted, numbers_in, progress
from measure import table as markdown
from unseen_cells import DURATION, SETS, Cell, case_of, draw

LOOKS = Path(__file__).with_name("unseen_looks.toml")
COUNTS = {"development": 300, "validation": 300, "judging": 400}
"""Cells of a set where no seeds are given."""
BASELINE = "active_disturbance_rejection"
"""The law that chatter and the share of worse cells are taken to."""
NEAR, WORSE = 1.1, 1.2


@dataclass(frozen=True)
class Run:
    """What one law did in one cell."""

    number: int
    families: str
    law: str
    stable: bool
    rmse_deg: float
    """Of the whole run, from rest; infinite of an unstable one [deg]."""
    travel_deg: float
    """Total variation of the command [deg]."""


def play(laws: Sequence[Law], cells: Sequence[Cell]) -> Iterator[Run]:
    """Every law in every cell; those that one compiled loop can run, one after another."""
    order = sorted(cells, key=lambda cell: (cell.rig.inner.cable.name, cell.rig.sample_time, cell.number))
    cases = (case_of(cell, tuple(configured(law, cell.known) for law in laws)) for cell in order)
    for cell, outcomes in zip(order, simulate_many(cases, DURATION), strict=True):
        for law, outcome in zip(laws, outcomes, strict=True):
            yield run_of(cell.number, cell.special, cell.allowed, law.name, outcome)


def run_of(number: int, families: str, allowed: float, law: str, outcome: Outcome) -> Run:
    """The figures of a run in degrees; it is stable with an error never above `allowed` [rad]."""
    stable = bool(outcome.ended and outcome.peak <= allowed)
    rmse, travel = (value * DEGREES if stable else math.inf for value in (outcome.rmse, outcome.command_travel))
    return Run(number, families, law, stable, rmse, travel)


@dataclass(frozen=True)
class Standing:
    """What came of a law over a set; shares are of the cells, ratios to the best of all laws in each cell."""

    law: str
    cells: int
    near: float
    """Share within 10 % of the best [–]."""
    median: float
    most: float
    """Ratio at 95 % of the cells [–]."""
    worse: float
    """Share more than 20 % worse than the baseline [–]."""
    chatter: float
    """Median of the command's total variation over the baseline's [–]."""
    most_chatter: float
    """The same at 95 % [–]."""
    unstable: int
    rmse_deg: float
    """Median [deg]."""


def standings(runs: Iterable[Run]) -> list[Standing]:
    """The laws, from the best median on."""
    table: dict[int, dict[str, Run]] = {}
    for run in runs:
        table.setdefault(run.number, {})[run.law] = run
    laws = list(dict.fromkeys(law for row in table.values() for law in row))
    return sorted((_standing(law, table) for law in laws), key=lambda one: (one.median, one.most))


def ratio(value: float, best: float) -> float:
    """Over the best; 1 where none is stable, infinite where only others are."""
    return value / best if math.isfinite(best) else 1.0


def _standing(law: str, table: dict[int, dict[str, Run]]) -> Standing:
    rows = [row for row in table.values() if law in row]
    whole = np.array([ratio(row[law].rmse_deg, min(run.rmse_deg for run in row.values())) for row in rows])
    compared = [(row[law], row[BASELINE]) for row in rows if BASELINE in row]
    chatter = [mine.travel_deg / its.travel_deg for mine, its in compared if mine.stable and its.stable]
    worse = [mine.rmse_deg > WORSE * its.rmse_deg or (its.stable and not mine.stable) for mine, its in compared]
    return Standing(
        law,
        len(rows),
        float(np.mean(whole <= NEAR)),
        _share(whole, 50.0),
        _share(whole, 95.0),
        float(np.mean(worse)) if worse else math.nan,
        _share(np.array(chatter), 50.0) if chatter else math.nan,
        _share(np.array(chatter), 95.0) if chatter else math.nan,
        sum(not row[law].stable for row in rows),
        _share(np.array([row[law].rmse_deg for row in rows]), 50.0),
    )


def _share(values: Any, share: float) -> float:
    """Percentile, without interpolation: an unstable run must not be averaged with others."""
    return float(np.percentile(values, share, method="higher"))


def worst(runs: Iterable[Run], law: str, count: int = 10) -> list[dict[str, Any]]:
    """The cells where a law is furthest behind the best, with their families."""
    table: dict[int, dict[str, Run]] = {}
    for run in runs:
        table.setdefault(run.number, {})[run.law] = run
    found = []
    for number, row in table.items():
        if law in row:
            best = min(row.values(), key=lambda run: run.rmse_deg)
            found.append((ratio(row[law].rmse_deg, best.rmse_deg), number, row[law], best))
    found.sort(key=lambda one: (-one[0], one[1]))
    return [
        {
            "number": number,
            "families": mine.families,
            "ratio": over,
            "rmse_deg": mine.rmse_deg,
            "best": best.law,
            "best_rmse_deg": best.rmse_deg,
        }
        for over, number, mine, best in found[:count]
    ]


def look(set_name: str, numbers: range, laws: Sequence[str], file: Path = LOOKS) -> int:
    """Write down that a set is looked at, and how often it has been; the development set is not counted."""
    return counted(file, set_name, {"cells": f"{numbers.start}:{numbers.stop}", "laws": list(laws)})


COLUMNS = (
    *("law", "within 10 % of the best", "median ratio", "95 % ratio", "> 20 % worse than ADRC"),
    *("chatter over ADRC: median, 95 %", "unstable", "RMSE [°]"),
)


def table(found: Sequence[Standing]) -> str:
    """One line a law."""
    rows = [
        [
            *(f"`{one.law}`", f"{one.near:.0%}", f"{one.median:.2f}", f"{one.most:.2f}", f"{one.worse:.1%}"),
            *(f"{one.chatter:.2f}, {one.most_chatter:.2f}", one.unstable, f"{one.rmse_deg:.2f}"),
        ]
        for one in found
    ]
    return markdown(COLUMNS, rows)


def over_rates(set_name: str, numbers: range, laws: Sequence[Law], rates: Sequence[float]) -> str:
    """Median RMSE of each law at each rate of the loop, and how many cells are unstable."""
    found = [
        {one.law: one for one in standings(play(laws, [draw(set_name, number, rate) for number in numbers]))}
        for rate in rates
    ]
    rows = [
        [f"`{law.name}`", *(f"{of[law.name].rmse_deg:.2f}, {of[law.name].unstable}" for of in found)] for law in laws
    ]
    return markdown(("law", *(f"{rate:g} Hz" for rate in rates)), rows)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--set", choices=list(SETS), default="development", dest="set_name")
    parser.add_argument("--seeds", default="", help="COUNT or FIRST:END; the set's own number without it")
    parser.add_argument("--rates", default="", help="of the loop in place of the drawn ones, with commas [Hz]")
    parser.add_argument("--laws", default="", help="names and files, with commas; all without it")
    given = parser.parse_args()
    laws = [loaded(named(name)) for name in (given.laws.split(",") if given.laws else LAWS)]
    numbers, begun = numbers_in(given.seeds, COUNTS[given.set_name]), time.perf_counter()
    names = [law.name for law in laws]
    looks = look(given.set_name, numbers, names)
    if given.rates:
        print(over_rates(given.set_name, numbers, laws, [float(one) for one in given.rates.split(",")]))
        return
    played = play(laws, [draw(given.set_name, number) for number in numbers])
    runs: list[Run] = list(progress(played, len(numbers) * len(laws), "runs"))
    counted_as = f"{time.perf_counter() - begun:.0f} s" + (f", look {looks}" if looks else "")
    print(f"{given.set_name}, cells {numbers.start}:{numbers.stop}, {counted_as}")
    print(table(standings(runs)))
    print(f"\nWorst cells of `{names[0]}`:")
    for one in worst(runs, names[0]):
        print(
            f"- {one['number']}: {one['ratio']:.2f} × `{one['best']}` ({one['rmse_deg']:.2f}° for "
            f"{one['best_rmse_deg']:.2f}°): {one['families']}"
        )


if __name__ == "__main__":
    main()
