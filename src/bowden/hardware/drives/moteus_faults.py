"""What the fault codes of a moteus board mean, register 00Fh.

Source: mjbots/moteus, docs/protocol/registers.md, "0x00f - Fault code", and docs/troubleshooting; the errors
of position and velocity by their names in fw/error.h and docs/reference/configuration.md.
"""

from collections.abc import Mapping

from bowden.hardware.drives.findings import FINDINGS

TIMED_OUT = 0xFE11
"""Code of the driver's own."""
FIRST_LIMIT = 96
"""From here on a code says what limits the output, and is no fault."""

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
"""Code → what it means."""

_OURS: Mapping[int, str] = {
    TIMED_OUT: "the board's watchdog ran out and it took its torque off (mode 11): commands came too late or were "
    "lost; check the bus and the load of this computer",
}


def fault_text(code: int) -> str:
    """The text of a code, with the code.

    >>> fault_text(40)
    '40: under-voltage of the supply: an emergency stop that cuts it shows so'
    """
    if code in _OURS:
        return f"0x{code:04X}: {_OURS[code]}"
    if code in FINDINGS:
        return f"0x{code:04X}: {FINDINGS[code]}"
    return f"{code}: {FAULTS.get(code, 'a fault that is not known here: see its maker’s register reference')}"
