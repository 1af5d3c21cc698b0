"""Encoders of limited range, followed over their end; and the turn that a hint names."""

import math


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
