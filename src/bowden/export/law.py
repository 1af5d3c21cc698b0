"""A control law as a module of C."""

import re

from bowden.control.law import Law
from bowden.core.signals import Reference, Sample
from bowden.export.checked import Argument, Function
from bowden.export.layout import identifier
from bowden.export.module import Module


def law_module(law: Law) -> Module:
    """``NAME_start`` and ``NAME_step``, with the law's gains as constants."""
    sample, reference = Sample(0.0, 0.0), Reference(0.0, 0.0, 0.0)
    state = law.start(sample)
    gains = Argument("gains", law.gains, constant=True)
    seen = Argument("sample", sample)
    return Module(
        prefix(law),
        f"The control law {law.name!r}: {law.source}.",
        (
            Function(
                "start", law.start_kernel, (gains, seen), ("state",), "The state with which the law begins at a sample."
            ),
            Function(
                "step",
                law.step_kernel,
                (gains, Argument("state", state), seen, Argument("reference", reference), Argument("dt", 0.001)),
                ("state", "return"),
                "One cycle of dt [s]: the motor's target angle [rad].",
            ),
        ),
        structs={"state": "state", "sample": "sample", "reference": "reference"},
        units=law.state_units,
    )


def prefix(law: Law) -> str:
    """What every name of the law's code begins with."""
    return re.sub(r"_+", "_", identifier(law.name)).lower()
