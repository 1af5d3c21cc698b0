"""The league: every law on every plant in every scenario, with one set of gains for each law."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from bowden.control.knowledge import configured
from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.core.metrics import delay, finite
from bowden.core.units import DEGREES
from bowden.design.league_cells import LeaguePlant, LeagueScenario
from bowden.design.league_exact import exact_travel
from bowden.plants.cable_plant import CablePlant
from bowden.plants.knowledge_of import knowledge_of
from bowden.sim.many import Case, Shown, simulate_each

BASELINE = "adaptive"
"""The law that ratios are taken to: the paper's."""


@dataclass(frozen=True)
class Cell:
    """What one law did in one scenario on one plant; None where a figure does not exist."""

    law: str
    plant: str
    scenario: str
    rmse_deg: float | None
    """From rest [deg]."""
    rmse_after_10s_deg: float | None
    """The same without the first ten seconds [deg]."""
    peak_deg: float | None
    """Largest |e| [deg]."""
    delay_s: float | None
    """See `bowden.core.metrics.delay` [s]."""
    chatter: float | None
    """Total variation of the command over that of the exact inverse's (`bowden.design.league_exact`) [–]."""
    energy_j: float | None
    """∫Pe dt of the motor, Eq. 18 [J]."""
    stable: bool
    """Whether it reached the end with the joint never further from the reference than the plant's whole stroke."""


@dataclass(frozen=True)
class Played:
    """A cell and how its error went."""

    cell: Cell
    what: str
    """What its plant is."""
    errors: NDArray[np.float64]
    """Largest |e| in each of `STRETCHES` stretches of the run; NaN of an unstable one (k,) [deg]."""


STRETCHES = 48
"""Points of the small plots."""


@dataclass(frozen=True)
class Standing:
    """A law's place in the league."""

    law: str
    cells: int
    """Cells that it played."""
    won: float
    """Share of the cells in which no other law had a lower RMSE from rest [–]."""
    ratio: float | None
    """Median of its RMSE from rest over the baseline's, an unstable cell counting as the largest; None where the
    baseline did not play, or the median is an unstable cell [–]."""
    rmse_deg: float | None
    """Median RMSE from rest, an unstable cell counting as the largest [deg]."""
    chatter: float | None
    """Median chatter over its stable cells [–]."""
    most_chatter: float | None
    """Largest chatter of its stable cells [–]."""
    unstable: int
    """Cells in which it was unstable."""


def play(
    laws: Sequence[Law],
    plants: Sequence[Callable[[], LeaguePlant]],
    scenarios: Sequence[LeagueScenario],
    progress: Callable[[str, float], None],
    guard: Callable[[Law], AbstractContextManager[None]],
    seed: int = 1,
) -> Iterator[Played]:
    """Play the cells, plant by plant and in each of them scenario by scenario, so that a league that is broken off
    has compared all laws in what it has.

    Args:
        laws: with their gains.
        plants: each made when it is its turn, since to identify one takes a second.
        scenarios: what to do.
        progress: called with what is done now and the share done.
        guard: held round a law's run, to say what is wrong with a user's own (`bowden.control.user_law.explained`).
        seed: of the encoders' noise, the same for all laws.
    """
    total, done = len(laws) * len(plants) * len(scenarios), 0
    for make in plants:
        found = make()
        for scenario in scenarios:
            reference = scenario.reference(found.stroke)
            start = float(reference.sample(np.zeros(1))[0, 0])
            initial = found.plant.resting_motor(start, float(found.bend(np.zeros(1))[0]))
            progress(f"{found.name}, {scenario.name}", done / total)
            travel = _exact_travel(found, reference, scenario.duration, initial)
            informed_laws = tuple(configured(law, found.known or knowledge_of(found.plant)) for law in laws)
            runs = simulate_each(
                Case(found.plant, informed_laws, reference, found.bend, seed, initial), scenario.duration
            )
            for law in laws:
                progress(f"{found.name}, {scenario.name}, {law.name}", done / total)
                with guard(law):
                    run = next(runs)
                yield _judged(law.name, found, scenario, run, travel)
                done += 1


def _exact_travel(found: LeaguePlant, reference: Trajectory, duration: float, initial: float) -> float:
    """`exact_travel`; NaN of a suit or a user's own plant, whose exact inverse nobody knows [rad]."""
    if not isinstance(found.plant, CablePlant):
        return math.nan
    return exact_travel(found.plant, reference, duration=duration, bend=found.bend, initial_motor=initial)


def _judged(name: str, found: LeaguePlant, scenario: LeagueScenario, run: Shown, travel: float) -> Played:
    """The cell: no trace is made, since all that is drawn of it are the largest errors of its stretches."""
    outcome, late = run.outcome, run.outcome.rmse_after_10s * DEGREES
    if not (outcome.ended and outcome.peak * DEGREES <= found.stroke * DEGREES):
        cell = Cell(name, found.name, scenario.name, None, None, None, None, None, None, stable=False)
        return Played(cell, found.what, np.full(STRETCHES, np.nan))
    errors = np.abs(run.joint - run.reference) * DEGREES
    return Played(
        Cell(
            law=name,
            plant=found.name,
            scenario=scenario.name,
            rmse_deg=outcome.rmse * DEGREES,
            rmse_after_10s_deg=late if math.isfinite(late) else None,
            peak_deg=outcome.peak * DEGREES,
            delay_s=delay(run.time, run.reference, run.joint),
            chatter=outcome.command_travel / travel if travel > 0.0 else None,
            energy_j=outcome.electrical_energy,
            stable=True,
        ),
        found.what,
        np.array([part.max() for part in np.array_split(errors, STRETCHES)]),
    )


def standings(cells: Sequence[Cell]) -> list[Standing]:
    """The laws from best to worst: by cells won, then by the median RMSE."""
    table: dict[tuple[str, str], dict[str, Cell]] = {}
    for cell in cells:
        table.setdefault((cell.plant, cell.scenario), {})[cell.law] = cell
    laws = list(dict.fromkeys(cell.law for cell in cells))
    found = [_standing(law, [row for row in table.values() if law in row]) for law in laws]
    return sorted(found, key=lambda one: (-one.won, math.inf if one.rmse_deg is None else one.rmse_deg))


def _standing(law: str, rows: Sequence[dict[str, Cell]]) -> Standing:
    errors = [_error(row[law]) for row in rows]
    best = [min(map(_error, row.values())) for row in rows]
    compared = [(_error(row[law]), _error(row[BASELINE])) for row in rows if BASELINE in row]
    ratios = [error / other if math.isfinite(other) else 0.0 for error, other in compared if error < math.inf]
    ratios += [math.inf] * sum(error == math.inf for error, _ in compared)
    chatters = [row[law].chatter for row in rows]
    defined = [chatter for chatter in chatters if chatter is not None]
    return Standing(
        law=law,
        cells=len(rows),
        won=sum(error < math.inf and error == least for error, least in zip(errors, best, strict=True)) / len(rows),
        ratio=finite(median(ratios)) if ratios else None,
        rmse_deg=finite(median(errors)),
        chatter=median(defined) if defined else None,
        most_chatter=max(defined, default=None),
        unstable=sum(not row[law].stable for row in rows),
    )


def _error(cell: Cell) -> float:
    return math.inf if cell.rmse_deg is None else cell.rmse_deg
