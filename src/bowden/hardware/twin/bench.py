"""The simulated bench behind the twin, moved on in real time.

With torque the motor is the servo of the simulation. Without, it coasts to a stop: dω/dt = −ω/τ, a stated choice; the
cable's friction and the gear are taken to hold the joint's spring. A quick stop brakes at a constant rate. The cable's
end follows the motor, or, with slack s, the play between motor − s and motor. A torn cable lets the joint go to where
its spring is at rest, x' = (rest − x)/τ. The power stage is one thermal mass: τ·dT/dt = T₀ + R·r·i² − T.
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel, reached, specialise
from bowden.models.cable.sheath_path import BendPath
from bowden.models.drive.encoder import reading
from bowden.models.drive.servo import servo_approach
from bowden.plants.bench import Bench
from bowden.plants.cable_body import Moving, Seen, cable_advance, cable_look, cable_rest, lagged
from bowden.plants.cable_plant import CablePlant
from bowden.plants.cables import as_cable_plant
from bowden.plants.plant import SheathState, sheath_state


class Doing(IntEnum):
    """What the motor does."""

    OFF = 0
    FOLLOW = 1
    BRAKE = 2


OFF, FOLLOW, BRAKE = Doing

LONGEST_GAP = 1.0
"""Time that one call makes up for at most; a twin that was stopped for longer has lost it [s]."""


class Physics(NamedTuple):
    """What the rig does not say; stated choices."""

    coasting: float = 0.02
    """τ of the motor without torque [s]."""
    braking: float = 400.0
    """Deceleration of the quick stop, at the spool [rad/s²]."""
    spool_radius: float = 0.02
    """[m]"""
    spring_return: float = 0.05
    """τ of the joint when its cable is torn [s]."""
    ambient: float = 30.0
    """T₀ of the power stage [°C]."""
    thermal_resistance: float = 6.0
    """R of the power stage [K/W]."""
    stage_resistance: float = 0.05
    """r, of the power stage's transistors [Ω]."""
    thermal_time: float = 60.0
    """τ of the power stage [s]."""


def stage_temperature(physics: Physics, before: float, current: float, elapsed: float) -> float:
    """Of the power stage after `elapsed` [s] under a `current` [A] [°C]."""
    end = physics.ambient + physics.thermal_resistance * physics.stage_resistance * current**2
    return before + (end - before) * (1.0 - math.exp(-elapsed / physics.thermal_time))


class BenchMotion(NamedTuple):
    """Where motor and cable are."""

    position: float
    """Of the motor at the spool [rad]."""
    velocity: float
    """[rad/s]"""
    acceleration: float
    """Mean of the last sub-step [rad/s²]."""
    end: float
    """Of the cable on the motor's side, in motor angle [rad]."""
    memory: Any
    """The cable's."""
    seen: Seen
    """The cable as it is."""
    joint: float
    """Joint angle, behind the load's lag [rad]."""


class Sheathing(NamedTuple):
    """The sheath at both ends of a stretch of time."""

    before: SheathState
    after: SheathState


@kernel
def at_rest(plant: Moving, motor: float, sheath: SheathState) -> BenchMotion:
    """At rest at a motor angle [rad]."""
    body = cable_rest(plant, motor, sheath)
    return BenchMotion(motor, 0.0, 0.0, motor, body.memory, body.seen, body.joint)


@kernel
def move(
    plant: Moving,
    motion: BenchMotion,
    doing: Doing,
    command: float,
    count: int,
    sheathing: Sheathing,
    coast: float,
    braking: float,
    slack: float,
) -> BenchMotion:
    """`count` sub-steps on: as the simulation's closed loop has them, and with the motor's power off or braking.

    Args:
        plant: prepared.
        motion: before.
        doing: `OFF`, `FOLLOW` or `BRAKE`.
        command: the target to follow [rad].
        count: of sub-steps.
        sheathing: of the stretch.
        coast: factor on the speed without torque, over one sub-step [–].
        braking: deceleration of the quick stop [rad/s²].
        slack: of the cable, at the spool [rad].
    """
    position, velocity, end, memory = motion.position, motion.velocity, motion.end, motion.memory
    servo, sheath, after = plant.servo.substep, sheathing.before, sheathing.after
    before, turned, done, dt = velocity, end, 0, servo.dt
    for i in range(count):
        before = velocity
        if doing == FOLLOW:
            offset, velocity = servo_approach(position - command, velocity, servo)
            position = command + offset
        else:
            if doing == BRAKE:
                velocity = math.copysign(max(0.0, abs(velocity) - braking * dt), velocity)
            else:
                velocity = coast * velocity
            position += 0.5 * dt * (before + velocity)
        pulled = max(position - slack, min(position, end))
        if (pulled - end) * (end - turned) < 0.0:
            part = i / count
            width = sheath.width + part * (after.width - sheath.width)
            factor = sheath.slope_factor + part * (after.slope_factor - sheath.slope_factor)
            memory = cable_advance(plant.cable, memory, turned, end, width, factor, (i - done) * dt)
            turned, done = end, i
        end = pulled
    memory = cable_advance(plant.cable, memory, turned, end, after.width, after.slope_factor, (count - done) * dt)
    seen = cable_look(plant.cable, memory, end, after.width, after.slope_factor)
    joint = lagged(motion.joint, motion.seen.joint, seen.joint, count * dt, plant.load_lag)
    return BenchMotion(position, velocity, (velocity - before) / dt, end, memory, seen, joint)


def course_at(course: NDArray[np.float64], time: float, spacing: float) -> float:
    """A course of values `spacing` [s] apart, straight between them, after a `time` [s]; its ends go on as they are."""
    if time <= 0.0:
        return float(course[0])
    place = time / spacing
    i = int(place)
    if i >= len(course) - 1:
        return float(course[-1])
    return float(course[i] + (course[i + 1] - course[i]) * (place - i))


class Opposed(Protocol):
    """A joint that another bench's cable pulls too: `hardware.twin.pair`."""

    def joint(self, bench: "TwinBench") -> float:
        """Where it is, in this bench's coordinate [rad]."""
        ...

    def pull(self, bench: "TwinBench") -> float:
        """Torque of this bench's cable on it [N·m]."""
        ...


class TwinBench:
    """The bench at a time that only goes forward.

    Args:
        bench: of the rig, or a plant round any cable.
        bend: the sheath's total bend over time, from when `start_scenario` was called; before that as at its start.
        duration: for how long the bend is known; it stays as it is then [s].
        seed: of the encoders' noise.
        initial_motor: spool angle at power-up [rad].
        now: [s]
        physics: what the rig does not say.
    """

    has_cable = True
    brake_set = False
    interaction = None
    """See `TwinPlant.interaction`."""
    servo_gains: tuple[float, float] | None = None
    """See `TwinPlant.servo_gains`."""

    def __init__(
        self,
        bench: Bench | CablePlant,
        bend: BendPath,
        duration: float,
        seed: int,
        initial_motor: float,
        now: float,
        physics: Physics = Physics(),  # noqa: B008  # a tuple
    ) -> None:
        self.bench = plant = as_cable_plant(bench)
        self.physics = physics
        dynamics = plant.dynamics()
        self._plant: Moving = dynamics.plant
        self._substep = self._plant.servo.substep.dt
        self._move = specialise(move, dynamics.name, **reached(move, dynamics.parts))
        edges = np.arange(round(duration / plant.sample_time) + 1, dtype=np.float64) * plant.sample_time
        self._bends = np.asarray(bend(edges), dtype=np.float64)
        self._coast = math.exp(-self._substep / physics.coasting)
        self._random = np.random.default_rng(seed)
        self._normals: NDArray[np.float64] = np.zeros((0, 2))
        self._used = 0
        self._time = now
        self._began = math.inf
        rest = specialise(at_rest, dynamics.name, **reached(at_rest, dynamics.parts))
        self._motion = BenchMotion(*rest(self._plant, float(initial_motor), self._sheath_at(now)))
        self._sag = math.nan  # the joint's angle while the cable is torn
        self.doing, self.command = OFF, initial_motor
        self.slack, self.torn = 0.0, False
        self.temperature = physics.ambient
        self.opposed: Opposed | None = None
        self.torque_offset: float | None = None  # its servo is linear: there is no friction to push against
        self.advance(now + 2.0 * self._substep)  # compiles

    def start_scenario(self, now: float) -> None:
        """From `now` on the sheath's bend changes as the scenario has it; before it is as at its start."""
        self._began = now

    def advance(self, now: float) -> None:
        """Move on to `now` [s], in whole sub-steps; what is left over waits for the next call."""
        gap = now - self._time
        if gap > LONGEST_GAP:
            self._time, gap = now - LONGEST_GAP, LONGEST_GAP
        count = int(gap / self._substep)
        if count < 1:
            return
        sheathing = Sheathing(self._sheath_at(self._time), self._sheath_at(self._time + gap))
        self._time += count * self._substep
        self._motion = BenchMotion(
            *self._move(
                self._plant,
                self._motion,
                self.doing,
                self.command,
                count,
                sheathing,
                self._coast,
                self.physics.braking,
                self.slack,
            )
        )
        elapsed = count * self._substep
        if self.torn:
            start = self.joint if math.isnan(self._sag) else self._sag
            self._sag = self._rest() + (start - self._rest()) * math.exp(-elapsed / self.physics.spring_return)
        else:
            self._sag = math.nan
        self.temperature = stage_temperature(self.physics, self.temperature, self.current, elapsed)

    def _rest(self) -> float:
        """The joint angle at which its spring has no torque [rad]."""
        return -self.bench.motor.pretension / self.bench.motor.spring if self.bench.motor.spring > 0.0 else 0.0

    @property
    def speed_limit(self) -> float:
        """Of the drive, at the spool [rad/s]."""
        return self.bench.servo.speed_limit

    @property
    def current_limit(self) -> float:
        """Of the drive [A]."""
        return self.bench.motor.current_limit

    def _sheath_at(self, time: float) -> SheathState:
        bend = course_at(self._bends, time - self._began, self.bench.sample_time)
        return sheath_state(self.bench.sheath, bend)

    @property
    def motor(self) -> float:
        """Spool angle [rad]."""
        return self._motion.position

    @property
    def velocity(self) -> float:
        """Of the spool [rad/s]."""
        return self._motion.velocity

    @property
    def joint(self) -> float:
        """Joint angle [rad]."""
        if self.opposed is not None:
            return self.opposed.joint(self)
        if not math.isnan(self._sag):
            return self._sag
        return self._motion.joint

    @property
    def alone(self) -> float:
        """Where this cable would have the joint, whatever else pulls it [rad]."""
        return self._motion.joint

    @property
    def taut(self) -> bool:
        """Whether the cable pulls."""
        return not self.torn and (self.slack == 0.0 or self._motion.position - self._motion.end >= self.slack - 1e-9)

    def _slope(self) -> float:
        return abs(self.bench.cable.slope) * self._sheath_at(self._time).slope_factor

    def _load(self) -> float:
        """Torque of the cable on the spool: its own where it knows forces, and else the spring's through it [N·m]."""
        motor = self.bench.motor
        if self.opposed is not None:
            return self._slope() * self.opposed.pull(self)
        if not self.taut:
            return 0.0
        if self.bench.cable.physical:
            return self._motion.seen.torque
        return self._slope() * (motor.pretension + motor.spring * self.joint)

    @property
    def tension(self) -> float:
        """Of the cable at the spool: its torque over the spool's radius [N]."""
        return max(0.0, self._load()) / self.physics.spool_radius

    @property
    def current(self) -> float:
        """Of the motor; zero without torque [A]."""
        if self.doing == OFF:
            return 0.0
        motor = self.bench.motor
        return (motor.inertia * self._motion.acceleration + self._load()) / (motor.gear * motor.torque_constant)

    def read_encoders(self) -> tuple[float, float]:
        """What the joint's and the motor's encoder show now, with the noise of the next cycle [rad]."""
        if self._used == len(self._normals):
            self._normals, self._used = self._random.standard_normal((4096, 2)), 0
        of_joint, of_motor = (float(normal) for normal in self._normals[self._used])
        self._used += 1
        return (
            float(reading(self.joint, of_joint, self.bench.joint_encoder)),
            float(reading(self.motor, of_motor, self.bench.motor_encoder)),
        )
