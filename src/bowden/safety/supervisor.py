"""The supervisor: it stands last before the wire, knows nothing of laws, and may only refuse or stop.

It looks (estimates and detectors), takes the worst reaction, and gives the drive a target and a power state. The law's
wish is passed on unchanged or not at all; a reading is used as it is or not at all.
"""

from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity
from bowden.core.signals import EMERGENCY_STOP, DriveReading
from bowden.models.drive.servo import servo_predict
from bowden.models.drive.thermal import ThermalState, warm
from bowden.models.plausible import Followed, beyond, follow, lasting, outside
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits


class Mode(IntEnum):
    """What the supervisor is at; it starts stopped."""

    STOPPED = 0  # power off
    PREFLIGHT = 1  # armed: the preflight moves the motor, then it waits there for the request to run
    RUNNING = 2  # the law moves the motor
    BRIDGING = 3  # R1: the last valid target
    RELEASING = 4  # R2, or an operator's stop: the cable is let out until it is just taut, then power off
    LATCHED = 5  # power off until an operator acknowledges


Request = IntEnum("Request", ["NONE", "ARM", "RUN", "STOP", "ACKNOWLEDGE"], start=0)  # what the operator asks for


class Observed(NamedTuple):
    """What the supervisor looks at in one cycle, besides the law's wish."""

    reading: DriveReading
    lateness: float  # of this cycle's beginning [s]
    elapsed: float  # since the cycle before began [s]
    request: float  # number of a `Request`
    operator_age: float  # since the operator's last sign of life [s]
    recorder: float  # 1 if the recorder is alive and has room, else 0
    preflight: float  # 0 not done, 1 passed, −1 failed
    emg_age: float  # since the newest EMG sample was taken; 0 in a run without EMG [s]
    others: float = 0.0  # worst reaction to faults of other axes, 2 or 3; 0 for none, and where there are no others
    opposite: float = 0.0  # angle of the other motor of a pair; 0 where there is none [rad]
    reference: float = float("nan")  # where a law is to have the joint; NaN while none leads [rad]


class Verdict(NamedTuple):
    """What the drive is sent, and why."""

    target: float  # motor angle; always finite, within the limits and within their speed of the one before [rad]
    power: float  # number of a `hardware.ports.Power`, 0 or 3
    mode: float  # number of a `Mode`
    reaction: float  # 0, or 1 to 3 for R1 to R3
    faults: float  # all that are active or latched, a sum of 2**fault


class Decided(NamedTuple):
    """What the supervisor decided last, and what its next decision needs of it."""

    mode: Annotated[float, Quantity("number of a `Mode`")]
    passed: Annotated[float, Quantity("1 from the request to run on, until the power is off, else 0")]
    target_before: Annotated[float, Quantity("what the drive was sent a cycle before the last", "rad")]
    bridged: Annotated[float, Quantity("time in R1, of which good time forgets a share", "s")]
    released: Annotated[float, Quantity("time in R2", "s")]
    latched: Annotated[float, Quantity("the faults that have to be acknowledged, a sum of 2**fault")]
    joint_then: Annotated[float, Quantity("joint angle when R2 began, or now where it has not", "rad")]
    motor_then: Annotated[float, Quantity("motor angle when R2 began, or now where it has not", "rad")]
    met: Annotated[float, Quantity("1 once the target of R2 has been where the motor is, else 0")]
    ahead: Annotated[float, Quantity("time in R2 for which the joint has been ahead of the cable", "s")]


class ModelledServo(NamedTuple):
    """The drive as its servo's model says it is."""

    enabled: Annotated[float, Quantity("1 from the drive's operation enabled on, while it is powered, else 0")]
    position: Annotated[float, Quantity("where the model is", "rad")]
    speed: Annotated[float, Quantity("its speed", "rad/s")]
    astray: Annotated[float, Quantity("for how long the motor has not followed it", "s")]


class Anchor(NamedTuple):
    """What the motor has done since the joint's reading last changed, and since the current did.

    A reading that only goes to and fro between two values has not changed: the last bit of a frozen sensor does so.

    A joint that stands still while the motor crosses the cable's dead zone is in order. So the motor's angle goes
    through a play as wide as the widest dead zone, `DEAD_SHARE` of `frozen_travel`, and what comes out of it is added
    up: over one stroke, or over several of which each is a little longer than the dead zone.
    """

    motor: Annotated[float, Quantity("motor angle behind the widest dead zone", "rad")]
    joint: Annotated[float, Quantity("joint angle", "rad")]
    joint_before: Annotated[float, Quantity("joint angle before it last changed", "rad")]
    unanswered: Annotated[float, Quantity("travel of the motor behind the dead zone without an answer", "rad")]
    current: Annotated[float, Quantity("motor current", "A")]
    current_before: Annotated[float, Quantity("motor current before it last changed", "A")]
    travelled: Annotated[float, Quantity("travel of the servo's model at that current", "rad")]
    swung: Annotated[float, Quantity("changes of its speed at that current, added up", "rad/s")]


class LoadAnchor(NamedTuple):
    """What the motor has done since the load cell's reading last changed, behind the widest dead zone, as `Anchor`."""

    motor: Annotated[float, Quantity("motor angle behind the widest dead zone", "rad")]
    reading: Annotated[float, Quantity("of the load cell, in its unit")]
    reading_before: Annotated[float, Quantity("of the load cell before it last changed, in its unit")]
    unanswered: Annotated[float, Quantity("travel of the motor behind the dead zone without an answer", "rad")]


class Pairing(NamedTuple):
    """How a motor goes with the other one on its joint.

    After a release, or before the co-contraction is there, both may hang anywhere: they must have been as near as they
    are to be before they can part.
    """

    met: Annotated[float, Quantity("1 once both were that near since the run began, else 0")]
    parted: Annotated[float, Quantity("for how long they have been further apart", "s")]


class Sums(NamedTuple):
    """For how long something has lasted, and sums that forget."""

    overload: Annotated[float, Quantity("time beyond the largest current", "s")]
    saturated: Annotated[float, Quantity("time of a drive that counts as saturated", "s")]
    slack: Annotated[float, Quantity("time of a slack cable", "s")]
    late: Annotated[float, Quantity("lateness of the last cycles", "s")]
    bus_errors: Annotated[float, Quantity("the drive's counter when it was last known")]
    failures: Annotated[float, Quantity("frames that could not be sent; one is forgiven each second")]
    armed: Annotated[float, Quantity("time with power and without a run", "s")]
    strained: Annotated[float, Quantity("time of a current that leaves no doubt of too much tension", "s")]
    undisabled: Annotated[float, Quantity("time with a sign of torque after the power was switched off", "s")]
    off_reference: Annotated[float, Quantity("time of a joint off its reference, less the time near it", "s")]


class SupervisorState(NamedTuple):
    """What the supervisor decided, and what it sees."""

    target: Annotated[float, Quantity("what the drive was sent last", "rad")]
    decided: Decided
    servo: ModelledServo
    motor: Followed
    joint: Followed
    anchor: Anchor
    sums: Sums
    heat: ThermalState
    sample_age: Annotated[float, Quantity("how old the drive's newest sample was", "s")]
    load: LoadAnchor
    pair: Pairing


class Found(NamedTuple):
    """A number for each fault, by its name: what its detector says (1 or 0), its bit, its reactions."""

    JOINT_LOST: float
    JOINT_JUMP: float
    JOINT_STALE: float
    JOINT_FROZEN: float
    JOINT_ASTRAY: float
    JOINT_OVER_TRAVEL: float
    JOINT_OVER_SPEED: float
    MOTOR_LOST: float
    MOTOR_JUMP: float
    MOTOR_STALE: float
    NOT_FOLLOWING: float
    MOTOR_OVER_TRAVEL: float
    MOTOR_OVER_SPEED: float
    CURRENT_LOST: float
    OVER_CURRENT: float
    SATURATED: float
    I2T: float
    MOTOR_HOT: float
    DRIVE_HOT: float
    TENSION_LOST: float
    OVER_TENSION: float
    SLACK: float
    HEARTBEAT_LOST: float
    NOT_ENABLED: float
    DRIVE_DROPPED: float
    DRIVE_FAULT: float
    EMERGENCY: float
    BUS_ERRORS: float
    LATE: float
    CLOCK: float
    WISH_LOST: float
    WISH_STEP: float
    WISH_FAR: float
    WISH_HARD: float
    OPERATOR_LOST: float
    PREFLIGHT_FAILED: float
    RECORDER_LOST: float
    EMG_LOST: float
    NOT_DISABLED: float
    SECOND_MASTER: float
    EMERGENCY_STOP: float
    CURRENT_STUCK: float
    RELEASE_PULLS: float
    AXIS_RELEASED: float
    AXIS_OFF: float
    TORQUE_LOST: float
    OVER_TORQUE: float
    LOAD_STUCK: float
    MOTORS_APART: float
    JOINT_OFF_REFERENCE: float


POWER_OFF, POWER_ON = 0.0, 3.0  # of `hardware.ports.Power`, which this floor cannot see
STOPPED, PREFLIGHT, RUNNING, BRIDGING, RELEASING, LATCHED = (float(mode) for mode in Mode)
ARM, RUN, STOP, ACKNOWLEDGE = (float(request) for request in list(Request)[1:])
DEAD_SHARE = (
    0.8  # of `frozen_travel`: the widest dead zone; the rest separates a frozen joint from one that starts late
)
SWING = 1.0  # changes of speed that no motor makes at one and the same current [rad/s]
PULLED_SPEED = 1.0  # a motor without power, and of unknown current, that pulls faster is not turned by hand [rad/s]
# a joint so far to the slack side of where the cable is just taut, and so much further than when R2 began, is pulled
REST, FURTHER = 0.35, 0.1  # [rad]
AHEAD = 0.05  # time for which a joint is ahead of the cable before the cable counts as slack [s]
OVERSPEED = 1.1  # speed over that of a release at which its target waits: more than a servo's own ripple
WAITS = 1.3  # time of a release over that without friction: 1.26 at most of 1000 (benchmarks/releases.py)
TAUT = 0.05  # a servo's model so near to where the cable is just taut has let the load down [rad]
BIG = 1e6  # what is larger is no number that anything here can mean
COUNT = len(Fault)
BIT = Found(**{fault.name: 2.0**fault for fault in Fault})
AT_ONCE = Found(**{fault.name: float(fault.at_once) for fault in Fault})
_JOINTS = (Fault.JOINT_LOST, Fault.JOINT_JUMP, Fault.JOINT_STALE, Fault.JOINT_FROZEN, Fault.JOINT_ASTRAY)
OF_FORCE = Found(**{fault.name: float(fault is Fault.SATURATED) for fault in Fault})  # 1 of a force that R2 ends
OF_JOINT = Found(**{fault.name: float(fault in _JOINTS) for fault in Fault})  # 1 where its angle is in doubt
THEN = Found(**{fault.name: float(fault.then) for fault in Fault})


@kernel
def begin(limits: Limits, reading: DriveReading, thermal: ThermalState) -> SupervisorState:
    """Stopped, with the motor as warm as the last run left it (`models.drive.thermal.rested`)."""
    motor = sel(outside(reading.motor, -limits.sensor_span, limits.sensor_span) > 0.0, 0.0, reading.motor)
    joint = sel(outside(reading.joint, -limits.sensor_span, limits.sensor_span) > 0.0, 0.0, reading.joint)
    target = np.fmax(limits.motor_low, np.fmin(limits.motor_high, motor))
    return SupervisorState(
        target,
        Decided(STOPPED, 0.0, target, 0.0, 0.0, 0.0, joint, motor, 0.0, 0.0),
        ModelledServo(0.0, motor, 0.0, 0.0),
        Followed(motor, 0.0, 0.0),
        Followed(joint, 0.0, 0.0),
        Anchor(motor, joint, joint, 0.0, 0.0, 0.0, 0.0, 0.0),
        Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        thermal,
        0.0,
        LoadAnchor(motor, 0.0, 0.0, 0.0),
        Pairing(0.0, 0.0),
    )


@kernel
def is_new(value: float, last: float, before: float, still: float) -> float:
    """1 where a reading is neither of its last two values, within `still`, else 0; 1 for what is not a number."""
    return beyond(np.abs(value - last), still) * beyond(np.abs(value - before), still)


@kernel
def most_step(limits: Limits, time: float, dt: float) -> float:
    """What the target may change by since the last cycle [rad]; a late loop is given five cycles at most."""
    return limits.target_speed * np.fmax(dt, np.fmin(time, 5.0 * dt))


@kernel
def steepest(limits: Limits) -> float:
    """The most that the joint moves by per motor angle [rad/rad]."""
    return np.fmax(-limits.slope_low, limits.slope_high)  # the smaller one may be below zero


@kernel
def release_speed(limits: Limits, force: float) -> float:
    """Speed of the target in R2, at which the joint is no faster than it may be on the cable's steepest slope [rad/s].

    Args:
        limits: of the rig.
        force: 1 where the cause is a force, else 0.
    """
    return sel(force > 0.0, limits.force_release, limits.lowering) / steepest(limits)


@kernel
def release_target(limits: Limits, met: float, target: float, motor: Followed, force: float, time: float) -> float:
    """The motor's next target in R2 [rad]: let down at `release_speed`, to where the cable is just taut.

    It begins at the target, or at a motor that could not pull as far. Once the target has been where the motor is, a
    load that drags the motor on is braked, and not gone after. Where friction lets go of the motor, it would run after
    the target: that waits at the motor until it is slow again.

    Args:
        limits: of the rig.
        met: 1 once the target of this release has been where the motor is, else 0.
        target: what the drive was sent last [rad].
        motor: as it is believed.
        force: 1 where the cause is a force, else 0.
        time: since the cycle before [s].
    """
    out, speed = limits.slack_sign, release_speed(limits, force)
    begin = sel(met > 0.0, out * target, np.fmax(out * target, out * motor.value))
    lowered = np.fmax(begin, np.fmin(out * limits.taut, begin + speed * np.fmin(time, 0.1)))
    quick = beyond(out * motor.speed, OVERSPEED * speed)
    return out * sel(quick > 0.0, np.fmin(lowered, out * motor.value), lowered)


@kernel
def longest_release(limits: Limits) -> float:
    """How long R2 may last [s]: from the end of the motor's range to where the cable is just taut."""
    pulled = np.fmax(-limits.slack_sign * limits.motor_low, -limits.slack_sign * limits.motor_high)
    return limits.release_time + WAITS * (pulled + limits.slack_sign * limits.taut) / release_speed(limits, 0.0)


class SensedAngles(NamedTuple):
    """What becomes of a cycle's angles: each is taken as it is, or not at all."""

    clock: float
    """1 where the clock cannot be right, else 0."""
    time: float
    """Since the cycle before; the length of a cycle where the clock cannot be right [s]."""
    sampled: float
    """From the sample that was read in the cycle before to this cycle's, which is not the time between the cycles: a
    late cycle reads what was sampled in time, and the next one what was sampled late [s]."""
    sample_age: float
    """Of this cycle's sample; 0 where it is not known [s]."""
    motor: Followed
    motor_lost: float
    motor_jump: float
    joint: Followed
    joint_lost: float
    joint_jump: float


@kernel
def see(limits: Limits, state: SupervisorState, observed: Observed, dt: float) -> SensedAngles:
    """The angles that are taken for true; without power the motor and the limb may be moved by hand."""
    reading, powered = observed.reading, 1.0 - outside(state.decided.mode, PREFLIGHT, RELEASING)
    clock = np.fmax(outside(observed.elapsed, 0.05 * dt, limits.clock_gap), outside(observed.lateness, -dt, BIG))
    time = sel(clock > 0.0, dt, observed.elapsed)
    age = sel(outside(reading.sample_age, 0.0, BIG) > 0.0, 0.0, reading.sample_age)
    sampled = np.fmax(0.0, time + state.sample_age - age)
    span, jump, filtered = limits.sensor_span, sel(powered > 0.0, limits.jump, BIG), limits.speed_filter
    motor, motor_lost, motor_jump = follow(
        state.motor, reading.motor, reading.motor_age == 0.0, sampled, span, jump, limits.motor_speed, filtered
    )
    joint, joint_lost, joint_jump = follow(
        state.joint, reading.joint, reading.joint_age == 0.0, sampled, span, jump, limits.joint_speed, filtered
    )
    return SensedAngles(clock, time, sampled, age, motor, motor_lost, motor_jump, joint, joint_lost, joint_jump)


@kernel
def look(
    limits: Limits, state: SupervisorState, observed: Observed, wish: float, dt: float
) -> tuple[SupervisorState, Found, float]:
    """This cycle's estimates beside what was decided last, what each detector says, and the time since then [s]."""
    reading, omega, zeta, peak = observed.reading, limits.servo_frequency, limits.servo_damping, limits.current_peak
    last, servo, sums = state.decided, state.servo, state.sums
    powered = 1.0 - outside(last.mode, PREFLIGHT, RELEASING)

    # angles
    clock, time, sampled, age, motor, motor_lost, motor_jump, joint, joint_lost, joint_jump = see(
        limits, state, observed, dt
    )
    stale = outside(reading.motor_age, 0.0, limits.reading_age)
    flat, steep, margin = limits.slope_low * motor.value, limits.slope_high * motor.value, limits.motor_margin

    # the drive's state and its servo
    off = outside(reading.drive_state, 3.5, 4.5)
    fault, left = 1.0 - outside(reading.drive_state, 5.5, 7.5), powered * servo.enabled * off
    enabled = powered * np.fmax(servo.enabled, 1.0 - off)
    pressed = 1.0 - outside(reading.emergency, EMERGENCY_STOP, EMERGENCY_STOP)
    moved, speed = servo_predict(servo.position, servo.speed, last.target_before, omega, zeta, sampled)
    model, model_speed = sel(servo.enabled > 0.0, moved, motor.value), sel(servo.enabled > 0.0, speed, 0.0)
    lag = beyond(np.abs(motor.value - model), limits.tracking + limits.tracking_lag * np.abs(model_speed))
    astray = lasting(lag, servo.astray, time)

    # signs of life: of the joint while the motor moves beyond the dead zone, of the current while it accelerates
    anchor, half = state.anchor, 0.5 * DEAD_SHARE * limits.frozen_travel
    alive = (powered == 0.0) + is_new(joint.value, anchor.joint, anchor.joint_before, limits.joint_still) > 0.0
    behind = np.fmax(motor.value - half, np.fmin(motor.value + half, anchor.motor))
    unanswered = anchor.unanswered + np.abs(behind - anchor.motor)
    flows = (enabled == 0.0) + is_new(reading.current, anchor.current, anchor.current_before, 0.0) > 0.0
    taken = flows * (1.0 - outside(reading.current, -BIG, BIG))
    anchor = Anchor(
        sel(alive, motor.value, behind),
        sel(alive, joint.value, anchor.joint),
        sel(alive, anchor.joint, anchor.joint_before),
        sel(alive, 0.0 - half, unanswered),
        sel(taken > 0.0, reading.current, anchor.current),
        sel(taken > 0.0, anchor.current, anchor.current_before),
        sel(flows, 0.0, anchor.travelled + np.abs(model - servo.position)),
        sel(flows, 0.0, anchor.swung + np.abs(model_speed - servo.speed)),
    )
    stuck = beyond(anchor.travelled, limits.frozen_travel) * beyond(anchor.swung, SWING)
    rest = limits.slack_sign * limits.taut
    rest = np.fmax(limits.slope_low * rest, limits.slope_high * rest)
    way = limits.slack_sign * joint.value - rest
    pulls = beyond(way, REST) * beyond(limits.slack_sign * (joint.value - last.joint_then), FURTHER)

    # current, heat, tension; while the current of a powered motor is unknown, the worst is taken for true, but for a
    # tension, which is none unless there is no doubt of it
    no_current = limits.measures_current * beyond(np.abs(reading.current), 2.0 * peak)
    known = limits.measures_current * (1.0 - no_current)
    current = sel(known > 0.0, np.abs(reading.current), no_current * powered * peak)
    # a drive that says it has no torque is believed by its current; where that is not known, by a motor that does not
    # pull: by hand it is turned more slowly, and a limb that sinks turns it the other way
    pulled = beyond(-limits.slack_sign * motor.speed, PULLED_SPEED)
    works = sel(known > 0.0, beyond(current, limits.released_current), pulled)
    works = np.fmax(1.0 - outside(reading.drive_state, 3.5, 6.5), works * (1.0 - stale))
    undisabled = lasting((1.0 - powered) * works, sums.undisabled, time)
    overload = lasting(beyond(current, peak), sums.overload, time)
    saturated = lasting(beyond(current, limits.saturation * peak), sums.saturated, time)
    heat = warm(limits.thermal, state.heat, current, np.fmin(time, 0.1))
    i2t = (peak * peak - limits.thermal.continuous_current * limits.thermal.continuous_current) * limits.i2t_time
    hot = np.fmax(outside(heat.winding, -BIG, limits.winding_limit), outside(heat.housing, -BIG, limits.housing_limit))
    no_tension = limits.measures_tension * outside(reading.tension, -BIG, BIG)
    tension = sel(limits.measures_tension * (1.0 - no_tension) > 0.0, reading.tension, limits.tension_low)
    pull = sel(known > 0.0, -limits.slack_sign * reading.current * limits.pull_gain - limits.pull_doubt, 0.0)
    strained = lasting(beyond(pull, limits.tension_high), sums.strained, time)
    no_torque = limits.measures_torque * outside(reading.joint_torque, -BIG, BIG)
    torque = sel(limits.measures_torque * (1.0 - no_torque) > 0.0, reading.joint_torque, 0.0)

    # the load cell's sign of life, as the joint's
    load = sel(limits.measures_tension > 0.0, reading.tension, reading.joint_torque)
    answers = (powered == 0.0) + is_new(load, state.load.reading, state.load.reading_before, 0.0) > 0.0
    held = answers * (1.0 - outside(load, -BIG, BIG))
    beside = np.fmax(motor.value - half, np.fmin(motor.value + half, state.load.motor))
    mute = state.load.unanswered + np.abs(beside - state.load.motor)
    cell = LoadAnchor(
        sel(answers, motor.value, beside),
        sel(held > 0.0, load, state.load.reading),
        sel(held > 0.0, state.load.reading, state.load.reading_before),
        sel(answers, 0.0 - half, mute),
    )
    measured = np.fmax(limits.measures_tension, limits.measures_torque) * (1.0 - beyond(last.mode, BRIDGING))
    slack = lasting(enabled * beyond(-tension, -limits.tension_low), sums.slack, time)

    # the other motor of a pair: half of what both are further apart than the joint asks, by both cables. While
    # its angle is not known nothing is said, which is for its own supervisor to do
    known = 1.0 - outside(observed.opposite, -limits.sensor_span, limits.sensor_span)
    asked_apart = limits.parting_offset + limits.parting_slope * joint.value
    apart = 0.5 * np.abs(motor.value - observed.opposite - asked_apart)
    further = beyond(apart, limits.parting + limits.parting_lag * np.abs(motor.speed))
    runs = limits.paired * enabled * last.passed * (1.0 - beyond(last.mode, BRIDGING))
    met = runs * np.fmax(state.pair.met, known * (1.0 - further))
    parted = lasting(met * known * further, state.pair.parted, time)

    # bus and time: sums that forget
    armed = lasting(powered * (1.0 - last.passed), sums.armed, time)
    unknown = outside(reading.bus_errors, 0.0, BIG * BIG)
    errors = sel(unknown > 0.0, sums.bus_errors, reading.bus_errors)
    failures = np.fmax(0.0, np.fmin(4.0, sums.failures + np.fmax(0.0, errors - sums.bus_errors)) - time)
    late = np.fmax(0.0, sums.late + np.fmax(0.0, time - 1.5 * dt) - 0.02 * time)

    # the wish
    led = enabled * (1.0 - beyond(last.mode, BRIDGING))
    no_wish = led * outside(wish, limits.motor_low, limits.motor_high)
    asked = sel(led * (1.0 - no_wish) > 0.0, wish, state.target)
    hard = omega * (omega * (asked - model) - 2.0 * zeta * model_speed)
    # the joint beside its reference; time near it counts back, so that one that swings about it is found too
    follows = led * last.passed * (1.0 - outside(observed.reference, -BIG, BIG))
    missed = beyond(np.abs(joint.value - observed.reference), limits.off_reference)
    off_reference = follows * np.fmax(0.0, sums.off_reference + sel(missed > 0.0, time, -time))
    failed = np.fmax(outside(observed.preflight, -0.5, 1.5), beyond(armed, limits.preflight_time))
    found = Found(
        JOINT_LOST=joint_lost,
        JOINT_JUMP=joint_jump,
        JOINT_STALE=outside(reading.joint_age, 0.0, limits.reading_age),
        JOINT_FROZEN=beyond(anchor.unanswered, limits.frozen_travel - 2.0 * half),
        JOINT_ASTRAY=outside(joint.value, np.fmin(flat, steep) - limits.play, np.fmax(flat, steep) + limits.play),
        JOINT_OVER_TRAVEL=outside(joint.value, limits.joint_low, limits.joint_high),
        JOINT_OVER_SPEED=beyond(np.abs(joint.speed), limits.joint_speed),
        MOTOR_LOST=motor_lost,
        MOTOR_JUMP=motor_jump,
        MOTOR_STALE=stale,
        NOT_FOLLOWING=beyond(astray, limits.tracking_time),
        MOTOR_OVER_TRAVEL=outside(motor.value, limits.motor_low - margin, limits.motor_high + margin),
        MOTOR_OVER_SPEED=beyond(np.abs(motor.speed), limits.motor_speed),
        CURRENT_LOST=no_current,
        OVER_CURRENT=beyond(overload, limits.current_time),
        SATURATED=beyond(saturated, limits.saturation_time),
        I2T=beyond(heat.i2t, i2t),
        MOTOR_HOT=hot,
        DRIVE_HOT=limits.measures_temperature * outside(reading.temperature, -BIG, limits.drive_limit),
        TENSION_LOST=no_tension,
        OVER_TENSION=np.fmax(beyond(tension, limits.tension_high), beyond(strained, limits.saturation_time)),
        SLACK=beyond(slack, limits.slack_time),
        HEARTBEAT_LOST=outside(reading.heartbeat_age, 0.0, limits.heartbeat_age),
        NOT_ENABLED=(1.0 - enabled) * beyond(armed, limits.enable_time),
        DRIVE_DROPPED=left * (1.0 - fault),
        DRIVE_FAULT=fault,
        EMERGENCY=outside(reading.emergency, 0.0, 0.0) * (1.0 - pressed),
        BUS_ERRORS=np.fmax(unknown, beyond(failures, limits.bus_errors)),
        LATE=(1.0 - clock) * beyond(np.fmax(observed.lateness, late), limits.lateness),
        CLOCK=clock,
        WISH_LOST=no_wish,
        WISH_STEP=beyond(np.abs(asked - state.target), most_step(limits, time, dt)),
        WISH_FAR=led * beyond(np.abs(asked - motor.value), limits.target_reach),
        WISH_HARD=led * beyond(np.abs(hard), limits.acceleration),
        OPERATOR_LOST=outside(observed.operator_age, -1.0, limits.operator_age),
        PREFLIGHT_FAILED=powered * (1.0 - last.passed) * failed,
        RECORDER_LOST=outside(observed.recorder, 0.5, 1.5),
        EMG_LOST=limits.uses_emg * outside(observed.emg_age, -1.0, limits.emg_age),
        NOT_DISABLED=beyond(undisabled, limits.disable_time),
        SECOND_MASTER=outside(reading.foreign, 0.0, 0.0),
        EMERGENCY_STOP=pressed,
        CURRENT_STUCK=limits.measures_current * (1.0 - beyond(last.mode, BRIDGING)) * stuck,
        RELEASE_PULLS=limits.homed * (last.mode == RELEASING) * pulls,
        AXIS_RELEASED=1.0 - outside(observed.others, 1.5, 2.5),
        AXIS_OFF=outside(observed.others, -0.5, 2.5),
        TORQUE_LOST=no_torque,
        OVER_TORQUE=beyond(np.abs(torque), limits.torque_high),
        LOAD_STUCK=measured * beyond(cell.unanswered, limits.frozen_travel - 2.0 * half),
        MOTORS_APART=beyond(parted, limits.slack_time),
        JOINT_OFF_REFERENCE=beyond(off_reference, limits.off_reference_time),
    )
    return (
        SupervisorState(
            state.target,
            last,
            ModelledServo(enabled, model, model_speed, astray),
            motor,
            joint,
            anchor,
            Sums(overload, saturated, slack, late, errors, failures, armed, strained, undisabled, off_reference),
            heat,
            age,
            cell,
            Pairing(met, parted),
        ),
        found,
        time,
    )


@kernel
def supervise(
    limits: Limits, state: SupervisorState, observed: Observed, wish: float, dt: float
) -> tuple[SupervisorState, Verdict]:
    """One cycle of `dt` [s]: the law's `wish` [rad], if nothing speaks against it, and power, if nothing forbids it."""
    seen, found, time = look(limits, state, observed, wish, dt)
    last, enabled, motor = state.decided, seen.servo.enabled, seen.motor.value
    once, eventually, latched, active, doubted, force = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(COUNT):
        once, eventually = np.fmax(once, found[i] * AT_ONCE[i]), np.fmax(eventually, found[i] * THEN[i])
    powered, releasing = 1.0 - outside(last.mode, PREFLIGHT, RELEASING), last.mode == RELEASING
    bridged = powered * sel(once > 0.0, last.bridged + time, np.fmax(0.0, last.bridged - limits.bridge_leak * time))
    ended = (bridged > limits.bridge_time + 0.5 * dt) + (once >= 2.0) + releasing > 0.0
    reaction = sel(powered > 0.0, sel(ended, eventually, once), found.NOT_DISABLED * eventually)

    # the next mode
    run = (observed.request == RUN) * (observed.preflight == 1.0) * (enabled > 0.0) * (reaction == 0.0) > 0.0
    run = run * (found.RECORDER_LOST == 0.0) > 0.0
    passed = powered * sel(run, 1.0, last.passed)
    going = sel(reaction > 0.0, BRIDGING, sel(passed > 0.0, RUNNING, PREFLIGHT))
    going = sel((reaction >= 2.0) + (observed.request == STOP) + releasing > 0.0, RELEASING, going)
    released = lasting(going == RELEASING, last.released, time)
    out = limits.slack_sign
    for i in range(COUNT):
        kept = np.floor(last.latched / BIT[i]) - 2.0 * np.floor(last.latched / (2.0 * BIT[i]))
        kept = np.fmax(kept, sel((reaction >= 2.0) * (THEN[i] >= 2.0), found[i], 0.0))
        latched, active = latched + kept * BIT[i], active + np.fmax(kept, found[i]) * BIT[i]
        doubted, force = np.fmax(doubted, kept * OF_JOINT[i]), np.fmax(force, kept * OF_FORCE[i])
    # a cable that the joint has left behind since R2 began carries nothing, if the joint's angle is to be believed:
    # it is not in doubt, it moves, and one that was wrong by as much before says nothing
    joint, late = seen.joint.value, np.fmin(time, 5.0 * dt)
    joint_then, motor_then = sel(releasing, last.joint_then, joint), sel(releasing, last.motor_then, motor)
    leads = out * (limits.slope_high * motor - joint)
    grown = leads - out * (limits.slope_high * motor_then - joint_then)
    behind = beyond(leads, 0.5 * limits.play) * beyond(grown, 0.5 * limits.play)
    moves = beyond(np.abs(joint - joint_then), limits.joint_still)
    ahead = lasting((1.0 - doubted) * behind * moves, last.ahead, late)  # outside a release it is where it was then
    carries = beyond(out * (limits.taut - seen.servo.position), TAUT) * (1.0 - beyond(ahead, AHEAD))
    most = sel(carries > 0.0, longest_release(limits), limits.release_time)
    empty = (released > most - 0.5 * dt) + (enabled == 0.0) > 0.0
    going = sel(releasing * empty, sel(latched > 0.0, LATCHED, STOPPED), going)
    going = sel(reaction >= 3.0, LATCHED, going)
    arms = (observed.request == ARM) * (last.mode == STOPPED) * (active == 0.0)
    rests = sel(arms, PREFLIGHT, sel((last.mode == LATCHED) * (observed.request != ACKNOWLEDGE), LATCHED, STOPPED))
    mode = sel(powered > 0.0, going, sel(found.NOT_DISABLED > 0.0, LATCHED, rests))

    # the target: without power it follows the motor, so that nothing moves when power comes
    lowered = release_target(limits, last.met, state.target, seen.motor, force, time)
    led = enabled * (1.0 - outside(mode, PREFLIGHT, RUNNING))
    aim = sel(led > 0.0, wish, sel(mode == RELEASING, lowered, sel(mode == BRIDGING, state.target, motor)))
    step = most_step(limits, time, dt)
    aim = np.fmax(state.target - step, np.fmin(state.target + step, aim))
    target = np.fmax(limits.motor_low, np.fmin(limits.motor_high, aim))
    idle = (outside(mode, PREFLIGHT, RELEASING) > 0.0) + (mode == RELEASING) * (enabled == 0.0) > 0.0
    reported = sel(mode == LATCHED, 3.0, sel(mode == RELEASING, 2.0, reaction))
    held = sel(mode == STOPPED, 0.0, latched)
    met = (mode == RELEASING) * np.fmax(last.met, 1.0 - beyond(out * motor, out * target))
    then = joint_then, motor_then, met, ahead
    decided = Decided(mode, passed, state.target, bridged, released, held, *then)
    return (
        SupervisorState(
            target,
            decided,
            seen.servo,
            seen.motor,
            seen.joint,
            seen.anchor,
            seen.sums,
            seen.heat,
            seen.sample_age,
            seen.load,
            seen.pair,
        ),
        Verdict(target, sel(idle, POWER_OFF, POWER_ON), mode, reported, active),
    )
