"""A plant round any cable: servo, motor, encoders, sample time and delay as on the bench, and a load that may lag.

A cable is three kernels and the parameters that they are handed:

    start(cable, motor, width, slope_factor) -> memory
    advance(cable, memory, before, after, width, slope_factor, dt) -> memory
    look(cable, memory, motor, width, slope_factor) -> Seen

`memory` is a NamedTuple of floats and arrays (the arrays may be changed in place). `advance` is told that the motor has
gone one way from `before` to `after` within `dt`; a cable that does not know time leaves `dt` alone. `width` and
`slope_factor` are what the sheath's bend makes of them (`bowden.models.cable.sheath`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.kernel import exp, kernel
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath import slope_factor as slope_factor_at
from bowden.models.cable.sheath import width as width_at
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor, acceleration_limit
from bowden.models.drive.servo import Servo, ServoSteps, prepare_steps


class Seen(NamedTuple):
    """What there is to be seen of a cable."""

    joint: float
    """Joint angle, before the load's lag [rad]."""
    torque: float
    """Of the cable on the motor's spool; NaN of a cable that knows no forces [N·m]."""
    h: float
    """The internal variable of a cable that has just one, else NaN [–]."""


@dataclass(frozen=True)
class Cable:
    """Any cable, ready for `CablePlant`; `bowden.plants.cables` makes them."""

    name: str
    """Its kind."""
    parameters: Any
    """A NamedTuple of what its maker was given; goes to the trace's settings."""
    prepared: Any
    """What the kernels are handed as `cable`."""
    start: Callable[..., Any]
    """``start(cable, motor, width, slope_factor) -> memory``."""
    advance: Callable[..., Any]
    """``advance(cable, memory, before, after, width, slope_factor, dt) -> memory``."""
    look: Callable[..., Seen]
    """``look(cable, memory, motor, width, slope_factor) -> Seen``."""
    slope: float
    """Joint motion per motor motion once the play is taken up, at the identified bend [rad/rad]."""
    physical: bool = False
    """Whether it computes what its sheath loses; then the sheath's own `loss` must be 0."""


class CablePlant(NamedTuple):
    """All that a plant is made of; the same as the bench's but for the cable and the load."""

    cable: Cable
    sheath: Sheath = Sheath()
    servo: Servo = Servo()
    motor: Motor = Motor()
    joint_encoder: Encoder = Encoder()
    motor_encoder: Encoder = Encoder()
    sample_time: float = 1e-3
    """Ts, one control cycle [s]."""
    delay: int = 1
    """Cycles between a sample and the moment its command reaches the servo [–]."""
    substeps: int = 10
    """Servo sub-steps in one cycle, where one exact step will not do [–]."""
    load_lag: float = 0.0
    """Time constant with which the joint follows the cable's end; 0 for none [s]."""


def prepare_servo(plant: CablePlant) -> ServoSteps:
    """The servo for one cycle; its acceleration limit is the motor's current limit if that is lower.

    Raises:
        ParameterError: a servo that cannot be.
    """
    limit = min(plant.servo.acceleration_limit, acceleration_limit(plant.motor))
    return prepare_steps(plant.servo._replace(acceleration_limit=limit), plant.sample_time, plant.substeps)


def resting_motor(plant: CablePlant, joint: float, bend: float | None = None) -> float:
    """The motor angle at which a cable that starts there has its joint at `joint` [rad], found by secant steps.

    Args:
        plant: with its cable.
        joint: wanted [rad].
        bend: total bend of the sheath at the start; the identified one where it is not given [rad].

    Raises:
        ParameterError: the cable has its joint there at no motor angle.
    """
    angle = plant.sheath.bend if bend is None else bend
    width, factor = float(width_at(angle, plant.sheath)), float(slope_factor_at(angle, plant.sheath))
    cable = plant.cable

    def error(motor: float) -> float:
        memory = cable.start(cable.prepared, motor, width, factor)
        return float(cable.look(cable.prepared, memory, motor, width, factor).joint) - joint

    before, motor = 0.0, joint / (cable.slope * factor) + 1e-3
    left, now = error(before), error(motor)
    for _ in range(60):
        if abs(now) < 1e-13 or now == left:
            break
        before, motor, left = motor, motor - now * (motor - before) / (now - left), now
        now = error(motor)
    if not abs(now) < 1e-9:
        raise ParameterError(
            f"a {cable.name!r} cable cannot rest with its joint at {joint:g} rad but at {joint + now:g} rad",
            expected="an angle that its load lets the joint take",
        )
    return motor


@kernel
def lagged(joint: float, before: float, after: float, dt: float, time_constant: float) -> float:
    """A first-order lag behind an input that goes straight from `before` to `after` in `dt` [s], exactly."""
    if time_constant <= 0.0:
        return after
    behind = (after - before) / dt * time_constant
    return after - behind + (joint - before + behind) * exp(-dt / time_constant)
