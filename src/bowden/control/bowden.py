"""Our law: it learns while it runs how the cable loses motion, and makes up for it ahead of time.

What is learned is what a controller needs of a cable, and nothing else: the slope in each direction, how wide the dead
zone is where the motor turns, and how far the joint lags.

**Plan** (`slot_plan`). The motor follows the reference through 1/slope. Where the reference turns it jumps most of the
dead zone, by minimum jerk, from a little before the turn; the rest is left to the feedback, since a jump too far cannot
be taken back through the dead zone. The plan, whose derivatives are exact, goes through the inverse of the servo, a
delay and a lag ahead.
**Feedback** (`held_feedback`). PI with lead on e = joint − reference, as wide as servo, delay and lag allow. It does
not turn the motor back on a cable with a dead zone, and does not hear the encoder's noise.
**Learning** (`crossing_estimate`, `slope_estimate`). Two Kalman filters of three unknowns each.

Derivation, stability and limits: ``docs/our_law.md``.
"""

from typing import NamedTuple

import numpy as np

from bowden.control.crossing_estimate import CrossingEstimate, crossing_here, first_crossing, watch
from bowden.control.held_feedback import SLIP, Feedback, Setting, answered, listen, no_feedback, steer
from bowden.control.law import Law
from bowden.control.slope_estimate import SlopeEstimate, first_slope, learn_slope
from bowden.control.slot_plan import (
    SlotPlan,
    advance_plan,
    heard_reference,
    planned_motion,
    rest_plan,
    wanted_side,
)
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
    """First guess of the slope, to about ± 40 %; negative where the cable runs the other way [rad/rad]."""
    width: float = 0.0
    """First guess of the dead zone in motor angle; 0 where nothing is known [rad]."""
    doubt: float = 1.0
    """Doubt about the first guesses: 1 where nothing is known, 0.1 where they come from an identified model [–]."""
    feedback: float = 1.1
    """Largest gain of the feedback over ω [–]."""
    most: float = 60.0
    """Largest gain of the feedback [1/s]."""
    budget: float = 0.6
    """Largest gain of the feedback times filter, delay and learned lag [–]."""
    lead: float = 1.0
    """Time of the feedback's lead, times ω [–]."""
    smoothing: float = 0.45
    """Time constant of the error's filter, times ω [–]."""
    quiet: float = 2.2
    """Changes of the feedback that are left alone, in standard deviations of the measured noise [–]."""
    crossing: float = 1.9
    """Time of a jump through the dead zone, times ω [–]."""
    early: float = 0.4
    """Share of that time by which a jump begins before the reference turns [–]."""
    reach: float = 0.95
    """Share of the dead zone that is jumped [–]."""
    worth: float = 0.0008
    """Motion of the reference that is worth a reversal [rad]."""
    tolerance: float = 0.007
    """Error that is worth crossing the dead zone for, if it does not pass by itself [rad]."""
    patience: float = 0.5
    """Time given to an error to pass by itself [s]."""


class BowdenState(NamedTuple):
    """What the law remembers: its plan, its feedback and its two estimates, one after the other."""

    side: float
    slot: float
    since: float
    phase: float
    jump: float
    plan: float
    owed: float
    reference: float
    integral: float
    feedback: float
    error_before: float
    error: float
    slow_error: float
    trust: float
    joint: float
    joint_before: float
    variance: float
    moved_motor: float
    moved_joint: float
    width: float
    wedge: float
    shortfall: float
    w11: float
    w12: float
    w13: float
    w22: float
    w23: float
    w33: float
    touches: float
    heading: float
    far_motor: float
    far_joint: float
    turn_motor: float
    turn_joint: float
    turn_open: float
    free: float
    share: float
    slope_up: float
    slope_down: float
    lag: float
    s11: float
    s12: float
    s13: float
    s22: float
    s23: float
    s33: float
    filtered_motor: float
    filtered_joint: float
    from_motor: float
    from_joint: float
    from_rate: float
    elapsed: float
    origin: float


NARROWEST = 0.012
"""A dead zone below this is followed, not jumped [rad]."""

RECOVERY = 0.006
"""Time in which the feedback comes back after a jump [s]."""

SETTLED = 2.0
"""Durations of a jump after its beginning until what is seen of it counts [–]."""


FASTEST = 50.0
"""Speed beyond which a measured motion of motor or joint is not believed [rad/s]."""


@kernel
def heard_angle(told: float, last: float, most: float) -> float:
    """A measured angle, no further from the last one than can be believed."""
    return np.fmax(last - most, np.fmin(last + most, told))


@kernel
def start(gains: BowdenGains, sample: Sample) -> BowdenState:
    """Begin at rest where the sample is, with the first guesses; the motor's angle counts from there."""
    plan = rest_plan(0.0, sample.joint)
    feedback = no_feedback(0.0, sample.joint, 4e-8)
    crossing = first_crossing(gains.width, gains.doubt, 0.0, sample.joint)
    slope = first_slope(np.abs(gains.slope), gains.doubt, 0.0, sample.joint)
    return BowdenState(*(plan[:] + feedback[:] + crossing[:] + slope[:] + (sample.motor,)))


@kernel
def step(
    gains: BowdenGains, state: BowdenState, sample: Sample, reference: Reference, dt: float
) -> tuple[BowdenState, float]:
    """One cycle: plan, feed back, invert servo, delay and lag, learn."""
    plan, before = SlotPlan(*state[0:8]), Feedback(*state[8:19])
    crossing, slopes = CrossingEstimate(*state[19:37]), SlopeEstimate(*state[37:52])
    sign, omega = np.sign(gains.slope), gains.servo_frequency
    travel = sign * (sample.motor - state.origin)
    seen_both = (np.abs(sample.joint) <= 1e3) * (np.abs(travel) <= 1e3)
    most = FASTEST * dt
    joint = heard_angle(sel(seen_both, sample.joint, before.joint), before.joint, most)
    motor = heard_angle(sel(seen_both, travel, crossing.far_motor), crossing.far_motor, most)
    reference = heard_reference(plan, reference, dt)
    lag = np.fmax(0.0, slopes.lag)
    duration = gains.crossing / omega

    # plan
    width = crossing_here(crossing, motor)
    wide = sel(width > NARROWEST, 1.0, 0.0)
    error = answered(before, motor, sel(seen_both, joint - reference.position, 0.0))
    heard = listen(before, motor, joint, error, 0.5 * gains.smoothing / omega, dt)
    side = wanted_side(
        plan,
        reference,
        wide * 2.0 * gains.early * duration,
        gains.worth,
        heard.slow_error,
        gains.tolerance,
        gains.patience,
        wide,
    )
    slope = sel(side < 0.0, slopes.down, slopes.up)
    plan = advance_plan(plan, reference, side, slope, wide * gains.reach * width, duration, dt)
    asked = planned_motion(plan, reference, slope, duration, gains.delay, lag)
    inverse = asked.position + (2.0 * gains.servo_damping * asked.velocity + asked.acceleration / omega) / omega

    # feedback
    jumping = plan.phase < 1.0
    latency = gains.smoothing / omega + gains.delay + lag
    setting = Setting(
        gain=np.fmin(np.fmin(gains.feedback * omega, gains.most), gains.budget / latency),
        lead=gains.lead / omega,
        smoothing=0.5 * gains.smoothing / omega + dt,
        quiet=gains.quiet,
        recovery=RECOVERY,
    )
    furthest = np.fmax(side * motor, side * slopes.filtered_motor)  # the filtered one, lest it be the noise's
    ahead = sel(jumping, 0.0, side * (inverse + before.feedback) - furthest - SLIP)
    free = np.fmax(np.abs(asked.steady) * dt, ahead)
    held = (wide > 0.5) + (crossing.touches < 1.5) > 0.0  # until it is known, a dead zone is taken for granted
    feedback = steer(heard, setting, error, slope, side, jumping, held, free, dt)
    command = state.origin + sign * (inverse + feedback.feedback)

    # learning
    settled = (plan.since > SETTLED * duration) + (plan.jump == 0.0) > 0.0
    crossing, seen = watch(crossing, motor, joint, slope, np.sqrt(heard.variance), settled)
    slopes = learn_slope(slopes, crossing, seen, motor, joint, np.abs(gains.slope), dt)
    return BowdenState(*(plan[:] + feedback[:] + crossing[:] + slopes[:] + (state.origin,))), command


_ANGLES = (
    *("plan", "owed", "jump", "reference", "integral", "feedback", "error_before", "error", "slow_error", "joint"),
    *("joint_before", "width", "shortfall", "far_motor", "far_joint", "turn_motor", "turn_joint", "free"),
    *("filtered_motor", "filtered_joint", "from_motor", "from_joint"),
    *("moved_motor", "moved_joint", "origin"),
)

BOWDEN = Law(
    name="bowden",
    gains=BowdenGains(),
    start_kernel=start,
    step_kernel=step,
    source="this project, docs/our_law.md",
    presets={"suit": BowdenGains(most=3.0)},  # 12 dB and 60° on the suit, see docs/suit.md
    limits={
        "servo_frequency": (1.0, 1e4),
        "servo_damping": (0.1, 10.0),
        "delay": (0.0, 0.1),
        "width": (0.0, 0.5),
        "doubt": (0.0, 10.0),
        "feedback": (0.0, 5.0),
        "most": (0.0, 1e3),
        "budget": (0.0, 5.0),
        "lead": (0.0, 10.0),
        "smoothing": (0.01, 10.0),
        "quiet": (0.0, 100.0),
        "crossing": (0.5, 100.0),
        "early": (0.0, 1.0),
        "reach": (0.0, 1.0),
        "worth": (0.0, 1.0),
        "tolerance": (1e-6, 1.0),
        "patience": (0.01, 100.0),
    },
    state_units={
        **dict.fromkeys(_ANGLES, "rad"),
        **dict.fromkeys(("since", "lag", "elapsed"), "s"),
        **dict.fromkeys(("wedge", "slope_up", "slope_down"), "rad/rad"),
        "from_rate": "rad/s",
        "variance": "rad²",
    },
)
