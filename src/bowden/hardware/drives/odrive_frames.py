"""CANSimple, the protocol of ODrive boards on classic CAN: identifiers, commands, their fields, and errors. Pure.

An identifier has the board's number in bits 5 to 10 and the command in bits 0 to 4. Numbers are little-endian,
positions are turns. What a board tells is asked for with a remote frame of the same identifier.

Source: ODrive Robotics, "CAN Protocol" of the documentation for firmware 0.6, and the DBC file
odrive-cansimple-0.6.10 that is made from it; for the errors the API's `ODrive.Error`.
"""

import math
import struct
from collections.abc import Mapping
from enum import IntEnum
from typing import Any, NamedTuple

from bowden.hardware.drives.findings import finding_text

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
    """State of an axis."""

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


class Beat(NamedTuple):
    """A heartbeat."""

    errors: int
    """Those that are active, and those that disarmed it last; flags."""
    state: int
    """An `AxisState`, or a number that is none."""


class Target(NamedTuple):
    """Content of Set_Input_Pos."""

    position: float
    """[turns]"""
    velocity: float
    """[turns/s]"""
    torque: float
    """[N·m]"""


Scales = tuple[float, float]
"""Steps of the feed-forward fields in 1 turn/s and in 1 N·m, input_vel_scale and input_torque_scale of a board."""

_NUMBERS, _WHOLE = struct.Struct("<ff"), struct.Struct("<II")
FIELDS: Mapping[int, struct.Struct] = {
    Cmd.GET_VERSION: struct.Struct("<8B"),  # protocol; hardware line, version, variant; firmware's three; unreleased
    Cmd.HEARTBEAT: struct.Struct("<IB"),  # errors, axis state; and two bytes about procedure and trajectory
    Cmd.GET_ERROR: _WHOLE,  # active errors, reason of the last disarming
    Cmd.SET_AXIS_STATE: struct.Struct("<I"),
    Cmd.GET_ENCODER_ESTIMATES: _NUMBERS,  # position [turns], velocity [turns/s]
    Cmd.SET_CONTROLLER_MODE: _WHOLE,  # control mode, input mode
    Cmd.SET_INPUT_POS: struct.Struct("<fhh"),  # position [turns], velocity and torque by scales of the board
    Cmd.SET_LIMITS: _NUMBERS,  # velocity [turns/s], current [A]
    Cmd.GET_IQ: _NUMBERS,  # wanted, measured [A]
    Cmd.GET_TEMPERATURE: _NUMBERS,  # of the transistors, of the motor [°C]
    Cmd.GET_BUS_VOLTAGE_CURRENT: _NUMBERS,  # [V], [A]
}
"""Command → its fields. Estop has none, Clear_Errors a byte; RxSdo and TxSdo: `pack_sdo`."""
_LEAST: Mapping[int, int] = {Cmd.HEARTBEAT: 7}
"""Bytes without which a frame says nothing, where those of its fields are fewer."""


def pack(cmd: int, *fields: Any) -> bytes:
    """A command's data."""
    return FIELDS[cmd].pack(*fields).ljust(8, b"\0")


def unpack(cmd: int, data: bytes) -> tuple[Any, ...] | None:
    """The fields of a command; None of too few bytes."""
    form = FIELDS[cmd]
    return form.unpack_from(data) if len(data) >= _LEAST.get(cmd, form.size) else None


def unpack_beat(data: bytes) -> Beat | None:
    """Heartbeat."""
    fields = unpack(Cmd.HEARTBEAT, data)
    return None if fields is None else Beat(*fields)


def pack_target(target: Target, scales: Scales) -> bytes:
    """Set_Input_Pos; a feed-forward beyond its field's range stands at its end, and one that is no number is none."""
    steps = (_steps(value, scale) for value, scale in zip(target[1:], scales, strict=True))
    return FIELDS[Cmd.SET_INPUT_POS].pack(target.position, *steps)


def _steps(value: float, scale: float) -> int:
    return round(max(-float(INT16), min(float(INT16), value * scale))) if math.isfinite(value) else 0


def unpack_target(data: bytes, scales: Scales) -> Target | None:
    """Set_Input_Pos."""
    fields = unpack(Cmd.SET_INPUT_POS, data)
    return None if fields is None else Target(fields[0], fields[1] / scales[0], fields[2] / scales[1])


READ, WRITE = 0, 1
"""Operations of RxSdo."""


def pack_sdo(endpoint: int, value: bytes = b"", operation: int = READ) -> bytes:
    """RxSdo with its operation, or TxSdo, which has none: an endpoint, and its value where one is given."""
    return struct.pack("<BHB", operation, endpoint, 0) + value


def unpack_sdo(data: bytes) -> tuple[int, int, bytes] | None:
    """RxSdo or TxSdo: operation, endpoint, value."""
    return (data[0], data[1] | data[2] << 8, data[4:]) if len(data) >= 4 else None


WATCHDOG, ESTOP, INITIALIZING = 0x0100_0000, 0x0200_0000, 0x1
"""Flags: the watchdog has expired, an emergency stop came, the board has not begun yet."""

ERRORS: Mapping[int, tuple[str, str]] = {
    0x0000_0001: ("INITIALIZING", "the board is starting, or an encoder has not answered yet"),
    0x0000_0002: ("SYSTEM_LEVEL", "an error inside the firmware"),
    0x0000_0004: ("TIMING_ERROR", "a time inside the firmware was not kept"),
    0x0000_0008: ("MISSING_ESTIMATE", "no position or speed: check the encoder and its calibration"),
    0x0000_0010: ("BAD_CONFIG", "its configuration makes no sense, or the motor is not calibrated"),
    0x0000_0020: ("DRV_FAULT", "the gate driver: check the motor's phases, and the supply"),
    0x0000_0040: ("MISSING_INPUT", "no target: it came with another mode, or is no number"),
    0x0000_0100: ("DC_BUS_OVER_VOLTAGE", "the supply cannot take back what the motor brakes: check the brake resistor"),
    0x0000_0200: ("DC_BUS_UNDER_VOLTAGE", "under-voltage of the supply: an emergency stop that cuts it shows so"),
    0x0000_0400: ("DC_BUS_OVER_CURRENT", "more current from the supply than its limit"),
    0x0000_0800: (
        "DC_BUS_OVER_REGEN_CURRENT",
        "more current back than its limit: check the brake resistor",
    ),
    0x0000_1000: ("CURRENT_LIMIT_VIOLATION", "the motor drew more than its hard limit (current_hard_max)"),
    0x0000_2000: ("MOTOR_OVER_TEMP", "over-temperature of the motor"),
    0x0000_4000: ("INVERTER_OVER_TEMP", "over-temperature of the board"),
    0x0000_8000: (
        "VELOCITY_LIMIT_VIOLATION",
        "the motor was faster than its limit (vel_limit · vel_limit_tolerance)",
    ),
    0x0001_0000: ("POSITION_LIMIT_VIOLATION", "an end stop, or a limit of the position"),
    0x0100_0000: (
        "WATCHDOG_TIMER_EXPIRED",
        "the board's watchdog ran out and it took its torque off: commands came too late or were lost; check the bus "
        "and the load of this computer",
    ),
    0x0200_0000: ("ESTOP_REQUESTED", "an emergency stop: its Estop frame, or an end stop or input set up as one"),
    0x0400_0000: ("SPINOUT_DETECTED", "the motor turns otherwise than its current says: calibrate its encoder anew"),
    0x0800_0000: ("BRAKE_RESISTOR_DISARMED", "the brake resistor is off"),
    0x1000_0000: ("THERMISTOR_DISCONNECTED", "a temperature sensor is off"),
    0x4000_0000: ("CALIBRATION_ERROR", "a calibration has failed"),
}
"""Flag → its name, and what it means."""

UNTOLD = 0xFE21
"""Code of the driver's own: the board does not do what its settings, as bring-up left them, say."""
_OURS: Mapping[int, str] = {
    UNTOLD: "the board has not come to closed loop and reports no error: it refused to, see its procedure_result",
}


def code_of(flags: int) -> int:
    """The code of the first of some errors, the number of its flag counted from 1; 0 of none.

    Causes come first: the watchdog and the emergency stop stand behind errors of supply, motor and encoder.

    >>> code_of(0x0100_0200), code_of(0x0100_0000), code_of(0)
    (10, 25, 0)
    """
    return (flags & -flags).bit_length()


def errors_text(flags: int) -> str:
    """Names of errors; those that are not known by their number.

    >>> errors_text(0x0100_0200)
    'DC_BUS_UNDER_VOLTAGE, WATCHDOG_TIMER_EXPIRED'
    """
    each = (1 << bit for bit in range(32) if flags >> bit & 1)
    return ", ".join(ERRORS[flag][0] if flag in ERRORS else f"0x{flag:X}" for flag in each) or "none"


def fault_text(code: int) -> str:
    """The text of a code.

    >>> fault_text(10)
    'DC_BUS_UNDER_VOLTAGE (0x200): under-voltage of the supply: an emergency stop that cuts it shows so'
    """
    flag = 1 << code - 1 if 0 < code <= 32 else 0
    name, meaning = ERRORS.get(flag, (f"error {code}", "which is not known here: see its maker's documentation"))
    return finding_text(code, _OURS) or f"{name} (0x{flag:X}): {meaning}"
