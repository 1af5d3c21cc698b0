"""Faults that a simulated drive, sensor, loop or law can be given while it runs."""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel
from bowden.core.signals import DriveReading


class Injected(IntEnum):
    """What goes wrong from a given cycle on."""

    NOTHING = 0
    JOINT_NAN = 1
    JOINT_RANGE = 2
    JOINT_FROZEN = 3
    JOINT_SPIKE = 4
    """One cycle."""
    JOINT_SPIKES = 5
    """Every third cycle."""
    JOINT_DROPOUT = 6
    """The last angle, ever older."""
    JOINT_DELAY = 7
    """0.4 s late, and nothing says so."""
    JOINT_SIGN = 8
    MOTOR_NAN = 9
    MOTOR_RANGE = 10
    MOTOR_FROZEN = 11
    MOTOR_SPIKE = 12
    MOTOR_SPIKES = 13
    MOTOR_DROPOUT = 14
    MOTOR_DELAY = 15
    MOTOR_SIGN = 16
    SLACK = 17
    """The cable has no tension, and the joint stays where it is for 0.8 rad of the motor."""
    BROKEN_CABLE = 18
    JOINT_OVER_TRAVEL = 19
    """The limb is pushed on at 4 rad/s."""
    MOTOR_OVER_TRAVEL = 20
    """The motor's zero slips away at 2 rad/s."""
    OVER_SPEED = 21
    """The drive runs at 25 rad/s whatever it is told."""
    OVER_TENSION = 22
    JAM = 23
    """The motor stands, the current is at its peak: laws wind up."""
    PEAK_CURRENT = 24
    LONG_CURRENT = 25
    """Just below saturation: only I²t and the thermal model see it."""
    DRIVE_HOT = 26
    CURRENT_NAN = 27
    TENSION_NAN = 28
    DRIVE_SILENT = 29
    """Nothing comes from the drive."""
    HEARTBEAT_SILENT = 30
    HOST_SILENT = 31
    """Nothing reaches the drive: it holds, and its heartbeat consumer stops it after 50 ms."""
    BUS_OFF = 32
    LATE_PDOS = 33
    """Each angle up to five cycles old."""
    EMERGENCY = 34
    DRIVE_FAULT = 35
    DRIVE_REBOOT = 36
    DRIVE_DROPPED = 37
    OVERRUN = 38
    """One cycle, 22 ms late: the drive still waits for our heartbeat."""
    OVERRUNS = 39
    """Every cycle 3 ms late."""
    CLOCK_BACK = 40
    CLOCK_FORWARD = 41
    LAW_NAN = 42
    LAW_STEP = 43
    LAW_BEYOND = 44
    LAW_RAMP = 45
    """Away at 60 rad/s."""
    LAW_SHAKES = 46
    """± 0.07 rad each cycle, then ever more."""
    OPERATOR_LOST = 47
    RECORDER_LOST = 48
    STOP = 49
    EMG_SILENT = 50
    """No sample comes any more."""
    EMG_TIMELESS = 51
    """Samples whose time is not known."""


class Around(NamedTuple):
    """What one cycle observes besides the drive's reading: the fields of `Observed` after it, in their order."""

    lateness: float
    elapsed: float
    request: float
    operator_age: float
    recorder: float
    preflight: float
    emg_age: float


@kernel
def misread(
    kind: int, since: int, reading: DriveReading, joints: NDArray[np.float64], motors: NDArray[np.float64], k: int
) -> Any:
    """The reading of cycle k with a fault that began `since` cycles ago; `joints`, `motors`: the true readings."""
    joint, motor, current, tension = reading.joint, reading.motor, reading.current, reading.tension
    temperature, motor_age, joint_age = reading.temperature, reading.motor_age, reading.joint_age
    heartbeat_age, drive_state, emergency = reading.heartbeat_age, reading.drive_state, reading.emergency
    bus_errors = reading.bus_errors
    begun, late = k - since, max(k - 400, 0)
    sign = -1.0 if k % 2 else 1.0
    if kind == 1:
        joint = np.nan
    elif kind == 2:
        joint = 20.0
    elif kind == 3:
        joint = joints[begun]
    elif kind == 4:
        joint += 0.5 if since == 0 else 0.0
    elif kind == 5:
        joint += 0.5 * sign if since % 3 == 0 else 0.0
    elif kind == 6 or kind == 29 or kind == 32:
        joint, joint_age = joints[begun], since + 1.0
    elif kind == 7:
        joint = joints[late]
    elif kind == 8:
        joint = -joint
    elif kind == 9:
        motor = np.nan
    elif kind == 10:
        motor = -20.0
    elif kind == 11:
        motor = motors[begun]
    elif kind == 12:
        motor += 0.5 if since == 0 else 0.0
    elif kind == 13:
        motor += 0.5 * sign if since % 3 == 0 else 0.0
    elif kind == 15:
        motor = motors[late]
    elif kind == 16:
        motor = -motor
    elif kind == 22:
        tension += 0.5 * since
    elif kind == 24:
        current = 30.0 * sign
    elif kind == 25:
        current = 18.0
    elif kind == 26:
        temperature += 0.5 * since
    elif kind == 27:
        current = np.nan
    elif kind == 28:
        tension = np.nan
    elif kind == 33:
        joint_age = motor_age = k % 6
        joint, motor = joints[k - k % 6], motors[k - k % 6]
    elif kind == 34:
        emergency = 0x5530 if since == 0 else 0.0
    elif kind == 35:
        drive_state = 7.0
    elif kind == 36:
        drive_state = 0.0 if since < 50 else 1.0
    elif kind == 37:
        drive_state = 3.0
    if kind == 14 or kind == 29 or kind == 32:
        motor, motor_age = motors[begun], since + 1.0
    if kind == 29 or kind == 30 or kind == 32:
        heartbeat_age = 0.01 + 0.001 * since
    if kind == 31 and since > 50:
        drive_state = 7.0
    if kind == 32:
        bus_errors += since + 1.0
    return DriveReading(
        motor,
        joint,
        current,
        tension,
        temperature,
        motor_age,
        joint_age,
        heartbeat_age,
        drive_state,
        emergency,
        bus_errors,
    )


@kernel
def disturbed(kind: int, since: int, around: Around, dt: float) -> Around:
    """Loop, operator, recorder and EMG with a fault."""
    lateness, elapsed, request, age, recorder, preflight, emg_age = around
    if kind == 40 and since == 0:
        elapsed = -3600.0
    elif kind == 41 and since == 0:
        elapsed = 3600.0
    elif kind == 47:
        age += since * dt
    elif kind == 48:
        recorder = 0.0
    elif kind == 49 and since == 0:
        request = 3.0
    elif kind == 50:
        emg_age += since * dt
    elif kind == 51:
        emg_age = np.nan
    return Around(lateness, elapsed, request, age, recorder, preflight, emg_age)


@kernel
def asleep(kind: int, since: int) -> int:
    """Cycles that the loop misses after this one."""
    if kind == 38 and since == 0:
        return 22
    return 3 if kind == 39 else 0


@kernel
def misled(kind: int, since: int, wish: float, dt: float) -> float:
    """The law's wish with a fault."""
    if kind == 42:
        return np.nan
    if kind == 43:
        return wish + 0.6
    if kind == 44:
        return 3.0 + wish
    if kind == 45:
        return wish + 60.0 * dt * since
    if kind == 46:
        return wish + (0.07 + 0.002 * since) * (1.0 if since % 2 else -1.0)
    return wish
