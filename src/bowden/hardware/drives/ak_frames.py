"""CubeMars AK series in MIT mode: frames of eight bytes by hand, and the ranges of each model. Pure.

    command   number of the drive    position 16, velocity 12, kp 12, kd 12, torque 12 bits, the highest first
    reply     its own number, or     number of the drive 8, position 16, velocity 12, torque 12 bits,
              its "CAN Master ID"    temperature 8, error code 8

A field of n bits holds a value from its range's lower to its upper end, code = (value − low)·(2ⁿ − 1)/(high − low);
beyond an end a position begins again at the other one. Three commands are none: seven bytes FFh, and FCh, FDh or FEh.

Boards of V3 have other frames, of the extended format, and no order to enter or leave a mode: torque is what the last
command says. They tell their state by themselves, up to 500 times a second, as any board does in servo mode:

    command   8 · 256 + number      kp 12, kd 12, position 16, velocity 12, torque 12 bits
    state     29h · 256 + number    position 16 [0.1°], speed 16 [10 electrical rev/min], current 16 [0.01 A],
                                    temperature 8, error code 8

Source of V3: CubeMars, "AK Series Module Product Manual" V3.0.0, 4.2 and 4.3.1, as naubiomech/OpenExo (`Motor.cpp`)
has it. Whether its torque is in N·m or in A the manual says both ways: none is sent.

Source: CubeMars, "AK Series Actuator Driver Manual" V1.0.8, chapter 5.3, pages 48 to 50: codes, layout and the table of
ranges; page 39 for the error codes. Where it contradicts itself or later editions: docs/background/drives.md.
"""

import math
import struct
from collections.abc import Mapping
from typing import NamedTuple

ENTER, EXIT, ZERO = (bytes((*(0xFF,) * 7, last)) for last in (0xFC, 0xFD, 0xFE))
"""Enter motor mode; leave it; take the present position for zero."""

HIGHEST_POSITION = 12.5
"""At the output shaft, either way; of all models [rad]."""
HIGHEST_KP, HIGHEST_KD = 500.0, 5.0
"""Of all models [N·m/rad], [N·m·s/rad]."""

ERRORS: Mapping[int, str] = {
    1: "over-temperature",
    2: "over-current",
    3: "over-voltage",
    4: "under-voltage",
    5: "encoder",
    6: "phase currents unbalanced: the hardware may be damaged",
    7: "motor locked (V3)",
}
"""Error code of a reply → what the manual says of it."""


def error_text(code: int) -> str:
    """What the error code of a reply means."""
    return f"0x{code:02X}, {ERRORS.get(code, 'which its manual does not name')}"


class AkModel(NamedTuple):
    """What distinguishes one model in MIT mode."""

    gear: float
    """Motor turns per turn of the output shaft; the number behind its name [–]."""
    velocity: float
    """Either way, at the output shaft [rad/s]."""
    torque: float
    """Either way, at the output shaft [N·m]."""
    pole_pairs: int = 21
    """Of the motor; V3 tells its electrical speed."""


MODELS: Mapping[str, AkModel] = {
    "AK10-9": AkModel(9.0, 50.0, 65.0),
    "AK60-6": AkModel(6.0, 45.0, 15.0),
    "AK70-10": AkModel(10.0, 50.0, 25.0),
    "AK80-6": AkModel(6.0, 76.0, 12.0),
    "AK80-9": AkModel(9.0, 50.0, 18.0),
    "AK80-64": AkModel(64.0, 8.0, 144.0),
}
"""Name → its ranges: manual V1.0.8, page 50; the AK80-64 stands there as AK80-80, by its older name."""


MODELS_V3: Mapping[str, AkModel] = {
    "AK10-9": AkModel(9.0, 28.0, 54.0),
    "AK60-6": AkModel(6.0, 60.0, 12.0, 14),
    "AK80-9": AkModel(9.0, 65.0, 18.0),
}
"""The same of boards V3: manual V3.0.0, 4.2."""
HIGHEST_POSITION_V3 = 12.56
"""[rad]"""


class AkCommand(NamedTuple):
    """What the drive makes its torque of: kp·(position − its own) + kd·(velocity − its own) + torque."""

    position: float
    """[rad]"""
    velocity: float
    """[rad/s]"""
    kp: float
    """[N·m/rad]"""
    kd: float
    """[N·m·s/rad]"""
    torque: float
    """[N·m]"""


class AkReply(NamedTuple):
    """What the drive says."""

    number: int
    """Its own."""
    position: float
    """[rad]"""
    velocity: float
    """[rad/s]"""
    torque: float
    """[N·m]"""
    temperature: int
    """The byte as it came."""
    error: int
    at_end: bool
    """True if the position's field stands at one of its ends, and says nothing of where the motor is."""


def pack_command(command: AkCommand, model: AkModel) -> bytes:
    """A command as bytes, each value within its range; one that could be taken for `ENTER`, `EXIT` or `ZERO` is not
    packed, but for a torque that is a step smaller.
    """
    position = _code(command.position, -HIGHEST_POSITION, HIGHEST_POSITION, 16)
    velocity = _code(command.velocity, -model.velocity, model.velocity, 12)
    kp, kd = _code(command.kp, 0.0, HIGHEST_KP, 12), _code(command.kd, 0.0, HIGHEST_KD, 12)
    torque = _code(command.torque, -model.torque, model.torque, 12)
    data = _packed(position, velocity, kp, kd, torque)
    return data if data[:7] != ENTER[:7] else _packed(position, velocity, kp, kd, torque - 0x100)


def _packed(position: int, velocity: int, kp: int, kd: int, torque: int) -> bytes:
    return (position << 48 | velocity << 36 | kp << 24 | kd << 12 | torque).to_bytes(8, "big")


def unpack_command(data: bytes, model: AkModel) -> AkCommand | None:
    """A command; None of anything but eight bytes, and of `ENTER`, `EXIT` and `ZERO`."""
    if len(data) != 8 or data in (ENTER, EXIT, ZERO):
        return None
    bits = int.from_bytes(data, "big")
    return AkCommand(
        _value(bits >> 48, -HIGHEST_POSITION, HIGHEST_POSITION, 16),
        _value(bits >> 36 & 0xFFF, -model.velocity, model.velocity, 12),
        _value(bits >> 24 & 0xFFF, 0.0, HIGHEST_KP, 12),
        _value(bits >> 12 & 0xFFF, 0.0, HIGHEST_KD, 12),
        _value(bits & 0xFFF, -model.torque, model.torque, 12),
    )


def pack_reply(reply: AkReply, model: AkModel) -> bytes:
    """A reply as bytes: a position beyond its range begins again at the other end, the rest stops at its own."""
    span = 2.0 * HIGHEST_POSITION
    within = (reply.position + HIGHEST_POSITION) % span - HIGHEST_POSITION
    bits = reply.number << 56 | _code(within, -HIGHEST_POSITION, HIGHEST_POSITION, 16) << 40
    bits |= _code(reply.velocity, -model.velocity, model.velocity, 12) << 28
    bits |= _code(reply.torque, -model.torque, model.torque, 12) << 16
    return (bits | (reply.temperature & 0xFF) << 8 | reply.error).to_bytes(8, "big")


def unpack_reply(data: bytes, model: AkModel) -> AkReply | None:
    """A reply; None of anything but eight bytes."""
    if len(data) != 8:
        return None
    bits = int.from_bytes(data, "big")
    position = bits >> 40 & 0xFFFF
    return AkReply(
        data[0],
        # `_value` written out: each cycle of a run is here
        -HIGHEST_POSITION + position * (2.0 * HIGHEST_POSITION) / 0xFFFF,
        -model.velocity + (bits >> 28 & 0xFFF) * (2.0 * model.velocity) / 0xFFF,
        -model.torque + (bits >> 16 & 0xFFF) * (2.0 * model.torque) / 0xFFF,
        data[6],
        data[7],
        position in (0, 0xFFFF),
    )


def _code(value: float, low: float, high: float, bits: int) -> int:
    """The nearest code; the end of the range for what is beyond."""
    top = (1 << bits) - 1
    return max(0, min(top, int((value - low) * top / (high - low) + 0.5)))


def _value(code: int, low: float, high: float, bits: int) -> float:
    return low + code * (high - low) / ((1 << bits) - 1)


def pack_command_v3(command: AkCommand, model: AkModel) -> bytes:
    """A command to a board V3, without its torque."""
    end = HIGHEST_POSITION_V3
    bits = _code(command.kp, 0.0, HIGHEST_KP, 12) << 52 | _code(command.kd, 0.0, HIGHEST_KD, 12) << 40
    bits |= _code(command.position + 1e-9, -end, end, 16) << 24  # so that 0 is not just below a half
    bits |= _code(command.velocity, -model.velocity, model.velocity, 12) << 12 | 0x800
    return bits.to_bytes(8, "big")


def unpack_command_v3(data: bytes, model: AkModel) -> AkCommand | None:
    """A command; None of anything but eight bytes."""
    if len(data) != 8:
        return None
    bits, end = int.from_bytes(data, "big"), HIGHEST_POSITION_V3
    return AkCommand(
        _value(bits >> 24 & 0xFFFF, -end, end, 16),
        _value(bits >> 12 & 0xFFF, -model.velocity, model.velocity, 12),
        _value(bits >> 52, 0.0, HIGHEST_KP, 12),
        _value(bits >> 40 & 0xFFF, 0.0, HIGHEST_KD, 12),
        _value(bits & 0xFFF, -model.torque, model.torque, 12),
    )


def _speed_step(model: AkModel) -> float:
    """Of a count of the speed, at the output shaft [rad/s]."""
    return 10.0 * 2.0 * math.pi / 60.0 / (model.pole_pairs * model.gear)


def pack_state_v3(state: AkReply, model: AkModel, torque_per_ampere: float) -> bytes:
    """What a board V3 tells by itself; each value within its range."""
    values = (
        math.degrees(state.position) / 0.1,
        state.velocity / _speed_step(model),
        state.torque / torque_per_ampere / 0.01,
    )
    counts = (max(-32000, min(32000, round(value))) for value in values)
    return struct.pack(">hhhbB", *counts, max(-128, min(127, state.temperature)), state.error)


def unpack_state_v3(data: bytes, number: int, model: AkModel, torque_per_ampere: float) -> AkReply | None:
    """The same of eight bytes; None of any other number of them."""
    if len(data) != 8:
        return None
    position, speed, current, temperature, error = struct.unpack(">hhhbB", data)
    return AkReply(
        number,
        math.radians(0.1 * position),
        _speed_step(model) * speed,
        torque_per_ampere * 0.01 * current,
        temperature,
        error,
        abs(position) >= 32000,
    )
