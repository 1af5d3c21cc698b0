"""The paper's bench as we run it: what is printed, what is chosen, and what is fitted, from paper.toml."""

import tomllib
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

from bowden.control.reference import Chirp, PeriodicMinimumJerk
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath, scripted_bend
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor
from bowden.models.drive.servo import Servo


@cache
def document() -> dict[str, Any]:
    """paper.toml as it stands."""
    return tomllib.loads((resources.files("bowden.plants.presets") / "paper.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Calibration:
    """Values that the paper does not give, fitted to its rows without the adaptive law."""

    natural_frequency: float
    """Of the servo, from the observer's bandwidth [rad/s]."""
    gap: float
    """Width of the cable's hysteresis over the printed parameters', from the dead zone [–]."""
    observer_share: float
    """The observer's α̂h over the cable's true αh·gap, from its RMSE at constant bend [–]."""
    loss: float
    """Slope lost when the bend doubles, from the observer's RMSE at varying bend [–]."""
    period: float
    """Of the periodic reference [s]."""
    speed_limit: float = document()["chosen"]["speed_limit"]
    """Of the drive, at the spool [rad/s]."""
    motor: Motor = field(default_factory=Motor)
    """With its gear, inertia and current limit, which limit the acceleration."""
    moved: tuple[float, float] = (document()["chosen"]["moved_from_s"], document()["chosen"]["moved_to_s"])
    """When the sheath of Fig. 15 begins to be moved, and when it is bent [s]."""


def calibration(name: str = "first") -> Calibration:
    """A frozen calibration of paper.toml: ``first``, on which every default stands, or ``second``."""
    return Calibration(**document()["calibration"][name])


class Parts(NamedTuple):
    """What a bench is made of."""

    cable: BoucWen
    sheath: Sheath
    servo: Servo
    motor: Motor
    joint_encoder: Encoder
    motor_encoder: Encoder
    sample_time: float
    delay: int
    substeps: int


def parts(fit: Calibration | None = None) -> Parts:
    """The bench with a calibration; the first one, on which every default stands, where none is given."""
    fit = fit or calibration()
    chosen = document()["chosen"]
    encoder = Encoder(chosen["encoder_resolution_deg"] * RADIANS, chosen["encoder_noise_deg"] * RADIANS)
    return Parts(
        cable=BoucWen(),
        sheath=Sheath(bend=chosen["bend_deg"] * RADIANS, gap=fit.gap, loss=fit.loss),
        servo=Servo(fit.natural_frequency, chosen["servo_damping"], speed_limit=fit.speed_limit),
        motor=fit.motor,
        joint_encoder=encoder,
        motor_encoder=encoder,
        sample_time=chosen["sample_time"],
        delay=chosen["delay"],
        substeps=chosen["substeps"],
    )


def minimum_jerk(fit: Calibration | None = None) -> PeriodicMinimumJerk:
    """The periodic reference of Fig. 9, 0–70°."""
    return PeriodicMinimumJerk(0.0, document()["chosen"]["stroke_deg"] * RADIANS, (fit or calibration()).period)


def chirp() -> Chirp:
    """The chirp of Fig. 16, with the integrated phase (reading 1)."""
    return Chirp(90.0 * RADIANS, 0.1, 20.0, 150.0)


def moved_sheath(fit: Calibration | None = None) -> BendPath:
    """The sheath of Fig. 15: bent to twice its angle while running."""
    chosen = document()["chosen"]
    bends = chosen["bend_deg"] * RADIANS, chosen["moved_bend_deg"] * RADIANS
    return scripted_bend((fit or calibration()).moved, bends)
