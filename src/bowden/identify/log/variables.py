"""What schedules a model, of each of several logs: a load, a bend; from a column of the logs, or as given."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bowden.core import arguments
from bowden.core.caller import argument
from bowden.core.errors import LogError, ParameterError, counted
from bowden.core.units import RADIANS
from bowden.identify.log.columns import split_name
from bowden.identify.log.read import Log, read_columns
from bowden.plants.identified import IdentifiedCable

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


def variables_of(
    given: Mapping[str, Any], files: Any, logs: Sequence[Log], known: IdentifiedCable | None
) -> list[Scheduled]:
    """What may schedule the model: numbers, a column's name, or what the files say.

    Args:
        given: ``load`` and ``bend``, each as the user gave it.
        files: the logs as the user gave them.
        logs: the same, read.
        known: a known model, which says what schedules it.

    Raises:
        LogError: a column that is not there, or without numbers.
        ParameterError: values that do not go with the logs.
    """
    found = []
    for name, value in given.items():
        wanted = len(logs) > 1 if known is None else f"{name}_low" in known.model().parameters
        one = _variable(name, value, files, [log.name for log in logs]) if wanted or value is not None else None
        if one is not None and len(logs) == 1 and known is None:
            raise ParameterError(
                f"{argument(name)} with one log, which cannot tell what the {name} changes",
                expected=f"several logs, or {argument('model')} with a model that is scheduled by it",
                do=f"give the other logs too, or leave out {argument(name)}",
            )
        found += [one] if one else []
    return found


def _variable(name: str, given: Any, files: Any, logs: Sequence[str]) -> Scheduled | None:
    """One of them: numbers, one for each log (of a bend as text in degrees), a column's name, ``none``, or None to look
    for a column of a common name; None where the logs have none."""
    if given is not None and not isinstance(given, str):
        values = given if hasattr(given, "__len__") else [given]
        return _of_numbers(name, [arguments.number(one, f"{name}[{i}]") for i, one in enumerate(values)], logs)
    each = files if isinstance(files, list | tuple) else [files]
    paths = [Path(one) for one in each if isinstance(one, str | Path)]
    if given is not None and given.strip().lower() == "none":
        return None
    if len(paths) != len(logs):
        if given is None:
            return None
        raise ParameterError(
            f"{name} is {given!r}, and not all logs are files",
            expected="one number for each log",
            do=f"give {name}=[…], in the logs' order",
        )
    if given is not None and (said := numbers(given)) is not None:
        return _of_numbers(name, [RADIANS * one for one in said] if name == "bend" else said, logs)
    found = [_mean(file, name, given) for file in paths]
    there = [one for one in found if one is not None]
    if not there:
        return None
    if len(there) < len(found):
        without = [log for log, one in zip(logs, found, strict=True) if one is None]
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


def _of_numbers(name: str, values: Sequence[float], logs: Sequence[str]) -> Scheduled:
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
