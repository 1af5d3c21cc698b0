"""Reading and checking the log of a cable: CSV (also gzipped), MATLAB, NPZ and Parquet files."""

import math
import shlex
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.arguments import said
from bowden.core.bounded import open_file
from bowden.core.errors import LogError, ParameterError
from bowden.core.guesses import answering
from bowden.core.units import DEGREES
from bowden.identify.cable import checks
from bowden.identify.cable.counting import NOT_SAID, Covered, Encoders
from bowden.identify.cable.trusted import Trust
from bowden.identify.cable.turns import least_swing, resolution, reversals
from bowden.identify.log.angles import (
    SIDES,
    Angle,
    angle_units,
    angles_of,
    check_plausible,
    geared,
    unit_doubts,
    unwrapped,
    without_outliers,
)
from bowden.identify.log.clock import even_clock, held_rows, odd_time, rises_evenly
from bowden.identify.log.columns import CABLE, FACTORS, LogColumn, find_columns, unit_of
from bowden.identify.log.mat import is_matlab, read_matlab
from bowden.identify.log.text import read_text
from bowden.records.table import PARQUET, ZIP, read_table

Array = NDArray[np.float64]

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

    @property
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


def read_log(
    path: Path | str,
    *,
    time: str | None = None,
    motor: str | None = None,
    joint: str | None = None,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | str | None = None,
    rate: float | None = None,
) -> Log:
    """Read a cable's log and check it.

    Args:
        path: ``.csv``, ``.csv.gz``, ``.mat`` (up to version 7), ``.npz``, ``.parquet``; text may stand above the names.
        time: name of the time column; guessed where it is not given.
        motor: name of the motor's column.
        joint: name of the joint's column.
        unit: of the angles, ``deg``, ``rad`` or ``counts``, or one each (``counts,deg``); taken from the columns' names
            where it is not given.
        counts_per_turn: of the encoders, one number for both or one each; see `angle_units`.
        rate: rows a second of a log without times; a time column is then not read [Hz].

    Raises:
        LogError: the file cannot be read, or the log cannot be used; one line that says why and where.
        ParameterError: an unknown unit, counts or a rate that cannot be, a rate beside a time column's name.
    """
    units, file = angle_units(unit, counts_per_turn), Path(path)
    checked_rate(rate, time)
    given = {"time": time, "motor": motor, "joint": joint}
    raw, warnings = from_the_first_reading(read_columns(file, given, optional=() if rate is None else ("time",)))
    if rate is None and not rises_evenly(raw.values["time"]):
        for side in SIDES:
            if rises_evenly(raw.values[side]):
                clock, other = raw.columns["time"].name, raw.columns[side].name
                raise LogError(
                    f"{file}: {other!r} rises by equal steps, as a time does, and {clock!r} does not",
                    expected="a time that rises",
                    do=f"exchange the names {clock!r} and {other!r} in the file",
                )
    for role, values in raw.values.items():
        if role != "time" or rate is None:
            checks.check_finite(raw.columns[role].name, values, raw.place)
    named = {side: (raw.columns[side].name, raw.columns[side].unit) for side in SIDES}
    angles, guessed = angles_of(named, raw.values, units)
    seconds, timed = seconds_of(raw, rate, file)
    doubts = [Trust("with care", (said,)) for said in timed if rate is None]
    timed = timed if rate is not None else []
    return prepare(seconds, angles, file.name, raw.place, units.apart, (*warnings, *guessed, *timed), doubts)


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
            f"the rate is {said(rate)}", expected="rows a second, a number above 0", do="give such a number"
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
    """Columns of a log, from text, a MATLAB file, NPZ or Parquet; see `find_columns`.

    Raises:
        LogError: the file cannot be read, or has no such columns.
    """
    try:
        if file.is_dir():
            raise LogError(
                f"{file} is a folder",
                expected="a log file",
                do="give the path of one .csv, .csv.gz, .mat, .npz or .parquet",
            )
        with open_file(file) as opened:
            head = opened.read(512)
        if not head:
            raise LogError(
                f"{file} is empty", expected=f"columns for {', '.join(known)}", do="record or export the log again"
            )
        if head.startswith(b"\x89MCAP0\r\n"):
            raise LogError(
                f"{file} is the log of a live run",
                expected="time, motor and joint in columns",
                do=f"write them: bowden log export {shlex.quote(str(file))}; in Python read it with "
                "bowden.read_trace(path), which bowden.identify takes",
            )
        read = _read_table if head.startswith((PARQUET, ZIP)) else read_matlab if is_matlab(file, head) else read_text
        columns, values, place = read(file, given, known, optional)
        return RawLog(columns, {role: np.asarray(part, dtype=np.float64) for role, part in values.items()}, place)
    except FileNotFoundError:
        raise LogError(f"{file} does not exist", do="check the path") from None
    except OSError as error:
        raise LogError(
            f"{file} cannot be read: {error.strerror or error}", do="check the file and its permissions"
        ) from None


def _read_table(
    path: Path, given: Mapping[str, str | None], known: Mapping[str, Sequence[str]], optional: Collection[str] = ()
) -> tuple[dict[str, LogColumn], dict[str, Array], Callable[[int], str]]:
    table = read_table(path)
    columns = find_columns(table.names, given, str(path), known, optional)
    for role, column in columns.items():
        columns[role] = LogColumn(column.index, column.name, column.unit or unit_of(table.units.get(column.name, "")))
    values = table.numbers([column.index for column in columns.values()])
    return columns, dict(zip(columns, values, strict=True)), lambda sample: f"{path}, row {sample + 1}"


def seconds_of(raw: RawLog, rate: float | None, file: Path) -> tuple[Array, list[str]]:
    """Times of the rows of a log (n,) [s], and what is to be said of them.

    Raises:
        LogError: times in another unit than one of time.
    """
    if rate is not None:
        unread = raw.columns.get("time")
        notes = [f"column {unread.name!r} was not read: the rate of the rows was given"] if unread else []
        return np.arange(len(raw.values["motor"])) / rate, notes
    column = raw.columns["time"]
    named = column.unit or unit_of(column.name)
    unit = named or "s"
    if unit not in ("s", "ms", "us"):
        raise LogError(
            f"{file}: the times in {column.name!r} are in {unit}",
            expected="s, ms or us",
            do="name another column, or give the rows' rate: --rate 1000 (rate= in Python)",
        )
    notes = [f"no unit is named for {column.name!r} (taken as s): end the name in _s or _ms"] if named is None else []
    return raw.values["time"] * FACTORS[unit], notes


def from_the_first_reading(raw: RawLog) -> tuple[RawLog, list[str]]:
    """The log without the rows at its beginning in which no angle had been read yet, as that of a live run has them."""
    there = np.all([np.isfinite(values) for role, values in raw.values.items() if role != "time"], axis=0)
    first = int(there.argmax()) if there.any() else 0
    if first == 0:
        return raw, []
    values = {role: part[first:] for role, part in raw.values.items()}
    said = f"the first {first} rows, in which no angle had been read yet, were left out"
    return RawLog(raw.columns, values, lambda i: raw.place(i + first)), [said]


def prepare(
    time: Array,
    angles: Mapping[str, Angle],
    name: str,
    place: Callable[[int], str],
    apart: bool = False,
    warnings: Sequence[str] = (),
    doubts: Sequence[Trust] = (),
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

    Raises:
        LogError: too short, not finite, not moving, angles that no cable has, or no clock.
    """
    checks.check_length(len(time), name)
    for what, values in (("time", time), *((one.name, one.values) for one in angles.values())):
        checks.check_finite(what, values, place)
    (motor, notes), (joint, more) = (unwrapped(angles[side]) for side in SIDES)
    check_plausible(motor, joint, place)
    (motor, filled), (joint, further) = (without_outliers(one, place) for one in (motor, joint))
    notes, more = notes + filled, more + further
    if not apart:
        checks.check_same_unit(motor.radians, joint.radians, name)
    more += geared(motor, joint)
    even, (motor_at, joint_at), clock = even_clock(time, (motor.radians, joint.radians), place)
    checks.check_length(len(even), name)
    counts = (resolution(motor.radians), resolution(joint.radians)) if clock else None
    even, motor_at, joint_at, repeats, seldom = at_new_readings(even, motor_at, joint_at)
    found = "the joint turns round before the motor does: motor and joint look swapped; exchange their columns"
    swapped = Trust("no", (found,))
    doubts = (
        *doubts,
        *unit_doubts(motor, joint, apart=apart),
        *odd_time(even, motor_at, joint_at),
        *seldom,
        *([swapped] if checks.look_swapped(motor_at, joint_at) else []),
    )
    if (stop := checks.stopped_at(motor_at, joint_at)) is not None:
        at, on = (one * DEGREES for one in stop)
        why = f"the joint stands at {at:.4g}° while the motor goes on by {on:.2g}°: the end of its sensor, or a stop"
        doubts = (*doubts, Trust("with care", (why,)))
    said = (*warnings, *notes, *more, *clock, *repeats)
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
    if first is None or len(time) // rows < max(checks.FEWEST_SAMPLES, _OF_A_STROKE * strokes):
        why = f"{said}, which makes the loop look wider: record a row when a new reading comes"
        return time, motor, joint, [], [Trust("with care", (why,))]
    time, motor, joint = (one[first::rows] for one in (time, motor, joint))
    said += "; the others were left out"
    alike = held["motor"] == held["joint"]
    return time, motor, joint, [said] * alike, [] if alike else [Trust("with care", (said,))]
