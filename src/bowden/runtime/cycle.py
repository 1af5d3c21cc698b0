"""One cycle of the live loop as one compiled function: filter, law, supervisor.

Read and write stand around it in `runtime.loop`. States go in and come out as NamedTuples: boxing them costs 20 µs a
cycle, which buys that law and supervisor are the very kernels of the simulation.
"""

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

from bowden.control.law import Law, law_start, law_step
from bowden.core.kernel import kernel, specialise
from bowden.core.signals import DriveReading, Reference, Sample
from bowden.models.thermal import ThermalState
from bowden.safety.limits import Limits
from bowden.safety.supervisor import Observed, SupervisorState, Verdict, begin, supervise
from bowden.sensing.filters import last_valid, low_pass


class Source(IntEnum):
    """Where the wish for the motor comes from in a cycle."""

    HOLD = 0
    """The target stays where the supervisor has it."""
    MOTION = 1
    """A motion of the motor, planned beforehand: preflight, approach, excitation."""
    LAW_BEGINS = 2
    """The law, which begins anew at this cycle's sample."""
    LAW = 3
    """The law."""


HOLD, MOTION, LAW_BEGINS, LAW = (float(source) for source in Source)


class Plan(NamedTuple):
    """What is planned for one cycle."""

    source: float
    """Number of a `Source`."""
    motor: float
    """Target of a `MOTION` [rad]."""
    reference: Reference
    """For the law; NaN where there is none."""


class Filters(NamedTuple):
    """Cut-off of the low-pass on each angle that the law sees; 0 for none [rad/s]."""

    joint: float = 0.0
    motor: float = 0.0


class CycleState(NamedTuple):
    """What one cycle hands to the next."""

    sample: Sample
    """What the law saw."""
    law: Any
    """The law's own state, a flat NamedTuple of floats."""
    supervisor: SupervisorState


@kernel
def one_cycle(
    gains: Any, limits: Limits, filters: Filters, state: CycleState, observed: Observed, plan: Plan, dt: float
) -> tuple[CycleState, float, Verdict]:
    """The state after this cycle, what was wished for the motor [rad], and what the drive is told."""
    joint = last_valid(state.sample.joint, observed.reading.joint)
    motor = last_valid(state.sample.motor, observed.reading.motor)
    sample = Sample(
        low_pass(state.sample.joint, joint, filters.joint, dt), low_pass(state.sample.motor, motor, filters.motor, dt)
    )
    law, wish = state.law, state.supervisor.target
    if plan.source == LAW_BEGINS:
        law = law_start(gains, sample)
    if plan.source >= LAW_BEGINS:
        law, wish = law_step(gains, law, sample, plan.reference, dt)
    elif plan.source == MOTION:
        wish = plan.motor
    supervisor, verdict = supervise(limits, state.supervisor, observed, wish, dt)
    return CycleState(sample, law, supervisor), wish, verdict


NOWHERE = Reference(math.nan, math.nan, math.nan)
"""Where the joint should be while no law has it."""


class Cycle:
    """A law under the supervisor, compiled and ready: `step` is one cycle.

    Args:
        law: with its gains.
        limits: the supervisor's.
        filters: in front of the law.
        period: length of a cycle [s].
    """

    def __init__(self, law: Law, limits: Limits, filters: Filters, period: float) -> None:
        self.law, self.limits, self.filters, self.period = law, limits, filters, period
        self._gains = law.gains
        self._run: Callable[..., tuple[CycleState, float, Verdict]] = specialise(
            one_cycle, law.name, law_start=law.start_kernel, law_step=law.step_kernel
        )
        self.state: CycleState

    def begin(self, reading: DriveReading, thermal: ThermalState) -> None:
        """Start stopped at this reading, and compile all that a cycle needs; takes seconds the first time."""
        joint, motor = (0.0 if math.isnan(angle) else float(angle) for angle in (reading.joint, reading.motor))
        sample = Sample(joint, motor)
        law = self.law.start(sample)
        fresh = CycleState(
            sample,
            type(law)(*map(float, law)),  # whole numbers in a user's start would be compiled for apart
            SupervisorState(*map(float, begin(self.limits, reading, thermal))),
        )
        self.state = fresh
        observed = Observed(reading, 0.0, self.period, 0.0, 0.0, 0.0, 0.0, 0.0)
        for source in (HOLD, MOTION, LAW_BEGINS, LAW):
            self.step(observed, Plan(source, motor, Reference(joint, 0.0, 0.0)))
        self.state = fresh

    def step(self, observed: Observed, plan: Plan) -> tuple[float, Verdict]:
        """The wish for the motor [rad] and the verdict on it."""
        self.state, wish, verdict = self._run(
            self._gains, self.limits, self.filters, self.state, observed, plan, self.period
        )
        return wish, verdict
