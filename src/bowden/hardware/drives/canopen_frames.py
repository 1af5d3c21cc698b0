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


class Pdo(NamedTuple):
    """Objects that go together in one frame, of which some devices have the first ones alone."""

    mapping: tuple[int, ...]
    """Index, sub-index and length in bits of each, as 1600h and 1A00h to 1A02h want it."""
    form: str
    """How `struct` has each."""

    def pack(self, *values: int) -> bytes:
        """All of them, or the first ones, as bytes."""
        return struct.pack("<" + self.form[: len(values)], *values)

    def unpack(self, data: bytes | bytearray, count: int | None = None) -> tuple[int, ...] | None:
        """All of them, or the first so many; None of any other number of bytes."""
        form = "<" + self.form[:count]
        return struct.unpack(form, data) if len(data) == struct.calcsize(form) else None


ORDER = Pdo((0x6040_0010, 0x607A_0020, 0x60B2_0010), "Hih")
"""RPDO 1: controlword, target position [counts], torque offset [‰], where one is sent."""
MOTION = Pdo((0x6041_0010, 0x6064_0020, 0x6077_0010), "Hih")
"""TPDO 1: statusword, position [counts], torque [‰ of the rated torque]."""
SENSORS = Pdo((0x60E4_0220, 0x3160_0110, 0x3201_0110), "ihh")
"""TPDO 2: position of the joint [counts], analog input [mV], temperature [0.1 °C], where the drive can map it."""
INPUTS = Pdo((0x60FD_0020,), "I")
"""TPDO 3: digital inputs."""
_EMERGENCY = struct.Struct("<HB")


def of_the_host(node: int, host: int) -> frozenset[int]:
    """COB-IDs of what nobody but this host may send while it has a drive: NMT, SYNC, the drive's RPDOs, questions to
    its SDO server (CiA 301 has one client of it), and the host's own heartbeat.
    """
    rpdos = (RPDO1 + 0x100 * i + node for i in range(4))
    return frozenset((NMT, SYNC, *rpdos, SDO_REQUEST + node, HEARTBEAT + host))


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
