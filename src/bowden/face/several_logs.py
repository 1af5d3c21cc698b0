"""`identify_together` and `recalibrate`: several logs of one cable, and a new log of a known one."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bowden.core import arguments
from bowden.core.errors import ParameterError
from bowden.face.identify import read_log
from bowden.face.progress import GivenProgress, reported
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.loads import JointFit, identify_loads
from bowden.identify.cable.model import CableModel, IdentifiedCable
from bowden.identify.cable.model_file import load_judged
from bowden.identify.cable.recalibrate import Recalibration
from bowden.identify.cable.recalibrate import recalibrate as recalibrate_log
from bowden.identify.log.angles import SIDES, angle_units, angles_of
from bowden.identify.log.read import Log, prepare
from bowden.identify.log.variables import Scheduled, of_numbers, scheduled_by
from bowden.records.trace import Trace

AnyLog = str | Path | Log | Trace
AnyModel = str | Path | Fit | JointFit | Recalibration | CableModel | IdentifiedCable


def identify_together(
    logs: Sequence[AnyLog],
    *,
    load: "str | Sequence[float] | None" = None,
    bend: "str | Sequence[float] | None" = None,
    seed: int = 0,
    progress: GivenProgress = None,
    **columns: Any,
) -> JointFit:
    """Fit one model to several logs of a cable; the model depends on the load, the bend, or both.

    Args:
        logs: two or more paths, `Log`s of `read_log` or traces.
        load: one value for each log, in any unit; or the name of a column, of which the mean is used. If left out, a
            column with a common name is looked for in files. ``"none"`` for no load.
        bend: the same [rad].
        seed: of the search for the plain Bouc–Wen cable.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.
        **columns: ``time``, ``motor``, ``joint``, ``unit``, ``counts_per_turn`` and ``rate`` of files; see `read_log`.

    Returns:
        The fit: ``best``, the model, for ``Rig(cable=…)``; ``at(load=…)``, the model at a load; and how well the other
        logs predict each log.

    Raises:
        LogError: files that cannot be read, or logs that do not go together.
        ParameterError: arguments of the wrong kind.

    >>> import bowden
    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> units = {"time": "s", "motor": "rad", "joint": "rad"}
    >>> joints = [0.9 * motor - 0.5 * load for load in (0.0, 0.1, 0.3)]
    >>> logs = [bowden.Trace({"time": time, "motor": motor, "joint": joint}, units) for joint in joints]
    >>> fit = bowden.identify_together(logs, load=[0.0, 0.1, 0.3])
    >>> round(float(fit.at(load=0.2).joint_angle(np.zeros(1))[0]), 3)
    -0.1
    """
    seed = arguments.whole(seed, "identify_together: seed", 0)
    if isinstance(logs, str | Path | Log | Trace) or not isinstance(logs, Sequence):
        raise ParameterError(
            f"identify_together: logs is {arguments.said(logs)}",
            expected="a list of two logs or more",
            do="for a single log use bowden.identify",
        )
    read = [_log(one, f"identify_together: logs[{i}]", columns) for i, one in enumerate(logs)]
    by = [_variable(name, given, logs, read) for name, given in (("load", load), ("bend", bend))]
    values = (one.values if one else None for one in by)
    units = [one.unit if one else "" for one in by]
    with reported(progress, "identify_together") as report:
        fit = identify_loads(read, *values, units=units, seed=seed, progress=report)
    return dataclasses.replace(fit, warnings=(*fit.warnings, *(one.said for one in by if one and one.said)))


def recalibrate(
    log: AnyLog,
    model: AnyModel,
    *,
    load: "str | float | None" = None,
    bend: "str | float | None" = None,
    **columns: Any,
) -> Recalibration:
    """Fit gain and offset of a known model to a few seconds of new motion, and say whether the cable has changed.

    Args:
        log: a path, a `Log` of `read_log` or a trace, with at least one reversal.
        model: a model.toml, or what `identify`, `identify_together` or `recalibrate` returned.
        load: of the log, if the model depends on it; a number, or the name of a column.
        bend: the same [rad].
        **columns: ``time``, ``motor``, ``joint``, ``unit``, ``counts_per_turn`` and ``rate`` of a file.

    Returns:
        Gain, offset, the errors before and after, ``changed``, and ``best``, the new model, for ``Rig(cable=…)``.

    Raises:
        LogError: a file that cannot be read, no reversal, or a joint that moves the other way.
        ParameterError: arguments of the wrong kind.

    >>> import bowden
    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> fit = bowden.identify(time, motor, 0.9 * motor)
    >>> signals = {"time": time[:500], "motor": motor[:500], "joint": 0.88 * motor[:500] + 0.1}
    >>> new = bowden.Trace(signals, {"time": "s", "motor": "rad", "joint": "rad"})
    >>> found = bowden.recalibrate(new, fit)
    >>> round(found.best.parameters["slope"], 4), round(found.best.parameters["offset"], 4)
    (0.88, 0.1)
    """
    cable, judged = _known(model)
    read = _log(log, "recalibrate: log", columns)
    values: dict[str, float] = {}
    units: dict[str, str] = {}
    for name, given in (("load", load), ("bend", bend)):
        if isinstance(given, str) or (given is None and f"{name}_low" in cable.model().parameters):
            found = _variable(name, given, [log], [read])
            values |= {name: found.values[0]} if found else {}
            units |= {name: found.unit} if found else {}
        elif given is not None:
            values[name] = arguments.number(given, f"recalibrate: {name}")
    return recalibrate_log(read, cable, judged, values, units)


def _known(model: Any) -> tuple[IdentifiedCable, float]:
    """A cable, and the error of its recommended model on data that it had not seen [rad]."""
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


def _log(given: Any, what: str, columns: Mapping[str, Any]) -> Log:
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


def _variable(name: str, given: Any, logs: Sequence[Any], read: Sequence[Log]) -> Scheduled | None:
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
