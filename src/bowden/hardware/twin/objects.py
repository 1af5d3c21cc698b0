"""The object dictionary of the twin, and the SDO server that serves it."""

import math
import struct
from collections.abc import Callable
from typing import NamedTuple

from bowden.hardware.drives import canopen_frames as frames

Key = tuple[int, int]
"""Index and sub-index."""


class Entry(NamedTuple):
    """One object."""

    size: int
    """[bytes]; 0 for a text."""
    value: int | bytes
    writable: bool = False
    signed: bool = False


class Abort(Exception):
    """An SDO abort, with its code."""

    def __init__(self, code: int) -> None:
        self.code = code


NO_OBJECT, NO_SUB, READ_ONLY, WRONG_LENGTH, OUT_OF_RANGE, BAD_COMMAND, GENERAL, NOT_MAPPABLE = (
    0x0602_0000,
    0x0609_0011,
    0x0601_0002,
    0x0607_0010,
    0x0609_0030,
    0x0504_0001,
    0x0800_0000,
    0x0604_0041,
)
"""SDO abort codes (CiA 301)."""


class Objects:
    """An object dictionary with its values.

    Args:
        entries: what there is.
        changed: called after an object was written from the bus.
        current: values that change by themselves, asked for at each reading.
    """

    def __init__(
        self, entries: dict[Key, Entry], changed: Callable[[Key, int], None], current: dict[Key, Callable[[], int]]
    ) -> None:
        self._entries = dict(entries)
        self._values = {key: entry.value for key, entry in entries.items()}
        self._changed, self._current = changed, current

    def __getitem__(self, key: Key) -> int:
        value = self._values.get(key, 0)
        return value if isinstance(value, int) else 0

    def change(self, key: Key, value: int) -> None:
        """Give an object another value from elsewhere than the bus."""
        self._values[key] = value

    def read(self, key: Key) -> bytes:
        """The bytes of an object, as SDO carries them."""
        entry = self._entries.get(key)
        if entry is None:
            raise Abort(NO_SUB if any(index == key[0] for index, _ in self._entries) else NO_OBJECT)
        value = self._current[key]() if key in self._current else self._values[key]
        if isinstance(value, bytes):
            return value
        return (value % (1 << 8 * entry.size)).to_bytes(entry.size, "little")

    def write(self, key: Key, data: bytes) -> None:
        """Write an object from the bus."""
        self.read(key)
        entry = self._entries[key]
        if not entry.writable:
            raise Abort(READ_ONLY)
        if len(data) != entry.size:
            raise Abort(WRONG_LENGTH)
        value = int.from_bytes(data, "little", signed=entry.signed)
        if (
            key[0] & ~0x3 in (0x1600, 0x1A00)
            and key[1]
            and value
            and (value >> 16, value >> 8 & 0xFF) not in self._entries
        ):
            raise Abort(NOT_MAPPABLE)
        self._values[key] = value
        self._changed(key, value)


class SdoServer:
    """Answers SDO requests: expedited and segmented uploads, expedited downloads (CiA 301, "SDO protocol")."""

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self._rest = b""
        self._toggle = 0

    def answer(self, request: bytes) -> bytes | None:
        """The answer to a request; None to an abort, or to what is no request."""
        if len(request) != 8 or request[0] >> 5 == 4:
            return None
        command, index, sub = struct.unpack_from("<BHB", request)
        try:
            if command >> 5 == 2:
                return self._upload(index, sub)
            if command >> 5 == 3:
                return self._segment(command)
            if command >> 5 == 1 and command & 0x02:
                size = 4 - (command >> 2 & 3) if command & 1 else 4
                self._objects.write((index, sub), request[4 : 4 + size])
                return struct.pack("<BHB4x", 0x60, index, sub)
            raise Abort(BAD_COMMAND)
        except Abort as abort:
            return struct.pack("<BHBI", 0x80, index, sub, abort.code)

    def _upload(self, index: int, sub: int) -> bytes:
        data = self._objects.read((index, sub))
        if 1 <= len(data) <= 4:
            return struct.pack("<BHB4s", 0x43 | (4 - len(data)) << 2, index, sub, data)
        self._rest, self._toggle = data, 0
        return struct.pack("<BHBI", 0x41, index, sub, len(data))

    def _segment(self, command: int) -> bytes:
        if command & 0x10 != self._toggle:
            raise Abort(0x0503_0000)
        part, self._rest = self._rest[:7], self._rest[7:]
        self._toggle ^= 0x10
        return struct.pack("<B7s", (command & 0x10) | (7 - len(part)) << 1 | (not self._rest), part)


class Made(NamedTuple):
    """What the dictionary says of this drive."""

    node_id: int
    rated_torque: float
    """[N·m]"""
    speed: float
    """Largest speed of the motor's shaft [turns/min]."""
    current: float
    """Largest current [A]."""
    window: float
    """Following error window [counts]."""
    braking: float
    """Quick stop deceleration of the motor's shaft [turns/min/s]."""
    pushed: bool
    """Whether it takes a torque offset."""
    braked: bool
    """Whether it has an output for a holding brake."""


def dictionary(made: Made) -> dict[Key, Entry]:
    """The objects of an EPOS4-like servo drive, as they are after power-up."""
    node, largest = made.node_id, 2**31 - 1
    objects = {
        (0x1000, 0): Entry(4, 0x0002_0192),
        (0x1001, 0): Entry(1, 0),
        (0x1005, 0): Entry(4, frames.SYNC),
        (0x1008, 0): Entry(0, b"bowden digital twin"),
        (0x1014, 0): Entry(4, frames.EMERGENCY + node),
        (0x1016, 0): Entry(1, 2),
        (0x1016, 1): Entry(4, 0, writable=True),
        (0x1016, 2): Entry(4, 0, writable=True),
        (0x1017, 0): Entry(2, 0, writable=True),
        (0x1018, 0): Entry(1, 4),
        (0x1018, 1): Entry(4, 0),
        (0x1018, 2): Entry(4, 1),
        (0x1018, 3): Entry(4, 1),
        (0x1018, 4): Entry(4, 1),
        (0x1029, 0): Entry(1, 1),
        (0x1029, 1): Entry(1, 0, writable=True),
        (0x3001, 2): Entry(4, math.ceil(1e3 * made.current)),
        (0x3160, 1): Entry(2, 0, signed=True),
        (0x3201, 1): Entry(2, 0, signed=True),
        (0x6007, 0): Entry(2, 1, writable=True, signed=True),
        (0x603F, 0): Entry(2, 0),
        (0x6040, 0): Entry(2, 0, writable=True),
        (0x6041, 0): Entry(2, 0),
        (0x605A, 0): Entry(2, 2, writable=True, signed=True),
        (0x605B, 0): Entry(2, 0, writable=True, signed=True),
        (0x605C, 0): Entry(2, 0, writable=True, signed=True),
        (0x605E, 0): Entry(2, 2, writable=True, signed=True),
        (0x6060, 0): Entry(1, 1, writable=True, signed=True),
        (0x6061, 0): Entry(1, 1, signed=True),
        (0x6064, 0): Entry(4, 0, signed=True),
        (0x6065, 0): Entry(4, round(made.window), writable=True),
        (0x6066, 0): Entry(2, 0, writable=True),
        (0x6076, 0): Entry(4, round(1e6 * made.rated_torque)),
        (0x6077, 0): Entry(2, 0, signed=True),
        (0x607A, 0): Entry(4, 0, writable=True, signed=True),
        (0x607D, 1): Entry(4, -largest - 1, writable=True, signed=True),
        (0x607D, 2): Entry(4, largest, writable=True, signed=True),
        (0x607F, 0): Entry(4, round(made.speed), writable=True),
        (0x6080, 0): Entry(4, round(made.speed), writable=True),
        (0x6085, 0): Entry(4, round(made.braking), writable=True),
        (0x60A9, 0): Entry(4, 0x00B4_4700, writable=True),
        (0x60C2, 1): Entry(1, 1, writable=True),
        (0x60C2, 2): Entry(1, -3, writable=True, signed=True),
        (0x60E4, 2): Entry(4, 0, signed=True),
        (0x60FD, 0): Entry(4, 0xFFFF_FFFF),
        (0x6502, 0): Entry(4, 0x3A5),
    }
    if made.pushed:
        objects[0x60B2, 0] = Entry(2, 0, writable=True, signed=True)
    if made.braked:
        objects |= {(0x60FE, 0): Entry(1, 2), **{(0x60FE, sub): Entry(4, 0, writable=True) for sub in (1, 2)}}
    for number in range(4):
        receive, transmit = frames.RPDO1 + 0x100 * number + node, frames.TPDO1 + 0x100 * number + node
        for index, cob_id in ((0x1400 + number, receive), (0x1800 + number, 0x4000_0000 | transmit)):
            objects[index, 1] = Entry(4, cob_id | (0x8000_0000 if number else 0), writable=True)
            objects[index, 2] = Entry(1, 255, writable=True)
            objects |= {(index + 0x200, sub): Entry(4 if sub else 1, 0, writable=True) for sub in range(9)}
    return objects


def overridden(entries: dict[Key, Entry], others: dict[Key, int | None]) -> dict[Key, Entry]:
    """Objects some of which have other values; None takes one away."""
    given = {key: value for key, value in others.items() if value is not None}
    changed = {key: entries.get(key, Entry(4, 0))._replace(value=value) for key, value in given.items()}
    return {key: entry for key, entry in (entries | changed).items() if others.get(key, 0) is not None}
