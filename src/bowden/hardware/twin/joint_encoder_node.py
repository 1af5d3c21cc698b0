"""The twin of a joint's encoder that is a CANopen device of its own (CiA 406): NMT, heartbeat, SDO, TPDO 1.

It stands beside the drive's twin in the same process and on the same bus, with the joint of the same plant. Its faults
are the injections of the joint's encoder, and `joint_silence`.
"""

import math
from collections.abc import Callable

from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.joint_encoder import BY_TIMER, JointEncoderParameters
from bowden.hardware.drives.scale import Scale
from bowden.hardware.twin.faults import NO_NUMBER, Faults
from bowden.hardware.twin.node import Send
from bowden.hardware.twin.objects import Entry, Key, Objects, SdoServer, overridden
from bowden.hardware.twin.outbox import Outbox

DEVICE_TYPE = 0x0002_0196
"""Profile 406, a multi-turn absolute rotary encoder."""
REVOLUTIONS = 4096
"""Turns that it counts, as usual devices of 12 bits do."""


class JointEncoderNode:
    """The device.

    Args:
        given: number, resolution and direction, as the rig has them.
        joint: what it measures [rad].
        faults: those of the drive's twin, of which those of the joint are its own.
        send: puts a frame on the bus.
        overrides: objects that are otherwise than usual; None takes one away.
    """

    def __init__(
        self,
        given: JointEncoderParameters,
        joint: Callable[[], float],
        faults: Faults,
        send: Send,
        overrides: dict[Key, int | None] | None = None,
    ) -> None:
        self._given, self._joint, self._faults = given, joint, faults
        self._outbox = Outbox(send, faults)
        self._counts = int(given.counts_per_turn)
        self._range = self._counts * REVOLUTIONS
        step = given.direction * 2.0 * math.pi / given.counts_per_turn
        self._scale = Scale(step, 0.0 if given.here else given.home)
        self.nmt = frames.PRE_OPERATIONAL
        self._next_heartbeat = self._next_reading = -math.inf
        self._booted = False
        entries = overridden(_dictionary(given, self._counts, self._range), overrides or {})
        self._objects = Objects(entries, lambda key, value: None, {(0x6004, 0): self._position})
        self._sdo = SdoServer(self._objects)

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """A frame from the bus."""
        node = self._given.node_id
        if self._faults.active("deaf", now):
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
        """Let time pass: boot-up frame, heartbeat, timer."""
        beat = frames.HEARTBEAT + self._given.node_id
        if not self._booted:
            self._booted = True
            self._emit(beat, bytes((frames.BOOT_UP,)), now)
        period = 1e-3 * self._objects[0x1017, 0]
        if period and now >= self._next_heartbeat:
            self._next_heartbeat = max(self._next_heartbeat + period, now)
            self._emit(beat, bytes((self.nmt,)), now)
        timer = 1e-3 * self._objects[0x6200, 0]
        if timer and self._objects[0x1800, 2] >= BY_TIMER and now >= self._next_reading:
            self._next_reading = max(self._next_reading + timer, now - timer)
            self._transmit(now)
        self._outbox.tick(now)

    def _transmit(self, now: float) -> None:
        if self.nmt == frames.OPERATIONAL and self._objects[0x1800, 1] >> 31 == 0:
            measured = self._faults.encoder("joint", self._scale.counts(self._joint()), abs(self._scale.step), now)
            value = 0xFFFF_FFFF if measured == NO_NUMBER else math.floor(measured + 0.5) % self._range
            if not self._faults.active("joint_silence", now):
                self._outbox.emit_cyclic(frames.TPDO1 + self._given.node_id, value.to_bytes(4, "little"), now)

    def _position(self) -> int:
        return math.floor(self._scale.counts(self._joint()) + 0.5) % self._range

    def _emit(self, cob_id: int, data: bytes, now: float) -> None:
        if not self._faults.active("joint_silence", now):
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


def _dictionary(given: JointEncoderParameters, counts: int, span: int) -> dict[Key, Entry]:
    """The objects of an absolute multi-turn encoder after power-up."""
    node = given.node_id
    objects = {
        (0x1000, 0): Entry(4, DEVICE_TYPE),
        (0x1001, 0): Entry(1, 0),
        (0x1005, 0): Entry(4, frames.SYNC),
        (0x1008, 0): Entry(0, b"bowden joint encoder twin"),
        (0x1014, 0): Entry(4, frames.EMERGENCY + node),
        (0x1017, 0): Entry(2, 0, writable=True),
        (0x1018, 0): Entry(1, 1),
        (0x1018, 1): Entry(4, 0),
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
