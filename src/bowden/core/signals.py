"""The signals that pass between a law, a drive and their surroundings, in radians, seconds and SI units."""

import math
from enum import IntEnum
from typing import NamedTuple


class Sample(NamedTuple):
    """Readings of the encoders at one instant.

    >>> Sample(joint=0.1, motor=0.12).motor
    0.12
    """

    joint: float
    """Joint-side (distal) angle, the paper's φ_out [rad]."""
    motor: float
    """Motor-side (proximal) angle, the paper's φ_in [rad]."""
    joint_age: float = math.nan
    """Since the last value of the joint's sensor, where the angle is an estimate; NaN of an encoder [s]."""
    joint_std: float = math.nan
    """Standard deviation of the joint's angle, where it is an estimate; NaN of an encoder [rad]."""


class Reference(NamedTuple):
    """Where the joint should be at one instant, with its exact derivatives.

    >>> Reference(position=0.2, velocity=0.5, acceleration=0.0).velocity
    0.5
    """

    position: float
    """Desired joint angle φ_d [rad]."""
    velocity: float
    """dφ_d/dt [rad/s]."""
    acceleration: float
    """d²φ_d/dt² [rad/s²]."""


class DriveState(IntEnum):
    """Where a drive stands, whatever its family: the states of CiA 402, and their numbers.

    A family with fewer of them reports those that it has: the supervisor distinguishes `OPERATION_ENABLED`, the two of
    a fault, and all others.
    """

    NOT_READY_TO_SWITCH_ON = 0
    """Starting up; also what is said of a drive that is not operational on the bus, or gives no valid word."""
    SWITCH_ON_DISABLED = 1
    """No torque."""
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    """Power stage on, no torque."""
    OPERATION_ENABLED = 4
    """The motor follows the target."""
    QUICK_STOP_ACTIVE = 5
    """Slowing down, or standing with torque."""
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7


class Power(IntEnum):
    """The supervisor's demand on the drive's power; the last is the most cautious."""

    OFF = 0
    """Torque off now."""
    QUICK_STOP = 1
    """The drive's own quick stop, and then off; a drive that has none goes off."""
    READY = 2
    """Ready, without torque."""
    ON = 3
    """The motor follows the target."""


EMERGENCY_STOP = 65536.0
"""Stands among the codes of `DriveReading.emergency`, all of which are smaller, for an emergency stop: its input, or
the drive's own safe torque off [–]."""


class DriveReading(NamedTuple):
    """Last reading of the drive in one cycle of the live loop; NaN for what it does not measure."""

    motor: float
    """Motor angle at the spool [rad]."""
    joint: float
    """Joint angle [rad]."""
    current: float
    """Motor current [A]."""
    tension: float
    """Tension of the cable [N]."""
    temperature: float
    """Of the drive's power stage [°C]."""
    motor_age: float
    """Cycles since the motor angle came; 0 in the cycle of its arrival [–]."""
    joint_age: float
    """Cycles since the joint angle came [–]."""
    heartbeat_age: float
    """Time since the drive's last sign of life [s]."""
    drive_state: float
    """Number of a `DriveState` [–]."""
    emergency: float
    """Error code that the drive sent by itself in this cycle, or `EMERGENCY_STOP`; 0 for none [–]."""
    bus_errors: float
    """Frames that could not be sent, or bus-off, since the start [–]."""
    foreign: float
    """Frames in this cycle that this host alone may send, and that somebody else has sent [–]."""
    sample_age: float
    """Since the drive took its newest sample, at the beginning of this cycle [s]."""
    joint_torque: float = math.nan
    """Torque of the suit on the joint as a load cell says, flexing positive [N·m]."""
    joint_sensor_age: float = math.nan
    """Since the last value of the joint's sensor, where its angle is an estimate [s]."""
    joint_std: float = math.nan
    """Standard deviation of the joint's angle, where it is an estimate [rad]."""
    joint_sensor: float = math.nan
    """Value of the joint's sensor, where one came in this cycle and no encoder's [rad]."""
