"""The paper's bench and suit from one set of physical parameters, with the range in which each is plausible."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from bowden.models.drive.motor import Motor
from bowden.models.suit.geometry import SuitGeometry
from bowden.plants.presets.paper import Calibration, document
from bowden.plants.presets.suit import SuitCalibration

GEAR = 25.0
"""Motor turns per spool turn, 5:1 and 5:1 (Section 2.2); taken for the bench, too, whose gear is not printed [–]."""


@dataclass(frozen=True)
class Parameter:
    """A parameter that the paper leaves open."""

    value: float
    low: float
    """Smallest plausible value."""
    high: float
    """Largest plausible value."""
    unit: str
    source: str
    """What it is, and where value and range come from."""
    fitted_to: str = ""
    """The claim that the value is fitted to; empty for a stated choice."""


@cache
def _document() -> dict[str, Any]:
    return tomllib.loads((resources.files("bowden.paper") / "calibration.toml").read_text(encoding="utf-8"))


def parameters() -> dict[str, Parameter]:
    """All parameters, by name."""
    return {
        name: Parameter(fitted_to=entry.get("from", ""), **{key: entry[key] for key in entry if key != "from"})
        for name, entry in _document()["parameters"].items()
    }


def values() -> dict[str, float]:
    """The main calibration."""
    return {name: one.value for name, one in parameters().items()}


def gains(of: str) -> dict[str, float]:
    """The adaptive law's gains by margin on the ``bench``, the ``suit``, or the ``suit_integral``."""
    return dict(_document()["gains"][of])


def bench_fit(given: Mapping[str, float] | None = None) -> Calibration:
    """The bench with these parameters; the main calibration where none are given."""
    p = given or values()
    start = document()["chosen"]["moved_from_s"]
    return Calibration(
        natural_frequency=p["natural_frequency"],
        gap=p["gap"],
        observer_share=p["observer_share"],
        loss=p["loss"],
        period=p["period"],
        speed_limit=p["speed_limit"],
        motor=Motor(gear=GEAR, inertia=p["inertia"], current_limit=p["current_limit"]),
        moved=(start, start + p["moving_time"]),
    )


def suit_fit(given: Mapping[str, float] | None = None) -> SuitCalibration:
    """The suit with these parameters, on the paper's PD drive; the main calibration where none are given.

    The supply is what turns the unloaded motor as fast as the bench's at its limit.
    """
    p = given or values()
    same = ("inertia", "efficiency", "current_limit", "fabric_stiffness", "pretension", "posture", "wearer_mass")
    chosen = {name: p[name] for name in (*same, "spool_radius")}
    return SuitCalibration(
        friction=p["friction"],
        half_width=p["play"],
        period=p["fig6_period"],
        cable_stiffness=p["cable_stiffness"],
        feeder_drag=p["feeder_drag"],
        natural_frequency=p["natural_frequency"],
        geometry=SuitGeometry(half_width=p["half_width"]),
        chosen=chosen | {"supply": p["speed_limit"] * GEAR * Motor().torque_constant},
    )
