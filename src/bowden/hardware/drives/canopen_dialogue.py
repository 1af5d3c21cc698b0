"""Questions and answers with one CANopen node over SDO, by the `canopen` library; each failure is said in one line."""

import contextlib
import struct
import threading
from collections.abc import Iterator

import can
import canopen
from canopen.sdo.exceptions import SdoError

from bowden.core.errors import DriveError
from bowden.hardware.drives import canopen_frames as frames

NOT_THERE = (0x0602_0000, 0x0609_0011)
"""SDO abort codes: no such object, no such sub-index (CiA 301)."""

_FAILURES = (SdoError, can.CanError, OSError, struct.error)
"""What the library raises where nobody answers, or answers with what is none (`struct.error`)."""

_GLANCE = 5e-3
"""Between two looks at an object that is to change [s]."""


class Dialogue:
    """One node, asked while the library's thread runs.

    Args:
        network: the library's.
        node_id: whom to ask.
        timeout: how long an answer may take [s].
    """

    def __init__(self, network: canopen.Network, node_id: int, timeout: float) -> None:
        self._network = network
        self._node = network.add_node(canopen.RemoteNode(node_id, _no_dictionary()))
        self._node.sdo.RESPONSE_TIMEOUT = timeout
        self._timeout = timeout
        self._id = node_id
        self.name = f"node {node_id}"

    def command(self, order: int) -> None:
        """An order of NMT.

        Raises:
            DriveError: nobody is on the bus.
        """
        try:
            self._network.send_message(frames.NMT, bytes((order, self._id)))
        except _FAILURES as error:
            raise DriveError(
                f"nobody is on the bus: {error}", do="switch the drive on, or start bowden twin; see to cable and ends"
            ) from error

    def answers(self) -> bool:
        """Whether the node answers at all; one that NMT has stopped, or that is not there, does not."""
        try:
            self._node.sdo.upload(0x1000, 0)
        except canopen.SdoAbortedError:
            return True
        except _FAILURES:
            return False
        return True

    def receives(self, number: int, span: float) -> bool:
        """Whether a node of that number says anything within `span` [s]."""
        self._network.scanner.nodes.clear()
        threading.Event().wait(span)
        return number in self._network.scanner.nodes

    def read_if_there(self, index: int, sub: int = 0, *, signed: bool = False) -> int | None:
        """A number; None where the drive has no such object.

        Raises:
            DriveError: no answer, or a refusal.
        """
        try:
            return int.from_bytes(self._node.sdo.upload(index, sub), "little", signed=signed)
        except canopen.SdoAbortedError as error:
            if error.code in NOT_THERE:
                return None
            raise DriveError(f"{self.name} does not tell {index:04X}h:{sub}: {error}") from error
        except _FAILURES as error:
            raise DriveError(f"{self.name} does not answer for {index:04X}h:{sub}: {error}") from error

    def read(self, index: int, sub: int = 0, *, signed: bool = False) -> int:
        """A number.

        Raises:
            DriveError: no answer, a refusal, or no such object.
        """
        value = self.read_if_there(index, sub, signed=signed)
        if value is None:
            raise DriveError(f"{self.name} has no object {index:04X}h:{sub}", expected="a CiA 402 drive that has it")
        return value

    def text(self, index: int) -> str:
        """A text, cut after 40 letters; empty where there is none."""
        try:
            said = bytes(self._node.sdo.upload(index, 0)).decode("ascii", "replace")
        except _FAILURES:
            return ""
        return "".join(letter for letter in said if letter.isprintable())[:40]

    def write(self, index: int, sub: int, value: int, size: int, mask: int = 0xFFFF_FFFF) -> None:
        """A number of `size` bytes, read back and compared in the bits of `mask`.

        Raises:
            DriveError: no answer, a refusal, or another value afterwards.
        """
        written = value % (1 << 8 * size)
        try:
            self._node.sdo.download(index, sub, written.to_bytes(size, "little"))
        except _FAILURES as error:
            raise DriveError(
                f"{self.name} refuses {index:04X}h:{sub} = {value}: {error}",
                expected="a CiA 402 drive for cyclic synchronous position",
            ) from error
        kept = self.read(index, sub)
        if (kept ^ written) & mask:
            raise DriveError(f"{self.name} keeps {index:04X}h:{sub} at {kept}", expected=f"{written}, as written")

    def becomes(self, index: int, sub: int, value: int) -> bool:
        """Whether a signed object has a value, or takes it within the time of an answer.

        Raises:
            DriveError: no answer, a refusal, or no such object.
        """
        for _ in range(1 + int(self._timeout / _GLANCE)):
            if self.read(index, sub, signed=True) == value:
                return True
            threading.Event().wait(_GLANCE)
        return False

    def others(self) -> list[int]:
        """The numbers of the other nodes that answer."""
        with contextlib.suppress(*_FAILURES):
            self._network.scanner.search()
        with contextlib.suppress(*_FAILURES):
            self._node.sdo.upload(0x1000, 0)  # nobody answers this, and meanwhile the others do
        return sorted(set(self._network.scanner.nodes) - {self._id})

    def reaches(self, state: int, patience: int = 3) -> bool:
        """Whether one of the next heartbeats tells that NMT state."""
        for _ in range(patience):
            with contextlib.suppress(canopen.nmt.NmtError):
                self._node.nmt.wait_for_heartbeat(self._timeout)
            if self._node.nmt._state == state:
                return True
        return False


@contextlib.contextmanager
def dialogue(bus: can.BusABC, node_id: int, timeout: float) -> Iterator[Dialogue]:
    """A dialogue over our bus; at its end the library's thread is gone, and the bus still open.

    Args:
        bus: open, and read by nobody else.
        node_id: whom to ask.
        timeout: how long an answer may take [s].
    """
    network = canopen.Network(bus)
    network.NOTIFIER_CYCLE = 0.02  # the thread is waited for at the end
    network.connect()
    try:
        yield Dialogue(network, node_id, timeout)
    finally:
        if network.notifier is not None:
            network.notifier.stop(5.0)


def _no_dictionary() -> canopen.ObjectDictionary:
    """The library wants an object dictionary; everything here is read and written by number."""
    return canopen.ObjectDictionary()  # type: ignore[no-untyped-call]  # the library has no types for it
