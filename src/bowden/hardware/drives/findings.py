"""What a driver finds out by itself, beside what the drive says: codes of `DriveReading.emergency`, with their text."""

import math
from collections.abc import Mapping

INERT, LEFT, LOST_RANGE = 0xFE01, 0xFE02, 0xFE03
"""Codes that no family uses for an error of its own."""

FINDINGS: Mapping[int, str] = {
    INERT: "the motor is inert: the drive reports no fault and answers, but neither turns nor draws current; check the "
    "motor's phases, its supply and its calibration",
    LEFT: "the drive has left its mode by itself and reports no fault; check its supply and its own limits",
    LOST_RANGE: "the motor has left the range that the drive's position can show",
}
"""Code → what it means and what to do."""


class InertWatch:
    """Sees a motor that gives no torque although the drive answers and reports no fault.

    It is inert when for `lasting` it was asked for a torque that it did not give, and stood still meanwhile: a motor
    that turns, or that is held with a current, is not. What counts as asked in vain is the family's to say.

    Args:
        still: an angle within which a motor stands still, above its encoder's noise [rad].
        lasting: for how long, below the 50 ms after which it must be off [s].
    """

    def __init__(self, still: float, lasting: float = 20e-3) -> None:
        self._still, self._lasting = still, lasting
        self.begin()

    def begin(self) -> None:
        """Nothing has been seen."""
        self._since = self._at = math.nan

    def inert(self, position: float, now: float, *, in_vain: bool) -> bool:
        """Whether it is, at `now` [s].

        Args:
            position: of the motor [rad].
            now: [s]
            in_vain: whether it is asked for a torque, and gives none.
        """
        if not in_vain or not abs(position - self._at) <= self._still:
            self._since, self._at = (now, position) if in_vain else (math.nan, math.nan)
        return now - self._since >= self._lasting
