"""Questions and answers with one CANopen node over SDO, by the `canopen` library; each failure is said in one line."""

import contextlib
import struct
import threading
from collections.abc import Callable, Iterator

import can
import canopen
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoError

from bowden.core.errors import DriveError
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.checklist import nobody_there

NOT_THERE = (0x0602_0000, 0x0609_0011)
"""SDO abort codes: no such object, no such sub-index (CiA 301)."""

_TOO_LONG = 0x0607_0012
"""SDO abort code: length of service parameter too high (CiA 301)."""

_FAILURES = (SdoError, can.CanError, OSError, struct.error)
"""What the library raises where nobody answers, or answers with what is none (`struct.error`)."""

_SPECIFIER = 0xE0
"""Bits of the first byte of an SDO frame that say what it is (CiA 301)."""

_ANSWERS = {0x20: 0x60, 0x40: 0x40, 0x00: 0x20, 0x60: 0x00}
"""What a client sends, download, upload and a segment of each → the answer."""

_BEGINS = (0x20, 0x40)
"""Of these, what names its object, as its answer does."""

_TOGGLE = 0x10
"""It alternates from segment to segment."""

_ABORT = 0x80
"""An abort of either side, which names its object too."""

_GLANCE = 5e-3
"""Between two looks at an object that is to change [s]."""

_LONGEST = 64
"""Of an answer: numbers have four bytes, and no more of a text is shown [bytes]."""

_TRIES = 2
"""Of a question, since a frame may get lost."""


class BusListener(can.Listener):
    """What has come over the bus beside answers.

    Args:
        node_id: the drive's.
        host_id: ours.
    """

    def __init__(self, node_id: int, host_id: int) -> None:
        self._node, self._ours = node_id, frames.of_the_host(node_id, host_id)
        self.foreign: int | None = None
        """COB-ID of the first frame that nobody but this host may send; None where none has come."""
        self.booted = False
        """Whether the node has started again."""
        self.emergencies: list[int] = []
        """Error codes of the node, in their order."""
        self.transmitted = 0
        """How often TPDO 1 of the node has come."""

    def on_message_received(self, msg: can.Message) -> None:
        """Take in a frame; called by the library's thread."""
        cob_id, data = msg.arbitration_id, bytes(msg.data)
        if msg.is_error_frame or msg.is_extended_id:
            return
        if cob_id in self._ours and self.foreign is None:
            self.foreign = cob_id
        if cob_id == frames.HEARTBEAT + self._node and frames.unpack_heartbeat(data) == frames.BOOT_UP:
            self.booted = True
        if cob_id == frames.TPDO1 + self._node:
            self.transmitted += 1
        if cob_id == frames.EMERGENCY + self._node and (code := frames.unpack_emergency(data)):
            self.emergencies.append(code)


class _Client(SdoClient):
    """The library's, which takes no answer to a question before: one that comes late would be read as of the next."""

    _asked, _answer, _object = 0, 0, b""

    def send_request(self, request: bytes) -> None:
        if (kind := request[0] & _SPECIFIER) in _ANSWERS:
            self._asked, self._answer = request[0], _ANSWERS[kind]
            if kind in _BEGINS:
                self._object = bytes(request[1:4])
        super().send_request(request)  # type: ignore[no-untyped-call]

    def on_response(self, can_id: int, data: bytes, timestamp: float) -> None:
        if data and self._is_of_another(data[0] & _SPECIFIER, data):
            return
        super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]

    def _is_of_another(self, kind: int, data: bytes) -> bool:
        names = bytes(data[1:4])
        if kind == _ABORT:
            return any(names) and names != self._object
        if kind != self._answer:
            return True
        if self._asked & _SPECIFIER in _BEGINS:
            return names != self._object
        return bool((data[0] ^ self._asked) & _TOGGLE)


class _Node(canopen.RemoteNode):
    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SdoClient:
        client = _Client(rx_cobid, tx_cobid, self.object_dictionary)  # type: ignore[no-untyped-call]
        self.sdo_channels.append(client)
        return client


class Dialogue:
    """One node, asked while the library's thread runs.

    Args:
        network: the library's.
        node_id: whom to ask.
        timeout: how long an answer may take [s].
        listener: what comes besides answers.
        kind: what the node should be, for messages.
    """

    def __init__(
        self, network: canopen.Network, node_id: int, timeout: float, listener: BusListener, kind: str
    ) -> None:
        self._network, self.listener, self._kind = network, listener, kind
        self._node = network.add_node(_Node(node_id, _no_dictionary()))
        self._node.sdo.RESPONSE_TIMEOUT, self._node.sdo.MAX_RETRIES = timeout, _TRIES
        self._kept: dict[tuple[int, int], tuple[int, int]] = {}
        """What was written last, and the bits of it that count."""
        self._timeout = timeout
        self.number = node_id
        """The node's."""
        self.name = f"node {node_id}"

    def command(self, order: int) -> None:
        """An order of NMT.

        Raises:
            DriveError: no other device is on the bus.
        """
        self.send(frames.NMT, bytes((order, self.number)))

    def send(self, cob_id: int, data: bytes) -> None:
        """A frame.

        Raises:
            DriveError: no other device is on the bus.
        """
        try:
            self._network.send_message(cob_id, data)
        except _FAILURES as error:
            raise nobody_there(error) from error

    def answers(self) -> bool:
        """Whether the node answers at all; one that NMT has stopped, or that is not there, does not."""
        try:
            self._upload(0x1000, 0)
        except canopen.SdoAbortedError:
            return True
        except _FAILURES:
            return False
        return True

    def _upload(self, index: int, sub: int) -> bytes:
        """The bytes of an object, of one whose server never ends the first of them."""
        stream, data = self._node.sdo.open(index, sub, buffering=0), b""
        while len(data) < _LONGEST and (piece := stream.read(7)):
            data += piece
        if len(data) >= _LONGEST:
            self._node.sdo.abort(_TOO_LONG)
        return data

    def waits(self, span: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let `span` [s] pass, or less where something comes to be so; whether it has."""
        for _ in range(round(span / _GLANCE)):
            if until():
                return True
            threading.Event().wait(_GLANCE)
        return until()

    def read_if_there(self, index: int, sub: int = 0, *, signed: bool = False) -> int | None:
        """A number; None where the drive has no such object.

        Raises:
            DriveError: no answer, or a refusal.
        """
        try:
            return int.from_bytes(self._upload(index, sub), "little", signed=signed)
        except canopen.SdoAbortedError as error:
            if error.code in NOT_THERE:
                return None
            raise DriveError(f"{self.name} does not report {index:04X}h:{sub}: {error}") from error
        except _FAILURES as error:
            raise DriveError(f"{self.name} does not answer for {index:04X}h:{sub}: {error}") from error

    def read(self, index: int, sub: int = 0, *, signed: bool = False) -> int:
        """A number.

        Raises:
            DriveError: no answer, a refusal, or no such object.
        """
        value = self.read_if_there(index, sub, signed=signed)
        if value is None:
            raise DriveError(f"{self.name} has no object {index:04X}h:{sub}", expected=f"{self._kind} that has it")
        return value

    def device_type(self, what: str, expected: str, do: str, check: str) -> int:
        """1000h, of a node that must be there: its profile in the low word (CiA 301).

        Args:
            what: it is, for messages.
            expected: of it.
            do: what to do where others answer.
            check: what to check where nobody does.

        Raises:
            DriveError: nobody answers with that number; who does.
        """
        try:
            return self.read(0x1000)
        except DriveError as error:
            there = ", ".join(map(str, self.others()))
            raise DriveError(
                f"no {what} answers as {self.name}" + (f"; there is node {there}" if there else ""),
                expected=f"{expected} with that number",
                do=do if there else f"switch it on; check {check}",
            ) from error

    def text(self, index: int) -> str:
        """A text, cut after 40 letters; empty where there is none."""
        try:
            said = self._upload(index, 0).decode("ascii", "replace")
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
                expected=f"{self._kind} that takes it",
            ) from error
        self._kept[index, sub] = written, mask
        self._compare(index, sub)

    def keeps_all(self) -> None:
        """Read back once more all that was written.

        Raises:
            DriveError: something has another value by now.
        """
        for index, sub in self._kept:
            self._compare(index, sub)

    def _compare(self, index: int, sub: int) -> None:
        written, mask = self._kept[index, sub]
        kept = self.read(index, sub)
        if (kept ^ written) & mask:
            raise DriveError(f"{self.name} keeps {index:04X}h:{sub} at {kept}", expected=f"{written}, as written")

    def becomes(self, index: int, sub: int, value: int) -> bool:
        """Whether a signed object has a value, or takes it within the time of an answer.

        Raises:
            DriveError: no answer, a refusal, or no such object.
        """
        return self.waits(self._timeout, lambda: self.read(index, sub, signed=True) == value)

    def others(self) -> list[int]:
        """The numbers of the other nodes that answer."""
        with contextlib.suppress(*_FAILURES):
            self._network.scanner.search()
        with contextlib.suppress(*_FAILURES):
            self._upload(0x1000, 0)  # nobody answers this, and meanwhile the others do
        return sorted(set(self._network.scanner.nodes) - {self.number})

    def reaches(self, state: int, patience: int = 3) -> bool:
        """Whether one of the next heartbeats has that NMT state."""
        for _ in range(patience):
            with contextlib.suppress(canopen.nmt.NmtError):
                self._node.nmt.wait_for_heartbeat(self._timeout)
            if self._node.nmt._state == state:
                return True
        return False


@contextlib.contextmanager
def dialogue(
    bus: can.BusABC, node_id: int, host_id: int, timeout: float, kind: str = "a CiA 402 drive"
) -> Iterator[Dialogue]:
    """A dialogue over our bus; at its end the library's thread is gone, and the bus still open.

    Args:
        bus: open, and read by nobody else.
        node_id: whom to ask.
        host_id: who we are.
        timeout: how long an answer may take [s].
        kind: what the node should be, for messages.
    """
    network, listener = canopen.Network(bus), BusListener(node_id, host_id)
    network.listeners.append(listener)  # type: ignore[arg-type]  # it takes any listener
    network.NOTIFIER_CYCLE = 0.02  # the thread is waited for at the end
    network.connect()
    try:
        yield Dialogue(network, node_id, timeout, listener, kind)
    finally:
        if network.notifier is not None:
            network.notifier.stop(5.0)


def _no_dictionary() -> canopen.ObjectDictionary:
    """The library wants an object dictionary; everything here is read and written by number."""
    return canopen.ObjectDictionary()  # type: ignore[no-untyped-call]  # the library has no types for it
