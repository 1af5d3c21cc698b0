"""A model counted from other zeros, or with its motor counted the other way: from a log's angles to a rig's.

A log counts its angles from where its encoders happened to be zero. A rig counts from where its cable is just taut, and
counts its motor so that the joint follows in the same direction; limits and supervisor build on that. With the motor's
direction d and the zeros m₀ and j₀ a rig has

    motor = d·(motor of the log − m₀),    joint = joint of the log − j₀

and the same cable has other parameters: `bowden.plants.recounted`.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

from bowden.core.quantity import Quantity

MODEL_FILE = "model.toml"
"""Name of the file of an identified cable that came from none."""


class Counting(NamedTuple):
    """How a rig counts the angles of a log."""

    direction: Annotated[
        Literal[1, -1],
        Quantity("of a model: -1 where this rig counts its motor the other way round than the log", key="direction"),
    ] = 1
    motor_zero: Annotated[
        float, Quantity("of a model: motor angle of its log that is zero here", "rad", ge=-36000.0, le=36000.0)
    ] = 0.0
    joint_zero: Annotated[
        float, Quantity("of a model: joint angle of its log that is zero here", "rad", ge=-36000.0, le=36000.0)
    ] = 0.0

    @property
    def as_recorded(self) -> bool:
        """True if the rig counts as the log does."""
        return self == Counting()


class Covered(NamedTuple):
    """The motion that a log covered; beyond it a model says what nothing was seen of."""

    motor_low: float
    """[rad]"""
    motor_high: float
    """[rad]"""
    joint_low: float
    """[rad]"""
    joint_high: float
    """[rad]"""

    def counted(self, counting: Counting) -> "Covered":
        """The same motion as a rig counts it."""
        ends = sorted(counting.direction * (one - counting.motor_zero) for one in (self.motor_low, self.motor_high))
        joint = (one - counting.joint_zero for one in (self.joint_low, self.joint_high))
        return Covered(*ends, *joint)


class Encoders(NamedTuple):
    """How the encoders of a log read."""

    motor: float = 0.0
    """One count; 0 where nobody said it [rad]."""
    joint: float = 0.0
    """The same [rad]."""
    joint_late: float = 0.0
    """By how much the joint was read later than the motor, as far as the log shows it [s]."""

    def late_cycles(self, sample_time: float) -> int:
        """`joint_late` in whole cycles of that length [s], rounded up; what is left of rounding is no cycle."""
        return math.ceil(round(self.joint_late / sample_time, 9))


NOT_SAID = Encoders()


def covered_by(all_of: Sequence[Covered]) -> Covered:
    """Range that several logs cover together, as if nothing lay between them."""
    low = (min(one[k] for one in all_of) for k in (0, 2))
    high = (max(one[k] for one in all_of) for k in (1, 3))
    (motor_low, joint_low), (motor_high, joint_high) = low, high
    return Covered(motor_low, motor_high, joint_low, joint_high)
