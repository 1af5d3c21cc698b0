"""A control law as a module of C."""

import re
from typing import Any, NamedTuple

from bowden.control.conditioning import Conditioned, condition_start, condition_step
from bowden.control.law import Law
from bowden.core.quantity import meanings
from bowden.core.signals import Reference, Sample
from bowden.export.checked import Argument, Function
from bowden.export.layout import identifier
from bowden.export.module import Module
from bowden.rig import counts


def law_module(law: Law, sample_time: float, encoders: counts.Counts | None = None) -> Module:
    """``NAME_start`` and ``NAME_step``, with the law's gains as constants, and the conditioner of its reference within.

    What one cycle does between source and wish, `bowden.cycle.one_cycle`, is one function of C. The cycle's length is a
    constant like the gains, so that what they fix together is worked out here or by the compiler, and never in a cycle.

    Args:
        law: with its gains.
        sample_time: length of a cycle [s].
        encoders: how the rig's count, where the code is to have their conversions.
    """
    sample, reference, state = Sample(0.0, 0.0), Reference(0.0, 0.0, 0.0), state_of(law)
    own: Any = type(law.start(sample))
    whole: Any = type(state)

    def start(gains: Any, conditioning: Any, sample: Sample) -> Any:
        return whole(*law.start_kernel(gains, sample), condition_start(conditioning, sample))

    def step(gains: Any, conditioning: Any, state: Any, sample: Sample, reference: Reference, dt: float) -> Any:
        conditioned, shown = condition_step(conditioning, state.conditioned, reference, dt)
        after, command = law.step_kernel(gains, own(*state[:-1]), sample, shown, dt)
        return whole(*after, conditioned), command

    gains = Argument("gains", law.gains, constant=True, plain=True)
    conditioning = Argument("conditioning", law.conditioning, constant=True)
    seen = Argument("sample", sample)
    period = Argument("sample_time", float(sample_time), constant=True, said="length of a cycle [s]")
    return Module(
        prefix(law),
        f"The control law {law.name!r}: {law.source}.",
        (
            Function(
                "start",
                start,
                (gains, conditioning, seen),
                ("state",),
                "The state in which a law begins at a sample.",
                law.start_kernel,
            ),
            Function(
                "step",
                step,
                (gains, conditioning, Argument("state", state), seen, Argument("reference", reference), period),
                ("state", "return"),
                f"One cycle, to be called every {sample_time:g} s: the motor's target angle [rad].",
                law.step_kernel,
            ),
            *(() if encoders is None else _conversions(encoders)),
        ),
        structs={"state": "state", "sample": "sample", "reference": "reference"},
        units=law.state_units,
        meanings=dict(meanings(own)),
    )


def _conversions(encoders: counts.Counts) -> tuple[Function, ...]:
    """``NAME_motor_angle``, ``NAME_joint_angle`` and ``NAME_motor_counts``."""
    constant, said = (
        Argument("encoders", encoders, constant=True),
        "from counts of an encoder that counts as in its log",
    )
    n, angle = Argument("counts", 0.0), Argument("angle", 0.0)
    return (
        Function("motor_angle", counts.motor_angle, (constant, n), ("return",), f"The motor's angle [rad] {said}."),
        Function("joint_angle", counts.joint_angle, (constant, n), ("return",), f"The joint's angle [rad] {said}."),
        Function("motor_counts", counts.motor_counts, (constant, angle), ("return",), "A target [rad] in counts."),
    )


def state_of(law: Law) -> Any:
    """What the code of a law remembers, as an example: the law's state, and behind it the conditioner's."""
    sample = Sample(0.0, 0.0)
    own, named = law.start(sample), NamedTuple
    whole: Any = named("State", [*((name, Any) for name in own._fields), ("conditioned", Conditioned)])
    return whole(*own, condition_start(law.conditioning, sample))


def prefix(law: Law) -> str:
    """What every name of the law's code begins with."""
    return re.sub(r"_+", "_", identifier(law.name)).lower()
