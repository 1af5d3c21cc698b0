"""The exponential of matrices."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TERMS = 16
"""Of the series; of a part of norm ¼, the next is 5e-24."""


def exponential(matrix: Array) -> Array:
    """e^matrix by its series on a part of it, squared; (…, n, n). All NaN where a number is not finite.

    SciPy's `expm` gives the same, which a test compares; to import it takes longer than a whole check.

    >>> exponential(np.array([[0.0, 1.0], [0.0, 0.0]]))
    array([[1., 1.],
           [0., 1.]])
    >>> exponential(np.array([[np.inf]]))
    array([[nan]])
    """
    size = float(np.abs(matrix).sum(axis=-2).max(initial=0.0))
    if not np.isfinite(size):
        return np.full(matrix.shape, np.nan)
    halvings = max(0, int(np.ceil(np.log2(max(size, 1e-300)))) + 2)
    part = matrix / 2.0**halvings
    term = found = np.broadcast_to(np.eye(matrix.shape[-1]), matrix.shape)
    for k in range(1, _TERMS):
        term = term @ part / k
        found = found + term
    for _ in range(halvings):
        found = found @ found
    return np.asarray(found)
