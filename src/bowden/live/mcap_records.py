"""The records of an MCAP file that a log has, as bytes; chunks and messages are packed in `mcap_log` and `mcap_layout`.

A record is its opcode, its length in 64 bits, and its content: numbers little-endian, text with its length in 32 bits
before it. Format: mcap.dev/spec. The package mcap reads the same, which tests compare; it would bring two compressors
of 30 MB that no log of ours needs.
"""

import struct
from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import NamedTuple, Protocol


class Opcode(IntEnum):
    """What a record is."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


class Record(Protocol):
    """One that can be written."""

    def packed(self) -> bytes:
        """All of it, from its opcode on."""
        ...


def packed(records: Iterable[Record]) -> bytes:
    """Records one after another."""
    return b"".join(record.packed() for record in records)


def _record(opcode: Opcode, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack("<BQ", opcode, len(content)) + content


def _text(value: str | bytes) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def _texts(values: Mapping[str, str]) -> bytes:
    return _text(b"".join(_text(part) for pair in values.items() for part in pair))


def _by_channel(values: Mapping[int, int]) -> bytes:
    return _text(b"".join(struct.pack("<HQ", channel, value) for channel, value in values.items()))


class Header(NamedTuple):
    """The first one."""

    profile: str
    library: str

    def packed(self) -> bytes:
        """See `Record`."""
        return _record(Opcode.HEADER, _text(self.profile), _text(self.library))


class Schema(NamedTuple):
    """What is in the messages of a channel."""

    id: int
    name: str
    encoding: str
    data: bytes

    def packed(self) -> bytes:
        """See `Record`."""
        number = struct.pack("<H", self.id)
        return _record(Opcode.SCHEMA, number, _text(self.name), _text(self.encoding), _text(self.data))


class Channel(NamedTuple):
    """Messages of one kind."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str

    def packed(self) -> bytes:
        """See `Record`."""
        numbers = struct.pack("<HH", self.id, self.schema_id)
        return _record(Opcode.CHANNEL, numbers, _text(self.topic), _text(self.message_encoding), _texts({}))


class Metadata(NamedTuple):
    """Text by its name."""

    name: str
    metadata: dict[str, str]

    def packed(self) -> bytes:
        """See `Record`."""
        return _record(Opcode.METADATA, _text(self.name), _texts(self.metadata))


def read_metadata(content: bytes) -> Metadata:
    """A metadata record from what stands behind its head.

    Raises:
        ValueError: it is damaged.

    >>> read_metadata(Metadata("of", {"a": "1"}).packed()[9:])
    Metadata(name='of', metadata={'a': '1'})
    """
    name, at = _read_text(content, 0)
    entries, end = _read_bytes(content, at)
    if end != len(content):
        raise ValueError("it goes on behind its end")
    found, at = {}, 0
    while at < len(entries):
        key, at = _read_text(entries, at)
        found[key], at = _read_text(entries, at)
    return Metadata(name, found)


def _read_bytes(data: bytes, at: int) -> tuple[bytes, int]:
    end = at + 4
    if end > len(data):
        raise ValueError("it ends too early")
    end += int.from_bytes(data[at:end], "little")
    if end > len(data):
        raise ValueError("it ends too early")
    return data[at + 4 : end], end


def _read_text(data: bytes, at: int) -> tuple[str, int]:
    found, end = _read_bytes(data, at)
    return found.decode(), end


class ChunkIndex(NamedTuple):
    """Where a chunk of messages stands."""

    message_start_time: int
    """[ns]"""
    message_end_time: int
    """[ns]"""
    chunk_start_offset: int
    chunk_length: int
    message_index_offsets: dict[int, int]
    """Channel → where the index of its messages stands."""
    message_index_length: int
    size: int
    """Of its messages, which are not compressed."""

    def packed(self) -> bytes:
        """See `Record`."""
        place = struct.pack("<QQQQ", *self[:4])
        size = struct.pack("<QQ", self.size, self.size)
        index = struct.pack("<Q", self.message_index_length)
        return _record(Opcode.CHUNK_INDEX, place, _by_channel(self.message_index_offsets), index, _text(""), size)


class MetadataIndex(NamedTuple):
    """Where a metadata record stands."""

    offset: int
    length: int
    name: str

    def packed(self) -> bytes:
        """See `Record`."""
        return _record(Opcode.METADATA_INDEX, struct.pack("<QQ", self.offset, self.length), _text(self.name))


class Statistics(NamedTuple):
    """What is in the file."""

    schema_count: int
    channel_count: int
    metadata_count: int
    chunk_count: int
    message_start_time: int
    """[ns]"""
    message_end_time: int
    """[ns]"""
    channel_message_counts: dict[int, int]

    def packed(self) -> bytes:
        """See `Record`."""
        attachments = 0
        counts = struct.pack(
            "<QHIIIIQQ",
            sum(self.channel_message_counts.values()),
            self.schema_count,
            self.channel_count,
            attachments,
            self.metadata_count,
            self.chunk_count,
            self.message_start_time,
            self.message_end_time,
        )
        return _record(Opcode.STATISTICS, counts, _by_channel(self.channel_message_counts))


class SummaryOffset(NamedTuple):
    """Where the records of one kind stand together behind the data."""

    group_opcode: Opcode
    group_start: int
    group_length: int

    def packed(self) -> bytes:
        """See `Record`."""
        return _record(Opcode.SUMMARY_OFFSET, struct.pack("<BQQ", *self))


class DataEnd(NamedTuple):
    """Behind the data, without a checksum of them all: every chunk has its own."""

    def packed(self) -> bytes:
        """See `Record`."""
        return _record(Opcode.DATA_END, struct.pack("<I", 0))


class Footer(NamedTuple):
    """The last one."""

    summary_start: int
    summary_offset_start: int
    summary_crc: int

    def packed(self) -> bytes:
        """See `Record`."""
        return _record(Opcode.FOOTER, struct.pack("<QQI", *self))
