"""The motor's electrical side: energy is neither made nor lost but as heat."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.models.drive.motor import Motor, acceleration_limit, current
from bowden.records.metrics import power

MOTOR = Motor()


def test_current_limit_is_the_acceleration_limit_of_the_unloaded_spool() -> None:
    free = Motor(spring=0.0, pretension=0.0)
    assert current(acceleration_limit(free), 0.3, 0.9, free) == pytest.approx(free.current_limit)


@given(st.floats(-20.0, 20.0), st.floats(-30.0, 30.0))
def test_electrical_is_mechanical_power_and_heat(amperes: float, velocity: float) -> None:
    """Eq. 18."""
    torque_constant = MOTOR.gear * MOTOR.torque_constant
    mechanical, electrical = power(np.array([velocity]), np.array([amperes]), MOTOR.resistance, torque_constant)
    assert electrical - mechanical == pytest.approx(MOTOR.resistance * amperes**2, abs=1e-9)
    assert mechanical == pytest.approx(torque_constant * amperes * velocity, abs=1e-12)


def test_spring_and_inertia_give_back_what_they_took() -> None:
    """Through a cable without hysteresis the mechanical work of a closed cycle is zero."""
    t = np.linspace(0.0, 1.0, 4001)
    phase, slope = 2.0 * np.pi * t, 0.9
    motor, velocity = -0.6 * np.cos(phase), 0.6 * 2.0 * np.pi * np.sin(phase)
    amperes = current(0.6 * (2.0 * np.pi) ** 2 * np.cos(phase), slope * motor, slope, MOTOR)
    mechanical, _ = power(velocity, amperes, MOTOR.resistance, MOTOR.gear * MOTOR.torque_constant)
    assert np.trapezoid(mechanical, t) == pytest.approx(0.0, abs=1e-9)
    spring = 0.5 * MOTOR.spring * (slope * motor) ** 2 + MOTOR.pretension * slope * motor
    stored = spring + 0.5 * MOTOR.inertia * velocity**2
    work = np.concatenate(([0.0], np.cumsum(0.5 * (mechanical[1:] + mechanical[:-1]) * np.diff(t))))
    np.testing.assert_allclose(work, stored - stored[0], atol=1e-6)
