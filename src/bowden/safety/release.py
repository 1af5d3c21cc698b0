"""R2: the joint is let down until the cable is just taut, no faster than it may be moved."""

from typing import NamedTuple

from bowden.core.kernel import kernel
from bowden.models.plausible import SensorState, beyond, persistence_time
from bowden.safety.faults import Fault, bits_of
from bowden.safety.limits import Limits
from bowden.safety.state import Decision, SupervisorState

OVERSPEED = 1.1
"""Speed over that of a release at which its target waits: more than a servo's own ripple [–]."""
WAITS = 1.3
"""Time of a release over that without friction: 1.26 at most of 1000 (benchmarks/releases.py) [–]."""
TAUT = 0.05
"""A servo's model so near to where the cable is just taut has let the load down [rad]."""
AHEAD = 0.05
"""Time for which a joint is ahead of the cable before the cable counts as slack [s]."""
OF_JOINT = bits_of(
    (
        Fault.JOINT_LOST,
        Fault.JOINT_JUMP,
        Fault.JOINT_STALE,
        Fault.JOINT_FROZEN,
        Fault.JOINT_MOTOR_MISMATCH,
        Fault.JOINT_UNSURE,
    )
)
"""Faults by which the joint's angle is in doubt."""
OF_FORCE = bits_of((Fault.SATURATED,))
"""Faults of a force that R2 ends."""


@kernel
def steepest(limits: Limits) -> float:
    """The most that the joint moves by per motor angle [rad/rad]."""
    return max(-limits.slope_low, limits.slope_high)  # the smaller one may be below zero


@kernel
def release_speed(limits: Limits, by_force: bool) -> float:
    """Speed of the target in R2, at which the joint is no faster than it may be on the cable's steepest slope [rad/s].

    Args:
        limits: of the rig.
        by_force: whether the cause is a force.
    """
    return (limits.force_release if by_force else limits.lowering) / steepest(limits)


@kernel
def release_target(
    limits: Limits, target_met_motor: bool, target: float, motor: SensorState, by_force: bool, time: float
) -> float:
    """The motor's next target in R2 [rad]: let down at `release_speed`, to where the cable is just taut.

    It begins at the target, or at a motor that could not pull as far. Once the target has been where the motor is, a
    load that drags the motor on is braked, and not gone after. Where friction lets go of the motor, it would run after
    the target: that waits at the motor until it is slow again.

    Args:
        limits: of the rig.
        target_met_motor: whether the target of this release has been where the motor is.
        target: what the drive was sent last [rad].
        motor: as it is measured.
        by_force: whether the cause is a force.
        time: since the cycle before [s].
    """
    out, speed = limits.slack_sign, release_speed(limits, by_force)
    begin = out * target
    if not target_met_motor:
        begin = max(begin, out * motor.value)
    lowered = max(begin, min(out * limits.taut, begin + speed * min(time, 0.1)))
    if beyond(out * motor.speed, OVERSPEED * speed):
        lowered = min(lowered, out * motor.value)
    return out * lowered


@kernel
def longest_release(limits: Limits) -> float:
    """How long R2 may last [s]: from the end of the motor's range to where the cable is just taut."""
    pulled = max(-limits.slack_sign * limits.motor_low, -limits.slack_sign * limits.motor_high)
    return limits.release_time + WAITS * (pulled + limits.slack_sign * limits.taut) / release_speed(limits, False)


class Release(NamedTuple):
    """How far a release is; of this cycle, in which none may have been asked for."""

    time: float
    """For which one has been asked for [s]."""
    joint_at_release: float
    """[rad]"""
    motor_at_release: float
    """[rad]"""
    joint_ahead_time: float
    """[s]"""
    done: bool
    """Nothing is left to let down, or its time is over."""


@kernel
def follow_release(
    limits: Limits,
    last: Decision,
    seen: SupervisorState,
    latched: int,
    requested: bool,
    releasing: bool,
    time: float,
    dt: float,
) -> Release:
    """How far a release is.

    It lasts until the servo's model is where the cable is just taut, or the joint has left the cable behind; and no
    longer than the whole way takes.

    Args:
        limits: of the rig.
        last: what was decided in the cycle before.
        seen: what this cycle shows.
        latched: the faults that are latched in this cycle.
        requested: whether a release is requested, or goes on.
        releasing: whether it goes on.
        time: since the cycle before [s].
        dt: length of a cycle [s].
    """
    joint, motor, out = seen.joint.value, seen.motor.value, limits.slack_sign
    released = persistence_time(requested, last.release_time, time)
    joint_at_release = last.joint_at_release if releasing else joint
    motor_at_release = last.motor_at_release if releasing else motor

    # a cable that the joint has left behind since R2 began carries nothing, if the joint's angle is valid:
    # it is not in doubt, it moves, and one that was wrong by as much before says nothing
    leads = out * (limits.slope_high * motor - joint)
    grown = leads - out * (limits.slope_high * motor_at_release - joint_at_release)
    behind = beyond(leads, 0.5 * limits.play) and beyond(grown, 0.5 * limits.play)
    moves = beyond(abs(joint - joint_at_release), limits.joint_still)
    joint_credible = (latched & OF_JOINT) == 0
    ahead = persistence_time(behind and moves and joint_credible, last.joint_ahead_time, min(time, 5.0 * dt))

    carries = beyond(out * (limits.taut - seen.servo.position), TAUT) and not beyond(ahead, AHEAD)
    longest = longest_release(limits) if carries else limits.release_time
    done = released > longest - 0.5 * dt or not seen.servo.enabled
    return Release(released, joint_at_release, motor_at_release, ahead, done)
