"""Gains for the suit by margin, and random wearers."""

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PointToPoint
from bowden.core.units import DEGREES, RADIANS
from bowden.models.suit.arm import GRAVITY
from bowden.models.suit.suit_angle import flexor_arm
from bowden.plants.presets.suit import suit, suit_calibration
from bowden.plants.suit_parts import prepare_suit
from bowden.sim.run import simulate
from bowden.sim.suit_runs import DRIVE_INTEGRAL, FRICTION_FEEDFORWARD, suit_adaptive, suit_adaptive_integral, suit_ours
from suit_gains import ESTIMATES, FEEDBACK_GAINS, SMOOTHINGS
from suit_linear import corners, suit_model, worst_margins
from wearers import wear


def test_the_linear_suit_at_rest_is_its_statics() -> None:
    """Command to elbow at frequency zero: two springs in series against the drive's and the arm's own stiffness."""
    made = suit()
    plant, parts = suit_model(made, 0.8), prepare_suit(made)
    gain = (plant.c @ np.linalg.solve(np.eye(len(plant.a)) - plant.a, plant.b))[0, 0]
    spring = 1.0 / (1.0 / made.flexor.stiffness + 1.0 / made.fabric.stiffness)
    drive = made.motor.inertia * made.motor.servo.natural_frequency**2
    lever, r_f, r_e, radius = flexor_arm(0.8, parts.map), parts.map.radius, parts.extensor_radius, parts.joint_radius
    across = spring * (r_f * lever + r_e * radius)
    weight = GRAVITY * made.arm.mass * made.arm.centre * np.cos(0.8)
    matrix = np.array(
        [
            [drive + spring * (r_f**2 + r_e**2), -across],
            [-across, spring * (lever**2 + radius**2) + made.arm.stiffness + weight],
        ]
    )
    assert gain == pytest.approx(np.linalg.solve(matrix, [drive * lever / r_f, 0.0])[1], rel=1e-6)


def test_the_chosen_gains_have_their_margins_and_the_next_have_not() -> None:
    at, gains = corners(suit()), suit_adaptive().gains
    chosen = worst_margins(at, gains, 1e-3, ESTIMATES, (12.0, 60.0))
    assert chosen is not None
    assert chosen == pytest.approx((12.5, 68.3), abs=0.1)
    faster = FEEDBACK_GAINS[FEEDBACK_GAINS.index(gains.feedback_gain) + 1]
    sharper = SMOOTHINGS[SMOOTHINGS.index(gains.smoothing) - 1]
    for other in (gains._replace(feedback_gain=faster), gains._replace(smoothing=sharper)):
        assert worst_margins(at, other, 1e-3, ESTIMATES, (12.0, 60.0)) is None


def test_with_an_integral_in_the_drive_the_linear_spool_is_at_its_target_at_rest() -> None:
    made = suit(suit_calibration("second"))
    plant, parts = suit_model(made, 0.8), prepare_suit(made)
    gain = (plant.c @ np.linalg.solve(np.eye(len(plant.a)) - plant.a, plant.b))[0, 0]
    spring = 1.0 / (1.0 / made.flexor.stiffness + 1.0 / made.fabric.stiffness)
    lever, radius = flexor_arm(0.8, parts.map), parts.joint_radius
    across = spring * (parts.map.radius * lever + parts.extensor_radius * radius)
    weight = GRAVITY * made.arm.mass * made.arm.centre * np.cos(0.8)
    back = spring * (lever**2 + radius**2) + made.arm.stiffness + weight
    assert gain == pytest.approx(across * lever / parts.map.radius / back, rel=1e-6)


def test_an_integral_in_the_drive_leaves_half_the_feedback() -> None:
    gains = suit_adaptive_integral().gains
    other = suit()._replace(motor=suit().motor._replace(integral=DRIVE_INTEGRAL))
    for made in (suit(suit_calibration("second")), other):
        assert worst_margins(corners(made), gains, 1e-3, ESTIMATES, (12.0, 60.0)) is not None
        faster = gains._replace(feedback_gain=2.0)
        assert worst_margins(corners(made), faster, 1e-3, ESTIMATES, (12.0, 60.0)) is None
    least = worst_margins(corners(other), suit_adaptive().gains, 1e-3, ESTIMATES)
    assert least is not None
    assert least[0] == pytest.approx(6.5, abs=0.1)


def test_the_benchs_gains_do_not_hold_on_the_suit() -> None:
    assert worst_margins(corners(suit()), LAWS["adaptive"].gains, 1e-3, ESTIMATES) is None


@pytest.mark.parametrize("number", [3, 8, 13])
def test_the_compensated_suit_on_a_few_random_wearers(number: int) -> None:
    """All of them stable, and far nearer than the 30° without compensation; the 500 are in the benchmarks."""
    made = suit()
    made = made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL))
    found = wear(number, made, suit_ours())
    assert found.stable
    assert found.largest_deg < 8.0
    assert found.rmse_deg < 1.5


@pytest.mark.xfail(strict=True, reason="0.46 s instead of 0.3 s until the elbow has moved by half a degree")
def test_the_elbow_sets_out_with_the_reference_after_a_rest() -> None:
    """Flexions of 2 s with rests: the dead zone is crossed as the reference sets out, and the elbow rests where it
    should."""
    made = suit()
    made = made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL, friction_feedforward=FRICTION_FEEDFORWARD))
    top = 90.0 * RADIANS
    rests = PointToPoint(
        (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0), (0.0, 0.0, top, top, 0.0, 0.0, top, top, 0.0)
    )
    trace = simulate(made, suit_ours(), rests, duration=16.0, seed=400)
    for begin, way in ((10.0, 1.0), (14.0, -1.0)):  # the first stroke is to learn from
        start = round(begin * 1000)
        moved = way * (trace["joint"][start:] - trace["joint"][start])
        assert np.argmax(moved > 0.5 * RADIANS) < 300  # the reference itself takes 166
        assert np.abs(trace.error[start - 200 : start]).max() * DEGREES < 3.0
    late = trace.time > 5.0
    assert np.abs(trace.error[late]).max() * DEGREES < 6.0


def test_a_stroke_that_goes_on_after_a_rest_is_followed_all_the_same() -> None:
    """A rest is no turn: there is nothing to cross."""
    made = suit()
    made = made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL, friction_feedforward=FRICTION_FEEDFORWARD))
    step = 30.0 * RADIANS
    steps = (0.0, 0.0, step, step, 2.0 * step, 2.0 * step, 3.0 * step)
    stairs = PointToPoint((0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0), steps)
    trace = simulate(made, suit_ours(), stairs, duration=12.0, seed=400)
    assert np.abs(trace.error).max() * DEGREES < 12.0
    resting = (trace.time > 9.5) & (trace.time < 10.0)
    assert np.abs(trace.error[resting]).max() * DEGREES < 3.5
