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
)
from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.objects import Entry, Key, Objects, identity, overridden
from bowden.hardware.twin.outbox import Send
from bowden.hardware.twin.plant import TwinPlant, torque_on_joint
from bowden.hardware.twin.sensor_node import SensorNode
from bowden.rig.load_cell import LoadCellParameters

DEVICE_TYPE = 0x0002_0194
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
        entries = overridden(_dictionary(given), overrides or {})
        number = given.input
        changing: dict[Key, Callable[[], int]] = {
            (VALUE_32, number): lambda: self._counts(self._now)[0],
            (VALUE_16, number): lambda: self._counts(self._now)[0],
            (STATUS, number): lambda: self._counts(self._now)[1],
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
        return counts, (OVERLOAD if (value > 0.0) is (given.scale > 0.0) else UNDERLOAD) if at_end else 0

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
        return 1e-3 * self._objects[0x1800, 5] if self._objects[0x1800, 2] >= BY_TIMER - 1 else 0.0

    def _measured(self, now: float) -> bytes:
        """What is mapped, of which it knows its value and its status."""
        counts, status = self._counts(now)
        data = b""
        for i in range(self._objects[0x1A00, 0]):
            entry = self._objects[0x1A00, 1 + i]
            size = (entry & 0xFF) // 8
            value = status if entry >> 16 == STATUS else counts
            data += (value % (1 << 8 * size)).to_bytes(size, "little")
        return data


def _dictionary(given: LoadCellParameters) -> dict[Key, Entry]:
    """The objects of a measuring device with one input after power-up."""
    node, number = given.node_id, given.input
    return identity(node, DEVICE_TYPE, b"bowden load cell twin") | {
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
