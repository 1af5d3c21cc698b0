"""The generalised play: its branches, the way on beyond its nodes, and its weights against NumPy's least squares."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.models.cable.generalised_play import (
    Branches,
    add_curve,
    add_slope,
    bent_on,
    bulge,
    fill_design,
    fill_joint,
    fill_slots,
    half_gap,
    mean_branch,
    with_curve,
)

BENDS, GAPS = np.array([0.02, -0.01, 0.0, 0.015, 0.03]), np.array([0.05, 0.08, 0.06])
LOW, HIGH = -0.2, 1.0
SPAN = HIGH - LOW
CABLE = with_curve(Branches(0.9, BENDS, GAPS, LOW, HIGH, np.array([0.5, 1.5]), np.array([0.4, 0.8 / 1.5]), 0.1, 0.0))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_each_way_the_joint_runs_on_its_own_branch(way: float) -> None:
    motor = np.linspace(LOW, HIGH, 61)[:: int(way)]
    joint = np.empty(61)
    fill_joint(motor, motor[0] - way, CABLE, np.empty(2), joint)
    mean = 0.9 * motor + np.interp(motor, np.linspace(LOW, HIGH, 5), BENDS)
    assert joint == pytest.approx(mean - way * np.interp(motor, np.linspace(LOW, HIGH, 3), GAPS) + 0.1)


@pytest.mark.parametrize("away", [1e-3, 0.3 * SPAN, 0.49 * SPAN, 0.51 * SPAN, 3.0 * SPAN])
def test_beyond_the_nodes_the_mean_goes_on_along_its_parabola_and_then_its_tangent(away: float) -> None:
    bent = CABLE.curve * (SPAN + 2.0 * min(away, 0.5 * SPAN))
    for node, side in ((LOW, -1.0), (HIGH, 1.0)):
        motor, step = node + side * away, 1e-5
        slope = (mean_branch(motor + step, CABLE) - mean_branch(motor - step, CABLE)) / (2.0 * step)
        assert slope == pytest.approx(0.9 + side * bent, rel=1e-6)
        assert mean_branch(node + side * 1e-12, CABLE) == pytest.approx(mean_branch(node, CABLE))
        assert half_gap(motor, CABLE) == half_gap(node, CABLE)


@given(st.lists(st.floats(LOW - 0.45 * SPAN, HIGH + 0.45 * SPAN), min_size=2, max_size=6), st.floats(-0.3, 0.3))
@settings(max_examples=30)
def test_the_joint_is_linear_in_the_branches_nodes(turns: list[float], lag: float) -> None:
    """The design's rows times the nodes' values; with bends whose own line is level, as a fit has them."""
    nodes, far = np.linspace(LOW, HIGH, 5), HIGH + 2.0 * SPAN
    cable = with_curve(CABLE._replace(bends=BENDS - np.polyval(np.polyfit(nodes, BENDS, 1), nodes)))
    motor = np.concatenate([np.linspace(one, other, 7) for one, other in pairwise(turns)])
    joint, z, slots, design = np.empty(len(motor)), np.empty(2), np.empty((len(motor), 2)), np.zeros((len(motor), 8))
    fill_joint(motor, motor[0] + lag, cable, z, joint)
    fill_slots(motor, motor[0] + lag, cable, z, slots)
    fill_design(motor, motor[0] + lag, cable, np.empty((3, 2)), design)
    assert design @ [*(0.9 * nodes + cable.bends), *GAPS] + 0.1 == pytest.approx(joint, abs=1e-9)
    mean = np.array([mean_branch(one, cable) for one in motor])
    assert (1.0 - cable.shares.sum()) * mean + slots @ cable.shares + 0.1 == pytest.approx(joint, abs=1e-12)
    assert bulge((far - LOW) / SPAN) == pytest.approx(bent_on(far, cable._replace(curve=1.0)) / SPAN**2)


@pytest.mark.parametrize("count", [3, 4, 7])
def test_weights_are_those_of_least_squares(count: int) -> None:
    values = np.random.default_rng(count).normal(size=count)
    for add, degree in ((add_slope, 1), (add_curve, 2)):
        row = np.zeros(count)
        add(row, count, 2.0)
        assert row @ values == pytest.approx(2.0 * np.polyfit(np.linspace(0.0, 1.0, count), values, degree)[0])


def test_a_curve_is_no_steeper_than_leaves_half_of_the_slope() -> None:
    steep = with_curve(CABLE._replace(bends=100.0 * BENDS))
    assert abs(steep.curve) == pytest.approx(0.25 * 0.9 / SPAN)
