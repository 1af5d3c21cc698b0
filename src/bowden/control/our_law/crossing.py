"""What matters of the cable: how wide its dead zone is, where its contact is, and how steep it is.

Both angles are measured at the same instant, so that o = motor − joint/a, the contact, is known without any model of
the servo. While the cable is engaged o stays; after a turn the motor crosses the dead zone, and o moves by its width.
All is in motor angle; a is the slope as learned, a₀ as given, I and F the observer's correction, asked for and sent.
The *side* is the sign of the reference's way since its last turn, +1 or −1; 0 before its first motion. Times it, what
is ahead is positive on either side: `side * smaller(side * a, side * b)` is that of two angles that is further behind.

- **Width** w of each way, a lower bound: a measurement below it is believed at once, one above it by a share. A jump
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

| mode | becomes | when |
|---|---|---|
| follow | cross | the reference turns by more than the tolerance |
| cross | follow | the joint moves on by more than a touch |
| cross | follow, on the side that it came from | the reference turns back before that |

Within cross the observer goes on with its bounded speed (search); within follow it may hold. Portable subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.extremes import larger, smaller
from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity

FOLLOW, CROSS = 1.0, 2.0
"""The two modes."""

UNSEEN = 1e9
"""What `Crossing.furthest` is before there was a reference."""

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
"""Share by which a larger width is believed [–]."""

WIDEST = 0.6
"""Largest width that is believed [rad]."""

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
"""Square of an innovation over its variance beyond which it is not believed [–]."""

FLATTEST, STEEPEST = 0.6, 1.7
"""Bounds of 1/a over the given one [–]."""

UNANSWERED = 1.2
"""How far the correction goes beyond what the joint has answered for: twice the widest dead zone, so that one of them
and as much slack are crossed; beyond, the cable is torn, the joint at a stop, or its sensor dead. A joint that moves
answers for as much of the contact's way as it went itself, by the slope as given: a breath does not say that a slack
cable pulls. So a cable that is less than half as steep as given, or whose contact goes further than this while the
joint is held, is left behind [rad]."""


class Crossing(NamedTuple):
    """What is known of the cable, and where in it the motor is."""

    mode: Annotated[float, Quantity("1 follow, 2 cross, with the sign of the reference's way; 0 before its first", "1")]
    furthest: Annotated[float, Quantity("the reference furthest on this side", "rad")]
    jump: Annotated[float, Quantity("J, what the command lacks of a jump", "rad")]
    jump_rate: Annotated[float, Quantity("its rate", "rad/s")]
    jump_bend: Annotated[float, Quantity("the rate of that", "rad/s²")]
    width: Annotated[float, Quantity("w, lower end of the dead zone's width in motor angle, crossed upward", "rad")]
    width_back: Annotated[float, Quantity("the same, crossed downward", "rad")]
    contact: Annotated[float, Quantity("o at the last touch, or where the motor turned", "rad")]
    extreme: Annotated[float, Quantity("the joint at the last touch; while crossing, furthest on the old side", "rad")]
    inverse: Annotated[float, Quantity("1/a", "1")]
    variance: Annotated[float, Quantity("its variance", "1")]
    answer_joint: Annotated[float, Quantity("the joint where it was last seen to move", "rad")]
    answer_contact: Annotated[float, Quantity("o, as far as the joint went with it", "rad")]


class Known(NamedTuple):
    """What a cycle of `crossed` gets."""

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


class Crossed(NamedTuple):
    """What came of it."""

    crossing: Crossing
    asked: float
    """I after holding and within reach, before its jump [rad]."""
    shift: float
    """What I and F go by at once: the jump, less what the plan takes over as the slope is learned [rad]."""


@kernel
def at_start(joint: float, contact: float, inverse: float, width: float) -> Crossing:
    """Nothing is known but what was given."""
    doubt = UNSURE * inverse
    return Crossing(0.0, UNSEEN, 0.0, 0.0, 0.0, width, width, contact, joint, inverse, doubt * doubt, joint, contact)


@kernel
def width_of(cable: Crossing, side: float) -> float:
    """w of a crossing this way [rad]."""
    return sel(side < 0.0, cable.width_back, cable.width)


@kernel
def missing(cable: Crossing, short: float) -> float:
    """What of the motion that the motor did not make the joint lacks: nothing within a dead zone that is being crossed.

    Args:
        cable: one cycle ago.
        short: what the motor did not make [rad].
    """
    side = np.sign(cable.mode)
    behind = side * short
    beyond = side * smaller(behind + width_of(cable, side), 0.0)
    return sel((np.abs(cable.mode) > FOLLOW) * (behind < 0.0) > 0.0, beyond, short)


@kernel
def crossed(before: Crossing, given: Known, asked_before: float, asked: float, dt: float) -> Crossed:
    """One cycle.

    Args:
        before: one cycle ago.
        given: both angles, the reference, and what is known of the rig.
        asked_before: I one cycle ago [rad].
        asked: I as the observer wants it [rad].
        dt: cycle [s].
    """
    joint, motor, speed, loop = given.joint, given.motor, given.velocity, given.inverse
    first, way_before = before.furthest >= UNSEEN, np.sign(before.mode)
    pace = PACE * given.omega

    # turn: the reference, as it will be, behind the furthest that it was on this side, and not going on: of one that is
    # given in steps the position alone goes back now and then while it goes on
    ahead = given.delay + MIDDLE / pace
    here = given.position + ahead * (speed + 0.5 * ahead * given.acceleration)
    fresh = before.mode == 0.0
    reached = way_before * larger(way_before * here, way_before * before.furthest)
    furthest = sel(first, given.position, sel(fresh, before.furthest, reached))
    back = sel(fresh, np.abs(here - furthest), way_before * (furthest - here))
    goes_on = (1.0 - fresh) * (way_before * (speed + ahead * given.acceleration) > 0.0)
    turns = (back > TURN + TURN_SIGMAS * given.noise) * (1.0 - goes_on) * (1.0 - first) > 0.0
    side = sel(turns, sel(fresh, np.sign(here - furthest), -way_before), way_before)
    furthest = sel(turns, here, furthest)
    crossing = np.abs(before.mode) > FOLLOW
    known, known_back = width_of(before, side), width_of(before, -side)

    # slope, at a turn: o now against o at the touch, over the joint's way between
    contact = motor - joint * before.inverse
    way = joint - before.extreme
    far = np.abs(way) > STRETCH
    by = (contact - before.contact) / sel(far, way, 1.0)
    other = STRANGE * STRANGE / (way * way + 1e-9)
    stretch = turns * (1.0 - crossing) * (1.0 - fresh) * far > 0.0
    odd = by * by > ODD * (before.variance + other)
    trust = sel(odd, 0.0, before.variance / (before.variance + other))
    learned = larger(smaller(before.inverse + trust * by, STEEPEST * loop), FLATTEST * loop)
    inverse = sel(stretch, learned, before.inverse)
    least, most = WANDERS * loop, UNSURE * loop
    surer = sel(odd, 2.0 * before.variance, (1.0 - trust) * before.variance + least * least)
    variance = sel(stretch, smaller(surer, most * most), before.variance)
    change = inverse - before.inverse
    contact = contact - change * joint

    # touch, and the width
    old_side = side * smaller(side * joint, side * before.extreme)
    extreme = sel(turns, sel(crossing, old_side, joint), sel(crossing, old_side, before.extreme))
    moved = side * (joint - extreme) > TOUCH + TOUCH_SIGMAS * given.noise
    touches = crossing * (1.0 - turns) * moved > 0.0
    follows = turns * (1.0 - fresh) * (1.0 - crossing) + (1.0 - turns) * (1.0 - touches) * crossing < 1.0
    mode = side * sel(follows, FOLLOW, CROSS)
    gone = side * (contact - before.contact)  # of the dead zone since the turn; while engaged about 0
    late = 1.0 + given.omega * given.lag
    more = BELIEVED * larger(gone - given.lag * larger(side * given.rate, 0.0) - known, 0.0)
    own = sel(touches, larger(smaller(sel(gone < known, gone, known + more), WIDEST), 0.0), known)
    others = sel(touches, smaller(known_back + larger(own - known, 0.0) / (late * late), WIDEST), known_back)
    done = smaller(larger(gone - SLACK * known, 0.0), known)  # of the crossing, before it was asked for
    at_turn = sel(crossing, before.contact, contact - side * done)
    place = sel(touches, contact, sel(turns, at_turn, before.contact))

    # hold, and no further than a cable reaches
    behind = side * (joint - given.position) * loop
    forward = larger(side * speed, 0.0) * loop
    waits = (behind * behind < 2.0 * known_back * forward * given.answer) * (behind > 0.0) * follows > 0.0
    kept = asked_before + side * larger(side * (asked - asked_before), -forward * dt)
    asked = sel(waits, kept, asked)
    moves = np.abs(joint - before.answer_joint)
    answers, went = moves > TOUCH + TOUCH_SIGMAS * given.noise, moves * loop
    held = before.answer_contact - change * before.answer_joint
    answer_contact = held + sel(answers, larger(smaller(contact - held, went), -went), 0.0)
    lowest = smaller(asked_before, answer_contact - UNANSWERED)
    highest = larger(asked_before, answer_contact + UNANSWERED)
    asked = larger(smaller(asked, highest), lowest)  # held back and never drawn along: that would be a loop of its own

    # jump by what is left of w; at a touch back by what of I is beyond the contact
    left = side * (sel(crossing, known_back, known) - sel(crossing, 0.0, done))
    beyond = side * larger(smaller(side * (asked - contact), WIDEST), 0.0)
    jump = sel(turns, sel(fresh, 0.0, left), 0.0) - sel(touches, beyond, 0.0)
    slower = 1.0 + pace * dt
    lack = before.jump - jump
    damp = before.jump_rate + dt * before.jump_bend
    stiff = pace * (lack + dt * damp)
    pull = -pace * (pace * (stiff + 3.0 * damp) + 3.0 * before.jump_bend)
    bend = before.jump_bend + pull * (dt / (slower * slower * slower))
    rate = before.jump_rate + dt * bend
    shift = jump - change * given.position  # with another slope the plan takes over a part of the correction
    return Crossed(
        Crossing(
            mode,
            furthest,
            lack + dt * rate,
            rate,
            bend,
            sel(side < 0.0, others, own),
            sel(side < 0.0, own, others),
            place,
            extreme,
            inverse,
            variance,
            sel(answers, joint, before.answer_joint),
            answer_contact,
        ),
        asked,
        shift,
    )
