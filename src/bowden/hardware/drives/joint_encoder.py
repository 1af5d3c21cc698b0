"""A joint's encoder that is a CANopen device of its own (CiA 406), beside a drive of any family on the same bus.

    TPDO 1  180h + node   6004h position u32 [counts], at SYNC or by the device's own timer (6200h)

Bring-up asks who it is, compares its resolution with the rig's, writes and reads back how it sends, and waits until it
is operational. From then on its heartbeat is watched: an angle of a device that is silent, not operational or in an
emergency is none, so that the joint's age grows.

Sources: CiA 406, "device profile for encoders" (objects 6000h to 6502h, in the edition 3.2 as makers' manuals have it);
CiA 301 for PDOs, heartbeat and emergency.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from bowden.core.errors import DriveError, ParameterError
from bowden.core.quantity import Quantity
from bowden.hardware.drives.canopen_sensor import CanopenSensor, identifiers_of_node
from bowden.hardware.drives.scale import LimitedRange, Scale

if TYPE_CHECKING:
    from bowden.hardware.drives.canopen_dialogue import Dialogue

KINDS = {1: "a single-turn absolute rotary encoder", 2: "a multi-turn absolute rotary encoder"}
"""High word of 1000h: those whose position says where the joint is."""
SCALED = 0x04
"""6000h: 6001h and 6002h count, and not the device's own resolution."""
POSITION = 0x6004_0020
"""Index, sub-index and length in bits of what TPDO 1 carries."""
BY_TIMER = 254
"""Transmission type: when the device's timer says so."""
JointSource = Annotated[
    Literal["cia406", "none"],
    Quantity(
        "what measures the joint: cia406, a CANopen encoder of its own on the same bus; none, with [joint_sensor]"
    ),
]
JointNode = Annotated[int, Quantity("number of the joint's encoder on the bus", ge=1, le=126)]
JointCounts = Annotated[float, Quantity("of the joint's encoder", gt=0.0, lt=1e9)]
JointDirection = Annotated[Literal[1, -1], Quantity("1 where the joint's counts rise with its angle, otherwise -1")]
JointHome = Annotated[float, Quantity("angle of the joint at home", "rad", ge=-720.0, le=720.0)]
JointSending = Annotated[
    Literal["sync", "timer"], Quantity("the joint's encoder sends at our SYNC of each cycle, or by a timer of its own")
]
"""The keys of [drive] that every family with such an encoder has: `joint`, `joint_node_id`, `joint_counts_per_turn`,
`joint_direction`, `joint_home`, `joint_sends`."""


def has_encoder(drive: Any) -> bool:
    """True if a drive's parameters, with the keys above, have such a device beside it."""
    return getattr(drive, "joint", "none") == "cia406"


def identifiers_of(drive: Any) -> dict[int, str]:
    """Identifier of each frame of the device beside a drive and to it → key of [drive] that it follows from; the
    network's have none.
    """
    return identifiers_of_node(drive.joint_node_id, "joint_node_id") if has_encoder(drive) else {}


def check_beside(drive: Any, taken: dict[int, str]) -> None:
    """Refuse identifiers of a drive that are CANopen's own on the same bus, where the joint's encoder is on it.

    Args:
        drive: parameters of its family.
        taken: identifier of a frame of the drive → key of [drive] that it follows from.

    Raises:
        ParameterError: one of them is the network's, or the encoder's.
    """
    own = identifiers_of(drive)
    for identifier, key in taken.items():
        if identifier in own:
            raise ParameterError(
                f"drive.{key} makes frames {identifier:03X}h, which are CANopen's for the joint's encoder",
                expected="numbers whose frames differ",
                do=f"correct drive.{key} or drive.joint_node_id, and the number set in the device",
            )


class JointEncoder(CanopenSensor):
    """The device; see `CanopenSensor`. By its own timer it sends every millisecond, the shortest that 6200h has.

    Args:
        drive: parameters of the drive's family, with the keys above.
    """

    what, quantity = "the joint's encoder", "its position"
    profile, kinds, by_timer = 406, KINDS, BY_TIMER
    expected = "profile 406 and type 1 or 2, an absolute rotary encoder"
    node_key = "joint_node_id in [drive]"
    sync_hint = 'set joint_sends = "timer" in [drive], if it has one'

    def __init__(self, drive: Any) -> None:
        super().__init__(drive.joint_node_id, drive.answer_timeout, synced=drive.joint_sends == "sync")
        self._drive, self._scale, self._turns = drive, Scale(1.0, 0.0), LimitedRange(math.inf)

    def wants(self, identifier: int) -> bool:
        """True if a frame is of it, or one that only its host may send."""
        return (identifier & 0x7F == self.node_id and identifier > 0x7F) or self.foreign(identifier)

    def _look(self, node: "Dialogue", kind: int) -> tuple[Sequence[int], str, str]:
        drive, counts = self._drive, self._drive.joint_counts_per_turn
        span = _check_resolution(node, counts)
        if node.read_if_there(0x6503):
            raise DriveError(
                f"{node.name}, {self.what}, reports an alarm (6503h is 0x{node.read(0x6503):X})",
                expected="no alarm",
                do="see what its maker's manual says of it",
            )
        step, at_home = drive.joint_direction * 2.0 * math.pi / counts, 0
        if drive.home == "here":
            at_home = node.read(0x6004)
        self._scale, self._turns = Scale(step, drive.joint_home - step * at_home), LimitedRange(span)
        self._turns.follow(at_home)  # angles begin within half a range of home
        return (POSITION,), KINDS[kind], f"{counts:g} counts a turn"

    def _set_timer(self, node: "Dialogue") -> None:
        """6200h [ms]."""
        if not self.synced:
            node.write(0x6200, 0, 1, 2)
        elif node.read_if_there(0x6200):
            node.write(0x6200, 0, 0, 2)

    def take(self, identifier: int, data: bytes, now: float) -> float | None:
        """The joint's angle, if this frame brings one [rad]; takes in what it says of itself."""
        if self._measures(identifier, data, now) and len(data) == 4:
            counts = self._turns.follow(float(int.from_bytes(data, "little")))
            if self._good(now):
                return self._scale.angle(counts)
        return None


def _check_resolution(node: "Dialogue", counts: float) -> float:
    """Compare the counts a turn with the rig's; after how many counts its position begins again."""
    if (node.read_if_there(0x6000) or 0) & SCALED:
        own, index, span = node.read(0x6001), 0x6001, node.read(0x6002)
    else:
        own, index = node.read(0x6501), 0x6501
        span = own * max(1, node.read_if_there(0x6502) or 1)
    if own != counts:
        raise DriveError(
            f"drive.joint_counts_per_turn is {counts:g}",
            expected=f"{own}, as {node.name} has it ({index:04X}h)",
            do="correct it in rig.toml, or the encoder's resolution with its maker's tool",
        )
    return float(span or 1 << 32)
