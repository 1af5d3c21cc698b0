"""A user's own plant behind the twin, moved on in real time by whole control cycles with its own kernels.

A command takes effect at the next whole cycle, as in a simulation; between two of them joint and motor go straight from
one to the other. How its motor stops is not known of such a plant: without torque, and under a quick stop, it is sent
to stay where it is, a stated choice. Its current is what its ``effort`` says; without one it is what the rig's motor
needs for itself and for the bench's spring at the joint, a stated choice too: a current that stands still is refused.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.source import Measurement
from bowden.core.kernel import kernel, reached, specialise
from bowden.hardware.twin.plant import FOLLOW, OFF, Look, TwinPlant
from bowden.models.drive.motor import current
from bowden.plants.plant import (
    SheathState,
    plant_advance,
    plant_effort,
    plant_look,
    plant_observe,
    plant_rest,
    refuse_no_number,
    sheath_state,
)
from bowden.plants.user_plant import UserPlant


class PlantCycle(NamedTuple):
    """A control cycle's two ends."""

    body: Any
    """At its beginning, with what its sensors remember."""
    after: Any
    """At its end."""
    current: float
    """At its beginning [A]; NaN where it is not known."""


@kernel
def begin(plant: Any, motor: float, sheath: SheathState) -> Any:
    """At rest at a motor angle [rad]."""
    return plant_rest(plant, motor, sheath)


@kernel
def one_on(
    plant: Any, body: Any, applied: float, sheath: SheathState, after: SheathState, normals: NDArray[np.float64]
) -> PlantCycle:
    """The cycle that begins with a body, under a command [rad]."""
    body, _ = plant_observe(plant, body, normals)
    return PlantCycle(body, plant_advance(plant, body, applied, sheath, after), plant_effort(plant, body, sheath))


@kernel
def sensed(plant: Any, body: Any, normals: NDArray[np.float64]) -> Measurement:
    """What the sensors say of a body."""
    _, measured = plant_observe(plant, body, normals)
    return measured


@kernel
def seen(plant: Any, body: Any) -> Any:
    """Where a body truly is."""
    return plant_look(plant, body)


class TwinUser(TwinPlant):
    """A user's plant; see `TwinPlant`."""

    has_cable = False

    def _begin(self, plant: UserPlant, motor: float, now: float) -> None:
        self.speed_limit, self.current_limit = plant.servo.speed_limit, plant.motor.current_limit
        self.plant = plant
        self._dynamics = dynamics = plant.dynamics()
        kernels = dynamics.kernels()
        rest, self._one_on, self._sensed, self._seen = (
            specialise(one, dynamics.name, **reached(one, kernels)) for one in (begin, one_on, sensed, seen)
        )
        self._first = self._now = now
        with dynamics.explained():
            body = rest(dynamics.plant, motor, self._sheath_at(now))
            self._cycle = PlantCycle(body, body, math.nan)
            self._after = self._seen(dynamics.plant, body)
            self._step(motor)
            self.read_encoders()  # compiles

    def advance(self, now: float) -> None:
        """Move on to `now` [s]: the cycle that it lies in has been calculated to its end.

        Raises:
            ParameterError: the plant gave no number, or failed.
        """
        self._now = max(now, self._time)
        self._since(now)
        with self._dynamics.explained():
            while now - self._time >= self.plant.sample_time:
                self._time += self.plant.sample_time
                self._step(self.command if self.doing == FOLLOW else self._after.motor)

    def _step(self, applied: float) -> None:
        """The cycle that begins at `_time`, from where the one before ended."""
        dt = self.plant.sample_time
        ends = self._sheath_at(self._time), self._sheath_at(self._time + dt)
        normals = self._random.standard_normal(2)
        self._before = self._after
        self._cycle = PlantCycle(*self._one_on(self._dynamics.plant, self._cycle.after, float(applied), *ends, normals))
        self._after = self._seen(self._dynamics.plant, self._cycle.after)
        refuse_no_number(self._dynamics, self._after._asdict(), self._time + dt - self._first)
        self._warm(dt)

    def _between(self, before: float, after: float) -> float:
        part = min((self._now - self._time) / self.plant.sample_time, 1.0)
        return before + part * (after - before)

    def _sheath_at(self, time: float) -> SheathState:
        return sheath_state(self.plant.sheath, self._bend_at(time))

    def look(self) -> Look:
        """See `TwinPlant.look`; where the plant does not say its current it is that of the bench's spring, and its
        tension is what the motor's torque pulls, over the spool's radius.
        """
        before, after, motor = self._before, self._after, self.plant.motor
        joint, amperes = self._between(before.joint, after.joint), self._cycle.current
        if not math.isfinite(amperes):
            acceleration = (after.motor_velocity - before.motor_velocity) / self.plant.sample_time
            amperes = current(acceleration, joint, 1.0, motor)
        pull = 0.0 if self.doing == OFF else max(0.0, amperes * motor.gear * motor.torque_constant)
        return Look(
            self._between(before.motor, after.motor),
            self._between(before.motor_velocity, after.motor_velocity),
            joint,
            pull / self.physics.spool_radius,
            amperes,
        )

    def read_encoders(self) -> tuple[float, float]:
        """See `TwinPlant.read_encoders`: what the plant's own ``observe`` makes of where it is now."""
        before, after = self._cycle.body, self._cycle.after
        body = before._replace(
            joint=self.joint,
            motor=self._between(before.motor, after.motor),
            motor_velocity=self._between(before.motor_velocity, after.motor_velocity),
        )
        measured = Measurement(*self._sensed(self._dynamics.plant, body, self._random.standard_normal(2)))
        return measured.joint, measured.motor
