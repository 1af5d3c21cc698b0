"""The simulated bench behind the twin, moved on in real time.

With torque the motor is the servo of the simulation. Without, it coasts to a stop: dω/dt = −ω/τ, a stated choice; the
cable's friction and the gear are taken to hold the joint's spring. A quick stop brakes at a constant rate. The cable's
end follows the motor, or, with slack s, the play between motor − s and motor. A torn cable lets the joint go to where
its spring is at rest, x' = (rest − x)/τ. The power stage is one thermal mass: τ·dT/dt = T₀ + R·r·i² − T.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel
from bowden.models.cable.bouc_wen import advance_prepared
from bowden.models.cable.sheath import joint_in_sheath
from bowden.models.cable.sheath import slope_factor as slope_factor_at
from bowden.models.cable.sheath import width as width_at
from bowden.models.drive import motor as motor_model
from bowden.models.drive.encoder import reading
from bowden.models.drive.servo import servo_approach
from bowden.plants.bench import Bench, BenchStep, prepare_bench
from bowden.sim.scenario import BendPath

OFF, FOLLOW, BRAKE = 0, 1, 2
"""What the motor does."""

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


class Motion(NamedTuple):
    """Where motor and cable are."""

    position: float
    """Of the motor at the spool [rad]."""
    velocity: float
    """[rad/s]"""
    acceleration: float
    """Mean of the last sub-step [rad/s²]."""
    h: float
    """The cable's hysteresis variable [–]."""
    end: float
    """Of the cable on the motor's side, in motor angle [rad]."""


class Sheathing(NamedTuple):
    """Widths of the sheath's hysteresis at both ends of a stretch of time."""

    before: float
    after: float


@kernel
def move(
    bench: BenchStep,
    motion: Motion,
    doing: int,
    command: float,
    count: int,
    sheathing: Sheathing,
    coast: float,
    braking: float,
    slack: float,
) -> Motion:
    """`count` sub-steps on: as the simulation's closed loop has them, and with the motor's power off or braking.

    Args:
        bench: prepared for one sub-step.
        motion: before.
        doing: `OFF`, `FOLLOW` or `BRAKE`.
        command: the target to follow [rad].
        count: of sub-steps.
        sheathing: of the stretch.
        coast: factor on the speed without torque, over one sub-step [–].
        braking: deceleration of the quick stop [rad/s²].
        slack: of the cable, at the spool [rad].
    """
    position, velocity, h, end = motion.position, motion.velocity, motion.h, motion.end
    before, travel, dt = velocity, 0.0, bench.servo.dt
    for i in range(count):
        before = velocity
        if doing == FOLLOW:
            offset, velocity = servo_approach(position - command, velocity, bench.servo)
            position = command + offset
        else:
            if doing == BRAKE:
                velocity = np.sign(velocity) * max(0.0, abs(velocity) - braking * dt)
            else:
                velocity = coast * velocity
            position += 0.5 * dt * (before + velocity)
        pulled = max(position - slack, min(position, end))
        width = sheathing.before + (sheathing.after - sheathing.before) * (i + 1.0) / count
        piece = (pulled - end) / width
        if piece * travel < 0.0:
            h, travel = advance_prepared(h, travel, bench.hysteresis), 0.0
        travel += piece
        end = pulled
    h = advance_prepared(h, travel, bench.hysteresis)
    return Motion(position, velocity, (velocity - before) / dt, h, end)


def course_at(course: NDArray[np.float64], time: float, spacing: float) -> float:
    """A course of values `spacing` [s] apart, straight between them, after a `time` [s]; its ends go on as they are."""
    if time <= 0.0:
        return float(course[0])
    place = time / spacing
    i = int(place)
    if i >= len(course) - 1:
        return float(course[-1])
    return float(course[i] + (course[i + 1] - course[i]) * (place - i))


class TwinBench:
    """The bench at a time that only goes forward.

    Args:
        bench: of the rig.
        bend: the sheath's total bend over time, from when `start_scenario` was called; before that as at its start.
        duration: for how long the bend is known; it stays as it is then [s].
        seed: of the encoders' noise.
        initial_motor: spool angle at power-up [rad].
        now: [s]
        physics: what the rig does not say.
    """

    interaction = None
    """See `TwinPlant.interaction`."""

    def __init__(
        self,
        bench: Bench,
        bend: BendPath,
        duration: float,
        seed: int,
        initial_motor: float,
        now: float,
        physics: Physics = Physics(),  # noqa: B008  # a tuple
    ) -> None:
        self.bench, self.physics = bench, physics
        self._step = prepare_bench(bench)
        self._substep = self._step.servo.dt
        self._move = compiled(move)
        edges = np.arange(round(duration / bench.sample_time) + 1, dtype=np.float64) * bench.sample_time
        angles = bend(edges)
        self._widths = np.asarray(width_at(angles, bench.sheath), dtype=np.float64)  # type: ignore[arg-type]
        self._slopes = np.asarray(slope_factor_at(angles, bench.sheath), dtype=np.float64)  # type: ignore[arg-type]
        self._coast = math.exp(-self._substep / physics.coasting)
        self._random = np.random.default_rng(seed)
        self._normals: NDArray[np.float64] = np.zeros((0, 2))
        self._used = 0
        self._time = now
        self._began = math.inf
        self._motion = Motion(initial_motor, 0.0, 0.0, 0.0, initial_motor)
        self._sag = math.nan  # the joint's angle while the cable is torn
        self.doing, self.command = OFF, initial_motor
        self.slack, self.torn = 0.0, False
        self.temperature = physics.ambient
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
        sheathing = Sheathing(self._at(self._widths, self._time), self._at(self._widths, self._time + gap))
        self._time += count * self._substep
        self._motion = Motion(
            *self._move(
                self._step,
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

    def _at(self, course: NDArray[np.float64], time: float) -> float:
        return course_at(course, time - self._began, self.bench.sample_time)

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
        if not math.isnan(self._sag):
            return self._sag
        motion, width = self._motion, self._at(self._widths, self._time)
        return joint_in_sheath(motion.end, motion.h, width, self._at(self._slopes, self._time), self._step.cable)

    @property
    def taut(self) -> bool:
        """Whether the cable pulls."""
        return not self.torn and (self.slack == 0.0 or self._motion.position - self._motion.end >= self.slack - 1e-9)

    def _slope(self) -> float:
        return abs(self.bench.cable.slope) * self._at(self._slopes, self._time)

    @property
    def tension(self) -> float:
        """Of the cable at the spool: the spring's torque through the cable, over the spool's radius [N]."""
        motor = self.bench.motor
        if not self.taut:
            return 0.0
        return max(0.0, self._slope() * (motor.pretension + motor.spring * self.joint)) / self.physics.spool_radius

    @property
    def current(self) -> float:
        """Of the motor; zero without torque [A]."""
        if self.doing == OFF:
            return 0.0
        slope = self._slope() if self.taut else 0.0
        return float(motor_model.current(self._motion.acceleration, self.joint, slope, self.bench.motor))

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
