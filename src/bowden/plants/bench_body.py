"""The bench, one cycle at a time; its cable's own kernels take the place of the placeholders here."""

from typing import Any, NamedTuple

from bowden.core.kernel import exp, kernel, placeholder
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor, current
from bowden.models.drive.servo import (
    ServoState,
    ServoSteps,
    servo_acceleration,
    servo_approach,
    servo_is_free,
    servo_turn,
)
from bowden.plants.cable import Seen
from bowden.plants.plant import SheathState


@placeholder
def cable_start(cable: Any, motor: float, width: float, slope_factor: float) -> Any:
    """Placeholder for the cable's ``start``; `specialise` puts the cable's own in its place."""
    raise NotImplementedError  # always replaced


@placeholder
def cable_advance(cable: Any, memory: Any, before: float, after: float, scaled: float, width: float, dt: float) -> Any:
    """Placeholder for the cable's ``advance``."""
    raise NotImplementedError  # always replaced


@placeholder
def cable_look(cable: Any, memory: Any, motor: float, width: float, slope_factor: float) -> Seen:
    """Placeholder for the cable's ``look``."""
    raise NotImplementedError  # always replaced


class Moving(NamedTuple):
    """A bench, prepared."""

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


class BenchBody(NamedTuple):
    """Where everything is."""

    motor: ServoState
    memory: Any
    """The cable's."""
    seen: Seen
    """The cable as it is."""
    joint: float
    """Joint angle, behind the load's lag [rad]."""


class BenchColumns(NamedTuple):
    """Columns of a trace of the bench; `BENCH_COLUMNS` has the units."""

    joint: float
    motor: float
    motor_velocity: float
    motor_acceleration: float
    h: float


BENCH_COLUMNS = {"joint": "rad", "motor": "rad", "motor_velocity": "rad/s", "motor_acceleration": "rad/s²", "h": "1"}


@kernel
def bench_rest(plant: Moving, motor: float, sheath: SheathState) -> BenchBody:
    """At rest at a `motor` angle [rad]."""
    memory = cable_start(plant.cable, motor, sheath.width, sheath.slope_factor)
    seen = cable_look(plant.cable, memory, motor, sheath.width, sheath.slope_factor)
    return BenchBody(ServoState(motor, 0.0, 0.0), memory, seen, seen.joint)


@kernel
def bench_moved(
    plant: Moving, body: BenchBody, applied: float, sheath: SheathState, next_sheath: SheathState
) -> BenchBody:
    """One cycle later under the command `applied` [rad], while the sheath goes straight to the next.

    A servo that meets no limit is taken through the whole cycle in one exact step, and through its turn, if there is
    one. The cable is advanced where the motor turns and at the end of the cycle, with the time since it last was; the
    load's lag is solved exactly between cycles.
    """
    width, next_width, dt = sheath.width, next_sheath.width, plant.dt
    servo, cable, memory = plant.servo.cycle, plant.cable, body.memory
    offset, velocity = body.motor.position - applied, body.motor.velocity
    if not servo_is_free(offset, velocity, servo):
        return _in_substeps(plant, body, applied, sheath, next_sheath, plant.substeps)
    begun, time = body.motor.position, 0.0
    moved = servo.xx * offset + servo.xv * velocity
    speed = servo.vx * offset + servo.vv * velocity
    if speed * velocity < 0.0:
        still, time = servo_turn(offset, velocity, servo)
        turn_width = width + (next_width - width) * time / dt
        way = scaled_way(still - offset, -velocity, time, width, turn_width)
        memory = cable_advance(cable, memory, begun, still + applied, way, turn_width, time)
        begun, offset, velocity, width = still + applied, still, 0.0, turn_width
    way = scaled_way(moved - offset, speed - velocity, dt - time, width, next_width)
    memory = cable_advance(cable, memory, begun, moved + applied, way, next_width, dt - time)
    return _ended(
        plant, body, ServoState(moved + applied, speed, servo_acceleration(moved, speed, servo)), memory, next_sheath
    )


@kernel
def _ended(plant: Moving, before: BenchBody, motor: ServoState, memory: Any, sheath: SheathState) -> BenchBody:
    """The bench at the end of a cycle, with its motor and the cable's memory where they are."""
    seen = cable_look(plant.cable, memory, motor.position, sheath.width, sheath.slope_factor)
    return BenchBody(motor, memory, seen, lagged(before.joint, before.seen.joint, seen.joint, plant.dt, plant.load_lag))


@kernel
def scaled_way(way: float, faster: float, time: float, width: float, next_width: float) -> float:
    """∫dm/w over a `way` [rad] in which the motor gains speed evenly, `faster` in all [rad/s], while w goes straight.

    About the middle of the time 1/w = (1 − x + x²)/w_m with x = w'·(t − t_m)/w_m; what is left out is of third order.
    """
    if next_width == width:  # a still sheath is spared all this
        return way * (1.0 / width)  # the sheath is known before the way
    middle = 0.5 * (width + next_width)
    growth = (next_width - width) / middle
    return (way * (1.0 + growth * growth / 12.0) - growth * faster * time / 12.0) / middle


@kernel
def _in_substeps(
    plant: Moving, body: BenchBody, applied: float, sheath: SheathState, next_sheath: SheathState, substeps: int
) -> BenchBody:
    """`bench_moved` for a servo at its limits, or one that is quick beside the cycle: it turns at ends of sub-steps.

    A cycle without a turn or a limit, in a still sheath, is one exact step to the same end; the velocity one sub-step
    `before` it follows from the sub-step's inverse.
    """
    servo, cycle, memory = plant.servo.substep, plant.servo.cycle, body.memory
    offset, velocity, begun, done = body.motor.position - applied, body.motor.velocity, body.motor.position, 0
    width, way, before = sheath.width, 0.0, velocity
    inverse_width = 1.0 / width
    moved = cycle.xx * offset + cycle.xv * velocity
    speed = cycle.vx * offset + cycle.vv * velocity
    if servo_is_free(offset, velocity, servo) and speed * velocity >= 0.0 and next_sheath.width == width:
        way = (moved - offset) * inverse_width
        before = (servo.xx * speed - servo.vx * moved) / (servo.xx * servo.vv - servo.xv * servo.vx)
        offset, velocity = moved, speed
    else:
        widening = (next_sheath.width - width) / substeps
        for i in range(substeps):
            before = velocity
            moved, velocity = servo_approach(offset, velocity, servo)
            if widening != 0.0:  # spares a still sheath the division
                inverse_width = 1.0 / (width + (i + 1.0) * widening)
            piece = (moved - offset) * inverse_width
            if piece * way < 0.0:
                at = offset + applied
                memory = cable_advance(plant.cable, memory, begun, at, way, width + i * widening, (i - done) * servo.dt)
                begun, done, way = at, i, 0.0
            way += piece
            offset = moved
    motor = ServoState(offset + applied, velocity, (velocity - before) / servo.dt)
    left = (substeps - done) * servo.dt
    memory = cable_advance(plant.cable, memory, begun, motor.position, way, next_sheath.width, left)
    return _ended(plant, body, motor, memory, next_sheath)


@kernel
def lagged(joint: float, before: float, after: float, dt: float, time_constant: float) -> float:
    """A first-order lag behind an input that goes straight from `before` to `after` in `dt` [s], exactly."""
    if time_constant <= 0.0:
        return after
    behind = (after - before) / dt * time_constant
    return after - behind + (joint - before + behind) * exp(-dt / time_constant)


@kernel
def spring_current(plant: Moving, body: BenchBody, sheath: SheathState) -> float:
    """The current that holds the bench's spring through a cable that knows no forces [A]."""
    return current(body.motor.acceleration, body.joint, sheath.slope_factor * plant.slope, plant.drive)


@kernel
def torque_current(plant: Moving, body: BenchBody, sheath: SheathState) -> float:
    """The current against the torque of a cable that knows it [A]."""
    drive = plant.drive
    return (drive.inertia * body.motor.acceleration + body.seen.torque) / (drive.gear * drive.torque_constant)


@kernel
def bench_columns(plant: Moving, body: BenchBody) -> BenchColumns:
    """See `bowden.plants.plant`."""
    motor = body.motor
    return BenchColumns(body.joint, motor.position, motor.velocity, motor.acceleration, body.seen.h)
