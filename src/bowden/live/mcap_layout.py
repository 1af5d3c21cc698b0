"""How the rows of a run stand in an MCAP file: topics, schemas, and the bytes of many messages at once.

``/cycle`` holds the columns whose name has no dot, ``/law`` those that begin with ``law.``, and so on for every other
beginning; ``/event`` is text. A message is CDR (the encapsulation header, then the doubles, little-endian, which stand
on multiples of 8 from there on), its schema is ros2msg with the unit as a comment. The messages of one row follow one
another, so that a chunk of rows is one numpy array of packed records. Format: mcap.dev/spec.
"""

import re
import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

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
