"""Reading a servo's log: time, command and motor."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.identify.log.columns import FACTORS, TIMES, LogColumn
from bowden.identify.log.read import read_columns

Array = NDArray[np.float64]

_SERVO: Mapping[str, Sequence[str]] = {
    "time": TIMES,
    "command": (
        *("command", "cmd", "target", "setpoint", "reference", "desired", "demand", "motor_command", "input", "u"),
    ),
    "motor": ("motor_measured", "motor", "motor_angle", "motor_position", "actual", "measured", "position", "output"),
}
"""Role → common names, the likeliest first."""


def read_servo_log(path: Path, given: Mapping[str, str | None], unit: str | None = None) -> tuple[Array, Array, Array]:
    """Time [s], command and motor [rad], each (n,).

    Args:
        path: a log as `bowden.identify.log.read.read_log` takes it.
        given: role (time, command, motor) → column, or None to guess.
        unit: of both angles, ``deg`` or ``rad``; from the columns' names where it is not given.

    Raises:
        LogError: the file cannot be read, has no such column, or a field is not a number.
        ParameterError: an unknown unit.
    """
    if unit not in (None, "deg", "rad"):
        raise ParameterError(f"--unit is {unit!r}", expected="deg or rad")
    raw = read_columns(path, given, _SERVO)
    factors = {role: _factor(role, column, unit, path) for role, column in raw.columns.items()}
    time, command, motor = (factors[role] * raw.values[role] for role in _SERVO)
    return time - time[0] if len(time) else time, command, motor


def _factor(role: str, column: LogColumn, unit: str | None, path: Path) -> float:
    if role == "time":
        return FACTORS[column.unit or "s"]
    wanted = unit or column.unit
    if wanted is None:
        raise LogError(f"{path}: column {column.name!r} does not say its unit", do="give --unit deg or --unit rad")
    return FACTORS[wanted]
