"""The wearer's push in a live run: what a drive on a bus can measure of it, and within which range."""

import math
from dataclasses import replace

from bowden.control.admittance.push import ROOM
from bowden.control.admittance.virtual_elbow import Admittance
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.live.preflight import SOFT_FIRST, SOFT_FOLLOWS
from bowden.plants.presets.suit import suit as papers_suit
from bowden.plants.pushing import Pushing, behind, friction_of
from bowden.safety.limits import Limits

MARGIN = ROOM
"""The reference stays this far within the range in which the supervisor lets joint and motor be: a wearer's push takes
the joint further than the motor, and a law that feeds the joint back may be led as far beyond that range [rad]."""

REVERSAL = 1.5
"""Extra lag of the motor where a motion turns, beside that by friction: 24° to 28° in simulation [–]."""


PAPERS = 2.79
"""Torque offset that was tried on the paper's suit, at the spool [N·m]."""


def live_pushing(pushing: Pushing, limits: Limits, strongest: float, *, by_emg: bool) -> tuple[Pushing, list[str]]:
    """The push as the live loop has it: measured or estimated, with the reference inside what the supervisor allows.

    And what the user should know of it.

    Args:
        pushing: as the rig describes it.
        limits: the supervisor's.
        strongest: torque offset that the drive may be asked for, at the spool [N·m].
        by_emg: whether EMG is to move the joint too.

    Raises:
        ParameterError: a load cell that the rig does not have; two sources of the reference; a motor that friction
            holds in the preflight; no range that is left.
    """
    if by_emg:
        raise ParameterError(
            "admittance.enabled is true in a run by EMG",
            expected="one source of the reference: either the wearer's push or their EMG",
            do="disable [admittance], or leave --emg and emg.source out",
        )
    if pushing.section.torque != "estimate" and not limits.measures_torque:
        other = "; this one measures the cable's tension alone" if limits.measures_tension else ""
        raise ParameterError(
            f'admittance.torque is "{pushing.section.torque}"',
            expected=f"a load cell that measures the joint's torque in a live run ([load_cell]){other}",
            do='set torque = "estimate" in [admittance], or fit one (docs/drives.md)',
        )
    notes = _of_friction(pushing, strongest)
    given, without = pushing.admittance, behind(pushing.suit)
    inside = _inside(given, limits)
    low, high = inside.low, inside.high
    room = min(MARGIN, low - limits.motor_low, limits.motor_high - high)  # a law may send the motor where it is led
    ends = f"{low / RADIANS:g}° to {high / RADIANS:g}°"
    if inside != given:
        notes.append(f"the reference of [admittance] is held within {ends}, inside [limits]")
    if limits.tracking < REVERSAL * without:
        notes.append(
            f"limits.tracking_deg is {limits.tracking / RADIANS:g}; where a motion turns, friction leaves the motor "
            f"{REVERSAL * without / RADIANS:.0f}° behind, and the supervisor regards it as a motor that does not follow"
        )
    return replace(pushing, admittance=inside, room=room), notes


def _of_friction(pushing: Pushing, strongest: float) -> list[str]:
    """What the user should know of a motor without an integral, which the friction that is left holds behind.

    Raises:
        ParameterError: it holds the motor in the preflight; with what the drive must make up for, or that it cannot.
    """
    motor, most = pushing.suit.motor, (1.0 - SOFT_FOLLOWS) * SOFT_FIRST
    left = behind(pushing.suit, motor.friction_feedforward)
    notes = []
    if pushing.suit.flexor.kind != "play":
        notes.append(
            f"suit.cable is {pushing.suit.flexor.kind!r}: friction of its sheath is not foreseen, and may hold "
            "motor or elbow in the preflight"
        )
    if motor.integral > 0.0 or left <= 0.5 * most:
        return notes
    said = f"suit.friction_feedforward_nm is {motor.friction_feedforward:g} in a live run by [admittance]"
    if left <= most:
        said = f"{said}: the friction that is left holds the motor {left / RADIANS:.1f}° behind"
        return [
            *notes,
            f"{said}; beyond about {0.5 * most / RADIANS:g}° the preflight may not move a firm wearer's elbow",
        ]
    least = math.ceil(100.0 * friction_of(pushing.suit) * (1.0 - most / behind(pushing.suit))) / 100.0
    why = (
        f"the friction that is left holds the motor {left / RADIANS:.1f}° behind, and the preflight lets it be "
        f"{most / RADIANS:g}° of {SOFT_FIRST / RADIANS:g}°"
    )
    if least > strongest:
        raise ParameterError(
            said,
            expected=f"at least {least:g}, and this drive has {strongest:.4g} at most: {why}",
            do="the suit cannot run live with this drive; use a stronger drive, or reduce the friction",
        )
    usual = math.isclose(friction_of(pushing.suit), friction_of(papers_suit())) and strongest >= PAPERS
    do = f"set it, to {PAPERS:g} on the paper's suit" if usual else "set it"
    raise ParameterError(said, expected=f"at least {least:g}: {why}", do=f"{do} (docs/day_one_suit.md)")


def _inside(given: Admittance, limits: Limits) -> Admittance:
    """The virtual elbow within the joint's limits, by `MARGIN`, and within the motor's.

    Raises:
        ParameterError: nothing is left of its range; with the limits that take it away.
    """
    joint = (limits.joint_low + MARGIN, limits.joint_high - MARGIN)
    motor = (limits.motor_low, limits.motor_high)
    low, high = max(given.low, joint[0], motor[0]), min(given.high, joint[1], motor[1])
    if low < high:
        return given._replace(low=low, high=high)
    expected = []
    for (from_, to), name in (
        (
            joint,
            f"{MARGIN / RADIANS:g}° or more inside the joint's limits, {_span(limits.joint_low, limits.joint_high)}",
        ),
        (motor, f"inside the motor's limits, {_span(*motor)}"),
    ):
        if given.low < low == from_ or given.high > high == to:
            expected.append(name)
    raise ParameterError(
        f"admittance.low_deg is {given.low / RADIANS:g} and high_deg {given.high / RADIANS:g}",
        expected=f"some of it {' and '.join(expected)}",
        do="correct them, or [limits]",
    )


def _span(low: float, high: float) -> str:
    return f"{low / RADIANS:g} to {high / RADIANS:g}"
