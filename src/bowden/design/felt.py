"""What a wearer feels of a suit: its torque on the elbow less the share of the arm's weight that it carries.

The first four seconds, or half of a shorter run, do not count.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES
from bowden.models.suit.arm import GRAVITY, Arm
from bowden.records.metrics import rmse
from bowden.records.trace import Trace

Array = NDArray[np.float64]

SETTLED = 4.0
"""What comes before, or before half of a shorter run, does not count in what a wearer feels [s]."""


@dataclass(frozen=True)
class Felt:
    """What a wearer felt of the suit."""

    rms: float
    """Of the suit's torque less what it is to carry [N·m]."""
    peak: float
    """The same [N·m]."""
    low: float
    """Least angle of the elbow [deg]."""
    high: float
    """Largest [deg]."""
    estimate: float | None
    """RMS error of the estimated torque; None where nothing was estimated [N·m]."""
    by_current: float | None
    """The same of the estimate from the current alone [N·m]."""
    by_stretch: float | None
    """The same of the estimate from both angles alone [N·m]."""


def settled(time: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Which samples of a run count, from their times since its begin (n,) [s]."""
    return time >= min(SETTLED, 0.5 * float(time[-1]))


def beside_load(torque: Array, joint: Array, arm: Arm, carried: float) -> Array:
    """The suit's torque on the elbow less what it is to carry (n,) [N·m].

    Args:
        torque: of the suit on the elbow (n,) [N·m].
        joint: angle of the elbow (n,) [rad].
        arm: whose weight that is.
        carried: share of it that the suit holds up [–].
    """
    return torque - carried * GRAVITY * arm.mass * arm.centre * np.sin(joint + arm.elevation)


def rms_and_peak(values: Array) -> tuple[float, float]:
    """Root mean square and largest size."""
    return rmse(values), float(np.max(np.abs(values)))


def felt(trace: Trace, arm: Arm, carried: float = 0.0) -> Felt:
    """The figures of a run."""
    tail = settled(trace.time)
    joint, torque = trace["joint"][tail], trace["interaction_torque"][tail]
    rms, peak = rms_and_peak(beside_load(torque, joint, arm, carried))
    names = ("torque", "from_current", "from_stretch")
    have = "admittance.estimate.torque" in trace.columns
    errors = [rmse(trace[f"admittance.estimate.{name}"][tail] - torque) if have else None for name in names]
    return Felt(
        rms,
        peak,
        float(np.min(joint)) * DEGREES,
        float(np.max(joint)) * DEGREES,
        *errors,
    )
