"""Reading the log of a run, whole or as a kill, a full disk or a flipped bit left it."""

import json
import mmap
import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Metadata
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.trace import Trace
from bowden.runtime.mcap_layout import Event, Packing, topics
from bowden.runtime.mcap_log import ABOUT, CLOSING, MAGIC, checksum
from bowden.runtime.ring import Description

_HEAD = 9  # of a record: opcode and length
_CHUNK_HEAD = 40  # of an uncompressed chunk: two times, size, CRC-32, no compression, size
_DO = "give a log that bowden run wrote"


class Damage(NamedTuple):
    """What could not be read of a file."""

    chunks: int
    """Chunks that are there but changed: their checksum is wrong."""
    skipped: int
    """Bytes that are no records, between others [bytes]."""
    torn: int
    """Bytes at the end that are no whole row or record [bytes]."""


@dataclass(frozen=True)
class Recording:
    """What a log holds."""

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
    def missing(self) -> int:
        """Rows that the loop wrote before the last one here, and that are not here."""
        return int(self.numbers[-1]) + 1 - len(self.numbers) if len(self.numbers) else 0

    @property
    def whole(self) -> bool:
        """Closed properly, and nothing in it changed since."""
        return self.closing is not None and self.damage == Damage(0, 0, 0)

    def trace(self) -> Trace:
        """All rows as a trace with units, settings and seed; what else the file says of its run is in ``settings.log``.

        Raises:
            LogError: there is no row.
        """
        if not len(self.rows):
            raise LogError("the log has no row", do="nothing can be made of it")
        kept = ("columns", "units", "settings", "crc32")
        log = {name: value for name, value in self.about.items() if name not in kept}
        columns = {name: np.ascontiguousarray(self.rows[:, i]) for i, name in enumerate(self.columns)}
        units = dict(zip(self.columns, self.units, strict=True))
        return Trace(columns, units, {**self.settings, "log": log}, self.settings.get("seed"))


def read(path: Path) -> Recording:
    """Everything that can be read of a log; what is damaged is left out and counted, never guessed.

    Raises:
        LogError: no such file, none that bowden wrote, or its beginning is damaged.
    """
    try:
        with path.open("rb") as file:
            start = file.read(len(MAGIC))
            if not start:
                raise LogError(f"{path} is empty", do=_DO)
            if start != MAGIC:
                raise LogError(f"{path} is no MCAP file", do=_DO)
            data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except (OSError, ValueError) as error:  # ValueError: a null byte in its name
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise LogError(f"cannot read {path}: {reason.lower()}", do=_DO) from error
    about, at = _about(data, path)
    try:
        columns, units = tuple(json.loads(about["columns"])), tuple(json.loads(about["units"]))
        settings = dict(json.loads(about["settings"]))
        Description(columns, units, settings, int(about["start_utc_ns"]))
    except (KeyError, TypeError, ValueError) as error:
        raise LogError(f"{path} does not say what its rows are: {error}", do=_DO) from error
    found = _Finds(Packing(topics(columns, units)))
    found.walk(data, at)
    numbers = np.concatenate([np.empty(0, np.int64), *found.numbers])
    rows = np.concatenate([np.empty((0, len(columns))), *found.rows])
    damage = Damage(found.chunks, found.skipped, found.torn)
    return Recording(about, found.closing, columns, units, numbers, rows, found.events, damage, settings)


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
    raise LogError(f"{path} does not say what its rows are: another program's, or its beginning is damaged", do=_DO)


def _metadata(data: memoryview) -> Metadata | None:
    try:
        return Metadata.read(ReadDataStream(BytesIO(data)))
    except (McapError, ValueError, struct.error, MemoryError, OverflowError):
        return None


class _Finds:
    """What a walk through a file has found."""

    def __init__(self, packing: Packing) -> None:
        self._packing = packing
        self.numbers: list[NDArray[np.int64]] = []
        self.rows: list[NDArray[np.float64]] = []
        self.events: list[Event] = []
        self.closing: dict[str, str] | None = None
        self.chunks = self.skipped = self.torn = 0

    def walk(self, data: memoryview, at: int) -> None:
        """Take every record from `at` on; where something is no record, go on at the next whole chunk."""
        ended = False
        while at < len(data) and not ended:
            size = self._take(data, at)
            if size:
                ended = data[at] == Opcode.FOOTER
                at += size
                continue
            following = _next_chunk(data, at + 1)
            if following is None:
                self.torn = self._take_torn(data[at:])
                self.closing = None
                return
            self.skipped += following - at
            at = following
        if bytes(data[at:]) != MAGIC:
            self.torn, self.closing = len(data) - at, None

    def _take(self, data: memoryview, at: int) -> int:
        """Take the record that begins at `at`, and say how long it is; 0 where there is no whole one."""
        if at + _HEAD > len(data):
            return 0
        opcode, length = struct.unpack_from("<BQ", data, at)
        end = at + _HEAD + length
        if not Opcode.HEADER <= opcode <= Opcode.DATA_END or end > len(data):
            return 0
        body = data[at + _HEAD : end]
        if opcode == Opcode.CHUNK:
            if not self._take_chunk(body):
                self.chunks += 1
        elif opcode == Opcode.METADATA:
            record = _metadata(body)
            if record is not None and record.name == CLOSING:
                self.closing = record.metadata
        return end - at

    def _take_chunk(self, body: memoryview) -> bool:
        """Take the rows of a chunk if it is as it was written."""
        if not _sound(body):
            return False
        data = body[_CHUNK_HEAD:]
        numbers, rows, _, rest = self._packing.unpack(data)
        self.numbers.append(numbers)
        self.rows.append(rows)
        self.events += self._packing.unpack_events(rest)
        return True

    def _take_torn(self, data: memoryview) -> int:
        """Take the whole rows of a chunk that was cut; how many bytes are left over.

        Its checksum says nothing now; but what a kill leaves is cut, not changed, and the row numbers must go on.
        """
        start = _HEAD + _CHUNK_HEAD
        if len(data) <= start or data[0] != Opcode.CHUNK:
            return len(data)
        numbers, rows, _, rest = self._packing.unpack(data[start:])
        last = int(self.numbers[-1][-1]) if self.numbers and len(self.numbers[-1]) else -1
        if not (np.diff(numbers, prepend=last) > 0).all():
            return len(data)
        self.numbers.append(numbers)
        self.rows.append(rows)
        self.events += self._packing.unpack_events(rest)
        return len(data) - start - len(numbers) * self._packing.dtype.itemsize


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
