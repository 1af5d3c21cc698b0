"""The servo: against python-control where it is linear, and its limits where it is not."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.models.drive.servo import Servo, ServoState, prepare, servo_acceleration, servo_step

step = compiled(servo_step)
REST = ServoState(0.0, 0.0, 0.0)


def run(servo: Servo, dt: float, commands: np.ndarray, state: ServoState = REST) -> np.ndarray:
    """Position and velocity before each command takes effect, (n, 2)."""
    prepared, states = prepare(servo, dt), []
    for command in commands.tolist():
        states.append(state[:2])
        state = step(state, command, prepared)
    return np.array(states)


@pytest.mark.parametrize("damping", [0.2, 0.7, 1.0 - 1e-7, 1.0, 1.0 + 1e-12, 1.0 + 1e-5, 1.8, 6.0])
@pytest.mark.parametrize("dt", [1e-4, 1e-3, 2e-2])
def test_against_python_control(damping: float, dt: float) -> None:
    """Oracle: the zero-order hold of the continuous second-order system."""
    omega = 54.4
    continuous = control.ss([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]], [[0.0], [omega**2]], np.eye(2), 0)
    held = control.sample_system(continuous, dt, method="zoh")
    commands = np.cumsum(np.random.default_rng(0).normal(0.0, 0.1, 500))
    expected = control.forced_response(held, T=np.arange(500) * dt, U=commands).outputs.T
    actual = run(Servo(omega, damping), dt, commands)
    np.testing.assert_allclose(actual[:, 0], expected[:, 0], atol=1e-9)
    np.testing.assert_allclose(actual[:, 1], expected[:, 1], atol=1e-9 * omega)


@given(st.floats(0.1, 5.0), st.floats(1.0, 300.0), st.floats(-2.0, 2.0), st.floats(-50.0, 50.0), st.integers(2, 20))
def test_splitting_a_step_changes_nothing(damping: float, omega: float, x: float, v: float, parts: int) -> None:
    servo, start = Servo(omega, damping), ServoState(x, v, 0.0)
    whole = run(servo, 1e-3, np.full(2, 0.3), start)[-1]
    pieces = run(servo, 1e-3 / parts, np.full(parts + 1, 0.3), start)[-1]
    np.testing.assert_allclose(pieces, whole, rtol=1e-10, atol=1e-10)


@given(st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=30), st.floats(0.1, 5.0), st.floats(1.0, 500.0))
@settings(max_examples=50)
def test_limits_are_kept(commands: list[float], speed: float, acceleration: float) -> None:
    servo = Servo(speed_limit=speed, acceleration_limit=acceleration)
    dt = 1e-3
    motion = run(servo, dt, np.repeat(commands, 20))
    assert np.abs(motion[:, 1]).max() <= speed * (1.0 + 1e-12)
    assert np.abs(np.diff(motion[:, 1])).max() <= acceleration * dt * (1.0 + 1e-9)
    assert np.abs(np.diff(motion[:, 0])).max() <= speed * dt * (1.0 + 1e-9)


def test_limited_servo_arrives_and_unreached_limits_change_nothing() -> None:
    commands = np.full(4000, 1.0)
    free = run(Servo(), 1e-3, commands)
    assert run(Servo(speed_limit=1.2 * np.abs(free[:, 1]).max()), 1e-3, commands).tolist() == free.tolist()
    slow = run(Servo(speed_limit=0.5, acceleration_limit=20.0), 1e-3, commands)
    assert slow[-1] == pytest.approx([1.0, 0.0], abs=1e-9)
    assert slow[2000, 0] == pytest.approx(0.5 * 2.0 - 0.5 * 0.5**2 / 20.0, abs=2e-3)  # up to speed in 25 ms, then along


def test_acceleration_is_what_changed_the_speed() -> None:
    state = step(ServoState(0.2, -1.0, 0.0), 0.9, prepare(Servo(), 1e-3))
    assert state.acceleration == pytest.approx((state.velocity + 1.0) / 1e-3)


@given(st.floats(1.0, 300.0), st.floats(0.1, 3.0), st.floats(-1.0, 1.0), st.floats(-9.0, 9.0))
def test_free_it_accelerates_by_its_spring_and_its_damper(omega: float, zeta: float, off: float, v: float) -> None:
    found = servo_acceleration(off, v, prepare(Servo(omega, zeta), 1e-3))
    assert found == pytest.approx(-(omega**2) * off - 2.0 * zeta * omega * v, rel=1e-9, abs=1e-9)


def test_bandwidth_of_the_default_servo() -> None:
    """Critically damped at 54.4 rad/s it is 3 dB down at 35 rad/s, the observer's bandwidth in Fig. 16."""
    dt, omega = 1e-4, 35.0
    time = np.arange(60_000) * dt
    motion = run(Servo(), dt, np.sin(omega * time))[20_000:, 0]
    basis = np.stack((np.sin(omega * time), np.cos(omega * time)), axis=1)[20_000:]
    gain = np.hypot(*np.linalg.lstsq(basis, motion)[0])
    assert gain == pytest.approx(math.sqrt(0.5), abs=2e-4)


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
