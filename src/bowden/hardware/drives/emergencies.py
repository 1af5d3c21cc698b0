"""What the error code of an emergency frame means.

Sources: CiA 301, "emergency object", table of error code classes; CiA 402-1 / IEC 61800-7-201, annex of error codes
603Fh; maxon EPOS4 Firmware Specification, chapter "Error handling", for codes whose text is maxon's.
"""

from bowden.core.signals import EMERGENCY_STOP
from bowden.hardware.drives.findings import FINDINGS

SAFE_TORQUE_OFF = 0x8A88
"""maxon: the drive's STO inputs are open."""
HEARTBEAT_LOST = 0x8130
"""CiA 301: life guard or heartbeat error; the drive misses our heartbeat."""

_CLASSES = {
    0x00: "error reset or no error",
    0x10: "generic error",
    0x20: "current",
    0x21: "current on the device's input side",
    0x22: "current inside the device",
    0x23: "current on the device's output side",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage inside the device",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "device temperature",
    0x43: "motor temperature",
    0x44: "supply temperature",
    0x50: "device hardware",
    0x51: "supply of the device's logic",
    0x52: "device control hardware",
    0x53: "operating unit",
    0x54: "power section",
    0x55: "data storage",
    0x60: "device software",
    0x61: "internal software",
    0x62: "user software",
    0x63: "data set or parameter",
    0x70: "additional modules",
    0x71: "power module",
    0x72: "measuring circuit",
    0x73: "sensor",
    0x74: "computation circuit",
    0x75: "communication module",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol",
    0x83: "torque control",
    0x84: "velocity control",
    0x85: "position control",
    0x86: "positioning controller",
    0x87: "SYNC controller",
    0x88: "winding controller",
    0x89: "process data monitoring",
    0x8A: "control monitoring",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "device-specific error",
}
"""High byte of the code → class."""

_CODES = {
    0x0000: "error reset: no error any more",
    0x1080: "generic initialization error",
    0x1090: "firmware incompatibility",
    0x2310: "overcurrent",
    0x2320: "power stage protection: short circuit or a damaged power stage",
    0x3210: "overvoltage of the supply",
    0x3220: "undervoltage of the supply",
    0x4210: "over-temperature of the power stage",
    0x4310: "over-temperature of the motor",
    0x4380: "thermal overload of the motor (I²t)",
    0x5113: "logic supply voltage too low",
    0x5280: "hardware defect",
    0x5281: "hardware incompatibility",
    0x5441: "contactor or enable input",
    0x6080: "sign of life error",
    0x6081: "extension watchdog error",
    0x6320: "parameter out of its range",
    0x6380: "stored parameters corrupt",
    0x7320: "position sensor error",
    0x7380: "position sensor breach: cable or connector of the encoder",
    0x7381: "position sensor resolution",
    0x7382: "position sensor index",
    0x7388: "Hall sensor error",
    0x7389: "Hall sensor not found",
    0x738A: "Hall angle detection",
    0x738C: "SSI sensor error",
    0x7390: "main sensor missing",
    0x7391: "commutation sensor missing",
    0x7392: "main sensor counts the wrong way",
    0x8110: "CAN overrun: frames lost",
    0x8111: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "heartbeat of the host lost",
    0x8140: "recovered from bus-off",
    0x8150: "PDO identifier in use by another node",
    0x81FD: "CAN bus-off",
    0x81FE: "CAN receive queue overflow",
    0x81FF: "CAN transmit queue overflow",
    0x8210: "PDO not processed: wrong length",
    0x8220: "PDO too long",
    0x8250: "process data (RPDO) too late",
    0x8611: "following error: the motor lags behind its target",
    0x8612: "reference limit",
    0x8A80: "negative limit switch",
    0x8A81: "positive limit switch",
    0x8A82: "software position limit",
    SAFE_TORQUE_OFF: "safe torque off",
    0xFF01: "drive overloaded: its cycle took too long",
    0xFF02: "watchdog of the drive",
    0xFF0B: "drive overloaded for a moment",
    0xFF10: "controller gain out of its range",
}


def emergency_text(code: int) -> str:
    """The text of an emergency's error code, with the code; of an unknown one the class that it belongs to.

    >>> emergency_text(0x8130), emergency_text(0x2312)
    ('0x8130: heartbeat of the host lost', "0x2312: current on the device's output side")
    """
    if code == EMERGENCY_STOP:
        return f"emergency stop pressed, or 0x{SAFE_TORQUE_OFF:X}: {_CODES[SAFE_TORQUE_OFF]}"
    code &= 0xFFFF
    high = code >> 8
    if code in FINDINGS:
        return f"0x{code:04X}: {FINDINGS[code]}"
    text = _CODES.get(code) or _CLASSES.get(high) or _CLASSES.get(high & 0xF0) or "unknown error code"
    return f"0x{code:04X}: {text}"
