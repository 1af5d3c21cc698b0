"""The figures of the suit's experiments (Figs 6, 17 and 19), each measured in one place."""

import itertools
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.knowledge import configured
from bowden.control.law import Law
from bowden.control.reference import PointToPoint
from bowden.core.units import DEGREES, RADIANS
from bowden.models.drive.holding_brake import ENGAGING, HELD, HoldingBrake, brake_power
from bowden.models.minimum_jerk import minimum_jerk_over
from bowden.paper.calibration import gains, suit_fit
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.suit import SuitCalibration, suit
from bowden.records.metrics import delay
from bowden.records.trace import Trace
from bowden.sim.suit_runs import DRIVE_INTEGRAL, NO_BRAKE, each_flexion, energies, flexions, largest_errors, run_suit

Array = NDArray[np.float64]

LEARNING = 50.0
"""Two slow flexions before the motions of Fig. 19 [s]."""
MOTIONS, PAUSE = 7, 1.5
"""Motions of Fig. 19, and the rest after each [s]."""
MOVED_DEG = 0.5
"""The elbow counts as moving once it has gone this far: ten steps of the flex sensor [deg]."""
RISEN, SMOOTH = 0.5, 0.05
"""Assistance counts as begun once the motor's current, a mean over so long [s], has changed by this much [A]."""


DRIVES = {"PD": 0.0, "integral": DRIVE_INTEGRAL}
"""The integral of the drive's position loop: the paper's has none, drives that one buys have [1/s]."""


def laws_on(drive: str) -> dict[str, Law]:
    """The adaptive law with the gains that have the margins on that drive, and ours as a rig of this suit has it."""
    law, chosen = LAWS["adaptive"], gains("suit" if drive == "PD" else "suit_integral")
    worn = suit(suit_fit())
    known = knowledge_of(worn._replace(motor=worn.motor._replace(integral=DRIVES[drive])))
    return {
        "adaptive": law.with_gains(**(law.gains._asdict() | chosen)),
        "ours": configured(LAWS["bowden"], known, preset="suit"),
    }


@dataclass(frozen=True)
class Uncompensated:
    """The suit without compensation, of its second flexion."""

    energy: float
    """[J]"""
    error: float
    """Largest [deg]."""
    delay: float
    """Shift that makes reference and elbow agree best [s]."""


def uncompensated(fit: SuitCalibration, period: float | None = None) -> Uncompensated:
    """Two flexions, of which the second has forgotten how the run began."""
    trace = run_suit(LAWS["uncompensated"], count=2, period=period, fit=fit)
    late = delay(trace.time, trace["reference"], trace["joint"])
    last = -1 if period is None else 0  # energies are of whole flexions of 25 s
    return Uncompensated(
        float(energies(trace)[last]),
        float(largest_errors(trace)[last]),
        float("nan") if late is None else late,
    )


@dataclass(frozen=True)
class Five:
    """Five flexions under a law."""

    trace: Trace
    energy: float
    """Mean of the five [J]."""
    spread: float
    """Standard deviation of the five [J]."""
    mean: float
    """Largest error of the mean of the five profiles after the first second: Fig. 17 shows the mean [deg]."""
    first: float
    """Largest error of the first flexion, whose estimates begin at zero [deg]."""
    worst: float
    """Of the five [deg]."""
    last: float
    """Of the fifth [deg]."""


def five_flexions(law: Law, integral: float | None = None, fit: SuitCalibration | None = None) -> Five:
    """Five flexions from rest.

    Args:
        law: with its gains.
        integral: of the drive's position loop; the calibration's where it is not given [1/s].
        fit: the calibration; the paper's where none is given.
    """
    trace = run_suit(law, fit=fit or suit_fit(), drive_integral=integral)
    used, largest = energies(trace), largest_errors(trace)
    return Five(
        trace,
        float(used.mean()),
        float(used.std()),
        mean_error(trace),
        float(largest[0]),
        float(largest.max()),
        float(largest[-1]),
    )


@cache
def suit_uncompensated() -> Five:
    """Fig. 17 without compensation, made once."""
    return five_flexions(LAWS["uncompensated"])


@cache
def suit_fives() -> dict[tuple[str, str], Five]:
    """Fig. 17 by drive and law: PD and integral, the adaptive law and ours; made once."""
    return {
        (drive, name): five_flexions(law, integral)
        for drive, integral in DRIVES.items()
        for name, law in laws_on(drive).items()
    }


BRAKE = HoldingBrake(holding_torque=0.15)
"""The outlook's clutch: as much as slips before the cable pulls 150 N, the supervisor's limit; the rest as usual."""

RESTS = (0.0, 10.0)
"""At 90° in each flexion: none, as in Fig. 17, and so long [s]."""


@dataclass(frozen=True)
class Rested:
    """Five flexions, each with a rest at 90°; means of one."""

    motor: float
    """Energy of the motor [J]."""
    brake: float
    """Energy of the brake [J]."""
    released: float
    """Time in which the brake takes current [s]."""
    error: float
    """Largest error of the last three [deg]."""


def rested(law: Law, integral: float, rest: float, brake: HoldingBrake = NO_BRAKE) -> Rested:
    """Five flexions of 12.5 s with rests of so long [s], and extensions of 12.5 s."""
    one = 25.0 + rest
    at = [k * one + t for k in range(5) for t in ((0.0, 12.5, 12.5 + rest) if rest else (0.0, 12.5))] + [5.0 * one]
    to = [angle * RADIANS for _ in range(5) for angle in ((0.0, 90.0, 90.0) if rest else (0.0, 90.0))] + [0.0]
    reference = PointToPoint(tuple(at), tuple(to))
    trace = run_suit(law, reference=reference, duration=5.0 * one, fit=suit_fit(), drive_integral=integral, brake=brake)
    phase = trace["brake"] if brake.enabled else np.full(len(trace), ENGAGING)
    engaged = (phase == ENGAGING) | (phase == HELD)
    return Rested(
        float(np.trapezoid(trace.power()[1], trace.time)) / 5.0,
        float(np.trapezoid(brake_power(brake, phase), trace.time)) / 5.0 if brake.enabled else 0.0,
        one * float(np.mean(~engaged)),
        float(np.max(np.abs(trace.error[trace.time > 2.0 * one]))) * DEGREES,
    )


def mean_error(trace: Trace, after: float = 1.0) -> float:
    """Largest error of the mean profile of all flexions of a run, `after` [s] [deg]."""
    parts = each_flexion(trace)
    mean = np.mean([trace["joint"][part] for part in parts], axis=0) - trace["reference"][parts[0]]
    return float(np.max(np.abs(mean[round(after / (trace.time[1] - trace.time[0])) :]))) * DEGREES


@dataclass(frozen=True)
class TimedMotions:
    """Two slow flexions, then flexion and extension in turn, each begun as by a contraction; a `Trajectory`."""

    duration: float
    """Of a motion [s]."""

    @property
    def length(self) -> float:
        """Of the whole course [s]."""
        return LEARNING + MOTIONS * (self.duration + PAUSE)

    def starts(self) -> list[float]:
        """When each motion begins [s]."""
        return [LEARNING + k * (self.duration + PAUSE) for k in range(MOTIONS)]

    def sample(self, time: Array) -> Array:
        """Position, velocity, acceleration (n, 3)."""
        since = np.maximum(time - LEARNING, 0.0)
        k = np.floor(since / (self.duration + PAUSE))
        at = np.clip(since - k * (self.duration + PAUSE), 0.0, self.duration)
        up = np.mod(k, 2.0) == 0.0
        begin, end = np.where(up, 0.0, 90.0) * RADIANS, np.where(up, 90.0, 0.0) * RADIANS
        motion = np.stack(minimum_jerk_over(begin, end, np.full(len(time), self.duration), at), axis=1)
        return np.where((time < LEARNING)[:, None], flexions().sample(time), motion)

    def describe(self) -> dict[str, Any]:
        """What this trajectory is."""
        return {"kind": "timed_motions", "learning": LEARNING, "duration": self.duration}


@dataclass(frozen=True)
class Motions:
    """Motions of Fig. 19 under a law: error, and its delay in three readings."""

    error: float
    """Largest after the first second of each, worst of seven [deg]."""
    current: float
    """Until the motor's current has changed by `RISEN`, median [s]."""
    shift: float
    """Shift that makes reference and elbow agree best over all motions [s]."""
    moved: float
    """Until the elbow has moved by `MOVED_DEG`, median [s]."""


def measure_motions(trace: Trace, starts: list[float]) -> Motions:
    """Error and delays of motions that begin at `starts` [s]."""
    if not np.isfinite(trace["joint"]).all():  # it ran away
        return Motions(*[float("nan")] * 4)
    step = float(trace.time[1] - trace.time[0])
    edges = [round(start / step) for start in starts] + [len(trace)]
    error, current, moved = [], [], []
    count = round(SMOOTH / step)
    total = np.cumsum(trace["current"])
    mean = np.concatenate([np.zeros(count), total[count:] - total[:-count]]) / count
    for begin, end in itertools.pairwise(edges):
        joint = trace["joint"][begin:end]
        current.append(_first(np.abs(mean[begin:end] - mean[begin]) >= RISEN) * step)
        way = np.sign(trace["reference"][end - 1] - trace["reference"][begin])
        moved.append(_first(way * (joint - joint[0]) * DEGREES >= MOVED_DEG) * step)
        error.append(np.max(np.abs(trace.error[begin + round(1.0 / step) : end])) * DEGREES)
    late = delay(trace.time[edges[0] :], trace["reference"][edges[0] :], trace["joint"][edges[0] :])
    return Motions(
        float(max(error)),
        float(np.median(current)),
        float("nan") if late is None else late,
        float(np.median(moved)),
    )


def _first(so: NDArray[np.bool_]) -> float:
    return float(np.argmax(so)) if so.any() else float("inf")


def motions_of(law: Law, duration: float, integral: float | None = None, fit: SuitCalibration | None = None) -> Motions:
    """Seven motions of `duration` [s], each begun by an ideal trigger."""
    asked = TimedMotions(duration)
    trace = run_suit(law, reference=asked, duration=asked.length, drive_integral=integral, fit=fit or suit_fit())
    return measure_motions(trace, asked.starts())
