"""The paper's suit as we run it: what is printed, what is chosen, and what is fitted, from paper.toml."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from bowden.core.units import RADIANS
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.geared_motor import GearedMotor
from bowden.models.suit.arm import arm_of
from bowden.models.suit.geometry import SuitGeometry
from bowden.models.suit.suit_cable import Fabric, SuitCable
from bowden.plants.presets.bench import bench
from bowden.plants.presets.paper import document
from bowden.plants.suit_parts import Suit


@dataclass(frozen=True)
class SuitCalibration:
    """Values that the paper does not give of its suit, fitted to its rows without compensation."""

    friction: float
    """Of bearings and seals at the spool, from the energy of a flexion [N·m]."""
    half_width: float
    """Of the cables' play, from the largest error [m]."""
    period: float
    """Of Fig. 6's reference, from the delay; Fig. 17 names its own, 25 s [s]."""
    cable_stiffness: float = 8000.0
    """Of cable and sheath; a stated choice where it is not from the energy [N/m]."""
    drive_integral: float = 0.0
    """Of the drive's position loop, which is PD without it [1/s]."""
    natural_frequency: float = bench().servo.natural_frequency
    """Of the drive's unloaded PD loop [rad/s]."""
    feeder_drag: float = 0.0
    """Of the feeder on a cable that is pulled in [N]."""
    geometry: SuitGeometry = field(default_factory=SuitGeometry)
    chosen: Mapping[str, float] = field(default_factory=dict)
    """Replacements of stated choices of paper.toml, by their names there."""


def suit_calibration(name: str = "first") -> SuitCalibration:
    """A frozen calibration of paper.toml: ``first``, on a PD drive, or ``second``, on one with an integral."""
    return SuitCalibration(**document()["suit"]["calibration"][name])


def suit(fit: SuitCalibration | None = None) -> Suit:
    """The suit with a calibration; the first one where none is given."""
    fit = fit or suit_calibration()
    chosen = document()["suit"]["chosen"] | dict(fit.chosen)
    cable = SuitCable(
        kind="play", stiffness=fit.cable_stiffness, half_width=fit.half_width, feeder_drag=fit.feeder_drag
    )
    servo, sheath = bench().servo, bench().sheath
    return Suit(
        geometry=fit.geometry,
        spool_radius=chosen["spool_radius"],
        motor=GearedMotor(
            inertia=chosen["inertia"],
            efficiency=chosen["efficiency"],
            friction=fit.friction,
            current_limit=chosen["current_limit"],
            supply=chosen["supply"],
            integral=fit.drive_integral,
            servo=servo._replace(natural_frequency=fit.natural_frequency),
        ),
        flexor=cable,
        extensor=cable,
        pretension=chosen["pretension"],
        fabric=Fabric(chosen["fabric_stiffness"], 0.0, chosen["fabric_damping"]),
        sheath=Sheath(bend=chosen["bend_deg"] * RADIANS, loss=sheath.loss),
        posture=chosen["posture"],
        arm=arm_of(chosen["wearer_mass"], chosen["wearer_height"]),
        sample_time=chosen["sample_time"],
        delay=chosen["delay"],
        substeps=chosen["substeps"],
    )
