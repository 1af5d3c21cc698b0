"""The searches of the identification."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.identify.cable.projection import minimise


def test_what_the_data_do_not_show_stays_where_it_is() -> None:
    """An unknown without any influence keeps its start, to the bit, though rounding gives it a slope."""
    points = np.linspace(-1.0, 1.0, 50)
    joint = np.tanh(3.0 * points) + 0.5

    def basis(theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        bent = np.tanh(theta[0] * points)
        slopes = np.stack([points * (1.0 - bent**2), 1e-20 * np.cos(9.0 * points)])
        return np.stack([np.ones(50), bent], axis=1), slopes[:, :, None]

    low, high = np.array([0.1, -1.0]), np.array([9.0, 1.0])
    theta, _ = minimise(basis, joint, np.ones(50), np.array([1.0, 0.123]), low, high)
    assert theta[0] == pytest.approx(3.0, rel=1e-6)
    assert theta[1] == 0.123
