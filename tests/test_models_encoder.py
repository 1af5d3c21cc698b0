"""Encoders: counts, noise, and the ideal one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.models.drive.encoder import Encoder, reading

angles = st.floats(-100.0, 100.0)


@given(angles, st.floats(-5.0, 5.0))
def test_without_resolution_and_noise_it_shows_the_angle(angle: float, normal: float) -> None:
    assert reading(angle, normal, Encoder()) == angle


@given(angles, st.floats(1e-5, 0.1))
def test_it_counts(angle: float, resolution: float) -> None:
    shown = reading(angle, 0.0, Encoder(resolution))
    assert abs(shown - angle) <= 0.5 * resolution * (1.0 + 1e-9)
    assert shown / resolution == pytest.approx(round(shown / resolution), abs=1e-6)


@given(angles, st.floats(0.0, 1.0), st.floats(1e-4, 0.1))
def test_it_never_falls_while_the_angle_rises(angle: float, more: float, resolution: float) -> None:
    assert reading(angle + more, 0.3, Encoder(resolution)) >= reading(angle, 0.3, Encoder(resolution))


@pytest.mark.parametrize(("resolution", "noise"), [(0.0, 2e-3), (1e-3, 0.0), (1e-3, 2e-3), (4e-4, 1e-4)])
def test_statistics(resolution: float, noise: float) -> None:
    """No bias; the variance is the noise's plus a count's, resolution²/12."""
    random = np.random.default_rng(0)
    angle, normal = random.uniform(-1.0, 1.0, 50_000), random.standard_normal(50_000)
    encoder = Encoder(resolution, noise)
    error = np.array([reading(a, n, encoder) - a for a, n in zip(angle.tolist(), normal.tolist(), strict=True)])
    spread = np.sqrt(noise**2 + resolution**2 / 12.0)
    assert abs(error.mean()) < 4.0 * spread / np.sqrt(error.size)
    assert error.std() == pytest.approx(spread, rel=0.02)
