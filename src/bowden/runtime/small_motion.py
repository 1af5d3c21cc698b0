"""The preflight's motion: a little out and back, and whether both encoders saw it."""

import math

import numpy as np

from bowden.control.reference import minimum_jerk
from bowden.core.signals import DriveReading

SETTLE, MOVE = 0.3, 0.5
"""Rest before the motion, and the time of each of its halves [s]."""
_REACHED = 0.5
"""Share of the motion that the motor must have made."""
_WRONG = 0.5
"""Share of it that the joint may move the other way: noise, and a cable that gives."""


class SmallMotion:
    """Moves the motor out by `distance` and back.

    Args:
        distance: with the sign that moves away from the nearer limit [rad].
    """

    def __init__(self, distance: float) -> None:
        self._distance = distance
        self.reason = ""
        self.begin(0.0)

    def begin(self, target: float) -> None:
        """The motor stands at `target` [rad]."""
        self._from, self._time, self._outcome, self.reason = target, 0.0, 0.0, ""
        self._motor = self._joint = math.nan
        self._far_motor = self._far_joint = math.nan

    def step(self, reading: DriveReading, enabled: bool, dt: float) -> tuple[float, float]:
        """The motor's target [rad], and 1 passed, −1 failed, 0 not done; time runs while the drive is enabled."""
        if not enabled or self._outcome != 0.0:
            return self._from, self._outcome
        self._time += dt
        moving = self._time - SETTLE
        if moving <= 0.0:
            self._motor, self._joint = reading.motor, reading.joint
            return self._from, 0.0
        there = minimum_jerk(0.0, 1.0, MOVE, moving).position
        back = minimum_jerk(0.0, 1.0, MOVE, moving - MOVE).position
        if moving <= MOVE + 0.05:
            self._far_motor, self._far_joint = reading.motor, reading.joint
        if moving >= 2.0 * MOVE + 0.2:
            self._outcome = self._judge()
        return self._from + self._distance * float(there - back), self._outcome

    def _judge(self) -> float:
        moved = (self._far_motor - self._motor) / self._distance
        followed = (self._far_joint - self._joint) / self._distance
        if not moved > _REACHED:
            self.reason = (
                f"the motor was to move by {np.degrees(self._distance):.1f}° and its encoder saw "
                f"{np.degrees(self._far_motor - self._motor):.1f}°: look at [drive] motor_direction and at its coupling"
            )
        elif not followed > -_WRONG:
            self.reason = (
                f"the joint moved by {np.degrees(self._far_joint - self._joint):.1f}° against the motor: "
                "look at [drive] joint_direction and at how the cable is led"
            )
        return -1.0 if self.reason else 1.0
