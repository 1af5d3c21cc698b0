"""The cable's dead zone: its width, where the cable is in contact, and the cable's slope.

Both angles are measured at the same instant, so that o = motor − joint/a, the contact, is known without any model of
the servo. While the cable is engaged o stays; after a turn the motor crosses the dead zone, and o moves by its width.
All is in motor angle; a is the slope as learned, a₀ as given, I and F the observer's correction, asked for and sent.
The *side* is the sign of the reference's way since its last turn, +1 or −1; 0 before its first motion. Times it, what
is ahead is positive on either side: `side * min(side * a, side * b)` is that of two angles that is further behind.

- **Width** w of each way, a lower bound: a measurement below it is taken at once, one above it by a share. A jump
  too short costs a slower crossing; one too far is an error at once that only a crossing back takes away. Where the
  joint follows late a touch is seen late: what the motor went meanwhile does not count. By what w of one way grows that
  of the other does, by (1 + ω·lag)² less: a joint that is late and hit too hard swings.
- **Slope** a: over a stretch from a touch to the next turn o stays where a is right. One Kalman step a stretch, with an
  innovation test. It is used in the plan and in o alone: in the feedback it would be the loop's gain.
- **Jump**: at a turn of the reference, seen ahead by τ and 2.2/p, I, F and y go at once by what is left of w, and
  J begins at minus that, J''' = −p³·J − 3p²·J' − 3p·J'', so that F + J is smooth. The observer sees nothing of it:
  d̂ + I stays. A jump goes to a place: what the motor has crossed before is left out. A crossing that is given up is
  taken back by the width that it began with, the other way's: else I would go away with a reference that vibrates.
- **Touch**: the joint moves again. What of I is beyond the contact is taken back the same way: the motor stops there.
- **Hold**: where the joint is ahead by e, and the reference will be there before the motor has gone back through the
  dead zone, (e/a₀)² < 2·w·(|φ̇|/a₀)·T_a, w that of the way back, T_a the time of the observer's answer, I goes back
  no faster than the reference comes.

| phase | becomes | when |
|---|---|---|
| at start | engaged | the reference moves for the first time |
| engaged | crossing, to the other side | the reference turns by more than the tolerance |
| crossing | engaged | the joint moves on by more than a touch |
| crossing | engaged, on the side that it came from | the reference turns back before that |

While crossing the observer goes on with its bounded speed (search); while engaged it may hold.
"""

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity


class DeadzonePhase(IntEnum):
    """Where the motor is in the dead zone, and to which side the reference goes, which is the sign."""

    AT_START = 0
    ENGAGED_UP = 1
    ENGAGED_DOWN = -1
    CROSSING_UP = 2
    CROSSING_DOWN = -2


UNSEEN = 1e9
"""`DeadzoneState.furthest` before there was a reference."""

PACE = 3.0
"""p over the servo's ω: a jump asks for up to 0.23·(p/ω)² times the width in the command's acceleration term, and
begins without a step of it [–]."""

MIDDLE = 2.2
"""Time by which a turn is seen ahead, times p: 38 % of a jump is done then [–]."""

TURN, TURN_SIGMAS = 0.001, 4.0
"""Way of the reference that is a turn, and the same in standard deviations of the noise [rad, –]."""

TOUCH, TOUCH_SIGMAS = 0.0017, 6.0
"""Way of the joint that is a touch [rad, –]."""

BELIEVED = 0.4
"""Share by which a larger width is taken [–]."""

WIDEST = 0.6
"""Largest width that is accepted [rad]."""

SLACK = 0.2
"""Share of the width that the motor may have gone without having begun to cross: the slope's error [–]."""

UNSURE = 0.15
"""Standard deviation of the given slope, as a share of it [–]."""

WANDERS = 0.02
"""By how much a slope changes from a stretch to the next, standard deviation [–]."""

STRANGE = 0.035
"""By how much a contact moves for other reasons in a stretch, standard deviation [rad]."""

STRETCH = 0.05
"""Shortest stretch of the joint that says something of the slope [rad]."""

ODD = 9.0
"""Square of an innovation over its variance beyond which it is rejected [–]."""

FLATTEST, STEEPEST = 0.6, 1.7
"""Bounds of 1/a over the given one [–]."""

UNANSWERED = 1.2
"""How far the correction goes beyond what the joint has answered for: twice the widest dead zone, so that one of them
and as much slack are crossed; beyond, the cable is torn, the joint at a stop, or its sensor dead. A joint that moves
answers for as much of the contact's way as it went itself, by the slope as given: a breath does not say that a slack
cable pulls. So a cable that is less than half as steep as given, or whose contact goes further than this while the
joint is held, is left behind [rad]."""


class DeadzoneState(NamedTuple):
    """Estimate of the cable, and of the motor's place in it."""

    phase: Annotated[
        DeadzonePhase, Quantity("±1 engaged, ±2 crossing, with the sign of the reference's way; 0 at start", "1")
    ]
    furthest: Annotated[float, Quantity("the reference furthest on this side", "rad")]
    jump: Annotated[float, Quantity("J, what the command lacks of a jump", "rad")]
    jump_rate: Annotated[float, Quantity("its rate", "rad/s")]
    jump_acceleration: Annotated[float, Quantity("the rate of that", "rad/s²")]
    width: Annotated[float, Quantity("w, lower end of the dead zone's width in motor angle, crossed upward", "rad")]
    width_back: Annotated[float, Quantity("the same, crossed downward", "rad")]
    contact: Annotated[float, Quantity("o at the last touch, or where the motor turned", "rad")]
    extreme: Annotated[float, Quantity("the joint at the last touch; while crossing, furthest on the old side", "rad")]
    inverse: Annotated[float, Quantity("1/a", "1")]
    variance: Annotated[float, Quantity("its variance", "1")]
    answer_joint: Annotated[float, Quantity("the joint where it was last seen to move", "rad")]
    answer_contact: Annotated[float, Quantity("o, as far as the joint went with it", "rad")]


class DeadzoneInput(NamedTuple):
    """Both angles, the reference, and what is known of the rig."""

    joint: float
    """As measured [rad]."""
    motor: float
    """As measured, in the direction in which it moves the joint on [rad]."""
    position: float
    """φ, of the reference [rad]."""
    velocity: float
    """[rad/s]"""
    acceleration: float
    """[rad/s²]"""
    inverse: float
    """1/a₀, as given [–]."""
    noise: float
    """σ [rad]."""
    omega: float
    """ω of the servo [rad/s]."""
    delay: float
    """τ [s]."""
    lag: float
    """Of the joint, with that of a load that swings [s]."""
    answer: float
    """T_a, time of the observer's answer, 1/κ + 2.2/q + τ [s]."""
    rate: float
    """Of the motor, as expected [rad/s]."""


class DeadzoneUpdate(NamedTuple):
    """Result of a cycle."""

    state: DeadzoneState
    requested: float
    """I after holding and within reach, before its jump [rad]."""
    shift: float
    """Step of I and F: the jump, less the part that the plan takes over as the slope is learned [rad]."""


@kernel
def deadzone_at_start(joint: float, contact: float, inverse: float, width: float) -> DeadzoneState:
    """Nothing is known but what was given."""
    doubt = UNSURE * inverse
    return DeadzoneState(
        DeadzonePhase.AT_START,
        UNSEEN,
        0.0,
        0.0,
        0.0,
        width,
        width,
        contact,
        joint,
        inverse,
        doubt * doubt,
        joint,
        contact,
    )


@kernel
def side_of(phase: DeadzonePhase) -> float:
    """The sign of the reference's way; 0 at start."""
    if phase > 0:
        return 1.0
    return -1.0 if phase < 0 else 0.0


@kernel
def is_crossing(phase: DeadzonePhase) -> bool:
    """The motor crosses the dead zone."""
    return phase == DeadzonePhase.CROSSING_UP or phase == DeadzonePhase.CROSSING_DOWN


@kernel
def engaged_on(side: float) -> DeadzonePhase:
    """The motor moves the joint this way."""
    return DeadzonePhase.ENGAGED_UP if side > 0.0 else DeadzonePhase.ENGAGED_DOWN


@kernel
def crossing_to(side: float) -> DeadzonePhase:
    """The motor crosses this way."""
    return DeadzonePhase.CROSSING_UP if side > 0.0 else DeadzonePhase.CROSSING_DOWN


@kernel
def width_of(cable: DeadzoneState, side: float) -> float:
    """w of a crossing this way [rad]."""
    return cable.width_back if side < 0.0 else cable.width


@kernel
def shortfall_at_joint(cable: DeadzoneState, shortfall: float) -> float:
    """Part of the motor's shortfall that the joint lacks: nothing within a dead zone that is being crossed.

    Args:
        cable: one cycle ago.
        shortfall: of the motor [rad].
    """
    side = side_of(cable.phase)
    behind = side * shortfall
    if is_crossing(cable.phase) and behind < 0.0:
        return side * min(0.0, behind + width_of(cable, side))
    return shortfall


class ReferenceTurn(NamedTuple):
    """The reference beside where it was furthest."""

    turns: bool
    side: float
    """Of its way after this cycle: +1, −1; 0 before it has moved."""
    furthest: float
    """On that side [rad]."""


@kernel
def reference_turn(before: DeadzoneState, given: DeadzoneInput) -> ReferenceTurn:
    """The reference turns where, as it will be, it is behind the furthest that it was on this side, and does not go on.

    Of one that is given in steps the position alone goes back now and then while it goes on.
    """
    side = side_of(before.phase)
    if before.furthest >= UNSEEN:  # the first reference
        return ReferenceTurn(False, side, given.position)
    ahead = given.delay + MIDDLE / (PACE * given.omega)
    here = given.position + ahead * (given.velocity + 0.5 * ahead * given.acceleration)
    tolerance = TURN + TURN_SIGMAS * given.noise
    if before.phase == DeadzonePhase.AT_START:
        off = here - before.furthest
        if abs(off) > tolerance:
            return ReferenceTurn(True, math.copysign(1.0, off), here)
        return ReferenceTurn(False, side, before.furthest)
    furthest = side * max(side * before.furthest, side * here)
    goes_on = side * (given.velocity + ahead * given.acceleration) > 0.0
    if side * (furthest - here) > tolerance and not goes_on:
        return ReferenceTurn(True, -side, here)
    return ReferenceTurn(False, side, furthest)


class LearnedSlope(NamedTuple):
    """The slope as learned."""

    inverse: float
    """1/a [–]."""
    variance: float


@kernel
def learn_slope(before: DeadzoneState, given: DeadzoneInput, contact: float) -> LearnedSlope:
    """One Kalman step at the end of a stretch: o now against o at the touch, over the joint's way between."""
    way, loop = given.joint - before.extreme, given.inverse
    if not abs(way) > STRETCH:
        return LearnedSlope(before.inverse, before.variance)
    innovation = (contact - before.contact) / way
    other = STRANGE * STRANGE / (way * way + 1e-9)
    most = UNSURE * loop * (UNSURE * loop)
    if innovation * innovation > ODD * (before.variance + other):
        return LearnedSlope(before.inverse, min(most, 2.0 * before.variance))
    trust = before.variance / (before.variance + other)
    inverse = max(FLATTEST * loop, min(STEEPEST * loop, before.inverse + trust * innovation))
    wandered = WANDERS * loop * (WANDERS * loop)
    return LearnedSlope(inverse, min(most, (1.0 - trust) * before.variance + wandered))


class LearnedWidths(NamedTuple):
    """w of both ways [rad]."""

    this_way: float
    other_way: float


@kernel
def learn_width(known: LearnedWidths, given: DeadzoneInput, gone: float, side: float) -> LearnedWidths:
    """At a touch, after o has `gone` this way [rad]."""
    late = 1.0 + given.omega * given.lag
    if gone < known.this_way:
        accepted = gone
    else:
        excess = gone - given.lag * max(0.0, side * given.rate) - known.this_way
        accepted = known.this_way + BELIEVED * max(0.0, excess)
    this_way = max(0.0, min(WIDEST, accepted))
    other_way = known.other_way + max(0.0, this_way - known.this_way) / (late * late)
    return LearnedWidths(this_way, min(WIDEST, other_way))


@kernel
def held(
    given: DeadzoneInput, side: float, width_back: float, requested_before: float, requested: float, dt: float
) -> float:
    """I no faster back than the reference comes, where it will be at the joint before the motor has gone back [rad]."""
    ahead = side * (given.joint - given.position) * given.inverse
    coming = max(0.0, side * given.velocity) * given.inverse
    if ahead > 0.0 and ahead * ahead < 2.0 * width_back * coming * given.answer:
        return requested_before + side * max(-coming * dt, side * (requested - requested_before))
    return requested


class JointAnswer(NamedTuple):
    """The joint where it last moved."""

    joint: float
    """[rad]"""
    contact: float
    """o, as far as the joint went with it [rad]."""


@kernel
def joint_answer(before: DeadzoneState, given: DeadzoneInput, contact: float, change: float) -> JointAnswer:
    """Follow a joint that moves by more than a touch; `change` is that of 1/a in this cycle."""
    moved = abs(given.joint - before.answer_joint)
    answered = before.answer_contact - change * before.answer_joint
    if not moved > TOUCH + TOUCH_SIGMAS * given.noise:
        return JointAnswer(before.answer_joint, answered)
    went = moved * given.inverse
    return JointAnswer(given.joint, answered + max(-went, min(went, contact - answered)))


@kernel
def within_reach(requested: float, requested_before: float, answered: float) -> float:
    """I no further than a cable reaches beyond the `answered` contact [rad].

    It is held back and never drawn along: that would be a loop of its own.
    """
    lowest = min(answered - UNANSWERED, requested_before)
    highest = max(answered + UNANSWERED, requested_before)
    return max(lowest, min(highest, requested))


class FadingJump(NamedTuple):
    """J and its derivatives [rad, rad/s, rad/s²]."""

    lack: float
    rate: float
    acceleration: float


@kernel
def fade_jump(before: DeadzoneState, begun: float, pace: float, dt: float) -> FadingJump:
    """J one cycle later: it begins at minus the jump `begun` [rad], and goes to 0 with three poles at p = `pace`."""
    slower = 1.0 + pace * dt
    lack = before.jump - begun
    damp = before.jump_rate + dt * before.jump_acceleration
    stiff = pace * (lack + dt * damp)
    pull = -pace * (pace * (stiff + 3.0 * damp) + 3.0 * before.jump_acceleration)
    acceleration = before.jump_acceleration + pull * (dt / (slower * slower * slower))
    rate = before.jump_rate + dt * acceleration
    return FadingJump(lack + dt * rate, rate, acceleration)


@kernel
def update_deadzone(
    before: DeadzoneState, given: DeadzoneInput, requested_before: float, requested: float, dt: float
) -> DeadzoneUpdate:
    """One cycle.

    Args:
        before: one cycle ago.
        given: both angles, the reference, and what is known of the rig.
        requested_before: I one cycle ago [rad].
        requested: I as the observer wants it [rad].
        dt: cycle [s].
    """
    joint = given.joint
    turn = reference_turn(before, given)
    turns, side, crosses = turn.turns, turn.side, is_crossing(before.phase)
    known = LearnedWidths(width_of(before, side), width_of(before, -side))

    contact, slope = given.motor - joint * before.inverse, LearnedSlope(before.inverse, before.variance)
    if turns and not crosses and before.phase != DeadzonePhase.AT_START:
        slope = learn_slope(before, given, contact)
    change = slope.inverse - before.inverse
    contact = contact - change * joint

    extreme = before.extreme
    if crosses:
        extreme = side * min(side * before.extreme, side * joint)
    elif turns:
        extreme = joint
    touches = crosses and not turns and side * (joint - extreme) > TOUCH + TOUCH_SIGMAS * given.noise
    gone = side * (contact - before.contact)  # of the dead zone since the turn; while engaged about 0
    done = min(known.this_way, max(0.0, gone - SLACK * known.this_way))  # of the crossing, before it was asked for

    phase, widths, place, jump = before.phase, known, before.contact, 0.0
    if turns and before.phase == DeadzonePhase.AT_START:
        phase, place = engaged_on(side), contact - side * done
    elif turns and crosses:  # given up: back by the width with which it began
        phase, jump = engaged_on(side), side * known.other_way
    elif turns:
        phase, place, jump = crossing_to(side), contact - side * done, side * (known.this_way - done)
    elif touches:
        phase, place, widths = engaged_on(side), contact, learn_width(known, given, gone, side)

    if not is_crossing(phase):
        requested = held(given, side, known.other_way, requested_before, requested, dt)
    answer = joint_answer(before, given, contact, change)
    requested = within_reach(requested, requested_before, answer.contact)
    if touches:  # back by what of I is beyond the contact
        jump = -side * max(0.0, min(WIDEST, side * (requested - contact)))
    fading = fade_jump(before, jump, PACE * given.omega, dt)
    after = DeadzoneState(
        phase,
        turn.furthest,
        fading.lack,
        fading.rate,
        fading.acceleration,
        widths.other_way if side < 0.0 else widths.this_way,
        widths.this_way if side < 0.0 else widths.other_way,
        place,
        extreme,
        slope.inverse,
        slope.variance,
        answer.joint,
        answer.contact,
    )
    shift = jump - change * given.position  # with another slope the plan takes over a part of the correction
    return DeadzoneUpdate(after, requested, shift)
