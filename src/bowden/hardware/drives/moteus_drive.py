"""A mjbots moteus board over CAN-FD as the live loop's `Drive`: packed and parsed by hand, no thread, never waiting.

A cycle sends one frame, a command with the questions, and the next cycle reads its reply. There is no heartbeat: the
age of the last reply stands for it. Each command has the watchdog's time in it: a loop that hangs is a host that is
gone, and the board goes into mode timeout, which it leaves by a stop alone. Stopping would clear a fault, so a board in
fault is asked and not commanded.

Bring-up writes nothing but the watchdog's time, which is read back and has no effect without a command. What the
board's own configuration says is asked for over the diagnostic channel (`conf get`) and never changed (mjbots/moteus,
docs/reference/configuration.md and docs/protocol/diagnostic.md).
"""

import math
from collections.abc import Mapping

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.opening import UNIX, Frame
from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.drives import checklist
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives.checklist import LISTENING, Conversation, DriveLimit, Found, Setting
from bowden.hardware.drives.cia402 import WITH_TORQUE
from bowden.hardware.drives.driver import SETTLED, Driver
from bowden.hardware.drives.families.moteus import MoteusParameters, command_of, joint_scale
from bowden.hardware.drives.findings import LEFT, UNWATCHED
from bowden.hardware.drives.moteus_frames import MOST_TURNS, TIMED_OUT, BoardMode, NumberKind, Register, fault_text
from bowden.hardware.drives.on_can import place
from bowden.hardware.drives.scale import LimitedRange, Scale, SuitScale, found_scale, motor_limits
from bowden.hardware.ports import Power
from bowden.rig.families import FoundDevice

HOMED = 2
"""Register 00Ch: the position counts from a place of the output, and not of one turn of the rotor."""
SAME_TIME = 1e-6
"""Two times of a watchdog that differ by less are the same, but for a rounding [s]."""
_MOST_POLLS = 50
"""Questions for the bytes of one line."""
_LONGEST = 256
"""Of a line [bytes]."""


def state_of(mode: int) -> DriveState:
    """What a mode is to the supervisor; what is no mode counts as not ready.

    >>> state_of(10).name, state_of(11).name
    ('OPERATION_ENABLED', 'SWITCH_ON_DISABLED')
    """
    return _STATES.get(mode, DriveState.NOT_READY_TO_SWITCH_ON)


_STATES: Mapping[int, DriveState] = {
    **dict.fromkeys(BoardMode, DriveState.QUICK_STOP_ACTIVE),
    BoardMode.STOPPED: DriveState.SWITCH_ON_DISABLED,
    BoardMode.FAULT: DriveState.FAULT,
    BoardMode.ENABLING: DriveState.READY_TO_SWITCH_ON,
    BoardMode.CALIBRATING: DriveState.READY_TO_SWITCH_ON,
    BoardMode.CALIBRATED: DriveState.SWITCHED_ON,
    BoardMode.POSITION: DriveState.OPERATION_ENABLED,
    BoardMode.TIMEOUT: DriveState.SWITCH_ON_DISABLED,
}
"""BoardMode → state. Any other mode with torque is one that we have not asked for: torque, but nothing is followed."""
WITHOUT_TORQUE = frozenset(mode for mode, state in _STATES.items() if state not in WITH_TORQUE)
"""Modes in which a board whose servo.timeout_mode is 0 has no torque (mjbots/moteus, fw/bldc_servo_control.h)."""


def frame(drive: MoteusParameters, data: bytes, *, reply: bool) -> Frame:
    """A frame to the board."""
    identifier = frames.identifier_of(drive.host_id, drive.node_id, drive.can_prefix, reply=reply)
    return frames.with_flag(identifier), frames.padded(data)


def is_foreign(drive: MoteusParameters, identifier: int) -> bool:
    """True if a frame is one that only this host may send, or the board's answer to somebody else."""
    if frames.prefix_of(identifier) != drive.can_prefix:
        return False
    source, receiver = identifier >> 8 & 0x7F, identifier & 0xFF
    to_it = receiver in (drive.node_id, frames.BROADCAST)
    return to_it or (source == drive.node_id and receiver != drive.host_id)


def is_answer(drive: MoteusParameters, identifier: int) -> bool:
    """True if a frame is the board's to us."""
    return identifier & 0x1FFF_FFFF == frames.identifier_of(drive.node_id, drive.host_id, drive.can_prefix)


class MoteusDialogue(Conversation):
    """Questions and answers with one board.

    Args:
        port: of its bus, while no cycle runs.
        drive: which board.
    """

    def __init__(self, port: BusPort, drive: MoteusParameters) -> None:
        super().__init__(
            port,
            drive.node_id,
            lambda identifier, _: is_foreign(drive, identifier),
            drive.answer_timeout,
            "tview, moteus_tool or the other program",
        )
        self._drive = drive

    def _ask(self, data: bytes, kinds: tuple[int, ...], tries: int = checklist.TRIES) -> bytes | None:
        """The data of the board's answer, whose first byte is a subframe of one of these kinds."""

        def answered(identifier: int, reply: bytes) -> bytes | None:
            kind = reply[0] & 0xF0 if reply and reply[0] & 0xF0 == frames.REPLY else reply[0] if reply else -1
            return reply if is_answer(self._drive, identifier) and kind in kinds else None

        return self.ask(frame(self._drive, data, reply=True), answered, tries)

    def registers(self, *asked: tuple[NumberKind, int, int], before: bytes = b"") -> dict[int, float]:
        """Registers, each of a type, from one on, so many; asked for in one frame, after what is written `before`.

        Raises:
            DriveError: no answer, or the board does not have one of them.
        """
        data = before + b"".join(frames.subframe(frames.READ, *one) for one in asked)
        for _ in range(checklist.TRIES):
            answer = self._ask(data, (frames.REPLY, frames.READ_ERROR), 1)
            if answer is None:
                continue
            found, failed, _ = frames.replied(answer)
            for error in failed:
                raise DriveError(
                    f"{self.name} has no register {error.at:03X}h (error {error.value:g})",
                    expected=f"the registers of map version {frames.REGISTER_MAP}",
                    do="load a later firmware with moteus_tool",
                )
            if all(register + i in found for _, register, count in asked for i in range(count)):
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
        for _ in range(checklist.TRIES):
            self._drain()
            words = text.encode() + b"\n"
            order = bytes((frames.TO_DRIVE, frames.CHANNEL)) + frames.varuint(len(words)) + words
            self.port.send_now(*frame(self._drive, order, reply=False))
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
                    self.wait(1e-3, lambda identifier, data: None)
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
        answer = self._ask(bytes((frames.POLL, frames.CHANNEL, 48)), (frames.FROM_DRIVE,), 1)
        return None if answer is None else frames.replied(answer)[2]


def _check_version(board: MoteusDialogue) -> tuple[str, str]:
    """Who it is, and its serial number."""
    first, serial = (board.registers((NumberKind.INT32, at, 3)) for at in (Register.MODEL, Register.SERIAL_1))
    version = int(first[Register.REGISTER_MAP])
    if version != frames.REGISTER_MAP:
        raise DriveError(
            f"{board.name} has version {version} of the register map (102h)",
            expected=f"{frames.REGISTER_MAP}",
            do="load a firmware of that version with moteus_tool: what its registers mean is not known here",
        )
    number = "".join(f"{int(serial[register]) & 0xFFFF_FFFF:08x}" for register in sorted(serial, reverse=True))
    return f"{_model(first)}, serial number {number}", number


def _model(registers: dict[int, float]) -> str:
    """Model and firmware, by their registers."""
    firmware = int(registers.get(Register.FIRMWARE, 0.0))
    version = f"{firmware >> 16 & 0xFF}.{firmware >> 8 & 0xFF}.{firmware & 0xFF}"
    return f"model 0x{int(registers[Register.MODEL]) & 0xFFFF_FFFF:X}, firmware {version}"


def _check_without_torque(board: MoteusDialogue, drive: MoteusParameters) -> dict[int, float]:
    """Whoever finds the motor under torque must not touch it."""
    seen = board.registers(
        (NumberKind.INT8, Register.MODE, 1),
        (NumberKind.FLOAT, Register.POSITION, 1),
        (NumberKind.INT8, Register.HOME_STATE, 1),
        (NumberKind.FLOAT, Register.VOLTAGE, 2),
        (NumberKind.INT8, Register.FAULT, 1),
        (NumberKind.FLOAT, frames.SOURCES[drive.joint_source], 1),
        (NumberKind.INT8, Register.ENCODER_VALIDITY, 1),
    )
    mode = int(seen[Register.MODE])
    if mode not in WITHOUT_TORQUE:
        named = BoardMode(mode).name.lower().replace("_", " ") if mode in list(BoardMode) else "unknown"
        do = "end the program that runs it, or stop it with moteus_tool --stop"
        raise checklist.refuse_torque(board.name, f"mode {mode} ({named})", do)
    return seen


def _settings(drive: MoteusParameters) -> tuple[Setting, ...]:
    """Those under which position mode is the one that is meant here, and a lost host means no torque."""

    def console(name: str, value: str) -> str:
        return f"moteus_tool, console: conf set {name} {value}, conf write"

    reaction, ratio = "servo.timeout_mode", "motor_position.rotor_to_output_ratio"
    silent = "keeps its torque when its host falls silent"
    loose = "has a mode in which neither its largest current nor our largest torque holds"
    plans = "plans a motion of its own to each target, and lags behind them"
    return (
        Setting(reaction, checklist.is_about(float(BoardMode.STOPPED)), "0, stopped", silent, console(reaction, "0")),
        *(
            Setting(name, checklist.is_about(0.0), "0", loose, console(name, "0"))
            for name in ("servo.fixed_voltage_mode", "servo.voltage_mode_control")
        ),
        *(
            Setting(name, lambda found: not math.isfinite(found), "nan, none", plans, console(name, "nan"))
            for name in ("servo.default_velocity_limit", "servo.default_accel_limit")
        ),
        Setting(
            "servo.pid_position.kp",
            lambda found: 0.0 < found < math.inf,
            "a number above 0",
            "has no gain of its position control",
            "tune it with tview, the shaft free",
        ),
        Setting(
            ratio,
            checklist.is_about(drive.output_ratio, 1e-3),
            f"{drive.output_ratio:g}, as drive.output_ratio has it",
            "turns its output otherwise than the rig says",
            "correct drive.output_ratio in rig.toml; the rig's own gear is motor.gear",
        ),
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


def _check_limits(board: MoteusDialogue, drive: MoteusParameters, motor: Scale | SuitScale) -> None:
    """The rig's limits against those in the board, which are read and never changed."""
    low, high = (board.configured(f"servopos.position_{end}") for end in ("min", "max"))
    if not (math.isfinite(low) and math.isfinite(high)) and drive.interface != UNIX:
        raise DriveError(
            f"{board.name} has no limits of its position (servopos.position_min is {low:g}, position_max {high:g})",
            expected="the range that the rig may go to at most, in turns of the output",
            do="set both with moteus_tool: they hold whatever this computer does, and whatever its scales are",
        )
    needs = drive.needs
    ends = sorted((motor.angle(_or(low, -math.inf)), motor.angle(_or(high, math.inf))))
    spool = abs(motor.step) / motor.steepest(needs.lowest_motor, needs.highest_motor)  # rad a turn
    speed, current, window = (
        _or(board.configured(f"servo.{name}"), math.inf)
        for name in ("max_velocity", "max_current_A", "fault_position_error")
    )
    checklist.check_limits(
        (
            DriveLimit(checklist.LOWEST, needs.lowest_motor, ends[0], "servopos.position_min, _max"),
            DriveLimit(checklist.HIGHEST, needs.highest_motor, ends[1], "servopos.position_min, _max"),
            DriveLimit(checklist.SPEED, needs.speed_limit, speed * spool, "servo.max_velocity"),
            DriveLimit(checklist.CURRENT, needs.current_limit, current, "servo.max_current_A"),
            DriveLimit(checklist.REACH, needs.following_error, window * spool, "servo.fault_position_error"),
        ),
        "with moteus_tool",
    )


def _or(limit: float, none: float) -> float:
    """A limit of the board, where nan is none."""
    return none if math.isnan(limit) else limit


def _check_watchdog(board: MoteusDialogue, drive: MoteusParameters) -> None:
    """The time of the watchdog as a command will have it, written without a command and read back."""
    timeout = Register.COMMAND_TIMEOUT
    written = frames.values(frames.WRITE, NumberKind.FLOAT, timeout, drive.watchdog)
    found = board.registers((NumberKind.FLOAT, timeout, 1), before=written)[timeout]
    if not abs(found - drive.watchdog) <= SAME_TIME:
        raise DriveError(
            f"{board.name} has a watchdog of {found:g} s after {drive.watchdog:g} s were written (register 027h)",
            expected="what was written",
            do="take another firmware: this one would keep its torque",
        )


def probe(drive: MoteusParameters, links: Links) -> list[FoundDevice]:
    """Which boards there are: all are asked at once who they are and what they do; nothing is written.

    Args:
        drive: with the bus, and this computer's number.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used, or another master is on it.
    """
    everybody = drive._replace(node_id=frames.BROADCAST)
    question = frames.subframe(frames.READ, NumberKind.INT8, Register.MODE, 1)
    question += frames.subframe(frames.READ, NumberKind.INT32, Register.MODEL, 3)
    found: dict[int, FoundDevice] = {}
    with links.join(place(drive), f"node {drive.node_id}", lambda _: True) as port:
        bus = MoteusDialogue(port, drive)
        bus.listen(LISTENING)

        def looked_at(identifier: int, data: bytes) -> None:
            node, receiver = identifier >> 8 & 0x7F, identifier & 0xFF
            ours = receiver == drive.host_id and frames.prefix_of(identifier) == drive.can_prefix
            registers, failed, _ = frames.replied(data)
            if ours and Register.MODE in registers and not failed and Register.MODEL in registers:
                state = state_of(int(registers[Register.MODE]))
                found[node] = FoundDevice(node, "moteus board", _model(registers), state.name)

        port.send_now(*frame(everybody, question, reply=True))
        bus.wait(drive.answer_timeout, looked_at)
    return [found[node] for node in sorted(found)]


_NO_FLAGS = ~EXTENDED & 0xFFFF_FFFF


class MoteusDrive(Driver):
    """The drive of one motor."""

    _drive: MoteusParameters
    most_counts = frames.MOST_TURNS

    def _prepare(self) -> None:
        drive = self._drive
        self.turn = drive.output_ratio
        self._answer = frames.identifier_of(drive.node_id, drive.host_id, drive.can_prefix)
        self._cycle = frames.CommandFrames(drive.joint_source)
        self._joint_turns = LimitedRange(1.0)
        to_board = frames.identifier_of(drive.host_id, drive.node_id, drive.can_prefix, reply=True)
        self._to_board = frames.with_flag(to_board)

    def _find(self, port: BusPort) -> Found:
        drive = self._drive
        board = MoteusDialogue(port, drive)
        board.listen(LISTENING)
        who, serial = _check_version(board)
        seen = _check_without_torque(board, drive)
        checklist.check_settings(board.name, board.configured, _settings(drive))
        turns, joint_turns = _check_encoders(board, drive, seen)
        here = drive.home == "here"
        motor = found_scale(drive, turns, self.turn)
        joint = joint_scale(drive, joint_turns if here else 0.0)
        limits = motor_limits(drive, motor)
        limits = limits._replace(low=max(-MOST_TURNS, limits.low), high=min(MOST_TURNS, limits.high))
        _check_limits(board, drive, motor)
        _check_watchdog(board, drive)
        board.check_alone()
        state = state_of(int(seen[Register.MODE]))
        fault = int(seen[Register.FAULT]) if state is DriveState.FAULT else 0
        identity = f"moteus board at {board.name}, {who}, supply {seen[Register.VOLTAGE]:.1f} V"
        if state is DriveState.FAULT:
            identity += f"; in fault, {fault_text(fault)}"
        return Found(identity, motor, joint, limits, state, fault, serial)

    def _concerns(self, identifier: int) -> bool:
        return is_answer(self._drive, identifier) or is_foreign(self._drive, identifier)

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        return is_foreign(self._drive, identifier)

    def _begin(self, found: Found | None) -> None:
        self._mode_state = self._state
        self._turns = math.nan  # the target of the cycle before
        self._timed_out = False
        self._joint_turns.begin()
        if found is not None and found.joint is not None:
            self._readings.failed(found.error)  # one that was there before is no news
            self._joint_turns.follow(found.joint.counts(self._drive.joint_home))

    def _take(self, identifier: int, data: bytes, now: float) -> bool:
        if identifier & _NO_FLAGS != self._answer:
            return False
        reply, found = self._cycle.reply(data), self._found
        if reply is None or found is None or found.joint is None:
            return True
        readings, drive = self._readings, self._drive
        readings.replied_at = now
        self._check_turns(reply.position, now)
        readings.moved(
            found.motor.angle(reply.position) if math.isfinite(reply.position) else math.nan,
            drive.motor_direction * reply.q_current if math.isfinite(reply.q_current) else math.nan,
            math.nan if reply.temperature == frames.NO_INT8 else float(reply.temperature),
            self._written,
        )
        if reply.validity >> 2 * drive.joint_source & 1:
            turns = reply.joint if -1.0 <= reply.joint <= 1.0 else math.nan  # it measures a part of a turn
            readings.turned(found.joint.angle(self._joint_turns.follow(turns)))
        self._timed_out = reply.mode == BoardMode.TIMEOUT
        readings.failed((reply.fault & 0xFF or LEFT) if reply.mode == BoardMode.FAULT else 0)
        if self._led >= SETTLED and not abs(reply.timeout - drive.watchdog) <= SAME_TIME:
            readings.found(UNWATCHED)
        self._mode_state = state_of(reply.mode)
        return True

    def _standing(self) -> DriveState:
        return DriveState.NOT_READY_TO_SWITCH_ON if self._lost else self._mode_state

    def _judge(self, now: float) -> None:
        enabled, state = DriveState.OPERATION_ENABLED, self._state
        if self._asked and self._before is enabled is not state and state is not DriveState.FAULT:
            self._readings.found(TIMED_OUT if self._timed_out else LEFT)

    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        """See `Driver._lead`; the target of a board that is not in position mode is none, by which it stays."""
        led = self._state is DriveState.OPERATION_ENABLED
        sent = (counts, self._turns, torque) if led else (math.nan, self._turns, 0.0)
        self._put(self._cycle.command(command_of(self._drive, found.limits, *sent)))
        self._led += 1
        self._target, self._turns = (target, counts) if led else (math.nan, math.nan)
        self._reset = False

    def _relax(self, power: Power, now: float) -> None:
        keep = self._state is DriveState.FAULT and not self._reset
        self._put(self._cycle.ask if keep else self._cycle.stop)
        self._turns, self._reset = math.nan, False

    def _tell_off(self, number: int) -> None:
        self._put(self._cycle.ask if self._state is DriveState.FAULT else self._cycle.stop)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        reply = self._cycle.reply(data) if is_answer(self._drive, identifier) else None
        return None if reply is None else reply.mode not in WITHOUT_TORQUE

    def _put(self, data: bytes) -> None:
        self._send(self._to_board, data)
