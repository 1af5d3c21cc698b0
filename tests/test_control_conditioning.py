"""The conditioner: a motion passes to the bit, all else becomes one that a servo can follow."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bowden.control.conditioning import (
    PACE,
    SHARPNESS,
    SLOWEST,
    Conditioned,
    Conditioning,
    condition_start,
    condition_step,
    departs,
    estimate_reference,
    follow_reference,
    update_doubt,
)
from bowden.control.knowledge import Knowledge, informed
from bowden.control.laws.uncompensated import LAW
from bowden.control.reference import Chirp, PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.core.kernel import compiled, kernel
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS
from bowden.sensing.intent import IntentSettings, proportional

Array = NDArray[np.float64]
DT, OMEGA = 1e-3, 53.58
SETTINGS = Conditioning()
MOTION = PointToPoint((0.0, 0.5, 1.7, 2.0, 2.8, 4.0), (0.0, 0.0, 0.8, 0.8, 0.2, 0.2))


@kernel
def run(settings: Conditioning, told: Array, dt: float, shown: Array) -> None:
    state = condition_start(settings, Sample(0.0, 0.0))
    for k in range(len(told)):
        state, found = condition_step(settings, state, Reference(told[k, 0], told[k, 1], told[k, 2]), dt)
        shown[k, 0], shown[k, 1], shown[k, 2] = found


def conditioned(told: Array, dt: float = DT) -> Array:
    shown = np.empty_like(told)
    compiled(run)(SETTINGS, np.ascontiguousarray(told), dt, shown)
    return shown


def sampled(motion: Trajectory, dt: float = DT, duration: float = 4.0) -> Array:
    return motion.sample(np.arange(round(duration / dt)) * dt)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))


@pytest.mark.parametrize("dt", [4e-3, 1e-3, 2.5e-4])
@pytest.mark.parametrize(
    "motion",
    [PeriodicMinimumJerk(0.0, 1.5, 1.5), MOTION, Chirp(1.5, 0.1, 13.0, 4.0)],
    ids=["periodic", "point to point", "chirp"],
)
def test_a_motion_is_shown_to_the_bit(motion: Trajectory, dt: float) -> None:
    told = sampled(motion, dt)
    assert conditioned(told, dt).tobytes() == told.tobytes()


def test_a_motion_in_steps_of_euler_is_shown_to_the_bit() -> None:
    """As EMG in proportion makes it."""
    rows, at = [], Reference(0.0, 0.0, 0.0)
    for k in range(3000):
        at = proportional(IntentSettings(), at, 0.3 + 0.2 * math.sin(2e-3 * k) + 0.2 * (k > 1000), 1.0, DT)
        rows.append(at)
    told = np.array(rows, dtype=np.float64)
    assert conditioned(told).tobytes() == told.tobytes()


@pytest.mark.parametrize("missing", [0.0, math.nan])
def test_derivatives_that_are_missing_are_found(missing: float) -> None:
    motion = sampled(MOTION)
    told = motion.copy()
    told[:, 1:] = missing
    off = conditioned(told) - motion
    assert rms(off[:, 0]) < 1e-5
    assert rms(off[:, 1]) < 0.02 * rms(motion[:, 1])
    assert rms(off[:, 2]) < 0.1 * rms(motion[:, 2])


def test_a_noisy_velocity_is_replaced() -> None:
    motion = sampled(MOTION)
    told = motion.copy()
    noise = 3.0 * RADIANS * np.random.default_rng(1).standard_normal(len(told))
    told[:, 1] += noise
    off = conditioned(told) - motion
    assert rms(off[:, 0]) < 1e-4
    assert rms(off[:, 1]) < 0.1 * rms(noise)


@pytest.mark.parametrize("keeps", [0.0, 1.0])
@pytest.mark.parametrize("rate", [20.0, 37.0, 100.0])
def test_a_position_that_is_held_becomes_a_motion_through_the_middle_of_its_stairs(rate: float, keeps: float) -> None:
    """Of a ramp the stairs are off by a twelfth of their square; its derivatives may be missing, or held as well."""
    time = np.arange(4000) * DT
    held = np.floor(time * rate) / rate
    told = np.stack([0.5 * held, np.full_like(time, 0.5 * keeps), np.zeros_like(time)], axis=1)
    shown, whole = conditioned(told), slice(1000, None)
    assert rms((shown - told)[whole, 0]) == pytest.approx(0.5 / rate / math.sqrt(12.0), rel=0.1)
    assert rms(shown[whole, 1] - 0.5) < 0.1 * 0.5
    still = conditioned(np.concatenate([told, np.repeat(told[-1:] * [1.0, 0.0, 0.0], 600, axis=0)]))
    assert np.abs(still[-50:] - still[-1] * [1.0, 0.0, 0.0]).max() < 1e-4
    assert still[-1, 0] == pytest.approx(told[-1, 0], abs=1e-9)


def test_a_jump_is_gone_over_as_a_servo_could_and_then_shown_as_it_is() -> None:
    told = np.zeros((1000, 3))
    told[100:, 0] = 0.2
    shown = conditioned(told)
    taken = float(np.sum((told[:, 0] - shown[:, 0]) ** 2)) * DT / 0.2**2
    assert taken < 1.25 / OMEGA + SETTINGS.delay  # of the servo itself
    assert 0.0 <= shown[:, 0].min() <= shown[:, 0].max() <= 0.2 + 1e-9
    assert np.abs(shown[:, 2]).max() < 4.0 * OMEGA**2 * 0.2
    assert np.abs(np.diff(shown[:, 0]) - DT * shown[1:, 1]).max() < 2e-6
    assert shown[-1].tolist() == [0.2, 0.0, 0.0]


def test_set_points_that_follow_each_other_slowly_are_jumps() -> None:
    told = np.zeros((3000, 3))
    told[:, 0] = 0.1 * np.floor(np.arange(3000) * DT / (1.5 * SLOWEST))
    shown = conditioned(told)
    assert np.all(np.diff(shown[:, 0]) > -1e-12)  # none is led beyond itself


@pytest.mark.parametrize("column", [0, 1, 2])
def test_what_is_no_number_never_reaches_a_law(column: int) -> None:
    told = sampled(MOTION)
    told[:3, column] = math.nan
    told[700:740, column] = math.inf
    shown = conditioned(told)
    assert np.isfinite(shown).all()
    assert shown[-1].tolist() == told[-1].tolist()


steps = st.floats(1e-4, 1e-2)
rates = st.floats(-9.0, 9.0)
shares = st.floats(-0.99, 0.99)


@given(rates, rates, st.floats(1e-3, 0.1), shares, steps)
def test_a_step_of_euler_or_of_the_trapezoid_leads_on_and_one_beyond_them_departs(
    velocity: float, acceleration: float, most: float, share: float, dt: float
) -> None:
    def stepped(part: float, off: float) -> bool:
        gone = dt * velocity - part * dt * dt * acceleration + off * most
        return departs(0.3, Reference(0.3 + gone, velocity, acceleration), most, dt)

    assert not any(stepped(part, share) for part in (0.0, 0.5, 1.0))
    way = math.copysign(1.01, acceleration)
    assert stepped(0.0, way)
    assert stepped(1.0, -way)


@given(shares, shares, rates, rates, steps)
def test_a_jump_is_followed_by_a_critically_damped_step_of_backward_euler(
    off: float, off_rate: float, velocity: float, acceleration: float, dt: float
) -> None:
    """ë = −2β·ė − β²·e at the step's end, of what is shown beside the motion that the reference leads on from."""
    given = Reference(0.4, velocity, acceleration)
    before = 0.4 - dt * velocity + 0.5 * dt * dt * acceleration, velocity - dt * acceleration
    state = Conditioned(before[0] + off, before[1] + off_rate, 0.0, 0.0, 0.0, 0.0, 0.0)
    e, rate, bend = np.subtract(follow_reference(SETTINGS, state, given, dt), given).tolist()
    pace = PACE / (1.0 / SETTINGS.servo_frequency + SETTINGS.delay)
    assert bend == pytest.approx(-2.0 * pace * rate - pace**2 * e, rel=1e-6, abs=1e-6)
    assert rate == pytest.approx(off_rate + dt * bend, abs=1e-6)
    assert e == pytest.approx(off + dt * rate, abs=1e-9)


@pytest.mark.parametrize("cycles", [1, 2, 7, 40])
def test_the_estimates_poles_are_where_the_servo_can_use_them(cycles: int) -> None:
    """All three at θ, over the time between two values that come."""
    span, moved = cycles * DT, []
    for start in 1e-6 * np.eye(3):
        shown = Reference(*start.tolist())
        for k in range(1, cycles + 1):
            state = Conditioned(*shown, 0.0, 0.0, span, 0.0)
            shown = estimate_reference(SETTINGS, state, 0.0, k == cycles, k * DT, DT)
        moved.append(shown)
    x = SHARPNESS * SETTINGS.servo_frequency * span
    pole = max(1.0 / (1.0 + x + 0.5 * x * x), DT / span if cycles > 1 else 0.0)
    np.testing.assert_allclose(np.poly(np.array(moved) / 1e-6), np.poly([pole] * 3), atol=1e-7)


def test_one_contradiction_in_a_while_is_none_and_a_jump_after_a_rest_is_a_set_point() -> None:
    assert update_doubt(0.0, contradicts=True, jumps=False, dt=DT) == SLOWEST
    assert update_doubt(DT / 2, contradicts=True, jumps=False, dt=DT) == 2.0 * SLOWEST
    assert update_doubt(2.0 * SLOWEST, contradicts=False, jumps=False, dt=DT) == 2.0 * SLOWEST - DT
    assert update_doubt(DT / 2, contradicts=False, jumps=False, dt=DT) == 0.0
    assert update_doubt(DT, contradicts=True, jumps=True, dt=DT) == SLOWEST


def test_a_law_takes_servo_and_delay_to_its_conditioner() -> None:
    told = informed(LAW, Knowledge(servo_frequency=20.0, delay=0.01))
    assert told.conditioning == Conditioning(20.0, 0.01)
    assert informed(told, Knowledge(delay=0.02)).conditioning == Conditioning(20.0, 0.02)
