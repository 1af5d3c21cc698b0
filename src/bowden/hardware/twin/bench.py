"""The simulated bench behind the twin, moved on in real time.

With torque the motor is the servo of the simulation. Without, it coasts to a stop: dω/dt = −ω/τ, a stated choice; the
cable's friction and the gear are taken to hold the joint's spring. A quick stop brakes at a constant rate. The cable's
end follows the motor, or, with slack s, the play between motor − s and motor. A torn cable lets the joint go to where
its spring is at rest, x' = (rest − x)/τ.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from bowden.core.kernel import compiled, kernel, reached, specialise
from bowden.hardware.twin.plant import BRAKE, FOLLOW, Doing, Look, TwinPlant
from bowden.models.cable.shared_joint import JointLoad, cable_pull, shared_joint
from bowden.models.drive.encoder import reading
from bowden.models.drive.servo import servo_approach
from bowden.plants.bench import Bench
from bowden.plants.bench_body import Moving, bench_rest, cable_advance, cable_look, lagged
from bowden.plants.cable import Seen
from bowden.plants.plant import SheathState, sheath_state


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
    body = bench_rest(plant, motor, sheath)
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
        doing: see `Doing`.
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
            memory = cable_advance(plant.cable, memory, turned, end, (end - turned) / width, width, (i - done) * dt)
            turned, done = end, i
        end = pulled
    way = (end - turned) / after.width
    memory = cable_advance(plant.cable, memory, turned, end, way, after.width, (count - done) * dt)
    seen = cable_look(plant.cable, memory, end, after.width, after.slope_factor)
    joint = lagged(motion.joint, motion.seen.joint, seen.joint, count * dt, plant.load_lag)
    return BenchMotion(position, velocity, (velocity - before) / dt, end, memory, seen, joint)


class TwinBench(TwinPlant):
    """The bench, round any cable; see `TwinPlant`."""

    def _begin(self, plant: Bench, motor: float, now: float) -> None:
        self.bench, self._cable = plant, plant.simulated_cable
        self.speed_limit, self.current_limit = plant.servo.speed_limit, plant.motor.current_limit
        dynamics = plant.dynamics()
        self._plant: Moving = dynamics.plant
        self._substep = self._plant.servo.substep.dt
        self._move = specialise(move, dynamics.name, **reached(move, dynamics.parts))
        self._coast = math.exp(-self._substep / self.physics.coasting)
        rest = specialise(at_rest, dynamics.name, **reached(at_rest, dynamics.parts))
        self._motion = BenchMotion(*rest(self._plant, motor, self._sheath_at(now)))
        self._sag = math.nan  # the joint's angle while the cable is torn
        self.shared: SharedJoint | None = None
        """A joint that other benches' cables pull too."""
        self.sign = 1.0
        """Direction in which its motor pulls the joint that it shares [–]."""
        self.advance(now + 2.0 * self._substep)  # compiles

    def advance(self, now: float) -> None:
        """Move on to `now` [s], in whole sub-steps; what is left over waits for the next call."""
        gap = self._since(now)
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
        self._warm(elapsed)

    def _rest(self) -> float:
        """The joint angle at which its spring has no torque [rad]."""
        return -self.bench.motor.pretension / self.bench.motor.spring if self.bench.motor.spring > 0.0 else 0.0

    def _sheath_at(self, time: float) -> SheathState:
        return sheath_state(self.bench.sheath, self._bend_at(time))

    @property
    def alone(self) -> float:
        """Where this cable would have the joint, whatever else pulls it [rad]."""
        return self._motion.joint

    @property
    def taut(self) -> bool:
        """True if the cable pulls."""
        return not self.torn and (self.slack == 0.0 or self._motion.position - self._motion.end >= self.slack - 1e-9)

    def _slope(self) -> float:
        return abs(self.bench.cable.slope) * self._sheath_at(self._time).slope_factor

    def _load(self, joint: float) -> float:
        """Torque of the cable on the spool: its own where it knows forces, and else the spring's through it [N·m]."""
        motor = self.bench.motor
        if self.shared is not None:
            return self._slope() * self.shared.pull(self)
        if not self.taut:
            return 0.0
        if self._cable.physical:
            return self._motion.seen.torque
        return self._slope() * (motor.pretension + motor.spring * joint)

    def look(self) -> Look:
        """See `TwinPlant.look`; the tension is the cable's torque over the spool's radius."""
        motion, motor = self._motion, self.bench.motor
        joint = motion.joint if math.isnan(self._sag) else self._sag
        joint = joint if self.shared is None else self.shared.joint(self)
        load = self._load(joint)
        current = (motor.inertia * motion.acceleration + load) / (motor.gear * motor.torque_constant)
        return Look(motion.position, motion.velocity, joint, max(0.0, load) / self.physics.spool_radius, current)

    def read_encoders(self) -> tuple[float, float]:
        """What the joint's and the motor's encoder show now, with the noise of the next cycle [rad]."""
        (of_joint, of_motor), now = self._noise(2), self.look()
        return (
            float(reading(now.joint, float(of_joint), self.bench.joint_encoder)),
            float(reading(now.motor, float(of_motor), self.bench.motor_encoder)),
        )


class SharedJoint:
    """A joint that several benches pull, a motor and a cable each; each sees it in its own coordinate, in which its
    motor pulls upwards.

    Each cable has its own hysteresis, from its motor's angle to where it would have the joint alone; the joint's
    balance is that of `bowden.models.cable.shared_joint`.

    Args:
        benches: that pull at it.
        signs: 1 of one whose coordinate is the joint's, −1 of one whose is the other way round.
        stiffness: of each cable at the joint, k [N·m/rad].
    """

    def __init__(self, benches: Sequence[TwinBench], signs: Sequence[float], stiffness: float) -> None:
        self._benches, self._signs = tuple(benches), np.array(signs)
        motor = next(bench for bench, sign in zip(benches, signs, strict=True) if sign > 0.0).bench.motor
        self._load = JointLoad(stiffness, motor.pretension, motor.spring)
        self._balance = compiled(shared_joint)
        for bench, sign in zip(benches, signs, strict=True):
            bench.shared, bench.sign = self, sign
        self.push = 0.0
        """Torque of whoever pushes the joint upwards [N·m]."""

    def joint(self, bench: TwinBench) -> float:
        """Where it is, in the coordinate of one of them [rad]."""
        ends = self._signs * [-math.inf if one.torn else one.alone for one in self._benches]
        return bench.sign * float(self._balance(ends, self._signs, self.push, self._load))

    def pull(self, bench: TwinBench) -> float:
        """Torque of the cable of one of them on the joint, 0 where it is slack [N·m]."""
        return 0.0 if bench.torn else cable_pull(bench.alone, self.joint(bench), self._load.stiffness)
