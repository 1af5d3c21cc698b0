"""Where the motor should be: the reference through the cable's slope, a jump through the dead zone at each reversal.

The plan is kept in increments, so that nothing jumps when an estimate changes: the motor moves by dφ/a with the
reference, and by `width`·(1 − side·slot)/2 where the side changes. `slot` ∈ [−1, 1] is the place in the dead zone
(+1 while the joint rises, −1 while it falls). A jump takes its own time by minimum jerk. Portable subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.control.law_parts import bounded
from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference
from bowden.models.minimum_jerk import minimum_jerk, minimum_jerk_share

STEP_SPEED = 5.0
"""Speed at which a step of the reference is followed, beyond twice the speed that it tells [rad/s]."""


_AMBLING = 0.1
"""Speed of the reference below which a joint that is ahead ends a stroke early [rad/s]."""

_ENDING = 0.6
"""Share of the tolerance that a joint may be ahead in the last of a stroke, which ends soon on the other side [–]."""

_STEADY = 5.0
"""By how much the patience with an error grows with the reference's speed, lest it hunts in mid-stroke [s/(rad/s)]."""


class SlotPlan(NamedTuple):
    """The plan at one moment."""

    side: Annotated[
        float,
        Quantity(
            "side of the dead zone that is wanted: +1 while the joint rises, −1 while it falls, 0 before the start"
        ),
    ]
    slot: Annotated[float, Quantity("place in the dead zone where the last jump ends")]
    since: Annotated[float, Quantity("time since the side changed", "s")]
    phase: Annotated[float, Quantity("share of the last jump that is done; 1 where there is none")]
    jump: Annotated[float, Quantity("motor travel of the last jump, signed; 0 before the first", "rad")]
    motor: Annotated[float, Quantity("where the motor should be once the jump is done", "rad")]
    owed: Annotated[
        float, Quantity("motion of the reference that is not planned yet, since it goes against the side", "rad")
    ]
    reference: Annotated[float, Quantity("reference of the last cycle", "rad")]
    gone: Annotated[float, Quantity("motion of the reference with the side since it changed, up to 1", "rad")]
    seeks: Annotated[
        float, Quantity("1 from a change of side until the joint is seen to move, where it is sought, else 0")
    ]


class MotorMotion(NamedTuple):
    """What the plan asks of the motor, with its exact derivatives."""

    position: float
    """[rad]"""
    velocity: float
    """[rad/s]"""
    acceleration: float
    """[rad/s²]"""
    steady: float
    """Velocity without the jump's [rad/s]."""


@kernel
def rest_plan(motor: float, joint: float) -> SlotPlan:
    """At rest in the middle of the dead zone, with the motor where it is, and the joint where it should be."""
    return SlotPlan(0.0, 0.0, 10.0, 1.0, 0.0, motor, 0.0, joint, 0.0, 0.0)


@kernel
def heard_reference(plan: SlotPlan, reference: Reference, dt: float) -> Reference:
    """The reference as a motion: where it steps it is followed at `STEP_SPEED`, and so is the way to where it starts.

    A step that went through at once would be made up for twice, by the plan and by the feedback, which sees the error
    while the servo is on its way.
    """
    velocity = bounded(reference.velocity, -1e4, 1e4, 0.0)
    most = dt * (STEP_SPEED + 2.0 * np.abs(velocity))
    told = sel((reference.position >= -1e3) * (reference.position <= 1e3), reference.position, plan.reference)
    position = np.fmax(plan.reference - most, np.fmin(plan.reference + most, told))
    steps = position != told
    return Reference(
        position,
        sel(steps, np.sign(position - plan.reference) * STEP_SPEED, velocity),
        sel(steps, 0.0, bounded(reference.acceleration, -1e6, 1e6, 0.0)),
    )


@kernel
def owed_now(plan: SlotPlan, reference: Reference) -> float:
    """Motion of the reference that is still to be planned [rad]."""
    return plan.owed + (reference.position - plan.reference)


@kernel
def wanted_side(
    plan: SlotPlan,
    reference: Reference,
    ahead: float,
    worth: float,
    slow_error: float,
    tolerance: float,
    patience: float,
    crossable: float,
) -> float:
    """The side that the reference wants, unless a lasting error wants the other.

    Args:
        plan: so far.
        reference: now.
        ahead: how far to look ahead, twice the time by which a jump should begin before the reference turns [s].
        worth: motion of the reference against the side that is worth a reversal [rad].
        slow_error: joint − reference behind a filter [rad].
        tolerance: error that is worth crossing the dead zone for, if it does not pass by itself within `patience`.
        patience: [s].
        crossable: 1 where crossing on purpose is of use, on a cable with a dead zone, else 0.
    """
    velocity = reference.velocity + reference.acceleration * ahead
    motion = owed_now(plan, reference) + ahead * (reference.velocity + 0.5 * ahead * reference.acceleration)
    turns = (velocity * plan.side <= 0.0) * (motion * plan.side < -worth)
    starts = (plan.side == 0.0) * (np.abs(velocity) > 1e-4)
    asks = (plan.side == 0.0) * (np.abs(slow_error) > 0.3 * tolerance)  # at rest, the first side is the error's
    first = sel(starts, np.sign(velocity), sel(asks, 0.0 - np.sign(slow_error), plan.side))
    wanted = sel(turns, 0.0 - plan.side, first)
    beyond = slow_error * plan.side  # positive: the joint is further than the reference, in the direction of motion
    passes = (reference.velocity - slow_error * (1.0 / patience)) * plan.side * patience
    back = (passes < -tolerance) * (beyond > tolerance) * (plan.since > patience) * crossable
    waits = (wanted != plan.side) * (beyond < -tolerance) * (np.abs(velocity) < 0.03)
    return sel(back, 0.0 - plan.side, sel(waits, plan.side, wanted))


@kernel
def foreseen_way(reference: Reference, foresight: float) -> float:
    """The reference's way within `foresight` [rad]; one that brakes is taken to stop."""
    velocity, acceleration = reference.velocity, reference.acceleration
    stop = np.abs(velocity) / np.fmax(np.abs(acceleration), 1e-9)
    time = sel(velocity * acceleration < 0.0, np.fmin(foresight, stop), foresight)
    return time * (velocity + 0.5 * time * acceleration)


@kernel
def foreseen_side(
    plan: SlotPlan,
    reference: Reference,
    way: float,
    rest: float,
    worth: float,
    slow_error: float,
    tolerance: float,
    patience: float,
    stop: float,
    return_way: float,
) -> float:
    """The side that the way still to go asks for: the reference's within a foresight, less what the joint is ahead.

    Where less than `rest` of a stroke is left (in slow motion less what the joint is ahead), and its end is near in
    time, the side is changed ahead of the next stroke, which is taken to go the other way; once a stroke, and not while
    the joint has still far to go. Where the joint has not arrived and the reference comes back, the side is changed as
    soon as the reference is seen to pass it.

    Args:
        plan: so far, whose side is not 0.
        reference: now.
        way: of the reference, as `foreseen_way` tells it [rad].
        rest: [rad].
        worth: way of the reference the other way that is worth a change of side [rad].
        slow_error: joint − reference behind a filter [rad].
        tolerance: way the other way that an error is worth [rad].
        patience: time that the other side is kept, if the error alone asks for a change [s].
        stop: time within which a braking reference has to stand for its stroke to count as ended; 0 for any [s].
        return_way: of a reference that comes back to a joint that has not arrived, seen further ahead [rad].
    """
    velocity, acceleration = reference.velocity, reference.acceleration
    way, beyond = plan.side * way, plan.side * slow_error
    turns = (way < -worth) * (way - beyond < -worth)
    passes = (plan.side * velocity < 0.0) * (beyond < 0.0) * (plan.side * return_way - beyond < -worth)
    nearly = (acceleration * plan.side < 0.0) * (velocity * plan.side > 0.0) * (np.abs(velocity) < _AMBLING)
    most = tolerance * sel(nearly, _ENDING, 1.0)
    errs = (0.5 * way - beyond < -most) * (plan.since > patience + _STEADY * np.abs(velocity))
    stands = (velocity == 0.0) * (reference.position == plan.reference)
    stops = (acceleration * plan.side < 0.0) + stands > 0.0
    left = way - sel(np.abs(velocity) < _AMBLING, np.fmax(0.0, beyond), 0.0)
    soon = sel(stop > 0.0, sel(np.abs(velocity) <= stop * np.abs(acceleration), 1.0, 0.0), 1.0)
    ends = stops * soon * (left < rest) * (plan.gone > 4.0 * rest) * (beyond > -0.5 * tolerance)
    return sel(turns + passes + errs + ends > 0.0, 0.0 - plan.side, plan.side)


@kernel
def advance_plan(
    plan: SlotPlan,
    reference: Reference,
    side: float,
    slope: float,
    width: float,
    duration: float,
    sought: float,
    search: float,
    owes: float,
    dt: float,
) -> SlotPlan:
    """The plan one cycle on.

    Args:
        plan: so far.
        reference: now.
        side: wanted.
        slope: joint motion per motor motion on that side [rad/rad].
        width: motor travel through the dead zone that is to be jumped from the other side; 0 for no jump [rad].
        duration: of a jump [s].
        sought: 1 where a change of side is to be ended by the joint's motion, 0 where it has been seen.
        search: speed of the motor until then, once the jump is done [rad/s].
        owes: 1 where motion against the side is made up for before the plan goes on, 0 where the feedback is to.
        dt: the cycle [s].
    """
    owed = owed_now(plan, reference)
    due = np.fmax(side * owed, 0.0)
    flip = side != plan.side
    travel = side * 0.5 * width * np.fmax(1.0 - side * plan.slot, 0.0)
    jumps = flip * (width > 0.0)
    left = plan.jump * (1.0 - minimum_jerk_share(plan.phase))
    return SlotPlan(
        side=side,
        slot=sel(flip, side, plan.slot),
        since=sel(flip, 0.0, np.fmin(10.0, plan.since + dt)),
        phase=sel(jumps, 0.0, np.fmin(1.0, plan.phase + dt * (1.0 / duration))),
        jump=sel(jumps, left + travel, plan.jump),
        motor=plan.motor + side * due * (1.0 / slope) + sel(jumps, travel, 0.0) + side * search * dt,
        owed=owes * sel((side * owed > 0.0) + (side == 0.0) > 0.0, 0.0, owed),
        reference=reference.position,
        gone=sel(flip, 0.0, np.fmin(1.0, plan.gone + np.fmax(0.0, side * (reference.position - plan.reference)))),
        seeks=sought * sel(flip, 1.0, plan.seeks),
    )


@kernel
def planned_motion(
    plan: SlotPlan, reference: Reference, slope: float, duration: float, delay: float, lag: float, search: float
) -> MotorMotion:
    """What the motor should do now: the reference `delay` + `lag` ahead, the jump `delay` ahead, and a `search`."""
    x, speed = plan.phase, 1.0 / duration
    jump = minimum_jerk(0.0, plan.jump, 1.0, x)
    rate, growth = jump.velocity * speed, jump.acceleration * (speed * speed)
    turns = sel(plan.side * reference.velocity > 0.0, 1.0 / slope, 0.0)
    steady, pick_up = reference.velocity * turns, reference.acceleration * turns
    ahead = delay + lag
    behind = plan.jump * (1.0 - minimum_jerk_share(x))
    return MotorMotion(
        position=plan.motor - behind + ahead * steady + delay * rate,
        velocity=steady + rate + ahead * pick_up + plan.side * search,
        acceleration=pick_up + growth,
        steady=steady + rate + plan.side * search,
    )
