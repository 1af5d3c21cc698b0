"""The suit's motor: a PD position loop that sets a current, within what drive and supply can give, behind two gears.

    τ* = J·ω²·(target − spool) − 2·ζ·ω·J·d(spool)/dt,    I = τ*/(N·kτ), bounded by
    |I| ≤ I_max   and   |R·I + kτ·N·d(spool)/dt| ≤ V               the supply against the back-EMF
    J·d²spool/dt² = N·kτ·I − load − friction,    |friction| ≤ F + (1 − η)·max(|N·kτ·I|, |load|)

The current loop is taken as immediate. Friction is Coulomb's, solved implicitly: what it cannot stop it slows, and it
never turns the spool back. The gears' loss is a friction in proportion to the torque that they carry.
"""

import math
from typing import NamedTuple

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.models.servo import Servo


class GearedMotor(NamedTuple):
    """Motor, gears and spool; kτ, R and both gears are the paper's (Sections 2.2 and 5.4), the rest stated choices."""

    torque_constant: float = 16.7e-3
    """kτ [N·m/A]."""
    resistance: float = 0.199
    """R, terminal resistance [Ω]."""
    gear: float = 25.0
    """N, motor turns per spool turn: 5:1 and 5:1 [–]."""
    inertia: float = 1.6e-3
    """J, of rotor (25 g·cm²), gears and spool, at the spool [kg·m²]."""
    efficiency: float = 0.8
    """η, of both gears [–]."""
    friction: float = 0.5
    """F, of bearings, seals and the feeder's rollers, at the spool [N·m]."""
    current_limit: float = 20.0
    """Largest current of the drive [A]."""
    supply: float = 24.0
    """V [V]."""
    servo: Servo = Servo()
    """ω and ζ of the unloaded PD loop; its limits are not looked at, the current's and the supply's stand for them."""


class SpoolState(NamedTuple):
    """The spool's motion."""

    position: float
    """[rad]"""
    velocity: float
    """[rad/s]"""
    current: float
    """[A]"""


def check_geared_motor(motor: GearedMotor) -> None:
    """Refuse a motor that cannot be.

    Raises:
        ParameterError: a number out of its range.
    """
    for name in ("torque_constant", "resistance", "gear", "inertia", "current_limit", "supply"):
        value = getattr(motor, name)
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"suit motor: {name} is {value:g}", expected="a number above 0")
    if not 0.0 < motor.efficiency <= 1.0:
        raise ParameterError(f"suit motor: efficiency is {motor.efficiency:g}", expected="above 0 and at most 1")
    if not 0.0 <= motor.friction < math.inf:
        raise ParameterError(f"suit motor: friction is {motor.friction:g}", expected="a number not below 0")
    for name in ("natural_frequency", "damping"):
        value = getattr(motor.servo, name)
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"suit motor: servo {name} is {value:g}", expected="a number above 0")


@kernel
def motor_current(motor: GearedMotor, target: float, position: float, velocity: float) -> float:
    """Current of the PD loop for a `target` of the spool [rad] [A]."""
    omega = motor.servo.natural_frequency
    torque = motor.inertia * omega * (omega * (target - position) - 2.0 * motor.servo.damping * velocity)
    constant = motor.gear * motor.torque_constant
    lowest = np.fmax(-motor.current_limit, (-motor.supply - constant * velocity) / motor.resistance)
    highest = np.fmin(motor.current_limit, (motor.supply - constant * velocity) / motor.resistance)
    return np.fmax(lowest, np.fmin(highest, torque / constant))


@kernel
def turn_spool(
    motor: GearedMotor, state: SpoolState, current: float, load: float, stiffness: float, dt: float
) -> SpoolState:
    """The spool one sub-step later.

    Args:
        motor: its constants.
        state: before.
        current: [A].
        load: torque of the cables against a turning that flexes [N·m].
        stiffness: how fast the load grows with the spool's angle, for a step that no stiff cable upsets [N·m/rad].
        dt: [s].
    """
    torque = motor.gear * motor.torque_constant * current
    effort = dt / (motor.inertia + dt * dt * stiffness)
    free = state.velocity + effort * (torque - load - dt * stiffness * state.velocity)
    carried = np.fmax(np.abs(torque), np.abs(load))
    held = effort * (motor.friction + (1.0 - motor.efficiency) * carried)
    velocity = np.sign(free) * np.fmax(0.0, np.abs(free) - held)
    return SpoolState(state.position + dt * velocity, velocity, current)
