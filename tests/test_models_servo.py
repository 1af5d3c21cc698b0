"""The servo: the exact solution where it is linear, constant acceleration at its limits, and its turns."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.models.drive.servo import (
    LONGEST_CYCLE,
    Servo,
    ServoState,
    prepare,
    prepare_steps,
    servo_acceleration,
    servo_is_free,
    servo_step,
    servo_turn,
)

step = compiled(servo_step)
dampings = st.one_of(st.floats(0.05, 6.0), st.sampled_from([1.0 - 1e-7, 1.0, 1.0 + 1e-12, 1.0 + 1e-5]))
frequencies, offsets, speeds = st.floats(1.0, 300.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)
limits = st.one_of(st.just(math.inf), st.floats(0.01, 3.0))


def exactly(servo: Servo, time: float, x: float, v: float) -> NDArray[np.float64]:
    """Offset from the command and speed of the unlimited servo after a time: the matrix exponential, by SciPy."""
    omega, zeta = servo.natural_frequency, servo.damping
    return np.asarray(expm(time * np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]])) @ [x, v])


@given(dampings, frequencies, offsets, speeds, st.floats(1e-3, 3.0), limits, limits, offsets)
def test_a_step_is_exact_and_at_a_limit_one_of_constant_acceleration(
    damping: float, omega: float, x: float, v: float, angle: float, fast: float, strong: float, command: float
) -> None:
    """In the servo's own time: ω·t, v/ω and a/ω²."""
    dt, begun = angle / omega, max(-fast, min(fast, v)) * omega
    servo = Servo(omega, damping, fast * omega, strong * omega**2)
    free = exactly(servo, dt, x, begun)
    limited = np.clip(free[1], begun - strong * omega**2 * dt, begun + strong * omega**2 * dt)
    limited = np.clip(limited, -fast * omega, fast * omega)
    end = free[0] if limited == free[1] else x + 0.5 * dt * (begun + limited)
    after = ServoState(*step(ServoState(command + x, begun, 0.0), command, prepare(servo, dt)))
    assert after.position - command == pytest.approx(end, abs=1e-8)
    assert after.velocity == pytest.approx(limited, abs=1e-8 * omega)
    assert after.acceleration == pytest.approx((after.velocity - begun) / dt, abs=1e-6 * omega)


@given(dampings, frequencies, offsets, speeds, st.floats(1e-3, LONGEST_CYCLE), st.floats(0.1, 3.0), st.floats(0.1, 3.0))
@example(1.0, 50.0, 0.0, 0.0, 0.2, 1.0, 1.0)
def test_who_is_called_free_meets_no_limit_within_the_cycle(
    damping: float, omega: float, x: float, v: float, angle: float, fast: float, strong: float
) -> None:
    servo, dt = Servo(omega, damping, fast * omega, strong * omega**2), angle / omega
    steps = prepare_steps(servo, dt, 4)
    strain = abs(servo_acceleration(x, v * omega, steps.cycle)) + omega * abs(v * omega)
    most = min(strong, fast) * omega**2 * math.exp(-(1.0 + 2.0 * damping) * angle)
    assert servo_is_free(x, v * omega, steps.cycle) == (strain <= most)
    if strain <= most:
        for time in np.linspace(0.0, dt, 7).tolist():
            offset, speed = exactly(servo, time, x, v * omega).tolist()
            assert abs(speed) <= fast * omega * (1.0 + 1e-9)
            assert abs(servo_acceleration(offset, speed, steps.cycle)) <= strong * omega**2 * (1.0 + 1e-9)
    assert steps.substep == prepare(servo, dt / 4)._replace(reach=steps.cycle.reach)
    assert not servo_is_free(0.0, 0.0, prepare_steps(servo, 1.01 * LONGEST_CYCLE / omega, 4).cycle)


@given(dampings, frequencies, offsets, speeds)
def test_a_turn_is_where_and_when_the_speed_is_zero(damping: float, omega: float, x: float, v: float) -> None:
    servo, dt = Servo(omega, damping), LONGEST_CYCLE / omega
    if exactly(servo, dt, x, v * omega)[1] * v < 0.0:
        still, time = servo_turn(x, v * omega, prepare(servo, dt))
        assert 0.0 <= time <= dt
        found = exactly(servo, time, x, v * omega)
        assert found[0] == pytest.approx(still, abs=1e-10)
        assert found[1] == pytest.approx(0.0, abs=1e-8 * omega)


@given(frequencies, st.floats(0.1, 3.0), offsets, speeds)
def test_free_it_accelerates_by_its_spring_and_its_damper(omega: float, zeta: float, off: float, v: float) -> None:
    found = servo_acceleration(off, v * omega, prepare(Servo(omega, zeta), 1e-3))
    assert found == pytest.approx(-(omega**2) * (off + 2.0 * zeta * v), rel=1e-9, abs=1e-9)


def test_bandwidth_of_the_default_servo() -> None:
    """Critically damped at 54.4 rad/s it is 3 dB down at 35 rad/s, the observer's bandwidth in Fig. 16."""
    assert 1.0 / (1.0 + (35.0 / Servo().natural_frequency) ** 2) == pytest.approx(math.sqrt(0.5), abs=2e-4)


@pytest.mark.parametrize(
    ("servo", "dt"),
    [
        (Servo(natural_frequency=0.0), 1e-3),
        (Servo(damping=-1.0), 1e-3),
        (Servo(speed_limit=0.0), 1e-3),
        (Servo(acceleration_limit=math.nan), 1e-3),
        (Servo(), 0.0),
    ],
)
def test_absurd_servos_are_refused(servo: Servo, dt: float) -> None:
    with pytest.raises(ParameterError, match="expected a number above 0"):
        prepare(servo, dt)
