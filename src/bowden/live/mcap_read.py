"""The log of a run, read piece by piece or whole, as it is or as a kill, a full disk or a flipped bit left it; its
traces, and recovery: a file that every reader opens.
"""

import json
import mmap
import os
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata
from numpy.typing import NDArray

from bowden.core import arguments
from bowden.core.bounded import open_file, reason
from bowden.core.errors import LogError, OutputError, near
from bowden.core.files import whole_file
from bowden.live.figures import Damage, Recovery
from bowden.live.mcap_log import ABOUT, CLOSING, MAGIC, Event, LogFile, Packing, checksum, topics
from bowden.live.ring import Description
from bowden.live.together import named, view
from bowden.records.trace import Trace

_HEAD = 9  # of a record: opcode and length
_DO = "give a log of bowden run"


class Piece(NamedTuple):
    """Rows that stand together in a log."""

    numbers: NDArray[np.int64]
    """Of each row since the run's begin, from 0 (n,)."""
    rows: NDArray[np.float64]
    """(n, width)"""
    events: list[Event]


def missing_of(last: int, count: int, closing: dict[str, str] | None) -> int:
    """Rows that the loop wrote and that a log does not have: those before its last one, or all that its end reports.

    Args:
        last: number of its last row, -1 of none.
        count: of its rows.
        closing: its last metadata record.
    """
    reported = [(closing or {}).get(name, "0") for name in ("lost", "dropped", "given_up")]
    return max(last + 1 - count, sum(int(number) for number in reported if number.isascii() and number.isdigit()))


class LogReader:
    """A log that is read piece by piece, so that it need not fit into memory; iterate over it once.

    Args:
        path: of the log.
        only: the columns to keep of those that it has; all by default.

    Raises:
        LogError: no such file, none that bowden wrote, or its beginning is damaged.
    """

    def __init__(self, path: Path, only: Sequence[str] | None = None) -> None:
        self.path = path
        self._data = _mapped(path)
        self.about, self._begin = _about(self._data, path)
        about = self.about
        try:
            columns, units = tuple(json.loads(about["columns"])), tuple(json.loads(about["units"]))
            self.settings: dict[str, Any] = dict(json.loads(about["settings"]))
            Description(columns, units, self.settings, int(about["start_utc_ns"]))
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise LogError(f"{path} does not say what its rows are: {error}", do=_DO) from error
        self._packing = Packing(topics(columns, units))
        wanted = None if only is None else {*named(tuple(only), motors_of(self.settings))}
        kept = [i for i, name in enumerate(columns) if wanted is None or name in wanted]
        self._kept = slice(None) if only is None else kept
        self.columns, self.units = tuple(columns[i] for i in kept), tuple(units[i] for i in kept)
        self.closing: dict[str, str] | None = None
        """The last metadata record, once all is read; None where the file was not closed properly."""
        self.count = 0
        """Rows so far."""
        self._last, self._chunks, self._skipped, self._torn = -1, 0, 0, 0

    def first_number(self) -> int:
        """Number of its first row since the run's begin; -1 of a log without one."""
        return next((int(piece.numbers[0]) for piece in LogReader(self.path, ()) if len(piece.numbers)), -1)

    @property
    def missing(self) -> int:
        """See `Recording.missing`, once all is read."""
        return missing_of(self._last, self.count, self.closing)

    @property
    def whole(self) -> bool:
        """See `Recording.whole`, once all is read."""
        return self.closing is not None and self.damage == Damage(0, 0, 0)

    @property
    def most(self) -> int:
        """The number of rows at most."""
        return len(self._data) // self._packing.dtype.itemsize

    @property
    def damage(self) -> Damage:
        """Parts that could not be read, once all is read."""
        return Damage(self._chunks, self._skipped, self._torn)

    def __iter__(self) -> Iterator[Piece]:
        """Take every record; where something is no record, go on at the next whole chunk."""
        data, at, ended = self._data, self._begin, False
        while at < len(data) and not ended:
            found = _record(data, at)
            if found is not None:
                opcode, record, end = found
                ended = opcode == Opcode.FOOTER
                yield from self._take(opcode, record)
                at = end
                continue
            following = _next_chunk(data, at + 1)
            if following is None:
                self._torn, self.closing = len(data) - at, None
                return
            self._skipped += following - at
            at = following
        if data[at:] != MAGIC:
            self._torn, self.closing = len(data) - at, None

    def _take(self, opcode: int, record: Chunk | Metadata | None) -> Iterator[Piece]:
        if isinstance(record, Chunk):
            numbers, rows, rest = self._packing.unpack(memoryview(record.data))
            self._last = int(numbers[-1]) if len(numbers) else self._last
            self.count += len(numbers)
            yield Piece(numbers, rows[:, self._kept], self._packing.unpack_events(rest))
        elif opcode == Opcode.CHUNK:
            self._chunks += 1
        elif isinstance(record, Metadata) and record.name == CLOSING:
            self.closing = record.metadata


def _mapped(path: Path) -> mmap.mmap:
    """The bytes of a file that begins as MCAP does."""
    try:
        with open_file(path) as file:
            start = file.read(len(MAGIC))
            if not start:
                raise LogError(f"{path} is empty", do=_DO)
            if start != MAGIC:
                raise LogError(f"{path} is no MCAP file", do=_DO)
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:  # ValueError: a null byte in its name
        raise LogError(f"cannot read {path}: {reason(error)}", do=_DO) from error


def _about(data: mmap.mmap, path: Path) -> tuple[dict[str, str], int]:
    """The first metadata record, and where it ends."""
    at = len(MAGIC)
    while (found := _record(data, at)) is not None:
        opcode, record, at = found
        if opcode in (Opcode.CHUNK, Opcode.DATA_END, Opcode.FOOTER):
            break
        if isinstance(record, Metadata) and record.name == ABOUT:
            if record.metadata.get("crc32") != checksum(record.metadata):
                break
            return record.metadata, at
    raise LogError(
        f"{path} does not say what its rows are: it is another program's, or its beginning is damaged", do=_DO
    )


def _record(data: mmap.mmap, at: int) -> tuple[int, Chunk | Metadata | None, int] | None:
    """The record that begins at a place, and its end; None where no whole one does.

    Metadata and chunks are read, and are None if they are damaged; what else there is (the index of every chunk above
    all) is passed over, for which mcap's own `StreamReader` has no way, nor for going on behind a damaged record.
    """
    if at + _HEAD > len(data):
        return None
    opcode, length = struct.unpack_from("<BQ", data, at)
    end = at + _HEAD + length
    if not Opcode.HEADER <= opcode <= Opcode.DATA_END or end > len(data):
        return None
    record: Chunk | Metadata | None = None
    if opcode in (Opcode.CHUNK, Opcode.METADATA):
        data.seek(at + _HEAD)
        stream = ReadDataStream(data)  # type: ignore[arg-type]  # of a file it calls `read` alone
        try:
            record = Chunk.read(stream) if opcode == Opcode.CHUNK else Metadata.read(stream)
        except (ValueError, struct.error, EndOfFile):
            return opcode, None, end
        if data.tell() != end or (isinstance(record, Chunk) and not _sound(record)):
            record = None
    return opcode, record, end


def _sound(chunk: Chunk) -> bool:
    """True if a chunk's length and checksum are right, and it is not compressed."""
    fits = not chunk.compression and chunk.uncompressed_size == len(chunk.data)
    return fits and zlib.crc32(chunk.data) == chunk.uncompressed_crc


def _next_chunk(data: mmap.mmap, at: int) -> int | None:
    """Where the next chunk that is as it was written begins, at `at` or later."""
    while (at := data.find(bytes([Opcode.CHUNK]), at)) >= 0:
        if (found := _record(data, at)) is not None and found[1] is not None:
            return at
        at += 1
    return None


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


TAIL = 0.2
"""Most that a recorder on a healthy disk can have had in its hands when it was killed, not yet in the file [s]."""
_ENOUGH = 10  # cycles from which the length of one is known


def recover(path: Path, out: Path, more: Sequence[Path] = ()) -> Recovery:
    """Copy every row and event that can be read into a new file; the old ones stay as they are.

    Args:
        path: of the log.
        out: the new file.
        more: files of the same run, of recorders that went on where another one had ended; rows that two of them have
            are written once.

    Raises:
        LogError: nothing can be read, or the files are not of one run.
        OutputError: the new file is an old one, is there already, or cannot be written.
    """
    if os.path.lexists(out):
        raise OutputError(f"{out} exists", expected="the name of a new file", do="choose another with --out")
    logs = sorted((LogReader(one) for one in dict.fromkeys((path, *more))), key=LogReader.first_number)
    for log in logs[1:]:
        if any(log.about.get(key) != logs[0].about.get(key) for key in _OF_A_RUN):
            raise LogError(f"{path} and {log.path} are of two runs", do="recover each of them separately")
    with whole_file(out) as part:
        handle = os.open(part, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o644)
        try:
            saved = _copy(handle, logs)
            os.fsync(handle)
        finally:
            os.close(handle)
    return saved


_OF_A_RUN = ("columns", "units", "settings", "start_utc_ns", "start_monotonic_ns")
"""What two files of one run say alike."""


def _copy(handle: int, logs: Sequence[LogReader]) -> Recovery:
    """Write every piece of a run's logs, and say what is missing of it."""
    file, time = LogFile(handle, logs[0].about), logs[0].columns.index("time")
    steps, last, count = np.empty(0), -1, 0
    for log in logs:
        for piece in log:
            new = piece.numbers > last
            numbers, rows = piece.numbers[new], piece.rows[new]
            if len(numbers):
                file.write(numbers, rows, [event for event in piece.events if event.number in numbers])
                steps = np.diff(rows[:, time]) if len(steps) < _ENOUGH else steps
                last, count = int(numbers[-1]), count + len(numbers)
    end = logs[-1]
    closing = end.closing or {}
    if len(logs) > 1:  # a later recorder has not lost what another one has written
        reported = missing_of(-1, 0, {**closing, "lost": "0"})
        closing = closing | {"lost": str(max(0, last + 1 - count - reported))}
    file.finish({**closing, "recovered_from": " ".join(log.path.name for log in logs)})
    missing = missing_of(last, count, closing)
    cycle, tail = float(np.median(steps)) if len(steps) else 0.0, 0.0 if end.closing is not None else TAIL
    damage = Damage(*(sum(parts) for parts in zip(*(astuple(log.damage) for log in logs), strict=True)))
    return Recovery(count, missing, round(missing * cycle, 6), tail, damage)
