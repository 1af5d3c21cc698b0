"""A control law as a module of C."""

import re
from typing import Any, NamedTuple

from bowden.control.conditioning import Conditioned, Conditioning, condition_start, condition_step
from bowden.control.law import Law, law_start, law_step
from bowden.core.kernel import kernel
from bowden.core.signals import Reference, Sample
from bowden.export.kinds import identifier
from bowden.export.module import Constant, Module, Public
from bowden.models.minimum_jerk import minimum_jerk, minimum_jerk_from
from bowden.models.suit.suit_angle import SpoolMap, motor_of, spool_of
from bowden.rig import counts


class LawState(NamedTuple):
    """What is remembered from one cycle to the next."""

    law: Any
    """By the law."""
    conditioned: Conditioned
    """By the conditioner of its reference."""


@kernel
def begin_cycles(gains: Any, conditioning: Conditioning, sample: Sample) -> LawState:
    """The state in which a law begins at a sample."""
    return LawState(law_start(gains, sample), condition_start(conditioning, sample))


@kernel
def cycle(
    gains: Any, conditioning: Conditioning, state: LawState, sample: Sample, reference: Reference, sample_time: float
) -> tuple[LawState, float]:
    """One cycle: the conditioner makes of the reference what the law is shown, and the law makes its command."""
    conditioned, shown = condition_step(conditioning, state.conditioned, reference, sample_time)
    law, command = law_step(gains, state.law, sample, shown, sample_time)
    return LawState(law, conditioned), command


def law_module(law: Law, sample_time: float, encoders: counts.Counts | SpoolMap | None = None) -> Module:
    """``NAME_start`` and ``NAME_step``, with the law's gains as constants, and the conditioner of its reference within.

    What `bowden.cycle.one_cycle` does between source and requested target is one function of C. The cycle's length is a
    constant like the gains, so that what they fix together is worked out by the compiler, and never in a cycle.

    Args:
        law: with its gains.
        sample_time: length of a cycle [s].
        encoders: how the rig's count, or on a suit how its spool turns; None for code without conversions.
    """
    given = {
        "gains": Constant(law.gains, "the law's gains"),
        "conditioning": Constant(law.conditioning, "what the conditioner knows of the rig"),
    }
    steps = given | {"state": state_of(law), "sample_time": Constant(float(sample_time), "length of a cycle [s]")}
    begun = "The state in which a law begins at a sample."
    stepped = f"One cycle, to be called every {sample_time:g} s: the motor's target angle [rad]."
    return Module(
        prefix(law),
        f"The control law {law.name!r}: {law.source}.",
        [
            Public("start", begin_cycles, ("state",), begun, given),
            Public("step", cycle, ("state", "return"), stepped, steps),
            *_motions(),
            *([] if encoders is None else _conversions(encoders)),
        ],
        parts=(("law_start", law.start_kernel), ("law_step", law.step_kernel)),
        units=dict(law.state_units),
    )


def _motions() -> list[Public]:
    """``NAME_minimum_jerk``, from rest, and ``NAME_minimum_jerk_from`` a motion."""
    said = "to rest at an end [rad]: the reference at a time since it began [s], of a duration [s]"
    return [
        Public("minimum_jerk", minimum_jerk, ("return",), f"The motion of minimum jerk from rest {said}."),
        Public("minimum_jerk_from", minimum_jerk_from, ("return",), f"The same from a motion {said}."),
    ]


def _conversions(encoders: counts.Counts | SpoolMap) -> list[Public]:
    """``NAME_motor_angle``, ``NAME_joint_angle`` and ``NAME_motor_counts``; on a suit ``_spool_angle``."""
    if isinstance(encoders, SpoolMap):
        suit = {"suit": Constant(encoders, "how the spool turns with the elbow")}
        angle_of = "The motor's angle in the joint's coordinate [rad] from the spool's [rad]."
        return [
            Public("motor_angle", motor_of, ("return",), angle_of, suit),
            Public("spool_angle", spool_of, ("return",), "The other way round [rad].", suit),
        ]
    how = {"counts": Constant(encoders, "how the rig's encoders count")}
    said = "from counts of an encoder that counts as in its log"
    return [
        Public("motor_angle", counts.motor_angle, ("return",), f"The motor's angle [rad] {said}.", how),
        Public("joint_angle", counts.joint_angle, ("return",), f"The joint's angle [rad] {said}.", how),
        Public("motor_counts", counts.motor_counts, ("return",), "A target [rad] in counts.", how),
    ]


def state_of(law: Law) -> LawState:
    """What the code of a law remembers, as an example."""
    sample = Sample(0.0, 0.0)
    return LawState(law.start(sample), condition_start(law.conditioning, sample))


def prefix(law: Law) -> str:
    """What every name of the law's code begins with."""
    return re.sub(r"_+", "_", identifier(law.name)).lower()
