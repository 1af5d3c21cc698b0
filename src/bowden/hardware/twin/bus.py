"""The twin in this process and at a time of one's own, for tests: a bus in memory with the twin at its other end."""

import threading
import time
from collections import deque
from collections.abc import Callable

import can

from bowden.hardware.drives.parameters import DriveParameters
from bowden.hardware.twin.canopen_node import CanopenNode
from bowden.hardware.twin.objects import Key
from bowden.hardware.twin.plant import TwinPlant

TICK = 1e-3
"""Of the twin's own time, and how far a wait for a frame moves it at least [s]."""


class TwinBus(can.BusABC):
    """A bus with a twin on it; give it to `CanopenDrive`. Time stands still but for `advance` and waiting for frames.

    Args:
        drive: of the twin.
        make_bench: makes what is behind it, for a time [s].
        overrides: see `CanopenNode`.
    """

    def __init__(
        self,
        drive: DriveParameters,
        make_bench: Callable[[float], TwinPlant],
        overrides: dict[Key, int | None] | None = None,
    ) -> None:
        self.time = 100.0
        """[s]"""
        self.journal: list[tuple[float, str, str]] = []
        """Time, event, detail."""
        self._frames: deque[can.Message] = deque()
        self._lock = threading.RLock()  # the library that brings a drive up has a thread
        self._still = threading.Event()
        self.node = CanopenNode(drive, make_bench(self.time), self._take, self._note, overrides)
        self.channel_info = "twin in memory"
        super().__init__(channel="twin")
        self.advance(TICK)

    def _take(self, cob_id: int, data: bytes) -> None:
        if not (self.node.faults.active("bus_off", self.time) or self.node.faults.active("queue_full", self.time)):
            self._frames.append(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def _note(self, time: float, event: str, detail: str) -> None:
        self.journal.append((time, event, detail))

    def advance(self, span: float) -> None:
        """Let `span` [s] pass for the twin, in ticks."""
        with self._lock:
            for _ in range(max(1, round(span / TICK))):
                self.time += min(span, TICK)
                self.node.tick(self.time)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Hand a frame to the twin.

        Raises:
            can.CanOperationError: the twin is bus-off, and there is no other node; or the host's queue is full.
        """
        with self._lock:
            if self.node.faults.off_bus(self.time):
                raise can.CanOperationError("no other node on the bus acknowledges")
            if not self.node.faults.swallows(self.time):
                self.node.receive(msg.arbitration_id, bytes(msg.data), self.time)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._frames and timeout != 0.0:
            begin = time.monotonic()
            self._still.wait(1e-4)  # for the library's other thread
            self.advance(max(TICK, time.monotonic() - begin))  # whoever waits meanwhile does so by the clock
        with self._lock:
            return (self._frames.popleft() if self._frames else None), False
