"""The twin of a serial servo of any family, and of the one on the joint, which has no torque.

Each is its memory: a table of registers with what a new servo has in them, but for what the rig says is set. What is
read is measured in that moment; what is written takes effect at once. Power-off is forgotten by the registers of RAM
and by the turn in which the motor was.

What the manuals do not say, and is chosen here: a servo whose watchdog has run out stays where it is, with torque; an
error of a Feetech servo is gone half a second later.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from bowden.core.signals import DriveState
from bowden.hardware.buses.packets import ALL, STATUS, Instruction
from bowden.hardware.drives.servo_table import ServoTable, joint_scale
from bowden.hardware.twin.faults import NO_NUMBER
from bowden.hardware.twin.injection import UNCOUNTED
from bowden.hardware.twin.node import HOTTEST, TwinNode
from bowden.hardware.twin.plant import FOLLOW, OFF, Doing

OVERHEATING, OVERLOAD = 0x04, 0x20
"""Errors of the faults that the twin finds itself, or is given by a number that is none of the servo's."""
RAN_OUT = 0xFF
"""Of a watchdog over the host."""
READ_ONLY, NO_INSTRUCTION, OUT_OF_RANGE, SHORT = 0x07, 0x02, 0x04, 0x05
"""Errors of an answer (Dynamixel protocol 2.0, "Error")."""
ALERT = 0x80
"""In the error of each answer of a servo with one."""
KICK = 20e-3
"""How long it pulls towards a target that it remembers, where that is injected [s]."""
CLEARED = 0.5
"""After which a servo that knows no restart over its line tells an error no more [s]."""
SIZE = 1024
"""Of a memory [bytes]."""


class ServoMemory:
    """Registers of one servo.

    Args:
        table: where they are.
        number: of the servo.
        given: register → what it has at power-on.
        overrides: address → byte that is otherwise, and stays so.
    """

    def __init__(self, table: ServoTable, number: int, given: Mapping[str, int], overrides: Mapping[int, int]) -> None:
        self.table, self.number, self._given, self._overrides = table, number, given, overrides
        self.power_up()

    def power_up(self) -> None:
        """As after switching on."""
        self.bytes = bytearray(SIZE)
        for name, value in self._given.items():
            self[name] = value
        for address, value in self._overrides.items():
            self.bytes[address] = value

    def __contains__(self, name: str) -> bool:
        return name in self.table.registers

    def __getitem__(self, name: str) -> int:
        one = self.table.registers[name]
        return one.decode(bytes(self.bytes[one.address : one.address + one.size]))

    def __setitem__(self, name: str, value: int) -> None:
        if name in self.table.registers:
            one = self.table.registers[name]
            self.write(one.address, one.encode(value))

    def read(self, address: int, length: int) -> bytes:
        """What stands there; where indirect addresses say so, what stands elsewhere."""
        indirect = self.table.of(self["Firmware Version"]).indirect
        if indirect is None or address != indirect[1]:
            return bytes(self.bytes[address : address + length])
        first = indirect[0]
        places = (int.from_bytes(self.bytes[first + 2 * i : first + 2 * i + 2], "little") for i in range(length))
        return bytes(self.bytes[place % SIZE] for place in places)

    def write(self, address: int, value: bytes) -> None:
        """Keep it, but for what is otherwise whatever is written."""
        self.bytes[address : address + len(value)] = value
        for at in range(address, address + len(value)):
            if at in self._overrides:
                self.bytes[at] = self._overrides[at]


class ServoNode(TwinNode):
    """The servo, and the one on the joint."""

    _drive: Any

    lacks: ClassVar[Mapping[str, str]] = {
        "doubled_pdos": UNCOUNTED,
        "emergency_stop": "a serial servo has no input for it, and its supply is cut: inject reboot, or silence",
        "encoder_nan motor": "its position has no number that means none",
        "encoder_nan joint": "its position has no number that means none",
        "saturated": "it tells no speed, and its current has no end that a motor reaches",
    }

    def _prepare(self) -> None:
        drive, table = self._drive, self._drive.table
        self.turn = float(table.turn)
        given = drive.setup.as_new
        registers = {key: int(value) for key, value in self._overrides.items() if isinstance(key, int)}
        self._own = ServoMemory(table, drive.node_id, given, registers)
        self._joint = ServoMemory(table, drive.joint_node_id, given, {}) if drive.joint == "servo" else None
        self._joint_scale = joint_scale(drive)
        self._kicks_until = self._failed = -math.inf

    def _power_up(self) -> None:
        for one in (self._own, self._joint):
            if one is not None:
                one.power_up()
        if math.isfinite(self._ready):
            lowest = self._drive.table.lowest
            self._shift -= self.turn * math.floor((self._position() - lowest) / self.turn)

    @property
    def _torque(self) -> bool:
        return bool(self._own["Torque Enable"])

    @property
    def _error(self) -> int:
        return self._own["Hardware Error Status"]

    def _standing(self) -> tuple[DriveState, int, dict[str, Any]]:
        state = DriveState.OPERATION_ENABLED if self._torque else DriveState.SWITCH_ON_DISABLED
        return DriveState.FAULT if self._error else state, self._error, {}

    def receive(self, identifier: int, data: bytes, now: float) -> None:
        """See `TwinNode.receive`."""
        joint = None if self.faults.active("joint_silence", now) else self._joint
        there = [one for one in (self._own, joint) if one is not None]
        heard = [one for one in there if identifier in (one.number, ALL)]
        if not heard or not data or data[0] == STATUS or self._is_destroyed(now) or not self._is_receiving(now):
            return
        self._move(now)  # up to here under the order before
        if data[0] != Instruction.SYNC_WRITE or self._own in heard:
            self.host = now
        for one in heard:
            self._obey(one, identifier, data, now)

    def _obey(self, one: ServoMemory, identifier: int, data: bytes, now: float) -> None:
        packets = one.table.packets
        match data[0]:
            case Instruction.PING:
                said = one.read(one.table.registers["Model Number"].address, 2) + bytes((one["Firmware Version"],))
                self._answer(one, said if packets.fast else b"", now)
            case Instruction.READ if identifier != ALL:
                address, length, _ = packets.asked(data)
                self._tell(one, address, length, now)
            case Instruction.WRITE:
                address = int.from_bytes(data[1 : 1 + packets.width], "little")
                error = self._write(one, address, data[1 + packets.width :], now)
                if identifier != ALL:
                    self._answer(one, b"", now, error)
            case Instruction.SYNC_WRITE:
                address, length, parts = packets.asked(data)
                for at in range(0, len(parts) - length, length + 1):
                    if parts[at] == one.number:
                        self._write(one, address, parts[at + 1 : at + 1 + length], now)
            case Instruction.SYNC_READ | Instruction.FAST_SYNC_READ:
                address, length, numbers = packets.asked(data)
                if one.number in numbers and (packets.fast or data[0] == Instruction.SYNC_READ):
                    self._tell(one, address, length, now, cyclic=True)
            case Instruction.REBOOT if one is self._own and identifier != ALL:
                self._answer(one, b"", now)
                self._journal(now, "reboot", "")
                self._restart(now, "reboot")
            case _:
                if identifier != ALL:
                    self._answer(one, b"", now, NO_INSTRUCTION)

    def _answer(self, one: ServoMemory, said: bytes, now: float, error: int = 0, *, cyclic: bool = False) -> None:
        wrong = self._error if one is self._own else 0
        alert = (ALERT if wrong else 0) if one.table.packets.fast else wrong
        emit = self._outbox.emit_cyclic if cyclic else self._outbox.emit
        emit(one.number, bytes((STATUS, error | alert)) + said, now)
        if cyclic and one is self._own and self.faults.active("foreign_replies", now):
            emit((one.number + 100) % 252, bytes((STATUS, 0)) + said, now)

    def _tell(self, one: ServoMemory, address: int, length: int, now: float, *, cyclic: bool = False) -> None:
        """What stands there, the measured values as they are now."""
        if not length or address + length > SIZE:
            self._answer(one, b"", now, OUT_OF_RANGE)
            return
        if one is self._own:
            self._measure(now)
        else:
            one["Present Position"] = self._joint_counts(now)
            one["Present Temperature"] = round(self.bench.physics.ambient)
        self._answer(one, one.read(address, length), now, cyclic=cyclic)

    def _measure(self, now: float) -> None:
        """Into the memory, with the faults of the sensors."""
        drive, own, bench = self._drive, self._own, self.bench
        counts = self._scale.counts(bench.read_encoders()[1]) + self._shift
        counts = self.faults.encoder("motor", counts, abs(self._scale.step), now)
        counts = max(-float(own.table.furthest), min(float(own.table.furthest), counts))
        current = drive.motor_direction * self._current(now) / own.table.current_step
        self._history.append((round(counts), round(current), round(bench.temperature)))
        sample = self._delayed(now)
        own["Present Position"], own["Present Current"], own["Present Temperature"] = sample

    def _joint_counts(self, now: float) -> int:
        scale = self._joint_scale
        counts = self.faults.encoder("joint", scale.counts(self.bench.read_encoders()[0]), abs(scale.step), now)
        counts = 0.0 if counts == NO_NUMBER else counts
        return round(counts) % self._drive.table.turn

    def _write(self, one: ServoMemory, address: int, value: bytes, now: float) -> int:
        """Set it; the error of an answer, 0 for none."""
        goal = one.table.registers["Goal Position"]
        if address + len(value) > SIZE:
            return OUT_OF_RANGE
        if not value:
            return SHORT
        if one is self._own and self.faults.active("commands_ignored", now):
            return 0
        if address <= goal.address < address + len(value) and self._ran_out(one):
            return OUT_OF_RANGE
        before = self._torque
        one.write(address, value)
        if one is self._own:
            if self._torque and not before:
                self._enable(now)
            self._order(now, "Torque Enable is 0")
        return 0

    def _ran_out(self, one: ServoMemory) -> bool:
        return "Bus Watchdog" in one and one["Bus Watchdog"] == RAN_OUT

    def _enable(self, now: float) -> None:
        if self._error:
            self._own["Torque Enable"] = 0
            return
        self._journal(now, "state", DriveState.OPERATION_ENABLED.name)
        self._own["Goal Position"] = self._own["Goal Position"] or round(self._position())
        kick = self.faults.active("kick", now)
        if kick:
            self._own["Goal Position"] = round(self._position() + math.radians(kick.amount) / abs(self._scale.step))
            self._kicks_until = now + KICK

    def _order(self, now: float, why: str) -> None:
        self._power(now, on=self._torque, why=why)

    def _stop(self, now: float, why: str) -> None:
        if self._torque:
            self._journal(now, "state", DriveState.SWITCH_ON_DISABLED.name)
        self._own["Torque Enable"] = 0
        self._order(now, why)

    def _code_of(self, amount: int) -> int:
        return amount if 0 < amount <= 0x7F else OVERLOAD

    def _fail(self, code: int, now: float) -> None:
        self._own["Hardware Error Status"] = self._error | code
        self._failed = now
        self._journal(now, "fault", f"0x{code:02X}")
        self._stop(now, DriveState.FAULT.name)

    def _watch(self, now: float) -> None:
        own = self._own
        if not own.table.packets.fast and self._error and now - self._failed >= CLEARED:
            own["Hardware Error Status"] = 0
        if "Bus Watchdog" not in own:
            return
        if self.faults.active("watch_off", now):
            own["Bus Watchdog"] = 0
        limit = max(own["Bus Watchdog"] * own.table.watch_step, self.patience)
        if 0 < own["Bus Watchdog"] < RAN_OUT and self._torque and now - self.host >= limit:
            own["Bus Watchdog"] = RAN_OUT
            own["Goal Position"] = round(self._position())
            self._journal(now, "watchdog", "stops, and holds")

    def _command_motor(self, now: float, span: float) -> Doing:
        doing = self._follow_or_inert(now, FOLLOW if self._torque else OFF)
        if doing == FOLLOW:
            self.bench.command = self._scale.angle(self._own["Goal Position"] - self._shift)
        return doing

    def _protect(self, now: float) -> None:
        if self.bench.temperature >= HOTTEST and not self._error:
            self._fail(OVERHEATING, now)


class FeetechNode(ServoNode):
    """A Feetech servo."""

    lacks: ClassVar[Mapping[str, str]] = {**ServoNode.lacks, "watch_off": "it has no watchdog over its host"}
