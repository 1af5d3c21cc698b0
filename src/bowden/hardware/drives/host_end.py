"""A host's end of the bus of one drive, of any family on CAN: joined at the first bring-up, left when one fails."""

import contextlib
from collections.abc import Callable, Iterator
from typing import TypeVar

import can

from bowden.hardware.buses.link import BusPlace, BusPort, Frame, Links
from bowden.hardware.buses.unix_bus import ERROR, REMOTE
from bowden.hardware.ports import TorqueLeft

MOST_FRAMES = 64
"""Frames that one cycle reads at most, so that a flood on the bus cannot hold the loop."""
CLOSING_CYCLES = 20
"""How often the power is told to go off at the end, `CLOSING_WAIT` apart, while the drive has not said that it is."""
CLOSING_WAIT = 2e-3
"""[s]"""

Found = TypeVar("Found")


class HostEnd:
    """The bus as one drive's host has it.

    Args:
        place: of the bus.
        node: the drive's number there.
        links: the buses of this process; of its own where none are given.
        concerns: whether a frame with this identifier, without its flags, is the drive's or its host's.
        synced: whether something for the whole bus is sent in each cycle, see `BusPort.sync`.
        restore: see `BusPort.disturbed`.
    """

    def __init__(
        self,
        place: BusPlace,
        node: int,
        links: Links | None,
        concerns: Callable[[int], bool],
        *,
        synced: bool = False,
        restore: Callable[[], None] | None = None,
    ) -> None:
        self._place, self._node, self._links = place, f"node {node}", links or Links()
        self._concerns, self._synced, self._restore = concerns, synced, restore
        self._port: BusPort | None = None
        self._errors = 0

    @property
    def bus(self) -> can.BusABC | None:
        """The bus, while it is joined."""
        return None if self._port is None else self._port.bus

    @property
    def errors(self) -> float:
        """Error frames, and frames that could not be sent or read."""
        return float(self._errors + (self._port.errors if self._port else 0))

    def bring_up(self, find: Callable[[BusPort], Found]) -> Found:
        """What `find` makes of the bus; it is left if that fails. May be called again.

        Raises:
            DriveError: the bus cannot be joined, or what `find` raises.
        """
        if self._port is None:
            join = self._links.join
            self._port = join(self._place, self._node, self._wants, synced=self._synced, restore=self._restore)
        else:
            self.drain()
        try:
            return find(self._port)
        except BaseException:
            self.leave()
            raise

    def _wants(self, identifier: int) -> bool:
        return bool(identifier & ERROR) or self._concerns(identifier & ~REMOTE)

    def take_all(self) -> list[Frame]:
        """The frames that are there, with the flags of `buses.unix_bus`, and no more than a cycle may read; error
        frames are counted and left out.
        """
        found = [] if self._port is None else self._port.take_all()
        for frame in found:
            if frame[0] & ERROR:
                self._errors += sum(bool(one[0] & ERROR) for one in found)
                return [one for one in found if not one[0] & ERROR]
        return found

    def wait_for(self, identifier: int, timeout: float) -> bytes | None:
        """The data of the next frame with an identifier; None where it does not come within `timeout` [s]."""
        frame = self._port.wait_for(lambda found, _: found == identifier, timeout) if self._port else None
        return None if frame is None else frame[1]

    def drain(self) -> None:
        """Take what has come up to now, and forget it."""
        for _ in range(MOST_FRAMES):
            if self._port is None or self._port.take() is None:
                return

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame, see `buses.opening.putter`; what cannot be sent is counted."""
        if self._port is not None:
            self._port.send(identifier, data)

    def sync(self, identifier: int) -> None:
        """Send a frame for the whole bus, see `BusPort.sync`."""
        if self._port is not None:
            self._port.sync(identifier)

    def power_off(self, tell: Callable[[int], None], torque: Callable[[int, bytes], bool | None]) -> TorqueLeft:
        """Tell the drive to take its torque off until it says that it has none, and what it said.

        What it says of the time before the second order does not count. The bus stays as it is.

        Args:
            tell: sends the order, of which it is given the number.
            torque: what a frame says of the torque; None of one that says nothing of it.
        """
        port = self._port
        if port is None:
            return TorqueLeft.OFF
        port.synced, left = False, TorqueLeft.UNKNOWN
        self.drain()
        for k in range(CLOSING_CYCLES):
            tell(k)
            frame = port.wait_for(lambda identifier, data: torque(identifier, data) is not None, CLOSING_WAIT)
            if frame is not None and k > 0:
                left = TorqueLeft.ON if torque(*frame) else TorqueLeft.OFF
            if left is TorqueLeft.OFF:
                break
        return left

    def leave(self) -> None:
        """Let go of the bus; safe to call twice."""
        if self._port is not None:
            self._errors += self._port.errors
            self._port.leave()
        self._port = None


@contextlib.contextmanager
def joined(place: BusPlace, node: int, links: Links) -> Iterator[BusPort]:
    """A bus while somebody looks at who is on it.

    Raises:
        DriveError: it cannot be joined.
    """
    port = links.join(place, f"node {node}", lambda _: True)
    try:
        yield port
    finally:
        port.leave()


def classic_frame(identifier: int, length: int, *, remote: bool = False) -> can.Message:
    """A frame of classic CAN, to be filled; `remote` asks for one."""
    if remote:
        return can.Message(arbitration_id=identifier, is_extended_id=False, is_remote_frame=True, dlc=length)
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=bytes(length))
