"""Logs and models of cables in whatever form Python has them: files, arrays, traces, what was identified before."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core import arguments
from bowden.core.caller import argument
from bowden.core.errors import ParameterError
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.recalibrate import Known
from bowden.identify.log.angles import SIDES, angle_units, angles_of
from bowden.identify.log.read import Log, checked_rate, prepare, read_run
from bowden.identify.log.read import read_log as read_file
from bowden.identify.log.variables import Scheduled, of_numbers, scheduled_by
from bowden.plants.identified import CableModel, IdentifiedCable, load_judged
from bowden.records.trace import Trace

_KINDS = str | Path | Log | Trace


def logs_of(
    given: Any,
    motor: Any = None,
    joint: Any = None,
    *,
    time: Any = None,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | str | None = None,
    spool_radius_mm: float | None = None,
    rate: float | None = None,
    name: str = "log",
) -> list[Log]:
    """One log or several: paths, `Log`s and traces; or time, motor and joint as arrays, which are one.

    Raises:
        LogError: a file that cannot be read, or signals that nothing can be fitted to.
        ParameterError: arguments of the wrong kind.
    """
    columns = {"time": time, "motor": motor, "joint": joint, "unit": unit}
    columns |= {"counts_per_turn": counts_per_turn, "spool_radius_mm": spool_radius_mm, "rate": rate}
    if isinstance(given, _KINDS):
        return [_log_of(given, "identify", columns, name)]
    if isinstance(given, list | tuple) and len(given) == 2 and all(isinstance(one, str | Path) for one in given):
        named = {what: None if columns[what] is None else str(columns[what]) for what in ("time", *SIDES)}
        checked_rate(rate, time)
        run = read_run(
            [arguments.path_of(one, "identify: log") for one in given],
            named,
            angle_units(unit, counts_per_turn, spool_radius_mm),
            rate,
        )
        if run is not None:
            return [run]
    if isinstance(given, list | tuple) and any(isinstance(one, _KINDS) for one in given):
        return [_log_of(one, f"identify: log {i}", columns, f"log {i}") for i, one in enumerate(given, 1)]
    if given is not None and time is not None:
        raise ParameterError(
            "identify: time is given twice", expected="it once", do="call it as identify(time, motor, joint)"
        )
    if motor is None and joint is None and (given is not None or time is None):
        raise ParameterError(
            f"identify: log is {'missing' if given is None else arguments.said(given)}",
            expected="files, or three arrays: identify(time, motor, joint)",
            do="give one of these",
        )
    signals = {"time": time if given is None else given, "motor": motor, "joint": joint}
    if rate is not None and signals["time"] is None:
        del signals["time"]
    for what, value in signals.items():
        if value is None:
            raise ParameterError(
                f"identify: {what} is missing",
                expected="files, or three arrays: identify(time, motor, joint)",
                do="give it too" + (", or give rate= in its place" if what == "time" else ""),
            )
    arrays = {what: arguments.signal(value, f"identify: {what}") for what, value in signals.items()}
    arguments.one_length(arrays, "identify")
    checked_rate(rate, arrays.get("time"))
    seconds = arrays.get("time", np.arange(len(arrays["motor"])) / (rate or 1.0))
    return [_of_arrays(seconds, arrays["motor"], arrays["joint"], name, unit, counts_per_turn, spool_radius_mm)]


def _log_of(given: Any, what: str, columns: Mapping[str, Any], name: str) -> Log:
    if isinstance(given, str | Path):
        return read_log(given, **columns)
    if not isinstance(given, Log | Trace):
        raise ParameterError(
            f"{what} is {arguments.said(given)}",
            expected="a path, a Log of bowden.read_log, or a Trace",
            do="give arrays as bowden.identify(time, motor, joint)",
        )
    kind = type(given).__name__
    for column, extra in columns.items():
        if extra is not None:
            raise ParameterError(
                f"identify: {column} beside a {kind}", expected=f"the {kind} alone, which has it", do="leave it out"
            )
    if isinstance(given, Log):
        return given
    seen = ("motor_measured", "joint_measured") if "motor_measured" in given else ("motor", "joint")
    signals = [given[one] for one in seen]
    first = int(np.isfinite(signals).all(axis=0).argmax())  # a live run begins before its first reading
    motor, joint = signals
    return _of_arrays(given.time[first:], motor[first:], joint[first:], name, "rad", None)


def _of_arrays(
    time: NDArray[np.float64],
    motor: NDArray[np.float64],
    joint: NDArray[np.float64],
    name: str,
    unit: str | None,
    counts_per_turn: float | Sequence[float] | str | None,
    spool_radius_mm: float | None = None,
) -> Log:
    units = angle_units(unit, counts_per_turn, spool_radius_mm)
    angles, _ = angles_of({side: (side, None) for side in SIDES}, {"motor": motor, "joint": joint}, units)
    angles = {side: dataclasses.replace(one, guessed=False) for side, one in angles.items()}  # arrays are in radians
    return prepare(time, angles, name, lambda sample: f"{name}, sample {sample + 1}", units.apart)


def read_log(
    path: str | Path,
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
        path: ``.csv``, ``.csv.gz``, ``.mat``, ``.npz``, ``.npy`` or ``.parquet``; text above the names is skipped.
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
    file = arguments.path_of(path, "read_log: path")
    named = {"time": time, "motor": motor, "joint": joint}
    named = {what: str(one) if type(one) is int else one for what, one in named.items()}
    for what, column in named.items():
        if column is not None and not isinstance(column, str):
            raise ParameterError(
                f"{what} of the log {path} is {arguments.said(column)}",
                expected="the name or number of a column in the file",
                do="or give only arrays: identify(time, motor, joint)",
            )
    given = {"unit": unit, "counts_per_turn": counts_per_turn, "spool_radius_mm": spool_radius_mm, "rate": rate}
    return read_file(file, **named, **given)  # type: ignore[arg-type]


def known_cable(model: Any, logs: int) -> Known | None:
    """A model whose gain and offset are fitted again; None where none is given.

    Args:
        model: as the user gave it.
        logs: how many there are.

    Raises:
        ParameterError: no model, or several logs.
    """
    if model is None:
        return None
    if logs > 1:
        raise ParameterError(
            f"{argument('model')} with {logs} logs",
            expected="one log, to which gain and offset of the model are fitted",
            do="give one log",
        )
    if isinstance(model, str | Path):
        return Known(*load_judged(arguments.path_of(model, "identify: model")))
    if isinstance(model, CableModel | IdentifiedCable):
        return Known(model.identified() if isinstance(model, CableModel) else model)
    if isinstance(model, Fit):
        return Known(dataclasses.replace(model.best.identified(), units=model.units), model.judged_rms)
    raise ParameterError(
        f"identify: model is {arguments.said(model)}",
        expected="a model.toml, or what bowden.identify gives",
        do="identify a log first",
    )


def variables_of(given: Mapping[str, Any], files: Any, logs: Sequence[Log], known: Known | None) -> list[Scheduled]:
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
        if known is not None:
            wanted = value is not None or f"{name}_low" in known.cable.model().parameters
        else:
            wanted = len(logs) > 1 or value is not None
        one = _variable(name, value, files, logs) if wanted else None
        if one is not None:
            found.append(one)
        if one is not None and len(logs) == 1 and known is None:
            raise ParameterError(
                f"{argument(name)} with one log, which cannot tell what the {name} changes",
                expected=f"several logs, or {argument('model')} with a model that is scheduled by it",
                do=f"give the other logs too, or leave out {argument(name)}",
            )
    return found


def _variable(name: str, given: Any, files: Any, logs: Sequence[Log]) -> Scheduled | None:
    called = [one.name for one in logs]
    if given is not None and not isinstance(given, str):
        several = isinstance(given, Sequence) or hasattr(given, "__len__")
        if not several and len(logs) > 1:
            raise ParameterError(
                f"{name} is {arguments.said(given)}",
                expected="one number for each log, or a column's name",
                do=f"give {name}=[…], in the logs' order",
            )
        values = given if several else [given]
        return of_numbers(name, [arguments.number(one, f"{name}[{i}]") for i, one in enumerate(values)], called)
    each = files if isinstance(files, list | tuple) else [files]
    paths = [Path(one) for one in each if isinstance(one, str | Path)]
    if len(paths) == len(logs):
        return scheduled_by(name, paths, given, names=called)
    if given is not None and given != "none":
        raise ParameterError(
            f"{name} is {given!r}, and not all logs are files",
            expected="one number for each log",
            do=f"give {name}=[…], in the logs' order",
        )
    return None
