"""The power state machine of CiA 402: states, statusword, controlword, and which word leads where. Pure.

Sources: CiA 402-2 / IEC 61800-7-201, "Drive control": state machine, statusword 6041h, controlword 6040h, supported
drive modes 6502h.
"""

from enum import IntEnum

from bowden.core.signals import DriveState
from bowden.hardware.ports import Power

CYCLIC_SYNCHRONOUS_POSITION = 8
"""Mode of operation, 6060h."""

STATUS: dict[DriveState, tuple[int, int]] = {
    DriveState.NOT_READY_TO_SWITCH_ON: (0x4F, 0x00),
    DriveState.SWITCH_ON_DISABLED: (0x4F, 0x40),
    DriveState.READY_TO_SWITCH_ON: (0x6F, 0x21),
    DriveState.SWITCHED_ON: (0x6F, 0x23),
    DriveState.OPERATION_ENABLED: (0x6F, 0x27),
    DriveState.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    DriveState.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    DriveState.FAULT: (0x4F, 0x08),
}
"""DriveState → mask and value of the statusword (CiA 402-2, table "state coding")."""

WITH_TORQUE = frozenset({DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE})
"""States in which the motor may have torque."""


class Controlword(IntEnum):
    """Controlwords of the device control commands (CiA 402-2, table "command coding")."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    """Also "disable operation", from operation enabled."""
    ENABLE_OPERATION = 0x000F
    FAULT_RESET = 0x0080
    """Works on its rising edge."""


CONTROL: dict[tuple[DriveState, Power], Controlword] = {
    (state, power): Controlword.DISABLE_VOLTAGE for state in DriveState for power in Power
} | {
    (DriveState.SWITCH_ON_DISABLED, Power.READY): Controlword.SHUTDOWN,
    (DriveState.SWITCH_ON_DISABLED, Power.ON): Controlword.SHUTDOWN,
    (DriveState.READY_TO_SWITCH_ON, Power.READY): Controlword.SWITCH_ON,
    (DriveState.READY_TO_SWITCH_ON, Power.ON): Controlword.SWITCH_ON,
    (DriveState.SWITCHED_ON, Power.READY): Controlword.SWITCH_ON,
    (DriveState.SWITCHED_ON, Power.ON): Controlword.ENABLE_OPERATION,
    (DriveState.OPERATION_ENABLED, Power.QUICK_STOP): Controlword.QUICK_STOP,
    (DriveState.OPERATION_ENABLED, Power.READY): Controlword.SWITCH_ON,
    (DriveState.OPERATION_ENABLED, Power.ON): Controlword.ENABLE_OPERATION,
    (DriveState.QUICK_STOP_ACTIVE, Power.QUICK_STOP): Controlword.QUICK_STOP,
}
"""DriveState × wanted power → the controlword of this cycle; one step a cycle, and never out of a fault.

A quick stop that has begun is let go to its end while it is wanted; any other request takes the torque off.
"""


def decode(statusword: int) -> DriveState:
    """The state that a statusword has; what fits no state counts as not ready.

    >>> decode(0x1637).name, decode(0x0250).name, decode(0x0008).name
    ('OPERATION_ENABLED', 'SWITCH_ON_DISABLED', 'FAULT')
    """
    return _DECODED[statusword & _STATE_BITS]


_STATE_BITS = 0x6F
"""Those of a statusword that any state asks for."""
_DECODED = tuple(
    next((state for state, (mask, value) in STATUS.items() if bits & mask == value), DriveState.NOT_READY_TO_SWITCH_ON)
    for bits in range(_STATE_BITS + 1)
)
"""These bits → state."""


def encode(state: DriveState) -> int:
    """A statusword of that state, as a drive would send it with the voltage on (bit 4) and remote (bit 9)."""
    return STATUS[state][1] | 0x0210


def controlword(state: DriveState, power: Power, reset: bool = False) -> int:
    """The controlword for this cycle.

    Args:
        state: what the drive said last.
        power: what is wanted of it.
        reset: whether an operator has asked for a fault reset; it works in `DriveState.FAULT` alone.
    """
    if reset and state is DriveState.FAULT:
        return Controlword.FAULT_RESET
    return CONTROL[state, power]


def step(state: DriveState, control: int, edge: bool, fault_gone: bool = True) -> DriveState:
    """The drive's side: the state after a controlword, transitions 2 to 12 and 15 of the state machine.

    Args:
        state: where the drive is.
        control: the controlword.
        edge: whether bit 7 has risen with it.
        fault_gone: whether the cause of a fault is gone.
    """
    if state is DriveState.FAULT:
        return DriveState.SWITCH_ON_DISABLED if edge and fault_gone else state
    if state in (DriveState.NOT_READY_TO_SWITCH_ON, DriveState.FAULT_REACTION_ACTIVE):
        return state
    low = control & 0x0F
    if not low & 0x02:  # disable voltage
        return DriveState.SWITCH_ON_DISABLED
    if not low & 0x04:  # quick stop
        enabled = state in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
        return DriveState.QUICK_STOP_ACTIVE if enabled else DriveState.SWITCH_ON_DISABLED
    if state is DriveState.QUICK_STOP_ACTIVE:
        return state  # transition 16, back to operation enabled, is optional; this drive has none
    if state is DriveState.SWITCH_ON_DISABLED:
        return DriveState.READY_TO_SWITCH_ON if low & 0x07 == 0x06 else state
    if low & 0x07 == 0x06:  # shutdown
        return DriveState.READY_TO_SWITCH_ON
    if state is DriveState.READY_TO_SWITCH_ON:
        return DriveState.SWITCHED_ON
    return DriveState.OPERATION_ENABLED if low == 0x0F else DriveState.SWITCHED_ON
