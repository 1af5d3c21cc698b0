"""From [reference] and [scenario.bend] of a rig.toml to a trajectory and the path of the sheath."""

from pathlib import Path

from bowden.control.reference import Chirp, Multisine, PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.core.units import RADIANS
from bowden.models.cable.sheath import Sheath
from bowden.rig import schema as schema
from bowden.sim.scenario import BendPath, constant_bend, random_bend, scripted_bend


def reference_of(section: schema.ReferenceSection, folder: Path) -> Trajectory:
    """The joint's desired motion; files are found from `folder`."""
    match section:
        case schema.PeriodicMinimumJerkSection():
            return PeriodicMinimumJerk(section.low_deg * RADIANS, section.high_deg * RADIANS, section.period_s)
        case schema.PointToPointSection():
            return PointToPoint(tuple(section.times_s), _radians(section.positions_deg))
        case schema.ChirpSection():
            return Chirp(section.amplitude_deg * RADIANS, section.start_hz, section.end_hz, section.sweep_s)
        case schema.MultisineSection():
            return Multisine(
                tuple(section.frequencies_hz),
                _radians(section.amplitudes_deg),
                _radians(section.phases_deg),
                section.centre_deg * RADIANS,
                section.ramp_s,
            )
        case schema.RecordedSection():
            from bowden.rig.recorded import read_motion  # brings pyarrow

            return read_motion(section, folder)


def bend_of(section: schema.BendSection, sheath: Sheath, duration: float, seed: int) -> BendPath:
    """How the sheath is bent over the run; the seed decides a random one."""
    match section:
        case schema.ConstantBendSection():
            return constant_bend(sheath.bend if section.bend_deg is None else section.bend_deg * RADIANS)
        case schema.ScriptedBendSection():
            return scripted_bend(section.times_s, _radians(section.bends_deg))
        case schema.RandomBendSection():
            return random_bend(section.low_deg * RADIANS, section.high_deg * RADIANS, section.fastest_s, duration, seed)


def _radians(angles: list[float]) -> tuple[float, ...]:
    return tuple(angle * RADIANS for angle in angles)
