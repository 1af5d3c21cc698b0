"""The motor's electrical side: its current, from which `bowden.core.metrics.power` has Eq. 18."""

from typing import NamedTuple

from bowden.core.kernel import kernel


class Motor(NamedTuple):
    """A geared motor with the bench's load; defaults: maxon EC-i 40, 70 W (Section 5.4) behind a 5:1 gear."""

    torque_constant: float = 16.7e-3
    """kτ [N·m/A]."""
    resistance: float = 0.199
    """R, terminal resistance [Ω]."""
    gear: float = 5.0
    """Motor turns per spool turn [–]."""
    inertia: float = 1.0e-4
    """Rotor and load, at the spool [kg·m²]; a stated choice."""
    spring: float = 0.2
    """Stiffness of the bench's distal spring [N·m/rad]; a stated choice."""
    pretension: float = 0.1
    """Torque of the spring at joint angle zero [N·m]; a stated choice."""
    current_limit: float = 20.0
    """Largest current of the drive [A]."""


@kernel
def acceleration_limit(motor: Motor) -> float:
    """Largest acceleration of the unloaded spool at the current limit [rad/s²]."""
    return motor.torque_constant * motor.gear * motor.current_limit / motor.inertia


@kernel
def current(acceleration: float, joint: float, cable_slope: float, motor: Motor) -> float:
    """Motor current [A] that accelerates the spool and holds the spring at a `joint` angle through the cable.

    The cable is taken as free of loss for the torque (virtual work: torque × αφ).
    """
    load = cable_slope * (motor.pretension + motor.spring * joint)
    return (motor.inertia * acceleration + load) / (motor.gear * motor.torque_constant)
