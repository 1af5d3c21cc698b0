"""Evidence of one cycle: valid readings, models beside them, and how long each condition has persisted.

No fault is decided here: the detectors (`safety.detectors`) do that, of what stands in `Evidence`.
"""

from typing import NamedTuple

from bowden.core.kernel import kernel
from bowden.core.signals import DriveReading, DriveState
from bowden.models.drive.servo import servo_predict
from bowden.models.drive.thermal import warm
from bowden.models.plausible import ReadingCheck, SensorState, beyond, follow, outside, persistence_time
from bowden.safety.limits import Limits
from bowden.safety.state import (
    Mode,
    ModelledServo,
    NeighbourState,
    Observed,
    StuckCurrentState,
    StuckSensorState,
    SupervisorState,
    Timers,
)

DEAD_SHARE = 0.8
"""Of `frozen_travel`: the widest dead zone; the rest separates a frozen joint from one that starts late [–]."""
PULLED_SPEED = 1.0
"""A motor without power, and of unknown current, that pulls faster is not turned by hand [rad/s]."""
DOUBT = 3.0
"""Standard deviations by which an estimate of the joint's angle may be off [–]."""
BIG = 1e6
"""A reading or target of a larger size counts as no number."""


class ValidatedReadings(NamedTuple):
    """A cycle's times and angles after validation: each is used as it is, or not at all."""

    clock_wrong: bool
    """The clock cannot be right."""
    time: float
    """Since the cycle before; the length of a cycle where the clock cannot be right [s]."""
    sampled: float
    """From the sample that was read in the cycle before to this cycle's, which is not the time between the cycles: a
    late cycle reads what was sampled in time, and the next one what was sampled late [s]."""
    sample_age: float
    """Of this cycle's sample; 0 where it is not known [s]."""
    motor: ReadingCheck
    joint: ReadingCheck


class Effort(NamedTuple):
    """Current, tension and torque as they are taken for true."""

    current_lost: bool
    current: float
    """Its size; while that of a powered motor is lost, the worst: its peak [A]."""
    tension_lost: bool
    tension: float
    """While it is lost, or not measured, one that is in order [N]."""
    torque_lost: bool
    torque: float
    """While it is lost, or not measured, none [N·m]."""
    least_tension: float
    """Of which the current leaves no doubt [N]."""


class RequestedTarget(NamedTuple):
    """Target that law, preflight or a planned motion request of the motor."""

    leads: bool
    """The drive is to follow it: it is enabled, and there is no release."""
    lost: bool
    """It is missing, or out of range."""
    target: float
    """The target to be judged: that which the drive was sent last, where this one is lost or does not lead [rad]."""


class Evidence(NamedTuple):
    """Inputs of the detectors in one cycle."""

    observed: Observed
    state: SupervisorState
    """Target and decision of the cycle before; all else is of this cycle."""
    readings: ValidatedReadings
    effort: Effort
    requested: RequestedTarget
    was_enabled: bool
    """The drive was enabled in the cycle before."""
    dt: float
    """Length of a cycle [s]."""


@kernel
def has_power(mode: Mode) -> bool:
    """True if the drive has power in this mode."""
    return mode != Mode.STOPPED and mode != Mode.LATCHED


@kernel
def most_step(limits: Limits, time: float, dt: float) -> float:
    """Largest change of the target since the last cycle [rad]; a late loop is given five cycles at most."""
    return limits.target_speed * max(dt, min(time, 5.0 * dt))


@kernel
def joint_doubt(limits: Limits, reading: DriveReading) -> float:
    """How far an estimate of the joint's angle may be off; 0 of an encoder [rad]."""
    if not limits.estimates_joint or outside(reading.joint_std, 0.0, limits.joint_std):
        return 0.0
    return DOUBT * reading.joint_std


@kernel
def validate_readings(limits: Limits, state: SupervisorState, observed: Observed, dt: float) -> ValidatedReadings:
    """The angles that are taken for true; without power the motor and the limb may be moved by hand."""
    reading = observed.reading
    clock_wrong = outside(observed.elapsed, 0.05 * dt, limits.clock_gap) or outside(observed.lateness, -dt, BIG)
    time = dt if clock_wrong else observed.elapsed
    age = 0.0 if outside(reading.sample_age, 0.0, BIG) else reading.sample_age
    sampled = max(0.0, time + state.sample_age - age)
    span, filtered = limits.sensor_span, limits.speed_filter
    jump = limits.jump if has_power(state.decided.mode) else BIG
    joint_jump = max(jump, joint_doubt(limits, reading))
    motor = follow(
        state.motor, reading.motor, reading.motor_age == 0.0, sampled, span, jump, limits.motor_speed, filtered
    )
    joint = follow(
        state.joint, reading.joint, reading.joint_age == 0.0, sampled, span, joint_jump, limits.joint_speed, filtered
    )
    return ValidatedReadings(clock_wrong, time, sampled, age, motor, joint)


@kernel
def drive_says(reading: DriveReading, state: DriveState) -> bool:
    """True if the drive says that it is in this state; a number of none is no state."""
    return reading.drive_state == state.value


@kernel
def is_stale(limits: Limits, age: float) -> bool:
    """True if an angle of this age [cycles] is too old."""
    return outside(age, 0.0, limits.reading_age)


@kernel
def model_servo(
    limits: Limits, state: SupervisorState, motor: float, enabled: bool, sampled: float, time: float
) -> ModelledServo:
    """The drive's model one sample later; it stands at the motor until the drive is enabled."""
    before, position, speed = state.servo, motor, 0.0
    if before.enabled:
        position, speed = servo_predict(
            before.position,
            before.speed,
            state.decided.previous_target,
            limits.servo_frequency,
            limits.servo_damping,
            sampled,
        )
    apart = beyond(abs(motor - position), limits.tracking + limits.tracking_lag * abs(speed))
    return ModelledServo(enabled, position, speed, persistence_time(apart, before.tracking_error_time, time))


@kernel
def is_new(value: float, last: float, before: float, still: float) -> bool:
    """True where a reading is neither of its last two values, within `still`; so for what is not a number."""
    return beyond(abs(value - last), still) and beyond(abs(value - before), still)


@kernel
def half_dead_zone(limits: Limits) -> float:
    """Half of the widest dead zone that the cable may have [rad]."""
    return 0.5 * DEAD_SHARE * limits.frozen_travel


@kernel
def stuck_sensor(
    limits: Limits, before: StuckSensorState, reading: float, still: float, motor: float, powered: bool
) -> StuckSensorState:
    """A sensor's sign of life while the motor moves beyond the dead zone; without power nothing is asked of it."""
    half = half_dead_zone(limits)
    if not powered or is_new(reading, before.reading, before.previous_reading, still):
        if outside(reading, -BIG, BIG):
            return StuckSensorState(motor, before.reading, before.previous_reading, -half)
        return StuckSensorState(motor, reading, before.reading, -half)
    behind = max(motor - half, min(motor + half, before.motor))
    travel = before.travel + abs(behind - before.motor)
    return StuckSensorState(behind, before.reading, before.previous_reading, travel)


@kernel
def stuck_current(
    before: StuckCurrentState, current: float, servo: ModelledServo, previous: ModelledServo
) -> StuckCurrentState:
    """The current's sign of life while the drive accelerates."""
    if not servo.enabled or is_new(current, before.reading, before.previous_reading, 0.0):
        if outside(current, -BIG, BIG):
            return StuckCurrentState(before.reading, before.previous_reading, 0.0, 0.0)
        return StuckCurrentState(current, before.reading, 0.0, 0.0)
    return StuckCurrentState(
        before.reading,
        before.previous_reading,
        before.travel + abs(servo.position - previous.position),
        before.speed_change + abs(servo.speed - previous.speed),
    )


@kernel
def measure_effort(limits: Limits, reading: DriveReading, powered: bool) -> Effort:
    """Current, tension and torque. A current that is not known counts as the largest, a tension as the lowest that
    is allowed, a torque as none."""
    current_lost = limits.measures_current and beyond(abs(reading.current), 2.0 * limits.current_peak)
    current, least_tension = 0.0, 0.0
    if limits.measures_current and not current_lost:
        current = abs(reading.current)
        least_tension = -limits.slack_sign * reading.current * limits.pull_gain - limits.pull_doubt
    elif current_lost and powered:
        current = limits.current_peak
    tension_lost = limits.measures_tension and outside(reading.tension, -BIG, BIG)
    torque_lost = limits.measures_torque and outside(reading.joint_torque, -BIG, BIG)
    return Effort(
        current_lost,
        current,
        tension_lost,
        reading.tension if limits.measures_tension and not tension_lost else limits.tension_low,
        torque_lost,
        reading.joint_torque if limits.measures_torque and not torque_lost else 0.0,
        least_tension,
    )


@kernel
def shows_torque(limits: Limits, reading: DriveReading, effort: Effort, motor_speed: float) -> bool:
    """True if the drive has a sign of torque.

    One that says it has none is confirmed by its current; where that is not known, by a motor that does not pull: by
    hand it is turned more slowly, and a limb that sinks turns it the other way.
    """
    if (
        drive_says(reading, DriveState.OPERATION_ENABLED)
        or drive_says(reading, DriveState.QUICK_STOP_ACTIVE)
        or drive_says(reading, DriveState.FAULT_REACTION_ACTIVE)
    ):
        return True
    if is_stale(limits, reading.motor_age):
        return False
    if limits.measures_current and not effort.current_lost:
        return beyond(effort.current, limits.released_current)
    return beyond(-limits.slack_sign * motor_speed, PULLED_SPEED)


@kernel
def judge_request(limits: Limits, state: SupervisorState, requested: float, enabled: bool) -> RequestedTarget:
    """The requested target, as far as it is to be followed."""
    leads = enabled and state.decided.mode != Mode.RELEASING
    lost = leads and outside(requested, limits.motor_low, limits.motor_high)
    return RequestedTarget(leads, lost, requested if leads and not lost else state.target)


@kernel
def watch_neighbour(
    limits: Limits, state: SupervisorState, neighbour: float, motor: SensorState, joint: float, time: float, leads: bool
) -> NeighbourState:
    """How a motor goes with another one on its joint: half of what both are further apart than the joint asks.

    While the other angle is not known nothing is said, which is for its own supervisor to do.
    """
    if not (limits.shared and leads and state.decided.started):
        return NeighbourState(False, 0.0)
    if outside(neighbour, -limits.sensor_span, limits.sensor_span):
        return NeighbourState(state.neighbour.met, 0.0)
    asked_apart = limits.parting_offset + limits.parting_slope * joint
    apart = 0.5 * abs(motor.value - neighbour - asked_apart)
    further = beyond(apart, limits.parting + limits.parting_lag * abs(motor.speed))
    met = state.neighbour.met or not further
    return NeighbourState(met, persistence_time(met and further, state.neighbour.apart_time, time))


@kernel
def off_reference_time(
    limits: Limits, state: SupervisorState, reference: float, joint: float, time: float, leads: bool
) -> float:
    """For how long the joint has been off its reference, while the law leads [s].

    Time near it counts back, so that a joint that swings about it is found too.
    """
    if not (leads and state.decided.started) or outside(reference, -BIG, BIG):
        return 0.0
    off = beyond(abs(joint - reference), limits.off_reference)
    return max(0.0, state.timers.off_reference + (time if off else -time))


@kernel
def gather(limits: Limits, state: SupervisorState, observed: Observed, requested_target: float, dt: float) -> Evidence:
    """All that the detectors look at in this cycle."""
    reading, before = observed.reading, state.timers
    powered, peak = has_power(state.decided.mode), limits.current_peak
    readings = validate_readings(limits, state, observed, dt)
    motor, joint, time = readings.motor.sensor, readings.joint.sensor, readings.time

    # the drive, and what it does
    enabled = powered and (state.servo.enabled or drive_says(reading, DriveState.OPERATION_ENABLED))
    servo = model_servo(limits, state, motor.value, enabled, readings.sampled, time)
    effort = measure_effort(limits, reading, powered)
    heat = warm(limits.thermal, state.heat, effort.current, min(time, 0.1))
    requested = judge_request(limits, state, requested_target, enabled)

    # signs of life
    load = reading.tension if limits.measures_tension else reading.joint_torque
    joint_life = stuck_sensor(limits, state.stuck_joint, joint.value, limits.joint_still, motor.value, powered)
    load_life = stuck_sensor(limits, state.stuck_load, load, 0.0, motor.value, powered)
    current_life = stuck_current(state.stuck_current, reading.current, servo, state.servo)

    # for how long; and sums that forget
    torque_though_off = not powered and shows_torque(limits, reading, effort, motor.speed)
    slack = enabled and beyond(-effort.tension, -limits.tension_low)
    errors = before.bus_errors if bus_errors_unknown(reading) else reading.bus_errors
    new_errors = max(0.0, errors - before.bus_errors)
    timers = Timers(
        persistence_time(beyond(effort.current, peak), before.overload, time),
        persistence_time(beyond(effort.current, limits.saturation * peak), before.saturated, time),
        persistence_time(slack, before.slack, time),
        max(0.0, before.late + max(0.0, time - 1.5 * dt) - 0.02 * time),
        errors,
        max(0.0, min(4.0, before.bus_failures + new_errors) - time),
        persistence_time(powered and not state.decided.started, before.armed, time),
        persistence_time(beyond(effort.least_tension, limits.tension_high), before.strained, time),
        persistence_time(torque_though_off, before.undisabled, time),
        off_reference_time(limits, state, observed.reference, joint.value, time, requested.leads),
    )
    neighbour = watch_neighbour(limits, state, observed.neighbour, motor, joint.value, time, requested.leads)
    now = SupervisorState(
        state.target,
        state.decided,
        servo,
        motor,
        joint,
        joint_life,
        current_life,
        timers,
        heat,
        readings.sample_age,
        load_life,
        neighbour,
    )
    return Evidence(observed, now, readings, effort, requested, state.servo.enabled, dt)


@kernel
def bus_errors_unknown(reading: DriveReading) -> bool:
    """True where the drive's counter of bus errors is no number."""
    return outside(reading.bus_errors, 0.0, BIG * BIG)
