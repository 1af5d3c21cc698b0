"""The sheath: its bend widens the loop in proportion and takes motion away, smoothly."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.kernel import compiled
from bowden.models.cable.bouc_wen import BoucWen, advance, joint_angle, saturation
from bowden.models.cable.sheath import Sheath, advance_in_sheath, joint_in_sheath, slope_factor, width

CABLE = BoucWen()
move, move_alone = compiled(advance_in_sheath), compiled(advance)


def loop(motor: np.ndarray, w: float, factor: float = 1.0) -> np.ndarray:
    """Joint angles along a motor path in a sheath that keeps still."""
    h, joints = 0.0, [joint_in_sheath(motor[0], 0.0, w, factor, CABLE)]
    for before, after in pairwise(motor.tolist()):
        h = move(h, after - before, w, CABLE)
        joints.append(joint_in_sheath(after, h, w, factor, CABLE))
    return np.array(joints)


@given(st.floats(0.1, 20.0), st.floats(0.1, 5.0), st.floats(0.1, 4.0))
def test_width_is_proportional_to_bend_and_gap(bend: float, gap: float, factor: float) -> None:
    """Section 3.2 (and against the Discussion, erratum 8)."""
    sheath = Sheath(bend=2.0, gap=gap)
    assert width(2.0, Sheath(bend=2.0)) == 1.0
    assert width(bend, sheath) == pytest.approx(max(0.01, gap * bend / 2.0))
    assert width(factor * bend, sheath) == pytest.approx(max(0.01, factor * gap * bend / 2.0))


def test_slope_falls_with_the_bend() -> None:
    sheath = Sheath(bend=2.0, loss=0.2)
    assert slope_factor(2.0, sheath) == 1.0
    assert slope_factor(4.0, sheath) == pytest.approx(0.8)
    assert slope_factor(100.0, sheath) == 0.05
    assert slope_factor(9.0, Sheath()) == 1.0


@given(st.floats(0.2, 3.0))
@settings(max_examples=20)
def test_the_loop_keeps_its_shape(w: float) -> None:
    """joint(w·motor; w) = w·joint(motor; 1): width and height of the hysteresis grow alike, so the dead zone does."""
    motor = 0.5 * np.sin(np.linspace(0.0, 10.0, 400))
    np.testing.assert_allclose(loop(w * motor, w), w * loop(motor, 1.0), atol=1e-9)


def test_at_the_identified_bend_it_is_bouc_wen_alone() -> None:
    motor = 0.5 * np.sin(np.linspace(0.0, 10.0, 400))
    h, joints = 0.0, []
    for before, after in zip(motor[:1].tolist() + motor[:-1].tolist(), motor.tolist(), strict=True):
        h = move_alone(h, after - before, CABLE)
        joints.append(joint_angle(after, h, CABLE))
    assert loop(motor, 1.0).tolist() == joints


def test_a_sheath_moved_under_a_still_motor_moves_the_joint_without_a_jump() -> None:
    h = 0.9 * saturation(CABLE)
    joints = [joint_in_sheath(0.7, move(h, 0.0, w, CABLE), w, 1.0, CABLE) for w in np.linspace(1.0, 2.0, 1001)]
    steps = np.diff(joints)
    assert np.ptp(joints) > 0.04
    assert np.abs(steps).max() < 1.001 * np.ptp(joints) / 1000
