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

import functools
import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

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
    """What distinguishes one model in MIT mode, on a board of one generation."""

    gear: float
    """Motor turns per turn of the output shaft; the number behind its name [–]."""
    velocity: float
    """Either way, at the output shaft [rad/s]."""
    torque: float
    """Either way, at the output shaft [N·m]."""
    pole_pairs: int = 21
    """Of the motor; V3 tells its electrical speed."""
    v3: bool = False
    """Whether its board is a V3."""

    @property
    def command_fields(self) -> tuple[str, ...]:
        """Of a command, in their order."""
        of_v3 = ("kp", "kd", "position", "velocity", "torque")
        return of_v3 if self.v3 else ("position", "velocity", "kp", "kd", "torque")


MODELS: Mapping[str, Mapping[str, AkModel]] = {
    "v2": {
        "AK10-9": AkModel(9.0, 50.0, 65.0),
        "AK60-6": AkModel(6.0, 45.0, 15.0),
        "AK70-10": AkModel(10.0, 50.0, 25.0),
        "AK80-6": AkModel(6.0, 76.0, 12.0),
        "AK80-9": AkModel(9.0, 50.0, 18.0),
        "AK80-64": AkModel(64.0, 8.0, 144.0),
    },
    "v3": {
        "AK10-9": AkModel(9.0, 28.0, 54.0, v3=True),
        "AK60-6": AkModel(6.0, 60.0, 12.0, 14, v3=True),
        "AK80-9": AkModel(9.0, 65.0, 18.0, v3=True),
    },
}
"""Board → name → ranges: manual V1.0.8, page 50, where the AK80-64 stands as AK80-80, by its older name; manual V3.0.0,
4.2."""


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


REPLY_FIELDS = ("position", "velocity", "torque")


@functools.cache
def _ranges(model: AkModel) -> Mapping[str, tuple[int, float, float]]:
    """Field → its bits, and the values at its ends."""
    end = 12.56 if model.v3 else HIGHEST_POSITION
    return {
        "position": (16, -end, end),
        "velocity": (12, -model.velocity, model.velocity),
        "kp": (12, 0.0, HIGHEST_KP),
        "kd": (12, 0.0, HIGHEST_KD),
        "torque": (12, -model.torque, model.torque),
    }


def _packed(fields: Sequence[str], values: Any, model: AkModel) -> int:
    """Fields of a command or a reply, the highest first; the end of a field's range for what is beyond."""
    bits, ranges = 0, _ranges(model)
    for name in fields:
        size, low, high = ranges[name]
        top = (1 << size) - 1
        code = int((getattr(values, name) - low) * top / (high - low) + 0.5 + 1e-9)  # 0 is not just below a half
        bits = bits << size | max(0, min(top, code))
    return bits


def _unpacked(fields: Sequence[str], bits: int, model: AkModel) -> dict[str, float]:
    found, ranges = {}, _ranges(model)
    for name in reversed(fields):
        size, low, high = ranges[name]
        top = (1 << size) - 1
        found[name] = low + (bits & top) * (high - low) / top
        bits >>= size
    return found


def pack_command(command: AkCommand, model: AkModel) -> bytes:
    """A command as bytes, each value within its range, to a V3 without its torque; one that could be taken for `ENTER`,
    `EXIT` or `ZERO` is not packed, but for a torque that is a step smaller.
    """
    if model.v3:
        return _packed(model.command_fields, command._replace(torque=0.0), model).to_bytes(8, "big")
    bits = _packed(model.command_fields, command, model)
    return (bits - 0x100 if bits >> 8 == (1 << 56) - 1 else bits).to_bytes(8, "big")


def unpack_command(data: bytes, model: AkModel) -> AkCommand | None:
    """A command; None of anything but eight bytes, and of `ENTER`, `EXIT` and `ZERO`, which a V3 does not have."""
    if len(data) != 8 or (not model.v3 and data in (ENTER, EXIT, ZERO)):
        return None
    return AkCommand(**_unpacked(model.command_fields, int.from_bytes(data, "big"), model))


def _speed_step(model: AkModel) -> float:
    """Of a count of a V3's speed, at the output shaft [rad/s]."""
    return 10.0 * 2.0 * math.pi / 60.0 / (model.pole_pairs * model.gear)


def pack_reply(reply: AkReply, model: AkModel, torque_per_ampere: float = math.nan) -> bytes:
    """A reply, or what a V3 tells by itself, as bytes, each value within its range.

    A position beyond its range begins again at the other end, but for that of a V3.

    Args:
        reply: what the drive says.
        model: which it is.
        torque_per_ampere: at the output shaft, by which a V3 tells its torque [N·m/A].
    """
    if not model.v3:
        span = 2.0 * HIGHEST_POSITION
        within = reply._replace(position=(reply.position + HIGHEST_POSITION) % span - HIGHEST_POSITION)
        bits = reply.number << 56 | _packed(REPLY_FIELDS, within, model) << 16
        return (bits | (reply.temperature & 0xFF) << 8 | reply.error).to_bytes(8, "big")
    values = (
        math.degrees(reply.position) / 0.1,
        reply.velocity / _speed_step(model),
        reply.torque / torque_per_ampere / 0.01,
    )
    counts = (max(-32000, min(32000, round(value))) for value in values)
    return struct.pack(">hhhbB", *counts, max(-128, min(127, reply.temperature)), reply.error)


def unpack_reply(data: bytes, model: AkModel, number: int = 0, torque_per_ampere: float = math.nan) -> AkReply | None:
    """A reply, or what a V3 of a number, which stands in the identifier, tells; None of anything but eight bytes."""
    if len(data) != 8:
        return None
    if model.v3:
        place, speed, current, temperature, error = struct.unpack(">hhhbB", data)
        position, velocity, torque = math.radians(0.1 * place), _speed_step(model) * speed, 0.01 * current
        return AkReply(number, position, velocity, torque_per_ampere * torque, temperature, error, abs(place) >= 32000)
    bits = int.from_bytes(data, "big")
    found = _unpacked(REPLY_FIELDS, bits >> 16 & (1 << 40) - 1, model)
    at_end = bits >> 40 & 0xFFFF in (0, 0xFFFF)
    return AkReply(number=data[0], temperature=data[6], error=data[7], at_end=at_end, **found)
