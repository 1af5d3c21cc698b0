"""The bench as one plant: servo, cable in its sheath, and the distal spring (Fig. 7A)."""

from typing import NamedTuple

from bowden.core.kernel import kernel
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import BoucWen, PreparedCable, advance_prepared, prepare_cable
from bowden.models.cable.sheath import Sheath, joint_in_sheath
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor, acceleration_limit
from bowden.models.drive.servo import (
    Servo,
    ServoState,
    ServoStep,
    prepare_steps,
    servo_acceleration,
    servo_approach,
    servo_is_free,
    servo_turn,
)


class Bench(NamedTuple):
    """All that the bench is made of."""

    cable: BoucWen = BoucWen()
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
    """Plant sub-steps in one cycle, where one exact step will not do [–]."""


class BenchStep(NamedTuple):
    """A bench prepared for one length of cycle and of sub-step."""

    cable: BoucWen
    hysteresis: PreparedCable
    servo: ServoStep
    """Over one sub-step."""
    cycle: ServoStep
    """Over one cycle; see `ServoSteps`."""


class BenchState(NamedTuple):
    """Where everything is."""

    motor: ServoState
    h: float
    """The cable's hysteresis variable [–]."""
    joint: float
    """Joint angle [rad]."""


def prepare_bench(bench: Bench) -> BenchStep:
    """The bench ready to be moved; the servo's acceleration limit is the motor's current limit if that is lower."""
    limit = min(bench.servo.acceleration_limit, acceleration_limit(bench.motor))
    servo = bench.servo._replace(acceleration_limit=limit)
    return BenchStep(bench.cable, prepare_cable(bench.cable), *prepare_steps(servo, bench.sample_time, bench.substeps))


@kernel
def bench_start(bench: BenchStep, motor: float, width: float, slope_factor: float) -> BenchState:
    """At rest at a `motor` angle [rad] with h = 0."""
    return bench_at(bench, ServoState(motor, 0.0, 0.0), 0.0, width, slope_factor)


@kernel
def bench_at(bench: BenchStep, motor: ServoState, h: float, width: float, slope_factor: float) -> BenchState:
    """The bench with its motor and its cable's h where they are, in a sheath of that width and slope factor."""
    return BenchState(motor, h, joint_in_sheath(motor.position, h, width, slope_factor, bench.cable))


@kernel
def bench_moved(
    bench: BenchStep, plant: BenchState, applied: float, width: float, next_width: float, factor: float, substeps: int
) -> BenchState:
    """The bench one cycle later under the command `applied` [rad], in a sheath whose width goes straight to the next.

    The cable does not know time: only where the motor turns has its travel to be cut. A servo that meets no limit is
    taken through the whole cycle in one exact step, and through its turn, if there is one. `factor` is the slope's at
    the end of the cycle.
    """
    offset, velocity = plant.motor.position - applied, plant.motor.velocity
    if not servo_is_free(offset, velocity, bench.cycle):
        return _bench_in_substeps(bench, plant, applied, width, next_width, factor, substeps)
    servo, h = bench.cycle, plant.h
    moved = servo.xx * offset + servo.xv * velocity
    speed = servo.vx * offset + servo.vv * velocity
    if speed * velocity < 0.0:
        turn, time = servo_turn(offset, velocity, servo)
        turn_width = width + (next_width - width) * time / servo.dt
        h = advance_prepared(h, _travel(turn - offset, -velocity, time, width, turn_width), bench.hysteresis)
        travel = _travel(moved - turn, speed, servo.dt - time, turn_width, next_width)
    else:
        travel = _travel(moved - offset, speed - velocity, servo.dt, width, next_width)
    h = advance_prepared(h, travel, bench.hysteresis)
    motor = ServoState(moved + applied, speed, servo_acceleration(moved, speed, servo))
    return bench_at(bench, motor, h, next_width, factor)


@kernel
def _travel(way: float, faster: float, time: float, width: float, next_width: float) -> float:
    """∫dm/w over a `way` [rad] in which the motor gains speed evenly, `faster` in all [rad/s], while w goes straight.

    About the middle of the time 1/w = (1 − x + x²)/w_m with x = w'·(t − t_m)/w_m; what is left out is of third order.
    """
    if next_width == width:  # a still sheath is spared all this
        return way * (1.0 / width)  # the sheath is known before the way
    middle = 0.5 * (width + next_width)
    growth = (next_width - width) / middle
    return (way * (1.0 + growth * growth / 12.0) - growth * faster * time / 12.0) / middle


@kernel
def _bench_in_substeps(
    bench: BenchStep, plant: BenchState, applied: float, width: float, next_width: float, factor: float, substeps: int
) -> BenchState:
    """`bench_moved` for a servo at its limits, or one that is quick beside the cycle: it turns at ends of sub-steps."""
    offset, velocity = plant.motor.position - applied, plant.motor.velocity
    before, h, travel = velocity, plant.h, 0.0
    widening = (next_width - width) / substeps
    inverse_width = 1.0 / width
    for i in range(substeps):
        before = velocity
        moved, velocity = servo_approach(offset, velocity, bench.servo)
        if widening != 0.0:  # spares a still sheath the division
            inverse_width = 1.0 / (width + (i + 1.0) * widening)
        piece = (moved - offset) * inverse_width
        if piece * travel < 0.0:
            h, travel = advance_prepared(h, travel, bench.hysteresis), 0.0
        travel += piece
        offset = moved
    h = advance_prepared(h, travel, bench.hysteresis)
    motor = ServoState(offset + applied, velocity, (velocity - before) / bench.servo.dt)
    return bench_at(bench, motor, h, next_width, factor)


PAPER_ENCODER = Encoder(resolution=360.0 / 16384 * RADIANS, noise=0.01 * RADIANS)
"""4096 lines counted fourfold (0.022°) and 0.01° of noise: a stated choice, the paper names none."""
