"""Our law: it learns while it runs how the cable loses motion, and makes up for it ahead of time.

What is learned is what a controller needs of a cable, and nothing else: the slope in each direction, how wide the dead
zone is where the motor turns, and how far the joint lags.

**Plan** (`slot_plan`). The motor follows the reference through 1/slope. Where the reference turns it jumps most of the
dead zone, by minimum jerk, from a little before the turn; the rest is left to the feedback, since a jump too far cannot
be taken back through the dead zone. The plan, whose derivatives are exact, goes through the inverse of the servo, a
delay and a lag ahead.
**Feedback** (`held_feedback`). PI with lead on e = joint − reference, as wide as servo, delay and lag allow. It does
not turn the motor back on a cable with a dead zone, and does not hear the encoder's noise. Where the joint is known not
to run the wrong way in the dead zone it is wider there, and in slow motion it turns the motor without waiting.
**Ahead** (`foreseen_side`, on the suit). Where a stroke ends, the dead zone is crossed before the next begins: jumped
in part, sought in the rest until the joint is seen to move; there the motor is held.
**Learning** (`crossing_estimate`, `slope_estimate`). Two Kalman filters of three unknowns each.

Derivation, stability and limits: ``docs/our_law.md``.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.control.our_law.crossing_estimate import CrossingEstimate, crossing_from, first_crossing, harmless, watch
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.held_feedback import LOST, SLIP, Feedback, Setting, answered, listen, no_feedback, steer
from bowden.control.our_law.slope_estimate import SlopeEstimate, first_slope, learn_slope
from bowden.control.our_law.slot_plan import (
    SlotPlan,
    advance_plan,
    foreseen_side,
    foreseen_way,
    heard_reference,
    planned_motion,
    rest_plan,
    wanted_side,
)
from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS


class BowdenState(NamedTuple):
    """What the law remembers: its plan, its feedback and its two estimates."""

    plan: SlotPlan
    feedback: Feedback
    crossing: CrossingEstimate
    slopes: SlopeEstimate
    origin: Annotated[float, Quantity("motor angle at the start, from which the others count", "rad")]


NARROWEST = 0.012
"""A dead zone below this is followed, not jumped [rad]."""

RECOVERY = 0.006
"""Time in which the feedback comes back after a jump [s]."""

SETTLED = 2.0
"""Durations of a jump after its beginning until what is seen of it counts [–]."""

BEGUN = (0.001, 0.1)
"""Way of a new stroke until which the feedback takes nothing back: this, and this time its speed [rad, s]."""

STILL = (5e-4, 0.03)
"""A motor that rests: within this of where it was 15 ms ago, under a reference slower than this [rad, rad/s]."""

PRESSING = 0.03
"""Time in which the command comes up to a resting motor that has gone beyond it [s]."""

STUCK = 0.05
"""Motor travel without joint motion after which a joint that is late is taken to be in the dead zone again [rad]."""

HURRY = (1.5 * RADIANS, 0.02, 0.2, 0.15)
"""Way of the reference from which a search hurries, the most of it that counts, the reference's speed from which it
carries the motor along itself, and its acceleration below which a stroke is slow [rad, rad, rad/s, rad/s²]."""

OVERDUE = (0.8, 0.6)
"""Share of the believed dead zone from which a search in a slow stroke may chase, and its largest speed [–, rad/s]."""

WOUND = 0.35
"""How far the command may be ahead of the motor until an error that asks for more is not summed up any further: a drive
at the limit of its current goes through all of it once it can [rad]."""

AHEAD = 0.05
"""How far the plan may be ahead of the motor in a search that hurries [rad]."""

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
    slope = first_slope(np.abs(gains.slope), gains.lag, gains.doubt, 0.0, sample.joint)
    return BowdenState(plan, feedback, crossing, slope, sample.motor)


@kernel
def step(
    gains: BowdenGains, state: BowdenState, sample: Sample, reference: Reference, dt: float
) -> tuple[BowdenState, float]:
    """One cycle: plan, feed back, invert servo, delay and lag, learn."""
    plan, before, crossing, slopes = state.plan, state.feedback, state.crossing, state.slopes
    sign, omega, swing = np.sign(gains.slope), gains.servo_frequency, 1.0 / gains.servo_frequency
    travel = sign * (sample.motor - state.origin)
    seen_both = (np.abs(sample.joint) <= 1e3) * (np.abs(travel) <= 1e3)
    most = FASTEST * dt
    joint = heard_angle(sel(seen_both, sample.joint, before.joint), before.joint, most)
    motor = heard_angle(sel(seen_both, travel, crossing.far_motor), crossing.far_motor, most)
    reference = heard_reference(plan, reference, dt)
    lag = np.fmax(0.0, slopes.lag)
    duration = gains.crossing * swing

    # plan
    mild, pace = harmless(crossing), np.abs(reference.velocity)
    goes = sel(pace > 1e-6, 1.0, 0.0)  # a reference that tells no velocity is none that is slow
    gentle = mild * goes * sel(pace < gains.slow, 1.0, 0.0)
    width, _ = crossing_from(crossing, 0.0, motor)
    wide = sel(width > NARROWEST, 1.0, 0.0)
    error = answered(before, motor, sel(seen_both, joint - reference.position, 0.0))
    heard = listen(before, motor, joint, error, 0.5 * gains.smoothing * swing, dt)
    early, off = wide * 2.0 * gains.early * duration, heard.slow_error
    wanted = wanted_side(plan, reference, early, gains.worth, off, gains.tolerance, gains.patience, wide)
    # gains alone come first in a choice: what they switch off is left out of exported code
    looks, seeks = gains.foresight > 0.0, gains.search > 0.0
    foresees = sel(looks, sel(wide * (np.abs(plan.side) > 0.5), 1.0, 0.0), 0.0)
    way = foreseen_way(reference, gains.foresight)
    slow = np.abs(reference.acceleration) < HURRY[3]
    return_way = sel(slow, foreseen_way(reference, gains.sight), 0.0)
    foreseen = foreseen_side(
        plan, reference, way, gains.rest, gains.worth, off, gains.tolerance, gains.patience, gains.stop, return_way
    )
    side = sel(looks, sel(foresees, foreseen, wanted), wanted)
    slope = sel(side < 0.0, slopes.down, slopes.up)
    begun = mild * sel((side != plan.side) * (crossing.heading == side), 1.0, 0.0)  # the feedback has turned the motor
    zone, doubt = crossing_from(crossing, begun, motor)
    gone = begun * np.abs(motor - crossing.turn_motor) + gentle * gains.caution * doubt
    travel_to = wide * np.fmax(0.0, gains.reach * zone - gone)
    touched = (side == plan.side) * (crossing.heading == side) * (crossing.turn_open == 0.0)
    behind, unmoved = 0.0 - side * off, np.abs(motor - before.moved_motor)
    late = (gains.late > 0.0) * (behind > gains.late)
    left = late * ((unmoved > STUCK) + (behind > 1.5 * gains.late) > 0.0)
    worth_it = sel(side == plan.side, 1.0, wide)  # what is sought was wide enough when the side changed
    sought = sel(seeks, sel(touched, sel(left, wide, 0.0), worth_it), 0.0)
    answers = seen_both * (unmoved < LOST)  # a dead joint is not sought for ever
    searches = (plan.phase >= 1.0) * (side * off < 0.5 * gains.tolerance) * answers
    hurry = np.fmax(0.0, np.fmin(HURRY[1], side * way - HURRY[0]))
    follows = side * (plan.motor + before.feedback - motor) < AHEAD  # friction holds a motor that is asked for more
    quick = (pace < HURRY[2]) * (side * reference.acceleration > HURRY[3])
    speed = gains.search + sel(quick * follows, gains.rush, 0.0) * hurry
    believed, _ = crossing_from(crossing, 1.0, motor)
    overdue = (crossing.heading == side) * (side * (motor - crossing.turn_motor) > OVERDUE[0] * believed)
    chased = np.fmin(OVERDUE[1], gains.chase * (behind + np.fmax(0.0, side * way)))
    speed = sel(gains.chase > 0.0, sel(slow * follows * overdue, np.fmax(speed, chased), speed), speed)
    goes_on = sel(late * follows, np.fmax(wide, plan.seeks), plan.seeks)
    search = sel(seeks, sel(searches, speed * sought * goes_on, 0.0), 0.0)
    plan = advance_plan(plan, reference, side, slope, travel_to, duration, sought, search, 1.0 - foresees, dt)
    asked = planned_motion(plan, reference, slope, duration, gains.delay, lag, search)
    inverse = asked.position + (2.0 * gains.servo_damping * asked.velocity + asked.acceleration * swing) * swing

    # feedback
    jumping = plan.phase < 1.0
    latency = gains.smoothing * swing + gains.delay + lag
    gain = heard.calm * np.fmin(np.fmin(gains.feedback * omega, gains.most), gains.budget / latency)
    inside = mild * goes * (crossing.turn_open > 0.0)
    setting = Setting(
        gain=gain * sel(inside, gains.haste, 1.0),
        lead=gains.lead * swing,
        smoothing=0.5 * gains.smoothing * swing + dt,
        quiet=gains.quiet,
        recovery=RECOVERY,
    )
    furthest = np.fmax(side * motor, side * slopes.filtered_motor)  # the filtered one, lest it be the noise's
    ahead = sel(jumping, 0.0, side * (inverse + before.feedback) - furthest - SLIP)
    moves = np.abs(asked.steady) * dt
    begins = foresees * (plan.gone <= BEGUN[0] + BEGUN[1] * pace) * (plan.seeks == 0.0) * (plan.phase >= 1.0)
    rests = sel(looks, sel(begins, 1.0, 0.0), 0.0)
    still = (np.abs(motor - slopes.filtered_motor) < STILL[0]) * (pace < STILL[1])
    asks = side * (inverse + before.feedback) - np.fmin(side * motor, side * slopes.filtered_motor)
    pressed = sel(still, np.fmin(0.0, asks) * dt / PRESSING, 0.0)
    back = np.fmax(moves, ahead)
    free = sel(looks, sel(rests, pressed, sel(foresees, moves, back)), back)
    free_to_turn = gentle * (side * reference.velocity < 0.0)
    taken = (wide > 0.5) + (crossing.touches < 1.5) > 0.0  # until it is known, a dead zone is taken for granted
    held = sel(free_to_turn, 0.0, sel(taken, 1.0, 0.0))
    comes = foresees * slow * (side * reference.velocity < 0.0) * (side * off < 0.0)  # the reference, to the joint
    wound = (side * (inverse + before.feedback - motor) > WOUND) * (side * error < 0.0)
    pulled = sel(gains.sight > 0.0, sel(comes + wound > 0.0, 0.0, error), error)
    feedback = steer(heard, setting, pulled, slope, side, jumping, held, free, rests, dt)
    command = state.origin + sign * (inverse + feedback.feedback)

    # learning
    settled = (plan.since > SETTLED * duration) + (plan.jump == 0.0) > 0.0
    heard_noise = sel(gains.sway > 0.0, heard.variance + gains.sway * heard.sway, heard.variance)
    crossing, seen = watch(crossing, motor, joint, slope, np.sqrt(heard_noise), settled)
    slopes = learn_slope(slopes, crossing, seen, motor, joint, np.abs(gains.slope), gains.stray, dt)
    return BowdenState(plan, feedback, crossing, slopes, state.origin), command
