"""A load cell that is a device of its own on a CAN bus: a CiA 404 measuring device, or one that sends plain frames.

    value = scale · (counts − zero)

A CiA 404 device sends its process value as a whole number, and its status where it has one:

    TPDO 1  180h + node   9130h:n AI input PV i32 (7130h:n, i16, of one that has no other), 6150h:n AI status u8

at SYNC or by its event timer (1800h:5). A device of plain frames has a number at a place in a frame, as the rig says.

A reading that is older than `silence` is none. Nor is one that its device calls invalid, and a tension at the lower
end of the range, since no cable pushes: both ends of a broken wire or bridge look so. At the upper end the number is
passed on: the largest load allowed is below it (`check_cell`), so that it stops the run.

Sources: CiA 404, "device profile for measuring devices and closed-loop controllers" (objects 6131h, 6132h, 6150h,
7130h and 9130h as makers' manuals have them); CiA 301 for PDOs; CiA 303-2 for the code of the newton.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bowden.core.errors import DriveError
from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.canopen_sensor import CanopenSensor, identifiers_of_node
from bowden.rig.load_cell import LoadCellParameters

if TYPE_CHECKING:
    from bowden.hardware.buses.link import BusPort
    from bowden.hardware.drives.canopen_dialogue import Dialogue

BY_TIMER = 255
"""Transmission type: when the device's profile or its event timer says so."""
VALUE_32, VALUE_16, STATUS, UNIT, DIGITS = 0x9130, 0x7130, 0x6150, 0x6131, 0x6132
"""Objects of the profile, of which the sub-index is the device's input."""
NEWTON = 0x21
"""Third byte of 6131h; the fourth is the power of ten before it."""
NOT_VALID, OVERLOAD, UNDERLOAD = 0x01, 0x02, 0x04
"""Bits of 6150h."""
LOOKED = 0.5
"""So long a plain frame is waited for at bring-up [s]."""
TRIAL = 8
"""Times that one is waited for after it, as long as a reading lasts: a computer that stalls misses fewer than half."""


def identifiers_of(cell: LoadCellParameters) -> dict[int, str]:
    """Identifier of each frame of the device and to it → key that it follows from; the network's have none."""
    if cell.source == "can":
        return {cell.identifier | EXTENDED * cell.extended: "load_cell.identifier"}
    return identifiers_of_node(cell.node_id, "load_cell.node_id")


class LoadCellReader(CanopenSensor):
    """The device; see `CanopenSensor`; or one that sends plain frames by itself.

    Args:
        given: what the rig says of it.
        timeout: how long an answer may take [s].
    """

    what, quantity = "the load cell", "its value"
    profile, by_timer = 404, BY_TIMER
    expected = "profile 404, a measuring device"
    node_key = "node_id in [load_cell]"
    sync_hint = 'set sends = "timer" in [load_cell], if it has one'

    def __init__(self, given: LoadCellParameters, timeout: float) -> None:
        self._plain = given.source == "can"
        super().__init__(given.node_id, timeout, synced=not self._plain and given.sends == "sync")
        self.given = given
        self._frame = given.identifier | EXTENDED * given.extended
        kinds = (frames.TPDO1, frames.HEARTBEAT, frames.EMERGENCY, frames.SDO_ANSWER)
        self._sends = (self._frame,) if self._plain else tuple(kind + given.node_id for kind in kinds)
        self._wide = True
        self._value, self._came = math.nan, math.nan

    @property
    def node(self) -> str:
        """Which device, for messages."""
        return f"{self.what} ({self.given.identifier:03X}h)" if self._plain else f"node {self.given.node_id}"

    def wants(self, identifier: int) -> bool:
        """True if a frame is of it, or one that only its host may send."""
        return identifier in self._sends or self.foreign(identifier)

    def foreign(self, identifier: int) -> bool:
        """See `CanopenSensor.foreign`; plain frames have no host."""
        return not self._plain and super().foreign(identifier)

    def bring_up(self, port: "BusPort") -> str:
        """See `CanopenSensor.bring_up`; of plain frames whether they come, long and often enough."""
        self._value, self._came = math.nan, math.nan
        return self._find_frame(port) if self._plain else super().bring_up(port)

    def _find_frame(self, port: "BusPort") -> str:
        given, others = self.given, set()

        def is_it(identifier: int, data: bytes) -> bool:
            others.add(identifier & ~EXTENDED)
            return identifier == self._frame

        frame = port.wait_for(is_it, LOOKED)
        if frame is None:
            there = ", ".join(f"{one:03X}h" for one in sorted(others)[:6])
            raise DriveError(
                f"no frame {given.identifier:03X}h of {self.what} came within {LOOKED:g} s"
                + (f"; there is {there}" if there else ""),
                expected="a load cell that sends by itself",
                do="check its supply, cable and bit rate, and load_cell.identifier",
            )
        if len(frame[1]) < given.first_byte + given.bytes:
            raise DriveError(
                f"the frames {given.identifier:03X}h of {self.what} have {len(frame[1])} bytes",
                expected=f"{given.first_byte + given.bytes} at least",
                do="correct first_byte and bytes in [load_cell]",
            )
        missed = sum(port.wait_for(is_it, given.silence) is None for _ in range(TRIAL))
        if missed > TRIAL // 2:
            raise DriveError(
                f"frames {given.identifier:03X}h of {self.what} come too seldom: {missed} of {TRIAL} times none came "
                f"within {1e3 * given.silence:g} ms",
                expected="one within load_cell.silence_ms",
                do="set a quicker rate in the device or its amplifier, 100 Hz at least",
            )
        return f"frames {given.identifier:03X}h, {abs(given.scale):g} {given.unit} a count"

    def _look(self, node: "Dialogue", kind: int) -> tuple[Sequence[int], str, str]:
        given, said = self.given, self._unit(node)
        return self._mapped(node), "a measuring device", f"{abs(given.scale):g} {given.unit} a count{said}"

    def _set_timer(self, node: "Dialogue") -> None:
        """Its event timer, 1800h:5 [ms], and no inhibit time, 1800h:3."""
        if not self.synced:
            if node.read_if_there(0x1800, 3):
                node.write(0x1800, 3, 0, 2)
            node.write(0x1800, 5, 1, 2)

    def _mapped(self, node: "Dialogue") -> tuple[int, ...]:
        """What it is to send: its process value, and its status where it has one."""
        number = self.given.input
        self._wide = node.read_if_there(VALUE_32, number) is not None
        if not self._wide and node.read_if_there(VALUE_16, number) is None:
            raise DriveError(
                f"{node.name}, {self.what}, has no input {number} as a whole number (9130h, 7130h)",
                expected="a device that has",
                do="correct load_cell.input",
            )
        value = (VALUE_32 if self._wide else VALUE_16) << 16 | number << 8 | (32 if self._wide else 16)
        if node.read_if_there(STATUS, number) is None:
            return (value,)
        return value, STATUS << 16 | number << 8 | 8

    def _unit(self, node: "Dialogue") -> str:
        """What the device says of its own unit, where that is the newton: the rig's scale may count a lever in."""
        number = self.given.input
        unit, digits = node.read_if_there(UNIT, number), node.read_if_there(DIGITS, number)
        if unit is None or digits is None or unit >> 16 & 0xFF != NEWTON:
            return ""
        power = (unit >> 24 ^ 0x80) - 0x80
        return f"; it says {10.0 ** (power - digits):g} N itself"

    def take(self, identifier: int, data: bytes, now: float) -> None:
        """Take in one of its frames at `now` [s]."""
        if self._plain:
            first, length = self.given.first_byte, self.given.bytes
            if identifier == self._frame and len(data) >= first + length:
                part = data[first : first + length]
                self._has(int.from_bytes(part, self.given.byte_order, signed=self.given.signed), 0, now)
            return
        size = 4 if self._wide else 2
        if self._measures(identifier, data, now) and len(data) in (size, size + 1):
            status = data[size] if len(data) > size else 0
            self._has(int.from_bytes(data[:size], "little", signed=True), status, now)

    def _has(self, counts: int, status: int, now: float) -> None:
        value, given = self.given.value(counts), self.given
        self._came = now
        if status & NOT_VALID:
            value = math.nan
        elif status & (OVERLOAD | UNDERLOAD):
            above = bool(status & OVERLOAD) is (given.scale > 0.0)
            value = max(value, given.full_scale) if above else min(value, -given.full_scale)
        self._value = usable(value, given.full_scale, given.measures)

    def value(self, now: float) -> float:
        """The load at `now` [s]; NaN of none that may be believed [N or N·m]."""
        fresh = now - self._came <= self.given.silence
        return self._value if fresh and (self._plain or self._good(now)) else math.nan


def usable(value: float, full_scale: float, measures: str) -> float:
    """A load as it is, or NaN: a tension at the lower end of the cell's range is a wire that is broken.

    >>> usable(-200.0, 200.0, "tension"), usable(-200.0, 200.0, "torque"), usable(250.0, 200.0, "tension")
    (nan, -200.0, 250.0)
    """
    return math.nan if measures == "tension" and value <= -full_scale else value
