"""A rig on a person as one plant: any cable of the house, and what bodies, garments, drives and radio links add to it.

Round the servo, the cable and the encoders of `bowden.plants.bench.Bench`:

    target = motor, where a motor at rest is asked for less than `stick`;   the command, else
    pulled = cable's end + pushes + tremor + creep·(1 − e^(−t/T))
    load:    d²x/dt² = ω²·(pulled − x) − 2ζω·dx/dt          an arm that swings; x = pulled where ω is 0
    joint  = x below the stop, above it the stop and 5 % of what is beyond
    seen   = joint behind a first-order lag, and the last reading again while the link is lost

`worn_cable` is the cable: play operators side by side and a Bouc–Wen term, whose width grows along the stroke (as a
capstan's does), falls with speed (Stribeck), and whose slope changes along the stroke (a joint's or pulley's geometry).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.source import Measurement
from bowden.core.kernel import exp, kernel, sin
from bowden.models.cable.backlash import push
from bowden.models.cable.bouc_wen import BoucWen, PreparedCable, advance_prepared, prepare_cable
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.encoder import Encoder, reading
from bowden.models.drive.motor import Motor
from bowden.models.drive.servo import Servo, ServoStep, prepare, servo_approach
from bowden.plants.bench import Bench, prepare_bench
from bowden.plants.bench_body import BenchBody, BenchColumns, Moving, bench_moved, bench_rest, spring_current
from bowden.plants.cable import Cable, Seen
from bowden.plants.plant import Dynamics, SheathPath, SheathState, draw_for_encoders

Array = NDArray[np.float64]

PUSHES = 6
"""Pushes that a run can have."""
_RATTLE = 0.02
"""Speed below which a motor rests and sticks [rad/s]."""
_BEYOND = 0.05
"""Of a motion into the stop that is left."""


class Worn(NamedTuple):
    """What is added to a cable plant; with the defaults nothing."""

    load_frequency: float = 0.0
    """Natural frequency of the arm on the cable's end; 0 for none [rad/s]."""
    load_damping: float = 1.0
    """[–]"""
    push_times: tuple[float, ...] = (0.0,) * PUSHES
    """When each push begins [s]."""
    push_lengths: tuple[float, ...] = (1.0,) * PUSHES
    """How long it lasts [s]."""
    push_sizes: tuple[float, ...] = (0.0,) * PUSHES
    """How far it alone would move the joint, at most [rad]."""
    tremor: float = 0.0
    """Amplitude that tremor, steps or breath alone would move the joint by [rad]."""
    tremor_frequency: float = 6.0
    """[Hz]"""
    creep: float = 0.0
    """How far the joint goes as tendon and strap give [rad]."""
    creep_time: float = 10.0
    """[s]"""
    stop: float = math.inf
    """Joint angle at which garment or bone stop it [rad]."""
    sensor_lag: float = 0.0
    """Time constant of the joint's sensor [s]."""
    lost: float = 0.0
    """Time for which the link to the joint's sensor is lost, once in `lost_every` [s]."""
    lost_every: float = 1.0
    """[s]"""
    stick: float = 0.0
    """Motor angle that a command must be away from a resting motor to turn it [rad]."""


class WornParameters(NamedTuple):
    """A `WornRig` ready to be moved."""

    moving: Moving
    worn: Worn
    load: ServoStep
    follow: float
    """Share by which the sensor comes after in one cycle [–]."""


class WornBody(NamedTuple):
    """Where everything is."""

    cable: BenchBody
    load: float
    """The arm [rad]."""
    load_speed: float
    """[rad/s]"""
    joint: float
    """[rad]"""
    seen: float
    """The joint as its sensor has it, before it is counted [rad]."""
    last: float
    """The last reading of the joint that came through [rad]."""
    time: float
    """[s]"""


class WornRig(NamedTuple):
    """A cable plant as a person wears it."""

    inner: Bench
    worn: Worn

    @property
    def sheath(self) -> Sheath:
        """See `Plant.sheath`."""
        return self.inner.sheath

    @property
    def servo(self) -> Servo:
        """See `Plant.servo`."""
        return self.inner.servo

    @property
    def motor(self) -> Motor:
        """See `Plant.motor`."""
        return self.inner.motor

    @property
    def joint_encoder(self) -> Encoder:
        """See `Plant.joint_encoder`."""
        return self.inner.joint_encoder

    @property
    def motor_encoder(self) -> Encoder:
        """Of the motor."""
        return self.inner.motor_encoder

    @property
    def sample_time(self) -> float:
        """See `Plant.sample_time`."""
        return self.inner.sample_time

    @property
    def delay(self) -> int:
        """See `Plant.delay`."""
        return self.inner.delay

    def dynamics(self) -> Dynamics:
        """See `Plant.dynamics`."""
        cable, dt = self.inner.cable, self.inner.sample_time
        load = prepare(Servo(max(self.worn.load_frequency, 1e-3), self.worn.load_damping), dt)
        made = WornParameters(prepare_bench(self.inner), self.worn, load, dt / (self.worn.sensor_lag + dt))
        parts = {"cable_start": cable.start, "cable_advance": cable.advance, "cable_look": cable.look}
        name = f"worn_{cable.advance.__name__}"
        units = {"joint": "rad", "motor": "rad", "motor_velocity": "rad/s", "motor_acceleration": "rad/s²", "h": "1"}
        return Dynamics(name, made, worn_rest, worn_advance, worn_observe, worn_effort, units, worn_look, parts)

    def draw(self, seed: int, out: Array) -> None:
        """See `Plant.draw`."""
        draw_for_encoders((self.joint_encoder, self.motor_encoder), seed, out)

    def sheath_columns(self, joint: Array, path: SheathPath) -> dict[str, Array]:
        """See `Plant.sheath_columns`."""
        return self.inner.sheath_columns(joint, path)

    def resting_motor(self, joint: float, bend: float | None = None) -> float:
        """See `Plant.resting_motor`."""
        return self.inner.resting_motor(joint, bend)

    def describe(self) -> dict[str, Any]:
        """See `Plant.describe`."""
        return {**self.inner.describe(), "worn": self.worn._asdict()}


@kernel
def worn_rest(plant: WornParameters, motor: float, sheath: SheathState) -> WornBody:
    """See `bowden.plants.plant`."""
    body = bench_rest(plant.moving, motor, sheath)
    return WornBody(body, body.joint, 0.0, body.joint, body.joint, body.joint, 0.0)


@kernel
def moved_by_the_body(worn: Worn, time: float) -> float:
    """How far the wearer alone would move the joint at this time [rad]."""
    moved = worn.tremor * sin(2.0 * np.pi * worn.tremor_frequency * time) * (0.7 + 0.3 * sin(1.7 * time))
    for i in range(PUSHES):
        part = (time - worn.push_times[i]) / worn.push_lengths[i]
        if 0.0 < part < 1.0:
            moved += worn.push_sizes[i] * min(1.0, 4.0 * min(part, 1.0 - part))
    return moved + worn.creep * (1.0 - exp(-time / worn.creep_time))


@kernel
def worn_advance(
    plant: WornParameters, body: WornBody, applied: float, sheath: SheathState, next_sheath: SheathState
) -> WornBody:
    """One cycle later; see the module."""
    worn, motor, time = plant.worn, body.cable.motor, body.time + plant.moving.dt
    sticks = np.abs(motor.velocity) < _RATTLE and np.abs(applied - motor.position) < worn.stick
    cable = bench_moved(plant.moving, body.cable, motor.position if sticks else applied, sheath, next_sheath)
    pulled = cable.joint + moved_by_the_body(worn, time)
    load, speed = pulled, 0.0
    if worn.load_frequency > 0.0:
        offset, speed = servo_approach(body.load - pulled, body.load_speed, plant.load)
        load = offset + pulled
    joint = load if load < worn.stop else worn.stop + _BEYOND * (load - worn.stop)
    return WornBody(cable, load, speed, joint, body.seen + (joint - body.seen) * plant.follow, body.last, time)


@kernel
def worn_observe(plant: WornParameters, body: WornBody, normals: Array) -> tuple[WornBody, Measurement]:
    """What its sensors say; the joint's says the same again while its link is lost."""
    worn, moving = plant.worn, plant.moving
    joint = reading(body.seen, normals[0], moving.joint_encoder)
    if body.time % worn.lost_every < worn.lost and body.time > worn.lost_every:
        joint = body.last
    motor = reading(body.cable.motor.position, normals[1], moving.motor_encoder)
    measured = Measurement(joint, motor, np.nan, np.nan)
    return WornBody(body.cable, body.load, body.load_speed, body.joint, body.seen, joint, body.time), measured


@kernel
def worn_effort(plant: WornParameters, body: WornBody, sheath: SheathState) -> float:
    """The current against the bench's spring [A]."""
    return spring_current(plant.moving, body.cable, sheath)


@kernel
def worn_look(plant: WornParameters, body: WornBody) -> BenchColumns:
    """See `bowden.plants.plant`."""
    motor = body.cable.motor
    return BenchColumns(body.joint, motor.position, motor.velocity, motor.acceleration, body.cable.seen.h)


OPERATORS = 4
"""Play operators of a `worn_cable`."""


class WornCable(NamedTuple):
    """What a `worn_cable` is made of."""

    slope: float
    """Joint motion per motor motion, at joint angle zero [rad/rad]."""
    half_widths: tuple[float, ...] = (0.05,) * OPERATORS
    """Of the play operators, of motor travel [rad]."""
    weights: tuple[float, ...] = (0.25,) * OPERATORS
    """Of the same, 1 together [–]."""
    height: float = 0.0
    """αh of the Bouc–Wen term; below 0 the joint first runs the wrong way, if steep [rad]."""
    rate: float = 9.256
    """ρ of the term [1/rad]."""
    curve: float = 0.0
    """Share by which the slope grows in a radian of the joint [1/rad]."""
    wedge: float = 0.0
    """Share by which the width grows in a radian of the motor [1/rad]."""
    stribeck: float = 0.0
    """Share by which the width of a cable that creeps is larger than one that slides [–]."""
    stribeck_speed: float = 0.1
    """Speed of the motor at which that is 1/e [rad/s]."""
    place: float = 0.0
    """Where in the dead zone it begins, −1…1 [–]."""


class PreparedWorn(NamedTuple):
    """A `WornCable` ready to be moved."""

    cable: WornCable
    hysteresis: PreparedCable


class WornMemory(NamedTuple):
    """What the cable remembers."""

    z: Array
    """Of the play operators (k,); changed in place [rad]."""
    h: float
    """Of the Bouc–Wen term [–]."""


@kernel
def worn_start(cable: PreparedWorn, motor: float, width: float, slope_factor: float) -> WornMemory:
    """At rest somewhere in the dead zone."""
    z = np.empty(OPERATORS)
    for i in range(OPERATORS):
        z[i] = motor + cable.cable.place * width * cable.cable.half_widths[i]
    return WornMemory(z, 0.0)


@kernel
def worn_pushed(
    cable: PreparedWorn, memory: WornMemory, before: float, after: float, scaled: float, width: float, dt: float
) -> WornMemory:
    """Every play operator pushed by the motor, and the Bouc–Wen term over its travel; in place."""
    made = cable.cable
    creeping = exp(-np.abs(after - before) / (max(dt, 1e-9) * made.stribeck_speed))
    wide = width * max(0.2, 1.0 + made.wedge * after) * (1.0 + made.stribeck * creeping)
    for i in range(OPERATORS):
        memory.z[i] = push(memory.z[i], after, wide * made.half_widths[i])
    return WornMemory(memory.z, advance_prepared(memory.h, (after - before) / wide, cable.hysteresis))


@kernel
def worn_seen(cable: PreparedWorn, memory: WornMemory, motor: float, width: float, slope_factor: float) -> Seen:
    """Where its end is."""
    made, moved = cable.cable, 0.0
    for i in range(OPERATORS):
        moved += made.weights[i] * memory.z[i]
    joint = slope_factor * made.slope * moved * (1.0 + 0.5 * made.curve * moved)
    return Seen(joint + width * made.height * memory.h, np.nan, memory.h)


def worn_cable(cable: WornCable) -> Cable:
    """The cable for a bench."""
    term = BoucWen(slope=cable.slope, hysteresis_gain=cable.height, rate=cable.rate)
    prepared = PreparedWorn(cable, prepare_cable(term))
    return Cable("worn", cable, prepared, worn_start, worn_pushed, worn_seen, cable.slope)
