"""The supervisor: it stands last before the wire, knows nothing of laws, and may only refuse or stop.

One cycle is: gather what can be seen (`safety.evidence`), run the detectors (`safety.detectors`), take the worst
reaction of those that their faults ask for (`safety.faults`), and from it the next mode, the power and the target. The
requested target is passed on, or not at all: one that asks for more than range and speed allow is a fault, and what is
sent meanwhile stays within both. A reading is used as it is or not at all.

R1 holds the last target for `bridge_time`, 5 ms or one cycle; R2 lets the joint down, then takes the power off; R3
takes it off at once. A fault that led to R2 or R3 is latched until an operator acknowledges. So, in a run:

joint lost for 3 ms    R1: the mode is BRIDGING until it is back, and the run goes on.
joint lost for 30 ms   R1 for 5 ms, then R2, also when it comes back: RELEASING, at its end LATCHED.
stop in mid-stroke     Like R2, without a fault: RELEASING, at its end STOPPED. The next run begins with a preflight.
drive silent           R3 once its heartbeat is older than `heartbeat_age`: LATCHED. A drive that does not hear that its
                       power is off needs its own watchdog; one that shows torque all the same is NOT_DISABLED.
recorder killed        No reaction: the run goes on. Until it is back nothing is armed, and no run begins.
"""

from bowden.core.kernel import kernel
from bowden.core.signals import DriveReading, Power
from bowden.models.drive.thermal import ThermalState
from bowden.models.plausible import SensorState, outside
from bowden.safety.detectors import run_detectors
from bowden.safety.evidence import Evidence, gather, has_power, most_step
from bowden.safety.faults import AT_ONCE, EVENTUALLY, LATCHING, Fault, Reaction, bits_of, worst_reaction
from bowden.safety.limits import Limits
from bowden.safety.release import OF_FORCE, follow_release, release_target
from bowden.safety.state import (
    Decision,
    Mode,
    ModelledServo,
    NeighbourState,
    Observed,
    PreflightResult,
    Request,
    StuckCurrentState,
    StuckSensorState,
    SupervisorState,
    Timers,
    Verdict,
)

NOT_DISABLED = bits_of((Fault.NOT_DISABLED,))


@kernel
def begin(limits: Limits, reading: DriveReading, warmth: ThermalState) -> SupervisorState:
    """Stopped, with the motor as warm as the last run left it (`models.drive.thermal.rested`)."""
    motor = 0.0 if outside(reading.motor, -limits.sensor_span, limits.sensor_span) else reading.motor
    joint = 0.0 if outside(reading.joint, -limits.sensor_span, limits.sensor_span) else reading.joint
    target = max(limits.motor_low, min(limits.motor_high, motor))
    return SupervisorState(
        target,
        Decision(Mode.STOPPED, False, target, 0.0, 0.0, 0, joint, motor, False, 0.0),
        ModelledServo(False, motor, 0.0, 0.0),
        SensorState(motor, 0.0, 0.0),
        SensorState(joint, 0.0, 0.0),
        StuckSensorState(motor, joint, joint, 0.0),
        StuckCurrentState(0.0, 0.0, 0.0, 0.0),
        Timers(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        warmth,
        0.0,
        StuckSensorState(motor, 0.0, 0.0, 0.0),
        NeighbourState(False, 0.0),
    )


@kernel
def supervise(
    limits: Limits, state: SupervisorState, observed: Observed, requested_target: float, dt: float
) -> tuple[SupervisorState, Verdict]:
    """One cycle of `dt` [s]: the requested target [rad] if nothing speaks against it, power if nothing forbids it."""
    evidence = gather(limits, state, observed, requested_target, dt)
    found = run_detectors(limits, evidence)
    last, now, time, request = state.decided, evidence.state, evidence.readings.time, observed.request
    powered, releasing, enabled = has_power(last.mode), last.mode == Mode.RELEASING, now.servo.enabled

    bridged = bridged_time(limits, last, found, time)
    reaction = reaction_to(limits, last.mode, found, bridged, dt)
    latched = last.latched
    if reaction >= Reaction.R2:
        latched = latched | (found & LATCHING)
    active = latched | found

    starts = request == Request.RUN and observed.preflight == PreflightResult.PASSED and enabled and found == 0
    started = powered and (starts or last.started)
    release_requested = reaction >= Reaction.R2 or request == Request.STOP or releasing
    release = follow_release(limits, last, now, latched, release_requested, releasing, time, dt)
    mode = next_mode(last.mode, request, reaction, started, release.done, latched, active)

    target = next_target(limits, evidence, mode, requested_target, latched)
    at_motor = limits.slack_sign * now.motor.value <= limits.slack_sign * target
    decided = Decision(
        mode,
        started,
        state.target,
        bridged,
        release.time,
        0 if mode == Mode.STOPPED else latched,
        release.joint_at_release,
        release.motor_at_release,
        mode == Mode.RELEASING and (last.target_met_motor or at_motor),
        release.joint_ahead_time,
    )
    return with_decision(now, target, decided), Verdict(
        target, power_in(mode, enabled), mode, reported(mode, reaction), active
    )


@kernel
def bridged_time(limits: Limits, last: Decision, found: int, time: float) -> float:
    """Time in R1 [s]: it grows while any reaction is asked for, and is forgotten slowly, so that a reading that is bad
    in every third cycle stops the run as well."""
    if not has_power(last.mode):
        return 0.0
    if worst_reaction(found, AT_ONCE) != Reaction.NONE:
        return last.bridged_time + time
    return max(0.0, last.bridged_time - limits.bridge_leak * time)


@kernel
def reaction_to(limits: Limits, mode: Mode, found: int, bridged: float, dt: float) -> Reaction:
    """The worst reaction to what was found: of those that the faults ask for at once, while R1 may last.

    Once it has lasted for `bridge_time`, beside a worse reaction, and in a release: of those that they ask for
    eventually. Without power, only a drive that keeps its torque counts: there is nothing else to take away.
    """
    at_once, eventually = worst_reaction(found, AT_ONCE), worst_reaction(found, EVENTUALLY)
    if not has_power(mode):
        return eventually if (found & NOT_DISABLED) != 0 else Reaction.NONE
    if mode == Mode.RELEASING or at_once >= Reaction.R2 or bridged > limits.bridge_time + 0.5 * dt:
        return eventually
    return at_once


@kernel
def next_mode(
    mode: Mode, request: Request, reaction: Reaction, started: bool, released: bool, latched: int, active: int
) -> Mode:
    """The state machine: for each mode the ways out of it, of which the first that is open is taken.

    Args:
        mode: of the cycle before.
        request: of the operator.
        reaction: the worst.
        started: whether the run has begun, by a request that was accepted.
        released: whether a release has come to its end.
        latched: faults that have to be acknowledged.
        active: faults that are active or latched.
    """
    if reaction == Reaction.R3:
        return Mode.LATCHED
    if mode == Mode.STOPPED:
        return Mode.PREFLIGHT if request == Request.ARM and active == 0 else Mode.STOPPED
    if mode == Mode.LATCHED:
        return Mode.STOPPED if request == Request.ACKNOWLEDGE else Mode.LATCHED
    if mode == Mode.RELEASING:
        if not released:
            return Mode.RELEASING
        return Mode.LATCHED if latched != 0 else Mode.STOPPED
    # PREFLIGHT, RUNNING, BRIDGING
    if reaction == Reaction.R2 or request == Request.STOP:
        return Mode.RELEASING
    if reaction == Reaction.R1:
        return Mode.BRIDGING
    return Mode.RUNNING if started else Mode.PREFLIGHT


@kernel
def reported(mode: Mode, reaction: Reaction) -> Reaction:
    """The reaction that is shown: a latch counts as R3, a release as R2, whatever led there."""
    if mode == Mode.LATCHED:
        return Reaction.R3
    return Reaction.R2 if mode == Mode.RELEASING else reaction


@kernel
def power_in(mode: Mode, enabled: bool) -> Power:
    """The drive's power in a mode; there is nothing to release on a drive that is not enabled."""
    if not has_power(mode) or (mode == Mode.RELEASING and not enabled):
        return Power.OFF
    return Power.ON


@kernel
def next_target(limits: Limits, evidence: Evidence, mode: Mode, requested_target: float, latched: int) -> float:
    """Target for the drive [rad]: within the motor's range, and within its speed of the last target.

    Without power, and until the drive is enabled, it follows the motor, so that nothing moves when power comes.
    """
    last_target, motor, time = evidence.state.target, evidence.state.motor, evidence.readings.time
    if mode == Mode.RELEASING:
        by_force = (latched & OF_FORCE) != 0
        aim = release_target(limits, evidence.state.decided.target_met_motor, last_target, motor, by_force, time)
    elif mode == Mode.BRIDGING:
        aim = last_target
    elif evidence.state.servo.enabled and has_power(mode):
        aim = requested_target
    else:
        aim = motor.value
    step = most_step(limits, time, evidence.dt)
    aim = max(last_target - step, min(last_target + step, aim))
    return max(limits.motor_low, min(limits.motor_high, aim))


@kernel
def with_decision(now: SupervisorState, target: float, decided: Decision) -> SupervisorState:
    """The next state: this cycle's evidence and the decision made from it."""
    return SupervisorState(
        target,
        decided,
        now.servo,
        now.motor,
        now.joint,
        now.stuck_joint,
        now.stuck_current,
        now.timers,
        now.heat,
        now.sample_age,
        now.stuck_load,
        now.neighbour,
    )
