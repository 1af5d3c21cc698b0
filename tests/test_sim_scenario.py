"""Paths of the sheath: through their way points, smooth, and repeatable."""

import numpy as np
import pytest

from bowden.core.errors import ParameterError
from bowden.models.cable.sheath_path import constant_bend, random_bend, scripted_bend

TIME = np.linspace(0.0, 60.0, 60_001)


def test_constant() -> None:
    assert constant_bend(1.5)(TIME).tolist() == [1.5] * len(TIME)


def test_scripted_passes_its_points_at_rest_and_holds_outside() -> None:
    times, bends = [10.0, 20.0, 25.0, 40.0], [1.0, 3.0, 3.0, 2.0]
    path = scripted_bend(times, bends)
    np.testing.assert_allclose(path(np.array(times)), bends, atol=1e-12)
    assert path(np.array([-5.0, 0.0, 100.0])).tolist() == [1.0, 1.0, 2.0]
    bend = path(TIME)
    assert bend.min() >= 1.0
    assert bend.max() <= 3.0
    rate = np.gradient(bend, TIME)
    acceleration = np.gradient(rate, TIME)
    assert np.abs(rate[np.searchsorted(TIME, times)]).max() < 1e-5
    assert np.abs(np.diff(acceleration)).max() < 0.01 * np.abs(acceleration).max()  # no jump
    assert np.abs(rate).max() == pytest.approx(1.875 * 2.0 / 10.0, rel=1e-3)


def test_random_stays_in_its_range_and_repeats_with_its_seed() -> None:
    first, again, other = (random_bend(1.0, 4.0, 2.0, 60.0, seed)(TIME) for seed in (3, 3, 4))
    assert first.tolist() == again.tolist()
    assert first.tolist() != other.tolist()
    assert 1.0 <= first.min() < 2.0
    assert 3.0 < first.max() <= 4.0
    rate = np.gradient(first, TIME)
    assert 0.1 < np.abs(rate).max() <= 1.875 * 3.0 / 2.0
    assert np.abs(rate[-5000:]).max() > 0.0  # it lasts


@pytest.mark.parametrize(
    "build",
    [
        lambda: scripted_bend([0.0], [1.0]),
        lambda: scripted_bend([0.0, 1.0], [1.0]),
        lambda: scripted_bend([1.0, 0.0], [1.0, 2.0]),
        lambda: scripted_bend([0.0, 1.0], [1.0, -2.0]),
        lambda: scripted_bend([0.0, 1.0], [1.0, float("nan")]),
        lambda: random_bend(0.0, 1.0, 1.0, 1.0, 0),
        lambda: random_bend(2.0, 1.0, 1.0, 1.0, 0),
        lambda: random_bend(1.0, 2.0, 0.0, 1.0, 0),
        lambda: random_bend(1.0, 2.0, 1.0, float("nan"), 0),
    ],
)
def test_absurd_paths_are_refused(build) -> None:
    with pytest.raises(ParameterError, match="expected"):
        build()
