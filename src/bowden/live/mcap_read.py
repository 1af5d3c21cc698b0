"""The log of a run in memory: whole, some of its columns, or as traces of a part of its rows."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core import arguments
from bowden.core.bounded import open_file, reason
from bowden.core.errors import LogError, near
from bowden.live.figures import Damage
from bowden.live.mcap_layout import Event
from bowden.live.mcap_log import MAGIC
from bowden.live.mcap_reader import LogReader, missing_of
from bowden.live.motor_columns import view
from bowden.records.trace import Trace

_TRACE = 50_000  # rows


@dataclass(frozen=True)
class Recording:
    """Rows, settings and events of a log."""

    about: dict[str, str]
    """The first metadata record: settings, versions, host and start, as text."""
    closing: dict[str, str] | None
    """The last metadata record; None where the file was not closed properly."""
    columns: tuple[str, ...]
    units: tuple[str, ...]
    numbers: NDArray[np.int64]
    """Of each row since the run's begin, from 0 (n,)."""
    rows: NDArray[np.float64]
    """(n, width)"""
    events: list[Event]
    damage: Damage
    settings: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.rows[:, self.columns.index(name)]

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of the motors of a run with several; empty of one with one motor."""
        return motors_of(self.settings)

    def only(self, name: str) -> "Recording":
        """The record of one motor, as a run with this motor alone has it: columns without its name, its settings.

        Args:
            name: of the motor.

        Raises:
            LogError: there is no such motor.
        """
        names = self.motors
        if name not in names:
            expected = near(name, names) if names else "none: the run had one motor"
            raise LogError(f"the log has no motor {name!r}", expected=expected, do="correct --motor")
        seen = view(self.columns, names, name)
        label, others = f"{name}: ", tuple(f"{other}: " for other in names if other != name)
        return replace(
            self,
            about=_about_of(self.about, names, name),
            columns=seen.columns,
            units=tuple(self.units[i] for i in seen.places),
            rows=self.rows[:, list(seen.places)],
            events=[
                one._replace(text=one.text.removeprefix(label))
                for one in self.events
                if not one.text.startswith(others)
            ],
            settings=settings_of(self.settings, name),
        )

    @property
    def parts(self) -> "dict[str, Recording]":
        """The record of each motor by its name; the whole without a name of a run with one motor."""
        return {name: self.only(name) for name in self.motors} or {"": self}

    @property
    def missing(self) -> int:
        """Rows that the loop wrote and that are not here: before the last one, and after it as far as the log says."""
        return missing_of(int(self.numbers[-1]) if len(self.numbers) else -1, len(self.numbers), self.closing)

    @property
    def whole(self) -> bool:
        """Closed properly, and nothing in it changed since."""
        return self.closing is not None and self.damage == Damage(0, 0, 0)

    def trace(self) -> Trace:
        """All rows as a trace with units, settings and seed; what else the file says of its run is in ``settings.log``.

        Raises:
            LogError: there is no row.
        """
        return _trace(self, self.rows)


def _about_of(about: Mapping[str, str], names: Sequence[str], name: str) -> dict[str, str]:
    """What a log says of itself, with the columns of one motor alone."""
    columns, units = (json.loads(about.get(key, "[]")) for key in ("columns", "units"))
    seen = view(columns, names, name)
    own = {"columns": [*seen.columns], "units": [units[place] for place in seen.places]}
    return {**about, **{key: json.dumps(value, ensure_ascii=False) for key, value in own.items() if key in about}}


def motors_of(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the motors in the settings of a log; empty of a run with one motor."""
    return tuple(str(one["name"]) for one in settings.get("motors") or ())


def settings_of(settings: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The settings of a log as a run with one of its motors alone has them."""
    own = next(one for one in settings["motors"] if one["name"] == name)
    rig = settings.get("rig")
    found = {key: value for key, value in settings.items() if key not in ("motors", "independent", *_OF_ONE)} | own
    if isinstance(rig, Mapping):
        found["rig"] = next((one["rig"] for one in rig.get("motors", ()) if one["name"] == name), None)
    del found["name"]
    return found


_OF_ONE = ("law_file", "push", "emg", "admittance")
"""Settings that not every motor has."""


def read(path: Path, only: Sequence[str] | None = None) -> Recording:
    """Everything that can be read of a log; what is damaged is left out and counted, never guessed.

    Args:
        path: of the log.
        only: the columns to keep of those that it has, of each motor, so that the log of hours fits into memory; all by
            default.

    Raises:
        LogError: no such file, none that bowden wrote, or its beginning is damaged.
    """
    log = LogReader(path, only)
    numbers, rows = np.empty(log.most, np.int64), np.empty((log.most, len(log.columns)))
    n = 0
    events: list[Event] = []
    for piece in log:
        end = n + len(piece.numbers)
        numbers[n:end], rows[n:end] = piece.numbers, piece.rows
        n = end
        events += piece.events
    numbers, rows = numbers[:n], rows[:n]
    return Recording(log.about, log.closing, log.columns, log.units, numbers, rows, events, log.damage, log.settings)


def traces(log: LogReader, motor: str | None = None) -> Iterator[Trace]:
    """All rows of a log as traces of some ten thousand rows, each as `Recording.trace` has them all.

    Args:
        log: to be read.
        motor: the one whose columns are wanted; all as they stand where it is not given.

    Raises:
        LogError: there is no row, or no such motor.
    """
    waiting: list[NDArray[np.float64]] = []
    for piece in log:
        waiting.append(piece.rows)
        if sum(map(len, waiting)) >= _TRACE:
            yield _piece(log, np.concatenate(waiting), motor)
            waiting = []
    if waiting or not log.count:
        yield _piece(log, np.concatenate([np.empty((0, len(log.columns))), *waiting]), motor)


def _piece(log: LogReader, rows: NDArray[np.float64], motor: str | None) -> Trace:
    if motor is None:
        return _trace(log, rows)
    numbers = np.arange(len(rows))
    whole = Recording(log.about, None, log.columns, log.units, numbers, rows, [], log.damage, log.settings)
    return whole.only(motor).trace()


def _trace(log: Recording | LogReader, rows: NDArray[np.float64]) -> Trace:
    if not len(rows):
        raise LogError("the log has no row", do="it cannot be used")
    kept = ("columns", "units", "settings", "crc32")
    about = {name: value for name, value in log.about.items() if name not in kept}
    columns = {name: np.ascontiguousarray(rows[:, i]) for i, name in enumerate(log.columns)}
    units = dict(zip(log.columns, log.units, strict=True))
    return Trace(columns, units, {**log.settings, "log": about}, log.settings.get("seed"))


def read_trace(path: str | Path) -> Trace:
    """Read a trace: what ``bowden simulate`` and `Trace.write` wrote, or the MCAP log of a live run.

    If a log is cut short or damaged, the readable part is read, and nothing is guessed.

    Args:
        path: of the file; its contents decide how it is read, not the end of its name.

    Raises:
        LogError: no such file, or not a file of bowden.

    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> Trace({"time": np.arange(3.0)}, {"time": "s"}).write(file)
    >>> read_trace(file).time
    array([0., 1., 2.])
    """
    file = arguments.path_of(path, "read_trace: path")
    try:
        with open_file(file) as opened:
            head = opened.read(len(MAGIC))
    except OSError as error:
        raise LogError(f"cannot read {file}: {reason(error)}", expected="a trace or log of bowden") from None
    return read(file).trace() if head == MAGIC else Trace.read(file)
