"""Writing the log of a run: an MCAP file that grows by whole chunks and can be read up to the last of them.

``/cycle`` holds the columns whose name has no dot, ``/law`` those that begin with ``law.``, and so on for every other
beginning; ``/event`` is text. A message is CDR (the encapsulation header, then the doubles, little-endian, which stand
on multiples of 8 from there on), its schema is ros2msg with the unit as a comment. The messages of one row follow one
another, so that a chunk of rows is one numpy array of packed records. Format: mcap.dev/spec.
"""

import json
import os
import re
import struct
import zlib
from array import array
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from bowden.live.ring import Description

PACKAGE = "bowden_msgs/msg/"
_CDR_LITTLE_ENDIAN = 0x00000100  # the four bytes 00 01 00 00, read as a little-endian word
_MESSAGE_HEAD = 2 + 4 + 8 + 8  # channel, sequence, log time, publish time


class Topic(NamedTuple):
    """Columns that make up one message."""

    name: str
    """``/cycle``, ``/law``, …"""
    columns: tuple[int, ...]
    """Where they stand in the row."""
    fields: tuple[str, ...]
    """Their names in the message."""
    units: tuple[str, ...]


class Event(NamedTuple):
    """Something that changed."""

    number: int
    """Of the row in which it shows."""
    time: float
    """The row's time [s]."""
    text: str


def topics(columns: Sequence[str], units: Sequence[str]) -> list[Topic]:
    """The topics that a row with these columns is spread over, `/cycle` first.

    >>> [(t.name, t.fields) for t in topics(["time", "law.Width", "law.width", "motor"], ["s", "1", "1", "rad"])]
    [('/cycle', ('time', 'motor')), ('/law', ('width', 'width_2'))]
    """
    groups: dict[str, list[int]] = {"cycle": []}
    for i, name in enumerate(columns):
        groups.setdefault(_field(name.split(".", 1)[0]) if "." in name else "cycle", []).append(i)
    found = []
    for group, at in groups.items():
        fields: list[str] = []
        for i in at:
            name = wanted = _field(columns[i].split(".", 1)[-1])
            again = 2
            while name in fields:
                name, again = f"{wanted}_{again}", again + 1
            fields.append(name)
        if at:
            found.append(Topic(f"/{group}", tuple(at), tuple(fields), tuple(units[i] for i in at)))
    return found


def _field(name: str) -> str:
    """A name as ROS 2 allows it: small letters, digits and single underscores, a letter first."""
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return plain if plain[:1].isalpha() else f"x_{plain}".strip("_")


def declarations(found: Sequence[Topic]) -> list[tuple[Schema, Channel]]:
    """Schema and channel of each topic, numbered from 1, and of ``/event`` last."""
    pairs = []
    for i, topic in enumerate(found, 1):
        lines = [f"float64 {name}  # [{unit}]" for name, unit in zip(topic.fields, topic.units, strict=True)]
        pairs.append(_declare(i, topic.name, "\n".join(lines) + "\n"))
    text = "float64 time  # [s], of the row in which it shows\nstring text\n"
    return [*pairs, _declare(len(pairs) + 1, "/event", text)]


def _declare(number: int, topic: str, text: str) -> tuple[Schema, Channel]:
    name = PACKAGE + "".join(part.capitalize() for part in topic[1:].split("_"))
    schema = Schema(id=number, name=name, encoding="ros2msg", data=text.encode())
    return schema, Channel(id=number, schema_id=number, topic=topic, message_encoding="cdr", metadata={})


class Packing:
    """Between rows and the bytes of their messages.

    Args:
        found: what `topics` says.
    """

    def __init__(self, found: Sequence[Topic]) -> None:
        self.topics = tuple(found)
        self.width = sum(len(topic.columns) for topic in found)
        message: list[tuple[str, np.dtype[np.void]]] = []
        for topic in found:
            parts = [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<u8")]
            parts += [("publish_time", "<u8"), ("cdr", "<u4")]
            message.append((topic.name, np.dtype([*parts, ("data", "<f8", (len(topic.columns),))])))
        self.dtype = np.dtype(message)
        self.event_channel = len(found) + 1

    def pack(self, numbers: NDArray[np.int64], rows: NDArray[np.float64], log_time: NDArray[np.int64]) -> bytes:
        """The messages of rows (n, width) with their numbers (n,) and times [ns] (n,)."""
        packed = np.empty(len(rows), self.dtype)
        for channel, topic in enumerate(self.topics, 1):
            part = packed[topic.name]
            part["opcode"] = Opcode.MESSAGE
            part["length"] = part.dtype.itemsize - 9
            part["channel"] = channel
            part["sequence"] = numbers & 0xFFFFFFFF
            part["log_time"] = part["publish_time"] = log_time
            part["cdr"] = _CDR_LITTLE_ENDIAN
            part["data"] = rows[:, topic.columns]
        return packed.tobytes()

    def messages(self, place: int, rows: NDArray[np.float64]) -> list[bytes]:
        """The messages of one topic alone, by its place in `topics`, of rows (n, width): CDR, without MCAP's head."""
        data = np.ascontiguousarray(rows[:, self.topics[place].columns], np.dtype("<f8"))
        head = struct.pack("<I", _CDR_LITTLE_ENDIAN)
        return [head + row.tobytes() for row in data]

    def offsets(self) -> list[int]:
        """Where each topic's message begins within a row's bytes."""
        fields = self.dtype.fields
        assert fields is not None
        return [fields[topic.name][1] for topic in self.topics]

    def unpack(self, data: memoryview) -> tuple[NDArray[np.int64], NDArray[np.float64], memoryview]:
        """Numbers and rows of all whole rows at the beginning of `data`, and what follows them."""
        many = np.frombuffer(data, self.dtype, len(data) // self.dtype.itemsize)
        right = np.ones(len(many), bool)
        for channel, topic in enumerate(self.topics, 1):
            part = many[topic.name]
            right &= (part["opcode"] == Opcode.MESSAGE) & (part["length"] == part.dtype.itemsize - 9)
            right &= (part["channel"] == channel) & (part["cdr"] == _CDR_LITTLE_ENDIAN)
        n = len(right) if right.all() else int(right.argmin())
        rows = np.empty((n, self.width))
        for topic in self.topics:
            rows[:, topic.columns] = many[topic.name]["data"][:n]
        numbers = many[self.topics[0].name]["sequence"][:n].astype(np.int64)
        return numbers, rows, data[n * self.dtype.itemsize :]

    def pack_event(self, event: Event, log_time: int) -> bytes:
        """The message of an event at a time [ns]."""
        text = event.text.encode() + b"\0"
        data = struct.pack("<Idi", _CDR_LITTLE_ENDIAN, event.time, len(text)) + text
        head = struct.pack("<BQHIQQ", Opcode.MESSAGE, _MESSAGE_HEAD + len(data), self.event_channel,
                           event.number & 0xFFFFFFFF, log_time, log_time)  # fmt: skip
        return head + data

    def unpack_events(self, data: memoryview) -> list[Event]:
        """The whole events at the beginning of `data`."""
        events = []
        while len(data) >= 9 + _MESSAGE_HEAD + 16:
            opcode, length, channel, number, _, _ = struct.unpack_from("<BQHIQQ", data)
            if (opcode, channel) != (Opcode.MESSAGE, self.event_channel) or len(data) < 9 + length:
                break
            cdr, time, count = struct.unpack_from("<Idi", data, 9 + _MESSAGE_HEAD)
            if cdr != _CDR_LITTLE_ENDIAN or count != length - _MESSAGE_HEAD - 16:
                break
            text = bytes(data[9 + length - count : 9 + length - 1]).decode(errors="replace")
            events.append(Event(number, time, text))
            data = data[9 + length :]
        return events


MAGIC = b"\x89MCAP0\r\n"
ABOUT = "bowden"
"""Name of the metadata record that stands first in a file, with what `about` says."""
_ENDLESS = 1e9
"""No run lasts this long, and 64 bits hold it [s]."""
CLOSING = "bowden.closing"
"""Name of the metadata record that stands last in a file that was closed properly."""


def about(description: Description, more: Mapping[str, str]) -> dict[str, str]:
    """Metadata of the file: columns, units, settings (as JSON), start, and `more`."""
    said = {
        "columns": json.dumps(description.columns),
        "units": json.dumps(description.units),
        "settings": json.dumps(description.settings),
        "start_utc_ns": str(description.start_utc_ns),
        "start_monotonic_ns": str(description.start_monotonic_ns),
        **more,
    }
    return said | {"crc32": checksum(said)}


def checksum(said: Mapping[str, str]) -> str:
    """Of all entries but its own; MCAP has none for metadata, and a unit or a gain that is wrong shows nowhere else."""
    return f"{zlib.crc32(json.dumps(sorted((k, v) for k, v in said.items() if k != 'crc32')).encode()):08x}"


def packed(*records: McapRecord) -> bytes:
    """Records one after another, as bytes."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def stamps_of(start: int, time: NDArray[np.float64]) -> NDArray[np.int64]:
    """The stamps of rows in the file: when the run began [ns], and the time of each since then [s]."""
    known = np.where(np.abs(time) < _ENDLESS, time, 0.0)
    return start + np.rint(1e9 * known).astype(np.int64)


class _Chunk(NamedTuple):
    """What is remembered of a chunk, beside its record in the index."""

    begins: int
    """In the file [bytes]."""
    rows: int
    events: int
    first: int
    """Stamp [ns]."""
    last: int
    """Stamp [ns]."""
    indexed: int
    """Where its record of the index ends [bytes]."""


_NUMBERS = len(_Chunk._fields)


class _Chunks:
    """The chunks of a file, twenty a second: of each its record of the index, packed, and six numbers are kept."""

    def __init__(self) -> None:
        self.index = bytearray()
        self._numbers = array("q")

    def __len__(self) -> int:
        return len(self._numbers) // _NUMBERS

    def append(self, entry: ChunkIndex, rows: int, events: int) -> None:
        """Take one more, behind the others."""
        self.index += packed(entry)
        times = entry.message_start_time, entry.message_end_time
        self._numbers.extend((entry.chunk_start_offset, rows, events, *times, len(self.index)))

    def pop(self) -> _Chunk:
        """Forget the last one."""
        last = _Chunk(*self._numbers[-_NUMBERS:])
        del self._numbers[-_NUMBERS:]
        del self.index[self._numbers[-1] if self._numbers else 0 :]
        return last

    def all_of(self, field: str) -> Sequence[int]:
        """One of the numbers of `_Chunk`, of each."""
        return self._numbers[_Chunk._fields.index(field) :: _NUMBERS]


class LogFile:
    """An open log.

    Args:
        handle: descriptor of an empty file; it stays the caller's to close.
        metadata: what `about` made.
        write: in place of `os.write`.

    Raises:
        OSError: the disk does not take it.
    """

    def __init__(self, handle: int, metadata: Mapping[str, str], write: Callable[[int, bytes], int] = os.write) -> None:
        self._handle, self._write = handle, write
        columns, units = json.loads(metadata["columns"]), json.loads(metadata["units"])
        found = topics(columns, units)
        self._packing, self._declared = Packing(found), declarations(found)
        self._time, self._start = columns.index("time"), int(metadata["start_utc_ns"])
        self._chunks = _Chunks()
        self._metadata: list[MetadataIndex] = []
        self.size = 0
        """Length of the whole records so far [bytes]."""
        self.rows = 0
        """Rows in the file."""
        head = MAGIC + packed(Header("ros2", "bowden"), *(record for pair in self._declared for record in pair))
        self._append(head)
        self._put_metadata(ABOUT, metadata)

    def write(self, numbers: NDArray[np.int64], rows: NDArray[np.float64], events: Sequence[Event] = ()) -> None:
        """Append a chunk, whole or not at all.

        Args:
            numbers: of the rows (n,).
            rows: (n, width), one or more.
            events: that show in these rows.

        Raises:
            OSError: the disk does not take it; the file is as it was before.
        """
        log_time = stamps_of(self._start, rows[:, self._time])
        data = self._packing.pack(numbers, rows, log_time)
        size = self._packing.dtype.itemsize
        index = [
            _message_index(channel, log_time, offset + size * np.arange(len(rows)))
            for channel, offset in enumerate(self._packing.offsets(), 1)
        ]
        stamps = [int(log_time[np.searchsorted(numbers, event.number)]) for event in events]
        texts = [self._packing.pack_event(event, stamp) for event, stamp in zip(events, stamps, strict=True)]
        if texts:
            offsets = len(data) + np.cumsum([0, *map(len, texts[:-1])])
            index.append(_message_index(self._packing.event_channel, np.array(stamps), offsets))
            data += b"".join(texts)
        first, last = int(log_time.min()), int(log_time.max())
        head = struct.pack("<QQQIIQ", first, last, len(data), zlib.crc32(data), 0, len(data))
        chunk = struct.pack("<BQ", Opcode.CHUNK, len(head) + len(data)) + head + data
        places, at = {}, self.size + len(chunk)
        for channel, record in enumerate(index, 1):
            places[channel], at = at, at + len(record)
        entry = ChunkIndex(
            chunk_length=len(chunk),
            chunk_start_offset=self.size,
            message_end_time=last,
            message_index_length=sum(map(len, index)),
            message_index_offsets=places,
            message_start_time=first,
            compression="",
            compressed_size=len(data),
            uncompressed_size=len(data),
        )
        self._append(chunk + b"".join(index))
        self._chunks.append(entry, len(rows), len(texts))
        self.rows += len(rows)

    def finish(self, closing: Mapping[str, str]) -> int:
        """End the file with its index; on a full disk the last chunks make room for it.

        Args:
            closing: for the last metadata record.

        Returns:
            Rows that had to be given up.

        Raises:
            OSError: the disk does not even take the index in place of chunks.
        """
        given_up = 0
        while True:
            before, kept = self.size, len(self._metadata)
            try:
                self._put_metadata(CLOSING, {**closing, "given_up": str(given_up), "rows": str(self.rows)})
                self._append(packed(DataEnd(0)))
                self._append(self._summary())
                return given_up
            except OSError:
                if not self._chunks:
                    raise
                del self._metadata[kept:]
                self.size = before
                while self._chunks and before - self.size < _ROOM:  # in steps, for the index of hours is long
                    last = self._chunks.pop()
                    given_up, self.rows = given_up + last.rows, self.rows - last.rows
                    self.size = last.begins
                os.ftruncate(self._handle, self.size)
                os.lseek(self._handle, self.size, os.SEEK_SET)

    def _append(self, data: bytes) -> None:
        """Write all of `data`, or leave the file as it was."""
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._write(self._handle, rest) :]  # type: ignore[arg-type]
        except OSError:
            os.ftruncate(self._handle, self.size)
            os.lseek(self._handle, self.size, os.SEEK_SET)
            raise
        self.size += len(data)

    def _put_metadata(self, name: str, metadata: Mapping[str, str]) -> None:
        data, at = packed(Metadata(name, dict(metadata))), self.size
        self._append(data)
        self._metadata.append(MetadataIndex(at, len(data), name))

    def _summary(self) -> bytes:
        """Everything after the end of the data."""
        chunks = self._chunks
        events = sum(chunks.all_of("events"))
        counts = dict.fromkeys(range(1, self._packing.event_channel), self.rows)
        counts |= {self._packing.event_channel: events} if events else {}
        statistics = Statistics(
            attachment_count=0,
            message_count=sum(counts.values()),
            channel_count=len(self._declared),
            channel_message_counts=counts,
            chunk_count=len(chunks),
            message_end_time=max(chunks.all_of("last"), default=0),
            message_start_time=min(chunks.all_of("first"), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._declared),
        )
        groups: list[tuple[Opcode, bytes]] = [
            (Opcode.SCHEMA, packed(*(schema for schema, _ in self._declared))),
            (Opcode.CHANNEL, packed(*(channel for _, channel in self._declared))),
            (Opcode.STATISTICS, packed(statistics)),
            (Opcode.CHUNK_INDEX, bytes(chunks.index)),
            (Opcode.METADATA_INDEX, packed(*self._metadata)),
        ]
        summary, offsets = b"", []
        for opcode, data in groups:
            if data:
                offsets.append(SummaryOffset(opcode, self.size + len(summary), len(data)))
                summary += data
        start, offset_start = self.size, self.size + len(summary)
        summary += packed(*offsets)
        footer = packed(Footer(start, offset_start, 0))[:-4]
        return summary + footer + struct.pack("<I", zlib.crc32(summary + footer)) + MAGIC


_ROOM = 1 << 16
"""How much is given up at a time to make room for the end of a file [bytes]."""


def _message_index(channel: int, log_time: NDArray[np.int64], offsets: NDArray[np.int64]) -> bytes:
    """A message index record: where the messages of a channel stand within their chunk."""
    entries = np.stack([log_time, offsets], axis=1).astype("<u8").tobytes()
    return struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + len(entries), channel, len(entries)) + entries
