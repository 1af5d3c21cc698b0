"""From contractions to where the joint should be: rest → flex → hold → extend, with minimum jerk, as kernels.

One muscle takes turns: its contraction begins a flexion from rest and an extension from hold. Two muscles have a
direction each, and a contraction of both at once (a stiffened arm) is no wish. A muscle that begins while the other one
still contracts, or is still taken to, has its motion once it has gone on alone for a moment; one that begins at nearly
the same time as the other has none. In both cases a contraction in mid-way that asks for the other direction turns the
motion round.

A motion is the quintic of least jerk (Flash and Hogan 1985) from where the reference is, with the velocity and the
acceleration that it has, to its end at rest; so that neither of them jumps when a motion is turned round.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.core.signals import Reference
from bowden.models.minimum_jerk import PEAK_SPEED, minimum_jerk_from


class Intent(IntEnum):
    """What the wearer is taken to want."""

    REST = 0
    FLEX = 1
    HOLD = 2
    EXTEND = 3


class IntentSettings(NamedTuple):
    """Where to, and how fast."""

    low: float = 0.0
    """Extended [rad]."""
    high: float = float(np.pi) / 2.0
    """Flexed [rad]."""
    duration: float = 2.0
    """Of the whole motion; less of a way takes its square root of it [s]."""
    muscles: float = 1.0
    """1 or 2."""


class IntentState(NamedTuple):
    """What the machine keeps."""

    mode: float
    """Number of an `Intent`."""
    flexor: float
    """How long it has contracted, up to 1 s; 0 where it does not [s]."""
    extensor: float
    begin: Reference
    """Where the motion began."""
    end: float
    """Where it goes [rad]."""
    lasts: float
    """[s]"""
    gone: float
    """[s]"""
    owed: float = 0.0
    """1 where the flexor, -1 where the extensor began during the other one's contraction and has had no motion yet."""
    alone: float = 0.0
    """How long that one has gone on without the other [s]."""


REST, FLEX, HOLD, EXTEND = (float(intent) for intent in Intent)
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


def intent_start(position: float) -> IntentState:
    """At rest at `position` [rad]."""
    return IntentState(REST, 0.0, 0.0, Reference(position, 0.0, 0.0), position, 1.0, 1.0)


@kernel
def longest(settings: IntentSettings, begin: Reference, end: float) -> float:
    """How long a motion takes [s]: as its way asks for, or less where it would swing out of the range before it turns.

    Args:
        settings: of the range and of the whole motion.
        begin: where the motion begins.
        end: where it goes [rad].
    """
    share = np.sqrt(np.fmin(1.0, np.abs(end - begin.position) / (settings.high - settings.low)))
    most = settings.duration * np.fmax(_SHORTEST, share)
    lasts = most * _LESS**_TRIES
    for i in range(_TRIES):
        tried, out = most * _LESS ** (_TRIES - 1 - i), 0.0
        for j in range(1, _POINTS):
            there = minimum_jerk_from(begin, end, tried, tried * j / _POINTS).position
            out = np.fmax(out, np.fmax(settings.low - there, there - settings.high))
        lasts = sel(out > 0.0, lasts, tried)
    return lasts


@kernel
def intent_step(
    settings: IntentSettings, state: IntentState, flexor: float, extensor: float, dt: float
) -> tuple[IntentState, Reference]:
    """One cycle.

    Args:
        settings: of the machine.
        state: of the cycle before.
        flexor: 1 while the muscle that flexes contracts, as `sensing.onset` says; 0, or NaN where it is unknown, else.
        extensor: the same of the muscle that extends; not looked at where there is one muscle.
        dt: length of the cycle [s].
    """
    gone = np.fmin(state.gone + dt, state.lasts)
    now = minimum_jerk_from(state.begin, state.end, state.lasts, gone)
    flexes, extends = flexor > 0.5, extensor > 0.5
    begins, other = flexes * (state.flexor <= 0.0), extends * (state.extensor <= 0.0)
    two, up = settings.muscles > 1.5, (state.mode == FLEX) + (state.mode == HOLD) > 0.0
    both = flexes * extends

    # who began while the other one contracted, and whether it is alone by now
    owed = sel(both * begins, sel(state.extensor > _TOGETHER, 1.0, 0.0), state.owed)
    owed = sel(both * other, sel(state.flexor > _TOGETHER, -1.0, 0.0), owed)
    owed = sel((owed > 0.0) * flexes + (owed < 0.0) * extends > 0.0, owed, 0.0)
    alone = sel((np.abs(owed) > 0.5) * (1.0 - both) > 0.0, state.alone + dt, 0.0)
    due = alone >= _ALONE
    flex_due, extend_due = due * (owed > 0.0), due * (owed < 0.0)

    flex = sel(two, begins * (1.0 - both) + flex_due, begins * (1.0 - up)) * (1.0 - up) > 0.0
    extend = sel(two, other * (1.0 - both) + extend_due, begins) * up > 0.0

    end = sel(flex, settings.high, sel(extend, settings.low, state.end))
    turns = flex + extend > 0.0
    lasts = sel(turns, longest(settings, now, end), state.lasts)
    begin = Reference(
        sel(turns, now.position, state.begin.position),
        sel(turns, now.velocity, state.begin.velocity),
        sel(turns, now.acceleration, state.begin.acceleration),
    )
    gone = sel(turns, 0.0, gone)
    arrived = gone >= lasts
    moved = sel(flex, FLEX, sel(extend, EXTEND, state.mode))
    mode = sel(arrived * (moved == FLEX) > 0.0, HOLD, sel(arrived * (moved == EXTEND) > 0.0, REST, moved))
    after = IntentState(
        mode,
        sel(flexes, np.fmin(1.0, state.flexor + dt), 0.0),
        sel(extends, np.fmin(1.0, state.extensor + dt), 0.0),
        begin,
        end,
        lasts,
        gone,
        sel(due, 0.0, owed),
        sel(due, 0.0, alone),
    )
    return after, now


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
    share = np.fmax(0.0, np.fmin(1.0, sel(envelope < np.inf, envelope, 0.0) / full))
    goal = settings.low + share * (settings.high - settings.low)
    rate = 10.0 / settings.duration
    most = FOLLOWED_SPEED * (settings.high - settings.low) / settings.duration
    velocity = (before.velocity + dt * rate * rate * (goal - before.position)) / (1.0 + rate * dt * (2.0 + rate * dt))
    velocity = np.fmax(0.0 - most, np.fmin(most, velocity))
    return Reference(before.position + dt * velocity, velocity, (velocity - before.velocity) / dt)
