"""What schedules a model, of each of several logs: a load, a bend; from a column of the logs, or as given."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bowden.core.errors import LogError, ParameterError, counted
from bowden.core.units import RADIANS
from bowden.identify.log.columns import split_name
from bowden.identify.log.read import read_columns

BEND = "bend"
"""The variable that is an angle."""
NONE = "none"
"""In place of a column's name: no such variable, whatever columns the logs have."""

_UNITS = {"nm": "N·m", "mnm": "mN·m", "n": "N", "mn": "mN"}
"""How a load's column may end → its unit."""

_LOADS = ("joint_torque", "load_torque", "torque", "tension", "cable_tension", "pretension", "force", "cable_force")
_BENDS = ("bend", "bend_angle", "sheath_bend", "bending", "bending_angle")
COMMON: Mapping[str, Sequence[str]] = {
    "load": [name + end for name in _LOADS for end in ("", *(f"_{unit}" for unit in _UNITS))],
    "bend": _BENDS,
}
"""Variable → common names of its column, the likeliest first."""


class Scheduled(NamedTuple):
    """A variable of several logs."""

    name: str
    """``load`` or ``bend``."""
    values: tuple[float, ...]
    """One for each log: a load as its unit says, a bend in radians."""
    unit: str
    """Empty where nothing says it."""
    said: str
    """Where the values are from, for the user; empty where they were given."""


def scheduled_by(
    name: str, files: Sequence[Path], given: str | None, *, names: Sequence[str] | None = None
) -> Scheduled | None:
    """The values of a variable; None where the logs have none.

    Args:
        name: ``load`` or ``bend``.
        files: the logs.
        given: ``0.1,0.2`` (one for each log, in their order; of a bend in degrees), a column's name, ``none``, or None
            to look for a column of a common name.
        names: of the logs, for messages; the files' own where they are left out.

    Raises:
        LogError: a column that is not there, or in some of the logs only, or without numbers.
        ParameterError: another number of values than of logs.
    """
    called = list(names or [file.name for file in files])
    if given is not None:
        if given.strip().lower() == NONE:
            return None
        values = numbers(given)
        if values is not None:
            return of_numbers(name, [RADIANS * one for one in values] if name == "bend" else values, called)
    found = [_mean(file, name, given) for file in files]
    there = [one for one in found if one is not None]
    if not there:
        return None
    if len(there) < len(found):
        without = [log for log, one in zip(called, found, strict=True) if one is None]
        raise LogError(
            f"{', '.join(without[:3])}{', …' if len(without) > 3 else ''} has no column for the {name}, others have "
            f"{there[0][2]!r}",
            expected="it in all logs, or in none",
            do=f"give {name} one value for each log (0.1,0.2,…), its column, or none",
        )
    units = {one[1] for one in there}
    if len(units) > 1:
        raise LogError(
            f"the {name} is in {' and '.join(sorted(unit or 'no unit' for unit in units))}",
            expected="one unit in all logs",
            do=f"convert them, or give {name} one value for each log",
        )
    (unit,) = units
    return Scheduled(
        name, tuple(one[0] for one in there), unit, f"the {name} of each log is the mean of its column {there[0][2]!r}"
    )


def of_numbers(name: str, values: Sequence[float], logs: Sequence[str]) -> Scheduled:
    """A variable as it was given for each log; a bend in radians.

    Raises:
        ParameterError: another number of them, or one that is not finite.
    """
    if len(values) != len(logs):
        raise ParameterError(
            f"{counted(len(values), 'value')} of the {name} for {len(logs)} logs",
            expected="one for each log, in their order",
            do="give them in that order, with commas between on a command line",
        )
    for value, log in zip(values, logs, strict=True):
        if not math.isfinite(value):
            raise ParameterError(f"the {name} of {log} is {value}", expected="a finite number", do="correct it")
    return Scheduled(name, tuple(float(value) for value in values), "rad" if name == "bend" else "", "")


def numbers(text: str) -> list[float] | None:
    """Numbers between commas; None where it is something else, a column's name.

    >>> numbers("0.1, 2"), numbers("torque")
    ([0.1, 2.0], None)

    Raises:
        ParameterError: numbers, and something else between them.
    """
    found: list[float] = []
    others: list[str] = []
    for part in text.split(","):
        try:
            found.append(float(part))
        except ValueError:
            others.append(part)
    if found and others:
        raise ParameterError(
            f"{others[0]!r} among the values {text!r}",
            expected="numbers with commas between, or the name of a column",
            do="correct it",
        )
    return None if others else found


def _mean(file: Path, name: str, column: str | None) -> tuple[float, str, str] | None:
    """Mean, unit and name of a log's column; None where it was looked for and is not there."""
    raw = read_columns(file, {name: column}, {name: COMMON[name]}, optional=() if column else (name,))
    if name not in raw.columns:
        return None
    values, found = raw.values[name], raw.columns[name]
    known = values[np.isfinite(values)]
    if len(known) < 0.5 * len(values) or not len(known):
        raise LogError(
            f"{file.name}: the {name} column {found.name!r} has {len(values) - len(known)} rows of {len(values)} "
            "without a number",
            expected=f"the {name} in most rows",
            do=f"give {name} one value for each log (0.1,0.2,…), or none",
        )
    mean = float(known.mean())
    if name == "bend":
        return mean * (1.0 if found.unit == "rad" else RADIANS), "rad", found.name
    return mean, _UNITS.get(split_name(found.name)[0].rpartition("_")[2], ""), found.name
