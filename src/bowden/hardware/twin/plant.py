"""What a twin's drive needs of the plant behind it: a bench, a suit on an arm or a user's own plant."""

from typing import Protocol

from bowden.hardware.twin.bench import Doing, Physics


def torque_on_joint(plant: "TwinPlant") -> float:
    """What a load cell at the joint measures: of a suit its torque on the elbow, of a bench the cable's, as if the
    joint's lever were the spool's radius [N·m]."""
    own = plant.interaction
    return plant.tension * plant.physics.spool_radius if own is None else own


class TwinPlant(Protocol):
    """A plant at a time that only goes forward."""

    physics: Physics
    doing: Doing
    command: float
    """The target to follow [rad]."""
    slack: float
    """Of the cable, at the spool [rad]."""
    torn: bool
    """Whether the cable that pulls is torn."""
    temperature: float
    """Of the power stage [°C]."""
    has_cable: bool
    """Whether a cable can be torn or slack in it."""
    torque_offset: float | None
    """What the drive adds to its torque, at the spool; None where it takes none [N·m]."""
    servo_gains: tuple[float, float] | None
    """Of the position loop of a plant whose motor gives way: torque per angle [N·m/rad] and per speed [N·m·s/rad], at
    the spool; None of one whose servo bears any load."""

    brake_set: bool
    """Whether the holding brake of its motor is told to hold; without effect on a plant that has none."""

    @property
    def motor(self) -> float:
        """Angle of the spool, of a suit in the joint's coordinate [rad]."""
        ...

    @property
    def velocity(self) -> float:
        """Of the spool [rad/s]."""
        ...

    @property
    def joint(self) -> float:
        """Joint angle [rad]."""
        ...

    @property
    def tension(self) -> float:
        """Of the cable at the spool [N]."""
        ...

    @property
    def current(self) -> float:
        """Of the motor; zero without torque [A]."""
        ...

    @property
    def interaction(self) -> float | None:
        """Torque of a suit on the elbow, flexing positive; None of a bench [N·m]."""
        ...

    @property
    def speed_limit(self) -> float:
        """Of the drive, at the spool [rad/s]."""
        ...

    @property
    def current_limit(self) -> float:
        """Of the drive [A]."""
        ...

    def start_scenario(self, now: float) -> None:
        """From `now` on the sheath's bend changes as the scenario has it; before it is as at its start."""
        ...

    def advance(self, now: float) -> None:
        """Move on to `now` [s]."""
        ...

    def read_encoders(self) -> tuple[float, float]:
        """What the joint's and the motor's sensor show now [rad]."""
        ...
