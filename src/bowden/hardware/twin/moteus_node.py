"""The twin of a mjbots moteus board as a node of the bus: subframes, registers, modes, watchdog, diagnostic channel.

Its motor follows as the rig's servo does, whatever the gains are; without gains, or without torque, it gives none.
A board whose `servo.timeout_mode` is not stopped brakes when its watchdog has run out, and keeps its torque.

Source: mjbots/moteus, docs/protocol, fw/moteus_controller.cc (registers, errors), fw/bldc_servo_control.h (modes and
watchdog); mjbots/mjlib, mjlib/multiplex/micro_server.cc (order of replies, what happens to a frame that is malformed).
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from bowden.core.signals import DriveState
from bowden.hardware.buses.place import REMOTE
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives.families.moteus import MoteusParameters, joint_scale
from bowden.hardware.drives.moteus_drive import HOMED, state_of
from bowden.hardware.drives.moteus_frames import BoardMode, NumberKind, Register
from bowden.hardware.twin.faults import NO_NUMBER
from bowden.hardware.twin.injection import UNCOUNTED
from bowden.hardware.twin.node import SUPPLY, TwinNode
from bowden.hardware.twin.plant import BRAKE, FOLLOW, OFF, Doing

ENABLING_TIME = 5e-3
"""From a command to the mode that it asks for: gate driver, offsets of the current's sensors; a stated choice [s]."""
DRIVER_FAULT, OVER_TEMPERATURE, OUTSIDE_LIMITS, POSITION_ERROR = 33, 38, 39, 49
"""Codes of the faults that the twin finds itself, or is given."""
LONGEST_LINE = 128
"""Of what is kept of a line that does not end [bytes]."""
LARGEST_REPLY, RESERVE = 64, 23
"""Of a reply, and the room that it must have for the next subframe to be looked at [bytes]."""
MODEL, FIRMWARE, SERIAL = 0x0B, 0x010101, (0x626F7764, 0x656E, 0x7477696E)
NOT_COMMANDED = frozenset({BoardMode.FAULT, BoardMode.ENABLING, BoardMode.CALIBRATING, BoardMode.CALIBRATED})
"""Modes that nobody can write."""
COMMANDS: Mapping[int, float] = {
    Register.COMMAND_POSITION: 0.0,
    Register.COMMAND_VELOCITY: 0.0,
    Register.COMMAND_TORQUE: 0.0,
    Register.COMMAND_KP_SCALE: 1.0,
    Register.COMMAND_KD_SCALE: 1.0,
    Register.COMMAND_MAX_TORQUE: math.nan,
    Register.COMMAND_TIMEOUT: 0.0,
    Register.COMMAND_IGNORE_BOUNDS: 0.0,
}
"""Registers of a command → what holds where they are not written."""
ONLY_INT32 = frozenset(
    {Register.MODEL, Register.FIRMWARE, Register.REGISTER_MAP, Register.SERIAL_1, Register.SERIAL_2, Register.SERIAL_3}
)


def _text(value: float) -> str:
    return f"{int(value)}" if math.isfinite(value) and value == int(value) else f"{value:f}"


_USUAL: Mapping[str, float] = {
    "id.id": 1.0,
    "servo.timeout_mode": 0.0,
    "servo.default_timeout_s": 0.1,
    "servo.timeout_max_torque_Nm": 5.0,
    "servo.fixed_voltage_mode": 0.0,
    "servo.voltage_mode_control": 0.0,
    "servo.default_velocity_limit": math.nan,
    "servo.default_accel_limit": math.nan,
    "servo.pid_position.kp": 4.0,
    "servo.pid_position.ki": 1.0,
    "servo.pid_position.kd": 0.05,
    "servo.fault_position_error": math.nan,
    "servo.fault_velocity_error": math.nan,
    "servo.fault_temperature": 75.0,
    "servopos.position_min": math.nan,
    "servopos.position_max": math.nan,
}
"""Configuration of a board as it comes, but for the watchdog's reaction; the limits and the joint's encoder are set up
for a rig (mjbots/moteus, docs/reference/configuration.md).
"""


def _read_error(register: int, error: int) -> bytes:
    return bytes((frames.READ_ERROR,)) + frames.varuint(register) + bytes((error,))


class Sampled(NamedTuple):
    """Readings of the board's sensors."""

    motor: float
    """Of the output [turns]."""
    joint: float
    """Of the joint's encoder, 0 to 1 [turns]."""
    current: float
    """[A]"""


class MoteusNode(TwinNode):
    """The board."""

    _drive: MoteusParameters

    lacks: ClassVar[Mapping[str, str]] = {
        "doubled_pdos": UNCOUNTED,
        "watch_off": "each command sets its watchdog anew",
        "kick": "its target comes with the order that enables it",
        "emergency_stop": "a board has no input for it that is read: it cuts the supply, so inject reboot",
        "joint_silence": "the joint's encoder hangs on the board: inject encoder_frozen joint, or encoder_nan joint",
    }

    def _prepare(self) -> None:
        self._joint, self.turn = joint_scale(self._drive), self._drive.output_ratio
        self.commands = 0
        """Frames that were for this board."""

    def _power_up(self) -> None:
        self.state, self.fault = BoardMode.STOPPED, 0
        self._command, self._wanted = dict(COMMANDS), BoardMode.STOPPED
        self._valid = False
        self._commanded = self._deadline = self._enabled = math.inf
        self._held = math.nan
        speed = self._speed_limit()
        self._named = {
            **_USUAL,
            "servo.max_velocity": 1.001 * speed if math.isfinite(speed) else 500.0,
            "servo.max_current_A": self.bench.current_limit,
            "motor_position.rotor_to_output_ratio": self._drive.output_ratio,
        }
        for slot in (1, 2):
            there = slot == self._drive.joint_source
            self._named[f"motor_position.sources.{slot}.aux_number"] = 2.0 if there else 1.0
            self._named[f"motor_position.sources.{slot}.type"] = 1.0 if there else 0.0
        others = {name: value for name, value in self._overrides.items() if isinstance(name, str)}
        self._named |= {name: value for name, value in others.items() if value is not None}
        self._named = {name: value for name, value in self._named.items() if others.get(name, 0.0) is not None}
        self._heard, self._said = b"", b""  # on the diagnostic channel

    def _standing(self) -> tuple[DriveState, int, dict[str, Any]]:
        fault = self.fault if self.state is BoardMode.FAULT else 0
        return state_of(self.state), fault, {"mode": int(self.state), "commands": self.commands}

    def receive(self, identifier: int, data: bytes, now: float) -> None:
        """A frame from the bus; whether its identifier is an extended one does not count."""
        prefix = self._drive.can_prefix
        if not self._is_receiving(now) or identifier & REMOTE:
            return
        source, receiver = identifier >> 8 & 0xFF, identifier & 0xFF
        if frames.prefix_of(identifier) != prefix or receiver not in (self._drive.node_id, frames.BROADCAST):
            return
        self.host, self.commands = now, self.commands + 1
        self._move(now)
        self._sample(now)
        reply = self._obey(data, now, answers=bool(source & 0x80))
        if self._valid:
            self._valid = False
            if not self.faults.active("commands_ignored", now):
                self._take(now)
        if not source & 0x80:
            return
        back = frames.identifier_of(self._drive.node_id, source & 0x7F, prefix)
        if reply[:1] == bytes((frames.FROM_DRIVE,)):
            self._outbox.emit(frames.with_flag(back), frames.padded(reply), now)
            return
        self._outbox.emit_cyclic(frames.with_flag(back), frames.padded(reply), now)
        if self.faults.active("foreign_replies", now):
            other = frames.identifier_of(self._drive.node_id % 126 + 1, source & 0x7F, prefix)
            self._outbox.emit_cyclic(frames.with_flag(other), frames.padded(reply), now)

    def _obey(self, data: bytes, now: float, *, answers: bool) -> bytes:
        """Take a frame's subframes in their order; the reply to them, as long as there is room for the next one."""
        reply = bytearray()
        for one in frames.subframes(data):
            if answers and LARGEST_REPLY - len(reply) < RESERVE:
                break
            if one.head == frames.WRITE:
                error = self._write(one.at, one.value)
                if error and answers:
                    reply += bytes((frames.WRITE_ERROR,)) + frames.varuint(one.at) + bytes((error,))
            elif one.head == frames.READ and answers:
                found = self._answer(one, LARGEST_REPLY - len(reply), now)
                reply += found
                if found[0] == frames.READ_ERROR:
                    break  # the rest of a frame with such an error is not looked at
            elif one.head >= frames.TO_DRIVE and not self._talk(one, reply, answers=answers):
                break
        return bytes(reply)

    def _talk(self, one: frames.Subframe, reply: bytearray, *, answers: bool) -> bool:
        """The diagnostic channel; whether there is such a one."""
        if one.at != frames.CHANNEL or one.head == frames.FROM_DRIVE:
            return False
        if one.head == frames.TO_DRIVE:
            self._hear(one.data)
        if answers:
            room = LARGEST_REPLY - len(reply) - RESERVE
            most = max(0, min(room, int(one.value) if one.head == frames.POLL else room))
            said, self._said = self._said[:most], self._said[most:]
            reply += bytes((frames.FROM_DRIVE, frames.CHANNEL)) + frames.varuint(len(said)) + said
        return True

    def _hear(self, data: bytes) -> None:
        """Bytes of the diagnostic channel; each line is answered, of the console's commands those that somebody sends
        to the twin.
        """
        lines = (self._heard + data).replace(b"\r", b"\n").split(b"\n")
        self._heard = lines.pop()[-LONGEST_LINE:]
        for line in filter(bytes.strip, lines):
            match line.decode("latin-1").split():
                case ["conf", "get", name]:
                    value = self._named.get(name)
                    said = "ERR error reading" if value is None else _text(value)
                case ["tel", "stop"]:
                    said = "OK"
                case _:
                    said = "ERR unknown command"
            self._said += said.encode() + b"\r\n"

    def _answer(self, asked: frames.Subframe, room: int, now: float) -> bytes:
        """The reply to a question for registers, in the type asked for, or which of them there is not."""
        size = (1, 2, 4, 4)[asked.kind]
        head = frames.subframe(frames.REPLY, asked.kind, asked.at, asked.amount)
        if asked.counted:
            head = bytes((frames.REPLY | asked.kind << 2,)) + frames.varuint(asked.amount)
            head += frames.varuint(asked.at)
        if len(head) + asked.amount * size > room:
            return _read_error(asked.at, frames.NOT_WRITEABLE)
        found = b""
        for register in range(asked.at, asked.at + asked.amount):
            value = self._read(register, asked.kind, now)
            if value is None:
                return _read_error(register, frames.UNKNOWN_REGISTER)
            found += frames.values(0, asked.kind, register, value)[1 + len(frames.varuint(register)) :]
        return head + found

    def _write(self, register: int, value: float) -> int:
        """Write a register; the number of the error, 0 for none."""
        if register == Register.MODE:
            number = int(value) if math.isfinite(value) else -1
            if not 0 <= number <= max(BoardMode):
                return 3
            self._wanted, self._command, self._valid = BoardMode(number), dict(COMMANDS), True
            return 0
        if register in self._command:
            self._command[register] = value
            return 0
        there = register in list(Register) and self._read(register, NumberKind.INT32, -math.inf) is not None
        return frames.NOT_WRITEABLE if there else frames.UNKNOWN_REGISTER

    def _read(self, register: int, kind: NumberKind, now: float) -> float | None:
        """The physical value of a register; None where there is none of that type."""
        if register in self._overrides:
            return self._overrides[register]
        if register in ONLY_INT32 and kind is not NumberKind.INT32:
            return None
        if register in self._command:
            return self._command[register]
        value = self._measured(now).get(register)
        if value is None or not self.faults.active("saturated", now) or register not in _SATURATED:
            return value
        return math.copysign(32767.0 * frames.SCALES[register][NumberKind.INT16], value)

    def _measured(self, now: float) -> dict[int, float]:
        shown, bench, drive = self._shown(now), self.bench, self._drive
        sources = {1: math.nan, 2: math.nan, drive.joint_source: shown.joint}
        valid = math.isfinite(shown.joint)
        return {
            Register.MODE: float(self.state),
            Register.POSITION: shown.motor,
            Register.VELOCITY: self._velocity(),
            Register.TORQUE: shown.current * drive.needs.torque_constant / drive.output_ratio,
            Register.Q_CURRENT: shown.current,
            Register.MOTOR_TEMPERATURE: math.nan,
            Register.HOME_STATE: float(HOMED),
            Register.VOLTAGE: SUPPLY,
            Register.TEMPERATURE: bench.temperature,
            Register.FAULT: float(self.fault),
            Register.ENCODER_1_POSITION: sources[1],
            Register.ENCODER_2_POSITION: sources[2],
            Register.ENCODER_VALIDITY: float(0b11 | (0b11 << 2 * drive.joint_source if valid else 0)),
            Register.MODEL: float(MODEL),
            Register.FIRMWARE: float(FIRMWARE),
            Register.REGISTER_MAP: float(frames.REGISTER_MAP),
            Register.SERIAL_1: float(SERIAL[0]),
            Register.SERIAL_2: float(SERIAL[1]),
            Register.SERIAL_3: float(SERIAL[2]),
        }

    def _sample(self, now: float) -> None:
        """Through the encoders' noise, with the faults that are there at `now` [s]."""
        turns = self._encoders(self._joint, now)
        current = self._drive.motor_direction * self._current(now)
        shown, turned = (math.nan if value == NO_NUMBER else value for value in turns)
        shown = math.copysign(frames.MOST_TURNS, shown) if math.isinf(shown) else shown + self._shift
        self._history.append(Sampled(shown, turned % 1.0 if math.isfinite(turned) else math.nan, current))

    def _shown(self, now: float) -> Sampled:
        if not self._history:
            self._sample(now)
        shown: Sampled = self._delayed(now)
        return shown

    def _take(self, now: float) -> None:
        """A command takes effect, once its frame has been answered."""
        wanted = self._wanted
        if wanted in NOT_COMMANDED:
            return
        timeout = self._command[Register.COMMAND_TIMEOUT]
        if timeout == 0.0:
            timeout = self._named.get("servo.default_timeout_s", math.nan)
        self._commanded, self._deadline = now, now + timeout if not math.isnan(timeout) else math.inf
        self._held = self._command[Register.COMMAND_POSITION]
        if math.isnan(self._held):
            self._held = self._position()
        if wanted is BoardMode.STOPPED:
            self._enter(BoardMode.STOPPED, now)
        elif self.state is BoardMode.STOPPED:
            self._enabled = now + ENABLING_TIME
            self._enter(BoardMode.ENABLING, now)
        elif self.state not in (*NOT_COMMANDED, BoardMode.TIMEOUT):
            self._begin(now)

    def _begin(self, now: float) -> None:
        """From one mode with torque to the one that is wanted; position mode not from outside its limits."""
        low, high = self._bounds()
        outside = not low <= self._position() <= high
        if self._wanted is BoardMode.POSITION and outside and not self._command[Register.COMMAND_IGNORE_BOUNDS]:
            self._fail(OUTSIDE_LIMITS, now)
        else:
            self._enter(self._wanted, now)

    def _bounds(self) -> tuple[float, float]:
        low, high = (self._named.get(f"servopos.position_{end}", math.nan) for end in ("min", "max"))
        return -math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high

    def _control(self, now: float) -> float:
        """Where position mode wants the output: the command's place, on with its velocity, in its limits [turns]."""
        if not math.isfinite(self._commanded):
            return math.nan
        velocity = self._command[Register.COMMAND_VELOCITY]
        place = self._held + (velocity * (now - self._commanded) if math.isfinite(velocity) else 0.0)
        low, high = self._bounds()
        return place if self._command[Register.COMMAND_IGNORE_BOUNDS] else max(low, min(high, place))

    def _entered(self, before: Any, now: float, why: str) -> None:
        if before is BoardMode.FAULT:
            self.fault = 0
        self._power(now, on=self.state is BoardMode.POSITION or self._doing(now) != OFF, why=why)

    def _stop(self, now: float, why: str) -> None:
        self._enter(BoardMode.STOPPED, now, why)

    def _code_of(self, amount: int) -> int:
        return amount if frames.FIRST_FAULT <= amount < frames.FIRST_LIMIT else DRIVER_FAULT

    def _doing(self, now: float) -> Doing:
        """What the motor does in this mode."""
        command = self._command
        if self.state is BoardMode.POSITION:
            torque = command[Register.COMMAND_MAX_TORQUE]
            gains = command[Register.COMMAND_KP_SCALE] > 0.0 and self._named.get("servo.pid_position.kp", 0.0) > 0.0
            gives = gains and (math.isnan(torque) or torque > 0.0) and not self.faults.active("inert", now)
            return FOLLOW if gives else OFF
        reaction = self._named.get("servo.timeout_mode", 0.0)
        braking = self.state is BoardMode.TIMEOUT and reaction != BoardMode.STOPPED
        return BRAKE if braking or self.state in (BoardMode.ZERO_VELOCITY, BoardMode.BRAKE) else OFF

    def _watch(self, now: float) -> None:
        if self.state is BoardMode.ENABLING and now >= self._enabled:
            self._begin(now)
        deadline = max(self._deadline, self._commanded + self.patience) if self.patience else self._deadline
        if self.state is BoardMode.POSITION and now >= deadline:
            self._enter(BoardMode.TIMEOUT, now)

    def _fail(self, code: int, now: float) -> None:
        """Torque off at once."""
        self.fault = code
        self._journal(now, "fault", f"{code}")
        self._enter(BoardMode.FAULT, now)

    def _command_motor(self, now: float, span: float) -> Doing:
        bench = self.bench
        self._watch(now)
        doing = self._doing(now)
        if doing == FOLLOW:
            bench.command = self._scale.angle(self._control(now) - self._shift)
            if bench.torque_offset is not None:
                feed = self._command[Register.COMMAND_TORQUE] * self._drive.output_ratio * self._drive.needs.gear
                bench.torque_offset = self._drive.motor_direction * feed if math.isfinite(feed) else 0.0
        return doing

    def _protect(self, now: float) -> None:
        window = self._named.get("servo.fault_position_error", math.nan)
        if self.state is not BoardMode.POSITION:
            return
        if math.isfinite(window) and abs(self._control(now) - self._position()) > window:
            self._fail(POSITION_ERROR, now)
        if self.bench.temperature >= self._named.get("servo.fault_temperature", math.inf):
            self._fail(OVER_TEMPERATURE, now)


_SATURATED = frozenset({Register.VELOCITY, Register.TORQUE, Register.Q_CURRENT, Register.VOLTAGE})
