"""Logs and models of cables in whatever form Python has them: files, arrays, traces, what was identified before."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core import arguments
from bowden.core.errors import ParameterError
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.identification import identify as identify_signals
from bowden.identify.cable.identification import identify_log
from bowden.identify.cable.joint_fit import JointFit
from bowden.identify.cable.recalibrate import Recalibration
from bowden.identify.log.angles import SIDES, angle_units, angles_of
from bowden.identify.log.read import Log, prepare
from bowden.identify.log.read import read_log as read_file
from bowden.identify.log.variables import Scheduled, of_numbers, scheduled_by
from bowden.plants.identified import CableModel, IdentifiedCable, load_judged
from bowden.records.trace import Trace


def identified(
    log: Any,
    motor: Any,
    joint: Any,
    time: Any,
    unit: str | None,
    counts_per_turn: float | Sequence[float] | None,
    rate: float | None,
    *,
    name: str,
    seed: int,
    progress: Callable[[str, float], None],
) -> Fit:
    """The fit to a log of whatever form.

    Raises:
        LogError: a file that cannot be read, or signals that nothing can be fitted to.
        ParameterError: arguments of the wrong kind.
    """
    if isinstance(log, str | Path):
        read = read_log(log, time=time, motor=motor, joint=joint, unit=unit, counts_per_turn=counts_per_turn, rate=rate)
        return identify_log(read, seed, progress)
    if isinstance(log, Log | Trace):
        beside = {"motor": motor, "joint": joint, "time": time, "unit": unit}
        for what, extra in (beside | {"counts_per_turn": counts_per_turn, "rate": rate}).items():
            if extra is not None:
                kind = type(log).__name__
                raise ParameterError(
                    f"identify: {what} beside a {kind}", expected=f"the {kind} alone, which has it", do="leave it out"
                )
        if isinstance(log, Log):
            return identify_log(log, seed, progress)
        seen = ("motor_measured", "joint_measured") if "motor_measured" in log else ("motor", "joint")
        columns = [log[one] for one in seen]
        first = int(np.isfinite(columns).all(axis=0).argmax())  # a live run begins before its first reading
        time, motor, joint = (one[first:] for one in (log.time, *columns))
        return identify_signals(time, motor, joint, unit="rad", name=name, seed=seed, progress=progress)
    if log is not None and time is not None:
        raise ParameterError(
            "identify: time is given twice", expected="it once", do="call it as identify(time, motor, joint)"
        )
    given = {"time": time if log is None else log, "motor": motor, "joint": joint}
    if rate is not None and given["time"] is None:
        del given["time"]
    for what, value in given.items():
        if value is None:
            raise ParameterError(
                f"identify: {what} is missing",
                expected="a file's path, or three arrays: identify(time, motor, joint)",
                do="give it too" + (", or give rate= in its place" if what == "time" else ""),
            )
    signals = {what: arguments.signal(value, f"identify: {what}") for what, value in given.items()}
    arguments.one_length(signals, "identify")
    return identify_signals(
        signals.get("time"),
        signals["motor"],
        signals["joint"],
        unit=unit,
        counts_per_turn=counts_per_turn,
        rate=rate,
        name=name,
        seed=seed,
        progress=progress,
    )


def read_log(
    path: str | Path,
    *,
    time: Any = None,
    motor: Any = None,
    joint: Any = None,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | None = None,
    rate: float | None = None,
) -> Log:
    """Read the log of a cable and check it: even time, finite angles that move, in radians.

    Args:
        path: ``.csv``, ``.csv.gz``, ``.mat``, ``.npz`` or ``.parquet``; text above the column names is skipped.
        time: name of the time column; guessed where it is not given.
        motor: name of the motor's column.
        joint: name of the joint's column.
        unit: of the angles, ``deg``, ``rad`` or ``counts``, or one each (``"counts,deg"``); as the columns' names say
            where it is not given.
        counts_per_turn: of the encoders, where they count: one number, or one for the motor and one for the joint.
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
    for what, column in (("time", time), ("motor", motor), ("joint", joint)):
        if column is not None and not isinstance(column, str):
            raise ParameterError(
                f"{what} of the log {path} is {arguments.said(column)}",
                expected="the name of a column in the file",
                do="or give only arrays: identify(time, motor, joint)",
            )
    return read_file(file, time=time, motor=motor, joint=joint, unit=unit, counts_per_turn=counts_per_turn, rate=rate)


def known_cable(model: Any) -> tuple[IdentifiedCable, float]:
    """A cable, and the error of its recommended model on data that it had not seen [rad].

    Raises:
        ParameterError: no model.
    """
    if isinstance(model, str | Path):
        return load_judged(arguments.path_of(model, "recalibrate: model"))
    if isinstance(model, CableModel | IdentifiedCable):
        return model.identified() if isinstance(model, CableModel) else model, math.nan
    if isinstance(model, Fit):
        return model.best.identified(), model.chosen.test_rms
    if isinstance(model, JointFit | Recalibration):
        judged = model.judged if isinstance(model, JointFit) else model.judged_rms
        of = dict(zip(model.variables, model.units, strict=True)) if isinstance(model, JointFit) else model.units
        return dataclasses.replace(model.best.identified(), units=of), judged
    raise ParameterError(
        f"recalibrate: model is {arguments.said(model)}",
        expected="a model.toml, or what bowden.identify gives",
        do="identify a log first",
    )


def log_of(given: Any, what: str, columns: Mapping[str, Any]) -> Log:
    """A log: read, checked, or of a trace.

    Args:
        given: a path, a `Log` or a trace.
        what: function and argument, for messages.
        columns: of a file, as `read_log` takes them.

    Raises:
        LogError: a file that cannot be read.
        ParameterError: none of these.
    """
    if isinstance(given, str | Path):
        return read_log(given, **columns)
    if isinstance(given, Log):
        return given
    if isinstance(given, Trace):
        seen = ("motor_measured", "joint_measured") if "motor_measured" in given else ("motor", "joint")
        motor, joint = (given[one] for one in seen)
        name = what.partition(": ")[2]
        units, values = angle_units("rad"), {"motor": motor, "joint": joint}
        angles, _ = angles_of({side: (side, "rad") for side in SIDES}, values, units)
        return prepare(given.time, angles, name, lambda sample: f"{name}, sample {sample + 1}")
    raise ParameterError(
        f"{what} is {arguments.said(given)}",
        expected="a path, a Log of bowden.read_log, or a Trace",
        do="give arrays as bowden.identify(time, motor, joint)",
    )


def variable_of(name: str, given: Any, logs: Sequence[Any], read: Sequence[Log]) -> Scheduled | None:
    """What schedules: numbers, a column's name, or what the files say."""
    called = [one.name for one in read]
    if given is not None and not isinstance(given, str):
        if not isinstance(given, Sequence) and not hasattr(given, "__len__"):
            raise ParameterError(
                f"{name} is {arguments.said(given)}",
                expected="one number for each log, or a column's name",
                do=f"give {name}=[…], in the logs' order",
            )
        return of_numbers(name, [arguments.number(one, f"{name}[{i}]") for i, one in enumerate(given)], called)
    files = [Path(one) for one in logs if isinstance(one, str | Path)]
    if len(files) == len(logs):
        return scheduled_by(name, files, given, names=called)
    if given is not None and given != "none":
        raise ParameterError(
            f"{name} is {given!r}, and not all logs are files",
            expected="one number for each log",
            do=f"give {name}=[…], in the logs' order",
        )
    return None
