"""Bring-up of a moteus board: finding it, asking what it is and how it is configured, all without power.

Nothing is written but the watchdog's time, which is read back and has no effect without a command. What the board's
own configuration says is asked for over the diagnostic channel (`conf get`) and never changed.

Source of the names: mjbots/moteus, docs/reference/configuration.md and docs/protocol/diagnostic.md.
"""

import math
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import can

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import BusPort
from bowden.hardware.buses.opening import UNIX
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives.moteus_faults import fault_text
from bowden.hardware.drives.moteus_frames import BoardMode, NumberKind, Register
from bowden.hardware.drives.moteus_parameters import MoteusLimits, MoteusParameters, joint_scale, limits_of, motor_scale
from bowden.hardware.drives.scale import Scale, SuitScale

LISTENING = 0.5
"""So long the bus is listened to before anything is said on it: a board's own watchdog is 0.1 s as it comes, so that
another master commands more often [s]."""
WITHOUT_TORQUE = frozenset(
    {
        BoardMode.STOPPED,
        BoardMode.FAULT,
        BoardMode.ENABLING,
        BoardMode.CALIBRATING,
        BoardMode.CALIBRATED,
        BoardMode.TIMEOUT,
    }
)
"""Modes in which a board whose servo.timeout_mode is 0 has no torque (mjbots/moteus, fw/bldc_servo_control.h)."""
HOMED = 2
"""Register 00Ch: the position counts from a place of the output, and not of one turn of the rotor."""
SAME_TIME = 1e-6
"""Two times of a watchdog that differ by less are the same, but for a rounding [s]."""
_TRIES = 3
"""Of a question, since a frame may get lost."""
_MOST_POLLS = 50
"""Questions for the bytes of one line."""
_LONGEST = 256
"""Of a line [bytes]."""


class MoteusFindings(NamedTuple):
    """What bring-up learnt of the board."""

    identity: str
    """Who it is, in one line."""
    motor: Scale | SuitScale
    joint: Scale
    limits: MoteusLimits
    state: DriveState
    fault: int
    """Its code; 0 for none."""
    serial: str


def state_of(mode: int) -> DriveState:
    """What a mode is to the supervisor; what is no mode counts as not ready.

    >>> state_of(10).name, state_of(11).name
    ('OPERATION_ENABLED', 'SWITCH_ON_DISABLED')
    """
    return _STATES.get(mode, DriveState.NOT_READY_TO_SWITCH_ON)


_STATES: Mapping[int, DriveState] = {
    BoardMode.STOPPED: DriveState.SWITCH_ON_DISABLED,
    BoardMode.FAULT: DriveState.FAULT,
    BoardMode.ENABLING: DriveState.READY_TO_SWITCH_ON,
    BoardMode.CALIBRATING: DriveState.READY_TO_SWITCH_ON,
    BoardMode.CALIBRATED: DriveState.SWITCHED_ON,
    BoardMode.POSITION: DriveState.OPERATION_ENABLED,
    BoardMode.TIMEOUT: DriveState.SWITCH_ON_DISABLED,
    **dict.fromkeys(
        (
            *(BoardMode.PWM, BoardMode.VOLTAGE, BoardMode.VOLTAGE_FOC, BoardMode.VOLTAGE_DQ, BoardMode.CURRENT),
            *(BoardMode.ZERO_VELOCITY, BoardMode.STAY_WITHIN, BoardMode.MEASURE_INDUCTANCE, BoardMode.BRAKE),
        ),
        DriveState.QUICK_STOP_ACTIVE,
    ),
}
"""BoardMode → state. Any other mode with torque is one that we have not asked for: torque, but nothing is followed."""


def message(drive: MoteusParameters, data: bytes, *, reply: bool) -> can.Message:
    """A frame to the board."""
    identifier = frames.identifier_of(drive.host_id, drive.node_id, drive.can_prefix, reply=reply)
    return can.Message(
        arbitration_id=identifier,
        is_extended_id=identifier > frames.STANDARD_ID,
        is_fd=True,
        bitrate_switch=True,
        data=frames.padded(data),
    )


def is_foreign(drive: MoteusParameters, identifier: int) -> bool:
    """Whether a frame is one that only this host may send, or the board's answer to somebody else."""
    if frames.prefix_of(identifier) != drive.can_prefix:
        return False
    source, receiver = identifier >> 8 & 0x7F, identifier & 0xFF
    to_it = receiver in (drive.node_id, frames.BROADCAST)
    return to_it or (source == drive.node_id and receiver != drive.host_id)


def is_answer(drive: MoteusParameters, identifier: int) -> bool:
    """Whether a frame is the board's to us."""
    return identifier & 0x1FFF_FFFF == frames.identifier_of(drive.node_id, drive.host_id, drive.can_prefix)


class MoteusDialogue:
    """Questions and answers with one board.

    Args:
        port: of its bus, while no cycle runs.
        drive: which board.
    """

    def __init__(self, port: BusPort, drive: MoteusParameters) -> None:
        self._port, self._drive = port, drive
        self.name = f"node {drive.node_id}"
        self._foreign: int | None = None

    def check_alone(self) -> None:
        """No other master may have sent anything.

        Raises:
            DriveError: one has.
        """
        if self._foreign is not None:
            raise DriveError(
                f"another master speaks to {self.name}, or it answers one (a frame {self._foreign:04X}h)",
                expected="one host",
                do="end tview, moteus_tool or the other program first, or correct node_id in [drive]",
            )

    def listen(self, span: float) -> None:
        """Listen to the bus, and say nothing.

        Raises:
            DriveError: another master sends.
        """
        self._wait(span, lambda identifier, data: False)
        self.check_alone()

    def _wait(self, span: float, matches: Callable[[int, bytes], bool]) -> bytes | None:
        """The next answer of the board that matches, of those that come within a time [s]."""

        def looked_at(identifier: int, data: bytes) -> bool:
            if is_foreign(self._drive, identifier) and self._foreign is None:
                self._foreign = identifier & 0xFFFF
            return is_answer(self._drive, identifier) and matches(identifier, data)

        ends = time.monotonic() + span
        while (left := ends - time.monotonic()) > 0.0:
            found = self._port.wait_for(looked_at, left)
            if found is not None:
                return found[1]
        return None

    def ask(self, data: bytes, wanted: tuple[int, ...]) -> dict[int, float]:
        """Registers that a frame asks for.

        Raises:
            DriveError: no answer, or the board does not have one of them.
        """
        for _ in range(_TRIES):
            self._send(data, reply=True)
            answer = self._wait(
                self._drive.answer_timeout, lambda _, data: bool(data) and (data[0] & 0xF0 == 0x20 or data[0] == 0x31)
            )
            if answer is None:
                continue
            found, failed, _ = frames.replied(answer)
            for error in failed:
                raise DriveError(
                    f"{self.name} has no register {error.register:03X}h (error {error.error})",
                    expected=f"the registers of map version {frames.REGISTER_MAP}",
                    do="load a later firmware with moteus_tool",
                )
            if all(register in found for register in wanted):
                return found
        raise DriveError(
            f"no moteus board answers as {self.name}",
            expected="one with that number on a bus of CAN-FD",
            do="switch it on; check node_id in [drive], cable, bit rates and termination",
        )

    def configured(self, name: str) -> float:
        """A value of the board's configuration.

        Raises:
            DriveError: no answer, or there is no such value.
        """
        line = self.console(f"conf get {name}")
        try:
            return float(line)
        except ValueError as error:
            raise DriveError(
                f"{self.name} says {line!r} of {name}",
                expected="a number",
                do="load a firmware that has this setting, with moteus_tool",
            ) from error

    def console(self, text: str) -> str:
        """The first line that the diagnostic console answers.

        Raises:
            DriveError: it answers nothing.
        """
        for _ in range(_TRIES):
            self._drain()
            words = text.encode() + b"\n"
            self._send(bytes((frames.TO_DRIVE, frames.CHANNEL)) + frames.varuint(len(words)) + words, reply=False)
            said = b""
            for _ in range(_MOST_POLLS):
                part = self._poll()
                if part is None:
                    break
                said = (said + part).lstrip(b"\r\n")[:_LONGEST]
                line, end, _ = said.replace(b"\r", b"\n").partition(b"\n")
                if end:
                    return line.decode("latin-1").strip()
                if not part:
                    self._wait(1e-3, lambda identifier, data: False)
        raise DriveError(
            f"{self.name} answers nothing on its diagnostic channel to {text!r}",
            expected="a line",
            do="check that no other program uses the board; load a later firmware with moteus_tool",
        )

    def _drain(self) -> None:
        """Take what the console still has to say to somebody before us."""
        for _ in range(_MOST_POLLS):
            if not self._poll():
                return

    def _poll(self) -> bytes | None:
        """What the console says now; None where the board does not answer."""
        self._send(bytes((frames.POLL, frames.CHANNEL, 48)), reply=True)
        answer = self._wait(self._drive.answer_timeout, lambda _, data: bool(data) and data[0] == frames.FROM_DRIVE)
        return None if answer is None else frames.replied(answer)[2]

    def _send(self, data: bytes, *, reply: bool) -> None:
        try:
            self._port.bus.send(message(self._drive, data, reply=reply))
        except (can.CanError, OSError) as error:
            raise DriveError(
                f"no other device is on the bus: {error}",
                do="switch the drive on, or start bowden twin; check the cable and its termination",
            ) from error


def set_up(port: BusPort, drive: MoteusParameters) -> MoteusFindings:
    """Find and check the board; it has no torque before, meanwhile and after.

    Args:
        port: of its bus, read by nobody else.
        drive: what the rig says of it.

    Raises:
        DriveError: no answer, another firmware's protocol, a board that runs, one that would keep its torque without
            us, no encoder of the joint, or limits narrower than the rig's.
    """
    board = MoteusDialogue(port, drive)
    board.listen(LISTENING)
    who, serial = _check_version(board)
    seen = _check_without_torque(board, drive)
    _check_reaction(board)
    _check_control(board)
    _check_ratio(board, drive)
    turns, joint_turns = _check_encoders(board, drive, seen)
    here = drive.home == "here"
    motor = motor_scale(drive, turns if here else 0.0)
    joint = joint_scale(drive, joint_turns if here else 0.0)
    limits = limits_of(drive, motor)
    _check_limits(board, drive, motor, limits)
    _check_watchdog(board, drive)
    board.check_alone()
    fault = int(seen[Register.FAULT])
    in_fault = int(seen[Register.MODE]) == BoardMode.FAULT
    identity = f"moteus board at {board.name}, {who}, supply {seen[Register.VOLTAGE]:.1f} V"
    if in_fault:
        identity += f"; in fault, {fault_text(fault)}"
    return MoteusFindings(
        identity, motor, joint, limits, state_of(int(seen[Register.MODE])), fault if in_fault else 0, serial
    )


def _check_version(board: MoteusDialogue) -> tuple[str, str]:
    """Who it is, and its serial number."""
    wanted = (Register.MODEL, Register.FIRMWARE, Register.REGISTER_MAP)
    first = board.ask(frames.subframe(frames.READ, NumberKind.INT32, Register.MODEL, 3), wanted)
    serial = board.ask(frames.subframe(frames.READ, NumberKind.INT32, Register.SERIAL_1, 3), (Register.SERIAL_3,))
    version = int(first[Register.REGISTER_MAP])
    if version != frames.REGISTER_MAP:
        raise DriveError(
            f"{board.name} has version {version} of the register map (102h)",
            expected=f"{frames.REGISTER_MAP}",
            do="load a firmware of that version with moteus_tool: what its registers mean is not known here",
        )
    firmware = int(first[Register.FIRMWARE])
    number = "".join(f"{int(serial[register]) & 0xFFFF_FFFF:08x}" for register in sorted(serial, reverse=True))
    who = (
        f"model 0x{int(first[Register.MODEL]) & 0xFFFF_FFFF:X}, firmware "
        f"{firmware >> 16 & 0xFF}.{firmware >> 8 & 0xFF}.{firmware & 0xFF}, serial number {number}"
    )
    return who, number


def _check_without_torque(board: MoteusDialogue, drive: MoteusParameters) -> dict[int, float]:
    """Whoever finds the motor under torque must not touch it."""
    source = frames.SOURCES[drive.joint_source]
    seen = board.ask(
        frames.subframe(frames.READ, NumberKind.INT8, Register.MODE, 1)
        + frames.subframe(frames.READ, NumberKind.FLOAT, Register.POSITION, 1)
        + frames.subframe(frames.READ, NumberKind.INT8, Register.HOME_STATE, 1)
        + frames.subframe(frames.READ, NumberKind.FLOAT, Register.VOLTAGE, 2)
        + frames.subframe(frames.READ, NumberKind.INT8, Register.FAULT, 1)
        + frames.subframe(frames.READ, NumberKind.FLOAT, source, 1)
        + frames.subframe(frames.READ, NumberKind.INT8, Register.ENCODER_VALIDITY, 1),
        (
            *(Register.MODE, Register.POSITION, Register.HOME_STATE, Register.VOLTAGE, Register.FAULT),
            *(source, Register.ENCODER_VALIDITY),
        ),
    )
    mode = int(seen[Register.MODE])
    if mode not in WITHOUT_TORQUE:
        named = BoardMode(mode).name.lower().replace("_", " ") if mode in list(BoardMode) else "unknown"
        raise DriveError(
            f"{board.name} runs already, in mode {mode} ({named})",
            expected="a board without torque",
            do="end the program that runs it, or stop it with moteus_tool --stop",
        )
    return seen


def _check_reaction(board: MoteusDialogue) -> None:
    """What the board does once its watchdog has run out: as it comes it keeps torque, to damp the motor."""
    reaction = board.configured("servo.timeout_mode")
    if reaction != BoardMode.STOPPED:
        raise DriveError(
            f"{board.name} keeps its torque when its host falls silent (servo.timeout_mode is {reaction:g})",
            expected="0, stopped",
            do="moteus_tool, console: conf set servo.timeout_mode 0, conf write",
        )


def _check_control(board: MoteusDialogue) -> None:
    """Settings under which position mode is another than the one that is meant here."""
    for name in ("servo.fixed_voltage_mode", "servo.voltage_mode_control"):
        if board.configured(name) != 0.0:
            raise DriveError(
                f"{board.name} has {name} set: neither its largest current nor our largest torque holds then",
                expected="0",
                do=f"moteus_tool, console: conf set {name} 0, conf write",
            )
    for name in ("servo.default_velocity_limit", "servo.default_accel_limit"):
        if math.isfinite(board.configured(name)):
            raise DriveError(
                f"{board.name} plans a motion of its own to each target ({name} is set), and lags behind them",
                expected="nan, none",
                do=f"moteus_tool, console: conf set {name} nan, conf write",
            )
    gain = board.configured("servo.pid_position.kp")
    if not 0.0 < gain < math.inf:
        raise DriveError(
            f"{board.name} has no gain of its position control (servo.pid_position.kp is {gain:g})",
            expected="a number above 0",
            do="tune it with tview, the shaft free",
        )


def _check_ratio(board: MoteusDialogue, drive: MoteusParameters) -> None:
    own = board.configured("motor_position.rotor_to_output_ratio")
    if not abs(own / drive.output_ratio - 1.0) <= 1e-3:
        raise DriveError(
            f"drive.output_ratio is {drive.output_ratio:g}",
            expected=f"{own:g}, as {board.name} has it (motor_position.rotor_to_output_ratio)",
            do="correct it in rig.toml; the rig's own gear is motor.gear",
        )


def _check_encoders(board: MoteusDialogue, drive: MoteusParameters, seen: dict[int, float]) -> tuple[float, float]:
    """Whether both angles are there, and from where they count; the output's turns and the joint's encoder's."""
    turns, joint = seen[Register.POSITION], seen[frames.SOURCES[drive.joint_source]]
    name = f"motor_position.sources.{drive.joint_source}"
    port = board.configured(f"{name}.aux_number")
    kind = board.configured(f"{name}.type")
    if port != 2 or kind == 0:
        raise DriveError(
            f"{board.name} has no encoder in slot {drive.joint_source} of its auxiliary port 2 ({name}.aux_number is "
            f"{port:g}, type {kind:g})",
            expected="the joint's encoder there",
            do="set it up with tview (docs/drive_moteus.md), or correct drive.joint_source",
        )
    if not int(seen[Register.ENCODER_VALIDITY]) >> 2 * drive.joint_source & 1 or not math.isfinite(joint):
        raise DriveError(
            f"{board.name} has no valid reading of the joint's encoder (slot {drive.joint_source}, register 058h)",
            expected="a reading",
            do="check its cable, its supply and aux2 in tview",
        )
    if not -1.0 <= joint <= 1.0:
        raise DriveError(
            f"{board.name} reports its encoders in counts ({joint:g})",
            expected="turns, as later firmware does",
            do="load a later firmware with moteus_tool",
        )
    if not math.isfinite(turns):
        raise DriveError(f"{board.name} has no position", do="calibrate the motor with moteus_tool")
    if drive.home == "counts" and int(seen[Register.HOME_STATE]) != HOMED:
        raise DriveError(
            f"{board.name} knows its position within a turn of the rotor alone (register 00Ch is "
            f"{seen[Register.HOME_STATE]:g})",
            expected="2, counted from a place of the output",
            do='set home = "here" in [drive]; or give the board an encoder of its output, or set where it is (d exact)',
        )
    return turns, joint


def _check_limits(
    board: MoteusDialogue, drive: MoteusParameters, motor: Scale | SuitScale, limits: MoteusLimits
) -> None:
    """The rig's limits against those in the board, which are read and never changed."""

    def refuse(what: str, wanted: float, own: float, unit: str, name: str) -> None:
        raise DriveError(
            f"the rig's {what} is {wanted:.6g} {unit}, beyond the board's own {own:.6g} {unit} ({name})",
            expected="a rig within the board's limits",
            do=f"reduce it in the rig, or extend {name} with moteus_tool",
        )

    low, high = (board.configured(f"servopos.position_{end}") for end in ("min", "max"))
    if not (math.isfinite(low) and math.isfinite(high)) and drive.interface != UNIX:
        raise DriveError(
            f"{board.name} has no limits of its position (servopos.position_min is {low:g}, position_max {high:g})",
            expected="the range that the rig may go to at most, in turns of the output",
            do="set both with moteus_tool: they hold whatever this computer does, and whatever its scales are",
        )
    for own, wanted, name, beyond in (
        (low, limits.low, "servopos.position_min", limits.low < low),
        (high, limits.high, "servopos.position_max", limits.high > high),
    ):
        if beyond:
            refuse("range of the motor", motor.angle(wanted), motor.angle(own), "rad", name)
    steepest = motor.steepest(drive.lowest_motor, drive.highest_motor)
    spool = abs(motor.step) / steepest
    speed = board.configured("servo.max_velocity")
    if drive.speed_limit > 0.0 and limits.speed > speed:
        refuse("speed limit", drive.speed_limit, speed * spool, "rad/s", "servo.max_velocity")
    current = board.configured("servo.max_current_A")
    if drive.current_limit > current:
        refuse("current limit", drive.current_limit, current, "A", "servo.max_current_A")
    window = board.configured("servo.fault_position_error")
    if math.isfinite(window) and drive.following_error > window * spool:
        refuse("following error", drive.following_error, window * spool, "rad", "servo.fault_position_error")


def _check_watchdog(board: MoteusDialogue, drive: MoteusParameters) -> None:
    """The time of the watchdog as a command will have it, written without a command and read back."""
    found = board.ask(
        frames.values(frames.WRITE, NumberKind.FLOAT, Register.COMMAND_TIMEOUT, drive.watchdog)
        + frames.subframe(frames.READ, NumberKind.FLOAT, Register.COMMAND_TIMEOUT, 1),
        (Register.COMMAND_TIMEOUT,),
    )[Register.COMMAND_TIMEOUT]
    if not abs(found - drive.watchdog) <= SAME_TIME:
        raise DriveError(
            f"{board.name} has a watchdog of {found:g} s after {drive.watchdog:g} s were written (register 027h)",
            expected="what was written",
            do="take another firmware: this one would keep its torque",
        )
