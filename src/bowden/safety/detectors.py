"""Fault detectors: a small function for each fault, and the table that calls them all.

Each takes the limits and what one cycle shows, and says True where its fault is there. What happens then stands in the
table of `safety.faults`. A limit is written so that what is not a number is beyond it (`models.plausible`).
"""

from bowden.core.kernel import kernel
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.models.plausible import beyond, outside
from bowden.safety.evidence import (
    BIG,
    Evidence,
    bus_errors_unknown,
    drive_says,
    half_dead_zone,
    has_power,
    is_stale,
    joint_doubt,
    most_step,
)
from bowden.safety.faults import Fault, Reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, PreflightResult

SWING = 1.0
"""Changes of speed that no motor makes at one and the same current [rad/s]."""
REST, FURTHER = 0.35, 0.1
"""A joint so far to the slack side of where the cable is just taut, and so much further than when R2 began, is pulled
[rad]."""


@kernel
def run_detectors(limits: Limits, seen: Evidence) -> int:
    """Every fault that is there in this cycle, a bit each."""
    return (
        bit(Fault.JOINT_LOST, joint_lost(seen))
        | bit(Fault.JOINT_JUMP, joint_jumps(seen))
        | bit(Fault.JOINT_STALE, joint_stale(limits, seen))
        | bit(Fault.JOINT_FROZEN, joint_frozen(limits, seen))
        | bit(Fault.JOINT_MOTOR_MISMATCH, joint_motor_mismatch(limits, seen))
        | bit(Fault.JOINT_OVER_TRAVEL, joint_over_travel(limits, seen))
        | bit(Fault.JOINT_OVER_SPEED, joint_over_speed(limits, seen))
        | bit(Fault.MOTOR_LOST, motor_lost(seen))
        | bit(Fault.MOTOR_JUMP, motor_jumps(seen))
        | bit(Fault.MOTOR_STALE, motor_stale(limits, seen))
        | bit(Fault.NOT_FOLLOWING, not_following(limits, seen))
        | bit(Fault.MOTOR_OVER_TRAVEL, motor_over_travel(limits, seen))
        | bit(Fault.MOTOR_OVER_SPEED, motor_over_speed(limits, seen))
        | bit(Fault.CURRENT_LOST, current_lost(seen))
        | bit(Fault.OVER_CURRENT, over_current(limits, seen))
        | bit(Fault.SATURATED, saturated(limits, seen))
        | bit(Fault.I2T, peak_for_too_long(limits, seen))
        | bit(Fault.MOTOR_HOT, motor_hot(limits, seen))
        | bit(Fault.DRIVE_HOT, drive_hot(limits, seen))
        | bit(Fault.TENSION_LOST, tension_lost(seen))
        | bit(Fault.OVER_TENSION, over_tension(limits, seen))
        | bit(Fault.SLACK, slack(limits, seen))
        | bit(Fault.HEARTBEAT_LOST, heartbeat_lost(limits, seen))
        | bit(Fault.NOT_ENABLED, not_enabled(limits, seen))
        | bit(Fault.DRIVE_DROPPED, drive_dropped(seen))
        | bit(Fault.DRIVE_FAULT, drive_fault(seen))
        | bit(Fault.EMERGENCY, emergency(seen))
        | bit(Fault.BUS_ERRORS, bus_errors(limits, seen))
        | bit(Fault.LATE, late(limits, seen))
        | bit(Fault.CLOCK, clock_wrong(seen))
        | bit(Fault.TARGET_LOST, target_lost(seen))
        | bit(Fault.TARGET_STEP, target_jumps(limits, seen))
        | bit(Fault.TARGET_TOO_FAR, target_too_far(limits, seen))
        | bit(Fault.TARGET_TOO_HARD, target_too_hard(limits, seen))
        | bit(Fault.OPERATOR_LOST, operator_lost(limits, seen))
        | bit(Fault.PREFLIGHT_FAILED, preflight_failed(limits, seen))
        | bit(Fault.RECORDER_LOST, recorder_lost(seen))
        | bit(Fault.EMG_LOST, emg_lost(limits, seen))
        | bit(Fault.NOT_DISABLED, not_disabled(limits, seen))
        | bit(Fault.SECOND_MASTER, second_master(seen))
        | bit(Fault.EMERGENCY_STOP, emergency_stop(seen))
        | bit(Fault.CURRENT_STUCK, current_stuck(limits, seen))
        | bit(Fault.RELEASE_PULLS, release_pulls(limits, seen))
        | bit(Fault.OTHER_RELEASED, other_released(seen))
        | bit(Fault.OTHER_OFF, other_off(seen))
        | bit(Fault.TORQUE_LOST, torque_lost(seen))
        | bit(Fault.OVER_TORQUE, over_torque(limits, seen))
        | bit(Fault.LOAD_STUCK, load_stuck(limits, seen))
        | bit(Fault.MOTORS_APART, motors_apart(limits, seen))
        | bit(Fault.JOINT_OFF_REFERENCE, joint_off_reference(limits, seen))
        | bit(Fault.JOINT_UNSURE, joint_unsure(limits, seen))
    )


@kernel
def bit(fault: Fault, found: bool) -> int:
    """The fault's bit where it is found, else none."""
    return 1 << fault if found else 0


# the joint's angle


@kernel
def joint_lost(seen: Evidence) -> bool:
    """The joint's angle is missing, or larger than an encoder can show."""
    return seen.readings.joint.lost


@kernel
def joint_jumps(seen: Evidence) -> bool:
    """The joint's angle is further from the last good one than noise and its largest speed explain."""
    return seen.readings.joint.jumped


@kernel
def joint_stale(limits: Limits, seen: Evidence) -> bool:
    """The joint's angle is older than it may be."""
    return is_stale(limits, seen.observed.reading.joint_age)


@kernel
def joint_frozen(limits: Limits, seen: Evidence) -> bool:
    """The joint's angle has not changed, although the motor has moved further than the cable's dead zone."""
    return beyond(seen.state.stuck_joint.travel, limits.frozen_travel - 2.0 * half_dead_zone(limits))


@kernel
def joint_motor_mismatch(limits: Limits, seen: Evidence) -> bool:
    """The joint is where the cable, with any of its slopes and its play, cannot have it."""
    flat, steep = limits.slope_low * seen.state.motor.value, limits.slope_high * seen.state.motor.value
    play = limits.play + joint_doubt(limits, seen.observed.reading)
    return outside(seen.state.joint.value, min(flat, steep) - play, max(flat, steep) + play)


@kernel
def joint_over_travel(limits: Limits, seen: Evidence) -> bool:
    """The joint is beyond its range."""
    return outside(seen.state.joint.value, limits.joint_low, limits.joint_high)


@kernel
def joint_over_speed(limits: Limits, seen: Evidence) -> bool:
    """The joint is too fast."""
    return beyond(abs(seen.state.joint.speed), limits.joint_speed)


@kernel
def joint_off_reference(limits: Limits, seen: Evidence) -> bool:
    """The joint has been off its reference for too long."""
    return beyond(seen.state.timers.off_reference, limits.off_reference_time)


@kernel
def joint_unsure(limits: Limits, seen: Evidence) -> bool:
    """The joint's angle is an estimate, and its standard deviation too large or unknown."""
    return limits.estimates_joint and beyond(seen.observed.reading.joint_std, limits.joint_std)


# the motor's angle


@kernel
def motor_lost(seen: Evidence) -> bool:
    """The motor's angle is missing, or larger than an encoder can show."""
    return seen.readings.motor.lost


@kernel
def motor_jumps(seen: Evidence) -> bool:
    """The motor's angle is further from the last good one than noise and its largest speed explain."""
    return seen.readings.motor.jumped


@kernel
def motor_stale(limits: Limits, seen: Evidence) -> bool:
    """The motor's angle is older than it may be."""
    return is_stale(limits, seen.observed.reading.motor_age)


@kernel
def not_following(limits: Limits, seen: Evidence) -> bool:
    """The motor has been away from its servo's model for too long."""
    return beyond(seen.state.servo.tracking_error_time, limits.tracking_time)


@kernel
def motor_over_travel(limits: Limits, seen: Evidence) -> bool:
    """The motor is beyond its range."""
    margin = limits.motor_margin
    return outside(seen.state.motor.value, limits.motor_low - margin, limits.motor_high + margin)


@kernel
def motor_over_speed(limits: Limits, seen: Evidence) -> bool:
    """The motor is too fast."""
    return beyond(abs(seen.state.motor.speed), limits.motor_speed)


@kernel
def motors_apart(limits: Limits, seen: Evidence) -> bool:
    """Two motors on one joint have been further apart than the joint asks, for too long."""
    return beyond(seen.state.neighbour.apart_time, limits.slack_time)


# current, heat, load


@kernel
def current_lost(seen: Evidence) -> bool:
    """The current is missing, or twice what it can be."""
    return seen.effort.current_lost


@kernel
def over_current(limits: Limits, seen: Evidence) -> bool:
    """The current has been beyond its peak for too long."""
    return beyond(seen.state.timers.overload, limits.current_time)


@kernel
def saturated(limits: Limits, seen: Evidence) -> bool:
    """The drive has been at its limit for too long."""
    return beyond(seen.state.timers.saturated, limits.saturation_time)


@kernel
def peak_for_too_long(limits: Limits, seen: Evidence) -> bool:
    """The sum of I²t is what the peak gives, from a start at rest, in the time that it may last."""
    peak, continuous = limits.current_peak, limits.thermal.continuous_current
    return beyond(seen.state.heat.i2t, (peak * peak - continuous * continuous) * limits.i2t_time)


@kernel
def motor_hot(limits: Limits, seen: Evidence) -> bool:
    """The motor's winding or housing is too warm, by its model."""
    heat = seen.state.heat
    return outside(heat.winding, -BIG, limits.winding_limit) or outside(heat.housing, -BIG, limits.housing_limit)


@kernel
def drive_hot(limits: Limits, seen: Evidence) -> bool:
    """The drive is too warm, or does not say how warm it is, where it measures that."""
    return limits.measures_temperature and outside(seen.observed.reading.temperature, -BIG, limits.drive_limit)


@kernel
def current_stuck(limits: Limits, seen: Evidence) -> bool:
    """The current has not changed, although the motor has moved and changed its speed."""
    stuck = seen.state.stuck_current
    in_motion = beyond(stuck.travel, limits.frozen_travel) and beyond(stuck.speed_change, SWING)
    return limits.measures_current and seen.state.decided.mode != Mode.RELEASING and in_motion


@kernel
def tension_lost(seen: Evidence) -> bool:
    """The tension is missing, or no number that it can be."""
    return seen.effort.tension_lost


@kernel
def over_tension(limits: Limits, seen: Evidence) -> bool:
    """The cable pulls too hard: as measured, or, for too long, as its current leaves no doubt of."""
    by_current = beyond(seen.state.timers.strained, limits.saturation_time)
    return beyond(seen.effort.tension, limits.tension_high) or by_current


@kernel
def slack(limits: Limits, seen: Evidence) -> bool:
    """The cable has been slack for too long."""
    return beyond(seen.state.timers.slack, limits.slack_time)


@kernel
def torque_lost(seen: Evidence) -> bool:
    """The joint's torque is missing, or no number that it can be."""
    return seen.effort.torque_lost


@kernel
def over_torque(limits: Limits, seen: Evidence) -> bool:
    """There is too much torque on the joint."""
    return beyond(abs(seen.effort.torque), limits.torque_high)


@kernel
def load_stuck(limits: Limits, seen: Evidence) -> bool:
    """The load cell has not changed, although the motor has moved further than the cable's dead zone."""
    measured = limits.measures_tension or limits.measures_torque
    unanswered = beyond(seen.state.stuck_load.travel, limits.frozen_travel - 2.0 * half_dead_zone(limits))
    return measured and seen.state.decided.mode != Mode.RELEASING and unanswered


# the drive and its bus


@kernel
def heartbeat_lost(limits: Limits, seen: Evidence) -> bool:
    """The drive has been silent for too long."""
    return outside(seen.observed.reading.heartbeat_age, 0.0, limits.heartbeat_age)


@kernel
def not_enabled(limits: Limits, seen: Evidence) -> bool:
    """The drive is still not enabled, so long after arming."""
    return not seen.state.servo.enabled and beyond(seen.state.timers.armed, limits.enable_time)


@kernel
def drive_dropped(seen: Evidence) -> bool:
    """The drive was enabled, and has left that state by itself, without a fault of its own."""
    enabled = drive_says(seen.observed.reading, DriveState.OPERATION_ENABLED)
    return has_power(seen.state.decided.mode) and seen.was_enabled and not enabled and not drive_fault(seen)


@kernel
def drive_fault(seen: Evidence) -> bool:
    """The drive is in fault."""
    reading = seen.observed.reading
    return drive_says(reading, DriveState.FAULT_REACTION_ACTIVE) or drive_says(reading, DriveState.FAULT)


@kernel
def emergency(seen: Evidence) -> bool:
    """The drive has sent an error code by itself; a code that is not a number is one."""
    return seen.observed.reading.emergency != 0.0 and not emergency_stop(seen)


@kernel
def emergency_stop(seen: Evidence) -> bool:
    """The emergency stop is pressed, or the drive's safe torque off is on."""
    return seen.observed.reading.emergency == EMERGENCY_STOP


@kernel
def not_disabled(limits: Limits, seen: Evidence) -> bool:
    """The drive has had a sign of torque for too long, although its power is off."""
    return beyond(seen.state.timers.undisabled, limits.disable_time)


@kernel
def bus_errors(limits: Limits, seen: Evidence) -> bool:
    """Too many frames of late could not be sent, or their counter is no number."""
    return bus_errors_unknown(seen.observed.reading) or beyond(seen.state.timers.bus_failures, limits.bus_errors)


@kernel
def second_master(seen: Evidence) -> bool:
    """Somebody else has sent frames that this host alone may send; a count that is not a number is one."""
    return seen.observed.reading.foreign != 0.0


# the loop and its clock


@kernel
def late(limits: Limits, seen: Evidence) -> bool:
    """This cycle is too late, or the last ones together are."""
    if seen.readings.clock_wrong:
        return False
    return beyond(seen.observed.lateness, limits.lateness) or beyond(seen.state.timers.late, limits.lateness)


@kernel
def clock_wrong(seen: Evidence) -> bool:
    """The clock stepped: the time between two cycles cannot be, or a cycle began too early."""
    return seen.readings.clock_wrong


# the requested target


@kernel
def target_lost(seen: Evidence) -> bool:
    """The requested target is missing, or out of the motor's range."""
    return seen.requested.lost


@kernel
def target_jumps(limits: Limits, seen: Evidence) -> bool:
    """The requested target is further from the last one than its speed allows."""
    step = abs(seen.requested.target - seen.state.target)
    return beyond(step, most_step(limits, seen.readings.time, seen.dt))


@kernel
def target_too_far(limits: Limits, seen: Evidence) -> bool:
    """The requested target is too far from the motor."""
    return seen.requested.leads and beyond(abs(seen.requested.target - seen.state.motor.value), limits.target_reach)


@kernel
def target_too_hard(limits: Limits, seen: Evidence) -> bool:
    """The requested target would accelerate the servo's model too much."""
    servo, omega, zeta = seen.state.servo, limits.servo_frequency, limits.servo_damping
    acceleration = omega * (omega * (seen.requested.target - servo.position) - 2.0 * zeta * servo.speed)
    return seen.requested.leads and beyond(abs(acceleration), limits.acceleration)


# operator, preflight, recorder, EMG, release


@kernel
def operator_lost(limits: Limits, seen: Evidence) -> bool:
    """The operator's process has given no sign of life for too long."""
    return outside(seen.observed.operator_age, -1.0, limits.operator_age)


@kernel
def preflight_failed(limits: Limits, seen: Evidence) -> bool:
    """The preflight has failed, or the motor has had power for too long without a run."""
    waits = has_power(seen.state.decided.mode) and not seen.state.decided.started
    failed = seen.observed.preflight == PreflightResult.FAILED
    return waits and (failed or beyond(seen.state.timers.armed, limits.preflight_time))


@kernel
def recorder_lost(seen: Evidence) -> bool:
    """Nothing is recorded."""
    return not seen.observed.recorder


@kernel
def emg_lost(limits: Limits, seen: Evidence) -> bool:
    """The newest EMG sample is too old, in a run by EMG."""
    return limits.uses_emg and outside(seen.observed.emg_age, -1.0, limits.emg_age)


@kernel
def release_pulls(limits: Limits, seen: Evidence) -> bool:
    """A release pulls: the joint goes beyond where the cable is just taut, on a rig that knows where that is."""
    decided, joint = seen.state.decided, seen.state.joint.value
    if not limits.homed or decided.mode != Mode.RELEASING:
        return False
    taut = limits.slack_sign * limits.taut
    way = limits.slack_sign * joint - max(limits.slope_low * taut, limits.slope_high * taut)
    return beyond(way, REST) and beyond(limits.slack_sign * (joint - decided.joint_at_release), FURTHER)


# other motors of the rig


@kernel
def other_released(seen: Evidence) -> bool:
    """A fault of another motor asks for R2."""
    return seen.observed.others == Reaction.R2


@kernel
def other_off(seen: Evidence) -> bool:
    """A fault of another motor asks for R3."""
    return seen.observed.others == Reaction.R3
