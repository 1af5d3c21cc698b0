"""Other readings of the paper's equations, as laws: wrapped round the one we take, for the errata only."""

from dataclasses import replace
from typing import NamedTuple

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.laws.adaptive import AdaptiveGains, AdaptiveState
from bowden.control.laws.adaptive import step as adaptive_step
from bowden.control.laws.observer import ObserverGains, ObserverState
from bowden.control.laws.observer import start as observer_start
from bowden.control.laws.observer import step as observer_step
from bowden.core.kernel import kernel, tanh
from bowden.core.signals import Reference, Sample


@kernel
def command_step(
    gains: AdaptiveGains, state: AdaptiveState, sample: Sample, reference: Reference, dt: float
) -> tuple[AdaptiveState, float]:
    """Eq. 14 as its symbol is printed: the motor command in place of φ̄ in the law for β̂."""
    after, command = adaptive_step(gains, state, sample, reference, dt)
    slope_inverse = state.slope_inverse - dt * gains.slope_adaptation * (
        command * after.filtered_error + gains.slope_leakage * state.slope_inverse
    )
    return AdaptiveState(
        after.integral, slope_inverse, after.bound, after.joint, after.joint_rate, after.filtered_error
    ), command


@kernel
def absorbed_step(
    gains: AdaptiveGains, state: AdaptiveState, sample: Sample, reference: Reference, dt: float
) -> tuple[AdaptiveState, float]:
    """The unknown β of Eq. 14 absorbed into δ2 in the law for D̂m, where we put β̂."""
    after, command = adaptive_step(gains, state, sample, reference, dt)
    s = after.filtered_error
    bound = state.bound + dt * gains.bound_adaptation * (
        tanh(s / gains.smoothing) * s - gains.bound_leakage * state.bound
    )
    return AdaptiveState(after.integral, after.slope_inverse, bound, after.joint, after.joint_rate, s), command


class SelfFedState(NamedTuple):
    """State of the observer that is driven by its own command."""

    h: float
    driver: float
    command: float


@kernel
def self_fed_start(gains: ObserverGains, sample: Sample) -> SelfFedState:
    """As the observer's."""
    state = observer_start(gains, sample)
    return SelfFedState(state.h, state.driver, sample.motor)


@kernel
def self_fed_step(
    gains: ObserverGains, state: SelfFedState, sample: Sample, reference: Reference, dt: float
) -> tuple[SelfFedState, float]:
    """Eq. 8 read literally: ĥ driven by the command of the cycle before."""
    own = Sample(sample.joint, state.command, sample.joint_age, sample.joint_std)
    after, command = observer_step(gains, ObserverState(state.h, state.driver), own, reference, dt)
    return SelfFedState(after.h, after.driver, command), command


COMMAND_IN_EQ14: Law = replace(LAWS["adaptive"], name="adaptive_command_in_eq14", step_kernel=command_step)
"""The adaptive law with the motor command in Eq. 14."""

BETA_ABSORBED: Law = replace(LAWS["adaptive"], name="adaptive_beta_absorbed", step_kernel=absorbed_step)
"""The adaptive law with β absorbed into δ2."""


def self_fed(observer: Law) -> Law:
    """The observer driven by its own command."""
    return replace(observer, name="observer_self_fed", start_kernel=self_fed_start, step_kernel=self_fed_step)
