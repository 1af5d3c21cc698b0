"""Reading and checking the log of a cable, of whatever kind and however laid out."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.arguments import format_value, path_of
from bowden.core.errors import LogError, ParameterError, counted
from bowden.core.guesses import answering
from bowden.identify.cable.turns import least_swing, resolution, reversals
from bowden.identify.log.angles import (
    COUNTERS,
    GAP,
    SIDES,
    Angle,
    AngleUnits,
    angle_units,
    angles_of,
    check_plausible,
    compared,
    odd_motions,
    unwrapped,
    without_outliers,
)
from bowden.identify.log.clock import (
    FEWEST_SAMPLES,
    check_finite,
    check_length,
    even_clock,
    held_rows,
    in_seconds,
    odd_time,
    rises_evenly,
)
from bowden.identify.log.columns import CABLE, FACTORS, TIMES, LogColumn, find_columns, only_angle, sides_in
from bowden.identify.log.quaternions import with_angles
from bowden.plants.counting import NOT_SAID, Covered, Encoders
from bowden.plants.trust import Trust
from bowden.records.table import read_table
from bowden.records.units import unit_of

Array = NDArray[np.float64]

_EPOCH = 8
"""Digits of a time from 1970 in seconds, less one."""
_TURNS = (86400.0, *COUNTERS)
"""Where times begin again: after a day [s], and where a counter of milli- or microseconds overflows."""
_LATE = 1e6
"""Times beyond which digits of small steps are lost: they are counted from the first [s]."""
_APART = 0.5
"""Share of the rows with one angle that must have the other too."""
_OF_A_STROKE = 8
"""Rows of a stroke that must stay where others are left out: as many as it has nodes at least when it is fitted."""


@answering(
    {
        "plot": "bowden.identify(log).plot()",
        "fit": "bowden.identify(log)",
        "rate": "1 / (log.time[1] - log.time[0])",
        **dict.fromkeys(("motor_deg", "joint_deg"), "numpy.degrees(log.motor), numpy.degrees(log.joint)"),
    },
    "read the log again",
)
@dataclass(frozen=True)
class Log:
    """A log that is fit to be identified from."""

    time: Array
    """Even, increasing (n,) [s]."""
    motor: Array
    """Motor-side angle (n,) [rad]."""
    joint: Array
    """Joint-side angle (n,) [rad]."""
    name: str
    """The file's name, for reports."""
    warnings: tuple[str, ...]
    """What was mended or guessed."""
    doubts: tuple[Trust, ...] = ()
    """Why no model of it is to be trusted without care: its units, its time, what its sensors did."""
    counts: tuple[float, float] | None = None
    """One count of motor's and joint's encoder, as recorded: an even clock's angles lie between them. None where the
    angles are as recorded [rad]."""
    encoders: Encoders = NOT_SAID
    """One count of each, where somebody said how many make a turn."""

    @cached_property
    def resolutions(self) -> tuple[float, float]:
        """One count of motor's and joint's encoder; zero where none can be determined [rad]."""
        return self.counts or (resolution(self.motor), resolution(self.joint))

    @property
    def covered(self) -> Covered:
        """The motion that is in it."""
        ends = (float(choose(values)) for values in (self.motor, self.joint) for choose in (np.min, np.max))
        return Covered(*ends)


@dataclass(frozen=True)
class RawLog:
    """The columns of a log as a file holds them."""

    columns: Mapping[str, LogColumn]
    """Role (time, motor, joint) → where it was found; of one that a log need not have, perhaps nothing."""
    values: Mapping[str, Array]
    """Role → (n,), in the file's units."""
    place: Callable[[int], str]
    """Sample → where it stands in the file, for messages."""


class Layout(NamedTuple):
    """What a user says of a log's layout; see `read_log`."""

    time: Any = None
    """Name or number of a column, or its values (n,); so the next two."""
    motor: Any = None
    joint: Any = None
    unit: str | None = None
    counts_per_turn: float | Sequence[float] | str | None = None
    spool_radius_mm: float | None = None
    rate: float | None = None

    @property
    def units(self) -> AngleUnits:
        """Of the angles, read."""
        return angle_units(self.unit, self.counts_per_turn, self.spool_radius_mm)

    def columns(self, path: Path) -> dict[str, str | None]:
        """Role (time, motor, joint) → name or number of its column in a file.

        Raises:
            ParameterError: something else, or a rate that is none or beside times.
        """
        checked_rate(self.rate, self.time)
        named: dict[str, str | None] = {}
        for role in ("time", *SIDES):
            column = getattr(self, role)
            named[role] = str(column) if type(column) is int else column
            if not isinstance(named[role], str | None):
                raise ParameterError(
                    f"{role} of the log {path} is {format_value(column)}",
                    expected="the name or number of a column in the file",
                    do="or give only arrays: identify(time, motor, joint)",
                )
        return named


def read_log(
    path: Path | str,
    *,
    time: Any = None,
    motor: Any = None,
    joint: Any = None,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | str | None = None,
    spool_radius_mm: float | None = None,
    rate: float | None = None,
) -> Log:
    """Read the log of a cable and check it: even time, finite angles that move, in radians.

    Args:
        path: CSV (also gzipped), NumPy, Parquet, MATLAB, HDF5, Excel, TDMS, or the folder of a bag of ROS 2; text
            above the names is skipped.
        time: name or number (from 1) of the time column; guessed where it is not given.
        motor: of the motor's column.
        joint: of the joint's column.
        unit: of the angles, ``deg``, ``rad``, ``turns``, ``counts`` or (of the motor) ``mm``, or one each
            (``"counts,deg"``); as the columns' names say where it is not given.
        counts_per_turn: of the encoders, where they count: one number, or one for the motor and one for the joint.
        spool_radius_mm: of the motor, where its column is a length of cable.
        rate: rows a second, of a log without times [Hz].

    Returns:
        ``time`` [s], ``motor`` and ``joint`` [rad]; ``warnings`` say what was corrected or guessed.

    Raises:
        LogError: the file cannot be read, or the log cannot be used; the message says why and where.
        ParameterError: arguments of the wrong kind.

    >>> import bowden, pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "log.csv"
    >>> rows = "".join(f"{0.01 * i:.2f},{i % 50},{(i + 3) % 50}\\n" for i in range(400))
    >>> _ = file.write_text("time_s,motor_deg,joint_deg\\n" + rows)
    >>> bowden.read_log(file).joint[0].round(3)
    np.float64(0.052)
    """
    file = path_of(path, "read_log: path")
    return read_file(file, Layout(time, motor, joint, unit, counts_per_turn, spool_radius_mm, rate))


def read_file(file: Path, layout: Layout) -> Log:
    """`read_log` of what a user says of a log's layout."""
    units, rate, given = layout.units, layout.rate, layout.columns(file)
    raw = read_columns(file, given, optional=() if rate is None else ("time",))
    if rate is None and not rises_evenly(raw.values["time"]):
        for side in SIDES:
            if rises_evenly(raw.values[side]):
                clock, other = raw.columns["time"].name, raw.columns[side].name
                raise LogError(
                    f"{file}: {other!r} rises by equal steps, as a time does, and {clock!r} does not",
                    expected="a time that rises",
                    do=f"exchange the names {clock!r} and {other!r} in the file",
                )
    raw, warnings = with_both(raw, rate)
    angles, guessed = angles_of(raw.columns, raw.values, units)
    seconds, notes, timed = seconds_of(raw, rate, file)
    words = [f"{role} is column {one.name!r}, by a word in it" for role, one in raw.columns.items() if one.by_word]
    said = (*words, *warnings, *guessed, *notes)
    return prepare(seconds, angles, file.name, raw.place, units.apart, said, time_unit_known=timed)


def read_run(files: Sequence[Path], layout: Layout) -> Log | None:
    """One run of which one file has the motor and another the joint, on one clock; None where they are no such files.

    The columns say which it is. Where those of a file do not, and it has one beside its time, or one in a unit of
    angles, that is the side that the other file lacks; where neither says it, the motor's file comes first.

    Args:
        files: two.
        layout: of both.

    Raises:
        LogError: a file that cannot be read, or files that are not of one motion.
    """
    from bowden.identify.log.align import aligned  # with a family of cables, which few logs need

    units, rate, given = layout.units, layout.rate, layout.columns(files[0])
    names = [with_angles(read_table(file)).names for file in files]
    found = [sides_in(given, one) for one in names]
    if sum(map(len, found)) < 2 and all(map(only_angle, names)):
        found = [
            one or (other and {*SIDES} - other) or {side}
            for one, other, side in zip(found, found[::-1], SIDES, strict=True)
        ]
    if [len(one) for one in found] != [1, 1] or found[0] == found[1]:
        return None
    raws: dict[str, RawLog] = {}
    warnings: list[str] = []
    at: dict[str, Array] = {}
    for file, (side,), each in zip(files, found, names, strict=True):
        named = given[side] or (None if sides_in(given, each) else only_angle(each))
        known = {"time": TIMES, side: CABLE[side]}
        raw = read_columns(file, {"time": given["time"], side: named}, known, () if rate is None else ("time",))
        raws[side], lost = with_both(raw, rate)
        at[side], notes, _ = seconds_of(raws[side], rate, file)
        warnings += [f"{file.name}: {one}" for one in (*lost, *notes) if one]
    columns = {side: raws[side].columns[side] for side in SIDES}
    angles, guessed = angles_of(columns, {side: raws[side].values[side] for side in SIDES}, units)
    signals = {}
    for side in SIDES:
        angles[side], notes = unwrapped(angles[side])
        even, (values,), more = even_clock(at[side], [angles[side].values], raws[side].place, cut=True)
        signals[side] = even, values
        warnings += [*notes, *more]
    both = aligned(signals["motor"], signals["joint"])
    angles = {side: replace(angles[side], values=getattr(both, side)) for side in SIDES}
    name = " + ".join(file.name for file in files)
    doubts = [Trust("with care", (both.said,))] if both.uncertain else []
    said = (*warnings, *guessed, both.said)
    return prepare(both.time, angles, name, lambda i: f"{name}, sample {i + 1}", units.apart, said, doubts)


def checked_rate(rate: Any, time: object = None) -> None:
    """Refuse a rate that is none, or one beside a column or an array of times.

    Raises:
        ParameterError: it is.
    """
    if rate is None:
        return
    if (
        isinstance(rate, bool)
        or not isinstance(rate, int | float | np.integer | np.floating)
        or not 0.0 < rate < math.inf
    ):
        raise ParameterError(
            f"the rate is {format_value(rate)}", expected="rows a second, a number above 0", do="give such a number"
        )
    if time is not None:
        raise ParameterError(
            "a rate and times are given for one log",
            expected="one of them",
            do="leave the rate out where there are times",
        )


def read_columns(
    file: Path,
    given: Mapping[str, str | None],
    known: Mapping[str, Sequence[str]] = CABLE,
    optional: Collection[str] = (),
) -> RawLog:
    """Columns of a log; see `read_table` and `find_columns`.

    Raises:
        LogError: the file cannot be read, or has no such columns.
    """
    table = with_angles(read_table(file))
    columns = find_columns(table.names, given, str(file), known, optional, table.units)
    clock = columns["time"].index if "time" in columns else None
    values = table.numbers([column.index for column in columns.values()], clock) if columns else []
    if values and not len(values[0]):
        raise LogError(f"{file}: no row of numbers found", expected="columns of numbers", do="record the log again")
    found = dict(zip(columns, values, strict=True))
    if "time" in found:
        found["time"] = _counted_on(found["time"])
    return RawLog(columns, found, table.place)


def _counted_on(time: Array) -> Array:
    """Times (n,) of day that go past midnight, or of a counter that overflows, counted on; all others as they are."""
    steps = np.diff(time)
    back = steps < 0.0
    for turn in _TURNS if back.any() else ():
        if ((turn + steps[back] > 0.0) & (turn + steps[back] < GAP * np.nanmedian(steps))).all():
            return time + turn * np.concatenate([[0.0], np.cumsum(back)])
    return time


def seconds_of(raw: RawLog, rate: float | None, file: Path) -> tuple[Array, list[str], bool]:
    """Times of the rows of a log (n,) [s], what is to be said of them, and whether their unit is known.

    Raises:
        LogError: times in another unit than one of time.
    """
    if rate is not None:
        unread = raw.columns.get("time")
        notes = [f"column {unread.name!r} was not read: the rate of the rows was given"] if unread else []
        return np.arange(len(next(iter(raw.values.values())))) / rate, notes, True
    column, time = raw.columns["time"], raw.values["time"]
    named = column.unit or unit_of(column.name)
    if named is None and (digits := int(np.log10(max(abs(time[0]), 1.0)))) > _EPOCH:  # from 1970, in one unit or other
        named = ("s", "ms", "us", "ns")[min((digits - _EPOCH) // 3, 3)]
    unit = named or "s"
    if unit not in ("s", "ms", "us", "ns"):
        raise LogError(
            f"{file}: the times in {column.name!r} are in {unit}",
            expected="s, ms, us or ns",
            do="name another column, or give the rows' rate: --rate 1000 (rate= in Python)",
        )
    return (time - time[0]) * FACTORS[unit] if abs(time[0]) > _LATE else time * FACTORS[unit], [], named is not None


def with_both(raw: RawLog, rate: float | None) -> tuple[RawLog, list[str]]:
    """The log at rows in which motor and joint are known.

    Where they stand in different rows, as two sensors of their own rates write them, the one with more readings is
    interpolated to the rows of the other. Else rows without a number are left out, which leaves gaps.
    """
    time = raw.values.get("time", np.empty(0)) if rate is None else np.empty(0)
    sides = [role for role in raw.values if role != "time"]
    known = {side: np.isfinite(raw.values[side]) for side in sides}
    timed = np.isfinite(time) if len(time) else np.ones(len(raw.values[sides[0]]), dtype=bool)
    both = np.all([timed, *known.values()], axis=0)
    if both.all():
        return raw, []
    counts = {side: int((known[side] & timed).sum()) for side in sides}
    few = min(sides, key=lambda side: counts[side])
    first = int(both.argmax()) if both.any() else 0
    said = ""
    if len(time) and both.sum() < _APART * counts[few] and counts[few] >= FEWEST_SAMPLES:
        rows = np.flatnonzero(known[few] & timed)
        values = {"time": time[rows], few: raw.values[few][rows]}
        for side in set(sides) - {few}:
            there = np.flatnonzero(known[side] & timed)
            values[side] = np.interp(time[rows], time[there], raw.values[side][there])
            rates = (counts[one] / max(np.ptp(time[timed]), 1e-300) for one in (few, side))
            said = f"{few} and {side} stand in different rows: {side} was interpolated to the {counts[few]} of {few}"
            said += "" if raw.columns["time"].unit != "s" else " ({:.4g} and {:.4g} Hz)".format(*rates)
    elif not both.any() or both.sum() < _APART * len(both):
        worst = int(np.argmin(both[first:])) + first
        name = next((raw.columns[side].name for side in sides if not known[side][worst]), "time")
        raise LogError(
            f"{raw.place(worst)}: {name} is nan, and {len(both) - int(both.sum())} of {len(both)} rows lack a number",
            expected="a number in most rows",
            do="name other columns, or record the log again",
        )
    else:
        rows = np.flatnonzero(both)
        values = {role: part[rows] for role, part in raw.values.items()}
        lost = len(both) - len(rows)
        rest = lost - first
        places = int(np.count_nonzero(np.diff(both[first:].astype(np.int8)) == -1))
        said = f"the first {first} rows, in which no angle had been read yet, were left out" if first else ""
        if rest:
            said += "; " * bool(said) + f"{counted(rest, 'row')} without a number in {counted(places, 'place')}"
            said += " were left out"
        if rest and rate is not None:
            values = {r: np.interp(np.arange(first, len(both)), rows, part) for r, part in values.items()}
            said += " and bridged by straight lines"
    return RawLog(raw.columns, values, lambda i: raw.place(int(rows[min(i, len(rows) - 1)]))), [said]


def prepare(
    time: Array,
    angles: Mapping[str, Angle],
    name: str,
    place: Callable[[int], str],
    apart: bool = False,
    warnings: Sequence[str] = (),
    doubts: Sequence[Trust] = (),
    *,
    time_unit_known: bool = True,
) -> Log:
    """Check time and both angles, and put them on an even clock, in radians.

    Args:
        time: (n,) [s].
        angles: of motor and joint, as the log has them.
        name: of the log, for messages.
        place: sample → place, for messages.
        apart: whether the unit of each side was said by itself; a ratio of 57 between them is then a gear.
        warnings: what was mended or guessed before.
        doubts: in what was read.
        time_unit_known: whether somebody named the unit of time; else it is the one in which the motion is possible.

    Raises:
        LogError: too short, not finite, not moving, angles that no cable has, or no clock.
    """
    check_length(len(time), name)
    for what, values in (("time", time), *((one.name, one.values) for one in angles.values())):
        check_finite(what, values, place)
    (motor, notes), (joint, more) = (unwrapped(angles[side]) for side in SIDES)
    check_plausible(motor, joint, place)
    (motor, filled), (joint, further) = (without_outliers(one, time, place) for one in (motor, joint))
    notes, more = notes + filled, more + further
    gear, of_units = compared(motor, joint, name, apart=apart)
    even, (motor_at, joint_at), clock = even_clock(time, (motor.radians, joint.radians), place, cut=True)
    if not time_unit_known:
        even, guessed = in_seconds(even, motor_at, joint_at)
        doubts = (*doubts, *guessed)
    check_length(len(even), name)
    counts = (resolution(motor.radians), resolution(joint.radians)) if clock else None
    even, motor_at, joint_at, repeats, seldom = at_new_readings(even, motor_at, joint_at)
    motions = (*odd_time(even, motor_at, joint_at), *seldom, *odd_motions(motor_at, joint_at))
    doubts = (*doubts, *of_units, *motions)
    said = (*(one for one in warnings if one), *notes, *more, *gear, *clock, *repeats)
    encoders = Encoders(*(angles[side].count for side in SIDES))
    return Log(even, motor_at, joint_at, name, said, doubts, counts, encoders)


def at_new_readings(time: Array, motor: Array, joint: Array) -> tuple[Array, Array, Array, list[str], list[Trust]]:
    """A log without the rows that repeat a reading of its joint or of its motor, where a new one comes evenly.

    A repeated reading is late by up to as many rows, which a fit takes for a wider loop; not where both are repeated in
    the same rows.

    Returns:
        Time, motor and joint; what was left out; why what is left is to be doubted.
    """
    held = {side: held_rows(angle) for side, angle in zip(SIDES, (motor, joint), strict=True)}
    name = max(SIDES, key=lambda side: held[side][0])
    rows, first = held[name]
    if rows == 1:
        return time, motor, joint, [], []
    said = f"the {name} repeats {rows} rows: {1.0 / (rows * (time[1] - time[0])):.4g} Hz"
    strokes = len(reversals(motor, least_swing(motor))) + 1
    if first is None or len(time) // rows < max(FEWEST_SAMPLES, _OF_A_STROKE * strokes):
        why = f"{said}, which makes the loop look wider: record a row when a new reading comes"
        return time, motor, joint, [], [Trust("with care", (why,))]
    time, motor, joint = (one[first::rows] for one in (time, motor, joint))
    said += "; the others were left out"
    alike = held["motor"] == held["joint"]
    return time, motor, joint, [said] * alike, [] if alike else [Trust("with care", (said,))]
