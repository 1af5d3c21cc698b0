"""The Bouc–Wen cable: against SciPy on Eq. 7 as printed, and the laws that every such loop obeys."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.special import hyp2f1

from bowden.core.kernel import compiled
from bowden.models.cable.bouc_wen import (
    BoucWen,
    advance_prepared,
    joint_angle,
    prepare_cable,
    saturation,
    slope_of_h,
    travel_step,
)
from bowden.models.cable.bouc_wen import advance as plain_advance

advance = compiled(plain_advance)
PAPER = BoucWen()
cables = st.builds(
    BoucWen,
    slope=st.just(0.938),
    hysteresis_gain=st.just(-0.129),
    offset=st.just(0.0),
    rate=st.floats(0.5, 60.0),
    shape=st.floats(0.55, 30.0),
    exponent=st.one_of(st.floats(1.0, 5.0), st.sampled_from([1.0, 1.5, 2.0, 3.0, 4.0, 5.0])),
)
inside = st.floats(-1.0, 1.0)  # h as a share of its bound
turning_points = st.lists(st.floats(-1.5, 1.5), min_size=2, max_size=8)


def walk(path: np.ndarray, cable: BoucWen, h: float = 0.0) -> np.ndarray:
    """h at each of the motor angles of a path (n,), the motor going straight from one to the next."""
    values = [h]
    for travel in np.diff(path):
        h = advance(h, float(travel), cable)
        values.append(h)
    return np.array(values)


def power(y: float, cable: BoucWen) -> float:
    """q of y = h·direction."""
    return (2.0 * cable.shape - 1.0 if y > 0.0 else -1.0) * abs(y) ** cable.exponent


def gone(y: float, cable: BoucWen) -> float:
    """ρ·travel since zero."""
    n = cable.exponent
    return float(y * hyp2f1(1.0, 1.0 / n, 1.0 + 1.0 / n, power(y, cable)))


@given(cables, inside, st.floats(-3.0, 3.0), st.sampled_from([1.0, 0.1, 0.01]))
@settings(max_examples=1000)
def test_travel_is_the_integral_of_eq_7(cable: BoucWen, share: float, travel: float, scale: float) -> None:
    """Oracle: ρ·|travel| = ∫dy/(1 − q) with y = h·direction, which Gauss' hypergeometric function has in closed form.

    So that h knows no time, and how a travel is cut changes nothing.
    """
    bound, direction = saturation(cable), math.copysign(1.0, travel)
    z = scale * bound * abs(travel)
    h = share * bound
    after = advance(h, direction * z / cable.rate, cable)
    left = 1.0 - power(direction * after, cable)
    assume(left > 1e-5 and power(direction * h, cable) < 0.99999)
    went = gone(direction * after, cable) - gone(direction * h, cable)
    assert (went - z) * left == pytest.approx(0.0, abs=3e-10 * bound)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("exponent", "order"), [(1.7, 5), (2.5, 5), (3.0, 6)])
def test_away_from_zero_half_the_step_leaves_the_power_of_the_series_order(
    exponent: float, order: int, side: float
) -> None:
    cable = BoucWen(rate=1.0, shape=1.5, exponent=exponent)
    begin = 0.7 * side * saturation(cable)
    travel = 0.2 * abs(begin) if order == 6 else 0.045 * abs(begin)

    def in_steps(count: int) -> float:
        steps = prepare_cable(cable)._replace(near_zero=0.0, piece=travel / count * (1.0 + 1e-12))
        return advance_prepared(begin, travel, steps)

    exact = in_steps(64)
    coarse, fine = (abs(in_steps(count) - exact) for count in (2, 4))
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.4)


@pytest.mark.parametrize("exponent", [1.5, 2.0])
@pytest.mark.parametrize("shape", [1.5, 0.8])
def test_through_zero_the_series_is_exact_to_the_fifth_power_of_what_it_grows_by(exponent: float, shape: float) -> None:
    cable, left = BoucWen(rate=1.0, shape=shape, exponent=exponent), []
    for size in (0.4, 0.2):
        whole = prepare_cable(cable)._replace(near_zero=9.0, piece=9.0)
        after = advance_prepared(-0.5 * size, size, whole)
        left.append(abs(gone(after, cable) - gone(-0.5 * size, cable) - size))
    assert math.log2(left[0] / left[1]) > 1.0 + 5.0 * exponent - 0.3


@given(cables, inside, turning_points)
def test_h_never_leaves_its_bound(cable: BoucWen, share: float, turns: list[float]) -> None:
    bound = saturation(cable)
    path = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(turns)])
    assert np.abs(walk(path, cable, share * bound)).max() <= bound * (1.0 + 1e-12)


@given(cables, st.floats(-1.0, 1.0), st.floats(0.05, 1.5))
@settings(max_examples=50)
def test_every_cycle_dissipates(cable: BoucWen, centre: float, amplitude: float) -> None:
    """∮h d(motor) > 0: the loop of h runs clockwise, and with αh < 0 the joint's runs anticlockwise, lagging."""
    cycle = centre + amplitude * np.cos(np.linspace(0.0, 2.0 * np.pi, 401))
    h = walk(np.concatenate((cycle[:-1], cycle)), cable)[400:]
    joint = np.array([joint_angle(m, v, cable) for m, v in zip(cycle, h, strict=True)])
    assert np.trapezoid(h, cycle) > 0.0
    assert np.trapezoid(joint, cycle) < 0.0


@given(cables, inside, st.sampled_from([-1.0, 1.0]))
def test_slope_is_eq_7_over_the_speed(cable: BoucWen, share: float, direction: float) -> None:
    h, u = share * saturation(cable), 0.37 * direction
    size = abs(h)
    eq7 = cable.rate * (
        u - cable.shape * abs(u) * size**cable.exponent * np.sign(h) - (cable.shape - 1.0) * u * size**cable.exponent
    )
    assert slope_of_h(h, direction, cable) == pytest.approx(eq7 / abs(u), rel=1e-12, abs=1e-12)


@given(inside, st.floats(-0.05, 0.05))
def test_the_laws_single_step_is_close_to_the_exact_one(share: float, scaled: float) -> None:
    """`travel_step`, what the observer uses, to 1e-6 for ρ·|travel| up to 0.05 with the paper's parameters."""
    h, travel = share * saturation(PAPER), scaled / PAPER.rate
    assert travel_step(h, travel, PAPER) == pytest.approx(advance(h, travel, PAPER), abs=1e-6)


@pytest.mark.parametrize("travel", [0.0, -0.0, math.nan])
def test_no_travel_changes_nothing(travel: float) -> None:
    assert advance(0.2, travel, PAPER) == 0.2


def test_a_slower_cable_is_monotone() -> None:
    """With ρ = 5 the joint never moves against the motor: what the implicit solution of the static plant relies on."""
    cable = BoucWen(rate=5.0)
    motor = 0.6 * np.cos(np.linspace(0.0, 4.0 * np.pi, 4001))
    joint = np.array([joint_angle(m, v, cable) for m, v in zip(motor, walk(motor, cable), strict=True)])
    steps = np.diff(motor)
    assert (np.diff(joint)[np.abs(steps) > 1e-6] * np.sign(steps[np.abs(steps) > 1e-6]) > 0.0).all()
