"""From contractions to where the joint should be: rest → flex → hold → extend, with minimum jerk, as kernels.

One muscle takes turns: its contraction begins a flexion from rest and an extension from hold. Two muscles have a
direction each, and a contraction of both at once (a stiffened arm) is no wish. A muscle that begins while the other one
still contracts, or is still taken to, has its motion once it has gone on alone for a moment; one that begins at nearly
the same time as the other has none. In both cases a contraction in mid-way that asks for the other direction turns the
motion round.

A motion is the quintic of least jerk (Flash and Hogan 1985) from where the reference is, with the velocity and the
acceleration that it has, to its end at rest; so that neither of them jumps when a motion is turned round.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from bowden.core.kernel import kernel, power, sqrt
from bowden.core.signals import Reference
from bowden.models.minimum_jerk import PEAK_SPEED, minimum_jerk_from


class Intent(IntEnum):
    """The wearer's intent."""

    REST = 0
    FLEX = 1
    HOLD = 2
    EXTEND = 3


class IntentSettings(NamedTuple):
    """Where to, and how fast."""

    low: float = 0.0
    """Extended [rad]."""
    high: float = math.pi / 2.0
    """Flexed [rad]."""
    duration: float = 2.0
    """Of the whole motion; less of a way takes its square root of it [s]."""
    muscles: int = 1
    """1 or 2."""


class Late(IntEnum):
    """Who began during the other one's contraction and has had no motion yet."""

    NOBODY = 0
    FLEXOR = 1
    EXTENSOR = 2


class IntentState(NamedTuple):
    """State of the state machine."""

    mode: Intent
    flexor: float
    """How long it has contracted, up to 1 s; 0 where it does not [s]."""
    extensor: float
    begin: Reference
    """Where the motion began."""
    end: float
    """Where it goes [rad]."""
    duration: float
    """[s]"""
    elapsed: float
    """[s]"""
    late: Late = Late.NOBODY
    alone: float = 0.0
    """How long that one has gone on without the other [s]."""


TURNED_SPEED, TURNED_ACCELERATION = 2.28, 20.2
"""Largest speed and acceleration of a motion that is turned round once, over range/duration and range/duration²; those
of one that is not are 1.875 and 5.774 [–]."""
FOLLOWED_SPEED, FOLLOWED_ACCELERATION = PEAK_SPEED, 100.0
"""The same of `proportional`."""
_SHORTEST = 0.3
"""A motion takes at least this share of `duration`, however short its way [–]."""
_LESS, _TRIES, _POINTS = 0.8, 10, 20
"""A motion that would leave its range is tried quicker by this factor, this often, and checked in this many points."""


_TOGETHER = 0.2
"""Muscles that begin within this time are contracted at once: neither has a motion after that [s]."""
_ALONE = 0.15
"""A muscle that began during the other one's contraction has its motion this long after that ends: two that are let
go at once end at somewhat different times [s]."""


@kernel
def intent_start(position: float) -> IntentState:
    """At rest at `position` [rad]."""
    begin = Reference(position, 0.0, 0.0)
    return IntentState(Intent.REST, 0.0, 0.0, begin, position, 1.0, 1.0, Late.NOBODY, 0.0)


@kernel
def leaves_range(settings: IntentSettings, begin: Reference, end: float, duration: float) -> bool:
    """True if a motion to `end` [rad] in a `duration` [s] swings out of the range before it turns."""
    for j in range(1, _POINTS):
        position = minimum_jerk_from(begin, end, duration, duration * j / _POINTS).position
        if position < settings.low or position > settings.high:
            return True
    return False


@kernel
def longest(settings: IntentSettings, begin: Reference, end: float) -> float:
    """How long a motion takes [s]: as its way asks for, or less where it would swing out of the range before it turns.

    Args:
        settings: of the range and of the whole motion.
        begin: where the motion begins.
        end: where it goes [rad].
    """
    share = sqrt(min(1.0, abs(end - begin.position) / (settings.high - settings.low)))
    most = settings.duration * max(_SHORTEST, share)
    for i in range(_TRIES):
        duration = most * power(_LESS, float(i))
        if not leaves_range(settings, begin, end, duration):
            return duration
    return most * power(_LESS, float(_TRIES))


@kernel
def late_muscle(state: IntentState, flexes: bool, extends: bool) -> Late:
    """Who began during the other one's contraction, is at it still, and has had no motion yet."""
    late = state.late
    if flexes and extends:
        if state.flexor <= 0.0:
            late = Late.FLEXOR if state.extensor > _TOGETHER else Late.NOBODY
        if state.extensor <= 0.0:
            late = Late.EXTENSOR if state.flexor > _TOGETHER else Late.NOBODY
    if (late == Late.FLEXOR and not flexes) or (late == Late.EXTENSOR and not extends):
        return Late.NOBODY
    return late


@kernel
def begun_motion(state: IntentState, muscles: int, flexes: bool, extends: bool, due: Late) -> Intent:
    """The motion that begins in this cycle, `FLEX` or `EXTEND`; else the intent as it was.

    Args:
        state: of the cycle before.
        muscles: 1 or 2.
        flexes: the flexor contracts.
        extends: the extensor does.
        due: who began late, and has gone on alone for long enough.
    """
    up = state.mode == Intent.FLEX or state.mode == Intent.HOLD
    flexor_begins, extensor_begins = flexes and state.flexor <= 0.0, extends and state.extensor <= 0.0
    if muscles == 1:
        if flexor_begins:
            return Intent.EXTEND if up else Intent.FLEX
        return state.mode
    if not up and ((flexor_begins and not extends) or due == Late.FLEXOR):
        return Intent.FLEX
    if up and ((extensor_begins and not flexes) or due == Late.EXTENSOR):
        return Intent.EXTEND
    return state.mode


@kernel
def intent_step(
    settings: IntentSettings, state: IntentState, flexes: bool, extends: bool, dt: float
) -> tuple[IntentState, Reference]:
    """One cycle.

    Args:
        settings: of the machine.
        state: of the cycle before.
        flexes: the muscle that flexes contracts, as `sensing.onset` says; not where that is unknown.
        extends: the same of the muscle that extends; not looked at where there is one muscle.
        dt: length of the cycle [s].
    """
    elapsed = min(state.elapsed + dt, state.duration)
    reference = minimum_jerk_from(state.begin, state.end, state.duration, elapsed)

    late, alone, due = late_muscle(state, flexes, extends), 0.0, Late.NOBODY
    if late != Late.NOBODY and not (flexes and extends):
        alone = state.alone + dt
        if alone >= _ALONE:
            due, late, alone = late, Late.NOBODY, 0.0

    mode = begun_motion(state, settings.muscles, flexes, extends, due)
    begin, end, duration = state.begin, state.end, state.duration
    if mode != state.mode:
        end = settings.high if mode == Intent.FLEX else settings.low
        begin, duration, elapsed = reference, longest(settings, reference, end), 0.0
    if elapsed >= duration:
        if mode == Intent.FLEX:
            mode = Intent.HOLD
        elif mode == Intent.EXTEND:
            mode = Intent.REST
    flexor = min(1.0, state.flexor + dt) if flexes else 0.0
    extensor = min(1.0, state.extensor + dt) if extends else 0.0
    return IntentState(mode, flexor, extensor, begin, end, duration, elapsed, late, alone), reference


@kernel
def proportional(settings: IntentSettings, before: Reference, envelope: float, full: float, dt: float) -> Reference:
    """The joint goes where the envelope is: from `low` at none to `high` at `full`, through a critically damped filter.

    Its time constant is a tenth of `duration`, and it is never quicker than a motion of the whole range is at its
    quickest, 15/8·range/duration, so that a step takes about the time of a motion to within 1 %.

    Args:
        settings: of the way.
        before: the reference of the cycle before.
        envelope: of the muscle, NaN where it is unknown: then the joint goes to `low`.
        full: envelope of a full flexion, such as a third of MVC.
        dt: length of the cycle [s].
    """
    share = max(0.0, min(1.0, envelope / full)) if math.isfinite(envelope) else 0.0
    goal = settings.low + share * (settings.high - settings.low)
    rate = 10.0 / settings.duration
    most = FOLLOWED_SPEED * (settings.high - settings.low) / settings.duration
    velocity = (before.velocity + dt * rate * rate * (goal - before.position)) / (1.0 + rate * dt * (2.0 + rate * dt))
    velocity = max(-most, min(most, velocity))
    return Reference(before.position + dt * velocity, velocity, (velocity - before.velocity) / dt)
