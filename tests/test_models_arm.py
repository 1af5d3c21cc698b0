"""The wearer's arm: figures of the table, statics by hand, and wearers that cannot be."""

import math
from contextlib import nullcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.core.errors import ParameterError
from bowden.models.suit.arm import Arm, Wearer, arm_of, check_wearer, gravity_torque, passive_torque, wearer_torque
from support.wearers import resting_angle


def test_the_defaults_are_a_body_of_75_kg_and_1_75_m() -> None:
    assert Arm() == pytest.approx(arm_of(75.0, 1.75))


def test_winters_row_of_the_table() -> None:
    """2.2 % of the body, 68.2 % of the way down a forearm of 14.6 % of the height, gyration 82.7 % of it."""
    arm = arm_of(80.0, 1.8)
    assert arm.mass == pytest.approx(1.76)
    assert arm.centre == pytest.approx(0.682 * 0.2628)
    assert math.sqrt(arm.inertia / arm.mass) == pytest.approx(0.827 * 0.2628)


def test_the_gravity_of_a_level_forearm_is_weight_times_lever() -> None:
    arm = arm_of()
    assert gravity_torque(arm, 0.5 * math.pi) == pytest.approx(-1.65 * 9.81 * 0.174251)
    raised = arm_of(elevation=0.5 * math.pi)  # the upper arm level: straight arm level, too
    assert gravity_torque(raised, 0.0) == pytest.approx(gravity_torque(arm, 0.5 * math.pi))


def test_a_weight_in_the_hand_adds_its_own_moment_and_inertia() -> None:
    bare, loaded, lever = arm_of(), arm_of(load=2.0), (0.146 + 0.054) * 1.75
    assert gravity_torque(loaded, 1.0) - gravity_torque(bare, 1.0) == pytest.approx(-2.0 * 9.81 * lever * math.sin(1.0))
    assert loaded.inertia - bare.inertia == pytest.approx(2.0 * lever**2)


def test_a_wearers_torques_add_up_each_with_its_sign() -> None:
    """Against gravity, along a tremor, towards the centre, against the motion, and flexing."""
    arm, angle, velocity, time = arm_of(), 0.9, 0.4, 0.03
    alone = {
        Wearer(share=0.3): -0.3 * gravity_torque(arm, angle),
        Wearer(tremor=0.5, tremor_frequency=5.0): 0.5 * math.sin(10.0 * math.pi * time),
        Wearer(stiffness=2.0, centre=1.2): 2.0 * (1.2 - angle),
        Wearer(damping=0.7): -0.7 * velocity,
        Wearer(constant=1.5): 1.5,
    }
    for wearer, expected in alone.items():
        assert wearer_torque(wearer, arm, angle, velocity, time) == pytest.approx(expected)
    whole = Wearer(0.3, 0.5, 5.0, 2.0, 0.7, 1.2, 1.5)
    assert wearer_torque(whole, arm, angle, velocity, time) == pytest.approx(sum(alone.values()))


@given(st.floats(45.0, 120.0), st.floats(1.5, 2.0), st.floats(-1.0, 1.5))
def test_a_relaxed_arm_rests_where_its_torques_cancel(mass: float, height: float, elevation: float) -> None:
    arm = arm_of(mass, height, elevation=elevation)
    angle = resting_angle(arm)
    assert gravity_torque(arm, angle) + passive_torque(arm, angle, 0.0) == pytest.approx(0.0, abs=1e-9)
    assert 0.40 <= arm.stiffness <= 1.8  # the range that Wiegner and Watts measured


@given(st.floats(0.0, 9.0), st.floats(0.3, 2.0), st.floats(0.0, 300.0), st.floats(0.0, 30.0))
def test_who_swings_and_carries_their_arm_needs_no_spring_to_follow(
    time: float, frequency: float, stiffness: float, damping: float
) -> None:
    """Along φw itself the torques are the inertia's, whatever the wearer's stiffness and damping."""
    arm, swing, omega = arm_of(elevation=0.4), 0.5, 2.0 * math.pi * frequency
    wearer = Wearer(1.0, stiffness=stiffness, damping=damping, centre=0.9, swing=swing, swing_frequency=frequency)
    angle, velocity = 0.9 + swing * math.sin(omega * time), swing * omega * math.cos(omega * time)
    torque = wearer_torque(wearer, arm, angle, velocity, time)
    torque += gravity_torque(arm, angle) + passive_torque(arm, angle, velocity)
    assert torque == pytest.approx(-arm.inertia * omega**2 * swing * math.sin(omega * time), abs=1e-9)


@pytest.mark.parametrize("index", [10.0, 80.0])
def test_a_body_is_one_up_to_the_ends_of_the_mass_index(index: float) -> None:
    for share, taken in ((1.0, True), (1.001 if index > 50.0 else 0.999, False)):
        with nullcontext() if taken else pytest.raises(ParameterError, match="body mass index"):
            arm_of(index * share * 1.5**2, 1.5)


@pytest.mark.parametrize(
    ("mass", "height", "load"),
    [
        (0.0, 1.75, 0.0),
        (75.0, 17.5, 0.0),
        (math.nan, 1.75, 0.0),
        (75.0, math.inf, 0.0),
        (250.0, 1.1, 0.0),
        (75, 1.7, -1),
    ],
)
def test_impossible_bodies_are_refused_in_one_line(mass: float, height: float, load: float) -> None:
    with pytest.raises(ParameterError, match="wearer") as caught:
        arm_of(mass, height, load=load)
    assert "\n" not in str(caught.value)
    assert "expected" in str(caught.value)


@pytest.mark.parametrize("field", Wearer._fields)
def test_impossible_torques_are_refused(field: str) -> None:
    for value in (math.nan, math.inf, -1e6):
        with pytest.raises(ParameterError, match=field):
            check_wearer(Wearer()._replace(**{field: value}))
