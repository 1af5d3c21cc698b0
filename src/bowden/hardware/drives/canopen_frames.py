"""CANopen frames by hand: identifiers, the drive's PDOs, heartbeat and emergency, as bytes. Pure.

    RPDO 1  200h + node   6040h controlword u16, 607Ah target position i32, and where a torque offset is sent
                          60B2h torque offset i16 [‰ of the rated torque]
    TPDO 1  180h + node   6041h statusword u16, 6064h position i32, 6077h torque i16 [‰ of the rated torque]
    TPDO 2  280h + node   60E4h:2 position of the second sensor i32, 3160h:1 analog input i16 [mV],
                          3201h:1 temperature of the power stage i16 [0.1 °C], where the drive can map it

    TPDO 3  380h + node   60FDh digital inputs u32, where one of them is the emergency stop's

Source: CiA 301, "predefined connection set", "emergency write", "heartbeat"; the two 3xxxh objects are maxon's (EPOS4
Firmware Specification).
"""

import struct
from typing import NamedTuple

NMT = 0x000
SYNC = 0x080
EMERGENCY = 0x080
TPDO1 = 0x180
RPDO1 = 0x200
TPDO2 = 0x280
TPDO3 = 0x380
SDO_ANSWER = 0x580
SDO_REQUEST = 0x600
HEARTBEAT = 0x700
"""COB-IDs; the node's number is added to all but NMT and SYNC."""

NMT_START, NMT_STOP, NMT_PRE_OPERATIONAL, NMT_RESET_NODE, NMT_RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82
"""Commands of NMT node control."""

BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x04, 0x05, 0x7F
"""NMT states as a heartbeat has them."""

STATE_AFTER = {NMT_START: OPERATIONAL, NMT_STOP: STOPPED, NMT_PRE_OPERATIONAL: PRE_OPERATIONAL}
"""Command → the state to which it leads."""

INT16, INT32 = 2**15, 2**31

RPDO1_MAPPING = (0x6040_0010, 0x607A_0020)
TORQUE_OFFSET = 0x60B2_0010
"""Comes third where it is sent."""
TPDO1_MAPPING = (0x6041_0010, 0x6064_0020, 0x6077_0010)
TPDO2_MAPPING = (0x60E4_0220, 0x3160_0110, 0x3201_0110)
TPDO3_MAPPING = (0x60FD_0020,)
"""Index, sub-index and length in bits of what is mapped, as 1600h and 1A00h to 1A02h want it."""

_RPDO1, _RPDO1_PUSHED, _TPDO1 = struct.Struct("<Hi"), struct.Struct("<Hih"), struct.Struct("<Hih")
_TPDO2, _TPDO2_SHORT, _EMERGENCY = struct.Struct("<ihh"), struct.Struct("<ih"), struct.Struct("<HB")


class Motion(NamedTuple):
    """Content of TPDO 1."""

    statusword: int
    position: int
    """[counts]"""
    torque: int
    """[‰ of the rated torque]"""


class Sensors(NamedTuple):
    """Content of TPDO 2."""

    joint: int
    """[counts]"""
    analog: int
    """[mV]"""
    temperature: int | None
    """[0.1 °C]; None of a drive that does not send it."""


def of_the_host(node: int, host: int) -> frozenset[int]:
    """COB-IDs of what nobody but this host may send while it has a drive: NMT, SYNC, the drive's RPDOs, questions to
    its SDO server (CiA 301 has one client of it), and the host's own heartbeat.
    """
    rpdos = (RPDO1 + 0x100 * i + node for i in range(4))
    return frozenset((NMT, SYNC, *rpdos, SDO_REQUEST + node, HEARTBEAT + host))


def pack_rpdo1(control: int, target: int, torque: int | None = None) -> bytes:
    """Controlword, target position [counts] and, where it is mapped, torque offset [‰] as bytes."""
    return _RPDO1.pack(control, target) if torque is None else _RPDO1_PUSHED.pack(control, target, torque)


def unpack_rpdo1(data: bytes | bytearray, *, pushed: bool = False) -> tuple[int, int, int] | None:
    """Controlword, target position [counts] and torque offset [‰], 0 where it is not mapped; None of another length."""
    if len(data) != (_RPDO1_PUSHED if pushed else _RPDO1).size:
        return None
    control, target, torque = _RPDO1_PUSHED.unpack(data) if pushed else (*_RPDO1.unpack(data), 0)
    return control, target, torque


def pack_tpdo1(motion: Motion) -> bytes:
    """TPDO 1 as bytes."""
    return _TPDO1.pack(*motion)


def unpack_tpdo1(data: bytes | bytearray) -> Motion | None:
    """TPDO 1; None of anything but 8 bytes."""
    return Motion(*_TPDO1.unpack(data)) if len(data) == _TPDO1.size else None


def pack_tpdo2(sensors: Sensors) -> bytes:
    """TPDO 2 as bytes; without a temperature the six of the rest."""
    if sensors.temperature is None:
        return _TPDO2_SHORT.pack(*sensors[:2])
    return _TPDO2.pack(*sensors)


def unpack_tpdo2(data: bytes | bytearray) -> Sensors | None:
    """TPDO 2; None of anything but 8 bytes, or 6 where the temperature is not mapped."""
    if len(data) == _TPDO2.size:
        return Sensors(*_TPDO2.unpack(data))
    if len(data) != _TPDO2_SHORT.size:
        return None
    joint, analog = _TPDO2_SHORT.unpack(data)
    return Sensors(joint, analog, None)


def unpack_tpdo3(data: bytes | bytearray) -> int | None:
    """The digital inputs of TPDO 3; None of anything but 4 bytes."""
    return int.from_bytes(data, "little") if len(data) == 4 else None


def pack_emergency(code: int, register: int) -> bytes:
    """An emergency frame: error code, error register 1001h, five bytes of the maker's, here zero."""
    return _EMERGENCY.pack(code, register).ljust(8, b"\0")


def unpack_emergency(data: bytes | bytearray) -> int | None:
    """The error code of an emergency frame; None of a frame too short to have one."""
    if len(data) < 2:
        return None
    return data[0] | data[1] << 8


def unpack_heartbeat(data: bytes | bytearray) -> int | None:
    """The NMT state in a heartbeat; None of anything but one byte. Bit 7 is reserved and left out."""
    return data[0] & 0x7F if len(data) == 1 else None


def pack_sdo_read(index: int, sub: int) -> bytes:
    """The request of an SDO upload (CiA 301, "SDO upload")."""
    return struct.pack("<BHB4x", 0x40, index, sub)


def unpack_sdo_answer(data: bytes | bytearray) -> tuple[int, int | None] | None:
    """Index, and the value of an expedited SDO upload, None of a download that was done; None of any other frame."""
    if len(data) != 8 or (data[0] & 0xE3 != 0x43 and data[0] != 0x60):
        return None
    value = None if data[0] == 0x60 else int.from_bytes(data[4 : 8 - (data[0] >> 2 & 3)], "little")
    return int.from_bytes(data[1:3], "little"), value


def pack_sdo_write(index: int, sub: int, value: int, size: int) -> bytes:
    """An expedited SDO download of `size` bytes, 1 to 4 (CiA 301, "SDO download")."""
    return struct.pack("<BHB4s", 0x23 | (4 - size) << 2, index, sub, (value & 0xFFFF_FFFF).to_bytes(4, "little"))
