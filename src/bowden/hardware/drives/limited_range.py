"""Encoders of limited range, followed over their end; a drive that loses count of turns; the turn that a hint names."""

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


class TurnCount:
    """Sees a drive that has lost count of its motor's turns.

    What it reports is what it controls: it pulls at once, as far as it is wrong. So what one reading of an encoder
    might be forgiven is not here: a change of half a turn that the motor is too slow for.

    Args:
        turn: of the motor, in the drive's unit.
        fastest: speed that the rig allows, in that unit a second; infinite where it says none, and nothing is seen.
    """

    def __init__(self, turn: float, fastest: float) -> None:
        self._turn, self._fastest = turn, fastest
        self.begin()

    def begin(self) -> None:
        """Nothing has been read."""
        self._last = self._at = math.nan

    def lost(self, position: float, now: float) -> bool:
        """Whether it has, by the position that came at `now` [s] and the one before."""
        moved, gap = abs(position - self._last), now - self._at
        self._last, self._at = position, now
        return moved > max(0.5 * self._turn, 1.5 * self._fastest * gap)


def nearest(angle: float, period: float, hint: float) -> float:
    """The angle nearest to `hint` among those that differ from `angle` by whole periods.

    What an encoder that has lost its turns with its supply says, for somebody who knows roughly where it is.

    >>> round(nearest(0.2, 1.0, 3.1), 6)
    3.2
    """
    return angle + period * round((hint - angle) / period)
