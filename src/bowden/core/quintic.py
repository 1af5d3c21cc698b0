"""A quintic spline through points: continuous up to its fourth derivative, so that its acceleration is smooth.

The spline is Σ cᵢ·Bᵢ(x) with B-splines of degree five on the points themselves as knots, without the two next to either
end ("not a knot"). The cᵢ follow from s(xᵢ) = yᵢ, equations with a few terms beside the diagonal; their matrix
is totally positive, so that elimination needs no exchange of rows.

SciPy's `make_interp_spline` gives the same, which a test compares.

Source: de Boor, *A Practical Guide to Splines*, Springer 1978, Chapters X and XIII.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEGREE = 5
_LEFT, _RIGHT = 4, 4
"""Terms of an equation beside its diagonal: four next to the ends, two elsewhere."""


class QuinticSpline:
    """Through points, with its derivatives.

    Args:
        x: increasing (n,), six or more.
        y: (n,).

    >>> x = np.linspace(0.0, 1.0, 9)
    >>> values = QuinticSpline(x, x**5)(np.array([0.3, 0.7]), 2)
    >>> np.round(values, 9)
    array([0.54, 6.86])
    """

    def __init__(self, x: Array, y: Array) -> None:
        inner = x[(_DEGREE + 1) // 2 : -((_DEGREE + 1) // 2)]
        self._knots = np.concatenate([np.repeat(x[0], _DEGREE + 1), inner, np.repeat(x[-1], _DEGREE + 1)])
        self._coefficients = [_interpolating(self._knots, x, y)]

    def __call__(self, x: Array, derivative: int = 0) -> Array:
        """The spline, or a derivative of it, at `x` (m,) within its points, (m,)."""
        degree = _DEGREE - derivative
        knots = self._knots[derivative : len(self._knots) - derivative]
        values, first = _splines(knots, degree, x)
        chosen = self._of(derivative)[first[:, None] + np.arange(degree + 1)]
        return np.asarray((values * chosen).sum(axis=1))

    def _of(self, derivative: int) -> Array:
        """Coefficients of a derivative, a spline on the same knots with one less at either end."""
        while len(self._coefficients) <= derivative:
            done = len(self._coefficients)
            degree, knots = _DEGREE - done + 1, self._knots[done : len(self._knots) - done]
            before = self._coefficients[-1]
            self._coefficients.append(degree * np.diff(before) / (knots[degree:] - knots[:-degree]))
        return self._coefficients[derivative]


def _splines(knots: Array, degree: int, x: Array) -> tuple[Array, NDArray[np.intp]]:
    """The B-splines that are not zero at `x`, (m, degree + 1), and the number of the first of them, (m,)."""
    place = np.searchsorted(knots, x, side="right") - 1
    place = np.clip(place, degree, len(knots) - degree - 2)
    values = np.zeros((len(x), degree + 1))
    values[:, 0] = 1.0
    for k in range(1, degree + 1):
        carried = np.zeros(len(x))
        for j in range(k):
            right, left = knots[place + j + 1], knots[place + j + 1 - k]
            share = values[:, j] / (right - left)
            values[:, j] = carried + (right - x) * share
            carried = (x - left) * share
        values[:, k] = carried
    return values, place - degree


def _interpolating(knots: Array, x: Array, y: Array) -> Array:
    """Coefficients of the spline through the points (n,)."""
    values, first = _splines(knots, _DEGREE, x)
    n, width = len(x), _LEFT + 1 + _RIGHT
    at = first[:, None] + np.arange(_DEGREE + 1) - np.arange(n)[:, None] + _LEFT
    within = (at >= 0) & (at < width)  # beyond there are the ones that are zero at a knot
    band = np.zeros((n, width))
    band[np.nonzero(within)[0], at[within]] = values[within]
    rows, right = band.tolist(), np.asarray(y, dtype=np.float64).tolist()
    for i, row in enumerate(rows):
        for below in range(1, min(_LEFT, n - 1 - i) + 1):
            under = rows[i + below]
            factor = under[_LEFT - below] / row[_LEFT]
            if factor != 0.0:
                for j in range(1, _RIGHT + 1):
                    if row[_LEFT + j] != 0.0:
                        under[_LEFT - below + j] -= factor * row[_LEFT + j]
                right[i + below] -= factor * right[i]
    found = [*right, *([0.0] * _RIGHT)]
    for i in range(n - 1, -1, -1):
        row = rows[i]
        known = sum(row[_LEFT + j] * found[i + j] for j in range(1, _RIGHT + 1))
        found[i] = (right[i] - known) / row[_LEFT]
    return np.array(found[:n])
