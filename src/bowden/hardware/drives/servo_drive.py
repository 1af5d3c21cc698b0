"""A serial servo as the live loop's `Drive`: targets in one sync write, readings in one sync read, no thread, no wait.

All servos of a line are written and asked together, once the last of their drivers has had its say in a cycle
(`BusPort.gather`). Without power a servo is told in every cycle that its torque is off. With power it is first given
its own position for a target, then its torque, and it follows once it has said that it has torque: enabling moves
nothing. Whatever a servo forgets at power-off is written and read back at bring-up; what it keeps is compared and never
written.
"""

import math
from typing import Any

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.packets import ALL, HIGHEST, STATUS, Instruction
from bowden.hardware.buses.place import ERROR
from bowden.hardware.drives.checklist import (
    CURRENT,
    TRIES,
    Conversation,
    DriveLimit,
    Found,
    check_limits,
    check_settings,
    refuse_torque,
)
from bowden.hardware.drives.driver import Driver
from bowden.hardware.drives.findings import JOINT_SERVO, UNWATCHED
from bowden.hardware.drives.on_can import place
from bowden.hardware.drives.scale import MotorLimits, Scale, SuitScale, found_scale, motor_limits
from bowden.hardware.drives.servo_table import BlockReader, ServoSample, error_of, joint_scale
from bowden.hardware.ports import Power
from bowden.rig.families import FoundDevice

LISTENING = 0.3
"""So long the line is listened to before anything is said on it [s]."""
STILL = 8
"""Counts within which a motor stands still between two readings, of 4096 a turn."""
BETWEEN, PING_BITS = 4e-3, 240
"""For an answer of one who may be there, when all are looked for [s], and the bits of a question and its answer."""


class ServoDialogue(Conversation):
    """Questions and answers with one servo.

    Args:
        port: of its line, while no cycle runs.
        drive: parameters of its family.
        number: which servo.
    """

    def __init__(self, port: BusPort, drive: Any, number: int) -> None:
        super().__init__(port, number, lambda *frame: is_foreign(number, *frame), drive.answer_timeout)
        self._drive, self.table, self.name = drive, drive.table, f"servo {number}"

    def _ask(self, data: bytes, length: int, to: int | None = None) -> bytes | None:
        """What follows the error in the servo's answer, of so many bytes, to a question to it or to a number."""

        def answered(identifier: int, said: bytes) -> bytes | None:
            fine = identifier == self.number and said[0] == STATUS and len(said) == 2 + length
            return said[2:] if fine else None

        return self.ask((self.number if to is None else to, data), answered)

    def find(self) -> int:
        """Its model's number.

        Raises:
            DriveError: nobody answers, or more than one does.
        """
        self.check_alone()
        port, answers = self.port, 0

        def counted(identifier: int, said: bytes) -> None:
            nonlocal answers
            answers += identifier == self.number and said[0] == STATUS

        for _ in range(TRIES):
            garbled = port.errors
            port.send_now(self.number, bytes((Instruction.PING,)))
            self.wait(self._timeout, counted)
            if answers:
                break
        if answers > 1:
            raise DriveError(
                f"{answers} servos answer as {self.number}",
                expected="a number of its own for each",
                do="take all but one off the line, and give that one another ID with its maker's tool",
            )
        if not answers and port.errors > garbled:
            raise DriveError(
                f"what answers as {self.name} cannot be read at {self._drive.bitrate} bit/s",
                expected="one servo of that number",
                do="look for two servos of one ID, another bit rate or a bad cable: connect one servo alone",
            )
        if not answers:
            raise DriveError(
                f"nobody answers as {self.name} at {self._drive.bitrate} bit/s",
                expected=f"a servo that speaks {self.table.packets.name}",
                do="switch its supply on; check its cable, its ID and its baud rate with its maker's tool, and node_id "
                "and bitrate in [drive]",
            )
        return self.get("Model Number")

    def get(self, name: str) -> int:
        """A register.

        Raises:
            DriveError: no answer.
        """
        register = self.table.registers[name]
        said = self._ask(self.table.packets.read(register.address, register.size), register.size)
        if said is None:
            raise DriveError(
                f"{self.name} does not tell its {name} ({register.address})",
                expected="an answer to every question",
                do="set its Status Return Level to answer all with its maker's tool; check its cable",
            )
        return register.decode(said)

    def set(self, name: str, value: int) -> None:
        """A register, which is read back.

        Raises:
            DriveError: it has another value afterwards.
        """
        register = self.table.registers[name]
        head = self.table.packets.sync_write(register.address, register.size)  # to which nobody answers
        self.port.send_now(ALL, head + bytes((self.number,)) + register.encode(value))
        found = self.get(name)
        if found != value:
            raise DriveError(
                f"{self.name} has {name} {found} after {value} was written",
                expected=f"{value}",
                do="look up what its firmware allows, and load a later one with its maker's tool",
            )

    def sample(self, fast: bool) -> ServoSample | None:
        """What it says in a cycle; None where it does not answer such a question."""
        address, length, _ = self.table.block()
        head = self.table.packets.sync_read(address, length, fast=fast)
        said = self._ask(head + bytes((self.number,)), length, ALL)
        return None if said is None else BlockReader(self.table).sample(said)

    def prepare(self) -> ServoSample:
        """Let it show in one piece what a cycle reads, and read that.

        Raises:
            DriveError: it is another model than the rig says, has torque, or does not answer.
        """
        table, drive = self.table, self._drive
        model = self.find()
        if model != table.model:
            raise DriveError(
                f"{self.name} is model number {model}",
                expected=f"{table.model}, {'a' if drive.family == 'dynamixel' else 'an'} {drive.model}",
                do="correct drive.model, or node_id: another model has other counts, currents and addresses",
            )
        table = self.table = table.of(self.get("Firmware Version"))
        if self.get("Torque Enable"):
            do = "end the program that holds it, or switch its supply off and on"
            raise refuse_torque(self.name, "torque: Torque Enable is 1", do)
        if table.indirect is not None:
            shown = table.indirection()
            self.port.send_now(
                ALL, table.packets.sync_write(table.indirect[0], len(shown)) + bytes((self.number,)) + shown
            )
            if self._ask(table.packets.read(table.indirect[0], len(shown)), len(shown)) != shown:
                raise DriveError(
                    f"{self.name} does not keep its indirect addresses ({table.indirect[0]})",
                    expected="what was written to them",
                    do="load a later firmware with its maker's tool",
                )
        sample = self.sample(fast=False)
        if sample is None:
            raise DriveError(
                f"{self.name} does not answer a sync read",
                expected="an answer",
                do="look for two servos of one ID: connect one alone; or load a later firmware with its maker's tool",
            )
        return sample


def is_foreign(number: int, identifier: int, data: bytes) -> bool:
    """Whether a frame is an instruction that only this host may give."""
    return identifier in (number, ALL) and bool(data) and data[0] != STATUS


class ServoDrive(Driver):
    """The drive of one motor, and the servo on its joint."""

    _drive: Any
    synced = True

    def _prepare(self) -> None:
        drive, table = self._drive, self._drive.table
        self._table = table  # of the servos' firmware, once it is known
        self._reader, self._packets = BlockReader(table), table.packets
        self.turn, self.most_counts = float(table.turn), float(table.furthest)
        self._goal, torque = table.registers["Goal Position"], table.registers["Torque Enable"]
        self._goal_head = self._packets.sync_write(self._goal.address, self._goal.size)
        self._torque_head = self._packets.sync_write(torque.address, torque.size)
        self._numbers = (drive.node_id, drive.joint_node_id) if drive.joint == "servo" else (drive.node_id,)
        self._fast, self._watch = False, drive.setup.watch
        self._joint_scale, self._joint_zero = joint_scale(drive), 0.0

    def _concerns(self, identifier: int) -> bool:
        return identifier in (*self._numbers, ALL)

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        return not identifier & ERROR and any(is_foreign(number, identifier, data) for number in self._numbers)

    def _find(self, port: BusPort) -> Found:
        drive, table = self._drive, self._drive.table
        servo = ServoDialogue(port, drive, drive.node_id)
        servo.listen(LISTENING)
        first = servo.prepare()
        check_settings(servo.name, servo.get, drive.setup.motor)
        for name, value in (
            *drive.setup.cleared,
            *drive.setup.preset.items(),
        ):  # a watchdog that ran out locks what is set
            servo.set(name, value)
        firmware = servo.get("Firmware Version")
        self._table, servos = servo.table, [servo]
        if drive.joint == "servo":
            servos.append(self._find_joint(port))
        self._fast = self._packets.fast and all(one.sample(fast=True) is not None for one in servos)
        last = servo.sample(fast=False) or first
        if abs(last.position - first.position) > STILL * table.turn / 4096:
            raise DriveError(
                f"the position of {servo.name} is {first.position} and then {last.position}",
                expected="a motor that stands still",
                do="hold it, and check what pulls at it",
            )
        scale = found_scale(drive, last.position, self.turn)
        limits = motor_limits(drive, scale)
        self._check_limits(servo, scale, limits)
        servo.check_alone()
        error = error_of(last)
        who = f"{drive.model} at {servo.name}, firmware {firmware}"
        if error:
            who += f"; in fault, 0x{error:02X}"
        state = DriveState.FAULT if error else DriveState.SWITCH_ON_DISABLED
        return Found(who, scale, None, limits, state, error, "")

    def _find_joint(self, port: BusPort) -> ServoDialogue:
        """The servo on the joint, whose counts at home are kept."""
        drive = self._drive
        on_joint = ServoDialogue(port, drive, drive.joint_node_id)
        position = on_joint.prepare().position
        check_settings(on_joint.name, on_joint.get, drive.setup.joint)
        if on_joint.table != self._table:
            raise DriveError(
                f"{on_joint.name} and servo {drive.node_id} have firmware with different addresses",
                expected="one question that both understand",
                do="load the later firmware into both with their maker's tool",
            )
        self._joint_zero = float(position) if drive.home == "here" else 0.0
        return on_joint

    def _check_limits(self, servo: ServoDialogue, scale: Scale | SuitScale, limits: MotorLimits) -> None:
        """That the servo counts as far, that it finds its turn again after power-off, and that it gives the current."""
        drive, table = self._drive, self._drive.table
        low, high = table.lowest, table.lowest + table.turn - 1
        if "Homing Offset" in table.registers:
            low, high = (end + servo.get("Homing Offset") for end in (low, high))
        elif (least := servo.get("Min Position Limit")) < (most := servo.get("Max Position Limit")):
            low, high = least, most
        inside = (drive.home != "counts" and table.multi_turn) or all(
            not math.isfinite(end) or low <= end <= high for end in (limits.low, limits.high)
        )
        if not inside:
            raise DriveError(
                f"the motor goes from {limits.low:.0f} to {limits.high:.0f} counts, and {servo.name} finds itself "
                f"between {low} and {high} after power-off",
                expected="a range within that turn",
                do="put the horn or the spool on so that it is, with motor_home_deg in [drive]; "
                + ('or set home = "hint" with motor_hint_deg, or home = "here"' if table.multi_turn else ""),
            )
        if "Current Limit" in table.registers:
            own = table.current_step * servo.get("Current Limit")
            check_limits(
                (DriveLimit(CURRENT, drive.needs.current_limit, own, "Current Limit (38)"),), "with its maker's tool"
            )

    def _least_current(self, found: Found) -> float:
        return float(self._drive.table.current_step)

    def _begin(self, found: Found | None) -> None:
        self._primed = 0
        self._torque, self._position = False, 0

    def _take(self, identifier: int, data: bytes, now: float) -> bool:
        if identifier not in self._numbers or not data or data[0] != STATUS:
            return False
        if len(data) != 2 + self._reader.length:
            self._readings.foreign += float(not self._packets.fast)  # a Feetech servo's packets do not say who speaks
            return True
        sample = self._reader.sample(data[2:])
        if identifier == self._drive.node_id:
            self._take_motor(sample, now)
        else:
            self._take_joint(sample)
        return True

    def _take_motor(self, sample: ServoSample, now: float) -> None:
        drive, readings, found = self._drive, self._readings, self._found
        self._answered()
        readings.replied_at = now
        self._torque, self._position = bool(sample.torque), sample.position
        if self._lost or found is None:
            return  # whatever it says: its position may be another
        readings.failed(error_of(sample))
        if "Bus Watchdog" in drive.table.registers and sample.watch not in (self._watch, 0xFF):
            readings.found(UNWATCHED)
        self._check_turns(float(sample.position), now)
        if self._lost:
            return
        current = drive.motor_direction * drive.table.current_step * sample.current
        sampled = now if math.isnan(self._written) else self._written
        readings.moved(found.motor.angle(sample.position), current, float(sample.temperature), sampled)

    def _take_joint(self, sample: ServoSample) -> None:
        """The joint's angle, in the turn around home: its servo forgets the turn as well."""
        turn = float(self._drive.table.turn)
        counts = (sample.position - self._joint_zero + 0.5 * turn) % turn - 0.5 * turn
        self._readings.turned(self._joint_scale.angle(counts))
        if sample.torque or sample.error:
            self._readings.found(JOINT_SERVO)

    def _standing(self) -> DriveState:
        error = self._readings.error
        if not self._up or self._lost:
            return DriveState.NOT_READY_TO_SWITCH_ON
        if self._torque:
            return DriveState.FAULT_REACTION_ACTIVE if error else DriveState.OPERATION_ENABLED
        return DriveState.FAULT if error else DriveState.SWITCH_ON_DISABLED

    def _can_lead(self) -> bool:
        return not self._readings.error

    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        number = bytes((self._drive.node_id,))
        if self._state is DriveState.OPERATION_ENABLED:
            self._primed, self._led, self._target = 0, self._led + 1, target
            self._gather((self._goal_head, number + self._goal.encode(round(counts))))
            return
        self._primed += 1
        here = (self._goal_head, number + self._goal.encode(self._position))
        self._gather(here, *(((self._torque_head, number + b"\x01"),) if self._primed > 1 else ()))

    def _relax(self, power: Power, now: float) -> None:
        """It has no quick stop: that is power off."""
        drive, number = self._drive, self._drive.node_id
        self._primed = 0
        if self._reset and self._readings.error:
            self._reset = False
            if self._readings.error & 0xFF and drive.table.packets.fast:
                self._send(number, bytes((Instruction.REBOOT,)))
                self._lost = True  # its turn may be another: it has to be brought up again
            else:
                for name, value in drive.setup.cleared:
                    register = drive.table.registers[name]
                    head = self._packets.sync_write(register.address, register.size)
                    self._send(ALL, head + bytes((number,)) + register.encode(value))
        self._gather((self._torque_head, bytes((number, 0))))

    def _gather(self, *writes: tuple[bytes, bytes]) -> None:
        """What this driver writes in this cycle, and whom it asks."""
        self._ordered()
        if self._port is not None:
            self._port.gather(ALL, writes, (self._question(), bytes(self._numbers)))

    def _question(self) -> bytes:
        address, length, _ = self._table.block()
        return self._packets.sync_read(address, length, fast=self._fast)

    def _tell_off(self, number: int) -> None:
        self._send(ALL, self._torque_head + bytes((self._drive.node_id, 0)))
        self._send(ALL, self._question() + bytes((self._drive.node_id,)))

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        if identifier != self._drive.node_id or len(data) != 2 + self._reader.length or data[0] != STATUS:
            return None
        return bool(self._reader.sample(data[2:]).torque)


def probe(drive: Any, links: Links) -> list[FoundDevice]:
    """Which servos there are: each number is pinged, and tells its model.

    Args:
        drive: with the line; its family's table is taken for all.
        links: the buses of this process.

    Raises:
        DriveError: the line cannot be used.
    """
    found, patience = [], BETWEEN + PING_BITS / drive.bitrate
    with links.join(place(drive), f"node {drive.node_id}", lambda _: True) as port:
        for number in range(HIGHEST + 1):
            servo = ServoDialogue(port, drive, number)
            port.send_now(number, bytes((Instruction.PING,)))
            there = port.wait_for(lambda identifier, data, number=number: identifier == number, patience)  # type: ignore[misc]
            if there is not None:
                found.append(_told(servo, drive))
    return found


def _told(servo: ServoDialogue, drive: Any) -> FoundDevice:
    model, torque = servo.get("Model Number"), servo.get("Torque Enable")
    said = f"{drive.setup.names.get(model, 'a model that is not known here')} (number {model}), "
    said += f"firmware {servo.get('Firmware Version')}, at {servo.get('Present Position')} counts"
    state = DriveState.OPERATION_ENABLED if torque else DriveState.SWITCH_ON_DISABLED
    return FoundDevice(servo.number, "serial servo", said, state.name)
