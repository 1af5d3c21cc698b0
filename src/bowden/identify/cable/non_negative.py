"""Non-negative least squares by active sets.

Source: Lawson and Hanson, *Solving Least Squares Problems*, 1974, Chapter 23.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def non_negative(matrix: Array, wanted: Array) -> Array:
    """The x ≥ 0 (n,) that minimises |A·x − b|².

    SciPy's `nnls` finds the same, which a test compares; to import it takes half a second.

    Args:
        matrix: A (m, n).
        wanted: b (m,).
    """
    count = matrix.shape[1]
    x, free = np.zeros(count), np.zeros(count, dtype=bool)
    smallest = 1e-14 * float(np.abs(matrix.T @ wanted).max(initial=0.0))
    for _ in range(3 * count):
        descent = np.where(free, -np.inf, matrix.T @ (wanted - matrix @ x))
        entering = int(np.argmax(descent))
        if not descent[entering] > smallest:
            break
        free[entering] = True
        while True:
            best = np.zeros(count)
            best[free] = np.linalg.lstsq(matrix[:, free], wanted, rcond=None)[0]
            blocked = free & (best <= 0.0)
            if not blocked.any():
                x = best
                break
            shares = x[blocked] / (x[blocked] - best[blocked])
            x = x + float(shares.min()) * (best - x)
            free &= x > 1e-15 * float(x.max())
            x[~free] = 0.0
    return x
