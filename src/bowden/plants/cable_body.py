"""A plant round any cable, one cycle at a time; the cable's own kernels take the place of the placeholders here.

A cable is three kernels and the parameters that they are handed:

    start(cable, motor, width, slope_factor) -> memory
    advance(cable, memory, before, after, width, slope_factor, dt) -> memory
    look(cable, memory, motor, width, slope_factor) -> Seen

`memory` is a NamedTuple of floats and arrays (the arrays may be changed in place). `advance` gets that the motor has
gone one way from `before` to `after` within `dt`; a cable that does not know time leaves `dt` alone. `width` and
`slope_factor` are what the sheath's bend makes of them (`bowden.models.cable.sheath`).
"""

from typing import Any, NamedTuple

from bowden.core.kernel import exp, kernel, placeholder
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor, current
from bowden.models.drive.servo import (
    ServoState,
    ServoSteps,
    servo_acceleration,
    servo_is_free,
    servo_step,
    servo_turn,
)
from bowden.plants.bench import BenchColumns
from bowden.plants.plant import SheathState


class Seen(NamedTuple):
    """Observable quantities of a cable."""

    joint: float
    """Joint angle, before the load's lag [rad]."""
    torque: float
    """Of the cable on the motor's spool; NaN of a cable that knows no forces [N·m]."""
    h: float
    """The internal variable of a cable that has just one, else NaN [–]."""


@placeholder
def cable_start(cable: Any, motor: float, width: float, slope_factor: float) -> Any:
    """Placeholder for the cable's ``start``; `specialise` puts the cable's own in its place."""
    raise NotImplementedError  # always replaced


@placeholder
def cable_advance(
    cable: Any, memory: Any, before: float, after: float, width: float, slope_factor: float, dt: float
) -> Any:
    """Placeholder for the cable's ``advance``."""
    raise NotImplementedError  # always replaced


@placeholder
def cable_look(cable: Any, memory: Any, motor: float, width: float, slope_factor: float) -> Seen:
    """Placeholder for the cable's ``look``."""
    raise NotImplementedError  # always replaced


class Moving(NamedTuple):
    """State of a plant round a cable."""

    cable: Any
    """`Cable.prepared`."""
    servo: ServoSteps
    dt: float
    """One control cycle [s]."""
    load_lag: float
    """[s]"""
    slope: float
    """`Cable.slope`."""
    drive: Motor
    joint_encoder: Encoder
    motor_encoder: Encoder
    substeps: int
    """In one cycle [–]."""


class CableBody(NamedTuple):
    """Where everything is."""

    motor: ServoState
    memory: Any
    """The cable's."""
    seen: Seen
    """The cable as it is."""
    joint: float
    """Joint angle, behind the load's lag [rad]."""


@kernel
def cable_rest(plant: Moving, motor: float, sheath: SheathState) -> CableBody:
    """At rest at a `motor` angle [rad]."""
    memory = cable_start(plant.cable, motor, sheath.width, sheath.slope_factor)
    seen = cable_look(plant.cable, memory, motor, sheath.width, sheath.slope_factor)
    return CableBody(ServoState(motor, 0.0, 0.0), memory, seen, seen.joint)


@kernel
def cable_moved(
    plant: Moving, body: CableBody, applied: float, sheath: SheathState, next_sheath: SheathState
) -> CableBody:
    """One cycle later under the command `applied` [rad], while the sheath goes to the next.

    The cable is advanced where the motor turns and at the end of the cycle, with the time since it last was; the load's
    lag is solved exactly between cycles. The motor's step is that of `bowden.plants.bench.bench_moved`.
    """
    width, next_width = sheath.width, next_sheath.width
    factor, next_factor = sheath.slope_factor, next_sheath.slope_factor
    servo, cable, memory, dt = plant.servo.cycle, plant.cable, body.memory, plant.dt
    begun, velocity = body.motor.position, body.motor.velocity
    offset = begun - applied
    if not servo_is_free(offset, velocity, servo):
        return _cable_in_substeps(plant, body, applied, width, next_width, factor, next_factor, plant.substeps)
    moved = servo.xx * offset + servo.xv * velocity
    speed = servo.vx * offset + servo.vv * velocity
    turned, time = begun, 0.0
    if speed * velocity < 0.0:
        still, time = servo_turn(offset, velocity, servo)
        turned, part = still + applied, time / dt
        here, at = width + part * (next_width - width), factor + part * (next_factor - factor)
        memory = cable_advance(cable, memory, begun, turned, here, at, time)
    motor = ServoState(moved + applied, speed, servo_acceleration(moved, speed, servo))
    memory = cable_advance(cable, memory, turned, motor.position, next_width, next_factor, dt - time)
    seen = cable_look(cable, memory, motor.position, next_width, next_factor)
    return CableBody(motor, memory, seen, lagged(body.joint, body.seen.joint, seen.joint, dt, plant.load_lag))


@kernel
def _cable_in_substeps(
    plant: Moving,
    body: CableBody,
    applied: float,
    width: float,
    next_width: float,
    factor: float,
    next_factor: float,
    substeps: int,
) -> CableBody:
    """`cable_moved` for a servo at its limits, or one that is quick beside the cycle: it turns at ends of sub-steps."""
    motor, memory, dt = body.motor, body.memory, plant.dt
    turned, done = motor.position, 0
    for i in range(substeps):
        moved = servo_step(motor, applied, plant.servo.substep)
        if (moved.position - motor.position) * (motor.position - turned) < 0.0:
            part = i / substeps
            here, at = width + part * (next_width - width), factor + part * (next_factor - factor)
            memory = cable_advance(plant.cable, memory, turned, motor.position, here, at, (i - done) / substeps * dt)
            turned, done = motor.position, i
        motor = moved
    part = (substeps - done) / substeps
    memory = cable_advance(plant.cable, memory, turned, motor.position, next_width, next_factor, part * dt)
    seen = cable_look(plant.cable, memory, motor.position, next_width, next_factor)
    return CableBody(motor, memory, seen, lagged(body.joint, body.seen.joint, seen.joint, dt, plant.load_lag))


@kernel
def lagged(joint: float, before: float, after: float, dt: float, time_constant: float) -> float:
    """A first-order lag behind an input that goes straight from `before` to `after` in `dt` [s], exactly."""
    if time_constant <= 0.0:
        return after
    behind = (after - before) / dt * time_constant
    return after - behind + (joint - before + behind) * exp(-dt / time_constant)


@kernel
def spring_current(plant: Moving, body: CableBody, sheath: SheathState) -> float:
    """The current that holds the bench's spring through a cable that knows no forces [A]."""
    return current(body.motor.acceleration, body.joint, sheath.slope_factor * plant.slope, plant.drive)


@kernel
def torque_current(plant: Moving, body: CableBody, sheath: SheathState) -> float:
    """The current against the torque of a cable that knows it [A]."""
    drive = plant.drive
    return (drive.inertia * body.motor.acceleration + body.seen.torque) / (drive.gear * drive.torque_constant)


@kernel
def cable_columns(plant: Moving, body: CableBody) -> BenchColumns:
    """See `bowden.plants.plant`; those of the bench."""
    motor = body.motor
    return BenchColumns(body.joint, motor.position, motor.velocity, motor.acceleration, body.seen.h)
