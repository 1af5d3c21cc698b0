"""The wearer's push as a source of references: interaction torque, admittance, and what lies under it.

    τ = carried·W(φ) − τ_suit,    W(φ) = m·g·c·sin(φ + φu)

τ_suit is the suit's torque on the elbow (load cell or estimate), W the weight of forearm and hand, and `carried` the
share of it that the suit is to hold up. With 0 the wearer carries the arm and the suit gets out of the way, so that
τ_suit goes to zero; with 1 the arm floats, and a limp wearer's stays where it is. τ is what the wearer pushes beyond.

An estimate is off by more than the admittance's dead band, and by another amount each time the play has been crossed.
An elbow at rest would be driven by that: the reference creeps, the drive's friction lets go at once, the play is
crossed, the error has another sign, and the reference creeps back, for ever. So what a push says against its own doubt
does not count while the elbow rests,

    τ ← f(τ, s·doubt),    s → 1 with `patience` while |φ̇| < `still`,    s → 0 with `leave` else

f being the admittance's dead band, which amplifies nothing. Who sets out must push by that much more; who moves hardly
feels it.

A law that feeds the joint back is shown q + τ/k_s, where the joint is when the motor is at q and the wearer pushes: it
would otherwise take the give of cables and fabric for an error, and pull against the wearer until one of them gave way.
Its motor stays at q, so that at an end of the range the lead τ/k_s may go beyond it: the joint is there already. It
goes no further than `room` beyond the end, inside the joint's own limits, and τ counts as no more than the admittance's
torque limit. Who pushes harder meets the law, which holds the joint there: a stop as firm as its feedback.

Under the admittance the motor is sent ahead of the law's command by what would keep it behind:

    (2ζ/ω + τd)·q̇ + q̈/ω²                                        lag of the drive, for laws that do not invert it
    (F·tanh(q̇/v) + carried·W·r/E')/(J·ω²)·r/E'                   friction and load, which a PD drive leaves as an error

F: of drive, gears and sheaths, at the spool; v: speed within which its sign goes over. Making up for less friction than
there is only costs transparency; making up for more lets the drive hunt.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.admittance.interaction import Chain, Doubt, InteractionState, interaction_start, interaction_step
from bowden.control.admittance.virtual_elbow import (
    Admittance,
    AdmittanceState,
    admittance_start,
    admittance_step,
    beyond_band,
)
from bowden.control.source import Measurement, Source
from bowden.core.kernel import kernel, sin, tanh
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference
from bowden.core.units import RADIANS
from bowden.models.suit.suit_angle import flexor_arm, spool_of

ROOM = 5.0 * RADIANS
"""How far beyond the admittance's range a reference may be led: 2.3 N·m on the paper's suit [rad]."""


class Under(NamedTuple):
    """Settings of the drive under the admittance."""

    lead: float = 0.0
    """2ζ/ω + τd; 0 for a law that inverts the drive itself [s]."""
    lead_square: float = 0.0
    """1/ω² [s²]."""
    friction: float = 0.0
    """F that is made up for, at the spool [N·m]."""
    speed: float = 0.3
    """v, of the reference [rad/s]."""
    stiffness: float = 1.0
    """J·ω² of the drive, at the spool [N·m/rad]."""
    compliance: float = 0.0
    """Of cables and fabric at the elbow, for a law that feeds the joint back [rad/(N·m)]."""
    room: float = ROOM
    """How far beyond the admittance's range such a law's reference may be led [rad]."""


class Rest(NamedTuple):
    """When the elbow rests."""

    still: float = 0.1
    """Speed below which it does [rad/s]."""
    smoothing: float = 0.05
    """Time over which the speed is taken [s]."""
    patience: float = 0.4
    """Time constant with which the doubt comes to count [s]."""
    leave: float = 0.1
    """And with which it stops to, where the elbow moves [s]."""
    sure: float = 1.5
    """How many of its doubts an estimated push must be to count [–]."""
    cell: float = 0.25
    """How large a measured one must be [N·m]."""


REST = Rest()


class Push(NamedTuple):
    """All that the source knows."""

    admittance: Admittance
    chain: Chain
    doubt: Doubt
    under: Under
    estimated: float
    """1: the torque is estimated, 0: it is the load cell's [–]."""
    carried: float
    """Share of the arm's weight that the suit holds up [–]."""
    weight: float
    """m·g·c of forearm and hand [N·m]."""
    elevation: float
    """φu, of the upper arm [rad]."""
    rest: Rest = REST


class Pushed(NamedTuple):
    """The wearer's push."""

    torque: Annotated[float, Quantity("the wearer's torque on the elbow", "N·m", symbol="τ")]
    rested: Annotated[float, Quantity("s, 0 for an elbow that moves, 1 for one at rest")]
    slow: Annotated[float, Quantity("φ, late by `Rest.smoothing`", "rad")]


class PushState(NamedTuple):
    """State of the source: the virtual elbow, the push, and the estimate."""

    virtual: AdmittanceState
    push: Pushed
    estimate: InteractionState


@kernel
def push_start(settings: Push, measured: Measurement) -> PushState:
    """At rest where the motor is: the law's first command then moves nothing."""
    estimate = interaction_start(settings.chain, spool_of(measured.motor, settings.chain.map), measured.joint)
    virtual = admittance_start(settings.admittance, measured.motor)
    return PushState(virtual, Pushed(0.0, 0.0, measured.joint), estimate)


@kernel
def stretched(settings: Push, position: float, push: float) -> float:
    """Where the joint is that the push τ holds beyond the motor [rad]: q + τ/k_s, within `room` of the range.

    A q that is beyond that itself, as at a start out of range, is led no further out. No τ, no lead. Where `room` is
    infinite, as of logs from before there was one, τ is not cut either.
    """
    virtual, under = settings.admittance, settings.under
    if not math.isfinite(push):
        return position
    most = virtual.torque_limit if math.isfinite(under.room) else math.inf
    pushed = max(-most, min(most, push))
    down = min(0.0, virtual.low - under.room - position)
    up = max(0.0, virtual.high + under.room - position)
    return position + max(down, min(up, under.compliance * pushed))


@kernel
def push_step(
    settings: Push, state: PushState, measured: Measurement, scheduled: Reference, dt: float
) -> tuple[PushState, Reference, float]:
    """One cycle: torque, admittance, and the motor's lead."""
    chain, under = settings.chain, settings.under
    spool = spool_of(measured.motor, chain.map)
    estimate = interaction_step(chain, settings.doubt, state.estimate, spool, measured.joint, measured.current, dt)
    estimated = settings.estimated > 0.5
    torque = estimate.torque if estimated else measured.load
    held = settings.carried * settings.weight * sin(estimate.joint + settings.elevation)
    push = held - torque
    slow = state.push.slow + dt / (settings.rest.smoothing + dt) * (estimate.joint - state.push.slow)
    still = abs(estimate.joint - slow) < settings.rest.still * settings.rest.smoothing
    goal, lag = (1.0, settings.rest.patience) if still else (0.0, settings.rest.leave)
    rested = state.push.rested + dt / (lag + dt) * (goal - state.push.rested)
    doubt = settings.rest.sure * estimate.doubt if estimated else settings.rest.cell
    pushed = beyond_band(push, rested * doubt)
    virtual, reference = admittance_step(settings.admittance, state.virtual, pushed, dt)
    ratio = chain.map.radius / flexor_arm(reference.position, chain.map)
    effort = under.friction * tanh(reference.velocity / under.speed) + held * ratio
    added = under.lead * reference.velocity + under.lead_square * reference.acceleration
    added = added + effort / under.stiffness * ratio
    shown = Reference(stretched(settings, reference.position, push), reference.velocity, reference.acceleration)
    return PushState(virtual, Pushed(push, rested, slow), estimate), shown, added


def push_source(settings: Push) -> Source:
    """The source with its settings.

    A law is shown the cables' stretch in the position, and on purpose not in the velocity: it is not conditioned.
    """
    return Source("admittance", settings, push_start, push_step, conditioned=False)
