"""The power state machine of CiA 402: states, statusword, controlword, and which word leads where. Pure.

Sources: CiA 402-2 / IEC 61800-7-201, "Drive control": state machine, statusword 6041h, controlword 6040h, supported
drive modes 6502h.
"""

from enum import IntEnum

from bowden.hardware.ports import Power


class State(IntEnum):
    """The states of the power drive system; the number goes into `core.signals.DriveReading.drive_state`."""

    NOT_READY_TO_SWITCH_ON = 0
    """Starting up; also what is said here of a drive that is not operational on the bus or gives no valid word."""
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    """Power stage on, no torque."""
    OPERATION_ENABLED = 4
    """The motor follows the target."""
    QUICK_STOP_ACTIVE = 5
    """Slowing down, or standing with torque."""
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7


class OperationMode(IntEnum):
    """Modes of operation, 6060h."""

    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6
    CYCLIC_SYNCHRONOUS_POSITION = 8
    CYCLIC_SYNCHRONOUS_VELOCITY = 9
    CYCLIC_SYNCHRONOUS_TORQUE = 10


STATUS: dict[State, tuple[int, int]] = {
    State.NOT_READY_TO_SWITCH_ON: (0x4F, 0x00),
    State.SWITCH_ON_DISABLED: (0x4F, 0x40),
    State.READY_TO_SWITCH_ON: (0x6F, 0x21),
    State.SWITCHED_ON: (0x6F, 0x23),
    State.OPERATION_ENABLED: (0x6F, 0x27),
    State.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    State.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    State.FAULT: (0x4F, 0x08),
}
"""State → mask and value of the statusword (CiA 402-2, table "state coding")."""

WITH_TORQUE = frozenset({State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE})
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


CONTROL: dict[tuple[State, Power], Controlword] = {
    (state, power): Controlword.DISABLE_VOLTAGE for state in State for power in Power
} | {
    (State.SWITCH_ON_DISABLED, Power.READY): Controlword.SHUTDOWN,
    (State.SWITCH_ON_DISABLED, Power.ON): Controlword.SHUTDOWN,
    (State.READY_TO_SWITCH_ON, Power.READY): Controlword.SWITCH_ON,
    (State.READY_TO_SWITCH_ON, Power.ON): Controlword.SWITCH_ON,
    (State.SWITCHED_ON, Power.READY): Controlword.SWITCH_ON,
    (State.SWITCHED_ON, Power.ON): Controlword.ENABLE_OPERATION,
    (State.OPERATION_ENABLED, Power.QUICK_STOP): Controlword.QUICK_STOP,
    (State.OPERATION_ENABLED, Power.READY): Controlword.SWITCH_ON,
    (State.OPERATION_ENABLED, Power.ON): Controlword.ENABLE_OPERATION,
    (State.QUICK_STOP_ACTIVE, Power.QUICK_STOP): Controlword.QUICK_STOP,
}
"""State × wanted power → the controlword of this cycle; one step a cycle, and never out of a fault.

A quick stop that has begun is let go to its end while it is wanted; any other wish takes the torque off.
"""


def decode(statusword: int) -> State:
    """The state that a statusword tells; what fits no state counts as not ready.

    >>> decode(0x1637).name, decode(0x0250).name, decode(0x0008).name
    ('OPERATION_ENABLED', 'SWITCH_ON_DISABLED', 'FAULT')
    """
    for state, (mask, value) in STATUS.items():
        if statusword & mask == value:
            return state
    return State.NOT_READY_TO_SWITCH_ON


def encode(state: State) -> int:
    """A statusword of that state, as a drive would send it with the voltage on (bit 4) and remote (bit 9)."""
    return STATUS[state][1] | 0x0210


def controlword(state: State, power: Power, reset: bool = False) -> int:
    """The controlword for this cycle.

    Args:
        state: what the drive said last.
        power: what is wanted of it.
        reset: whether an operator has asked for a fault reset; it works in `State.FAULT` alone.
    """
    if reset and state is State.FAULT:
        return Controlword.FAULT_RESET
    return CONTROL[state, power]


def fell(before: State, now: State, sent: int, already: bool, power: Power) -> bool:
    """Whether the drive has left operation enabled by itself and must not be switched on again as if nothing was.

    A drive whose master was silent for a moment may be in switch on disabled when the master is back; climbing again
    would be a restart that nobody ordered. It is forgotten when the master itself has wanted the power off.

    Args:
        before: the state of the cycle before.
        now: the state of this cycle.
        sent: the controlword sent in the cycle before.
        already: the value of the cycle before.
        power: what is wanted now.
    """
    if power is Power.OFF:
        return False
    left = before is State.OPERATION_ENABLED and now is not State.OPERATION_ENABLED
    return already or (left and sent == Controlword.ENABLE_OPERATION)


def step(state: State, control: int, edge: bool, fault_gone: bool = True) -> State:
    """The drive's side: the state after a controlword, transitions 2 to 12 and 15 of the state machine.

    Args:
        state: where the drive is.
        control: the controlword.
        edge: whether bit 7 has risen with it.
        fault_gone: whether the cause of a fault is gone.
    """
    if state is State.FAULT:
        return State.SWITCH_ON_DISABLED if edge and fault_gone else state
    if state in (State.NOT_READY_TO_SWITCH_ON, State.FAULT_REACTION_ACTIVE):
        return state
    low = control & 0x0F
    if not low & 0x02:  # disable voltage
        return State.SWITCH_ON_DISABLED
    if not low & 0x04:  # quick stop
        enabled = state in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
        return State.QUICK_STOP_ACTIVE if enabled else State.SWITCH_ON_DISABLED
    if state is State.QUICK_STOP_ACTIVE:
        return state  # transition 16, back to operation enabled, is optional; this drive has none
    if state is State.SWITCH_ON_DISABLED:
        return State.READY_TO_SWITCH_ON if low & 0x07 == 0x06 else state
    if low & 0x07 == 0x06:  # shutdown
        return State.READY_TO_SWITCH_ON
    if state is State.READY_TO_SWITCH_ON:
        return State.SWITCHED_ON
    return State.OPERATION_ENABLED if low == 0x0F else State.SWITCHED_ON


def supports(drive_modes: int, mode: OperationMode) -> bool:
    """Whether 6502h, supported drive modes, has the bit of a mode (bit mode − 1).

    >>> [supports(modes, OperationMode.CYCLIC_SYNCHRONOUS_POSITION) for modes in (0x3A5, 0x25)]
    [True, False]
    """
    return bool(drive_modes >> (mode - 1) & 1)
