"""Our law: an inverse of the cable that is learned while it runs, with the servo's lag and the delay fed forward.

The cable is seen as a slot between two lines, which covers play, Bouc–Wen and soft friction loops alike:

    joint = a·motor + b·η + o,    dη/d(motor) = −k/b inside the slot, |η| ≤ 1

a is the slope, b half the loop's height, k how fast the hysteresis takes up its height (k = a is pure play, k > a a
cable that first moves the wrong way, k < a a soft one), o the offset.

**Inverse.** The motor should be at (reference − o + b·q)/a; `slot_plan` says where q should be. A cable with k ≥ 0.8·a
is *jumped* when the reference turns; a softer one is *followed*.
**Servo and delay.** The plan, whose derivatives are exact, goes through the inverse of the servo, a delay ahead.
**Feedback.** PI with lead on e = joint − reference. Inside the slot of a jumped cable the joint moves the wrong way:
there the feedback may slow the motor down but never turn it back.
**Learning.** `cable_estimate`, while it runs. Derivation, stability and limits: ``docs/our_law.md``.
"""

from typing import NamedTuple

import numpy as np

from bowden.control.cable_estimate import CableEstimate, first_guess, learn
from bowden.control.law import Law
from bowden.control.slot_plan import SlotPlan, followed, jumped, wanted_side
from bowden.core.kernel import kernel, sel
from bowden.core.signals import Reference, Sample


class BowdenGains(NamedTuple):
    """What the law is told; the defaults are for the paper's bench, of whose cable it knows nothing."""

    servo_frequency: float = 53.6
    """ω, natural frequency of the servo, to about ± 20 % [rad/s]."""
    servo_damping: float = 1.0
    """ζ of the servo [–]."""
    delay: float = 0.0015
    """From a sample to the middle of the time for which its command is held [s]."""
    slope: float = 1.0
    """First guess of a, to about ± 40 %; negative where the cable runs the other way [rad/rad]."""
    height: float = 0.0
    """First guess of b [rad]."""
    steepness: float = 1.0
    """First guess of k/a [–]."""
    doubt: float = 1.0
    """Doubt about the first guess: 1 where nothing is known, 0.1 where it comes from an identified model [–]."""
    feedback: float = 0.19
    """Integral gain on a jumped cable over ω, but no more than 10/s [–]."""
    soft_feedback: float = 0.37
    """The same on a followed cable, but no more than 20/s [–]."""
    lead: float = 0.8
    """Time of the lead and of the error's filter, times ω [–]."""
    crossing: float = 3.0
    """Time for jumping the slot, times ω [–]."""
    early: float = 0.5
    """Share of that time by which a jump begins before the reference turns [–]."""
    least_speed: float = 0.01
    """Slower references do not decide on a side [rad/s]."""
    tolerance: float = 0.007
    """Error that is worth crossing the slot for, if it does not pass by itself [rad]."""
    patience: float = 0.5
    """Time given to an error to pass by itself [s]."""
    wander: float = 0.05
    """Standard deviation by which a and b may change in one radian of motor travel [1 and rad per √rad]."""
    noise: float = 0.002
    """Standard deviation of what the model does not explain [rad]."""


class BowdenState(NamedTuple):
    """What the law remembers."""

    integral: float
    """Integral part of the feedback, in joint angle [rad]."""
    feedback: float
    """Feedback in motor angle [rad]."""
    error: float
    """Filtered error [rad]."""
    slow_error: float
    """Error behind a filter of 50 ms [rad]."""
    trust: float
    """0 during a jump, rising to 1 after it; the feedback acts as far as it is trusted [–]."""
    side: float
    """Side of the slot that is wanted: +1 while the joint rises, −1 while it falls [–]."""
    slot: float
    """q, the planned place in the slot [–]."""
    slot_from: float
    """q where the present jump began [–]."""
    phase: float
    """Share of the present jump that is done [–]."""
    slope: float
    """a [rad/rad]."""
    height: float
    """b [rad]."""
    offset: float
    """o [rad]."""
    steepness: float
    """k [rad/rad]."""
    p11: float
    p12: float
    p13: float
    p22: float
    p23: float
    p33: float
    hysteresis: float
    """η as the measured motor's travel makes it [–]."""
    motor: float
    """Motor angle at the last step of travel [rad]."""
    joint: float
    """Joint angle there [rad]."""
    heading: float
    """Direction of the last step of travel [–]."""
    travel: float
    """Travel since the motor turned [rad]."""
    turn_motor: float
    """Motor angle where it turned [rad]."""
    turn_joint: float
    """Joint angle there [rad]."""
    turn_open: float
    """1 while that reversal can still tell k [–]."""


@kernel
def believed(state: BowdenState) -> CableEstimate:
    """The cable's part of the state."""
    return CableEstimate(
        slope=state.slope,
        height=state.height,
        offset=state.offset,
        steepness=state.steepness,
        p11=state.p11,
        p12=state.p12,
        p13=state.p13,
        p22=state.p22,
        p23=state.p23,
        p33=state.p33,
        hysteresis=state.hysteresis,
        motor=state.motor,
        joint=state.joint,
        heading=state.heading,
        travel=state.travel,
        turn_motor=state.turn_motor,
        turn_joint=state.turn_joint,
        turn_open=state.turn_open,
    )


@kernel
def remembered(
    integral: float,
    feedback: float,
    error: float,
    slow_error: float,
    trust: float,
    side: float,
    slot: float,
    slot_from: float,
    phase: float,
    cable: CableEstimate,
) -> BowdenState:
    """The state, flat, from its own part and the cable's."""
    return BowdenState(
        integral=integral,
        feedback=feedback,
        error=error,
        slow_error=slow_error,
        trust=trust,
        side=side,
        slot=slot,
        slot_from=slot_from,
        phase=phase,
        slope=cable.slope,
        height=cable.height,
        offset=cable.offset,
        steepness=cable.steepness,
        p11=cable.p11,
        p12=cable.p12,
        p13=cable.p13,
        p22=cable.p22,
        p23=cable.p23,
        p33=cable.p33,
        hysteresis=cable.hysteresis,
        motor=cable.motor,
        joint=cable.joint,
        heading=cable.heading,
        travel=cable.travel,
        turn_motor=cable.turn_motor,
        turn_joint=cable.turn_joint,
        turn_open=cable.turn_open,
    )


@kernel
def start(gains: BowdenGains, sample: Sample) -> BowdenState:
    """Begin at rest where the sample is, with the first guess of the cable."""
    sign = np.sign(gains.slope)
    cable = first_guess(
        np.abs(gains.slope), gains.height, gains.steepness, gains.doubt, sample.joint, sign * sample.motor
    )
    return remembered(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, cable)


@kernel
def step(
    gains: BowdenGains, state: BowdenState, sample: Sample, reference: Reference, dt: float
) -> tuple[BowdenState, float]:
    """One cycle: plan the slot, feed back, invert cable, servo and delay, learn."""
    sign = np.sign(gains.slope)
    motor = sign * sample.motor
    a, b, k = state.slope, state.height, state.steepness
    height = np.fmax(b, 0.002)
    soft = (k < 0.8 * a) * (b > 0.004)
    omega = gains.servo_frequency
    crossing_time = gains.crossing / omega

    error = sample.joint - reference.position
    follow = dt / (gains.lead / omega + dt)
    filtered = state.error + (error - state.error) * follow
    error_rate = (error - state.error) * follow / dt
    slow_error = state.slow_error + (error - state.slow_error) * dt / 0.05

    settled = (state.trust >= 1.0) * (soft < 0.5)
    side = wanted_side(
        state.side,
        slow_error,
        reference,
        gains.early * crossing_time,
        gains.least_speed,
        gains.tolerance,
        gains.patience,
        settled,
    )
    before = SlotPlan(state.side, state.slot, state.slot_from, state.phase, 0.0, 0.0)
    jump = jumped(before, side, crossing_time, dt)
    follow_on = followed(before, side, k / (height * np.fmax(a - k, 0.1 * a)), reference, dt)
    slot = sel(soft, follow_on.slot, jump.slot)
    slot_from = sel(soft, follow_on.slot_from, jump.slot_from)
    phase = sel(soft, follow_on.phase, jump.phase)
    slot_rate = sel(soft, follow_on.rate, jump.rate)
    slot_growth = sel(soft, follow_on.growth, jump.growth)

    # feedback, which may not turn the motor back inside a slot that is jumped
    trust = sel(phase < 1.0, 0.0, np.fmin(1.0, state.trust + dt / 0.05))
    kappa = sel(soft, np.fmin(gains.soft_feedback * omega, 20.0), np.fmin(gains.feedback * omega, 10.0))
    integral = state.integral + sel(trust >= 1.0, kappa * error * dt, 0.0)
    lead = gains.lead / omega
    wish = -(integral + kappa * trust * (2.0 * lead * filtered + lead * lead * error_rate)) / a
    allowed = np.abs(reference.velocity + b * slot_rate) / a * dt
    change = wish - state.feedback
    held = state.feedback + sel(side > 0.0, np.fmax(change, -allowed), np.fmin(change, allowed))
    feedback = sel((np.abs(side) > 0.5) * (soft < 0.5), held, wish)
    integral = sel(feedback == wish, integral, state.integral)

    # inverse of the cable, the servo and the delay
    ahead_of = gains.delay
    plan = reference.position + ahead_of * reference.velocity + b * (slot + ahead_of * slot_rate) - state.offset
    plan_rate = reference.velocity + ahead_of * reference.acceleration + b * slot_rate
    plan_growth = reference.acceleration + b * slot_growth
    servo = plan + 2.0 * gains.servo_damping / omega * plan_rate + plan_growth / (omega * omega)
    command = sign * (servo / a + feedback)

    calm = sel(phase >= 1.0, 1.0, 0.0)
    cable = learn(believed(state), motor, sample.joint, gains.wander, gains.noise, np.abs(gains.slope), calm)
    after = remembered(integral, feedback, filtered, slow_error, trust, side, slot, slot_from, phase, cable)
    return after, command


BOWDEN = Law(
    name="bowden",
    gains=BowdenGains(),
    start_kernel=start,
    step_kernel=step,
    source="this project, docs/our_law.md",
    limits={
        "servo_frequency": (1.0, 1e4),
        "servo_damping": (0.1, 10.0),
        "delay": (0.0, 0.1),
        "height": (0.0, 0.2),
        "steepness": (0.2, 2.0),
        "doubt": (0.0, 10.0),
        "feedback": (0.0, 1.0),
        "soft_feedback": (0.0, 1.0),
        "lead": (0.0, 10.0),
        "crossing": (0.5, 100.0),
        "early": (0.0, 1.0),
        "least_speed": (0.0, 10.0),
        "tolerance": (1e-6, 1.0),
        "patience": (0.01, 100.0),
        "wander": (0.0, 10.0),
        "noise": (1e-6, 1.0),
    },
    state_units={
        "integral": "rad",
        "feedback": "rad",
        "error": "rad",
        "slow_error": "rad",
        **dict.fromkeys(("height", "offset", "motor", "joint", "travel", "turn_motor", "turn_joint"), "rad"),
        **dict.fromkeys(("slope", "steepness"), "rad/rad"),
    },
)
