"""The wearer's push as a source of references: interaction torque, admittance, and what lies under it.

    τ = carried·W(φ) − τ_suit,    W(φ) = m·g·c·sin(φ + φu)

τ_suit is the suit's torque on the elbow (load cell or estimate), W the weight of forearm and hand, and `carried` the
share of it that the suit is to hold up. With 0 the wearer carries the arm and the suit gets out of the way, so that
τ_suit goes to zero; with 1 the arm floats, and a limp wearer's stays where it is. τ is what the wearer pushes beyond.

A law that feeds the joint back is shown q + τ/k_s, where the joint is when the motor is at q and the wearer pushes: it
would otherwise take the give of cables and fabric for an error, and pull against the wearer until one of them gave way.

Under the admittance the motor is sent ahead of the law's command by what would keep it behind:

    (2ζ/ω + τd)·q̇ + q̈/ω²                                        lag of the drive, for laws that do not invert it
    (F·tanh(q̇/v) + carried·W·r/E')/(J·ω²)·r/E'                   friction and load, which a PD drive leaves as an error

F: of drive, gears and sheaths, at the spool; v: speed within which its sign goes over. Making up for less friction than
there is only costs transparency; making up for more lets the drive hunt.
"""

from typing import NamedTuple

import numpy as np

from bowden.control.admittance import Admittance, AdmittanceState, admittance_start, admittance_step
from bowden.control.interaction import Chain, Doubt, InteractionState, interaction_start, interaction_step
from bowden.control.source import Heard, Source
from bowden.core.kernel import kernel, sel, sin, tanh
from bowden.core.signals import Reference
from bowden.models.suit_angle import flexor_arm, spool_of


class Under(NamedTuple):
    """What is done for the drive under the admittance."""

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


class Pushed(NamedTuple):
    """The part of the state between virtual elbow and estimate; compiled code joins tuples, not numbers to tuples."""

    push: float
    """τ [N·m]."""


class PushState(NamedTuple):
    """What the source remembers: the virtual elbow, the push, and the estimate."""

    position: float
    velocity: float
    acceleration: float
    push: float
    spool: float
    joint: float
    spool_rate: float
    joint_rate: float
    current: float
    flexor_node: float
    extensor_node: float
    estimate: float
    doubt: float
    from_current: float
    from_stretch: float


@kernel
def push_start(settings: Push, heard: Heard) -> PushState:
    """At rest where the motor is: the law's first command then moves nothing."""
    estimate = interaction_start(settings.chain, spool_of(heard.motor, settings.chain.map), heard.joint)
    virtual = admittance_start(settings.admittance, heard.motor)
    return PushState(*(virtual[:] + Pushed(0.0)[:] + estimate[:]))


@kernel
def push_step(
    settings: Push, state: PushState, heard: Heard, scheduled: Reference, dt: float
) -> tuple[PushState, Reference, float]:
    """One cycle: torque, admittance, and the motor's lead."""
    chain, under = settings.chain, settings.under
    before = InteractionState(*state[4:15])
    spool = spool_of(heard.motor, chain.map)
    estimate = interaction_step(chain, settings.doubt, before, spool, heard.joint, heard.current, dt)
    torque = sel(settings.estimated > 0.5, estimate.torque, heard.load)
    held = settings.carried * settings.weight * sin(estimate.joint + settings.elevation)
    push = held - torque
    virtual, reference = admittance_step(settings.admittance, AdmittanceState(*state[0:3]), push, dt)
    ratio = chain.map.radius / flexor_arm(reference.position, chain.map)
    effort = under.friction * tanh(reference.velocity / under.speed) + held * ratio
    added = under.lead * reference.velocity + under.lead_square * reference.acceleration
    added = added + effort / under.stiffness * ratio
    given = sel((push > -np.inf) * (push < np.inf), under.compliance * push, 0.0)
    shown = Reference(reference.position + given, reference.velocity, reference.acceleration)
    return PushState(*(virtual[:] + Pushed(push)[:] + estimate[:])), shown, added


PUSH_UNITS = {
    **dict.fromkeys(("position", "spool", "joint"), "rad"),
    **dict.fromkeys(("velocity", "spool_rate", "joint_rate"), "rad/s"),
    "acceleration": "rad/s²",
    **dict.fromkeys(("push", "estimate", "doubt", "from_current", "from_stretch"), "N·m"),
    "current": "A",
    **dict.fromkeys(("flexor_node", "extensor_node"), "m"),
}
"""Field of `PushState` → its unit."""


def push_source(settings: Push) -> Source:
    """The source with its settings."""
    return Source("admittance", settings, push_start, push_step, PUSH_UNITS)
