"""CANSimple, the protocol of ODrive boards on classic CAN: identifiers, commands and their fields by hand. Pure.

An identifier has the board's number in bits 5 to 10 and the command in bits 0 to 4. Numbers are little-endian,
positions are turns. What a board tells is asked for with a remote frame of the same identifier.

    0x00 Get_Version      protocol, hardware line, version, variant, firmware major, minor, revision, unreleased: u8
    0x01 Heartbeat        errors u32, axis state u8, result of the last procedure u8, trajectory done u8
    0x02 Estop            nothing
    0x03 Get_Error        active errors u32, reason of the last disarming u32
    0x04 RxSdo            operation u8 (0 read, 1 write), endpoint u16, 0, value
    0x05 TxSdo            0, endpoint u16, 0, value
    0x07 Set_Axis_State   u32
    0x09 Get_Encoder_Estimates  position f32 [turns], velocity f32 [turns/s]
    0x0B Set_Controller_Mode    control mode u32, input mode u32
    0x0C Set_Input_Pos    position f32 [turns], velocity i16, torque i16, each by a scale of the board's configuration
    0x0F Set_Limits       velocity f32 [turns/s], current f32 [A]
    0x14 Get_Iq           wanted f32 [A], measured f32 [A]
    0x15 Get_Temperature  of the transistors f32, of the motor f32 [°C]
    0x17 Get_Bus_Voltage_Current  f32 [V], f32 [A]
    0x18 Clear_Errors     identify u8

Source: ODrive Robotics, "CAN Protocol" of the documentation for firmware 0.6, and the DBC file
odrive-cansimple-0.6.10 that is made from it.
"""

import math
import struct
from enum import IntEnum
from typing import NamedTuple

PROTOCOL = 2
"""Protocol_Version that every board with Get_Version reports."""
BROADCAST = 0x3F
"""Number that every board hears; of a board that has none yet."""
HIGHEST_ID = 0x7FF
"""Of a standard frame."""
INT16 = 32767
"""Largest value of the feed-forward fields."""
MOST_TURNS = 1024.0
"""Either way: beyond, the steps of a position as f32 are longer than 0.02° of the motor [turns]."""


class Cmd(IntEnum):
    """Command of a frame."""

    GET_VERSION = 0x00
    HEARTBEAT = 0x01
    ESTOP = 0x02
    GET_ERROR = 0x03
    RX_SDO = 0x04
    TX_SDO = 0x05
    ADDRESS = 0x06
    SET_AXIS_STATE = 0x07
    GET_ENCODER_ESTIMATES = 0x09
    SET_CONTROLLER_MODE = 0x0B
    SET_INPUT_POS = 0x0C
    SET_INPUT_VEL = 0x0D
    SET_INPUT_TORQUE = 0x0E
    SET_LIMITS = 0x0F
    SET_TRAJ_VEL_LIMIT = 0x11
    SET_TRAJ_ACCEL_LIMITS = 0x12
    SET_TRAJ_INERTIA = 0x13
    GET_IQ = 0x14
    GET_TEMPERATURE = 0x15
    REBOOT = 0x16
    GET_BUS_VOLTAGE_CURRENT = 0x17
    CLEAR_ERRORS = 0x18
    SET_ABSOLUTE_POSITION = 0x19
    SET_POS_GAIN = 0x1A
    SET_VEL_GAINS = 0x1B
    GET_TORQUES = 0x1C
    GET_POWERS = 0x1D
    ENTER_DFU_MODE = 0x1F


TOLD = frozenset(
    (
        *(Cmd.GET_VERSION, Cmd.HEARTBEAT, Cmd.GET_ERROR, Cmd.TX_SDO, Cmd.GET_ENCODER_ESTIMATES, Cmd.GET_IQ),
        *(Cmd.GET_TEMPERATURE, Cmd.GET_BUS_VOLTAGE_CURRENT, Cmd.GET_TORQUES, Cmd.GET_POWERS),
    )
)
"""What a board sends, and nobody else does but with a remote frame or without data; ADDRESS goes both ways."""


class AxisState(IntEnum):
    """What an axis does."""

    UNDEFINED = 0
    IDLE = 1
    STARTUP_SEQUENCE = 2
    FULL_CALIBRATION_SEQUENCE = 3
    MOTOR_CALIBRATION = 4
    ENCODER_INDEX_SEARCH = 6
    ENCODER_OFFSET_CALIBRATION = 7
    CLOSED_LOOP_CONTROL = 8
    LOCKIN_SPIN = 9
    ENCODER_DIR_FIND = 10
    HOMING = 11
    ENCODER_HALL_POLARITY_CALIBRATION = 12
    ENCODER_HALL_PHASE_CALIBRATION = 13
    ANTICOGGING_CALIBRATION = 14


POSITION_CONTROL, PASSTHROUGH = 3, 1
"""Control mode, and input mode: the position is taken as it comes, without a filter or a trajectory."""


def identifier_of(node: int, cmd: Cmd) -> int:
    """Identifier of a command to or from a board.

    >>> hex(identifier_of(1, Cmd.SET_INPUT_POS))
    '0x2c'
    """
    return node << 5 | cmd


class BoardVersion(NamedTuple):
    """Who a board is."""

    protocol: int
    hardware: tuple[int, int, int]
    """Product line, version, variant."""
    firmware: tuple[int, int, int]
    unreleased: bool


class Beat(NamedTuple):
    """A heartbeat."""

    errors: int
    """Those that are active, and those that disarmed it last; flags."""
    state: int
    """An `AxisState`, or a number that is none."""


class BoardErrors(NamedTuple):
    """Errors as flags."""

    active: int
    disarmed: int
    """Why it disarmed last."""


class Target(NamedTuple):
    """What Set_Input_Pos carries."""

    position: float
    """[turns]"""
    velocity: float
    """[turns/s]"""
    torque: float
    """[N·m]"""


class Scales(NamedTuple):
    """Steps of the feed-forward fields in one unit, input_vel_scale and input_torque_scale of a board."""

    velocity: float
    """In 1 turn/s."""
    torque: float
    """In 1 N·m."""


def pack_state(state: int) -> bytes:
    """Set_Axis_State."""
    return struct.pack("<II", state, 0)


def unpack_state(data: bytes) -> int | None:
    """Set_Axis_State."""
    return int.from_bytes(data[:4], "little") if len(data) >= 4 else None


def pack_modes(control: int, input_mode: int) -> bytes:
    """Set_Controller_Mode."""
    return struct.pack("<II", control, input_mode)


def pack_target(target: Target, scales: Scales) -> bytes:
    """Set_Input_Pos; a feed-forward beyond its field's range stands at its end, and one that is no number is none."""
    return struct.pack(
        "<fhh",
        target.position,
        _steps(target.velocity, scales.velocity),
        _steps(target.torque, scales.torque),
    )


def _steps(value: float, scale: float) -> int:
    return round(max(-float(INT16), min(float(INT16), value * scale))) if math.isfinite(value) else 0


def unpack_target(data: bytes, scales: Scales) -> Target | None:
    """Set_Input_Pos."""
    if len(data) != 8:
        return None
    position, velocity, torque = struct.unpack("<fhh", data)
    return Target(position, velocity / scales.velocity, torque / scales.torque)


def pack_floats(first: float, second: float) -> bytes:
    """The commands that have two numbers: limits, estimates, currents, temperatures, voltage."""
    return struct.pack("<ff", first, second)


def unpack_floats(data: bytes) -> tuple[float, float] | None:
    """See `pack_floats`."""
    if len(data) != 8:
        return None
    first, second = struct.unpack("<ff", data)
    return first, second


def pack_version(version: BoardVersion) -> bytes:
    """Get_Version."""
    return bytes((version.protocol, *version.hardware, *version.firmware, version.unreleased))


def unpack_version(data: bytes) -> BoardVersion | None:
    """Get_Version."""
    if len(data) != 8:
        return None
    return BoardVersion(data[0], (data[1], data[2], data[3]), (data[4], data[5], data[6]), data[7] != 0)


def pack_beat(beat: Beat) -> bytes:
    """Heartbeat."""
    return struct.pack("<IBBBB", beat.errors, beat.state, 0, 0, 0)


def unpack_beat(data: bytes) -> Beat | None:
    """Heartbeat; seven bytes of it say something."""
    return Beat(*struct.unpack("<IB", data[:5])) if len(data) >= 7 else None


def pack_errors(errors: BoardErrors) -> bytes:
    """Get_Error."""
    return struct.pack("<II", *errors)


def unpack_errors(data: bytes) -> BoardErrors | None:
    """Get_Error."""
    return BoardErrors(*struct.unpack("<II", data)) if len(data) == 8 else None


READ, WRITE = 0, 1
"""Operations of RxSdo."""


def pack_question(endpoint: int) -> bytes:
    """RxSdo that reads an endpoint."""
    return struct.pack("<BHB", READ, endpoint, 0)


def unpack_question(data: bytes) -> tuple[int, int, bytes] | None:
    """RxSdo: operation, endpoint, value."""
    if len(data) < 4:
        return None
    operation, endpoint, _ = struct.unpack("<BHB", data[:4])
    return operation, endpoint, data[4:]


def pack_answer(endpoint: int, value: bytes) -> bytes:
    """TxSdo."""
    return struct.pack("<BHB", 0, endpoint, 0) + value


def unpack_answer(data: bytes) -> tuple[int, bytes] | None:
    """TxSdo: endpoint, value."""
    if len(data) < 4:
        return None
    _, endpoint, _ = struct.unpack("<BHB", data[:4])
    return endpoint, data[4:]
