"""Reading a servo's log: time, command and motor from a CSV or Parquet file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.identify.log.columns import FACTORS, split_name
from bowden.identify.log.table import read_table

Array = NDArray[np.float64]

_NAMES: Mapping[str, tuple[str, ...]] = {
    "time": ("time", "t", "timestamp", "seconds", "sec", "clock"),
    "command": (
        "command",
        "cmd",
        "target",
        "setpoint",
        "reference",
        "desired",
        "demand",
        "motor_command",
        "input",
        "u",
    ),
    "motor": ("motor_measured", "motor", "motor_angle", "motor_position", "actual", "measured", "position", "output"),
}
"""Common names, the likeliest first."""


def read_servo_log(path: Path, given: Mapping[str, str | None], unit: str | None = None) -> tuple[Array, Array, Array]:
    """Time [s], command and motor [rad], each (n,).

    Args:
        path: ``.csv``, ``.csv.gz`` or ``.parquet``, with column names in the first row.
        given: role (time, command, motor) → column, or None to guess.
        unit: of both angles, ``deg`` or ``rad``; from the columns' names where it is not given.

    Raises:
        LogError: the file cannot be read, has no such column, or a column is not of numbers.
        ParameterError: an unknown unit.
    """
    if unit not in (None, "deg", "rad"):
        raise ParameterError(f"--unit is {unit!r}", expected="deg or rad")
    table = _read(path)
    chosen = {role: _choose(role, given.get(role), list(table), path) for role in _NAMES}
    if len(set(chosen.values())) < len(chosen):
        said = ", ".join(f"{role} = {name!r}" for role, name in chosen.items())
        raise LogError(f"{path}: one column is taken twice ({said})", expected="three different columns")
    factors = {role: _factor(role, name, unit, path) for role, name in chosen.items()}
    time, command, motor = (factors[role] * table[chosen[role]] for role in _NAMES)
    return time - time[0] if len(time) else time, command, motor


def _read(path: Path) -> dict[str, Array]:
    import pyarrow as pa

    table = read_table(path)
    return {
        name: np.asarray(column.to_numpy(), dtype=np.float64)
        for name, column in zip(table.column_names, table.columns, strict=True)
        if pa.types.is_floating(column.type) or pa.types.is_integer(column.type)
    }


def _choose(role: str, given: str | None, names: list[str], path: Path) -> str:
    plain = [split_name(name)[0] for name in names]
    if given is not None:
        if given in names:
            return given
    else:
        for known in _NAMES[role]:
            if known in plain:
                return names[plain.index(known)]
    wanted = f"column {given!r}" if given is not None else f"{role} column"
    listed = ", ".join(names[:12]) or "none"
    raise LogError(f"{path}: no {wanted} of numbers among {listed}", do=f"name it with --{role}")


def _factor(role: str, name: str, unit: str | None, path: Path) -> float:
    own = split_name(name)[1]
    if role == "time":
        return FACTORS[own or "s"]
    wanted = unit or own
    if wanted is None:
        raise LogError(f"{path}: column {name!r} does not say its unit", do="give --unit deg or --unit rad")
    return FACTORS[wanted]
