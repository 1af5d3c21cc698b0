"""`identify` and `read_log`: from a log of a cable to its model."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bowden.core import arguments
from bowden.core.errors import ParameterError
from bowden.face.progress import GivenProgress, Progress, reported
from bowden.identify.cable.fit import Fit, identify_log
from bowden.identify.cable.fit import identify as identify_signals
from bowden.identify.log.read import Log
from bowden.identify.log.read import read_log as read_file
from bowden.records.trace import Trace


def identify(
    log: "str | Path | Log | Trace | ArrayLike | None" = None,
    motor: "str | ArrayLike | None" = None,
    joint: "str | ArrayLike | None" = None,
    *,
    time: "str | ArrayLike | None" = None,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | None = None,
    rate: float | None = None,
    name: str = "log",
    seed: int = 0,
    progress: GivenProgress = None,
) -> Fit:
    """Fit six families of cable models to the first half of a log, and judge them on the second half.

    Args:
        log: the path of a CSV (.gz), MATLAB, NPZ or Parquet file; a `Log` of `read_log`; a `Trace`; or time (n,) [s].
        motor: motor-side angle (n,); of a file, the name of its column.
        joint: joint-side angle (n,); of a file, the name of its column.
        time: the same for time, where it does not come first.
        unit: of the angles, ``rad``, ``deg`` or ``counts``, or one each (``"counts,deg"``); radians where it is not
            given, or as a file's columns say.
        counts_per_turn: of the encoders, where they count: one number, or one for the motor and one for the joint.
        rate: samples a second, of a log without times [Hz].
        name: of the log, for messages.
        seed: of the global search; the same seed gives the same result.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Returns:
        The fit: ``best``, the recommended model, for ``Rig(cable=…)``; ``models``, all models with their errors and
        uncertainties; ``forecast``; ``warnings``, what the log cannot show.

    Raises:
        LogError: a file that cannot be read, or signals that nothing can be fitted to.
        ParameterError: arguments of the wrong kind.

    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> fit = identify(time, motor, 0.9 * motor + 0.1)
    >>> fit.best.name, round(fit.best.parameters["slope"], 6)
    ('line', 0.9)
    """
    seed = arguments.whole(seed, "identify: seed", 0)
    arguments.text(name, "identify: name", "a name for the log")
    with reported(progress, "identify") as report:
        return _identified(log, motor, joint, time, unit, counts_per_turn, rate, name=name, seed=seed, progress=report)


def _identified(
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
    progress: Progress,
) -> Fit:
    """`identify`, whatever form the log has."""
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

    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "log.csv"
    >>> rows = "".join(f"{0.01 * i:.2f},{i % 50},{(i + 3) % 50}\\n" for i in range(400))
    >>> _ = file.write_text("time_s,motor_deg,joint_deg\\n" + rows)
    >>> read_log(file).joint[0].round(3)
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
