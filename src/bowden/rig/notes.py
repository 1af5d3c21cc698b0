"""What the user should know about how a rig is understood."""

import math
from pathlib import Path

import numpy as np

from bowden.core.units import DEGREES, HERTZ, RADIANS
from bowden.models.suit.geometry import ELBOW_RANGE, SuitGeometry, flexor_moment_arm
from bowden.plants.cable_parameters import outside
from bowden.plants.identified import IdentifiedCable
from bowden.plants.predicted import SCHEDULED
from bowden.plants.suit_settings import SuitSettings
from bowden.rig.declaration import at, items_of
from bowden.rig.plant import INSTANTS, plain_cable, scheduled_by_bend
from bowden.rig.rig import Rig
from bowden.rig.sections import PARTS
from bowden.safety.limits import Limits
from bowden.sensing import wearer_file

_LINE = "line"
_BEYOND = 0.1
"""How far a reference may leave the motion that a log covered, over that motion [–]."""
_METRES = 0.01
"""Share of its usual length below which one was probably not written in millimetres [–]."""
_SAME_COUNT = 0.01
"""Two encoders' counts that differ by less are the same [–]."""
_WRITTEN = 1e-3
"""A limit further from its default was written by somebody; the default's own text in degrees is rounded [rad]."""
NO_SOURCE = (
    "[emg] has no source, so the joint follows [reference]; set emg.source, or give simulate and run one with --emg"
)
"""Note on a rig whose EMG moves nothing in a run; an export reads it at the board."""


def notes(rig: Rig) -> tuple[str, ...]:
    """What the user should know about how the rig is understood."""
    notes = list(rig.remarks)
    if isinstance(rig.cable, IdentifiedCable) and rig.cable.best == _LINE:
        where = Path(rig.origin).parent / rig.cable.file if rig.cable.file else "the identified cable"
        notes.append(f"{where} recommends {_LINE!r}; the bench runs the cable's bouc_wen model")
    if isinstance(rig.cable, IdentifiedCable) and rig.cable.best == SCHEDULED:
        own = rig.cable.model().parameters
        notes += outside(own, {"load": own["load"]} if "load" in own else {})
    if rig.worn is not None and rig.identified:
        notes.append(rig.whose_cable)
    notes += [*_gear_notes(rig), *_like_metres(rig)]
    if scheduled_by_bend(rig):
        notes += _bend_notes(rig)
    if rig.turned:
        why = "the cable's slope is negative" if rig.plant is None else "the joint falls as the plant's motor rises"
        notes.append(f"{why}: motor angles are counted the other way round here")
    given, used = rig.limits.frozen_travel, rig.supervisor_limits.frozen_travel
    if used < given:
        known = f"the identified cable explains no more than {used / RADIANS:.3g}, which is used"
        notes.append(f"limits.frozen_travel_deg is {given / RADIANS:.4g}; {known}")
    asked, slower = rig.limits.lowering, rig.supervisor_limits.lowering
    if slower < asked and abs(asked - Limits().lowering) > _WRITTEN:
        why = "an arm is let down no faster" if rig.suit.worn else "joint_speed and motor_speed allow no more"
        notes.append(
            f"limits.lowering_deg_per_s is {asked / RADIANS:.4g}; {why} than {slower / RADIANS:.3g}, which is used"
        )
    if rig.emg.source is None and rig.emg != PARTS["emg"].default:
        notes.append(NO_SOURCE)
    if rig.emg.levels is not None and not rig.emg.levels.sigma:
        notes.append(f"{rig.emg.wearer} was {wearer_file.EARLIER}")
    if rig.worn is None or not rig.admittance.enabled:
        notes += _like_radians(rig)
        notes += _beyond_the_log(rig)
    return tuple(notes)


def servo_assumed(rig: Rig) -> bool:
    """True if the cable was identified, and the servo that pulls it is still that of the paper's bench."""
    if not isinstance(rig.cable, IdentifiedCable) or rig.worn is not None or rig.plant is not None:
        return False
    papers = PARTS["servo"].default
    return math.isclose(rig.servo.natural_frequency, papers.natural_frequency, rel_tol=1e-3) and math.isclose(
        rig.servo.damping, papers.damping, rel_tol=1e-3
    )


def servo_text(rig: Rig) -> str:
    """The servo that gains are judged for, in words; what to do, where it is not the rig's own."""
    whose = "the servo of the paper's bench, not yours," if rig.servo_assumed else "a servo"
    how = f"{rig.servo.natural_frequency / HERTZ:.3g} Hz and damping {rig.servo.damping:.3g}"
    late = f"which gets a command {1e3 * rig.delay * rig.sample_time:g} ms after its sample"
    file = Path(rig.origin).name if rig.origin.endswith(".toml") else "rig.toml"
    do = f": log steps of yours, then bowden identify-servo LOG --into {file}" if rig.servo_assumed else ""
    return f"{whose} of {how}, {late}{do}"


def whose_cable(rig: Rig) -> str:
    """What a suit has of its identified cable, and whether that moved its joint as the suit does the elbow."""
    cable, spool = rig.cable, rig.suit.spool_radius
    lost = cable.lost  # type: ignore[union-attr]
    said = (
        f"both cables of the suit lose what {cable.file or 'the identified cable'} does, "  # type: ignore[union-attr]
        f"±{lost * DEGREES:.3g}° or ±{1e3 * lost * spool:.3g} mm of the spool"
    )
    slope = abs(plain_cable(rig).slope)
    least, most = (spool / flexor_moment_arm(end, SuitGeometry()) for end in reversed(ELBOW_RANGE))
    if least <= slope <= most:
        return said
    return (
        f"{said}; but its slope is {slope:.3g}, and that of the elbow over this spool {least:.2g} to {most:.2g}: "
        "if its motor turned a spool of another size than suit.spool_radius_mm, delete [cable] and set "
        f"suit.play_mm to {lost:.3g} times the radius of that spool in mm"
    )


def _gear_notes(rig: Rig) -> list[str]:
    """That the log of the cable's model was probably counted before the gear, behind which the drive's angle is."""
    counts, gear = getattr(rig.drive, "motor_counts_per_turn", 0.0), rig.drive_needs.gear
    counted = rig.cable.encoders.motor if isinstance(rig.cable, IdentifiedCable) else None
    if not (counted and counts) or gear == 1.0 or abs(counted * counts / math.tau - 1.0) > _SAME_COUNT:
        return []
    return [
        f"the log of the cable's model has {counts:g} counts a turn, as the drive's encoder has before "
        f"the gear of {gear:g} in [motor]: if that is the log's encoder, identify the log with --counts-per-turn "
        f"{counts * gear:g}"
    ]


def _bend_notes(rig: Rig) -> list[str]:
    """What is said of the bends of a run whose cable is scheduled by them."""
    own = rig.cable.model().parameters  # type: ignore[union-attr]
    path = rig.bend_path(np.linspace(0.0, rig.duration, INSTANTS))
    low, high = float(np.min(path)), float(np.max(path))
    far = low if own["bend_low"] - low > high - own["bend_high"] else high
    found = outside(own, {"bend": far})
    if max(abs(low - own["bend"]), abs(high - own["bend"])) > _WRITTEN:
        seen = f"{low / RADIANS:.4g}°" + (f" to {high / RADIANS:.4g}°" if high - low > _WRITTEN else "")
        found.append(
            f"the sheath's bend schedules the cable: it is {seen} in this run (scenario.bend, sheath.bend_deg), "
            f"and not the {own['bend'] / RADIANS:.4g}° among the cable's parameters; laws get that one, "
            "of the beginning"
        )
    return found


def _like_metres(rig: Rig) -> list[str]:
    """What is said of lengths of a suit that are so small that they were probably meant in metres."""
    lengths = [item for item in items_of(SuitSettings) if item.quantity.file_unit == "mm"]
    usual, own = SuitSettings(), rig.suit
    return [
        f"suit.{item.key} is {1e3 * at(own, item.path):.4g}; metres? {1e3 * at(own, item.path):.4g} m would be "
        f"{1e6 * at(own, item.path):.4g}"
        for item in lengths
        if own.worn and 0.0 < at(own, item.path) < _METRES * at(usual, item.path)
    ]


def _like_radians(rig: Rig) -> list[str]:
    """Note on a reference that is so small that it is probably in radians."""
    if rig.emg.source is not None:
        what, ends = "emg.low_deg and high_deg", (rig.emg.low, rig.emg.high)
    else:
        what, ends = "the reference", rig.reference_ends
    furthest = max(map(abs, ends)) / RADIANS
    if ends[0] != ends[1] and furthest > math.pi:
        return _one_like_radians(rig, what, ends)
    if ends[0] == ends[1]:
        return []
    meant = f"radians? {furthest:.3g} rad would be {furthest * DEGREES:.3g}°"
    return [f"{what} goes no further than {furthest:.3g}°, less than a cable's dead zone; {meant}"]


def _one_like_radians(rig: Rig, what: str, ends: tuple[float, float]) -> list[str]:
    """Note on a range with one end in degrees and one probably in radians, of a cable with a known stroke."""
    covered = rig.cable.covered if isinstance(rig.cable, IdentifiedCable) else None
    for end, other in (ends, ends[::-1]):
        number = end / RADIANS
        in_order = (number < other) == (end < other)
        within = covered is not None and covered.joint_low <= number <= covered.joint_high
        if 0.0 < abs(number) <= math.pi and within and in_order:
            return [f"{what} ends at {number:.3g}°; radians? {number:.3g} rad would be {number * DEGREES:.3g}°"]
    return []


def _beyond_the_log(rig: Rig) -> list[str]:
    """What is said of a reference that leaves the motion that the cable's log covered."""
    covered = rig.cable.covered if isinstance(rig.cable, IdentifiedCable) else None
    if covered is None or rig.worn is not None or rig.plant is not None:
        return []
    low, high = rig.reference_ends
    span = covered.joint_high - covered.joint_low
    if max(covered.joint_low - low, high - covered.joint_high) <= _BEYOND * span:
        return []
    seen = f"{covered.joint_low / RADIANS:.1f} to {covered.joint_high / RADIANS:.1f}°"
    return [
        f"the reference goes from {low / RADIANS:.3g} to {high / RADIANS:.3g}°, and the log of the cable's model "
        f"covered {seen} of the joint: beyond that the model was not fitted, and its figures there are uncertain; "
        f"{rig.made_anew or 'keep the reference within, or identify a log of a larger motion'}"
    ]


def made_anew(rig: Rig) -> str:
    """What to do about a cable that a program put into a rig of other angles; empty where a file names it."""
    given = isinstance(rig.cable, IdentifiedCable) and not rig.cable.file
    return "bowden.init(fit).rig has the reference, directions and zeros of its log" if given else ""
