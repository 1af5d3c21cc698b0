"""One angle confirmed by hand, once for a drive and its scales: their only witness that is neither file nor drive.

A joint whose counts a turn are wrong by a factor, with a motor wrong by the same, or both signs turned round, passes
everything else: drives need not know their encoder, no drive knows the joint's, and no law sees it. So before a motor
that is none of a twin's gets power for the first time, somebody turns it by hand and says by how much the joint went.

    |joint − moved| ≤ share·moved + reading,    moved/steepest ≤ motor ≤ (moved + play)/flattest, widened by the same

all counted in the direction in which the cable pulls, which only turning by hand can show. Where a sensor takes the
place of the joint's encoder, its axis and its curve are witnessed so; two standard deviations of its lasting error are
added to `reading`. Where the cable's model does, the motor alone is.
"""

import hashlib
import json
import math
import shlex
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from bowden.core.clock import TimeSource, unix_seconds
from bowden.core.errors import DriveError, OutputError, SafetyError
from bowden.core.files import state_folder, whole_file
from bowden.core.signals import DriveReading
from bowden.core.units import DEGREES, RADIANS
from bowden.hardware.ports import Drive
from bowden.live.drive_look import AGES, looked_at
from bowden.live.joint_estimate import RestingSensor
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from bowden.rig.settings import JointSensor
from bowden.safety.limits import Limits

LEAST = 30.0 * RADIANS
"""Smallest angle that is taken: what a goniometer is misread by is small against it [rad]."""
SHARE, READING = 0.1, 4.0 * RADIANS
"""What an angle that is read by hand may be wrong by: a share [–], and a goniometer's reading on a limb, of which two
by different hands differ by some 4° to 5° [rad]. A factor of 0.7 or 1.4 is found at the smallest angle."""
SETTLED = 20
"""Cycles without an angle after which there is none."""
ENCODER = JointSensor()
_OLD = 2
"""Cycles that an angle may be old and still be the one of now."""
_LEAST_SLOPE = 1e-3
"""Of a cable, where something is divided by it [rad/rad]."""
_TURNED = "(where the sign is wrong) slack_sign of [limits] or "


def least_turn(sensor: JointSensor) -> float:
    """Smallest angle by which a joint is turned: a factor of 0.7 shows over what a reading may be wrong by [rad]."""
    return max(LEAST, _unsure(sensor) / (0.3 - SHARE) if sensor.sensed else 0.0)


def _unsure(sensor: JointSensor) -> float:
    """Of a reading, beside a share of the angle [rad]."""
    return READING + (2.0 * sensor.offset if sensor.sensed else 0.0)


def contradictions(
    moved: float, joint: float, motor: float, limits: Limits, sensor: JointSensor = ENCODER
) -> list[str]:
    """Contradictions of motor and joint to the angle by which the joint was turned, in sentences; empty if they agree.

    Args:
        moved: how far the cable has pulled the joint, as whoever turned it has read it [rad].
        joint: change of the joint's angle; not looked at where nothing measures it [rad].
        motor: change of the motor's [rad].
        limits: with the cable's slopes and play.
        sensor: what measures the joint.
    """
    least = least_turn(sensor)
    if not moved >= least:
        return [f"{moved * DEGREES:.3g}° is too little to check a scale; turn it by {least * DEGREES:.3g}° or more"]
    pull, slack, found = -limits.slack_sign, SHARE * moved + _unsure(sensor), []
    joint, motor = pull * joint, pull * motor
    if sensor.source != "motor" and not abs(joint - moved) <= slack:
        wrong = f"joint_counts_per_turn or {_TURNED}joint_direction"
        if sensor.sensed:
            wrong = "[joint_sensor] by bowden calibrate joint, or (where the sign is wrong) slack_sign of [limits]"
        found.append(
            f"the cable has pulled the joint by {moved * DEGREES:.3g}°, but its "
            f"{'sensor' if sensor.sensed else 'encoder'} shows {joint * DEGREES:.3g}°: correct {wrong}"
        )
    low, high = (
        moved / max(limits.slope_high, _LEAST_SLOPE),
        (moved + limits.play) / max(limits.slope_low, _LEAST_SLOPE),
    )
    if not low - slack <= motor <= high + slack:
        found.append(
            f"the motor should have pulled by {low * DEGREES:.3g}° to {high * DEGREES:.3g}° for it, by its encoder "
            f"that is {motor * DEGREES:.3g}°: turn it along with the joint, or correct motor_counts_per_turn, gear or "
            f"{_TURNED}motor_direction"
        )
    return found


def turned(
    drive: Drive,
    lines: Callable[[], str | None],
    say: Callable[[str], None],
    clock: TimeSource,
    period: float,
    sensor: JointSensor = ENCODER,
    at_joint: RestingSensor | None = None,
) -> tuple[float, DriveReading, DriveReading]:
    """The angle that somebody says to have turned the joint by [rad], and what was read before and after.

    Args:
        drive: brought up; every cycle it is sent power off.
        lines: what was entered since it was asked last; None of nothing yet.
        say: shows a sentence.
        clock: to go by.
        period: of a cycle [s].
        sensor: what measures the joint.
        at_joint: it, opened, where that is no encoder at the drive.

    Raises:
        DriveError: no angle comes, or the drive has torque.
        SafetyError: what was entered is no angle.
    """
    readings = (
        look.last if at_joint is None else at_joint.shown(look.last)
        for look in looked_at(drive, clock, period)
        if look.last is not None
    )
    needed = ("motor", "joint") if sensor.source != "motor" else ("motor",)
    say("The motor gets no power. Let the joint rest where the cable is just taut, and press Enter.")
    before, _ = _until(readings, needed, lines)
    say(
        "Turn the motor by hand, at its spool or its shaft, so that the cable pulls the joint by "
        f"{least_turn(sensor) * DEGREES:.3g}° or more. Measure with a goniometer how far the joint has turned, hold it "
        "still, type that in degrees, and press Enter."
    )
    after, entered = _until(readings, needed, lines)
    try:
        moved = float(entered.strip().rstrip("°").replace(",", ".")) * RADIANS
    except ValueError:
        raise SafetyError(f"{entered.strip()!r} is not an angle", expected="degrees, such as 45") from None
    return moved, before, after


def _until(
    readings: Iterable[DriveReading], needed: Sequence[str], lines: Callable[[], str | None]
) -> tuple[DriveReading, str]:
    """Cycles without power until a line is entered and the angles needed are there; the last reading and that line."""
    missing, entered = 0, None
    for reading in readings:
        there = all(math.isfinite(getattr(reading, one)) and getattr(reading, AGES[one]) <= _OLD for one in needed)
        missing = 0 if there else missing + 1
        if missing > SETTLED:
            raise DriveError(
                f"no angle of the {' and the '.join(needed)} comes",
                do="check the encoders' plugs, the drive's PDOs, and the program that sends [joint_sensor]",
            )
        entered = lines() if entered is None else entered
        if entered is not None and not missing:
            return reading, entered
    raise AssertionError  # it has no end of its own


def _path(rig: Rig) -> Path:
    """One file for a drive and all that makes angles of its counts; another law or reference asks for no new turn."""
    drive, needs, family = rig.drive, rig.drive_needs, family_of(rig.drive)
    address, scales = sorted(family.address(drive).items()), list(family.scales(drive))
    sensor = (rig.joint_sensor,) if rig.joint_sensor.estimated else ()
    bound = (drive.family, address, scales, needs.gear, needs.spool, rig.supervisor_limits.slack_sign, *sensor)
    name = hashlib.sha256(repr(bound).encode())
    return state_folder() / f"by-hand-{name.hexdigest()[:16]}.json"


def confirm(rig: Rig, moved: float, joint: float, motor: float, serial: str = "") -> Path:
    """Keep that the angles of a rig's drive, of that serial number, were confirmed; where it is kept.

    Raises:
        SafetyError: they do not agree with what was read by hand.
        OutputError: it cannot be kept.
    """
    found = contradictions(moved, joint, motor, rig.supervisor_limits, rig.joint_sensor)
    if found:
        raise SafetyError("; ".join(found))
    kept = {"rig": rig.hash, "utc": unix_seconds(), "told_deg": moved * DEGREES}
    kept |= {"joint_deg": joint * DEGREES, "motor_deg": motor * DEGREES, "serial": serial}
    try:
        path = _path(rig)
        path.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError) as error:
        raise OutputError(f"cannot keep what was confirmed: {error}", do="see to XDG_STATE_HOME") from error
    with whole_file(path) as stage:
        stage.write_text(json.dumps(kept), encoding="utf-8")
    return path


def _kept(rig: Rig) -> dict[str, Any]:
    """What was kept of the drive; nothing where there is nothing that can be read, and of a twin."""
    try:
        kept = {} if family_of(rig.drive).simulated(rig.drive) else json.loads(_path(rig).read_text(encoding="utf-8"))
    except (OSError, RuntimeError, ValueError, RecursionError):
        return {}
    return kept if isinstance(kept, dict) else {}


def confirmed(rig: Rig) -> bool:
    """True if somebody has confirmed an angle on this rig's drive, or nobody need: there is a twin."""
    if family_of(rig.drive).simulated(rig.drive):
        return True
    kept = _kept(rig)
    try:
        moved, joint, motor = (float(kept[name]) * RADIANS for name in ("told_deg", "joint_deg", "motor_deg"))
    except (ValueError, KeyError, TypeError):
        return False
    return not contradictions(moved, joint, motor, rig.supervisor_limits, rig.joint_sensor)


def require_confirmed(rig: Rig, motor: str = "") -> None:
    """Refuse to power a motor whose angles nobody has confirmed.

    Args:
        rig: of the motor.
        motor: its name among several.

    Raises:
        SafetyError: nobody has, for this drive and these scales.
    """
    if not confirmed(rig):
        raise SafetyError(
            "no angle has been confirmed by hand on this drive with these scales and directions",
            expected="the joint turned once by hand, without power, and compared with both encoders",
            do=shlex.join(["bowden", "confirm", rig.origin, *(["--motor", motor] if motor else [])]),
        )


def require_same(motors: Sequence[tuple[str, Rig, str]]) -> None:
    """Refuse to power drives that are not those that were confirmed: numbers or buses of two may be swapped.

    Args:
        motors: name, rig and serial number of each drive that was brought up; a family without one has the empty text.

    Raises:
        SafetyError: another serial number than when it was confirmed.
    """
    confirmed_as = {name: str(_kept(rig).get("serial", "")) for name, rig, _ in motors}
    for name, rig, serial in motors:
        expected = confirmed_as[name]
        if not expected or serial == expected:
            continue
        other = next((one for one, kept in confirmed_as.items() if one != name and kept == serial), "")
        drive = f"the drive of motor {name!r}" if name else "the drive"
        again = shlex.join(["bowden", "confirm", rig.origin, *(["--motor", name] if name else [])])
        raise SafetyError(
            f"{drive} has the serial number {serial or 'none'}"
            + (f", which was confirmed as motor {other!r}: numbers or buses of the two are swapped" if other else ""),
            expected=f"{expected}, as it was confirmed by hand",
            do="swap them back, at the drives or in rig.toml" if other else f"if it was replaced: {again}",
        )
