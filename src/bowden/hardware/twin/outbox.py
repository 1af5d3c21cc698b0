"""What a twin's drive sends, with the faults of the bus: it says nothing, loses frames, or is late."""

from collections import deque
from collections.abc import Callable

from bowden.hardware.buses.unix_bus import ERROR
from bowden.hardware.twin.faults import Faults

Send = Callable[[int, bytes], None]
"""Puts a frame on the bus: identifier, with the flags of `buses.unix_bus`, and data."""

BIT_ERROR = 0x08
"""Error class of an error frame: violation in the protocol (Linux, `linux/can/error.h`, CAN_ERR_PROT)."""


class Outbox:
    """Where a node's frames go out.

    Args:
        send: puts a frame on the bus.
        faults: of the drive.
    """

    def __init__(self, send: Send, faults: Faults) -> None:
        self._send, self._faults = send, faults
        self._waiting: deque[tuple[float, int, bytes]] = deque()

    def emit(self, identifier: int, data: bytes, now: float) -> None:
        """A frame that comes when something happens: an answer, a heartbeat, an emergency."""
        if not self._faults.active("silence", now):
            self._put(identifier, data, now)

    def emit_cyclic(self, identifier: int, data: bytes, now: float) -> None:
        """A frame with readings, of every cycle; those alone are lost or late."""
        if self._faults.active("silence", now) or self._faults.drops_pdo(now):
            return
        late, short = self._faults.active("late_pdos", now), self._faults.active("short_frames", now)
        data = data[: int(short.amount)] if short else data
        if late:
            self._waiting.append((now + 1e-3 * late.amount, identifier, data))
        else:
            self._put(identifier, data, now)

    def _put(self, identifier: int, data: bytes, now: float) -> None:
        if self._faults.destroys(now):
            identifier, data = ERROR | BIT_ERROR, bytes(8)
        self._send(identifier, data)

    def tick(self, now: float) -> None:
        """Send what has waited long enough."""
        while self._waiting and self._waiting[0][0] <= now:
            _, identifier, data = self._waiting.popleft()
            self._put(identifier, data, now)
