"""The twins of CANopen sensors beside a drive: NMT, heartbeat, SDO, TPDO 1 at SYNC or by a timer (CiA 301).

They stand beside the drive's twin in the same process, with the plant and the faults of that one: a joint's encoder
(CiA 406), and a load cell (CiA 404), which may send plain frames too.
"""

import math
from collections.abc import Callable
from typing import Any

from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives import load_cell as cia404
from bowden.hardware.drives.joint_encoder import BY_TIMER
from bowden.hardware.drives.scale import Scale
from bowden.hardware.twin.faults import NO_NUMBER, Faults, Outbox, Send
from bowden.hardware.twin.objects import Entry, Key, Objects, SdoAnswers, identity, overridden
from bowden.hardware.twin.plant import TwinPlant, torque_on_joint
from bowden.rig.load_cell import LoadCellParameters


class SensorNode:
    """A device; what it measures and how long its timer is say `_measured` and `_timer`.

    Args:
        node_id: its number.
        silence: injection of the device itself in which it sends nothing.
        faults: those of the drive's twin.
        send: puts a frame on its bus.
        objects: its dictionary.
    """

    def __init__(self, node_id: int, silence: str, faults: Faults, send: Send, objects: Objects) -> None:
        self._node, self._silence, self._faults = node_id, silence, faults
        self._outbox = Outbox(send, faults)
        self._objects, self._sdo = objects, SdoAnswers(objects)
        self.nmt = frames.PRE_OPERATIONAL
        self._next_heartbeat = self._next_reading = -math.inf
        self._booted = False

    def _measured(self, now: float) -> bytes:
        """What TPDO 1 carries."""
        raise NotImplementedError  # always replaced

    def _timer(self) -> float:
        """Between two readings that it sends by itself; 0 where it does not [s]."""
        raise NotImplementedError  # always replaced

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """A frame from the bus."""
        if self._faults.active("deaf", now):
            return
        if cob_id == frames.SYNC and not data:
            if self._objects[0x1800, 2] == 1:
                self._transmit(now)
        elif cob_id == frames.SDO_REQUEST + self._node and self.nmt in (frames.OPERATIONAL, frames.PRE_OPERATIONAL):
            answer = self._sdo.answer(data)
            if answer is not None:
                self._emit(frames.SDO_ANSWER + self._node, answer, now)
        elif cob_id == frames.NMT and len(data) == 2 and data[1] in (0, self._node):
            self._obey(data[0])

    def tick(self, now: float) -> None:
        """Let time pass: boot-up frame, heartbeat, timer."""
        beat = frames.HEARTBEAT + self._node
        if not self._booted:
            self._booted = True
            self._emit(beat, bytes((frames.BOOT_UP,)), now)
        period = 1e-3 * self._objects[0x1017, 0]
        if period and now >= self._next_heartbeat:
            self._next_heartbeat = max(self._next_heartbeat + period, now)
            self._emit(beat, bytes((self.nmt,)), now)
        timer = self._timer()
        if timer and now >= self._next_reading:
            self._next_reading = max(self._next_reading + timer, now - timer)
            self._transmit(now)
        self._outbox.tick(now)

    def _transmit(self, now: float) -> None:
        if self.nmt == frames.OPERATIONAL and self._objects[0x1800, 1] >> 31 == 0:
            self._emit_cyclic(frames.TPDO1 + self._node, self._measured(now), now)

    def _emit(self, cob_id: int, data: bytes, now: float) -> None:
        if not self._faults.active(self._silence, now):
            self._outbox.emit(cob_id, data, now)

    def _emit_cyclic(self, cob_id: int, data: bytes, now: float) -> None:
        if not self._faults.active(self._silence, now):
            self._outbox.emit_cyclic(cob_id, data, now)

    def _obey(self, order: int) -> None:
        """NMT node control."""
        self.nmt = frames.STATE_AFTER.get(order, self.nmt)
        if order in (frames.NMT_RESET_NODE, frames.NMT_RESET_COMMUNICATION):
            self.nmt, self._booted = frames.PRE_OPERATIONAL, False


CELL_TYPE = 0x0002_0194
"""Profile 404, an analogue input."""
PERIOD = 1e-3
"""Between two plain frames [s]."""


class LoadCellNode(SensorNode):
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
        self._given, self._plant, self._now = given, plant, -math.inf
        self._slow_until = -math.inf  # for so long nothing is sent
        entries = overridden(_cell_objects(given), overrides or {})
        number = given.input
        changing: dict[Key, Callable[[], int]] = {
            (cia404.VALUE_32, number): lambda: self._counts(self._now)[0],
            (cia404.VALUE_16, number): lambda: self._counts(self._now)[0],
            (cia404.STATUS, number): lambda: self._counts(self._now)[1],
        }
        objects = Objects(entries, lambda key, value: None, {key: changing[key] for key in changing if key in entries})
        super().__init__(given.node_id, "load_silence", faults, send, objects)

    def _counts(self, now: float) -> tuple[int, int]:
        """What it measures, in counts, and its status."""
        given, plant = self._given, self._plant
        true = plant.tension if given.measures == "tension" else torque_on_joint(plant)
        value = self._faults.load(true, given.full_scale, now)
        low, high = given.ends
        counts = max(low, min(high, math.floor(given.counts(value) + 0.5)))
        at_end = abs(value) >= given.full_scale
        return counts, (cia404.OVERLOAD if (value > 0.0) is (given.scale > 0.0) else cia404.UNDERLOAD) if at_end else 0

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """A frame from the bus; one that sends plain frames takes none."""
        self._now = now
        if self._given.source == "cia404":
            super().receive(cob_id, data, now)

    def tick(self, now: float) -> None:
        """Let time pass; or the next plain frame."""
        self._now = now
        if self._given.source == "cia404":
            return super().tick(now)
        if now >= self._next_reading:
            self._next_reading = max(self._next_reading + PERIOD, now - PERIOD)
            given = self._given
            number = self._counts(now)[0].to_bytes(given.bytes, given.byte_order, signed=given.signed)
            identifier = given.identifier | EXTENDED * given.extended
            self._emit_cyclic(identifier, (bytes(given.first_byte) + number).ljust(8, b"\0"), now)
        self._outbox.tick(now)
        return None

    def _emit_cyclic(self, cob_id: int, data: bytes, now: float) -> None:
        slow = self._faults.active("load_slow", now)
        if slow and now < self._slow_until:
            return
        self._slow_until = now + 1.0 / slow.amount if slow else -math.inf
        if self._faults.active("load_half", now):
            data = data[: len(data) // 2]
        for _ in range(2 if self._faults.active("load_doubled", now) else 1):
            super()._emit_cyclic(cob_id, data, now)

    def _timer(self) -> float:
        return 1e-3 * self._objects[0x1800, 5] if self._objects[0x1800, 2] >= cia404.BY_TIMER - 1 else 0.0

    def _measured(self, now: float) -> bytes:
        """What is mapped, of which it knows its value and its status."""
        counts, status = self._counts(now)
        data = b""
        for i in range(self._objects[0x1A00, 0]):
            entry = self._objects[0x1A00, 1 + i]
            size = (entry & 0xFF) // 8
            value = status if entry >> 16 == cia404.STATUS else counts
            data += (value % (1 << 8 * size)).to_bytes(size, "little")
        return data


def _cell_objects(given: LoadCellParameters) -> dict[Key, Entry]:
    """The objects of a measuring device with one input after power-up."""
    node, number = given.node_id, given.input
    return identity(node, CELL_TYPE, b"bowden load cell twin") | {
        (cia404.UNIT, number): Entry(4, cia404.NEWTON << 16),
        (cia404.DIGITS, number): Entry(1, 2),
        (cia404.STATUS, number): Entry(1, 0),
        (cia404.VALUE_32, number): Entry(4, 0),
        (cia404.VALUE_16, number): Entry(2, 0),
        (0x1800, 1): Entry(4, 0x4000_0000 | frames.TPDO1 + node, writable=True),
        (0x1800, 2): Entry(1, cia404.BY_TIMER, writable=True),
        (0x1800, 3): Entry(2, 500, writable=True),
        (0x1800, 5): Entry(2, 0, writable=True),
        (0x1A00, 0): Entry(1, 1, writable=True),
        (0x1A00, 1): Entry(4, cia404.VALUE_16 << 16 | number << 8 | 16, writable=True),
        (0x1A00, 2): Entry(4, 0, writable=True),
    }


ENCODER_TYPE = 0x0002_0196
"""Profile 406, a multi-turn absolute rotary encoder."""
REVOLUTIONS = 4096
"""Turns that it counts, as usual devices of 12 bits do."""


class JointEncoderNode(SensorNode):
    """The device.

    Args:
        drive: beside which it is, whose parameters have its number, resolution and direction.
        joint: what it measures [rad].
        faults: those of the drive's twin, of which those of the joint are its own.
        send: puts a frame on the bus.
        overrides: objects that are otherwise than usual; None takes one away.
    """

    def __init__(
        self,
        drive: Any,
        joint: Callable[[], float],
        faults: Faults,
        send: Send,
        overrides: dict[Key, int | None] | None = None,
    ) -> None:
        self._joint = joint
        counts, node = int(drive.joint_counts_per_turn), drive.joint_node_id
        self._range = counts * REVOLUTIONS
        step = drive.joint_direction * 2.0 * math.pi / drive.joint_counts_per_turn
        self._scale = Scale(step, 0.0 if drive.home == "here" else drive.joint_home)
        entries = overridden(_encoder_objects(node, counts, self._range), overrides or {})
        objects = Objects(entries, lambda key, value: None, {(0x6004, 0): self._position})
        super().__init__(node, "joint_silence", faults, send, objects)

    def _timer(self) -> float:
        return 1e-3 * self._objects[0x6200, 0] if self._objects[0x1800, 2] >= BY_TIMER else 0.0

    def _measured(self, now: float) -> bytes:
        measured = self._faults.encoder("joint", self._scale.counts(self._joint()), abs(self._scale.step), now)
        value = 0xFFFF_FFFF if measured == NO_NUMBER else math.floor(measured + 0.5) % self._range
        return value.to_bytes(4, "little")

    def _position(self) -> int:
        return math.floor(self._scale.counts(self._joint()) + 0.5) % self._range


def _encoder_objects(node: int, counts: int, span: int) -> dict[Key, Entry]:
    """The objects of an absolute multi-turn encoder after power-up."""
    objects = identity(node, ENCODER_TYPE, b"bowden joint encoder twin") | {
        (0x6000, 0): Entry(2, 0, writable=True),
        (0x6001, 0): Entry(4, counts, writable=True),
        (0x6002, 0): Entry(4, span, writable=True),
        (0x6004, 0): Entry(4, 0),
        (0x6200, 0): Entry(2, 0, writable=True),
        (0x6501, 0): Entry(4, counts),
        (0x6502, 0): Entry(2, REVOLUTIONS),
        (0x6503, 0): Entry(2, 0),
    }
    for number in range(2):
        objects[0x1800 + number, 1] = Entry(4, 0x4000_0000 | frames.TPDO1 + 0x100 * number + node, writable=True)
        objects[0x1800 + number, 2] = Entry(1, BY_TIMER if number == 0 else 1, writable=True)
        objects |= {(0x1A00 + number, sub): Entry(4 if sub else 1, 0, writable=True) for sub in range(2)}
        objects[0x1A00 + number, 0] = Entry(1, 1, writable=True)
        objects[0x1A00 + number, 1] = Entry(4, 0x6004_0020, writable=True)
    return objects
