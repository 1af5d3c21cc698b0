"""Faults that can be injected into a cycle while it runs: at the sensors, the bus, the drive, the clock, the law.

One table for all loops: the sensors of a simulation (`faulty`), the fault matrix, and the live loop on a
simulated drive. What breaks in drive, cable, clock and law is done by the loop of those two (`tests/support`).
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel, noinline, placeholder
from bowden.core.signals import DriveReading, DriveState, Sample

NOT_READY, DISABLED = float(DriveState.NOT_READY_TO_SWITCH_ON), float(DriveState.SWITCH_ON_DISABLED)
SWITCHED_ON, ENABLED, FAULT = (
    float(state) for state in (DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED, DriveState.FAULT)
)
"""Numbers of states, as a reading has them."""
CONSUMER = 50
"""Cycles without the host's heartbeat after which the drive stops by itself."""


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
    """The drive runs at 25 rad/s whatever it is sent."""
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


@kernel
def misread(
    kind: int, since: int, reading: DriveReading, joints: NDArray[np.float64], motors: NDArray[np.float64], k: int
) -> Any:
    """The reading of cycle k with a fault that began `since` cycles ago; `joints`, `motors`: the true readings."""
    joint, motor, current, tension = reading.joint, reading.motor, reading.current, reading.tension
    temperature, motor_age, joint_age = reading.temperature, reading.motor_age, reading.joint_age
    heartbeat_age, drive_state, emergency = reading.heartbeat_age, reading.drive_state, reading.emergency
    bus_errors, foreign = reading.bus_errors, reading.foreign
    begun, late = k - since, max(k - 400, 0)
    sign = -1.0 if k % 2 else 1.0
    if kind == Injected.JOINT_NAN:
        joint = np.nan
    elif kind == Injected.JOINT_RANGE:
        joint = 20.0
    elif kind == Injected.JOINT_FROZEN:
        joint = joints[begun]
    elif kind == Injected.JOINT_SPIKE:
        joint += 0.5 if since == 0 else 0.0
    elif kind == Injected.JOINT_SPIKES:
        joint += 0.5 * sign if since % 3 == 0 else 0.0
    elif kind == Injected.JOINT_DROPOUT or kind == Injected.DRIVE_SILENT or kind == Injected.BUS_OFF:
        joint, joint_age = joints[begun], since + 1.0
    elif kind == Injected.JOINT_DELAY:
        joint = joints[late]
    elif kind == Injected.JOINT_SIGN:
        joint = -joint
    elif kind == Injected.MOTOR_NAN:
        motor = np.nan
    elif kind == Injected.MOTOR_RANGE:
        motor = -20.0
    elif kind == Injected.MOTOR_FROZEN:
        motor = motors[begun]
    elif kind == Injected.MOTOR_SPIKE:
        motor += 0.5 if since == 0 else 0.0
    elif kind == Injected.MOTOR_SPIKES:
        motor += 0.5 * sign if since % 3 == 0 else 0.0
    elif kind == Injected.MOTOR_DELAY:
        motor = motors[late]
    elif kind == Injected.MOTOR_SIGN:
        motor = -motor
    elif kind == Injected.OVER_TENSION:
        tension += 0.5 * since
    elif kind == Injected.PEAK_CURRENT:
        current = 30.0 * sign
    elif kind == Injected.LONG_CURRENT:
        current = 18.0
    elif kind == Injected.DRIVE_HOT:
        temperature += 0.5 * since
    elif kind == Injected.CURRENT_NAN:
        current = np.nan
    elif kind == Injected.TENSION_NAN:
        tension = np.nan
    elif kind == Injected.LATE_PDOS:
        joint_age = motor_age = k % 6
        joint, motor = joints[k - k % 6], motors[k - k % 6]
    elif kind == Injected.EMERGENCY:
        emergency = 0x5530 if since == 0 else 0.0
    elif kind == Injected.DRIVE_FAULT:
        drive_state = FAULT
    elif kind == Injected.DRIVE_REBOOT:
        drive_state = NOT_READY if since < 50 else DISABLED
    elif kind == Injected.DRIVE_DROPPED:
        drive_state = SWITCHED_ON
    if kind == Injected.MOTOR_DROPOUT or kind == Injected.DRIVE_SILENT or kind == Injected.BUS_OFF:
        motor, motor_age = motors[begun], since + 1.0
    if kind == Injected.DRIVE_SILENT or kind == Injected.HEARTBEAT_SILENT or kind == Injected.BUS_OFF:
        heartbeat_age = 0.01 + 0.001 * since
    if kind == Injected.HOST_SILENT and since > CONSUMER:
        drive_state = FAULT
    if kind == Injected.BUS_OFF:
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
        foreign,
        reading.sample_age,
        reading.joint_torque,
        reading.joint_sensor_age,
        reading.joint_std,
        reading.joint_sensor,
    )


class SensorFault(NamedTuple):
    """What goes wrong, and when."""

    kind: Injected = Injected.NOTHING
    """Of the joint's or the motor's angle."""
    begin: int = 0
    """First cycle."""
    end: int = 0
    """The cycle after the last."""


@placeholder
def as_it_is(fault: SensorFault, sample: Sample, kept: NDArray[np.float64], k: int) -> Sample:
    """The sample: where nothing goes wrong, this is compiled into the loop in place of `faulty`."""
    return sample


@noinline
def faulty(fault: SensorFault, sample: Sample, kept: NDArray[np.float64], k: int) -> Sample:
    """What the law is shown in cycle k; `kept` (2, n) holds the true readings for faults that look back."""
    kept[0, k], kept[1, k] = sample.joint, sample.motor
    if not fault.begin <= k < fault.end:
        return sample
    true = DriveReading(
        sample.motor, sample.joint, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        sample.joint_age, sample.joint_std, math.nan,
    )  # fmt: skip
    misread_sample = misread(fault.kind, k - fault.begin, true, kept[0], kept[1], k)
    return Sample(misread_sample.joint, misread_sample.motor, sample.joint_age, sample.joint_std)
