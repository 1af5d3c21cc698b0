"""The motor's electrical side: its current, from which `bowden.records.metrics.power` has Eq. 18."""

from typing import Annotated, NamedTuple

from bowden.core.kernel import kernel
from bowden.core.part import part
from bowden.core.quantity import Quantity


@part
class Motor(NamedTuple):
    """A geared motor with the bench's load; defaults: maxon EC-i 40, 70 W (Section 5.4) behind a 5:1 gear.

    >>> Motor(gear=10.0).torque_constant
    0.0167
    """

    torque_constant: Annotated[float, Quantity("torque constant", "N·m/A", symbol="kτ", gt=0.0, le=100.0)] = 16.7e-3
    resistance: Annotated[float, Quantity("terminal resistance", "Ω", symbol="R", gt=0.0, le=1e4)] = 0.199
    gear: Annotated[float, Quantity("motor turns per spool turn", gt=0.0, le=1e4)] = 5.0
    inertia: Annotated[float, Quantity("rotor and load, at the spool", "kg·m²", gt=0.0, le=100.0)] = 1.0e-4
    """A stated choice."""
    spring: Annotated[float, Quantity("stiffness of the joint's spring", "N·m/rad", ge=0.0, le=1e4)] = 0.2
    """A stated choice."""
    pretension: Annotated[float, Quantity("its torque at joint angle 0", "N·m", ge=0.0, le=1e4)] = 0.1
    """A stated choice."""
    current_limit: Annotated[float, Quantity("largest current of the drive", "A", gt=0.0, le=1e4)] = 20.0


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
