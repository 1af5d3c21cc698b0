"""NumPy's order of summation, for compiled code whose sums are to be NumPy's."""

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel, noinline

Array = NDArray[np.float64]


@noinline
def pairwise_sum(values: Array, begin: int, end: int) -> float:
    """The sum of values[begin:end] in the order in which NumPy adds up a row, and so equal to its last bit.

    Halves (the first a multiple of eight long) down to 128 numbers, and in these eight sums side by side.
    """
    ends, sums, depth = np.empty(64, np.int64), np.empty(64), 0
    left = np.zeros(64, np.int64)  # whether a level's first half is being summed, 0, or its second, 1
    start, stop = begin, end
    while True:
        while stop - start > 128:
            half = (stop - start) // 2
            ends[depth], left[depth] = stop, 0
            depth += 1
            stop = start + half - half % 8
        total = _short_sum(values, start, stop)
        while depth > 0 and left[depth - 1] == 1:
            depth -= 1
            total = sums[depth] + total
        if depth == 0:
            return total
        sums[depth - 1], left[depth - 1] = total, 1
        start, stop = stop, ends[depth - 1]


@kernel
def _short_sum(values: Array, start: int, stop: int) -> float:
    """Of at most 128 numbers."""
    n = stop - start
    if n < 8:
        total = 0.0
        for i in range(start, stop):
            total += values[i]
        return total
    r0, r1, r2, r3 = values[start], values[start + 1], values[start + 2], values[start + 3]
    r4, r5, r6, r7 = values[start + 4], values[start + 5], values[start + 6], values[start + 7]
    i = start + 8
    while i < start + n - n % 8:
        r0, r1, r2, r3 = r0 + values[i], r1 + values[i + 1], r2 + values[i + 2], r3 + values[i + 3]
        r4, r5, r6, r7 = r4 + values[i + 4], r5 + values[i + 5], r6 + values[i + 6], r7 + values[i + 7]
        i += 8
    total = ((r0 + r1) + (r2 + r3)) + ((r4 + r5) + (r6 + r7))
    while i < stop:
        total += values[i]
        i += 1
    return total
