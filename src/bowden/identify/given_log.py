"""Logs and models of cables in whatever form Python has them: files, arrays, traces, what was identified before."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core import arguments
from bowden.core.caller import argument
from bowden.core.errors import ParameterError
from bowden.identify.cable.fit import Fit
from bowden.identify.log.angles import SIDES, angles_of
from bowden.identify.log.columns import LogColumn
from bowden.identify.log.read import Layout, Log, checked_rate, prepare, read_file, read_run
from bowden.plants.identified import CableModel, IdentifiedCable, load_cable
from bowden.records.trace import Trace

_KINDS = str | Path | Log | Trace


def logs_of(given: Any, layout: Layout, name: str = "log") -> list[Log]:
    """One log or several: paths, `Log`s and traces; or time, motor and joint as arrays, which are one.

    Args:
        given: any of them; of arrays, the times.
        layout: the columns of the files, or motor and joint (n,) and perhaps the times.
        name: of logs without a file.

    Raises:
        LogError: a file that cannot be read, or signals that nothing can be fitted to.
        ParameterError: arguments of the wrong kind.
    """
    if isinstance(given, _KINDS):
        return [_log_of(given, "identify", layout, name)]
    if isinstance(given, list | tuple):
        if len(given) == 2 and all(isinstance(one, str | Path) for one in given):
            run = read_run([arguments.path_of(one, "identify: log") for one in given], layout)
            if run is not None:
                return [run]
        if any(isinstance(one, _KINDS) for one in given):
            return [_log_of(one, f"identify: log {i}", layout, f"log {i}") for i, one in enumerate(given, 1)]
    return [_of_arrays(given, layout, name)]


def _log_of(given: Any, what: str, layout: Layout, name: str) -> Log:
    if isinstance(given, str | Path):
        return read_file(arguments.path_of(given, "read_log: path"), layout)
    if not isinstance(given, Log | Trace):
        raise ParameterError(
            f"{what} is {arguments.format_value(given)}",
            expected="a path, a Log of bowden.read_log, or a Trace",
            do="give arrays as bowden.identify(time, motor, joint)",
        )
    kind = type(given).__name__
    for column, extra in layout._asdict().items():
        if extra is not None:
            raise ParameterError(
                f"identify: {column} beside a {kind}", expected=f"the {kind} alone, which has it", do="leave it out"
            )
    if isinstance(given, Log):
        return given
    measured = "_measured" if "motor_measured" in given else ""
    motor, joint = given[f"motor{measured}"], given[f"joint{measured}"]
    first = int(np.isfinite([motor, joint]).all(axis=0).argmax())  # a live run begins before its first reading
    return _prepared(given.time[first:], motor[first:], joint[first:], name, Layout(unit="rad"))


def _of_arrays(given: Any, layout: Layout, name: str) -> Log:
    if given is not None and layout.time is not None:
        raise ParameterError(
            "identify: time is given twice", expected="it once", do="call it as identify(time, motor, joint)"
        )
    signals = {"time": layout.time if given is None else given, "motor": layout.motor, "joint": layout.joint}
    if layout.rate is not None and signals["time"] is None:
        del signals["time"]
    odd = given is not None and layout.motor is None and layout.joint is None
    nothing = all(one is None for one in signals.values())
    for what, value in signals.items():
        if value is None or odd:
            missing = f"log is {arguments.format_value(given)}" if odd else f"{'log' if nothing else what} is missing"
            raise ParameterError(
                f"identify: {missing}",
                expected="files, or three arrays: identify(time, motor, joint)",
                do="give one of these" if odd or nothing else "give it too, or rate= in place of time",
            )
    arrays = {what: arguments.signal(value, f"identify: {what}") for what, value in signals.items()}
    arguments.one_length(arrays, "identify")
    checked_rate(layout.rate, arrays.get("time"))
    seconds = arrays.get("time", np.arange(len(arrays["motor"])) / (layout.rate or 1.0))
    return _prepared(seconds, arrays["motor"], arrays["joint"], name, layout)


def _prepared(
    time: NDArray[np.float64], motor: NDArray[np.float64], joint: NDArray[np.float64], name: str, layout: Layout
) -> Log:
    units = layout.units
    columns = {side: LogColumn(0, side, None) for side in SIDES}
    angles, _ = angles_of(columns, {"motor": motor, "joint": joint}, units)
    angles = {side: dataclasses.replace(one, guessed=False) for side, one in angles.items()}  # arrays are in radians
    return prepare(time, angles, name, lambda sample: f"{name}, sample {sample + 1}", units.apart)


def known_cable(model: Any, logs: int) -> IdentifiedCable | None:
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
        return load_cable(arguments.path_of(model, "identify: model"))
    if isinstance(model, CableModel | IdentifiedCable):
        return model.identified() if isinstance(model, CableModel) else model
    if isinstance(model, Fit):
        return dataclasses.replace(model.best.identified(), units=model.units, judged=model.judged_rms)
    raise ParameterError(
        f"identify: model is {arguments.format_value(model)}",
        expected="a model.toml, or what bowden.identify gives",
        do="identify a log first",
    )
