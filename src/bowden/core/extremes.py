"""The smaller and the larger of two numbers, by one comparison; ``np.fmin`` and ``np.fmax`` need two for NaN's sake.

A NaN that stands second stays one, where ``np.fmin`` and ``np.fmax`` give the first: a bound must be a number.
"""

from bowden.core.kernel import kernel, sel


@kernel
def smaller(a: float, b: float) -> float:
    """The smaller of two; `b` where one is no number, so that a bound stands second.

    >>> smaller(1.0, 2.0), smaller(float("nan"), 2.0)
    (1.0, 2.0)
    """
    return sel(a < b, a, b)


@kernel
def larger(a: float, b: float) -> float:
    """The larger of two; `b` where one is no number.

    >>> larger(1.0, 2.0), larger(float("nan"), 2.0)
    (2.0, 2.0)
    """
    return sel(a > b, a, b)
