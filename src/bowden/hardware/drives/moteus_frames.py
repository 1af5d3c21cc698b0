"""Frames of mjbots moteus boards by hand: identifiers, subframes, registers and their scales, the cycle's frames. Pure.

A frame of CAN-FD carries subframes: registers to write, registers to read, replies to these, errors, and the bytes of
the diagnostic channel. Each number is of one of four types; an integer stands for a physical value by a scale of the
register, its lowest value stands for none, and what is beyond its ends stands at them.

Identifiers have the sender in bits 8 to 14, the receiver in bits 0 to 6, and bit 15 where a reply is wanted.

    command of a cycle  mode i8, position, velocity, feed-forward torque f32, scales of kp and kd i16, largest torque,
                        watchdog timeout f32, and the questions: 48 bytes
    reply               mode i8; position, velocity, torque, q current f32; temperature, fault i8; position of the
                        joint's encoder f32; validity of the encoders i8; watchdog timeout f32: 41 bytes, filled to 48

Source: mjbots/moteus, docs/protocol/can.md and docs/protocol/registers.md, register map version 5; the subframes of the
diagnostic channel and the order of a server's replies are those of mjbots/mjlib, mjlib/multiplex/format.h and
micro_server.cc.
"""

import contextlib
import functools
import math
import struct
from collections.abc import Iterator, Mapping
from enum import IntEnum
from typing import NamedTuple

from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.drives.findings import finding_text

REGISTER_MAP = 5
"""Version of the register map, register 102h, that all here is of."""
REPLY_WANTED = 0x8000
BROADCAST = 0x7F
HIGHEST_PREFIX = 0x1FFF
"""Largest `can.prefix`: the upper 13 bits of an extended identifier."""
STANDARD_ID = 0x7FF
"""Identifiers above are extended ones; whether one below is does not count."""
MOST_TURNS = 32767.0
"""Largest position that a board takes [turns]."""


class BoardMode(IntEnum):
    """Register 000h."""

    STOPPED = 0
    """No torque; written, it clears a fault."""
    FAULT = 1
    ENABLING = 2
    CALIBRATING = 3
    CALIBRATED = 4
    """The three that lead from stopped to a mode with torque."""
    PWM = 5
    VOLTAGE = 6
    VOLTAGE_FOC = 7
    VOLTAGE_DQ = 8
    CURRENT = 9
    POSITION = 10
    TIMEOUT = 11
    """The watchdog has run out; it is left by stopping alone. What the motor does meanwhile says servo.timeout_mode."""
    ZERO_VELOCITY = 12
    STAY_WITHIN = 13
    MEASURE_INDUCTANCE = 14
    BRAKE = 15


class Register(IntEnum):
    """Registers that are used here, or that the twin has."""

    MODE = 0x000
    POSITION = 0x001
    VELOCITY = 0x002
    TORQUE = 0x003
    Q_CURRENT = 0x004
    MOTOR_TEMPERATURE = 0x00A
    HOME_STATE = 0x00C
    VOLTAGE = 0x00D
    TEMPERATURE = 0x00E
    FAULT = 0x00F
    COMMAND_POSITION = 0x020
    COMMAND_VELOCITY = 0x021
    COMMAND_TORQUE = 0x022
    COMMAND_KP_SCALE = 0x023
    COMMAND_KD_SCALE = 0x024
    COMMAND_MAX_TORQUE = 0x025
    COMMAND_TIMEOUT = 0x027
    COMMAND_IGNORE_BOUNDS = 0x02D
    ENCODER_1_POSITION = 0x052
    ENCODER_2_POSITION = 0x054
    ENCODER_VALIDITY = 0x058
    MODEL = 0x100
    FIRMWARE = 0x101
    REGISTER_MAP = 0x102
    SERIAL_1 = 0x120
    SERIAL_2 = 0x121
    SERIAL_3 = 0x122


class NumberKind(IntEnum):
    """Types of a number on the wire."""

    INT8 = 0
    INT16 = 1
    INT32 = 2
    FLOAT = 3


WRITE, READ, REPLY = 0x00, 0x10, 0x20
"""Subframes of registers: four times the type is added, and the number of registers where it is 1 to 3."""
WRITE_ERROR, READ_ERROR = 0x30, 0x31
TO_DRIVE, FROM_DRIVE, POLL = 0x40, 0x41, 0x42
"""Subframes of the diagnostic channel: bytes to the board, its bytes, and the question for these."""
NOP = 0x50
"""Fills a frame up to a length that there is."""
CHANNEL = 1
"""Of the diagnostic console."""
UNKNOWN_REGISTER, NOT_WRITEABLE = 1, 2
"""Numbers of errors."""

Scales = tuple[float, float, float]
"""Physical value of one of an int8, an int16, an int32."""
_SHARE: Scales = (1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2147483647.0)
_OF: Mapping[Scales, tuple[Register, ...]] = {
    (0.01, 1e-4, 1e-5): (  # [turns]
        *(Register.POSITION, Register.COMMAND_POSITION, Register.ENCODER_1_POSITION, Register.ENCODER_2_POSITION),
    ),
    (0.1, 0.25e-3, 1e-5): (Register.VELOCITY, Register.COMMAND_VELOCITY),  # [turns/s]
    (0.5, 0.01, 1e-3): (Register.TORQUE, Register.COMMAND_TORQUE, Register.COMMAND_MAX_TORQUE),  # [N·m]
    (1.0, 0.1, 1e-3): (Register.Q_CURRENT, Register.TEMPERATURE, Register.MOTOR_TEMPERATURE),  # [A], [°C]
    (0.5, 0.1, 1e-3): (Register.VOLTAGE,),  # [V]
    (0.01, 1e-3, 1e-6): (Register.COMMAND_TIMEOUT,),  # [s]
    _SHARE: (Register.COMMAND_KP_SCALE, Register.COMMAND_KD_SCALE),  # [–]
}
SCALES: Mapping[int, Scales] = {register: scales for scales, registers in _OF.items() for register in registers}
"""Register → its scales; what is not here is a whole number of every type."""

_TYPES = (struct.Struct("<b"), struct.Struct("<h"), struct.Struct("<i"), struct.Struct("<f"))
_MOST = (127, 32767, 2147483647)


def identifier_of(source: int, destination: int, prefix: int = 0, *, reply: bool = False) -> int:
    """The identifier of a frame; boards and hosts with another prefix (`can.prefix`) do not hear it.

    >>> hex(identifier_of(0, 1, reply=True)), hex(identifier_of(1, 0)), hex(identifier_of(1, 0, 0x123))
    ('0x8001', '0x100', '0x1230100')
    """
    return prefix << 16 | (REPLY_WANTED if reply else 0) | source << 8 | destination


def with_flag(identifier: int) -> int:
    """An identifier with the flag of `buses.place` where it is an extended one."""
    return identifier | EXTENDED * (identifier > STANDARD_ID)


def prefix_of(identifier: int) -> int:
    """The prefix of an identifier; flags above it do not count.

    >>> prefix_of(0x8001), prefix_of(0x1230100)
    (0, 291)
    """
    return identifier >> 16 & HIGHEST_PREFIX


def wire_value(register: int, kind: NumberKind, value: float) -> float:
    """Encoded form of a physical value; see the module."""
    scales = SCALES.get(register)
    if kind is NumberKind.FLOAT:
        return value
    most = _MOST[kind]
    if scales is None:
        whole = int(value) if math.isfinite(value) else 0
        return (whole + most + 1) % (2 * most + 2) - most - 1  # cut to its bits, as a cast does
    if not math.isfinite(value):
        return -most - 1
    return round(max(-float(most), min(float(most), value / scales[kind])))


def physical_value(register: int, kind: NumberKind, value: float) -> float:
    """The physical value that a number on the wire stands for; NaN for none.

    >>> physical_value(Register.POSITION, NumberKind.INT16, 0x0050)
    0.008
    >>> physical_value(Register.POSITION, NumberKind.INT16, -32768)
    nan
    """
    scales = SCALES.get(register)
    if kind is NumberKind.FLOAT or scales is None:
        return value
    return math.nan if value == -_MOST[kind] - 1 else value * scales[kind]


def varuint(value: int) -> bytes:
    """A whole number of seven bits a byte, the lowest first."""
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes((*found, value))


def subframe(base: int, kind: NumberKind, register: int, count: int) -> bytes:
    """The head of a subframe of so many registers from one on; where they are read, all of it."""
    head = base | kind << 2
    return (bytes((head | count,)) if count <= 3 else bytes((head,)) + varuint(count)) + varuint(register)


def values(base: int, kind: NumberKind, register: int, *physical: float) -> bytes:
    """A subframe that writes, or replies with, these physical values from a register on."""
    found = subframe(base, kind, register, len(physical))
    return found + b"".join(
        _TYPES[kind].pack(wire_value(register + i, kind, value)) for i, value in enumerate(physical)
    )


class Subframe(NamedTuple):
    """A part of a frame; of registers that are written or replied with, one of them."""

    head: int
    """`WRITE`, `READ`, `REPLY`, an error, or one of the diagnostic channel."""
    at: int
    """The register, of some that are asked for the first; of the diagnostic channel its number."""
    value: float = math.nan
    """Of a register, physical, NaN for none; or the number of an error, or how many bytes may come."""
    kind: NumberKind = NumberKind.INT8
    """Type of registers that are asked for."""
    amount: int = 1
    """Of these."""
    counted: bool = False
    """True if the number of them stands in a byte of its own, as it then does in the reply."""
    data: bytes = b""
    """Of the diagnostic channel."""


def subframes(data: bytes) -> Iterator[Subframe]:
    """What a frame says, up to what cannot be read."""
    with contextlib.suppress(IndexError, struct.error):
        yield from _subframes(data)


def _subframes(data: bytes) -> Iterator[Subframe]:
    at = 0
    while at < len(data):
        head, at = _read_varuint(data, at)
        if head == NOP:
            continue
        if head < WRITE_ERROR:
            base, kind, count = head & 0x30, NumberKind(head >> 2 & 3), head & 3
            counted = count == 0
            if counted:
                count, at = _read_varuint(data, at)
            register, at = _read_varuint(data, at)
            if base == READ:
                yield Subframe(base, register, kind=kind, amount=count, counted=counted)
                continue
            for i in range(register, register + count):
                (number,) = _TYPES[kind].unpack_from(data, at)
                at += _TYPES[kind].size
                yield Subframe(base, i, physical_value(i, kind, number))
        elif head in (WRITE_ERROR, READ_ERROR, POLL, TO_DRIVE, FROM_DRIVE):
            first, at = _read_varuint(data, at)
            second, at = _read_varuint(data, at)
            size = second if head in (TO_DRIVE, FROM_DRIVE) else 0
            if at + size > len(data):
                return
            yield Subframe(head, first, float(second), data=bytes(data[at : at + size]))
            at += size
        else:
            return


def _read_varuint(data: bytes, at: int) -> tuple[int, int]:
    """The number from a place on, and where the next one begins."""
    value = 0
    for i in range(5):
        byte = data[at + i]
        value |= (byte & 0x7F) << 7 * i
        if not byte & 0x80:
            return value & 0xFFFF_FFFF, at + i + 1
    raise IndexError


def replied(data: bytes) -> tuple[dict[int, float], list[Subframe], bytes]:
    """Decoded reply: registers with physical values, errors, bytes of the console."""
    parts = list(subframes(data))
    found = {one.at: one.value for one in parts if one.head == REPLY}
    failed = [one for one in parts if one.head in (WRITE_ERROR, READ_ERROR)]
    return found, failed, b"".join(one.data for one in parts if (one.head, one.at) == (FROM_DRIVE, CHANNEL))


def padded(data: bytes) -> bytes:
    """A frame's data filled up to the next length that CAN-FD has."""
    for length in (*range(9), 12, 16, 20, 24, 32, 48, 64):
        if length >= len(data):
            return data + bytes((NOP,)) * (length - len(data))
    raise ValueError(f"{len(data)} bytes, and a frame has 64")


class MoteusCommand(NamedTuple):
    """A command in position mode, of the board's output."""

    position: float
    """NaN for the present one [turns]."""
    velocity: float
    """With which the position goes on until the next command [turns/s]."""
    torque: float
    """Feed-forward [N·m]."""
    kp_scale: float
    """Share of the board's own gain, 0 to 1 [–]."""
    kd_scale: float
    """[–]"""
    max_torque: float
    """NaN for what the board's largest current gives [N·m]."""
    timeout: float
    """Of the board's watchdog [s]."""


class MoteusReply(NamedTuple):
    """The reply to a cycle's questions."""

    mode: int
    position: float
    """Of the output [turns]; NaN for none."""
    velocity: float
    """[turns/s]"""
    torque: float
    """[N·m]"""
    q_current: float
    """[A]"""
    temperature: int
    """Of the power stage [°C]; −128 for none."""
    fault: int
    joint: float
    """Of the joint's encoder, of the part of a turn that it measures [turns]."""
    validity: int
    """Bits 2·n of encoder n."""
    timeout: float
    """Of the watchdog, as the command had it [s]."""


NO_INT8 = -128
SOURCES = {1: Register.ENCODER_1_POSITION, 2: Register.ENCODER_2_POSITION}
"""Slot of an encoder beside the rotor's (`motor_position.sources`) → its register."""


class CommandFrames:
    """The frames of a cycle: what is asked for does not change.

    Args:
        source: slot of the joint's encoder.
    """

    def __init__(self, source: int) -> None:
        asked = (
            (NumberKind.INT8, Register.MODE, 1),
            (NumberKind.FLOAT, Register.POSITION, 4),
            (NumberKind.INT8, Register.TEMPERATURE, 2),
            (NumberKind.FLOAT, SOURCES[source], 1),
            (NumberKind.INT8, Register.ENCODER_VALIDITY, 1),
            (NumberKind.FLOAT, Register.COMMAND_TIMEOUT, 1),
        )
        self.questions = b"".join(subframe(READ, *one) for one in asked)
        self._heads = tuple(subframe(REPLY, *one) for one in asked)
        self.stop = padded(values(WRITE, NumberKind.INT8, Register.MODE, BoardMode.STOPPED) + self.questions)
        """Torque off, and the questions."""
        self.ask = padded(self.questions)
        """The questions alone."""
        self._mode = values(WRITE, NumberKind.INT8, Register.MODE, BoardMode.POSITION)

    def command(self, given: MoteusCommand) -> bytes:
        """A command in position mode, and the questions."""
        kp, kd = _shares(given.kp_scale, given.kd_scale)
        return _COMMAND.pack(
            self._mode, _MOTION, given.position, given.velocity, given.torque, _GAINS, kp, kd,
            _TORQUE, given.max_torque, _TIMEOUT, given.timeout, self.questions,
        )  # fmt: skip

    def reply(self, data: bytes) -> MoteusReply | None:
        """A reply to all the questions in the types asked for; None of anything else."""
        if len(data) < _REPLY.size:
            return None
        one, mode, two, position, velocity, torque, current, three, temperature, fault, four, joint, five, validity, *rest = _REPLY.unpack_from(data)  # fmt: skip  # noqa: E501
        if (one, two, three, four, five, rest[0]) != self._heads:
            return None
        return MoteusReply(
            mode, position, velocity, torque, current, temperature, fault, joint, validity & 0xFF, rest[1]
        )


@functools.lru_cache(maxsize=16)
def _shares(kp_scale: float, kd_scale: float) -> tuple[int, int]:
    """Shares of the board's gains on the wire; they are the same in every cycle of a run."""
    kp, kd = (
        int(wire_value(register, NumberKind.INT16, min(1.0, max(0.0, share))))
        for register, share in ((Register.COMMAND_KP_SCALE, kp_scale), (Register.COMMAND_KD_SCALE, kd_scale))
    )
    return kp, kd


_MOTION = subframe(WRITE, NumberKind.FLOAT, Register.COMMAND_POSITION, 3)
_GAINS = subframe(WRITE, NumberKind.INT16, Register.COMMAND_KP_SCALE, 2)
_TORQUE = subframe(WRITE, NumberKind.FLOAT, Register.COMMAND_MAX_TORQUE, 1)
_TIMEOUT = subframe(WRITE, NumberKind.FLOAT, Register.COMMAND_TIMEOUT, 1)
_COMMAND = struct.Struct("<3s2sfff2shh2sf2sf13s")
_REPLY = struct.Struct("<2sb3sffff2sbb2sf2sb2sf")

TIMED_OUT = 0xFE11
"""Code of the driver's own finding."""
FIRST_FAULT, FIRST_LIMIT = 32, 96
"""From the latter on a code says what limits the output, and is no fault."""

FAULTS: Mapping[int, str] = {
    32: "calibration: the encoder sensed no magnet",
    33: "motor driver: most often the supply gives less than the motor takes",
    34: "over-voltage of the supply: it cannot take back what the motor brakes (servo.max_voltage)",
    35: "encoder: its readings are not those of a magnet",
    36: "the motor is not configured: calibrate it with moteus_tool",
    37: "PWM cycle overrun: an internal error of the firmware",
    38: "over-temperature of the board or the motor",
    39: "outside its limits: position mode began beyond servopos.position_min or position_max",
    40: "under-voltage of the supply: an emergency stop that cuts it shows so",
    41: "the configuration was changed while it ran",
    42: "no valid encoder for commutation",
    43: "no valid encoder for the position",
    44: "the gate driver could not be enabled",
    45: "a stop position with limits of speed or acceleration",
    46: "a time inside the firmware was not kept",
    47: "feed-forward of the back-EMF without a limit of acceleration",
    48: "its limits of the position are beyond what it can count",
    96: "the speed limits the output (servo.max_velocity)",
    97: "the power limits the output (servo.max_power_W)",
    98: "the supply's voltage limits the output",
    99: "the current limits the output (servo.max_current_A)",
    100: "the board's temperature limits the output",
    101: "the motor's temperature limits the output",
    102: "the commanded torque limits the output",
    103: "the limits of the position limit the output",
}
"""Code of register 00Fh → what it means (docs/protocol/registers.md, docs/troubleshooting, fw/error.h)."""

_OURS: Mapping[int, str] = {
    TIMED_OUT: "the board's watchdog ran out and it took its torque off (mode 11): commands came too late or were "
    "lost; check the bus and the load of this computer",
}


def fault_text(code: int) -> str:
    """The text of a code, with the code.

    >>> fault_text(40)
    '40: under-voltage of the supply: an emergency stop that cuts it shows so'
    """
    return (
        finding_text(code, _OURS)
        or f"{code}: {FAULTS.get(code, 'a fault that is not known here: see its maker’s register reference')}"
    )
