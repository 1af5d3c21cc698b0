"""A CANopen sensor beside a drive: how it is told to send, and whether one may still believe it. Of any profile.

Bring-up maps what is measured into TPDO 1, at SYNC or by a timer, switches the device's other PDOs off, sets its
heartbeat, starts it, and reads everything back. From then on what it sends counts while its heartbeat is there, says
operational, and no emergency stands.

Source: CiA 301, "PDO communication parameter", "PDO mapping parameter", "heartbeat", "emergency".
"""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

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


class SensorKind(NamedTuple):
    """Kind of a sensor, for its bring-up and its messages."""

    what: str
    """``the joint's encoder``"""
    value: str
    """Quantity that it measures: ``its position``."""
    profile: int
    """Low word of 1000h."""
    kinds: tuple[int, ...]
    """High word of 1000h; none where that does not count."""
    expected: str
    node_key: str
    """Key that says its number, with its section."""
    sync_hint: str
    """What to do about one that does not answer a SYNC."""
    by_timer: int
    """Transmission type where it does not wait for a SYNC."""


def sensor(port: "BusPort", node_id: int, timeout: float, kind: SensorKind) -> "tuple[Dialogue, int]":
    """A sensor that is there and of its kind, asked in pre-operational; and the high word of its 1000h.

    Raises:
        DriveError: nobody answers with that number, and who does; or another kind of device.
    """
    from bowden.hardware.drives.canopen_dialogue import Dialogue

    node = Dialogue(port, node_id, HOST, timeout, f"a CiA {kind.profile} device")
    if not node.answers():
        node.command(frames.NMT_PRE_OPERATIONAL)
    said = node.device_type(
        kind.what.removeprefix("the "),
        f"a CANopen device (CiA {kind.profile})",
        f"correct {kind.node_key}",
        "supply, cable and bit rate",
    )
    profile, high = said & 0xFFFF, said >> 16
    if profile != kind.profile or (kind.kinds and high not in kind.kinds):
        raise DriveError(
            f"{node.name} has device profile {profile} and type {high} (1000h is 0x{said:08X})",
            expected=kind.expected,
            do=f"correct {kind.node_key}",
        )
    node.command(frames.NMT_PRE_OPERATIONAL)
    return node, high


def start(
    node: "Dialogue", kind: SensorKind, mapped: Sequence[int], *, synced: bool, timer: "Callable[[Dialogue], None]"
) -> None:
    """Have a sensor send objects in TPDO 1, and start it; one whose mapping is fixed must have them in it already.

    It must answer a SYNC where it is to: one that does not would first show in a run.

    Args:
        node: in pre-operational.
        kind: of the sensor.
        mapped: index, sub-index and length in bits of each object.
        synced: whether it sends at SYNC.
        timer: sets the device's timer, or stops it.

    Raises:
        DriveError: a setting that is refused, a device that does not start, or that sends nothing.
    """
    from bowden.hardware.drives.canopen_dialogue import NO_REMOTE, SYNCHRONOUS

    node.switch_off((0x1801, 0x1802, 0x1803))
    cob_id = NO_REMOTE | frames.TPDO1 + node.number
    node.map_pdo(0x1800, cob_id, mapped, SYNCHRONOUS if synced else kind.by_timer, ours=False)
    timer(node)
    node.write(0x1017, 0, round(1e3 * HEARTBEAT), 2)
    node.command(frames.NMT_START)
    if not node.reaches(frames.OPERATIONAL):
        raise DriveError(
            f"{node.name}, {kind.what}, does not become operational", expected="NMT state 5 in its heartbeat"
        )
    node.keeps_all()
    if synced:
        node.transmitted = 0
        node.send(frames.SYNC, b"")
        if not node.waits(0.1, lambda: node.transmitted > 0):
            said = f"{node.name}, {kind.what}, sends nothing at a SYNC"
            raise DriveError(said, expected=f"{kind.value} in TPDO 1", do=kind.sync_hint)


class SensorHealth:
    """Validity of the frames of a device; `begin` once, then `take` for each of its frames.

    Args:
        node_id: of the device.
    """

    def __init__(self, node_id: int) -> None:
        self._node = node_id
        self.ours = frames.of_the_host(node_id, HOST)
        """COB-IDs that only its host may send."""
        self._beat = math.nan
        self._operational = self._failed = False

    def begin(self) -> None:
        """It has been started."""
        self._operational, self._failed, self._beat = True, False, math.nan

    def take(self, identifier: int, data: bytes, now: float) -> bool:
        """Take in what it says of itself; whether the frame is its TPDO 1."""
        if identifier == frames.HEARTBEAT + self._node:
            state = frames.unpack_heartbeat(data)
            if state is not None:
                self._beat = now
                self._operational = self._operational and state == frames.OPERATIONAL
        elif identifier == frames.EMERGENCY + self._node:
            code = frames.unpack_emergency(data)
            self._failed = self._failed if code is None else code != 0
        elif identifier == frames.TPDO1 + self._node:
            if math.isnan(self._beat):
                self._beat = now  # from its first reading on it can be late
            return True
        return False

    def good(self, now: float) -> bool:
        """True if it is operational, in no emergency, and not silent, at `now` [s]."""
        return self._operational and not self._failed and now - self._beat <= MOST_SILENCE
