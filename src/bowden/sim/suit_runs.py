"""Runs of the paper's suit, and what of them its rows say."""

import itertools

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk, Trajectory
from bowden.core.units import DEGREES, RADIANS
from bowden.models.drive.holding_brake import HoldingBrake
from bowden.plants.presets.paper import document
from bowden.plants.presets.suit import SuitCalibration, suit
from bowden.records.trace import Trace
from bowden.sim.run import simulate


def suit_adaptive() -> Law:
    """The adaptive law with the gains that were chosen for margin on the suit (docs/background/suit.md)."""
    return LAWS["adaptive"].preset("suit")


def suit_adaptive_integral() -> Law:
    """The same where the drive has an integral, whose lag leaves half the κ; both calibrations have this choice."""
    return suit_adaptive().with_gains(error_gain=0.03, feedback_gain=1.5, smoothing=0.2)


def suit_ours() -> Law:
    """Our own law, with its gains for the suit."""
    return LAWS["bowden"].preset("suit")


def knowing_drive(law: Law, integral: float) -> Law:
    """The law told of the drive's integral [1/s], where it has a gain for it."""
    return law.with_gains(servo_integral=integral) if "servo_integral" in law.from_rig else law


DRIVE_INTEGRAL = 25.0
"""k_i of a drive whose position loop has an integral, with which our law runs: 12 dB below that loop's limit, which is
2·ζ·ω = 107 1/s [1/s]."""
FRICTION_FEEDFORWARD = 2.79
"""What our stack's drive pushes against friction: 0.7 of the 3.99 N·m that the uncompensated run shows (half of what
its torques up and down differ by at one angle), so that it is not more than there is where friction is 30 % less
[N·m]."""


NO_BRAKE = HoldingBrake()


def flexions(period: float | None = None) -> PeriodicMinimumJerk:
    """Flexions and extensions 0–90°; one takes 25 s (Fig. 17) where no `period` [s] is given."""
    return PeriodicMinimumJerk(
        0.0, 90.0 * RADIANS, document()["suit"]["chosen"]["period"] if period is None else period
    )


def run_suit(
    law: Law,
    *,
    count: int = 5,
    period: float | None = None,
    fit: SuitCalibration | None = None,
    reference: Trajectory | None = None,
    duration: float | None = None,
    drive_integral: float | None = None,
    friction_feedforward: float = 0.0,
    brake: HoldingBrake = NO_BRAKE,
) -> Trace:
    """A run of the suit from rest.

    Args:
        law: with its gains.
        count: of flexions.
        period: of one of them [s].
        fit: in place of the frozen calibration.
        reference: in place of the flexions.
        duration: with it [s].
        drive_integral: of the drive's position loop; the calibration's where it is not given [1/s].
        friction_feedforward: of the drive, which the paper's has not [N·m].
        brake: of the drive, likewise.
    """
    made, motion = suit(fit), reference or flexions(period)
    made = made._replace(motor=made.motor._replace(friction_feedforward=friction_feedforward), brake=brake)
    if drive_integral is not None:
        made = made._replace(motor=made.motor._replace(integral=drive_integral))
    one = document()["suit"]["chosen"]["period"] if period is None else period
    length = count * one if duration is None else duration
    law = knowing_drive(law, made.motor.integral)
    return simulate(made, law, motion, duration=length, seed=document()["chosen"]["seed"])


def each_flexion(trace: Trace, period: float | None = None) -> list[slice]:
    """The samples of each whole flexion and extension of a run."""
    length = document()["suit"]["chosen"]["period"] if period is None else period
    step = float(trace.time[1] - trace.time[0])
    edges = [round(k * length / step) for k in range(int(len(trace) * step / length + 1e-6) + 1)]
    return [slice(start, end) for start, end in itertools.pairwise(edges)]


def energies(trace: Trace) -> NDArray[np.float64]:
    """∫Pe dt of each flexion and extension (Eq. 18), (k,) [J]."""
    electrical = trace.power()[1]
    return np.array([np.trapezoid(electrical[part], trace.time[part]) for part in each_flexion(trace)])


def largest_errors(trace: Trace, after: float = 1.0) -> NDArray[np.float64]:
    """The largest |joint − reference| of each flexion, without its first second, (k,) [deg]."""
    skip = round(after / float(trace.time[1] - trace.time[0]))
    return np.array([np.max(np.abs(trace.error[part][skip:])) * DEGREES for part in each_flexion(trace)])
