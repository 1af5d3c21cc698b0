"""The cable's dead zone: its width, where the cable is in contact, and the cable's slope.

o = motor − joint/a, the contact, needs no model of the servo, as both are measured at the same instant. While the cable
is engaged o stays; after a turn the motor crosses the dead zone, and o moves by its width w, of which a lower bound is
known for each way. All is in motor angle; I and F are the observer's correction, asked for and sent. The *side* is the
sign of the reference's way: times it, what is ahead is positive on either side. At a turn I, F and y *jump* by what is
left of w, and J begins at minus that and goes to 0, so that F + J is smooth and the observer sees nothing of it. At a
*touch*, when the joint moves again, what of I is beyond the contact is taken back the same way. A joint that is ahead
of a reference that comes is *held*. Phases and equations: ``docs/background/our_law.md``.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.our_law.gains import BowdenGains
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference

FURTHEST = 1e6
"""Angles beyond it are none; a motor may have made many turns [rad]."""
PACE = 3.0
"""p over the servo's ω: a jump asks for up to 0.23·(p/ω)² times the width in the command's acceleration term, and
begins without a step of it [–]."""
MIDDLE = 2.2
"""Time by which a turn is seen ahead, times p: 38 % of a jump is done then [–]."""
SMALL, SIGMAS = 0.001, 4.0
"""Way of the reference that is no turn, and of the joint that is no news: the same in standard deviations of the
noise. Twice as much is a touch, and a swing [rad, –]."""
BELIEVED, LEARNED = 0.4, 0.5
"""Shares by which a larger width and another slope are taken [–]."""
STRETCH = 0.3
"""Stretch of the joint that says half of the slope: a contact moves for other reasons, too [rad]."""
STEEPEST = 1.7
"""Largest 1/a over the given one; the smallest is its inverse [–]."""
WIDEST = 0.6
"""Largest width that is accepted. I goes twice as far beyond what the joint has answered for, so that one dead zone
and as much slack are crossed; beyond, the cable is torn, the joint at a stop, or its sensor dead. A joint that moves
answers for as much of the contact's way as it went itself, by the slope as given: a breath does not say that a slack
cable pulls. So a cable that is less than half as steep as given, or whose contact goes further than this while the
joint is held, is left behind [rad]."""


class DeadzoneState(NamedTuple):
    """Estimate of the cable, and of the motor's place in it."""

    side: Annotated[float, Quantity("sign of the reference's way since it turned; 0 before it has moved", "1")]
    crossing: Annotated[bool, Quantity("the motor crosses the dead zone")]
    furthest: Annotated[float, Quantity("the reference furthest on this side; FURTHEST before there was one", "rad")]
    jump: Annotated[float, Quantity("J, what the command lacks of a jump", "rad")]
    jump_rate: Annotated[float, Quantity("its rate", "rad/s")]
    jump_acceleration: Annotated[float, Quantity("the rate of that", "rad/s²")]
    width: Annotated[float, Quantity("w, lower end of the dead zone's width in motor angle, crossed upward", "rad")]
    width_back: Annotated[float, Quantity("the same, crossed downward", "rad")]
    contact: Annotated[float, Quantity("o at the last touch, or where the motor turned", "rad")]
    extreme: Annotated[float, Quantity("the joint at the last touch; while crossing, furthest on the old side", "rad")]
    inverse: Annotated[float, Quantity("1/a", "1")]
    answer_joint: Annotated[float, Quantity("the joint where it was last seen to move", "rad")]
    answer_contact: Annotated[float, Quantity("o, as far as the joint went with it", "rad")]


@kernel
def no_news(gains: BowdenGains) -> float:
    """Way of the joint or the reference that may be noise [rad]."""
    return SMALL + SIGMAS * gains.noise


@kernel
def reference_turn(gains: BowdenGains, before: DeadzoneState, reference: Reference) -> tuple[float, float]:
    """Side of the reference, and where it was furthest on it [rad].

    It turns where, as it will be, it is behind the furthest that it was on this side, and does not go on. Of one that
    is given in steps the position alone goes back now and then while it goes on.
    """
    side, ahead = before.side, gains.delay + MIDDLE / (PACE * gains.servo_frequency)
    there = reference.position + ahead * (reference.velocity + 0.5 * ahead * reference.acceleration)
    furthest = reference.position if before.furthest >= FURTHEST else before.furthest
    off = there - furthest
    if side == 0.0 and abs(off) > no_news(gains):
        return math.copysign(1.0, off), there
    if side * off < -no_news(gains) and not side * (reference.velocity + ahead * reference.acceleration) > 0.0:
        return -side, there
    return side, furthest + side * max(0.0, side * off)


@kernel
def learn_slope(gains: BowdenGains, before: DeadzoneState, joint: float, contact: float) -> float:
    """1/a at the end of a stretch, by what o has moved since the touch [–]."""
    way, given = joint - before.extreme, 1.0 / abs(gains.slope)
    innovation = LEARNED * way * (contact - before.contact) / (way * way + STRETCH * STRETCH)
    return max(given / STEEPEST, min(given * STEEPEST, before.inverse + innovation))


@kernel
def learn_width(known: float, gone: float, late: float) -> float:
    """w at a touch, after o has `gone` this way, of which the motor went `late` as the joint moved [rad]."""
    return max(0.0, min(WIDEST, gone, known + BELIEVED * max(0.0, gone - known - late)))


@kernel
def update_deadzone(
    gains: BowdenGains,
    before: DeadzoneState,
    joint: float,
    plausible: bool,
    motor: float,
    reference: Reference,
    lag: float,
    answer: float,
    speed: float,
    last: float,
    wanted: float,
    dt: float,
) -> tuple[DeadzoneState, float, float]:
    """One cycle: the cable; I held and within reach, before its jump; and the step of I, F and y [rad].

    A reading that is not `plausible` is no touch. `lag` is the joint's, with that of a load that swings, `answer` T_a,
    the time of the observer's answer [s], `speed` the motor's as expected [rad/s], `last` I one cycle ago, and `wanted`
    what the observer wants it to be [rad].
    """
    touch, pace, given = 2.0 * no_news(gains), PACE * gains.servo_frequency, 1.0 / abs(gains.slope)
    side, furthest = reference_turn(gains, before, reference)
    turns = side != before.side
    this_way = before.width_back if side < 0.0 else before.width
    other_way = before.width if side < 0.0 else before.width_back

    inverse, contact = before.inverse, motor - joint * before.inverse
    if turns and not before.crossing and before.side != 0.0:
        inverse = learn_slope(gains, before, joint, contact)
    change = inverse - before.inverse
    contact = contact - change * joint
    gone = side * (contact - before.contact)  # of the dead zone since the turn; while engaged about 0

    crossing, place, extreme, jump = before.crossing, before.contact, before.extreme, 0.0
    touches = False
    if crossing:
        here = joint if plausible else extreme
        extreme = side * min(side * extreme, side * here)
        touches = not turns and side * (here - extreme) > touch
        crossing = not turns and not touches
        if turns:  # given up: back by the width with which it began
            jump = side * other_way
    elif turns:
        done = min(this_way, max(0.0, gone))  # of the crossing, before it was asked for
        extreme, place, crossing = joint, contact - side * done, before.side != 0.0
        if crossing:
            jump = side * (this_way - done)
    if touches:
        late = 1.0 + gains.servo_frequency * lag
        learned = learn_width(this_way, gone, lag * max(0.0, side * speed))
        other_way = min(WIDEST, other_way + max(0.0, learned - this_way) / (late * late))
        this_way, place = learned, contact

    # I goes back no faster than the reference comes, where that is at the joint before the motor has gone back: e goes
    # back at e/T_a in w; and no further than a cable reaches: held back, never drawn along, which would be a loop
    requested, ahead = wanted, side * (joint - reference.position) * given
    coming = max(0.0, side * reference.velocity) * given
    if not crossing and ahead > 0.0 and ahead * ahead < 2.0 * other_way * answer * coming:
        requested = last + side * max(-coming * dt, side * (wanted - last))
    moved, seen = abs(joint - before.answer_joint), before.answer_joint
    answered = before.answer_contact - change * seen
    if moved > touch:
        most = moved * given
        seen, answered = joint, answered + max(-most, min(most, contact - answered))
    lowest = min(answered - 2.0 * WIDEST, last)
    highest = max(answered + 2.0 * WIDEST, last)
    requested = max(lowest, min(highest, requested))
    if touches:  # back by what of I is beyond the contact
        jump = -side * max(0.0, min(WIDEST, side * (requested - contact)))

    # J: it begins at minus the jump, and goes to 0 with three poles at p
    lack, slower = before.jump - jump, 1.0 + pace * dt
    damp = before.jump_rate + dt * before.jump_acceleration
    pull = -pace * (pace * (pace * (lack + dt * damp) + 3.0 * damp) + 3.0 * before.jump_acceleration)
    acceleration = before.jump_acceleration + pull * (dt / (slower * slower * slower))
    rate = before.jump_rate + dt * acceleration
    jumped, up, down = lack + dt * rate, other_way if side < 0.0 else this_way, this_way if side < 0.0 else other_way
    after = DeadzoneState(
        side, crossing, furthest, jumped, rate, acceleration, up, down, place, extreme, inverse, seen, answered
    )
    return after, requested, jump - change * reference.position  # the plan takes over a part
