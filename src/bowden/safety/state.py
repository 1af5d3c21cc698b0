"""The supervisor's inputs, its verdict, and its state from one cycle to the next."""

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

from bowden.core.quantity import Quantity
from bowden.core.signals import DriveReading, Power
from bowden.models.drive.thermal import ThermalState
from bowden.models.plausible import SensorState
from bowden.safety.faults import Reaction


class Mode(IntEnum):
    """Mode of the supervisor; it starts stopped."""

    STOPPED = 0
    """Power off."""
    PREFLIGHT = 1
    """Armed: the preflight moves the motor, then it waits there for the request to run."""
    RUNNING = 2
    """The law moves the motor."""
    BRIDGING = 3
    """R1: the last valid target."""
    RELEASING = 4
    """R2, or an operator's stop: the cable is let out until it is just taut, then power off."""
    LATCHED = 5
    """Power off until an operator acknowledges."""


class Request(IntEnum):
    """Request of the operator."""

    NONE = 0
    ARM = 1
    RUN = 2
    STOP = 3
    ACKNOWLEDGE = 4


class PreflightResult(IntEnum):
    """Result of the preflight."""

    FAILED = -1
    PENDING = 0
    PASSED = 1


class Observed(NamedTuple):
    """Inputs of the supervisor in one cycle, besides the requested target."""

    reading: DriveReading
    lateness: float
    """Of this cycle's beginning [s]."""
    elapsed: float
    """Since the cycle before began [s]."""
    request: Request
    operator_age: float
    """Since the operator's last sign of life [s]."""
    recorder: bool
    """True if the recorder is alive and has room."""
    preflight: PreflightResult
    emg_age: float
    """Since the newest EMG sample was taken; 0 in a run without EMG [s]."""
    others: Reaction = Reaction.NONE
    """Worst reaction to the faults of other motors, R2 or R3."""
    neighbour: float = 0.0
    """Angle of another motor on its joint; 0 where there is none [rad]."""
    reference: float = math.nan
    """Where a law is to have the joint; NaN while none leads [rad]."""


class Verdict(NamedTuple):
    """Command to the drive, and the reason for it."""

    target: float
    """Motor angle; always finite, within the limits and within their speed of the one before [rad]."""
    power: Power
    """ON or OFF."""
    mode: Mode
    reaction: Reaction
    faults: int
    """All that are active or latched, a bit each."""


class Decision(NamedTuple):
    """The last decision, with all that the next one needs of it."""

    mode: Annotated[Mode, Quantity("number of a `Mode`")]
    started: Annotated[bool, Quantity("1 from the accepted request to run on, until the power is off, else 0")]
    previous_target: Annotated[
        float, Quantity("what the drive was sent a cycle before the last, which the newest sample answers", "rad")
    ]
    bridged_time: Annotated[float, Quantity("time with any reaction, of which good time forgets a share", "s")]
    release_time: Annotated[float, Quantity("time for which a release has been asked for", "s")]
    latched: Annotated[int, Quantity("the faults that have to be acknowledged, a sum of 2**fault")]
    joint_at_release: Annotated[float, Quantity("joint angle when R2 began, or now where it has not", "rad")]
    motor_at_release: Annotated[float, Quantity("motor angle when R2 began, or now where it has not", "rad")]
    target_met_motor: Annotated[bool, Quantity("1 once the target of R2 has been where the motor is, else 0")]
    joint_ahead_time: Annotated[float, Quantity("time in R2 for which the joint has been ahead of the cable", "s")]


class ModelledServo(NamedTuple):
    """The drive as its servo's model says it is."""

    enabled: Annotated[bool, Quantity("1 from the drive's operation enabled on, while it is powered, else 0")]
    position: Annotated[float, Quantity("where the model is", "rad")]
    speed: Annotated[float, Quantity("its speed", "rad/s")]
    tracking_error_time: Annotated[float, Quantity("for how long the motor has not followed it", "s")]


class StuckSensorState(NamedTuple):
    """Motion of the motor since a sensor's reading last changed: of the joint's encoder, or of a load cell.

    A reading that only goes to and fro between two values has not changed: the last bit of a frozen sensor does so.

    A sensor that stands still while the motor crosses the cable's dead zone is in order. So the motor's angle goes
    through a play as wide as the widest dead zone, `DEAD_SHARE` of `frozen_travel`, and what comes out of it is added
    up: over one stroke, or over several of which each is a little longer than the dead zone.
    """

    motor: Annotated[float, Quantity("motor angle behind the widest dead zone", "rad")]
    reading: Annotated[float, Quantity("of the sensor, in its unit")]
    previous_reading: Annotated[float, Quantity("of the sensor before it last changed, in its unit")]
    travel: Annotated[float, Quantity("of the motor behind the dead zone without an answer", "rad")]


class StuckCurrentState(NamedTuple):
    """Motion of the servo's model since the current's reading last changed: a motor that does so needs another."""

    reading: Annotated[float, Quantity("motor current", "A")]
    previous_reading: Annotated[float, Quantity("motor current before it last changed", "A")]
    travel: Annotated[float, Quantity("of the model at that current", "rad")]
    speed_change: Annotated[float, Quantity("changes of its speed at that current, added up", "rad/s")]


class Timers(NamedTuple):
    """For how long something has lasted, and sums that forget."""

    overload: Annotated[float, Quantity("time beyond the largest current", "s")]
    saturated: Annotated[float, Quantity("time of a drive that counts as saturated", "s")]
    slack: Annotated[float, Quantity("time of a slack cable", "s")]
    late: Annotated[float, Quantity("lateness of the last cycles", "s")]
    bus_errors: Annotated[float, Quantity("the drive's counter when it was last known")]
    bus_failures: Annotated[float, Quantity("frames that could not be sent; one is forgiven each second")]
    armed: Annotated[float, Quantity("time with power and without a run", "s")]
    strained: Annotated[float, Quantity("time of a current that leaves no doubt of too much tension", "s")]
    undisabled: Annotated[float, Quantity("time with a sign of torque after the power was switched off", "s")]
    off_reference: Annotated[float, Quantity("time of a joint off its reference, less the time near it", "s")]


class NeighbourState(NamedTuple):
    """How a motor goes with the other one on its joint.

    After a release, or before the co-contraction is there, both may hang anywhere: they must have been as near as they
    are to be before they can part.
    """

    met: Annotated[bool, Quantity("1 once both were that near since the run began, else 0")]
    apart_time: Annotated[float, Quantity("for how long they have been further apart", "s")]


class SupervisorState(NamedTuple):
    """State of the supervisor: its last decision, and its detectors' memory."""

    target: Annotated[float, Quantity("what the drive was sent last", "rad")]
    decided: Decision
    servo: ModelledServo
    motor: SensorState
    joint: SensorState
    stuck_joint: StuckSensorState
    stuck_current: StuckCurrentState
    timers: Timers
    heat: ThermalState
    sample_age: Annotated[float, Quantity("how old the drive's newest sample was", "s")]
    stuck_load: StuckSensorState
    neighbour: NeighbourState
