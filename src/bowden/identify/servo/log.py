"""Reading a servo's log: time, command and motor."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.identify.cable.checks import check_length
from bowden.identify.log.clock import even_clock
from bowden.identify.log.columns import FACTORS, TIMES, LogColumn
from bowden.identify.log.read import checked_rate, read_columns, seconds_of, with_both

Array = NDArray[np.float64]

_SERVO: Mapping[str, Sequence[str]] = {
    "time": TIMES,
    "command": (
        *("command", "cmd", "target", "setpoint", "reference", "desired", "demand", "motor_command", "input", "u"),
    ),
    "motor": (
        *("motor_measured", "motor", "motor_angle", "motor_position", "actual", "measured", "position", "output"),
        *("spool", "spindle", "winch", "drum", "actuator"),
    ),
}
"""Role → common names, the likeliest first."""


def read_servo_log(
    path: Path, given: Mapping[str, str | None], unit: str | None = None, rate: float | None = None
) -> tuple[tuple[Array, Array, Array], list[str]]:
    """Time [s], command and motor [rad], each (n,), on an even clock; and what was mended.

    Args:
        path: a log as `bowden.identify.log.read.read_log` takes it.
        given: role (time, command, motor) → column, or None to guess.
        unit: of both angles, ``deg`` or ``rad``; from the columns' names where it is not given.
        rate: rows a second of a log without times; a time column is then not read [Hz].

    Raises:
        LogError: the file cannot be read, has no such column, a field is not a number, or its times are no clock.
        ParameterError: an unknown unit, a rate that cannot be, a rate beside a time column's name.
    """
    if unit not in (None, "deg", "rad"):
        raise ParameterError(f"--unit is {unit!r}", expected="deg or rad")
    checked_rate(rate, given.get("time"))
    raw, left_out = with_both(read_columns(path, given, _SERVO, () if rate is None else ("time",)), rate)
    factors = {role: _factor(raw.columns[role], unit, path) for role in ("command", "motor")}
    check_length(len(raw.values["motor"]), str(path))
    time, notes, named = seconds_of(raw, rate, path)
    if not named:
        notes.append(f"no unit is named for {raw.columns['time'].name!r} (taken as s): end the name in _s or _ms")
    angles = [raw.values[role] * factor for role, factor in factors.items()]
    even, (command, motor), warnings = even_clock(time - time[0], angles, raw.place)
    return (even, command, motor), [*left_out, *notes, *warnings]


def _factor(column: LogColumn, unit: str | None, path: Path) -> float:
    if unit is not None and column.unit not in (None, unit):
        raise LogError(
            f"{path}: --unit is {unit}, and column {column.name!r} names {column.unit}",
            do="leave --unit out, or correct the name",
        )
    wanted = unit or column.unit
    if wanted is None:
        raise LogError(f"{path}: column {column.name!r} does not say its unit", do="give --unit deg or --unit rad")
    if wanted not in ("deg", "rad"):
        raise LogError(f"{path}: column {column.name!r} is in {wanted}", expected="deg or rad", do="convert it first")
    return FACTORS[wanted]
