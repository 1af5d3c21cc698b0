"""The supervisor."""

from enum import IntEnum
from typing import NamedTuple

from bowden.core.signals import DriveReading


class Mode(IntEnum):
    """What the supervisor is at."""

    STOPPED = 0
    """Power off; where it starts."""
    PREFLIGHT = 1
    """Armed: power on, the preflight moves the motor; afterwards it waits for the request to run."""
    RUNNING = 2
    """The law moves the motor."""
    BRIDGING = 3
    """R1: the last valid target, for 5 ms at most."""
    RELEASING = 4
    """R2, or an operator's stop: the cable is let out, then power off."""
    LATCHED = 5
    """Power off until an operator acknowledges."""


class Request(IntEnum):
    """What the operator asks for in this cycle."""

    NONE = 0
    ARM = 1
    RUN = 2
    STOP = 3
    ACKNOWLEDGE = 4


class Observed(NamedTuple):
    """What the supervisor looks at in one cycle, besides the law's wish."""

    reading: DriveReading
    lateness: float
    """Of this cycle's beginning [s]."""
    elapsed: float
    """Since the cycle before began [s]."""
    request: float
    """Number of a `Request`."""
    operator_age: float
    """Since the operator's last sign of life [s]."""
    recorder: float
    """1 if the recorder is alive and has room, else 0."""
    preflight: float
    """0 not done, 1 passed, −1 failed."""


class Verdict(NamedTuple):
    """What the drive is told, and why."""

    target: float
    """The motor's target angle; always finite, within the limits, and within their speed of the one before [rad]."""
    power: float
    """Number of a `runtime.ports.Power`."""
    mode: float
    """Number of a `Mode`."""
    reaction: float
    """0, or 1 to 3 for R1 to R3."""
    faults: float
    """All that are active or latched, a sum of 2**fault."""
