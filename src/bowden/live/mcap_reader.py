"""Reading a log piece by piece, as it is or as a kill, a full disk or a flipped bit left it."""

import json
import mmap
import struct
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import open_file, reason
from bowden.core.errors import LogError
from bowden.live import axis_columns
from bowden.live.mcap_layout import Event, Packing, topics
from bowden.live.mcap_log import ABOUT, CLOSING, MAGIC, checksum, stamps_of
from bowden.live.mcap_records import Metadata, Opcode, read_metadata
from bowden.live.ring import Description

_HEAD = 9  # of a record: opcode and length
_CHUNK_HEAD = 40  # of an uncompressed chunk: two times, size, CRC-32, no compression, size
_DO = "give a log of bowden run"


class Damage(NamedTuple):
    """What could not be read of a file."""

    chunks: int
    """Chunks that are there but changed: their checksum is wrong."""
    skipped: int
    """Bytes that are no records, between others [bytes]."""
    torn: int
    """Bytes at the end that are no whole row or record [bytes]."""


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
        self._start, self._time = int(about["start_utc_ns"]), columns.index("time")
        names = [str(one["name"]) for one in self.settings.get("axes") or ()]
        wanted = None if only is None else {*axis_columns.named(tuple(only), names)} if names else {*only}
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
        """What could not be read, once all is read."""
        return Damage(self._chunks, self._skipped, self._torn)

    def __iter__(self) -> Iterator[Piece]:
        """Take every record; where something is no record, go on at the next whole chunk."""
        data, at, ended = self._data, self._begin, False
        while at < len(data) and not ended:
            size = self._size(at)
            if size:
                ended = data[at] == Opcode.FOOTER
                yield from self._take(data[at], data[at + _HEAD : at + size])
                at += size
                continue
            following = _next_chunk(data, at + 1)
            if following is None:
                yield from self._take_torn(data[at:])
                self.closing = None
                return
            self._skipped += following - at
            at = following
        if bytes(data[at:]) != MAGIC:
            self._torn, self.closing = len(data) - at, None

    def _size(self, at: int) -> int:
        """Length of the record that begins at `at`; 0 where there is no whole one."""
        if at + _HEAD > len(self._data):
            return 0
        opcode, length = struct.unpack_from("<BQ", self._data, at)
        whole = Opcode.HEADER <= opcode <= Opcode.DATA_END and at + _HEAD + length <= len(self._data)
        return _HEAD + length if whole else 0

    def _take(self, opcode: int, body: memoryview) -> Iterator[Piece]:
        if opcode == Opcode.CHUNK and not _sound(body):
            self._chunks += 1
        elif opcode == Opcode.CHUNK:
            numbers, rows, _, rest = self._packing.unpack(body[_CHUNK_HEAD:])
            yield self._piece(numbers, rows, rest)
        elif opcode == Opcode.METADATA:
            record = _metadata(body)
            if record is not None and record.name == CLOSING:
                self.closing = record.metadata

    def _take_torn(self, data: memoryview) -> Iterator[Piece]:
        """The whole rows of a chunk that was cut.

        Its checksum says nothing now; but what a kill leaves is cut, not changed, the row numbers must go on, and a row
        says its time twice: up to the first that contradicts itself. A time that is wrong by itself has a page drawn
        over 10³⁰⁰ seconds.
        """
        start, self._torn = _HEAD + _CHUNK_HEAD, len(data)
        if len(data) <= start or data[0] != Opcode.CHUNK:
            return
        numbers, rows, times, rest = self._packing.unpack(data[start:])
        same = stamps_of(self._start, rows[:, self._time]) == times
        if not same.all():
            n = int(same.argmin())
            numbers, rows, rest = numbers[:n], rows[:n], rest[len(rest) :]
        if (np.diff(numbers, prepend=self._last) > 0).all():
            self._torn -= start + len(numbers) * self._packing.dtype.itemsize
            yield self._piece(numbers, rows, rest)

    def _piece(self, numbers: NDArray[np.int64], rows: NDArray[np.float64], rest: memoryview) -> Piece:
        self._last = int(numbers[-1]) if len(numbers) else self._last
        self.count += len(numbers)
        return Piece(numbers, rows[:, self._kept], self._packing.unpack_events(rest))


def _mapped(path: Path) -> memoryview:
    """The bytes of a file that begins as MCAP does."""
    try:
        with open_file(path) as file:
            start = file.read(len(MAGIC))
            if not start:
                raise LogError(f"{path} is empty", do=_DO)
            if start != MAGIC:
                raise LogError(f"{path} is no MCAP file", do=_DO)
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except (OSError, ValueError) as error:  # ValueError: a null byte in its name
        raise LogError(f"cannot read {path}: {reason(error)}", do=_DO) from error


def _about(data: memoryview, path: Path) -> tuple[dict[str, str], int]:
    """The first metadata record, and where it ends."""
    at = len(MAGIC)
    while at + _HEAD <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        end = at + _HEAD + length
        if opcode in (Opcode.CHUNK, Opcode.DATA_END, Opcode.FOOTER) or end > len(data):
            break
        if opcode == Opcode.METADATA:
            record = _metadata(data[at + _HEAD : end])
            if record is not None and record.name == ABOUT:
                if record.metadata.get("crc32") != checksum(record.metadata):
                    break
                return record.metadata, end
        at = end
    raise LogError(
        f"{path} does not say what its rows are: it is another program's, or its beginning is damaged", do=_DO
    )


def _metadata(data: memoryview) -> Metadata | None:
    try:
        return read_metadata(bytes(data))
    except ValueError:
        return None


def _sound(body: memoryview) -> bool:
    """Whether a chunk's length and checksum are right, and it is not compressed."""
    if len(body) < _CHUNK_HEAD:
        return False
    _, _, size, crc, compression, again = struct.unpack_from("<QQQIIQ", body)
    fits = compression == 0 and size == again == len(body) - _CHUNK_HEAD
    return fits and zlib.crc32(body[_CHUNK_HEAD:]) == crc


def _next_chunk(data: memoryview, at: int) -> int | None:
    """Where the next chunk that is as it was written begins, at `at` or later."""
    buffer = data.obj
    assert isinstance(buffer, mmap.mmap)
    while (at := buffer.find(bytes([Opcode.CHUNK]), at)) >= 0:
        if at + _HEAD + _CHUNK_HEAD <= len(data):
            (length,) = struct.unpack_from("<Q", data, at + 1)
            if length <= len(data) - at - _HEAD and _sound(data[at + _HEAD : at + _HEAD + length]):
                return at
        at += 1
    return None
