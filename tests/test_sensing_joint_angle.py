"""The estimate of a joint's angle: from the motor through the cable's model, corrected by a sensor."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.kernel import compiled
from bowden.core.nested import flat
from bowden.core.units import RADIANS
from bowden.sensing.joint_angle import (
    CHANGES,
    CREDIBLE,
    CREEPS,
    GATE,
    LATE,
    STAYS,
    TRAVEL,
    UNSEEN,
    Covariance,
    JointEstimate,
    JointModel,
    estimate_start,
    estimate_step,
)

DT = 1e-3
ALONE = JointModel(slope=0.9, zero=0.1, play=0.05, error=3.0 * RADIANS)
IMU = ALONE._replace(period=0.01, delay=0.01, noise=2.0 * RADIANS, drift=RADIANS / 60.0)


def strokes(count: int, speed: float = 2.0) -> Any:
    """A motor's strokes, 0.5 rad either way."""
    return 0.6 - 0.5 * np.cos(speed * DT * np.arange(count))


def followed(model: JointModel, motor: Any, truth: Any, seed: int = 0, until: float = math.inf) -> list[JointEstimate]:
    """Estimates of a joint that goes as `truth`, with the sensor of the model, whose values end at a time [s]."""
    random, step = np.random.default_rng(seed), compiled(estimate_step)
    state, found = estimate_start(model, motor[0]), []
    every, late = round(model.period / DT), round(model.delay / DT)
    for k, angle in enumerate(motor):
        comes = every > 0 and k % every == 0 and k >= late and k * DT < until
        value = truth[k - late] + model.noise * random.standard_normal() + model.drift * k * DT if comes else math.nan
        state = step(model, state, angle, value, DT)
        found.append(state)
    return found


def cable(model: JointModel, motor: Any) -> Any:
    """The cable model's own joint."""
    return np.array([one.cable for one in followed(model._replace(period=0.0), motor, motor)])


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=50))
@settings(deadline=None)
def test_the_cable_alone_is_a_play(motors: list[float]) -> None:
    """The joint stays within its play, and moves no further than slope times the motor."""
    state = estimate_start(ALONE, motors[0])
    for motor in motors:
        before, state = state, estimate_step(ALONE, state, motor, math.nan, DT)
        assert abs(state.angle - ALONE.slope * (motor - ALONE.zero)) <= ALONE.play + 1e-12
        assert state.std == pytest.approx(ALONE.error)
        assert state.age == math.inf
        assert abs(state.angle - before.angle) <= abs(ALONE.slope * (motor - ALONE.zero) - before.angle) + 1e-12


@given(
    st.lists(st.floats(-0.1, 0.1), min_size=12, max_size=12),
    st.floats(0.2, 0.9),
    st.one_of(st.just(math.nan), st.floats(-1.0, 1.0)),
    st.floats(0.0, 0.1) | st.just(math.inf),
)
def test_a_step_is_kalman_s_prediction_and_correction_of_the_three_errors(
    drawn: list[float], motor: float, innovation: float, age: float
) -> None:
    """Against matrices: f and b are forgotten, d grows by its drift, and a value shows the sum of all three."""
    model, root, errors = IMU._replace(delay=0.0, offset=0.07), np.reshape(drawn[:9], (3, 3)), np.array(drawn[9:])
    p = root @ root.T + 1e-4 * np.eye(3)
    begun = estimate_start(model, 0.5)._replace(age=age, shown=0.02, covariance=Covariance(*p[np.triu_indices(3)]))
    begun = begun._replace(changing=errors[0], staying=errors[1], sensor=errors[2])
    still = estimate_step(model, begun, motor, math.nan, DT)
    keeps = np.array([math.exp(-abs(still.cable - begun.cable) / TRAVEL - DT / CHANGES), math.exp(-DT / CREEPS), 1.0])
    errors, p = keeps * errors, p * np.outer(keeps, keeps)
    p += np.diag((1.0 - keeps**2) * np.array([1.0 - STAYS, STAYS, 0.0]) * model.error**2)
    p[2, 2] = (math.sqrt(p[2, 2]) + model.drift * DT) ** 2
    after, age, total = estimate_step(model, begun, motor, still.cable + errors.sum() + innovation, DT), age + DT, 0.0
    taken = innovation**2 <= GATE**2 * (model.error**2 + model.offset**2 + model.noise**2)  # as the first one is judged
    if taken:
        total, gain = p.sum() + model.noise**2, p.sum(axis=1) / (p.sum() + model.noise**2)
        errors, p = errors + gain * innovation, p - np.outer(gain, gain) * total
        age = 0.0
    assert (after.changing, after.staying, after.sensor) == pytest.approx(tuple(errors), abs=1e-12)
    assert after.covariance == pytest.approx(tuple(p[np.triu_indices(3)]), abs=1e-12)
    assert (after.age, after.expected) == (pytest.approx(age), pytest.approx(total if taken else begun.expected))
    assert after.refused == (not taken and not math.isnan(innovation))
    shown = 0.02 + (errors[0] + errors[1] - 0.02) * DT / model.period
    assert after.angle == pytest.approx(after.cable + shown, abs=1e-12)
    doubt = max(0.0, abs(errors[0] + errors[1]) - CREDIBLE * model.error)
    doubt += UNSEEN * max(0.0, after.age - LATE * model.period)
    assert after.std == pytest.approx(math.sqrt(p[:2, :2].sum()) + doubt)


@given(st.floats(0.0, 69.9), st.sampled_from((-2.0, 0.7, 3.0)))
@settings(max_examples=20)
def test_a_sensor_that_shows_the_cable_s_own_joint_a_delay_ago_corrects_nothing(late: float, speed: float) -> None:
    """Over any delay, in cycles, while the joint goes at one speed."""
    model = IMU._replace(delay=late * DT)
    state = estimate_start(model, 0.5)
    for k in range(200):
        motor = 0.5 + speed * DT * k
        shown = state.cable + model.slope * speed * DT * (1.0 - late) if k > 150 else math.nan
        state = estimate_step(model, state, motor, shown, DT)
    assert flat(state)[3:8] == pytest.approx((state.angle, 0.0, 0.0, 0.0, 0.0), abs=1e-12)
    assert state.angle == pytest.approx(model.slope * (motor - model.zero) - math.copysign(model.play, speed))


@pytest.mark.parametrize("seed", range(5))
def test_error_is_below_the_noise_and_within_its_standard_deviation(seed: int) -> None:
    motor = strokes(20_000)
    truth = cable(IMU, motor) + 3.0 * RADIANS
    found = followed(IMU, motor, truth, seed)[2000:]
    errors = np.array([one.angle for one in found]) - truth[2000:]
    deviation = np.array([one.std for one in found])
    assert np.sqrt(np.mean(errors**2)) < 0.6 * IMU.noise
    assert np.mean(np.abs(errors) < 2.0 * deviation) > 0.9


def test_drift_is_borne_by_the_cable_s_model() -> None:
    """After ten minutes the sensor is 10° off, and the estimate less than half of that."""
    model, motor = IMU._replace(noise=0.5 * RADIANS), strokes(600_000, 1.0)
    truth = cable(model, motor)
    assert abs(followed(model, motor, truth)[-1].angle - truth[-1]) < 5.0 * RADIANS


def test_a_sensor_that_stops_leaves_the_prediction_with_growing_deviation() -> None:
    motor = strokes(4000)
    truth = cable(IMU, motor)
    deviation = [one.std for one in followed(IMU, motor, truth, until=2.0)]
    assert deviation[1990] < 1.5 * RADIANS
    assert all(after >= before for before, after in pairwise(deviation[2000:]))
    assert deviation[-1] > 15.0 * RADIANS


def test_a_sensor_that_a_busy_computer_hears_seldom_is_no_silent_one() -> None:
    """A value every 3.5 periods, for ten seconds: each shows that the sensor is there."""
    motor, step = strokes(10_000), compiled(estimate_step)
    truth, state = cable(IMU, motor), estimate_start(IMU, motor[0])
    for k, angle in enumerate(motor):
        state = step(IMU, state, angle, truth[k - 10] if k % 35 == 10 else math.nan, DT)
    assert state.std < 2.0 * RADIANS


def test_a_value_that_cannot_be_is_not_taken() -> None:
    """A sensor that jumps by 20° stays out, so that the standard deviation grows until a limit ends the run."""
    motor = strokes(4000)
    truth = cable(IMU, motor)
    lying = truth + np.where(np.arange(4000) >= 2000, 20.0 * RADIANS, 0.0)
    found = followed(IMU, motor, lying)
    after = np.array([one.angle for one in found[2000:3000]])
    assert np.abs(after - truth[2000:3000]).max() < 4.0 * RADIANS
    assert found[2990].std > 8.0 * RADIANS


def test_a_sensor_that_stands_still_is_doubted() -> None:
    """Each of its values is near the prediction of its time, and together they are what no cable does."""
    motor = 1.2 - 1.1 * np.cos(3.0 * DT * np.arange(4000))
    truth = cable(IMU, motor)
    frozen = np.where(np.arange(4000) >= 2000, truth[2000], truth)
    deviation = np.array([one.std for one in followed(IMU, motor, frozen)])
    assert deviation[1500:2000].max() < 2.0 * RADIANS
    assert deviation[2000:3500].max() > 9.0 * RADIANS
