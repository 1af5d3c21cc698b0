"""No compensation: the motor is sent where the joint should be (Fig. 7B).

    command = motor_zero + reference/slope

The paper's law has slope 1, on a bench of 0.938, and a motor encoder zeroed where the joint is at zero. Of an
identified cable slope and zero are known: what is left is what the hysteresis costs.
"""

from typing import Annotated, NamedTuple

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
    """State of the law from one cycle to the next."""

    command: Annotated[float, Quantity("the last command", "rad")]


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
    from_rig={"slope": "slope", "motor_zero": "motor_zero"},
    tunable=frozenset(),
    feeds_back=frozenset(),
)
