"""What the errors of an ODrive board mean, and which of several is told: each flag is a code of its own.

Source: ODrive Robotics, the API's `ODrive.Error` of firmware 0.6, and the DBC file odrive-cansimple-0.6.10.
"""

from collections.abc import Mapping

from bowden.hardware.drives.findings import FINDINGS

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
    names = [ERRORS[flag][0] if flag in ERRORS else f"0x{flag:X}" for flag in _flags(flags)]
    return ", ".join(names) or "none"


def _flags(flags: int) -> list[int]:
    return [1 << bit for bit in range(32) if flags >> bit & 1]


def fault_text(code: int) -> str:
    """The text of a code.

    >>> fault_text(10)
    'DC_BUS_UNDER_VOLTAGE (0x200): under-voltage of the supply: an emergency stop that cuts it shows so'
    """
    if code in _OURS:
        return f"0x{code:04X}: {_OURS[code]}"
    if code in FINDINGS:
        return f"0x{code:04X}: {FINDINGS[code]}"
    flag = 1 << code - 1 if 0 < code <= 32 else 0
    name, meaning = ERRORS.get(flag, (f"error {code}", "which is not known here: see its maker's documentation"))
    return f"{name} (0x{flag:X}): {meaning}"
