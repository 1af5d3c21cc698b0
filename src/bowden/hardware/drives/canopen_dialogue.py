"""Questions and answers with one CANopen node over SDO (CiA 301); each failure is said in one line."""

import contextlib
from collections.abc import Callable, Iterable, Sequence

from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from bowden.core.errors import DriveError
from bowden.hardware.buses.link import BusPort
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.checklist import Conversation, Said

PDO_OFF, NO_REMOTE = 0x8000_0000, 0x4000_0000
"""Bits of a PDO's COB-ID."""
COB_ID_BITS = PDO_OFF | 0x7FF
SYNCHRONOUS = 1
"""Transmission type: at every SYNC."""
NOT_THERE = (0x0602_0000, 0x0609_0011)
"""SDO abort codes: no such object, no such sub-index."""
_TIMED_OUT, _TOO_LONG = 0x0504_0000, 0x0607_0012
"""SDO abort codes of ours: no answer in time, length of service parameter too high."""
_SPECIFIER, _ABORT = 0xE0, 0x80
"""Bits of the first byte of an SDO frame that say what it is; an abort of either side."""
_ANSWERS = {0x20: 0x60, 0x40: 0x40, 0x60: 0x00}
"""What a client sends, download, upload and a segment of the latter → the answer; the first two name their object."""
_EXPEDITED, _SIZED, _TOGGLE, _LAST = 0x02, 0x01, 0x10, 0x01
"""Bits of an answer: its data are in it, their size is too; it alternates from segment to segment, it is the last."""
_GLANCE = 5e-3
"""Between two looks at an object that is to change [s]."""
_LONGEST = 64
"""Of an answer: numbers have four bytes, and no more of a text is shown [bytes]."""
_TRIES = 2
"""Of a question, since a frame may get lost."""
_OF_NODES = (frames.EMERGENCY, frames.TPDO1, frames.TPDO2, frames.TPDO3, 0x480, frames.SDO_ANSWER, frames.HEARTBEAT)
"""What a node sends."""


class Dialogue(Conversation):
    """One node, asked while nobody else reads its bus.

    Args:
        port: of its bus, while no cycle runs.
        node_id: whom to ask.
        host_id: who we are.
        timeout: how long an answer may take [s].
        kind: what the node should be, for messages.
    """

    def __init__(
        self, port: BusPort, node_id: int, host_id: int, timeout: float, kind: str = "a CiA 402 drive"
    ) -> None:
        ours = frames.of_the_host(node_id, host_id)
        super().__init__(port, node_id, lambda identifier, _: identifier in ours, timeout)
        self.booted = False
        """True if the node has started again."""
        self.emergencies: list[int] = []
        """Error codes of the node, in their order."""
        self.transmitted = 0
        """How often TPDO 1 of the node has come."""
        self._kind, self._nodes = kind, set[int]()
        self._object = b""  # that the transfer is of
        self._kept: dict[tuple[int, int], tuple[int, int]] = {}
        """What was written last, and the bits of it that count."""

    def take(self, identifier: int, data: bytes) -> None:
        """Note what a frame says beside answers."""
        service, number = identifier & ~0x7F, identifier & 0x7F
        if number and service in _OF_NODES:
            self._nodes.add(number)
        if number != self.number:
            return
        if service == frames.HEARTBEAT and frames.unpack_heartbeat(data) == frames.BOOT_UP:
            self.booted = True
        if service == frames.TPDO1:
            self.transmitted += 1
        if service == frames.EMERGENCY and (code := frames.unpack_emergency(data)):
            self.emergencies.append(code)

    def _noted(self, matches: Callable[[int, bytes], Said | None]) -> Callable[[int, bytes], Said | None]:
        def looked_at(identifier: int, data: bytes) -> Said | None:
            self.take(identifier, data)
            return matches(identifier, data)

        return looked_at

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
        self.port.send_now(cob_id, data)

    def answers(self) -> bool:
        """True if the node answers at all; one that NMT has stopped, or that is not there, does not."""
        try:
            self._upload(0x1000, 0)
        except SdoAbortedError:
            return True
        except (SdoError, DriveError):
            return False
        return True

    def _exchange(self, request: bytes) -> bytes:
        """The answer to a request; one to a question before, that comes late, is not taken for it.

        Raises:
            SdoError: none, or an abort.
            DriveError: no other device is on the bus.
        """
        asked, kind = request[0], _ANSWERS[request[0] & _SPECIFIER]
        segment = kind == 0x00
        if not segment:
            self._object = request[1:4]

        def answered(identifier: int, data: bytes) -> bytes | None:
            if identifier != frames.SDO_ANSWER + self.number or len(data) != 8:
                return None
            if data[0] & _SPECIFIER == _ABORT:
                return data if data[1:4] in (self._object, bytes(3)) else None
            ours = not (data[0] ^ asked) & _TOGGLE if segment else data[1:4] == self._object
            return data if ours and data[0] & _SPECIFIER == kind else None

        question = frames.SDO_REQUEST + self.number, request
        said = self.ask(question, self._noted(answered), _TRIES)
        if said is None:
            self._abort(_TIMED_OUT)
            raise SdoCommunicationError("No SDO response received")
        if said[0] & _SPECIFIER == _ABORT:
            raise SdoAbortedError(int.from_bytes(said[4:], "little"))
        return said

    def _abort(self, code: int) -> None:
        """End the transfer."""
        self.send(frames.SDO_REQUEST + self.number, bytes((_ABORT,)) + self._object + code.to_bytes(4, "little"))

    def _upload(self, index: int, sub: int) -> bytes:
        """The bytes of an object, of one whose server never ends the first of them."""
        said, data, toggle = self._exchange(frames.pack_sdo_read(index, sub)), b"", 0
        if said[0] & _EXPEDITED:
            return said[4 : 8 - (said[0] >> 2 & 3 if said[0] & _SIZED else 0)]
        while len(data) < _LONGEST:
            said = self._exchange(bytes((0x60 | toggle, *bytes(7))))
            data += said[1 : 8 - (said[0] >> 1 & 7)]
            if said[0] & _LAST:
                return data
            toggle ^= _TOGGLE
        self._abort(_TOO_LONG)
        return data

    def waits(self, span: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let `span` [s] pass, or less where something comes to be so; whether it has."""
        for _ in range(round(span / _GLANCE)):
            if until():
                return True
            self.wait(_GLANCE, self.take)
        return until()

    def read_if_there(self, index: int, sub: int = 0, *, signed: bool = False) -> int | None:
        """A number; None where the drive has no such object.

        Raises:
            DriveError: no answer, or a refusal.
        """
        try:
            return int.from_bytes(self._upload(index, sub), "little", signed=signed)
        except SdoAbortedError as error:
            if error.code in NOT_THERE:
                return None
            raise DriveError(f"{self.name} does not report {index:04X}h:{sub}: {error}") from error
        except SdoError as error:
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
        except (SdoError, DriveError):
            return ""
        return "".join(letter for letter in said if letter.isprintable())[:40]

    def write(self, index: int, sub: int, value: int, size: int, mask: int = 0xFFFF_FFFF) -> None:
        """A number of `size` bytes, read back and compared in the bits of `mask`.

        Raises:
            DriveError: no answer, a refusal, or another value afterwards.
        """
        written = value % (1 << 8 * size)
        try:
            self._exchange(frames.pack_sdo_write(index, sub, written, size))
        except SdoError as error:
            raise DriveError(
                f"{self.name} refuses {index:04X}h:{sub} = {value}: {error}",
                expected=f"{self._kind} that takes it",
            ) from error
        self._kept[index, sub] = written, mask
        self._compare(index, sub)

    def switch_off(self, indices: Iterable[int]) -> None:
        """PDOs by their communication parameters, where they are there and on.

        Raises:
            DriveError: no answer, or a refusal.
        """
        for index in indices:
            cob_id = self.read_if_there(index, 1)
            if cob_id is not None and not cob_id & PDO_OFF:
                self.write(index, 1, cob_id | PDO_OFF, 4, COB_ID_BITS)

    def map_pdo(
        self, index: int, cob_id: int, objects: Sequence[int], kind: int = SYNCHRONOUS, *, ours: bool = True
    ) -> None:
        """One PDO, in the order that CiA 301 prescribes: off, type, mapping from none to all, on.

        Args:
            index: of its communication parameter.
            cob_id: with its bits.
            objects: index, sub-index and length in bits of each.
            kind: its transmission type.
            ours: whether the mapping is written in any case, and not only where it is another.

        Raises:
            DriveError: no answer, a refusal, or another value afterwards.
        """
        mapping = index + 0x200
        self.write(index, 1, cob_id | PDO_OFF, 4, COB_ID_BITS)
        self.write(index, 2, kind, 1)
        if ours or [self.read(mapping, 1 + i) for i in range(self.read(mapping))] != list(objects):
            self.write(mapping, 0, 0, 1)
            for sub, entry in enumerate(objects, 1):
                self.write(mapping, sub, entry, 4)
            self.write(mapping, 0, len(objects), 1)
        self.write(index, 1, cob_id, 4, COB_ID_BITS)

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
        """True if a signed object has a value, or takes it within the time of an answer.

        Raises:
            DriveError: no answer, a refusal, or no such object.
        """
        return self.waits(self._timeout, lambda: self.read(index, sub, signed=True) == value)

    def others(self) -> list[int]:
        """The numbers of the other nodes that answer."""
        with contextlib.suppress(DriveError):
            for number in range(1, 128):
                self.send(frames.SDO_REQUEST + number, frames.pack_sdo_read(0x1000, 0))
            self.wait(_TRIES * self._timeout, self.take)
        return sorted(self._nodes - {self.number})

    def reaches(self, state: int, patience: int = 3) -> bool:
        """True if one of the next heartbeats has that NMT state."""

        def beat(identifier: int, data: bytes) -> int | None:
            return frames.unpack_heartbeat(data) if identifier == frames.HEARTBEAT + self.number else None

        return any(self.wait(self._timeout, self._noted(beat)) == state for _ in range(patience))
