"""Reading and checking the log of a cable: CSV (also gzipped), MATLAB and Parquet files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import open_file
from bowden.core.errors import LogError, ParameterError
from bowden.core.table import read_parquet, readable
from bowden.identify.cable import checks
from bowden.identify.log.columns import CABLE, FACTORS, LogColumn, find_columns, unit_of
from bowden.identify.log.mat import is_matlab, read_matlab
from bowden.identify.log.text import read_text

Array = NDArray[np.float64]


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


@dataclass(frozen=True)
class RawLog:
    """The columns of a log as a file holds them."""

    columns: Mapping[str, LogColumn]
    """Role (time, motor, joint) → where it was found."""
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
) -> Log:
    """Read a cable's log and check it.

    Args:
        path: ``.csv``, ``.csv.gz``, ``.mat`` (up to version 7) or ``.parquet``; rows of text may stand above the names.
        time: name of the time column; guessed where it is not given.
        motor: name of the motor's column.
        joint: name of the joint's column.
        unit: of both angles, ``deg`` or ``rad``; taken from the columns' names where it is not given.

    Raises:
        LogError: the file cannot be read, or the log cannot be used; one line that says why and where.
        ParameterError: an unknown unit.
    """
    unit = unit.lower() if unit else unit
    if unit not in (None, "deg", "rad"):
        raise ParameterError(f"the unit of the angles is {unit!r}", expected="deg or rad")
    file = Path(path)
    return _in_radians(read_columns(file, {"time": time, "motor": motor, "joint": joint}), unit, file.name)


def read_columns(file: Path, given: Mapping[str, str | None], known: Mapping[str, Sequence[str]] = CABLE) -> RawLog:
    """Columns of a log, from text, a MATLAB file or Parquet; see `find_columns`.

    Raises:
        LogError: the file cannot be read, or has no such columns.
    """
    try:
        if file.is_dir():
            raise LogError(
                f"{file} is a folder", expected="a log file", do="give the path of one .csv, .csv.gz, .mat or .parquet"
            )
        with open_file(file) as opened:
            head = opened.read(512)
        if not head:
            raise LogError(
                f"{file} is empty", expected=f"columns for {', '.join(known)}", do="record or export the log again"
            )
        read = _read_parquet if head.startswith(b"PAR1") else read_matlab if is_matlab(file, head) else read_text
        return RawLog(*read(file, given, known))
    except FileNotFoundError as error:
        raise LogError(f"{file} does not exist", do="check the path") from error
    except OSError as error:
        raise LogError(
            f"{file} cannot be read: {error.strerror or error}", do="check the file and its rights"
        ) from error


def _read_parquet(
    path: Path, given: Mapping[str, str | None], known: Mapping[str, Sequence[str]]
) -> tuple[dict[str, LogColumn], dict[str, Array], Callable[[int], str]]:
    columns: dict[str, LogColumn] = {}

    def choose(schema: Any) -> list[str]:
        columns.update(find_columns(schema.names, given, str(path), known))
        for role, column in columns.items():
            unit = (schema.field(column.index).metadata or {}).get(b"unit", b"").decode()  # of a trace
            columns[role] = LogColumn(column.index, column.name, column.unit or unit_of(unit))
        return [schema.names[column.index] for column in columns.values()]

    with readable(path):
        table = read_parquet(path, choose)
    try:
        values = {role: np.array(table[i].to_numpy(), dtype=np.float64) for i, role in enumerate(columns)}
    except (TypeError, ValueError) as error:
        raise LogError(f"{path} cannot be read: {error}", expected="numbers in the columns of a log") from error
    return columns, values, lambda sample: f"{path}, row {sample + 1}"


def _in_radians(raw: RawLog, unit: str | None, name: str) -> Log:
    raw, warnings = _from_the_first_reading(raw)
    for role, values in raw.values.items():
        checks.check_finite(raw.columns[role].name, values, raw.place)
    own = {role: raw.columns[role].unit for role in ("motor", "joint")}
    own = {role: found if found in ("deg", "rad") else None for role, found in own.items()}
    angles: dict[str, Array] = {}
    for role, other in (("motor", "joint"), ("joint", "motor")):
        column, named = raw.columns[role], own[role] or own[other]
        chosen = unit or named or "rad"
        if unit is not None and own[role] not in (None, unit):
            warnings.append(f"column {column.name!r} names {own[role]}, but {unit} was given and is taken")
        if unit is None and own[role] is None:
            warnings.append(f"column {column.name!r} names no unit and was taken as {chosen} (unless a unit is given)")
        said = unit is not None or named is not None
        checks.check_angles(column.name, raw.values[role], chosen, said, raw.place)
        angles[role] = np.ascontiguousarray(raw.values[role] * FACTORS[chosen])
    seconds = raw.values["time"] * FACTORS.get(raw.columns["time"].unit or "s", 1.0)
    checked = prepare(seconds, angles["motor"], angles["joint"], name, raw.place)
    return Log(checked.time, checked.motor, checked.joint, name, (*warnings, *checked.warnings))


def _from_the_first_reading(raw: RawLog) -> tuple[RawLog, list[str]]:
    """The log without the rows at its beginning in which no angle had been read yet, as that of a live run has them."""
    there = np.isfinite(raw.values["motor"]) & np.isfinite(raw.values["joint"])
    first = int(there.argmax()) if there.any() else 0
    if first == 0:
        return raw, []
    values = {role: part[first:] for role, part in raw.values.items()}
    said = f"the first {first} rows, in which no angle had been read yet, were left out"
    return RawLog(raw.columns, values, lambda i: raw.place(i + first)), [said]


def prepare(time: Array, motor: Array, joint: Array, name: str, place: Callable[[int], str], unit: str = "rad") -> Log:
    """Check three signals, in seconds and in `unit`, and put them on an even clock, in radians.

    Raises:
        LogError: too short, not finite, not moving, beyond ±20 rad, or on an uneven clock.
    """
    checks.check_length(len(time), name)
    for what, values in (("time", time), ("motor", motor), ("joint", joint)):
        checks.check_finite(what, values, place)
    for what, values in (("motor", motor), ("joint", joint)):
        checks.check_angles(what, values, unit, True, place)
    checks.check_same_unit(motor, joint, name)
    motor, joint = motor * FACTORS[unit], joint * FACTORS[unit]
    even, warnings = checks.even_time(time, place)
    if even is not time:
        motor, joint = np.interp(even, time, motor), np.interp(even, time, joint)
    return Log(even, motor, joint, name, (*warnings, *checks.odd_time(even, motor)))
