"""A CANopen sensor beside a drive: how it is told to send, and whether one may still believe it. Of any profile.

Bring-up maps what is measured into TPDO 1, at SYNC or by a timer, switches the device's other PDOs off, sets its
heartbeat, starts it, and reads everything back. From then on what it sends counts while its heartbeat is there, says
operational, and no emergency stands.

Source: CiA 301, "PDO communication parameter", "PDO mapping parameter", "heartbeat", "emergency".
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from bowden.core.errors import DriveError
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives import on_can

if TYPE_CHECKING:
    from bowden.hardware.buses.link import BusPort
    from bowden.hardware.drives.canopen_dialogue import Dialogue

HOST = 127
"""Our own number on the bus of such a device, which does not watch us."""
HEARTBEAT = 20e-3
"""Between two heartbeats of the device, as bring-up sets it [s]."""
MOST_SILENCE = 3.5 * HEARTBEAT
"""Of its heartbeat; two lost ones do no harm [s]."""


def identifiers_of_node(node_id: int, key: str) -> dict[int, str]:
    """Identifier of each frame of a sensor and to it → key that it follows from; the network's have none."""
    functions = (frames.EMERGENCY, frames.TPDO1, frames.SDO_ANSWER, frames.SDO_REQUEST, frames.HEARTBEAT)
    own = {function + node_id: key for function in functions}
    return own | dict.fromkeys((frames.NMT, frames.SYNC), on_can.OF_ALL)


class CanopenSensor(ABC):
    """The device, while its drive runs: `bring_up` once, then `take` for each of its frames.

    Args:
        node_id: its number.
        timeout: how long an answer may take [s].
        synced: whether it waits for our SYNC, and does not send by its own timer.
    """

    what: ClassVar[str]
    """``the joint's encoder``"""
    quantity: ClassVar[str]
    """What it measures: ``its position``."""
    profile: ClassVar[int]
    """Low word of 1000h."""
    kinds: ClassVar[Mapping[int, str]] = {}
    """High word of 1000h → what it is; empty where that does not count."""
    expected: ClassVar[str]
    node_key: ClassVar[str]
    """Key that says its number, with its section."""
    sync_hint: ClassVar[str]
    """What to do about one that does not answer a SYNC."""
    by_timer: ClassVar[int]
    """Transmission type where it does not wait for a SYNC."""

    def __init__(self, node_id: int, timeout: float, *, synced: bool) -> None:
        self.node_id, self.synced, self._timeout = node_id, synced, timeout
        self._ours = frames.of_the_host(node_id, HOST)
        self._began(operational=False)

    def _began(self, *, operational: bool) -> None:
        """It has been started, or not yet."""
        self._operational, self._failed, self._beat = operational, False, math.nan

    @abstractmethod
    def _look(self, node: "Dialogue", kind: int) -> tuple[Sequence[int], str, str]:
        """Check a device of this profile that is in pre-operational.

        Args:
            node: to ask.
            kind: high word of its 1000h.

        Returns:
            Index, sub-index and length in bits of each object that it is to send; who it is where it has no name; and
            what it counts in, in a few words.
        """

    @abstractmethod
    def _set_timer(self, node: "Dialogue") -> None:
        """Set its own timer, or stop it where it waits for our SYNC."""

    def foreign(self, identifier: int) -> bool:
        """True if a frame is one that only its host may send."""
        return identifier in self._ours

    def bring_up(self, port: "BusPort") -> str:
        """Find, check and configure it, and start it; who it is, in one line.

        A device whose mapping is fixed must have the objects in TPDO 1 already. One that is to answer a SYNC must do
        so: otherwise it would first show in a run.

        Args:
            port: of its bus, read by nobody else meanwhile.

        Raises:
            DriveError: nobody answers with that number, and who does; another kind of device, or one that does not fit
                the rig; a setting that is refused; a device that does not start, or that sends nothing.
        """
        from bowden.hardware.drives.canopen_dialogue import NO_REMOTE, SYNCHRONOUS, Dialogue

        node = Dialogue(port, self.node_id, HOST, self._timeout, f"a CiA {self.profile} device")
        if not node.answers():
            node.command(frames.NMT_PRE_OPERATIONAL)
        said = node.device_type(
            self.what.removeprefix("the "),
            f"a CANopen device (CiA {self.profile})",
            f"correct {self.node_key}",
            "supply, cable and bit rate",
        )
        profile, kind = said & 0xFFFF, said >> 16
        if profile != self.profile or (self.kinds and kind not in self.kinds):
            raise DriveError(
                f"{node.name} has device profile {profile} and type {kind} (1000h is 0x{said:08X})",
                expected=self.expected,
                do=f"correct {self.node_key}",
            )
        node.command(frames.NMT_PRE_OPERATIONAL)
        mapped, named, counts = self._look(node, kind)
        node.switch_off((0x1801, 0x1802, 0x1803))
        cob_id = NO_REMOTE | frames.TPDO1 + node.number
        node.map_pdo(0x1800, cob_id, mapped, SYNCHRONOUS if self.synced else self.by_timer, ours=False)
        self._set_timer(node)
        node.write(0x1017, 0, round(1e3 * HEARTBEAT), 2)
        node.command(frames.NMT_START)
        if not node.reaches(frames.OPERATIONAL):
            raise DriveError(
                f"{node.name}, {self.what}, does not become operational", expected="NMT state 5 in its heartbeat"
            )
        node.keeps_all()
        if self.synced:
            node.transmitted = 0
            node.send(frames.SYNC, b"")
            if not node.waits(0.1, lambda: node.transmitted > 0):
                said_of = f"{node.name}, {self.what}, sends nothing at a SYNC"
                raise DriveError(said_of, expected=f"{self.quantity} in TPDO 1", do=self.sync_hint)
        self._began(operational=True)
        return f"{node.text(0x1008) or named} at {node.name}, {counts}"

    def _measures(self, identifier: int, data: bytes, now: float) -> bool:
        """Take in what it says of itself; whether the frame is its TPDO 1."""
        if identifier == frames.HEARTBEAT + self.node_id:
            state = frames.unpack_heartbeat(data)
            if state is not None:
                self._beat = now
                self._operational = self._operational and state == frames.OPERATIONAL
        elif identifier == frames.EMERGENCY + self.node_id:
            code = frames.unpack_emergency(data)
            self._failed = self._failed if code is None else code != 0
        elif identifier == frames.TPDO1 + self.node_id:
            if math.isnan(self._beat):
                self._beat = now  # from its first reading on it can be late
            return True
        return False

    def _good(self, now: float) -> bool:
        """True if it is operational, in no emergency, and not silent, at `now` [s]."""
        return self._operational and not self._failed and now - self._beat <= MOST_SILENCE
