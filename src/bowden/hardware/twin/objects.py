"""The object dictionaries of CANopen twins, and what canopen's SDO server makes of them."""

import math
from collections.abc import Callable
from typing import NamedTuple

from canopen.sdo.exceptions import SdoAbortedError
from canopen.sdo.server import SdoServer

from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.drives.scale import Scale, SuitScale
from bowden.hardware.twin.plant import TwinPlant

Key = tuple[int, int]
"""Index and sub-index."""


class Entry(NamedTuple):
    """One object."""

    size: int
    """[bytes]; 0 for a text."""
    value: int | bytes
    writable: bool = False
    signed: bool = False


NO_OBJECT, NO_SUB, READ_ONLY, WRONG_LENGTH, NOT_MAPPABLE = (
    0x0602_0000,
    0x0609_0011,
    0x0601_0002,
    0x0607_0010,
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

    object_dictionary = None
    """Of canopen's nodes; its server asks for data alone."""

    def get_data(self, index: int, sub: int, check_readable: bool = False) -> bytes:
        """The bytes of an object, as SDO carries them."""
        key = index, sub
        entry = self._entries.get(key)
        if entry is None:
            raise SdoAbortedError(NO_SUB if any(index == key[0] for key in self._entries) else NO_OBJECT)
        value = self._current[key]() if key in self._current else self._values[key]
        if isinstance(value, bytes):
            return value
        return (value % (1 << 8 * entry.size)).to_bytes(entry.size, "little")

    def set_data(self, index: int, sub: int, data: bytes, check_writable: bool = False) -> None:
        """Write an object from the bus."""
        self.get_data(index, sub)
        entry = self._entries[index, sub]
        if not entry.writable:
            raise SdoAbortedError(READ_ONLY)
        if len(data) != entry.size:
            raise SdoAbortedError(WRONG_LENGTH)
        value = int.from_bytes(data, "little", signed=entry.signed)
        mapped = value and sub and index & ~0x3 in (0x1600, 0x1A00)
        if mapped and (value >> 16, value >> 8 & 0xFF) not in self._entries:
            raise SdoAbortedError(NOT_MAPPABLE)
        self._values[index, sub] = value
        self._changed((index, sub), value)


class SdoAnswers(SdoServer):
    """The answers of canopen's SDO server for these objects, without its network."""

    def __init__(self, objects: Objects) -> None:
        super().__init__(0, 0, objects)  # type: ignore[no-untyped-call] # canopen has none
        self._index, self._subindex, self._buffer = 0, 0, bytearray()
        self._said: bytes | None = None

    def send_response(self, response: bytes) -> None:
        """Keep it, where canopen sends it."""
        self._said = bytes(response)

    def answer(self, request: bytes) -> bytes | None:
        """The answer to a request; None to an abort, or to what is no request."""
        self._said = None
        if len(request) == 8:
            self.on_request(0, request, 0.0)  # type: ignore[no-untyped-call]
        return self._said


def identity(node_id: int, device_type: int, name: bytes) -> dict[Key, Entry]:
    """The objects by which a device says who it is, and its heartbeat's period, after power-up."""
    return {
        (0x1000, 0): Entry(4, device_type),
        (0x1001, 0): Entry(1, 0),
        (0x1005, 0): Entry(4, frames.SYNC),
        (0x1008, 0): Entry(0, name),
        (0x1014, 0): Entry(4, frames.EMERGENCY + node_id),
        (0x1017, 0): Entry(2, 0, writable=True),
        (0x1018, 0): Entry(1, 1),
        (0x1018, 1): Entry(4, 0),
    }


RPM = 30.0 / math.pi
"""Turns a minute in one rad/s."""
WINDOW = 2.0
"""Following error that the drive allows as it comes; one that was chosen for a rig allows what that asks for [rad]."""


def dictionary(
    drive: DriveParameters, bench: TwinPlant, scale: Scale | SuitScale, rated_torque: float
) -> dict[Key, Entry]:
    """The objects of an EPOS4-like servo drive, as they are after power-up.

    Args:
        drive: of the rig.
        bench: behind it.
        scale: of its motor.
        rated_torque: [N·m]
    """
    node, gear = drive.node_id, drive.needs.gear
    speed, lag = bench.speed_limit * gear * RPM, max(WINDOW, drive.needs.following_error)
    most, window = math.ceil(min(speed, 50e3)), lag * scale.steepest(-math.inf, math.inf) / abs(scale.step)
    largest = 2**31 - 1
    objects = identity(node, 0x0002_0192, b"bowden digital twin") | {
        (0x1016, 0): Entry(1, 2),
        (0x1016, 1): Entry(4, 0, writable=True),
        (0x1016, 2): Entry(4, 0, writable=True),
        (0x1018, 0): Entry(1, 4),
        (0x1018, 2): Entry(4, 1),
        (0x1018, 3): Entry(4, 1),
        (0x1018, 4): Entry(4, 1),
        (0x1029, 0): Entry(1, 1),
        (0x1029, 1): Entry(1, 0, writable=True),
        (0x3001, 2): Entry(4, math.ceil(1e3 * bench.current_limit)),
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
        (0x6065, 0): Entry(4, math.ceil(window), writable=True),
        (0x6066, 0): Entry(2, 0, writable=True),
        (0x6076, 0): Entry(4, round(1e6 * rated_torque)),
        (0x6077, 0): Entry(2, 0, signed=True),
        (0x607A, 0): Entry(4, 0, writable=True, signed=True),
        (0x607D, 1): Entry(4, -largest - 1, writable=True, signed=True),
        (0x607D, 2): Entry(4, largest, writable=True, signed=True),
        (0x607F, 0): Entry(4, most, writable=True),
        (0x6080, 0): Entry(4, most, writable=True),
        (0x6085, 0): Entry(4, round(min(bench.physics.braking * gear * RPM, 2**31)), writable=True),
        (0x60A9, 0): Entry(4, 0x00B4_4700, writable=True),
        (0x60C2, 1): Entry(1, 1, writable=True),
        (0x60C2, 2): Entry(1, -3, writable=True, signed=True),
        (0x60E4, 2): Entry(4, 0, signed=True),
        (0x60FD, 0): Entry(4, 0xFFFF_FFFF),
        (0x6502, 0): Entry(4, 0x3A5),
    }
    if bench.torque_offset is not None:
        objects[0x60B2, 0] = Entry(2, 0, writable=True, signed=True)
    if drive.brake_output != "none":
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
