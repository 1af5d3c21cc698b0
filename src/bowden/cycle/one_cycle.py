"""One cycle of the live loop as one compiled function: filter, source of the reference, law, supervisor.

Read and write stand around it in `runtime.loop`. States go in and come out as NamedTuples: boxing them costs 20 µs a
cycle, which buys that source, law and supervisor are the very kernels of the simulation.
"""

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from bowden.control import source as references
from bowden.control.knowledge import measured
from bowden.control.law import Law, law_start, law_step
from bowden.control.source import TABLE, Heard, source_start, source_step
from bowden.core.kernel import kernel, specialise
from bowden.core.signals import DriveReading, Reference, Sample
from bowden.models.drive.thermal import ThermalState
from bowden.models.plausible import Followed, follow
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
    """For the law, or for the source that makes it; NaN where there is none."""


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
    asked: Any
    """That of the reference's source, likewise."""
    supervisor: SupervisorState


@kernel
def led(limits: Limits, command: float, added: float) -> float:
    """A law's command and what its source adds, which takes it no further than the motor's range [rad].

    What is no number, or a law's command that is out of range itself, is left to the supervisor.

    >>> led(Limits(motor_low=-0.25, motor_high=2.0), 0.0, -0.75), led(Limits(motor_high=2.0), 2.5, 0.5)
    (-0.25, 2.5)
    """
    wish = command + added
    if command < limits.motor_low or command > limits.motor_high:
        return command
    if wish < limits.motor_low:
        return limits.motor_low
    if wish > limits.motor_high:
        return limits.motor_high
    return wish


@kernel
def credible(limits: Limits, before: Followed, angle: float, fastest: float, time: float) -> bool:
    """Whether the supervisor will take an angle for true: it can be, and motion explains it."""
    _, lost, jumped = follow(before, angle, time, limits.sensor_span, limits.jump, fastest, limits.speed_filter)
    return lost + jumped == 0.0


@kernel
def one_cycle(
    gains: Any,
    source: Any,
    limits: Limits,
    filters: Filters,
    state: CycleState,
    observed: Observed,
    plan: Plan,
    dt: float,
) -> tuple[CycleState, Reference, float, Verdict]:
    """The state after this cycle, the law's reference, the wish for the motor [rad], and what the drive is told.

    The source hears what the law sees, but an angle that is missing or not credible as missing: a push is not guessed.
    """
    reading = observed.reading
    joint = last_valid(state.sample.joint, reading.joint)
    motor = last_valid(state.sample.motor, reading.motor)
    sample = Sample(
        low_pass(state.sample.joint, joint, filters.joint, dt), low_pass(state.sample.motor, motor, filters.motor, dt)
    )
    watched = state.supervisor
    law, asked, reference, wish = state.law, state.asked, plan.reference, watched.target
    if plan.source == LAW_BEGINS:
        law = law_start(gains, sample)
        asked = source_start(source, Heard(sample.joint, sample.motor, reading.current, math.nan))
    if plan.source >= LAW_BEGINS:
        time, motors, joints = np.fmax(dt, observed.elapsed), Followed(*watched[12:15]), Followed(*watched[15:18])
        seen = Heard(
            sample.joint if credible(limits, joints, reading.joint, limits.joint_speed, time) else math.nan,
            sample.motor if credible(limits, motors, reading.motor, limits.motor_speed, time) else math.nan,
            reading.current,
            math.nan,
        )
        asked, reference, added = source_step(source, asked, seen, plan.reference, dt)
        law, command = law_step(gains, law, sample, reference, dt)
        wish = led(limits, command, added)
    elif plan.source == MOTION:
        wish = plan.motor
    supervisor, verdict = supervise(limits, watched, observed, wish, dt)
    return CycleState(sample, law, asked, supervisor), reference, wish, verdict


NOWHERE = Reference(math.nan, math.nan, math.nan)
"""Where the joint should be while no law has it."""


class Cycle:
    """A law under the supervisor, compiled and ready: `step` is one cycle.

    Args:
        law: with its gains.
        limits: the supervisor's.
        filters: in front of the law.
        period: length of a cycle [s].
        source: of the reference; the plan's own where it is not given.
    """

    def __init__(
        self, law: Law, limits: Limits, filters: Filters, period: float, source: references.Source = TABLE
    ) -> None:
        self.law, self.limits, self.filters, self.period, self.source = law, limits, filters, period, source
        self._gains = law.gains
        self._run: Callable[..., tuple[CycleState, Reference, float, Verdict]] = specialise(
            one_cycle,
            f"{law.name}_{source.name}",
            law_start=law.start_kernel,
            law_step=law.step_kernel,
            source_start=source.start_kernel,
            source_step=source.step_kernel,
        )
        self.reference = NOWHERE
        """What the law was told last."""
        self.state: CycleState

    def begin(self, reading: DriveReading, thermal: ThermalState) -> None:
        """Start stopped at this reading, and compile all that a cycle needs; takes seconds the first time."""
        joint, motor = (0.0 if math.isnan(angle) else float(angle) for angle in (reading.joint, reading.motor))
        sample = Sample(joint, motor)
        law, asked = self.law.start(sample), self.source.start(Heard(joint, motor, 0.0, math.nan))
        fresh = CycleState(
            sample,
            type(law)(*map(float, law)),  # whole numbers in a user's start would be compiled for apart
            type(asked)(*map(float, asked)),
            SupervisorState(*map(float, begin(self.limits, reading, thermal))),
        )
        self.state = fresh
        observed = Observed(reading, 0.0, self.period, 0.0, 0.0, 0.0, 0.0, 0.0)
        for source in (HOLD, MOTION, LAW_BEGINS, LAW):
            self.step(observed, Plan(source, motor, Reference(joint, 0.0, 0.0)))
        self.state = fresh

    def know(self, width: float) -> None:
        """Let the law begin with the dead zone that was measured [rad], where it takes one; NaN is none."""
        self._gains = measured(self.law, width).gains

    def step(self, observed: Observed, plan: Plan) -> tuple[float, Verdict]:
        """The wish for the motor [rad] and the verdict on it."""
        self.state, self.reference, wish, verdict = self._run(
            self._gains, self.source.settings, self.limits, self.filters, self.state, observed, plan, self.period
        )
        return wish, verdict

    def asked(self) -> tuple[float, ...]:
        """What is recorded of the reference's source: its state, and nothing of a table."""
        return () if self.source is TABLE else tuple(self.state.asked)
