"""A load cell between suit and forearm, and how noisy the drive's current is read."""

from typing import NamedTuple

from bowden.core.kernel import kernel


class LoadCell(NamedTuple):
    """How far a reading is off; the defaults are of the size of a good 20 N·m cell: a stated choice."""

    noise: float = 0.03
    """Standard deviation of one reading [N·m]."""
    offset: float = 0.05
    """Error of its zero [N·m]."""
    gain: float = 0.01
    """Error of its scale [–]."""


CURRENT_NOISE = 0.05
"""Standard deviation of one reading of the motor's current: 0.25 % of a drive of 20 A, a stated choice [A]."""


@kernel
def cell_reading(cell: LoadCell, value: float, normal: float) -> float:
    """Reading of the cell at a `value`, given a standard normal number.

    >>> cell_reading(LoadCell(0.5, 0.25, 0.0), 2.0, 1.0)
    2.75
    """
    return value * (1.0 + cell.gain) + cell.offset + cell.noise * normal
