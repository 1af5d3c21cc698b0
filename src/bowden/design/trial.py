"""A short closed-loop run that shows what a loop does: it moves, then rests."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.control.reference import PointToPoint, Trajectory
from bowden.core.units import DEGREES
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.estimated import measured_plant
from bowden.plants.plant import Plant
from bowden.plants.suit_parts import Suit
from bowden.plants.transmission import transmission, unrest
from bowden.records.trace import Trace
from bowden.sim.run import simulate

Array = NDArray[np.float64]

_HALF = 2.0
"""Time of one motion, up or down [s]."""
MOVING = 40.0
"""How long it moves [s]; a whole number of motions."""
LONGEST = 400.0
"""The longest motion of a trial [s], for estimates that settle late or never; the adaptive law's take all of it."""
_SETTLING, _JUDGED = 10.0, 10.0
"""Of the rest that follows: what is left to the loop, and what is judged [s]."""
AFTER = _SETTLING + _JUDGED
"""What a trial lasts longer than it moves [s]."""
_SNAPSHOTS = 8
_FOLLOWS = 0.5
"""Share of the stroke that the joint of a suit goes at least."""


@dataclass(frozen=True)
class Trial:
    """What a run showed."""

    moving: float
    """How long it moved [s]."""
    bounded: bool
    """True if it came to rest: it did not run away, its joint was never further from the reference than the stroke is
    long, and ends up within twice the dead zone and 1°. Of a suit both bounds are wider by what the joint does with no
    law (`bowden.plants.transmission.unrest`), the first by twice what friction and weight keep it off, the stroke at
    most; and its joint has to go half of the stroke, since an arm that its wearer holds fast rests as well."""
    why: str
    """What it did instead; empty where it is bounded."""
    swing: float | None
    """Half of the joint's span while the reference rests [rad]; None where the run ran away."""
    period: float | None
    """Of that swing [s]; None where it crosses its middle less than three times."""
    peak: float | None
    """Largest error after the first 4 s [rad]; None where the run ran away."""
    ripple: float | None
    """Root mean square of the command's step from one cycle to the next, at rest [rad]."""
    visited: tuple[dict[str, float], ...]
    """The law's state now and then, while the error was no larger than the stroke."""


def run_trial(
    bench: Plant, law: Law, bend: float, stroke: tuple[float, float], seed: int = 1, moving: float = MOVING
) -> Trial:
    """Move between the ends of a `stroke` [rad] at a constant `bend` [rad] for so long, then rest in its middle."""
    trace = simulate(
        bench,
        law,
        motion(stroke, moving),
        duration=moving + AFTER,
        bend=constant_bend(bend),
        seed=seed,
        initial_motor=bench.resting_motor(stroke[0], bend),
    )
    free, length = unrest(bench, bend, stroke, _JUDGED), abs(stroke[1] - stroke[0])
    bounds = Bounds(
        furthest=length + min(2.0 * free.off, length) + free.span,
        most=2.0 * transmission(bench, bend, stroke).dead_zone + float(np.radians(1.0)) + free.span,
        least=_FOLLOWS * length if isinstance(measured_plant(bench), Suit) else 0.0,
    )
    return judged(trace, length, moving, bounds)


class Bounds(NamedTuple):
    """What a trial's joint may do."""

    furthest: float
    """Largest error that is borne [rad]."""
    most: float
    """Largest span at rest that is [rad]."""
    least: float
    """How far it has to go in all [rad]."""


def judged(trace: Trace, length: float, moving: float, bounds: Bounds) -> Trial:
    """What a run along `motion` showed.

    Args:
        trace: of the run.
        length: of the stroke [rad].
        moving: how long it moved [s].
        bounds: of its joint.
    """
    error = trace.columns["joint"] - trace.columns["reference"]
    near = np.abs(error) <= bounds.furthest
    lasted = len(error) if near.all() else int(np.argmin(near))
    states = {name.removeprefix("law."): v for name, v in trace.columns.items() if name.startswith("law.")}
    picked = np.unique(np.linspace(0, max(lasted - 1, 0), _SNAPSHOTS).astype(int))
    visited = tuple({name: float(values[k]) for name, values in states.items()} for k in picked)
    if not trace.ended:
        return Trial(moving, False, "it runs away", None, None, None, None, visited)
    rest = error[trace.columns["time"] >= moving + _SETTLING]
    span, went = float(np.ptp(rest)), float(np.ptp(trace.columns["joint"]))
    commands = trace.columns["command"][-len(rest) :]
    why = ""
    if lasted < len(error):
        why = f"the joint is off by more than {bounds.furthest * DEGREES:.3g}°"
    elif went < bounds.least:
        why = f"the joint moves by {went * DEGREES:.3g}° in all, where {length * DEGREES:.3g}° are asked for"
    elif span > bounds.most:
        why = f"the joint moves by {span * DEGREES:.3g}° at rest, where {bounds.most * DEGREES:.3g}° are borne"
    return Trial(
        moving=moving,
        bounded=not why,
        why=why,
        swing=0.5 * span,
        period=_period(rest, float(trace.settings["sample_time"])),
        peak=float(np.max(np.abs(error[trace.columns["time"] >= 2.0 * _HALF]))),
        ripple=float(np.sqrt(np.mean(np.diff(commands) ** 2))),
        visited=visited,
    )


def settled_after(law: Law) -> float:
    """How long a trial moves until the law's estimates have settled [s]: `Law.settling` in whole motions."""
    said = LONGEST if law.settling is None else law.settling(law.gains)
    return LONGEST if not said < LONGEST else _HALF * math.ceil(said / _HALF)


@lru_cache(4)
def motion(stroke: tuple[float, float], moving: float) -> "Kept":
    """The motion of a trial, sampled once for all the laws and benches that are tried on it."""
    low, high = stroke
    times = np.arange(0.0, moving + 0.5 * _HALF, _HALF)
    positions = np.where(np.arange(len(times)) % 2, high, low)
    positions[-1] = 0.5 * (low + high)
    return Kept(PointToPoint((*times.tolist(), moving + AFTER), (*positions.tolist(), float(positions[-1]))))


def _period(values: Array, dt: float) -> float | None:
    """Median time between crossings of the middle of the span upwards that go on for a tenth of the span."""
    middle, band = 0.5 * (np.max(values) + np.min(values)), 0.1 * float(np.ptp(values))
    side = np.where(values > middle + band, 1, np.where(values < middle - band, -1, 0))
    at = np.flatnonzero(side)
    ups = at[1:][(side[at[1:]] > 0) & (side[at[:-1]] < 0)]
    return float(np.median(np.diff(ups))) * dt if len(ups) >= 3 else None


_PIECES = 100
"""How many of them are kept, of whatever length."""


class Kept:
    """A trajectory that keeps its samples, since every law is asked to follow the same ones, piece by piece."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self._kept: dict[float, tuple[Array, Array]] = {}

    def sample(self, time: Array) -> Array:
        """Position, velocity, acceleration (n, 3)."""
        if len(time) == 1:
            return self._trajectory.sample(time)
        times, samples = self._kept.get(float(time[0]), (time[:0], time))
        if not np.array_equal(time, times):
            if len(self._kept) == _PIECES:
                self._kept.clear()
            times, samples = self._kept[float(time[0])] = time.copy(), self._trajectory.sample(time)
        return samples

    def describe(self) -> dict[str, Any]:
        """Kind and parameters."""
        return self._trajectory.describe()
