"""Serial servos: where things are in their memory, what a cycle asks of them, and what all their families share.

A servo is a table of registers that are read and written; its families differ in the table and in the packets.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity
from bowden.hardware.buses.packets import PROTOCOLS, STATUS, Packets, fast_answer
from bowden.hardware.drives import on_can
from bowden.hardware.drives.checklist import Setting, is_about
from bowden.hardware.drives.scale import Scale, motor_scale
from bowden.rig.families import DriveFamily

ADAPTER = 1e-3
"""For which a USB adapter may keep what it has received, its latency timer at the least [s]."""

DELAY_STEP = 2e-6
"""Of a count of the delay before an answer [s]."""

ServoNumber = Annotated[int, Quantity("the servo's number on its line, its ID", ge=0, le=252)]
ReturnDelay = Annotated[
    float,
    Quantity(
        "between a question and the servo's answer as it is set (Return Delay Time)", "s", shown="ms", ge=0.0, le=0.508
    ),
]
JointServo = Annotated[
    Literal["servo", "none"],
    Quantity("what measures the joint: servo, a second one of this model, without torque; none, with [joint_sensor]"),
]


class ServoRegister(NamedTuple):
    """A value in a servo's memory."""

    address: int
    size: int = 1
    """[bytes]"""
    signed: bool = False
    """True if it may be negative."""
    sign: int = 0
    """Of a servo that writes a sign and a magnitude the bit of the sign; otherwise it writes the complement of two."""

    def encode(self, value: int) -> bytes:
        """The value as bytes, within what they can hold."""
        most = (1 << self.sign) - 1 if self.sign else (1 << 8 * self.size - self.signed) - 1
        value = max(-most if self.signed else 0, min(most, value))
        if value < 0:
            value = -value | 1 << self.sign if self.sign else value + (1 << 8 * self.size)
        return value.to_bytes(self.size, "little")

    def decode(self, data: bytes) -> int:
        """The value of bytes, of which there are as many as it has."""
        value = int.from_bytes(data, "little")
        if not self.signed:
            return value
        if self.sign:
            return -(value & ~(1 << self.sign)) if value >> self.sign else value
        return value - (1 << 8 * self.size) if value >> 8 * self.size - 1 else value


class ServoSample(NamedTuple):
    """What a servo says in a cycle."""

    torque: int
    """True if it may have torque."""
    error: int
    watch: int
    """Its watchdog over its host; 0 of one without."""
    current: int
    position: int
    temperature: int
    """[°C]"""


CYCLIC = ("Torque Enable", "Hardware Error Status", "Bus Watchdog", "Present Current", "Present Position",
          "Present Temperature")  # fmt: skip
"""Registers of a `ServoSample`, in its order; what a servo has not stays 0."""


class ServoTable(NamedTuple):
    """A servo's memory."""

    protocol: str
    """Name in `packets.PROTOCOLS`."""
    registers: Mapping[str, ServoRegister]
    """By the makers' names; a name for one thing in both families."""
    model: int
    """Its number."""
    turn: int
    """Counts of a turn of its output shaft."""
    current_step: float
    """Of a count of its current [A]."""
    furthest: int
    """Counts that it counts to, either way."""
    lowest: int = 0
    """Of the turn in which it finds itself after power-off."""
    indirect: tuple[int, int] | None = None
    """Where the addresses stand of what is shown in one piece, and where it is shown; None where it is so anyhow."""
    watch_step: float = math.inf
    """Of a count of its watchdog; infinite of one without [s]."""
    multi_turn: bool = True
    """Whether it goes beyond a turn."""
    moved: tuple[int, int] | None = None
    """Firmware from which on `indirect` is shown elsewhere, and where; None of a servo of which it never is."""

    @property
    def packets(self) -> Packets:
        """Of its protocol."""
        return PROTOCOLS[self.protocol]

    def of(self, firmware: int) -> "ServoTable":
        """As a servo of that firmware has it."""
        if self.indirect is None or self.moved is None or firmware < self.moved[0]:
            return self
        return self._replace(indirect=(self.indirect[0], self.moved[1]))

    def parts(self) -> list[ServoRegister | None]:
        """The registers of a `ServoSample`; None of what it has not."""
        return [self.registers.get(name) for name in CYCLIC]

    def block(self) -> tuple[int, int, tuple[int, ...]]:
        """What a cycle reads: its address, its length, and where in it the parts of a `ServoSample` begin."""
        parts = self.parts()
        there = [one for one in parts if one is not None]
        if self.indirect is None:
            first = min(one.address for one in there)
            length = max(one.address + one.size for one in there) - first
            return first, length, tuple(one.address - first if one else -1 for one in parts)
        starts, at = [], 0
        for one in parts:
            starts.append(at if one else -1)
            at += one.size if one else 0
        return self.indirect[1], at, tuple(starts)

    def indirection(self) -> bytes:
        """What has to be written to the first of `indirect`, that a cycle finds what it reads in one piece."""
        return b"".join(
            (one.address + i).to_bytes(2, "little") for one in self.parts() if one is not None for i in range(one.size)
        )


class ServoSetup(NamedTuple):
    """What a family asks of the servos of a rig."""

    motor: tuple[Setting, ...]
    """What the motor's must be set to, by whoever owns it; see `servo_drive`."""
    joint: tuple[Setting, ...]
    """Likewise the one on the joint."""
    preset: Mapping[str, int]
    """What is written and read back at every bring-up, of what a servo forgets at power-off."""
    as_new: Mapping[str, int]
    """What one has in its registers that is set as the rig says; for its twin."""
    names: Mapping[int, str]
    """Number of a model → its name, of all that there are."""
    watch: int = 0
    """Of its watchdog; 0 of one without."""

    @property
    def cleared(self) -> tuple[tuple[str, int], ...]:
        """What is written when an operator acknowledges that its watchdog has run out."""
        return (("Bus Watchdog", 0), ("Bus Watchdog", self.watch)) if self.watch else ()


WATCH_RAN_OUT = 0x100
"""Error of a servo whose watchdog has run out; below it is the hardware error status."""


def error_of(sample: ServoSample) -> int:
    """What is wrong with a servo, 0 for nothing."""
    return sample.error | (WATCH_RAN_OUT if sample.watch == 0xFF else 0)


class BlockReader:
    """Makes a `ServoSample` of what a cycle has read."""

    def __init__(self, table: ServoTable) -> None:
        _, self.length, starts = table.block()
        self._parts = tuple(zip(table.parts(), starts, strict=True))

    def sample(self, data: bytes) -> ServoSample:
        """Of as many bytes as the block has."""
        return ServoSample(*(one.decode(data[at : at + one.size]) if one is not None else 0 for one, at in self._parts))


def cycle_time(drives: Sequence[Any]) -> float:
    """What a cycle takes with these drives on one line, and the servos on their joints: targets out, readings in [s].

    10 bits a byte, one sync write, one sync read and the answers, each after its servo's delay; and the adapter's time.
    """
    first = drives[0]
    table, packets = first.table, first.table.packets
    count = sum(2 if one.joint == "servo" else 1 for one in drives)
    address, length, _ = table.block()
    goal = table.registers["Goal Position"]
    write = packets.sync_write(goal.address, goal.size) + bytes(len(drives) * (1 + goal.size))
    ask = packets.sync_read(address, length, fast=packets.fast) + bytes(count)
    answer = (1, bytes((STATUS, 0)) + bytes(length))
    answers = len(fast_answer([answer] * count)) if packets.fast else count * len(packets.pack(*answer))
    sent = len(packets.pack(1, write)) + len(packets.pack(1, ask)) + answers
    delays = first.return_delay if packets.fast else sum(one.return_delay for one in drives) * count / len(drives)
    return 10.0 * sent / first.bitrate + delays + ADAPTER


def motor_step(drive: Any) -> float:
    """Of a count of a servo, see `scale.motor_scale` [rad]."""
    step: float = drive.motor_direction * 2.0 * math.pi / (drive.table.turn * drive.needs.gear)
    return step


def joint_scale(drive: Any) -> Scale:
    """Counts of the servo on the joint to the joint's angle, from home."""
    return Scale(drive.joint_direction * 2.0 * math.pi / drive.table.turn, drive.joint_home)


def identifiers(drive: Any) -> dict[int, str]:
    """See `on_can.collision`: the servos' numbers."""
    return {**({drive.joint_node_id: "joint_node_id"} if drive.joint == "servo" else {}), drive.node_id: "node_id"}


def delay_setting(drive: Any) -> Setting:
    """That it answers as soon as the rig says."""
    return Setting(
        "Return Delay Time",
        is_about(round(drive.return_delay / DELAY_STEP)),
        f"{drive.return_delay / DELAY_STEP:.0f}, {1e3 * drive.return_delay:g} ms",
        "answers later or sooner than the rig says",
        "set it with its maker's tool, or correct return_delay_ms in [drive]",
    )


def rules(drive: Any) -> Iterator[on_can.Rule]:
    """What must hold of a serial servo; see `on_can.require`.

    Raises:
        ParameterError: a cycle that the line is too slow for, or a range of which a restart would forget the turn.
    """
    yield from on_can.rules_of_rig(drive, (1e-3, 0.05))
    yield "interface", drive.interface in ("bowden_unix", "serial"), "serial, or bowden_unix for the twin"
    yield "joint_node_id", drive.joint == "none" or drive.joint_node_id != drive.node_id, "not the motor's node_id"
    shortest = cycle_time((drive,))
    if drive.needs.sample_time < shortest:
        raise ParameterError(
            f"a cycle of {1e3 * drive.needs.sample_time:g} ms is too short for these servos at {drive.bitrate} bit/s",
            expected=f"{1e3 * shortest:.2f} ms or more",
            do="raise bench.sample_time_ms, or the bit rate of the servos and of [drive]; lower their Return Delay "
            "Time and return_delay_ms",
        )
    if drive.home == "counts" or not drive.table.multi_turn:
        expected = "less than a turn" + (' with home = "counts"' if drive.table.multi_turn else "")
        do = (on_can.TELL_TURN if drive.table.multi_turn else "") + "make the range in [limits] smaller"
        scale, turn = motor_scale(drive), float(drive.table.turn)
        on_can.check_turn(drive, scale, turn, "the servo, which forgets", expected, do)


_BENCH: Mapping[str, Mapping[str, Any]] = {
    "bench": {"sample_time_ms": 5.0},
    "encoder.joint": {"resolution_deg": 0.087890625},
    "encoder.motor": {"resolution_deg": 0.087890625},
    "drive": {"motor_home_deg": -90.0},
}
"""Of a bench with servos of 4096 counts a turn, for ``bowden init --drive``."""


def family(
    parameters: Any, title: str, *, unseen_watch: str, example: Mapping[str, Mapping[str, Any]], **rest: Any
) -> DriveFamily:
    """A family of serial servos; see `on_can.family`.

    Args:
        parameters: the default.
        title: what it is.
        unseen_watch: why its torque stays when this computer dies.
        example: what a bench with it has beside what all have.
        rest: other arguments of `on_can.family`.
    """
    return on_can.family(
        parameters,
        title,
        driver="drives.servo_drive.ServoDrive",
        probe="drives.servo_drive.probe",
        options=("register",),
        scales=("model", "motor_direction", "joint", "joint_direction"),
        cycle_time=cycle_time,
        unseen_watch=lambda _: unseen_watch,
        no_limb=lambda drive: drive.no_limb,
        holds=True,
        example={**_BENCH, **example},
        **rest,
    )
