"""No compensation: the motor is sent where the joint should be (Fig. 7B).

    command = motor_zero + reference/slope

The paper's law has slope 1, on a bench of 0.938, and a motor encoder zeroed where the joint is at zero. Pulleys and
zeros of another rig are no backlash: a law without them would have them as its error and little else. What a sheath
takes of its slope stays its error, as on the paper's bench; a slope that no loss of a sheath explains is that of its
spools, and the law has it.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.knowledge import Knowledge
from bowden.control.law import Law
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample


class UncompensatedGains(NamedTuple):
    """How a cable without backlash would run."""

    slope: float = 1.0
    """Assumed joint motion per motor motion; negative where the cable runs the other way [rad/rad]."""
    motor_zero: float = 0.0
    """Motor angle at which the joint is at zero [rad]."""


class UncompensatedState(NamedTuple):
    """What the law remembers."""

    command: Annotated[float, Quantity("the last command", "rad")]


LEAST, MOST = 0.85, 1.12
"""Slope over that of a bench with these pulleys, as a sheath leaves it: 0.8 to 1.05 joint per motor through pulleys of
1 to 1. Recorded cables have 0.84 to 0.90; a ratio that is not near a whole one lies outside [–]."""


def pulleys(known: Knowledge) -> float:
    """Ratio of the pulleys, whole or 1 over a whole one, that a sheath's loss explains; else the cable's own slope."""
    slope = abs(known.relative_slope)
    ratio = float(round(slope)) if slope >= 1.0 else 1.0 / round(1.0 / slope)
    if not LEAST <= slope / ratio <= MOST:
        ratio = slope if math.isnan(known.slope) else abs(known.slope)
    return math.copysign(ratio, known.relative_slope)


@kernel
def start(gains: UncompensatedGains, sample: Sample) -> UncompensatedState:
    """Begin where the motor is."""
    return UncompensatedState(sample.motor)


@kernel
def step(
    gains: UncompensatedGains, state: UncompensatedState, sample: Sample, reference: Reference, dt: float
) -> tuple[UncompensatedState, float]:
    """command = motor_zero + reference/slope."""
    command = gains.motor_zero + reference.position / gains.slope
    return UncompensatedState(command), command


LAW = Law(
    name="uncompensated",
    gains=UncompensatedGains(),
    start_kernel=start,
    step_kernel=step,
    source="Dinh et al. 2017, Section 3.1, Fig. 7B",
    from_rig={"slope": pulleys, "motor_zero": "motor_zero"},
    tunable=frozenset(),
    feeds_back=frozenset(),
)
