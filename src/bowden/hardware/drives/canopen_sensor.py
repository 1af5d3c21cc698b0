"""A CANopen sensor beside a drive: how it is told to send, and whether one may still believe it. Of any profile.

Bring-up maps what is measured into TPDO 1, at SYNC or by a timer, switches the device's other PDOs off, sets its
heartbeat, starts it, and reads everything back. From then on what it sends counts while its heartbeat is there, says
operational, and no emergency stands.

Source: CiA 301, "PDO communication parameter", "PDO mapping parameter", "heartbeat", "emergency".
"""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bowden.core.errors import DriveError
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives import on_can

if TYPE_CHECKING:
    from bowden.hardware.drives.canopen_dialogue import Dialogue

HOST = 127
"""Our own number on the bus of such a device, which does not watch us."""
HEARTBEAT = 20e-3
"""Between two heartbeats of the device, as bring-up sets it [s]."""
MOST_SILENCE = 3.5 * HEARTBEAT
"""Of its heartbeat; two lost ones do no harm [s]."""
SYNCED = 1
"""Transmission type: at every SYNC."""
OFF = 0x8000_0000
"""Bit of a PDO's COB-ID: it is not sent."""


def identifiers_of_node(node_id: int, key: str) -> dict[int, str]:
    """Identifier of each frame of a sensor and to it → key that it follows from; the network's have none."""
    functions = (frames.EMERGENCY, frames.TPDO1, frames.SDO_ANSWER, frames.SDO_REQUEST, frames.HEARTBEAT)
    own = {function + node_id: key for function in functions}
    return own | dict.fromkeys((frames.NMT, frames.SYNC), on_can.OF_ALL)


def device_type(node: "Dialogue", what: str, expected: str, key: str) -> int:
    """1000h, of a sensor that must be there: its profile in the low word.

    Args:
        node: asked.
        what: it is, for messages: ``encoder of the joint``.
        expected: of it.
        key: which says its number, with its section.

    Raises:
        DriveError: nobody answers with that number; who does.
    """
    try:
        return node.read(0x1000)
    except DriveError as error:
        there = node.others()
        raise DriveError(
            f"no {what} answers as {node.name}" + (f"; there is node {', '.join(map(str, there))}" if there else ""),
            expected=f"{expected} with that number",
            do=f"correct {key}" if there else "check its supply, cable and bit rate",
        ) from error


def send_in_tpdo1(node: "Dialogue", what: str, mapped: Sequence[int], kind: int, timer: Callable[[], None]) -> None:
    """Have it send objects in TPDO 1, and start it; a device whose mapping is fixed must have them in it already.

    Args:
        node: in pre-operational.
        what: it is, for messages: ``the joint's encoder``.
        mapped: index, sub-index and length in bits of each.
        kind: transmission type.
        timer: sets the device's timer, or stops it.

    Raises:
        DriveError: a setting that is refused, or a device that does not start.
    """
    cob_id = 0x4000_0000 | (node.read(0x1800, 1) & 0x7FF)
    if cob_id & 0x7FF != frames.TPDO1 + node.number:
        cob_id = 0x4000_0000 | frames.TPDO1 + node.number
    for index in (0x1801, 0x1802, 0x1803):
        other = node.read_if_there(index, 1)
        if other is not None and not other & OFF:
            node.write(index, 1, other | OFF, 4, OFF | 0x7FF)
    node.write(0x1800, 1, cob_id | OFF, 4, OFF | 0x7FF)
    node.write(0x1800, 2, kind, 1)
    found = [node.read(0x1A00, 1 + i) for i in range(node.read(0x1A00, 0))]
    if found != list(mapped):
        node.write(0x1A00, 0, 0, 1)
        for i, entry in enumerate(mapped):
            node.write(0x1A00, 1 + i, entry, 4)
        node.write(0x1A00, 0, len(mapped), 1)
    timer()
    node.write(0x1017, 0, round(1e3 * HEARTBEAT), 2)
    node.write(0x1800, 1, cob_id, 4, OFF | 0x7FF)
    node.command(frames.NMT_START)
    if not node.reaches(frames.OPERATIONAL):
        raise DriveError(f"{node.name}, {what}, does not become operational", expected="NMT state 5 in its heartbeat")
    node.keeps_all()


def try_sync(node: "Dialogue", what: str, value: str, do: str) -> None:
    """It must answer a SYNC: one that does not would first show in a run.

    Raises:
        DriveError: it sends nothing.
    """
    node.listener.transmitted = 0
    node.send(frames.SYNC, b"")
    if not node.waits(0.1, lambda: node.listener.transmitted > 0):
        raise DriveError(f"{node.name}, {what}, sends nothing at a SYNC", expected=f"{value} in TPDO 1", do=do)


class SensorHealth:
    """Whether what a device sends may be believed; `begin` once, then `take` for each of its frames.

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
        """Whether it is operational, in no emergency, and not silent, at `now` [s]."""
        return self._operational and not self._failed and now - self._beat <= MOST_SILENCE
