"""Reading a log piece by piece, as it is or as a kill, a full disk or a flipped bit left it."""

import json
import mmap
import struct
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata
from numpy.typing import NDArray

from bowden.core.bounded import open_file, reason
from bowden.core.errors import LogError
from bowden.live import motor_columns
from bowden.live.figures import Damage
from bowden.live.mcap_layout import Event, Packing, topics
from bowden.live.mcap_log import ABOUT, CLOSING, MAGIC, checksum
from bowden.live.ring import Description

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
        names = [str(one["name"]) for one in self.settings.get("motors") or ()]
        wanted = None if only is None else {*motor_columns.named(tuple(only), names)} if names else {*only}
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
