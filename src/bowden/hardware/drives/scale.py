"""From an encoder's counts to an angle and back, of any drive, on the bench and on a suit; and the rig's limits
as the drive counts.
"""

import math
from typing import Any, NamedTuple

from bowden.core.kernel import compiled
from bowden.models.suit.suit_angle import SpoolMap, motor_of, spool_of, steepest_spool


class Scale(NamedTuple):
    """The way from an encoder's counts to an angle and back: angle = origin + step · counts."""

    step: float
    """Angle of one count, with its sign [rad]."""
    origin: float
    """Angle at count zero [rad]."""

    def angle(self, counts: float) -> float:
        """Counts to an angle [rad]."""
        return self.origin + self.step * counts

    def counts(self, angle: float) -> float:
        """An angle [rad] to counts, not rounded."""
        return (angle - self.origin) / self.step

    def steepest(self, low: float, high: float) -> float:
        """Turn of the spool per angle, at most, between two angles [rad/rad]."""
        return 1.0


class SuitScale(NamedTuple):
    """The way from counts to the motor's angle in the joint's coordinate and back, through the spool's angle."""

    spool: Scale
    """Counts to the spool's angle."""
    map: SpoolMap

    @property
    def step(self) -> float:
        """Angle of the spool of one count, with its sign [rad]."""
        return self.spool.step

    def angle(self, counts: float) -> float:
        """Counts to an angle [rad]."""
        return float(compiled(motor_of)(self.spool.angle(counts), self.map))

    def counts(self, angle: float) -> float:
        """An angle [rad] to counts, not rounded."""
        return self.spool.counts(float(compiled(spool_of)(float(angle), self.map)))

    def steepest(self, low: float, high: float) -> float:
        """Turn of the spool per angle, at most, between two angles [rad/rad]."""
        return steepest_spool(low, high, self.map)


def motor_scale(drive: Any, counts_at_home: float = 0.0) -> Scale | SuitScale:
    """The motor's counts to the spool's angle, or, on a suit, to the motor's in the joint's coordinate.

    Args:
        drive: its parameters, whose `motor_step` is the angle of the spool of one count, with its sign [rad].
        counts_at_home: what the counter says at home.
    """
    step, home, spool = drive.motor_step, drive.motor_home, drive.needs.spool
    if spool is None:
        return Scale(step, home - step * counts_at_home)
    scale = SuitScale(Scale(step, float(spool_of(home, spool)) - step * counts_at_home), spool)
    scale.angle(scale.counts(0.0))  # compiles, before a loop asks
    return scale


class MotorLimits(NamedTuple):
    """The rig's limits as the drive counts; infinite for none."""

    low: float
    """Position, in the drive's unit."""
    high: float
    speed: float
    """Largest, in its unit a second."""
    current: float
    """Largest [A]."""


def motor_limits(drive: Any, motor: Scale | SuitScale) -> MotorLimits:
    """The rig's limits of a drive, whose parameters are given, by the scale of its motor."""
    needs = drive.needs
    low, high = sorted(
        motor.counts(angle) if math.isfinite(angle) else math.copysign(math.inf, angle * motor.step)
        for angle in (needs.lowest_motor, needs.highest_motor)
    )
    steepest = motor.steepest(needs.lowest_motor, needs.highest_motor)
    speed = needs.speed_limit * steepest / abs(motor.step) if needs.speed_limit > 0.0 else math.inf
    return MotorLimits(low, high, speed, needs.current_limit if needs.current_limit > 0.0 else math.inf)


def feed_velocity(position: float, before: float, sample_time: float, largest: float) -> float:
    """The velocity that leads from the target before to this one; 0 where there is none, as at the first one.

    Args:
        position: the target, in the drive's unit.
        before: the target of the cycle before; NaN for none.
        sample_time: of a cycle [s].
        largest: of the rig, in the drive's unit a second.
    """
    velocity = (position - before) / sample_time
    return max(-largest, min(largest, velocity)) if math.isfinite(velocity) else 0.0


def bounded_torque(torque: float, drive: Any) -> float:
    """A torque offset within the bound of the rig that the drive's parameters have; 0 of what is no number [N·m]."""
    most: float = drive.needs.torque_offset
    return max(-most, min(most, torque)) if math.isfinite(torque) else 0.0


class LimitedRange:
    """Follows a value that begins again at its other end: it has moved the shorter way from one reading to the next.

    Args:
        span: of the range, from one end to the other, in any unit.
    """

    def __init__(self, span: float) -> None:
        self._span = span
        self._last = self._offset = math.nan

    def begin(self) -> None:
        """Nothing has been read: the next reading is taken as it is."""
        self._last = self._offset = math.nan

    def follow(self, value: float) -> float:
        """The reading `value`, within the range, as an angle that goes on; NaN is passed on and changes nothing."""
        if math.isnan(value):
            return value
        if math.isnan(self._last):
            self._last, self._offset = value, 0.0
        moved = value - self._last
        if abs(moved) > 0.5 * self._span:
            self._offset -= math.copysign(self._span, moved)
        self._last = value
        return value + self._offset


def nearest(angle: float, period: float, hint: float) -> float:
    """The angle nearest to `hint` among those that differ from `angle` by whole periods.

    What an encoder that has lost its turns with its supply says, for somebody who knows roughly where it is.

    >>> round(nearest(0.2, 1.0, 3.1), 6)
    3.2
    """
    return angle + period * round((hint - angle) / period)


def found_scale(drive: Any, found: float, turn: float) -> Scale | SuitScale:
    """`motor_scale` of a drive whose home is where it is found, the zero nearest to a hint, or its own zero.

    Args:
        drive: its parameters.
        found: what it counts now.
        turn: that it may have lost with its supply, in counts.
    """
    own = motor_scale(drive)
    if drive.home == "hint":
        return motor_scale(drive, found - nearest(found, turn, own.counts(drive.motor_hint)))
    return motor_scale(drive, found) if drive.home == "here" else own
