"""The bench as one plant: servo, cable in its sheath, and the distal spring (Fig. 7A)."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.models.cable.bouc_wen import BoucWen, PreparedCable, advance_prepared, prepare_cable
from bowden.models.cable.sheath import Sheath, joint_in_sheath, slope_factor
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor, acceleration_limit, current
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
from bowden.plants.plant import (
    Dynamics,
    SheathPath,
    SheathState,
    check_numbers,
    draw_for_encoders,
    plain,
    read_encoders,
)

Array = NDArray[np.float64]


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

    def dynamics(self) -> Dynamics:
        """See `Plant.dynamics`.

        Raises:
            ParameterError: a part that cannot be.
        """
        return Dynamics(
            "bench",
            prepare_bench(self),
            bench_rest,
            bench_advance,
            read_encoders,
            bench_effort,
            BENCH_COLUMNS,
            bench_look,
        )

    def draw(self, seed: int, out: Array) -> None:
        """See `Plant.draw`."""
        draw_for_encoders((self.joint_encoder, self.motor_encoder), seed, out)

    def sheath_columns(self, joint: Array, path: SheathPath) -> dict[str, Array]:
        """See `Plant.sheath_columns`."""
        return {"width": path.widths[:-1], "slope": path.slope_factors[:-1] * self.cable.slope}

    def resting_motor(self, joint: float, bend: float | None = None) -> float:
        """See `Plant.resting_motor`: with h = 0.

        Raises:
            ParameterError: a cable whose slope is 0.
        """
        slope = self.cable.slope * float(slope_factor(self.sheath.bend if bend is None else bend, self.sheath))
        if slope == 0.0:
            raise ParameterError("bench: the cable's slope is 0", expected="a cable that moves the joint")
        return (joint - self.cable.offset) / slope

    def describe(self) -> dict[str, Any]:
        """See `Plant.describe`."""
        return dict(plain(self))


class BenchStep(NamedTuple):
    """A bench prepared for one length of cycle and of sub-step."""

    cable: BoucWen
    hysteresis: PreparedCable
    servo: ServoStep
    """Over one sub-step."""
    cycle: ServoStep
    """Over one cycle; see `ServoSteps`."""
    motor: Motor
    joint_encoder: Encoder
    motor_encoder: Encoder
    substeps: int
    """In one cycle [–]."""


class BenchState(NamedTuple):
    """Where everything is."""

    motor: ServoState
    h: float
    """The cable's hysteresis variable [–]."""
    joint: float
    """Joint angle [rad]."""


class BenchColumns(NamedTuple):
    """Columns of a trace of the bench; `BENCH_COLUMNS` has the units."""

    joint: float
    motor: float
    motor_velocity: float
    motor_acceleration: float
    h: float


BENCH_COLUMNS = {"joint": "rad", "motor": "rad", "motor_velocity": "rad/s", "motor_acceleration": "rad/s²", "h": "1"}
"""Of a bench, and of a plant round any cable."""


def prepare_bench(bench: Bench) -> BenchStep:
    """The bench ready to be moved; the servo's acceleration limit is the motor's current limit if that is lower.

    Raises:
        ParameterError: a part that cannot be.
    """
    check_numbers(bench, "bench")
    check_bouc_wen(bench.cable, "bench")
    if bench.substeps < 1:
        raise ParameterError(f"bench: substeps is {bench.substeps}", expected="1 or more")
    limit = min(bench.servo.acceleration_limit, acceleration_limit(bench.motor))
    servo = bench.servo._replace(acceleration_limit=limit)
    steps = prepare_steps(servo, bench.sample_time, bench.substeps)
    encoders = bench.joint_encoder, bench.motor_encoder
    return BenchStep(bench.cable, prepare_cable(bench.cable), *steps, bench.motor, *encoders, bench.substeps)


def check_bouc_wen(cable: BoucWen, where: str) -> None:
    """Refuse a cable whose h has no bound.

    Raises:
        ParameterError: ρ, n or σ out of its range.
    """
    for name, least in (("rate", 0.0), ("shape", 0.5), ("exponent", 0.0)):
        value = getattr(cable, name)
        if not least < value < math.inf:
            raise ParameterError(f"{where}: the cable's {name} is {value:g}", expected=f"a number above {least:g}")


@kernel
def bench_rest(bench: BenchStep, motor: float, sheath: SheathState) -> BenchState:
    """See `bowden.plants.plant`; with h = 0."""
    return bench_at(bench, ServoState(motor, 0.0, 0.0), 0.0, sheath.width, sheath.slope_factor)


@kernel
def bench_advance(
    bench: BenchStep, body: BenchState, applied: float, sheath: SheathState, next_sheath: SheathState
) -> BenchState:
    """See `bowden.plants.plant` and `bench_moved`."""
    return bench_moved(bench, body, applied, sheath.width, next_sheath.width, next_sheath.slope_factor, bench.substeps)


@kernel
def bench_effort(bench: BenchStep, body: BenchState, sheath: SheathState) -> float:
    """The current that accelerates the spool and holds the bench's spring [A]."""
    return current(body.motor.acceleration, body.joint, sheath.slope_factor * bench.cable.slope, bench.motor)


@kernel
def bench_look(bench: BenchStep, body: BenchState) -> BenchColumns:
    """See `bowden.plants.plant`."""
    motor = body.motor
    return BenchColumns(body.joint, motor.position, motor.velocity, motor.acceleration, body.h)


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
    """`bench_moved` for a servo at its limits, or one that is quick beside the cycle: it turns at ends of sub-steps.

    A cycle without a turn or a limit, in a still sheath, is one exact step to the same end; the velocity one sub-step
    `before` it follows from the sub-step's inverse.
    """
    offset, velocity = plant.motor.position - applied, plant.motor.velocity
    before, h, travel = velocity, plant.h, 0.0
    servo, cycle, inverse_width = bench.servo, bench.cycle, 1.0 / width
    moved = cycle.xx * offset + cycle.xv * velocity
    speed = cycle.vx * offset + cycle.vv * velocity
    if servo_is_free(offset, velocity, servo) and speed * velocity >= 0.0 and next_width == width:
        travel = (moved - offset) * inverse_width
        before = (servo.xx * speed - servo.vx * moved) / (servo.xx * servo.vv - servo.xv * servo.vx)
        offset, velocity = moved, speed
    else:
        widening = (next_width - width) / substeps
        for i in range(substeps):
            before = velocity
            moved, velocity = servo_approach(offset, velocity, servo)
            if widening != 0.0:  # spares a still sheath the division
                inverse_width = 1.0 / (width + (i + 1.0) * widening)
            piece = (moved - offset) * inverse_width
            if piece * travel < 0.0:
                h, travel = advance_prepared(h, travel, bench.hysteresis), 0.0
            travel += piece
            offset = moved
    h = advance_prepared(h, travel, bench.hysteresis)
    motor = ServoState(offset + applied, velocity, (velocity - before) / servo.dt)
    return bench_at(bench, motor, h, next_width, factor)
