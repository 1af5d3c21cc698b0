"""What is behind a twin's drive, in real time: a bench, a suit on an arm or a user's own plant: what they share.

The power stage is one thermal mass: τ·dT/dt = T₀ + R·r·i² − T.
"""

import math
from abc import ABC, abstractmethod
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.models.cable.sheath_path import BendPath


class Doing(IntEnum):
    """State of the motor's power stage."""

    OFF = 0
    FOLLOW = 1
    BRAKE = 2


OFF, FOLLOW, BRAKE = Doing

LONGEST_GAP = 1.0
"""Time that one call makes up for at most; a twin that was stopped for longer has lost it [s]."""


class Physics(NamedTuple):
    """Constants that no rig states; chosen."""

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


class Look(NamedTuple):
    """Where a plant truly is."""

    motor: float
    """Angle of the spool, of a suit in the joint's coordinate [rad]."""
    velocity: float
    """Of the spool [rad/s]."""
    joint: float
    """Joint angle [rad]."""
    tension: float
    """Of the cable at the spool [N]."""
    current: float
    """Of the motor, as long as it has torque [A]."""
    interaction: float | None = None
    """Torque of a suit on the elbow, flexing positive; None of a bench [N·m]."""


def torque_on_joint(plant: "TwinPlant") -> float:
    """What a load cell at the joint measures: of a suit its torque on the elbow, of a bench the cable's, as if the
    joint's lever were the spool's radius [N·m]."""
    own = plant.interaction
    return plant.tension * plant.physics.spool_radius if own is None else own


class TwinPlant(ABC):
    """A plant at a time that only goes forward.

    Args:
        plant: of the rig; `_begin` of each kind says which.
        bend: the sheath's total bend over time, from when `start_scenario` was called; before that as at its start.
        duration: for how long the bend is known; it stays as it is then [s].
        seed: of the sensors' noise.
        initial_motor: angle at power-up, which is its target too [rad].
        now: [s]

    Raises:
        ParameterError: kernels of the user's own that cannot be compiled, or give no number.
    """

    has_cable = True
    """True if a cable can be torn or slack in it."""
    speed_limit: float
    """Of the drive, at the spool [rad/s]."""
    current_limit: float
    """Of the drive [A]."""

    def __init__(
        self, plant: Any, bend: BendPath, duration: float, seed: int, initial_motor: float, now: float
    ) -> None:
        spacing = plant.sample_time
        self._edges = np.arange(round(duration / spacing) + 1, dtype=np.float64) * spacing
        self._bends = np.asarray(bend(self._edges), dtype=np.float64)
        self._random = np.random.default_rng(seed)
        self._normals: NDArray[np.float64] = np.zeros((0, 0))
        self._used = 0
        self._time, self._began = now, math.inf
        self.physics = Physics()
        self.doing = OFF
        self.command = initial_motor
        """The target to follow [rad]."""
        self.slack = 0.0
        """Of the cable, at the spool [rad]."""
        self.torn = False
        """True if the cable that pulls is torn."""
        self.temperature = self.physics.ambient
        """Of the power stage [°C]."""
        self.torque_offset: float | None = None
        """What the drive adds to its torque, at the spool; None where it takes none [N·m]."""
        self.servo_gains: tuple[float, float] | None = None
        """Of the position loop of a plant whose motor gives way: torque per angle [N·m/rad] and per speed [N·m·s/rad],
        at the spool; None of one whose servo bears any load."""
        self.brake_set = False
        """True if the holding brake of its motor is told to hold; without effect on a plant that has none."""
        self._begin(plant, float(initial_motor), now)

    @abstractmethod
    def _begin(self, plant: Any, motor: float, now: float) -> None:
        """At rest at a motor angle [rad], at `now` [s]; what is compiled is compiled here."""

    @abstractmethod
    def look(self) -> Look:
        """Where it is now."""

    @property
    def motor(self) -> float:
        """See `Look`."""
        return self.look().motor

    @property
    def velocity(self) -> float:
        """See `Look`."""
        return self.look().velocity

    @property
    def joint(self) -> float:
        """See `Look`."""
        return self.look().joint

    @property
    def tension(self) -> float:
        """See `Look`."""
        return self.look().tension

    @property
    def current(self) -> float:
        """See `Look`; zero without torque."""
        return 0.0 if self.doing == OFF else self.look().current

    @property
    def interaction(self) -> float | None:
        """See `Look`."""
        return self.look().interaction

    @abstractmethod
    def advance(self, now: float) -> None:
        """Move on to `now` [s]."""

    @abstractmethod
    def read_encoders(self) -> tuple[float, float]:
        """What the joint's and the motor's sensor show now [rad]."""

    def start_scenario(self, now: float) -> None:
        """From `now` on the sheath's bend changes as the scenario has it; before it is as at its start."""
        self._began = now

    def _bend_at(self, time: float) -> float:
        """The sheath's bend [rad]."""
        return float(np.interp(time - self._began, self._edges, self._bends))

    def _since(self, now: float) -> float:
        """How long it has to move on; what is more than `LONGEST_GAP` is lost [s]."""
        self._time = max(self._time, now - LONGEST_GAP)
        return now - self._time

    def _warm(self, elapsed: float) -> None:
        """The power stage after `elapsed` [s] under its current."""
        physics = self.physics
        end = physics.ambient + physics.thermal_resistance * physics.stage_resistance * self.current**2
        self.temperature += (end - self.temperature) * (1.0 - math.exp(-elapsed / physics.thermal_time))

    def _noise(self, count: int) -> NDArray[np.float64]:
        """Standard normal numbers of the next reading (count,)."""
        if self._used == len(self._normals):
            self._normals, self._used = self._random.standard_normal((4096, count)), 0
        self._used += 1
        drawn: NDArray[np.float64] = self._normals[self._used - 1]
        return drawn
