"""The twin of a joint's encoder that is a CANopen device of its own (CiA 406): NMT, heartbeat, SDO, TPDO 1.

It stands beside the drive's twin in the same process and on the same bus, with the joint of the same plant. Its faults
are the injections of the joint's encoder, and `joint_silence`.
"""

import math
from collections.abc import Callable
from typing import Any

from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.joint_encoder import BY_TIMER
from bowden.hardware.drives.scale import Scale
from bowden.hardware.twin.faults import NO_NUMBER, Faults
from bowden.hardware.twin.objects import Entry, Key, Objects, identity, overridden
from bowden.hardware.twin.outbox import Send
from bowden.hardware.twin.sensor_node import SensorNode

DEVICE_TYPE = 0x0002_0196
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
        entries = overridden(_dictionary(node, counts, self._range), overrides or {})
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


def _dictionary(node: int, counts: int, span: int) -> dict[Key, Entry]:
    """The objects of an absolute multi-turn encoder after power-up."""
    objects = identity(node, DEVICE_TYPE, b"bowden joint encoder twin") | {
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
