"""The suit's geometry: Eqs 1–3, their derivatives, and the spools against a linear programme."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from bowden.core.errors import ParameterError
from bowden.models.suit.geometry import (
    ELBOW_RANGE,
    SuitGeometry,
    extensor_extension,
    extensor_moment_arm,
    flexor_extension,
    flexor_moment_arm,
    size_spools,
    spool_angle,
)

PAPER = SuitGeometry()
geometries = st.builds(
    SuitGeometry, st.floats(0.01, 0.1), st.floats(0.02, 0.2), st.floats(0.01, 0.1), st.floats(0, 1), st.floats(0, 1)
)


def travels(geometry: SuitGeometry, angles: tuple[float, float], count: int = 4001) -> np.ndarray:
    """Flexor's shortening and extensor's lengthening (2, n), from Eqs 1 and 2 as printed."""
    a, b, radius, *_ = geometry
    phi = np.linspace(*angles, count)
    h1 = 2.0 * np.hypot(a, b) * np.cos(np.arctan(a / b) + phi / 2.0) - 2.0 * b
    return np.stack((h1[0] - h1, radius * (phi - phi[0])))


@given(geometries, st.floats(-0.5, 2.0))
def test_extensions_are_the_printed_formulas(geometry: SuitGeometry, angle: float) -> None:
    a, b, radius, l1, l2 = geometry
    printed = l1 + 2.0 * math.sqrt(a * a + b * b) * math.cos(math.atan(a / b) + angle / 2.0) - 2.0 * b
    assert flexor_extension(angle, geometry) == pytest.approx(printed, abs=1e-14)
    assert extensor_extension(angle, geometry) == l2 + radius * angle
    assert spool_angle(0.3, 0.02) == pytest.approx(15.0)


@given(geometries, st.floats(-0.5, 2.0))
def test_moment_arms_are_the_derivatives(geometry: SuitGeometry, angle: float) -> None:
    d = 1e-5
    for extension, arm in ((flexor_extension, flexor_moment_arm), (extensor_extension, extensor_moment_arm)):
        difference = (extension(angle + d, geometry) - extension(angle - d, geometry)) / (2.0 * d)
        assert arm(angle, geometry) == pytest.approx(-difference, abs=1e-9)


def test_the_printed_half_width_by_hand() -> None:
    low, high = ELBOW_RANGE
    assert 1e3 * (flexor_extension(high, PAPER) - flexor_extension(low, PAPER)) == pytest.approx(-99.3, abs=0.05)
    assert 1e3 * (extensor_extension(high, PAPER) - extensor_extension(low, PAPER)) == pytest.approx(78.5, abs=0.05)
    sizing = size_spools(PAPER)
    assert sizing.ratio == pytest.approx(1.175, abs=0.0005)
    assert 1e3 * sizing.mismatch == pytest.approx(20.7, abs=0.06)
    assert 1e3 * sizing.residual_flexor == pytest.approx(6.98, abs=0.005)
    assert 1e3 * sizing.residual_extensor == pytest.approx(5.94, abs=0.005)


@settings(max_examples=30)
@given(geometries, st.floats(-0.2, 0.5), st.floats(0.3, 1.4))
def test_ratio_is_the_best_there_is(geometry: SuitGeometry, low: float, span: float) -> None:
    """Oracle: min r with |f − k·g| ≤ r at many angles is a linear programme in (k, r)."""
    tilt = math.atan2(geometry.half_width, geometry.anchor_distance)
    low = max(low, -2.0 * tilt)
    high = min(low + span, math.pi - 2.0 * tilt)
    if high - low < 0.1:
        return
    f, g = 1e3 * travels(geometry, (low, high), 401)  # millimetres: the solver's tolerances are absolute
    ones = np.ones_like(f)
    lines = np.concatenate((np.stack((-g, -ones), 1), np.stack((g, -ones), 1)))
    best = linprog([0.0, 1.0], A_ub=lines, b_ub=np.concatenate((-f, f)), bounds=(None, None))
    sizing = size_spools(geometry, (low, high))
    assert 1e3 * sizing.residual_flexor == pytest.approx(best.fun, rel=1e-3, abs=1e-6)
    assert sizing.ratio == pytest.approx(best.x[0], rel=1e-3)
    assert sizing.residual_extensor == pytest.approx(sizing.residual_flexor / sizing.ratio)
    assert 1e3 * sizing.mismatch == pytest.approx(np.abs(f - g).max(), rel=1e-3, abs=1e-5)


@pytest.mark.parametrize(
    "call",
    [
        lambda: size_spools(PAPER._replace(half_width=0.0)),
        lambda: size_spools(PAPER._replace(joint_radius=math.nan)),
        lambda: size_spools(PAPER._replace(flexor_length=math.inf)),
        lambda: size_spools(PAPER, (1.0, 1.0)),
        lambda: size_spools(PAPER, (0.0, 3.0)),
    ],
)
def test_absurd_geometry_is_refused(call) -> None:
    with pytest.raises(ParameterError, match="expected"):
        call()
