"""What twins of CANopen sensors beside a drive have in common: NMT, heartbeat, SDO, TPDO 1 at SYNC or by a timer.

Source: CiA 301.
"""

import math

from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.objects import Objects, SdoAnswers
from bowden.hardware.twin.outbox import Outbox, Send


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
