"""Angles as encoders give them: degrees, radians or counts, perhaps wrapped at a turn, perhaps of many turns."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.arguments import format_value
from bowden.core.errors import LogError, ParameterError
from bowden.core.units import CABLE_LOG_LIMIT, DEGREES, RADIANS
from bowden.identify.cable.turns import Index, least_swing, motor_noise, reversals
from bowden.identify.log.columns import ANGLES, FACTORS, LENGTHS, LogColumn, split_name
from bowden.plants.trust import Level, Trust

Array = NDArray[np.float64]

SIDES = ("motor", "joint")

_TURN = 2.0 * math.pi  # rad
_MOST_TURNS = 1000.0
"""Of a motor before its gear or spool; a wire winds up on no more."""
_STROKE = 0.25
"""Share of a signal's range by which no step of a motion goes; a larger one is an outlier or a wrapped angle."""
_GEARED = 5.0
"""Motion of the motor over the joint's that no cable has: those are 0.8 to 1.2, slack and play included below 5."""
_AS_OF_LENGTH = 1.3
"""Motion of the joint over the motor's [°/mm] from which on a motor without a unit may be a length: a spool of 44 mm
radius or less makes more, cables make 1.15 at most."""
_OUTLIER, _BEYOND_USUAL, _RARE = 0.02, 10.0, 1e-3
"""How far a reading stands beside the median of the five round it, over the motion and over what others are beside
theirs, to be none of the motion; and of how many at most: of more it is what is usual."""
GAP = 4.5
"""A step of time longer than this many medians is a gap however uneven the clock is: USB and ROS deliver rows one to
four together."""
COUNTERS = (2.0**16, 2.0**32)
"""Counts at which counters overflow."""
_EXPECTED = "deg, mdeg, rad, mrad, turns, counts, mm or cm, or one for the motor and one for the joint: counts,deg"


class AngleUnits(NamedTuple):
    """What the user says of the units of motor and joint."""

    unit: tuple[str | None, str | None]
    """``deg``, ``rad`` or ``counts``; None where the log shall say."""
    counts_per_turn: tuple[float | None, float | None]
    """Of each encoder: what one count is, whatever unit the log is in."""
    spool: float | None
    """Radius of the motor's spool, where its column is a length of cable [mm]."""
    apart: bool
    """True if each side has its own unit said, so that a gear between them is no mistake."""


_LEADS = 0.005
"""Of the loop that looks swapped: a quarter of the least that a recorded cable shows [–]."""
_STOPPED = 0.01
"""Share of the motor's range in which a joint that stands still makes the model's end a wrong one [–]. Within a cable's
play it stands as the motor goes back, not on."""
_LIKE_DEGREES = (0.8 * DEGREES, 1.15 * DEGREES)
"""Ratios of two motions that are rather a mistaken unit than a cable's slope: those of cables are 0.8 to 1.15."""


@dataclass(frozen=True)
class Angle:
    """One side's angle as a log has it."""

    name: str
    """Of the column, for messages."""
    values: Array
    """(n,)"""
    unit: str
    """``deg``, ``rad`` or ``counts``."""
    known: bool
    """True if the log or the user named that unit."""
    factor: float
    """Radians in one of it."""
    guessed: bool = False
    """True if nobody named the unit of a file's column."""
    count: float = 0.0
    """One count of its encoder, where somebody said how many make a turn; 0 where not [rad]."""

    @property
    def radians(self) -> Array:
        """(n,) [rad]."""
        return np.ascontiguousarray(self.values * self.factor)


def angle_units(unit: Any = None, counts_per_turn: Any = None, spool_radius_mm: Any = None) -> AngleUnits:
    """The units that a user gave, read.

    Args:
        unit: ``deg``, ``rad``, ``turns``, ``counts`` or ``mm`` for both sides, or one each: ``counts,deg``; None where
            the log shall say.
        counts_per_turn: of both encoders, or one each as a pair or as text: ``8192,4000``. Given alone, those sides are
            in counts whose columns name no unit; beside another unit it is the encoders' resolution.
        spool_radius_mm: of the motor, where its column is a length of cable in mm.

    Raises:
        ParameterError: another unit, or numbers that no encoder has.

    >>> angle_units("counts", "8192,4000").counts_per_turn
    (8192.0, 4000.0)
    """
    if isinstance(unit, list | tuple) and len(unit) == 2 and all(isinstance(one, str) for one in unit):
        raise ParameterError(
            f"the unit of the angles is {format_value(unit)}", expected="text", do=f'give unit="{",".join(unit)}"'
        )
    if unit is not None and not isinstance(unit, str):
        raise ParameterError(
            f"the unit of the angles is {format_value(unit)}", expected=_EXPECTED, do="give one of them"
        )
    parts = [part.strip().lower() for part in unit.split(",")] if unit else [None]
    if len(parts) > 2 or any(part not in (None, *ANGLES, *LENGTHS) for part in parts):
        raise ParameterError(f"the unit of the angles is {unit!r}", expected=_EXPECTED, do="give one of them")
    counts = _counts(counts_per_turn)
    both = (parts[0], parts[-1])
    of_turn = (counts[0], counts[-1]) if counts else (None, None)
    radius = spool_radius_mm
    if radius is not None and not (type(radius) in (int, float) and 0.0 < radius < 1e4):
        raise ParameterError(f"the spool's radius is {format_value(radius)}", expected="mm, above 0", do="measure it")
    return AngleUnits(
        both, of_turn, radius, len(parts) == 2 or radius is not None or (len(counts) == 2 and unit in (None, "counts"))
    )


def _counts(given: Any) -> list[float]:
    if given is None:
        return []
    if isinstance(given, np.ndarray):
        given = np.atleast_1d(given).tolist()
    parts = given.split(",") if isinstance(given, str) else given if isinstance(given, Sequence) else [given]
    try:
        numbers = [float(part) for part in parts if not isinstance(part, bool)]
    except (TypeError, ValueError):
        numbers = []
    if not (len(numbers) == len(parts) and 1 <= len(numbers) <= 2 and all(2.0 <= one < math.inf for one in numbers)):
        raise ParameterError(
            f"the counts per turn are {format_value(given)}",
            expected="a number from 2 on, or one for the motor and one for the joint",
            do="take them from the encoder's data sheet, four for each line of a quadrature encoder",
        )
    return numbers


def angles_of(
    columns: Mapping[str, LogColumn], values: Mapping[str, Array], given: AngleUnits
) -> tuple[dict[str, Angle], list[str]]:
    """Motor and joint in the units that the user gave or the log names, and what was guessed.

    Args:
        columns: side → its column.
        values: side → (n,).
        given: see `angle_units`.

    Raises:
        LogError: a length; one unit for two columns of which one names another; counts that are not whole, or of which
            nobody says how many make a turn.
    """
    spool = given.spool or 0.0
    unit_of_motor = given.unit[0] or ("mm" if spool and columns["motor"].unit is None else None)
    units = (unit_of_motor, given.unit[1])
    for side, unit in zip(SIDES, units, strict=True):
        found = columns[side].unit
        if (unit or found) in LENGTHS and not (side == "motor" and spool):
            radius = "give the radius of its spool: --spool-radius-mm 20 (spool_radius_mm= in Python)"
            do = radius if side == "motor" else "convert it, or name another column"
        elif found not in (None, *ANGLES, *LENGTHS) and unit is None:
            do = "name another column, or give --unit where the name is wrong"
        else:
            continue
        what = f"the {side}'s column {columns[side].name!r} is in {unit or found}"
        raise LogError(what, expected=f"an angle: {', '.join(ANGLES)}", do=do)
    own = {side: columns[side].unit if columns[side].unit in (*ANGLES, *LENGTHS) else None for side in SIDES}
    factors = FACTORS | {unit: length / spool for unit, length in LENGTHS.items() if spool}
    angles: dict[str, Angle] = {}
    warnings: list[str] = []
    for side, other, unit, counts in zip(SIDES, reversed(SIDES), units, given.counts_per_turn, strict=True):
        name, named = columns[side].name, own[side] or (own[other] if own[other] in ANGLES else None)
        if unit is None and counts is not None and own[side] is None:
            unit = "counts"
        chosen = unit or named or "rad"
        if unit is not None and own[side] not in (None, unit):
            if own[other] in (None, unit) and not given.apart:
                apart = ",".join(own[one] or unit for one in SIDES)
                raise LogError(
                    f"column {name!r} names {own[side]}, and {unit} was given for both columns",
                    expected="the unit of each",
                    do=f"give --unit {apart} (unit='{apart}' in Python), or name the column otherwise",
                )
            warnings.append(f"column {name!r} names {own[side]}, but {unit} was given and is taken")
        if chosen == "counts" and counts is None:
            raise LogError(
                f"{name!r} is in counts, and nothing says how many make a turn",
                expected="the counts of a turn",
                do="give them: --counts-per-turn 8192, or 8192,4000 for motor and joint (counts_per_turn= in Python)",
            )
        broken = np.flatnonzero(values[side] != np.round(values[side]))
        if chosen == "counts" and len(broken):
            raise LogError(
                f"{name!r} is taken as counts, and has {values[side][broken[0]]:.9g} in it",
                expected="whole numbers",
                do="give its unit: --unit deg or --unit rad (unit= in Python), beside the counts per turn",
            )
        factor = _TURN / (counts or 1.0) if chosen == "counts" else factors[chosen]
        known, guessed = unit is not None or named is not None, unit is None and own[side] is None
        angles[side] = Angle(name, values[side], chosen, known, factor, guessed, _TURN / counts if counts else 0.0)
    if any(one.unit == "counts" for one in angles.values()) and len({*given.counts_per_turn}) == 1:
        # one number beside one side that counts is that side's: the other's encoder is not known
        angles = {side: one if one.unit == "counts" else replace(one, count=0.0) for side, one in angles.items()}
    return angles, warnings


def unwrapped(angle: Angle) -> tuple[Angle, list[str]]:
    """The angle without the jumps of an encoder that starts again at a turn, or of a counter that overflows.

    It is taken to be one where all readings lie within a turn (a counter's range), some steps are larger than half of
    it, and no step is larger than a quarter once these are taken out. From counts that begin far from
    zero whole turns are taken off.
    """
    values, warnings = angle.values, []
    turn = _TURN / angle.factor
    for period in (turn, *(COUNTERS if angle.unit == "counts" else ())):
        jumps = np.abs(np.diff(values)) > 0.5 * period
        if not jumps.any() or np.ptp(values) > period * (1.0 + 1e-9):
            continue
        whole = np.unwrap(values, period=period)
        if float(np.max(np.abs(np.diff(whole)))) <= 0.25 * period:
            what = "a turn" if period == turn else f"{period:.0f} counts"
            warnings.append(f"{angle.name} wraps at {what} {int(jumps.sum())} times and was unwrapped")
            values = whole
            break
    begun = turn * round(float(values[0]) / turn)
    if angle.unit == "counts" and abs(begun) * angle.factor > CABLE_LOG_LIMIT - _TURN:
        warnings.append(f"{angle.name} begins at {values[0]:.9g} counts; {begun / turn:.0f} whole turns were taken off")
        values = values - begun
    return replace(angle, values=values), warnings


def without_outliers(angle: Angle, time: Array, where: Callable[[int], str]) -> tuple[Angle, list[str]]:
    """The angle without single readings, one or two in a row, that stand far beside their neighbours.

    A disturbed reading goes out and comes back, as no joint does: it is beside the median of the five round it by more
    than 2 % of the motion, and by more than ten times what all but one in a thousand are. It is filled between good
    ones.

    Args:
        angle: unwrapped.
        time: (n,); readings beside a gap in it are left alone: what goes on there elsewhere was not disturbed.
        where: sample → place, for messages.
    """
    from scipy.ndimage import median_filter

    values = angle.values
    middle = median_filter(values, 5, mode="nearest")
    beside = np.abs(values - middle)
    rare = -1 - max(2, int(_RARE * len(beside)))
    usual = float(np.partition(beside, rare)[rare])
    far = beside > max(_OUTLIER * float(np.ptp(middle)), _BEYOND_USUAL * usual)
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > GAP * np.median(steps))
    for side in range(-1, 3):
        far[np.clip(gaps + side, 0, len(far) - 1)] = False
    bad = np.flatnonzero(far)
    if not len(bad):
        return angle, []
    unit = "°" if angle.unit == "deg" else f" {angle.unit}"
    first = f"{where(int(bad[0]))}: {angle.name} is {values[bad[0]]:.6g}{unit}, between {middle[bad[0]]:.6g}{unit}"
    good = np.delete(np.arange(len(values)), bad)
    filled = values.copy()
    filled[bad] = np.interp(bad, good, values[good])
    stand, were = ("1 reading stands", "was") if len(bad) == 1 else (f"{len(bad)} readings stand", "were")
    return replace(angle, values=filled), [
        f"{first}: {stand} far beside the ones round it, as a disturbed one does, and {were} filled between them"
    ]


def check_plausible(motor: Angle, joint: Angle, where: Callable[[int], str]) -> None:
    """Refuse angles that no cable's log holds, and a signal that does not move.

    The joint stays within ±20 rad. So does the motor, but where its unit is known it may make up to 1000 turns, as one
    before a gear or a spool does: without jumps (no step is above a quarter of its range), and while the joint moves by
    less than a turn.

    Args:
        motor: as the log has it.
        joint: as the log has it.
        where: sample → place, for messages.

    Raises:
        LogError: an angle beyond that, or no motion.
    """
    for one in (motor, joint):
        if not np.ptp(one.values) * one.factor > 1e-9:
            raise LogError(
                f"{where(0)}: {one.name} is {one.values[0]:.6g} {one.unit} in every sample",
                expected="a motor that moves back and forth, and a joint that follows",
                do="check the columns and the cable",
            )
        worst = int(np.argmax(np.abs(one.values)))
        far = abs(one.values[worst]) * one.factor > CABLE_LOG_LIMIT
        if far and not (one is motor and _many_turns(motor, joint)):
            raise _beyond(one, one is motor, where(worst), float(one.values[worst]))


def compared(motor: Angle, joint: Angle, where: str, *, apart: bool) -> tuple[list[str], list[Trust]]:
    """What motor and joint beside one another say of their units: notes, and why perhaps they are others.

    A unit that nobody named is a guess. And a joint moves by less than half a turn, and a log of one that can be fitted
    by more than π°: what is taken for radians and moves by more than π may be degrees, and what is taken for degrees
    and moves by less than π, radians. A motor whose column names no unit, and for which one is not said apart from the
    joint's, may be a length where the joint moves too far for a cable.

    Raises:
        LogError: one moves some 57.3 times as far as the other, as degrees do beside radians, and nobody says of each
            `apart` in which unit it is.
    """
    ratio = float(np.ptp(joint.radians) / np.ptp(motor.radians))
    for factor, large, small in ((ratio, "joint", "motor"), (1.0 / ratio, "motor", "joint")):
        if _LIKE_DEGREES[0] < factor < _LIKE_DEGREES[1] and not apart:
            raise LogError(
                f"{where}: the {large} moves {factor:.3g} times as far as the {small}, which looks like degrees beside "
                "radians",
                expected="both in the same unit",
                do="convert one of them; with a gear between them give each unit (--unit deg,deg, unit='deg,deg')",
            )
    span = float(np.ptp(joint.values))
    little = joint.unit == "deg" and span < math.pi
    guessed = " and ".join(f"{one.name!r} (taken as {one.unit})" for one in (motor, joint) if one.guessed)
    said = "" if apart else f" Say so with --unit; if it is not, with --unit {motor.unit},{joint.unit}"
    unlikely: Level = "with care" if apart else "no"
    unnamed = motor.unit == "deg" and split_name(motor.name)[1] is None and not apart
    table: tuple[tuple[bool, Level, str], ...] = (
        (
            joint.unit == "rad" and span > math.pi,
            unlikely,
            f"{joint.name} was taken as rad and so moves by {span / RADIANS:.4g}°: is it in degrees?{said}",
        ),
        (
            little,
            unlikely,
            f"{joint.name} was taken as deg and so moves by {span:.2g}° only: is it in radians?{said}",
        ),
        (
            bool(guessed),
            "with care",
            f"no unit is named for {guessed}: give --unit, or end the names in _deg or _rad",
        ),
        (
            unnamed and ratio > _AS_OF_LENGTH,
            "with care",
            f"the joint moves {ratio:.3g} times as far as {motor.name}, which names no unit: is that a length in mm? "
            "Then divide it by the radius of its spool (rad). If it is an angle, say in which unit: --unit "
            f"deg,{joint.unit} or --unit rad,{joint.unit}",
        ),
        (
            motor.unit == joint.unit == "counts" and ratio > _GEARED,
            "with care",
            f"the joint moves {ratio:.3g} times as far as the motor: are the counts a turn of the two exchanged?",
        ),
    )
    gear = (
        f"the motor moves {1.0 / ratio:.3g} times as far as the joint, as before a gear: the model holds for this "
        "log's motor; a rig counts its motor behind the gear, so divide it by the gear's ratio before the model goes "
        "into one"
    )
    doubts = [Trust(level, (why,)) for holds, level, why in table if holds]
    return [gear] * (ratio * _GEARED <= 1.0 and not little), doubts


def _many_turns(motor: Angle, joint: Angle) -> bool:
    span = float(np.ptp(motor.values))
    steady = float(np.max(np.abs(np.diff(motor.values)))) <= _STROKE * span
    within = float(np.max(np.abs(motor.values))) * motor.factor <= _MOST_TURNS * _TURN
    return motor.known and steady and within and float(np.ptp(joint.values)) * joint.factor < _TURN


def _beyond(angle: Angle, motor: bool, place: str, value: float) -> LogError:
    limit = CABLE_LOG_LIMIT / angle.factor
    turns = " (more of a motor that moves without jumps while the joint moves by less than a turn)" if motor else ""
    if angle.unit == "rad" and not angle.known and np.array_equal(angle.values, np.round(angle.values)):
        return LogError(
            f"{place}: {angle.name} is {value:.9g}, without a unit in its name; whole numbers beyond "
            f"±{CABLE_LOG_LIMIT:g} look like counts of an encoder",
            expected="counts with how many make a turn, or the unit",
            do="give --unit counts --counts-per-turn 8192 (8192,4000 for motor and joint), or --unit deg; in Python "
            "unit= and counts_per_turn=",
        )
    if angle.unit == "rad":
        named = "declared as radians" if angle.known else "without a unit in its name"
        return LogError(
            f"{place}: {angle.name} is {value:.6g}, {named}; angles beyond ±{CABLE_LOG_LIMIT:g} rad look like degrees, "
            "or a length",
            do="give the unit deg (--unit deg, unit='deg'), or end the column's name in _deg; divide a length by the "
            "radius of its spool, which makes it rad"
            + ("; of a motor of many turns, say rad" if motor and not angle.known else ""),
        )
    unit = "°" if angle.unit == "deg" else f" {angle.unit}"
    return LogError(
        f"{place}: {angle.name} is {value:.9g}{unit}",
        expected=f"an angle within ±{limit:.0f}{unit}{turns}",
        do="check the column and its unit, or remove the outlier",
    )


def odd_motions(motor: Array, joint: Array) -> list[Trust]:
    """Why these (n,) [rad] are perhaps no motor and no joint that follows it: they look swapped, or the joint stands.

    A cable's far end lags, and so its loop is gone round one way. What is looked at is ½∮(m·dj − j·dm), over the
    motor's travel and the joint's range: 0.019 to 0.052 on 24 recordings of cables, and nothing on one without play. A
    sensor at the end of its range reads one angle while the motor goes on, and so does a joint at a stop.
    """
    turns, found = reversals(motor, least_swing(motor)), []
    if _look_swapped(motor, joint, turns):
        why = "the joint turns round before the motor does: motor and joint look swapped; exchange their columns"
        found.append(Trust("no", (why,)))
    if (stop := _stopped_at(motor, joint, turns)) is not None:
        at, on = (one * DEGREES for one in stop)
        why = f"the joint stands at {at:.4g}° while the motor goes on by {on:.2g}°: the end of its sensor, or a stop"
        found.append(Trust("with care", (why,)))
    return found


def _look_swapped(motor: Array, joint: Array, turns: Index) -> bool:
    if len(turns) < 3:  # nothing is gone round: the chord of an open path has an area too
        return False
    round_ = slice(turns[0], turns[2 * ((len(turns) - 1) // 2)])
    motor, joint = motor[round_], joint[round_]
    m, j = motor - motor.mean(), joint - joint.mean()
    area = 0.5 * float(np.sum(m[:-1] * np.diff(j) - j[:-1] * np.diff(m)) * np.sign(np.sum(m * j)))
    return area < -_LEADS * float(np.abs(np.diff(m)).sum() * np.ptp(j))


def _stopped_at(motor: Array, joint: Array, turns: Index) -> tuple[float, float] | None:
    """Where the joint stands [rad] while the motor goes on, and how far that goes on [rad]; None where it does not."""
    near = 3.0 * motor_noise(joint)
    direction = float(np.sign(np.sum((motor - motor.mean()) * (joint - joint.mean()))))
    slope = float(np.ptp(joint) / np.ptp(motor))
    for side in (1.0, -1.0):
        out, along = side * joint, side * direction * motor
        there, beyond = out >= out.max() - near, []
        for begin, end in pairwise([0, *turns]):
            if along[end] > along[begin] and there[end] and not there[begin]:
                beyond.append(float(along[end] - along[begin + int(there[begin : end + 1].argmax())]))
        on = sorted(beyond)[-2] if len(beyond) > 1 else 0.0  # once is no stop; and not every stroke goes as far
        if on > _STOPPED * float(np.ptp(motor)) + 2.0 * near / slope:
            return side * float(out.max()), on
    return None
