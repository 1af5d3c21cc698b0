"""The twin of a load cell that is a device of its own: a CiA 404 measuring device, or one that sends plain frames.

It stands beside the drive's twin in the same process, with the cable or the joint of the same plant. Its faults are
the injections of the load cell.
"""

import math
from collections.abc import Callable

from bowden.hardware.buses.unix_bus import EXTENDED
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.load_cell import (
    BY_TIMER,
    DIGITS,
    NEWTON,
    OVERLOAD,
    STATUS,
    UNDERLOAD,
    UNIT,
    VALUE_16,
    VALUE_32,
    LoadCellParameters,
)
from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.node import Send
from bowden.hardware.twin.objects import Entry, Key, Objects, SdoServer, overridden
from bowden.hardware.twin.outbox import Outbox
from bowden.hardware.twin.plant import TwinPlant, torque_on_joint

DEVICE_TYPE = 0x0002_0194
"""Profile 404, an analogue input."""
PERIOD = 1e-3
"""Between two plain frames [s]."""


class LoadCellNode:
    """The device.

    Args:
        given: as the rig has it.
        plant: whose load it measures.
        faults: those of the drive's twin, of which those of the load cell are its own.
        send: puts a frame on its bus.
        overrides: objects that are otherwise than usual; None takes one away.
    """

    def __init__(
        self,
        given: LoadCellParameters,
        plant: TwinPlant,
        faults: Faults,
        send: Send,
        overrides: dict[Key, int | None] | None = None,
    ) -> None:
        self._given, self._plant, self._faults = given, plant, faults
        self._outbox = Outbox(send, faults)
        self.nmt = frames.PRE_OPERATIONAL
        self._next_heartbeat = self._next_reading = -math.inf
        self._booted, self._now = False, -math.inf
        entries = overridden(_dictionary(given), overrides or {})
        number = given.input
        changing: dict[Key, Callable[[], int]] = {
            (VALUE_32, number): lambda: self._counts(self._now)[0],
            (VALUE_16, number): lambda: self._counts(self._now)[0],
            (STATUS, number): lambda: self._counts(self._now)[1],
        }
        self._objects = Objects(
            entries, lambda key, value: None, {key: changing[key] for key in changing if key in entries}
        )
        self._sdo = SdoServer(self._objects)

    def _counts(self, now: float) -> tuple[int, int]:
        """What it measures, in counts, and its status."""
        given, plant = self._given, self._plant
        true = plant.tension if given.measures == "tension" else torque_on_joint(plant)
        value = self._faults.load(true, given.full_scale, now)
        low, high = given.ends
        counts = max(low, min(high, math.floor(given.counts(value) + 0.5)))
        at_end = abs(value) >= given.full_scale
        return counts, (OVERLOAD if (value > 0.0) is (given.scale > 0.0) else UNDERLOAD) if at_end else 0

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """A frame from the bus."""
        self._now = now
        node = self._given.node_id
        if self._given.source != "cia404" or self._faults.active("deaf", now):
            return
        if cob_id == frames.SYNC and not data:
            if self._objects[0x1800, 2] == 1:
                self._transmit(now)
        elif cob_id == frames.SDO_REQUEST + node and self.nmt in (frames.OPERATIONAL, frames.PRE_OPERATIONAL):
            answer = self._sdo.answer(data)
            if answer is not None:
                self._emit(frames.SDO_ANSWER + node, answer, now)
        elif cob_id == frames.NMT and len(data) == 2 and data[1] in (0, node):
            self._obey(data[0])

    def tick(self, now: float) -> None:
        """Let time pass: boot-up frame, heartbeat, timer; or the next plain frame."""
        self._now = now
        if self._given.source == "can":
            if now >= self._next_reading:
                self._next_reading = max(self._next_reading + PERIOD, now - PERIOD)
                self._send_plain(now)
        else:
            self._tick_node(now)
        self._outbox.tick(now)

    def _tick_node(self, now: float) -> None:
        beat = frames.HEARTBEAT + self._given.node_id
        if not self._booted:
            self._booted = True
            self._emit(beat, bytes((frames.BOOT_UP,)), now)
        period = 1e-3 * self._objects[0x1017, 0]
        if period and now >= self._next_heartbeat:
            self._next_heartbeat = max(self._next_heartbeat + period, now)
            self._emit(beat, bytes((self.nmt,)), now)
        timer = 1e-3 * self._objects[0x1800, 5]
        if timer and self._objects[0x1800, 2] >= BY_TIMER - 1 and now >= self._next_reading:
            self._next_reading = max(self._next_reading + timer, now - timer)
            self._transmit(now)

    def _send_plain(self, now: float) -> None:
        given = self._given
        if not self._faults.active("load_silence", now):
            number = self._counts(now)[0].to_bytes(given.bytes, given.byte_order, signed=given.signed)
            identifier = given.identifier | EXTENDED * given.extended
            self._outbox.emit_cyclic(identifier, (bytes(given.first_byte) + number).ljust(8, b"\0"), now)

    def _transmit(self, now: float) -> None:
        """TPDO 1: what is mapped, of which it knows its value and its status."""
        if self.nmt != frames.OPERATIONAL or self._objects[0x1800, 1] >> 31 or self._faults.active("load_silence", now):
            return
        counts, status = self._counts(now)
        data = b""
        for i in range(self._objects[0x1A00, 0]):
            entry = self._objects[0x1A00, 1 + i]
            size = (entry & 0xFF) // 8
            value = status if entry >> 16 == STATUS else counts
            data += (value % (1 << 8 * size)).to_bytes(size, "little")
        self._outbox.emit_cyclic(frames.TPDO1 + self._given.node_id, data, now)

    def _emit(self, cob_id: int, data: bytes, now: float) -> None:
        if not self._faults.active("load_silence", now):
            self._outbox.emit(cob_id, data, now)

    def _obey(self, order: int) -> None:
        """NMT node control."""
        if order in (frames.NMT_RESET_NODE, frames.NMT_RESET_COMMUNICATION):
            self._booted = False
        self.nmt = {
            frames.NMT_START: frames.OPERATIONAL,
            frames.NMT_STOP: frames.STOPPED,
            frames.NMT_PRE_OPERATIONAL: frames.PRE_OPERATIONAL,
            frames.NMT_RESET_NODE: frames.PRE_OPERATIONAL,
            frames.NMT_RESET_COMMUNICATION: frames.PRE_OPERATIONAL,
        }.get(order, self.nmt)


def _dictionary(given: LoadCellParameters) -> dict[Key, Entry]:
    """The objects of a measuring device with one input after power-up."""
    node, number = given.node_id, given.input
    objects = {
        (0x1000, 0): Entry(4, DEVICE_TYPE),
        (0x1001, 0): Entry(1, 0),
        (0x1005, 0): Entry(4, frames.SYNC),
        (0x1008, 0): Entry(0, b"bowden load cell twin"),
        (0x1014, 0): Entry(4, frames.EMERGENCY + node),
        (0x1017, 0): Entry(2, 0, writable=True),
        (0x1018, 0): Entry(1, 1),
        (0x1018, 1): Entry(4, 0),
        (UNIT, number): Entry(4, NEWTON << 16),
        (DIGITS, number): Entry(1, 2),
        (STATUS, number): Entry(1, 0),
        (VALUE_32, number): Entry(4, 0),
        (VALUE_16, number): Entry(2, 0),
        (0x1800, 1): Entry(4, 0x4000_0000 | frames.TPDO1 + node, writable=True),
        (0x1800, 2): Entry(1, BY_TIMER, writable=True),
        (0x1800, 3): Entry(2, 500, writable=True),
        (0x1800, 5): Entry(2, 0, writable=True),
        (0x1A00, 0): Entry(1, 1, writable=True),
        (0x1A00, 1): Entry(4, VALUE_16 << 16 | number << 8 | 16, writable=True),
        (0x1A00, 2): Entry(4, 0, writable=True),
    }
    return objects
