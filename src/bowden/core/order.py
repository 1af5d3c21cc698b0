"""Sorted values: each once, the one in the middle, and the one that a share of them does not exceed.

NumPy has the same to the bit; but its `unique`, `median` and `quantile` import masked arrays, which takes a fiftieth of
a second at the start of a command.
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)


def distinct(values: NDArray[Number]) -> NDArray[Number]:
    """The values of an array (n,), sorted and each once.

    >>> distinct(np.array([3, 1, 3, 2])).tolist()
    [1, 2, 3]
    """
    ordered = np.sort(values)
    return ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])] if len(ordered) else ordered


def median(values: NDArray[np.float64]) -> float:
    """The median of one or more finite numbers (n,).

    >>> median(np.array([4.0, 1.0, 2.0])), median(np.array([4.0, 1.0]))
    (2.0, 2.5)
    """
    half = len(values) // 2
    ordered = np.partition(values, [max(half - 1, 0), half])
    return float(ordered[half] if len(values) % 2 else 0.5 * (ordered[half - 1] + ordered[half]))


def quantile(values: NDArray[np.float64], share: float) -> float:
    """What a `share` of one or more finite numbers (n,) does not exceed, between two of them in proportion.

    >>> quantile(np.array([4.0, 1.0, 2.0]), 0.75)
    3.0
    """
    place = share * (len(values) - 1)
    below = min(int(place), max(len(values) - 2, 0))
    above = min(below + 1, len(values) - 1)
    ordered, part = np.partition(values, [below, above]), place - below
    low, high = float(ordered[below]), float(ordered[above])
    return low + (high - low) * part if part < 0.5 else high - (high - low) * (1.0 - part)
