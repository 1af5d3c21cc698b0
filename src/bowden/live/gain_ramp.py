"""Gains that are changed while the law runs, as the loop goes over to them.

A change goes from the value in force to the one that was asked for in a straight line within `RAMP`, a step a cycle.
The loop takes what is asked for only of gains that the law declares live, within their limits, and one change after the
other: what is asked for while another change goes on waits for its end. All else about a change (who may ask, and
whether the gains hold) is the operator's side's: `live.session`.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.core.nested import leaves, name_of, quantity_at
from bowden.live.control_block import ControlBlock

RAMP = 0.5
"""From the value in force to the one that was asked for [s]."""
IN_FORCE, ASKED = "gain.", "asked."
"""What the columns' names begin with: the value with which the law ran in this cycle, and the one it goes over to."""


class GainRamp:
    """The live gains of a run.

    Args:
        law: with the gains with which the run begins.
        row: all of the law's gains, flat, as the cycle reads them; it is written.
        period: length of a cycle [s].
    """

    def __init__(self, law: Law, row: NDArray[np.float64], period: float) -> None:
        order, self._count = list(law.numbers), max(1, round(RAMP / period))
        self._row, self._places = row, [order.index(name) for name in law.live]
        self._limits = [law.limits[name] for name in law.live]
        self._left, self._which, self._start = 0, 0, 0.0
        begun = [float(law.numbers[name]) for name in law.live]
        self.recorded = [*begun, *begun]
        """Values in force, then those asked for, in the order of `columns`."""

    @property
    def count(self) -> int:
        """Gains that the law declares live."""
        return len(self._places)

    @property
    def going(self) -> bool:
        """True if a change is not finished."""
        return self._left > 0

    def take(self, which: int, value: float) -> None:
        """Begin a change; what is no live gain, or beyond its limits, is none.

        Args:
            which: its place in `Law.live`.
            value: in the unit of the law.
        """
        if not 0 <= which < len(self._places):
            return
        low, high = self._limits[which]
        if not low <= value <= high:
            return  # nor is what is no number
        self._which, self._left, self._start = which, self._count, self.recorded[which]
        self.recorded[len(self._places) + which] = value

    def go_on(self, cycles: int) -> None:
        """Go on with a change.

        Args:
            cycles: since the step before; more than 1 where deadlines were skipped.
        """
        which, goal = self._which, self.recorded[len(self._places) + self._which]
        self._left = max(0, self._left - cycles)
        share = 1.0 - self._left / self._count
        value = self._start + share * (goal - self._start) if self._left else goal
        self.recorded[which] = self._row[self._places[which]] = value


def step_all(ramps: Sequence[GainRamp], block: ControlBlock, cycles: int) -> None:
    """Take what is asked for, or go on with what was: one change at a time.

    The place of a gain is that among the live gains of all motors, one motor after the other.

    Args:
        ramps: of the motors, in their order.
        block: the operator's words.
        cycles: see `GainRamp.go_on`.
    """
    waits = block.gain_waits and not any(ramp.going for ramp in ramps)
    for ramp in ramps:
        if ramp.going:
            ramp.go_on(cycles)
    if waits:
        which, value = block.take_gain()
        for ramp in ramps:
            if 0 <= which < ramp.count:
                ramp.take(which, value)
                return
            which -= ramp.count


def columns(law: Law) -> dict[str, str]:
    """Column → unit of a law's live gains; nothing for a law without any."""
    units = {}
    for path, _ in leaves(law.gains):
        quantity = quantity_at(law.gains, path)
        if quantity is not None and quantity.live:
            units[name_of(path)] = quantity.unit.replace("–", "1")
    return {f"{part}{name}": unit for part in (IN_FORCE, ASKED) for name, unit in units.items()}


def in_force(row: Mapping[str, float]) -> dict[str, float]:
    """The live gains that a row of a run says are in force."""
    return {name.removeprefix(IN_FORCE): value for name, value in row.items() if name.startswith(IN_FORCE)}
