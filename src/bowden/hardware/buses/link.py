"""One bus of this process: claimed and opened once, shared by the drives on it, read without waiting."""

import contextlib
from collections import deque
from collections.abc import Callable, Sequence

import can

from bowden.core.clock import MonotonicClock, TimeSource
from bowden.core.errors import DriveError
from bowden.hardware.buses.opening import Frame, claim, open_bus, putter, quieten, received, taker
from bowden.hardware.buses.place import ERROR, REMOTE, BusPlace


def _speeds(place: BusPlace) -> str:
    return f"{place.bitrate} bit/s" + (f" and {place.data_bitrate} bit/s for data (CAN-FD)" if place.fd else "")


class Links:
    """The buses of this process, each opened by the first drive that joins it and let go of by the last.

    Args:
        given: an open bus in place of any that would be opened; it stays open, and is not claimed. For tests.
        clock: by which bring-up waits.
    """

    def __init__(self, given: can.BusABC | None = None, clock: TimeSource | None = None) -> None:
        self._given, self.clock = given, MonotonicClock() if clock is None else clock
        self._links: dict[tuple[str, str], BusLink] = {}

    def join(
        self,
        place: BusPlace,
        node: str,
        wanted: Callable[[int], bool],
        *,
        synced: bool = False,
        restore: Callable[[], None] | None = None,
    ) -> "BusPort":
        """Join a bus as the host of one node; its end of the bus is a context manager, which leaves.

        Args:
            place: of the bus.
            node: which one, for messages: ``node 1``.
            wanted: whether a frame with this identifier and these flags is for this node's host.
            synced: whether it sends something for the whole bus in each cycle, see `BusPort.sync`.
            restore: called when another drive on the bus has been brought up, see `BusPort.disturbed`.

        Raises:
            DriveError: the bus cannot be opened, another process is its host, this process has that node already, or
                has that bus open at other bit rates.
        """
        link = self._links.get(place[:2])
        if link is None:
            link = BusLink(place, self._given)
            self._links[place[:2]] = link
        elif link.place != place:
            raise DriveError(
                f"two drives of this rig want the bus {place.channel} otherwise: {_speeds(link.place)}, "
                f"{_speeds(place)}",
                expected="one of classic CAN or of CAN-FD, at one bit rate: nodes of classic CAN destroy frames of "
                "CAN-FD",
                do="give each a bus of its own, or correct the bit rates in [drive]",
            )
        try:
            link.check(node)
        except BaseException:
            if not link.ports:
                link.close()
                self._links.pop(place[:2], None)
            raise
        port = BusPort(link, node, wanted, self.clock, lambda: self._links.pop(place[:2], None))
        port.synced, port.restore = synced, restore
        link.ports.append(port)
        link.forget()
        return port


class BusLink:
    """An open bus and those who have joined it.

    Args:
        place: of the bus.
        given: see `Links`.

    Raises:
        DriveError: it cannot be opened, or has a host already.
    """

    def __init__(self, place: BusPlace, given: can.BusABC | None = None) -> None:
        quieten()
        self.place, self._given = place, given
        self._claim = None if given is not None else claim(place.interface, place.channel, "host")
        try:
            self.bus = given if given is not None else open_bus(place)
            self._take, self.put = taker(self.bus), putter(self.bus, fd=place.fd)
        except BaseException:
            if self._claim is not None:
                self._claim.close()
            raise
        self.ports: list[BusPort] = []
        self.errors = 0
        """Frames that could not be sent or read since it was opened."""
        self._synced = 0
        self._writes: dict[bytes, bytes] = {}
        self._asks: dict[bytes, bytes] = {}
        self._whose: dict[int, tuple[BusPort, ...]] = {}
        """Identifier → whose frames those are."""

    def check(self, node: str) -> None:
        """Refuse a node that is there already; see `Links.join`."""
        if any(port.node == node for port in self.ports):
            raise DriveError(
                f"two drives of this rig are {node} of the bus {self.place.channel}",
                expected="a number of its own for each",
                do="correct one of them in the rig's [drive]",
            )

    def forget(self) -> None:
        """Whose frames are whose: the ports are others."""
        self._whose.clear()

    def wanting(self, identifier: int) -> "tuple[BusPort, ...]":
        """The ports that want frames with this identifier and these flags."""
        ports = self._whose.get(identifier)
        if ports is None:
            if len(self._whose) >= _MOST_KNOWN:
                self._whose.clear()
            ports = self._whose[identifier] = tuple(port for port in self.ports if port._wanted(identifier))
        return ports

    def take_all(self, most: int) -> list[Frame]:
        """What is there, `most` frames of it; never waits, never raises."""
        found, take = list[Frame](), self._take
        try:
            for _ in range(most):
                frame = take()
                if frame is None:
                    break
                found.append(frame)
        except (can.CanError, OSError):
            self.errors += 1
        return found

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame, see `opening.putter`; never raises: what cannot be sent is counted."""
        try:
            self.put(identifier, data)
        except (can.CanError, OSError):
            self.errors += 1

    def sync(self, identifier: int) -> None:
        """Send a frame for the whole bus once all whose frames it follows have asked for it in this cycle."""
        self._synced += 1
        if self._synced >= sum(port.synced for port in self.ports):
            self._synced = 0
            self.send(identifier, b"")

    def gather(self, identifier: int, writes: Sequence[tuple[bytes, bytes]], ask: tuple[bytes, bytes]) -> None:
        """Keep what a drive writes in a cycle, and whom it asks; once the last one has, send a frame for each head.

        Args:
            identifier: of the frames.
            writes: head of a frame, and this drive's part of it.
            ask: the same of a question, which goes out last.
        """
        for head, part in writes:
            self._writes[head] = self._writes.get(head, b"") + part
        self._asks[ask[0]] = self._asks.get(ask[0], b"") + ask[1]
        self._synced += 1
        if self._synced >= sum(port.synced for port in self.ports):
            for head, parts in (*self._writes.items(), *self._asks.items()):
                self.send(identifier, head + parts)
            self._synced, self._writes, self._asks = 0, {}, {}

    def close(self) -> None:
        """Leave the bus."""
        if self._given is None:
            self.bus.shutdown()
        if self._claim is not None:
            self._claim.close()
            self._claim = None


class BusPort:
    """One drive's end of a link."""

    def __init__(
        self,
        link: BusLink,
        node: str,
        wanted: Callable[[int], bool],
        clock: TimeSource,
        emptied: Callable[[], object],
    ) -> None:
        self.node, self.clock, self.synced = node, clock, False
        """Whether what it sends for the whole bus waits for the others who do so; False while it is let go of alone."""
        self.restore: Callable[[], None] | None = None
        self._link, self._wanted, self._emptied = link, wanted, emptied
        self.send, self.gather = link.send, link.gather
        self._frames: deque[Frame] = deque(maxlen=_MOST_WAITING)

    def __enter__(self) -> "BusPort":
        return self

    def __exit__(self, *_: object) -> None:
        self.leave()

    @property
    def errors(self) -> int:
        """Frames that could not be sent or read on this bus."""
        return self._link.errors

    def take_all(self) -> list[Frame]:
        """The frames for this drive that are there, not more than a cycle may read; never waits, never raises."""
        link = self._link
        if len(link.ports) == 1:
            return link.take_all(_MOST_WAITING)
        for frame in link.take_all(_MOST_WAITING):
            for port in link.wanting(frame[0]):
                port._frames.append(frame)
        found = list(self._frames)
        self._frames.clear()
        return found

    def send_now(self, identifier: int, data: bytes) -> None:
        """Send a frame at bring-up.

        Raises:
            DriveError: nobody else is on the bus.
        """
        try:
            self._link.put(identifier, data)
        except (can.CanError, OSError) as error:
            raise DriveError(
                f"no other device is on the bus: {error}",
                do="switch the drive on, or start bowden twin; check the cable and its termination",
            ) from error

    def sync(self, identifier: int) -> None:
        """Send an empty frame for the whole bus, CANopen's SYNC: after what all others on it send in this cycle."""
        if self.synced and len(self._link.ports) > 1:
            self._link.sync(identifier)
        else:
            self.send(identifier, b"")

    def disturbed(self) -> None:
        """What this drive's bring-up sent for the whole bus has reached the others too: each restores itself."""
        for port in self._link.ports:
            if port is not self and port.restore is not None:
                port.restore()

    def wait_for(self, matches: Callable[[int, bytes], bool], timeout: float) -> Frame | None:
        """The next frame that matches, an extended identifier with its flag; None where none comes within `timeout` [s]
        after the one before.
        """
        for _ in range(_MOST_WAITING):
            try:
                frame = received(self._link.bus, timeout)
            except (can.CanError, OSError):
                return None
            if frame is None:
                return None
            identifier, data = frame[0] & ~REMOTE, frame[1]
            self._link.errors += bool(identifier & ERROR)
            if not identifier & ERROR and matches(identifier, data):
                return identifier, data
        return None

    def leave(self) -> None:
        """Let go of the bus; the last one closes it. Safe to call twice."""
        if self in self._link.ports:
            self._link.ports.remove(self)
            self._link.forget()
            if not self._link.ports:
                with contextlib.suppress(can.CanError, OSError):
                    self._link.close()
                self._emptied()


_MOST_KNOWN = 4096
"""Identifiers whose ports are remembered: all of classic CAN, and as many of a flood of others."""
_MOST_WAITING = 64
"""Frames that wait for one drive at most, the newest of them, and that one call looks at: a flood holds up no loop."""
