"""One cycle of the loop, wherever it runs: sense → reference → law → supervisor, as one kernel.

    one_cycle(settings, state, observed, plan, dt) -> (state, reference, requested_target, verdict)

Between source and law stands the conditioner (`control.conditioning`): the law is shown a motion, whatever the source
gives. What is recorded as the reference, and what errors are taken to, is what the source gave. Law, source and, for
sources that ask for it, conditioner are placeholders, and so are three parts that a loop may have or not, which
`specialise` fills with `SUPERVISED` (the live loop, replay and the fault matrix) or with `BARE` (simulation of a law
alone):

    cycle_sense(settings, state, observed, dt) -> (sample, measured)           what law and source see of the readings
    cycle_target(limits, command, added) -> requested_target     the law's command, with what the source adds
    cycle_verdict(limits, supervisor, observed, requested_target, reference, dt) -> (supervisor, verdict)

A part that is left out costs nothing once it is compiled. Reading and writing stand around the cycle.
"""

import math
import struct
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.conditioning import Conditioned, Conditioning, condition_start, condition_step
from bowden.control.law import Law, law_start, law_step
from bowden.control.source import TABLE, Measurement, Source, source_start, source_step
from bowden.core.kernel import kernel, placeholder, specialise
from bowden.core.nested import flat, map_leaves, name_of, names, numbers_of, unflatten, zeros_of
from bowden.core.signals import DriveReading, Power, Reference, Sample
from bowden.models.drive.thermal import ThermalState
from bowden.safety.evidence import ValidatedReadings, validate_readings
from bowden.safety.faults import Fault, Reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, SupervisorState, Verdict
from bowden.safety.supervisor import begin, supervise
from bowden.sensing.filters import low_pass

Array = NDArray[np.float64]


class TargetSource(IntEnum):
    """Where the requested target for the motor comes from in a cycle."""

    HOLD = 0
    """The target stays where the supervisor has it."""
    MOTION = 1
    """A motion of the motor, planned beforehand: preflight, approach, excitation."""
    LAW_BEGINS = 2
    """The law, which starts again at this cycle's sample."""
    LAW = 3
    """The law."""


HOLD, MOTION, LAW_BEGINS, LAW = TargetSource


class Plan(NamedTuple):
    """The plan for one cycle."""

    source: TargetSource
    motor: float
    """Target of a `MOTION` [rad]."""
    reference: Reference
    """For the law, or for the source that makes it; NaN where there is none."""


class Filters(NamedTuple):
    """Cut-off of the low-pass on each angle that the law sees; 0 for none [rad/s]."""

    joint: float = 0.0
    motor: float = 0.0


class CycleSettings(NamedTuple):
    """Constants of a run."""

    gains: Any
    """The law's."""
    conditioning: Conditioning
    """Of the reference, before the law is shown it."""
    source: Any
    """Settings of the reference's source."""
    filters: Any
    """`Filters`, where there are any."""
    limits: Any
    """The supervisor's `Limits`, where there is one."""


class CycleState(NamedTuple):
    """State handed from one cycle to the next."""

    sample: Sample
    """Sample that the law was given."""
    law: Any
    """The law's own state."""
    conditioned: Conditioned
    """The reference that the law was shown."""
    source: Any
    """That of the reference's source."""
    supervisor: Any
    """That of the supervisor, or of what stands in its place; ``target`` is what the drive was sent last [rad]."""


@placeholder
def cycle_condition(
    conditioning: Conditioning, conditioned: Conditioned, reference: Reference, dt: float
) -> tuple[Conditioned, Reference]:
    """Placeholder for what the law is shown of the source's reference."""
    raise NotImplementedError  # always replaced


@placeholder
def cycle_sense(settings: CycleSettings, state: CycleState, observed: Any, dt: float) -> tuple[Sample, Measurement]:
    """Placeholder for what law and source are shown of the readings."""
    raise NotImplementedError  # always replaced


@placeholder
def cycle_target(limits: Any, command: float, added: float) -> float:
    """Placeholder for how a law's command and what the source adds make the requested target [rad]."""
    raise NotImplementedError  # always replaced


@placeholder
def cycle_verdict(
    limits: Any, state: Any, observed: Any, requested_target: float, reference: float, dt: float
) -> tuple[Any, Verdict]:
    """Placeholder for the supervisor."""
    raise NotImplementedError  # always replaced


@kernel
def one_cycle(
    settings: CycleSettings, state: CycleState, observed: Any, plan: Plan, dt: float
) -> tuple[CycleState, Reference, float, Verdict]:
    """One cycle.

    Args:
        settings: of the run.
        state: after the cycle before.
        observed: what there is to see in this cycle: `Measurement` for a bare law, `Observed` under the supervisor.
        plan: who has the motor, and the reference that is scheduled.
        dt: length of a cycle [s].

    Returns:
        The state after this cycle, the source's reference, the motor's requested target [rad], and what the drive is
        sent.
    """
    sample, measured = cycle_sense(settings, state, observed, dt)
    law, conditioned, source = state.law, state.conditioned, state.source
    reference, requested_target = plan.reference, state.supervisor.target
    if plan.source == TargetSource.LAW_BEGINS:
        law = law_start(settings.gains, sample)
        conditioned = condition_start(settings.conditioning, sample)
        begun = Measurement(
            sample.joint, sample.motor, measured.current, measured.load, sample.joint_age, sample.joint_std
        )
        source = source_start(settings.source, begun)
    if plan.source == TargetSource.LAW_BEGINS or plan.source == TargetSource.LAW:
        source, reference, added = source_step(settings.source, source, measured, plan.reference, dt)
        conditioned, shown = cycle_condition(settings.conditioning, conditioned, reference, dt)
        law, command = law_step(settings.gains, law, sample, shown, dt)
        requested_target = cycle_target(settings.limits, command, added)
    elif plan.source == TargetSource.MOTION:
        requested_target = plan.motor
    supervisor, verdict = cycle_verdict(
        settings.limits, state.supervisor, observed, requested_target, reference.position, dt
    )
    return CycleState(sample, law, conditioned, source, supervisor), reference, requested_target, verdict


class Unsupervised(NamedTuple):
    """Stands in for the supervisor where there is none."""

    target: float
    """The requested target of the cycle before [rad]."""


@kernel
def as_measured(
    settings: CycleSettings, state: CycleState, observed: Measurement, dt: float
) -> tuple[Sample, Measurement]:
    """`cycle_sense` of a bare law: the readings as they are."""
    return Sample(observed.joint, observed.motor, observed.joint_age, observed.joint_std), observed


@kernel
def summed(limits: Any, command: float, added: float) -> float:
    """`cycle_target` of a bare law [rad]."""
    return command + added


@kernel
def unsupervised(
    limits: Any, state: Unsupervised, observed: Any, requested_target: float, reference: float, dt: float
) -> tuple[Unsupervised, Verdict]:
    """`cycle_verdict` of a bare law: the requested target itself, at power on."""
    return Unsupervised(requested_target), Verdict(requested_target, Power.ON, Mode.RUNNING, Reaction.NONE, 0)


BARE: dict[str, Callable[..., Any]] = {
    "cycle_sense": as_measured,
    "cycle_target": summed,
    "cycle_verdict": unsupervised,
}
"""A law alone: neither filter nor supervisor, and no state of theirs."""


@kernel
def bare_settings(gains: Any, conditioning: Conditioning, source: Any) -> CycleSettings:
    """The settings of a bare law."""
    return CycleSettings(gains, conditioning, source, 0.0, 0.0)


@kernel
def bare_start(settings: CycleSettings, measured: Measurement) -> CycleState:
    """The state with which a bare law begins."""
    sample = Sample(measured.joint, measured.motor, measured.joint_age, measured.joint_std)
    law, source = law_start(settings.gains, sample), source_start(settings.source, measured)
    conditioned = condition_start(settings.conditioning, sample)
    return CycleState(sample, law, conditioned, source, Unsupervised(measured.motor))


@kernel
def filtered_sample(
    filters: Filters, before: Sample, readings: ValidatedReadings, reading: DriveReading, dt: float
) -> Sample:
    """The last valid angles, each behind its low-pass."""
    return Sample(
        low_pass(before.joint, readings.joint.sensor.value, filters.joint, dt),
        low_pass(before.motor, readings.motor.sensor.value, filters.motor, dt),
        reading.joint_sensor_age,
        reading.joint_std,
    )


@kernel
def filtered_measurement(
    settings: CycleSettings, state: CycleState, observed: Observed, dt: float
) -> tuple[Sample, Measurement]:
    """`cycle_sense` under the supervisor: the angles that the supervisor itself goes by, each behind its low-pass.

    While an angle is missing or not credible the law has the last one that was, so that what the supervisor bridges
    leaves no trace in it. For the source such an angle is missing: a push is not guessed.
    """
    readings = validate_readings(settings.limits, state.supervisor, observed, dt)
    joint, motor = readings.joint, readings.motor
    sample = filtered_sample(settings.filters, state.sample, readings, observed.reading, dt)
    measured = Measurement(
        math.nan if joint.lost or joint.jumped else sample.joint,
        math.nan if motor.lost or motor.jumped else sample.motor,
        observed.reading.current,
        observed.reading.joint_torque,
        sample.joint_age,
        sample.joint_std,
    )
    return sample, measured


@kernel
def clamp_offset(limits: Limits, command: float, added: float) -> float:
    """`cycle_target` under the supervisor: what is added takes the command no further than the motor's range [rad].

    What is no number, or a law's command that is out of range itself, is left to the supervisor.

    >>> clamp_offset(Limits(motor_low=-0.25), 0.0, -0.75), clamp_offset(Limits(motor_high=2.0), 2.5, 0.5)
    (-0.25, 2.5)
    """
    requested_target = command + added
    if command < limits.motor_low or command > limits.motor_high:
        return command
    if requested_target < limits.motor_low:
        return limits.motor_low
    if requested_target > limits.motor_high:
        return limits.motor_high
    return requested_target


@kernel
def supervised(
    limits: Limits, state: SupervisorState, observed: Observed, requested_target: float, reference: float, dt: float
) -> tuple[SupervisorState, Verdict]:
    """`cycle_verdict` under the supervisor, which is shown the reference beside all else."""
    seen = Observed(
        observed.reading,
        observed.lateness,
        observed.elapsed,
        observed.request,
        observed.operator_age,
        observed.recorder,
        observed.preflight,
        observed.emg_age,
        observed.others,
        observed.neighbour,
        reference,
    )
    return supervise(limits, state, seen, requested_target, dt)


SUPERVISED: dict[str, Callable[..., Any]] = {
    "cycle_sense": filtered_measurement,
    "cycle_target": clamp_offset,
    "cycle_verdict": supervised,
}
"""A law as it runs live: `Observed` in, and the supervisor's last word out."""


@kernel
def unconditioned(
    conditioning: Conditioning, conditioned: Conditioned, reference: Reference, dt: float
) -> tuple[Conditioned, Reference]:
    """`cycle_condition` of a source that asks for none: the reference as it is."""
    position, velocity, acceleration = reference
    return Conditioned(position, velocity, acceleration, position, 0.0, 0.0, 0.0), reference


def law_and_source(law: Law, source: Source = TABLE) -> dict[str, Callable[..., Any]]:
    """A law's and a source's kernels by the names of the placeholders that they replace."""
    return {
        "law_start": law.start_kernel,
        "law_step": law.step_kernel,
        "source_start": source.start_kernel,
        "source_step": source.step_kernel,
        "cycle_condition": condition_step if source.conditioned else unconditioned,
    }


_LIMITS = Limits()
"""Of which compiled code needs the type alone."""


NOTHING_OBSERVED, NOTHING_PLANNED = zeros_of(Observed), zeros_of(Plan)
_OBSERVED = len(flat(NOTHING_OBSERVED))
"""Numbers of `Observed`."""
_GIVEN = struct.Struct(f"{_OBSERVED + len(flat(NOTHING_PLANNED))}d")
"""Those and the numbers of a `Plan`."""
_TAKEN = len(flat(zeros_of(tuple[Reference, float, Verdict])))
"""Numbers that a cycle hands on: reference, requested target and verdict."""


@kernel
def cycle_in_place(
    settings: CycleSettings,
    limits: Array,
    gains: Array,
    sample: Array,
    law: Array,
    conditioned: Array,
    source: Array,
    supervisor: Array,
    given: Array,
    output: Array,
    dt: float,
) -> None:
    """`one_cycle` under the supervisor on states that are kept flat; each row is written again.

    Of the states that begin here the types alone are needed, so that no state crosses from Python and back. The law's
    gains are kept flat too, so that one of them can be changed between two cycles; those of the settings are their
    type. And so are the limits, whose 80 numbers would take longer on their way from Python than the cycle itself; what
    there is to see with the plan, `given`; and reference, requested target and verdict, which `output` is filled with.
    """
    allowed = unflatten(_LIMITS, limits)
    now = CycleSettings(
        unflatten(settings.gains, gains), settings.conditioning, settings.source, settings.filters, allowed
    )
    begun = Sample(0.0, 0.0, 0.0, 0.0)
    observed = unflatten(NOTHING_OBSERVED, given)
    plan = unflatten(NOTHING_PLANNED, given[_OBSERVED:])
    before = CycleState(
        unflatten(begun, sample),
        unflatten(law_start(now.gains, begun), law),
        unflatten(condition_start(settings.conditioning, begun), conditioned),
        unflatten(source_start(settings.source, Measurement(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), source),
        unflatten(begin(allowed, NOTHING_OBSERVED.reading, ThermalState(0.0, 0.0, 0.0)), supervisor),
    )
    after, reference, requested_target, verdict = one_cycle(now, before, observed, plan, dt)
    keep(sample, after.sample)
    keep(law, after.law)
    keep(conditioned, after.conditioned)
    keep(source, after.source)
    keep(supervisor, after.supervisor)
    keep(output, (reference, requested_target, verdict))


@kernel
def keep(row: Array, state: Any) -> None:
    """Write a state flat."""
    numbers = flat(state)
    for i in range(len(numbers)):
        row[i] = numbers[i]


_POWERS, _MODES, _REACTIONS = ({float(one): one for one in kind} for kind in (Power, Mode, Reaction))

_MORE = 2.0 ** len(Fault)
"""No sum of faults is as large."""


def verdict_of(target: float, power: float, mode: float, reaction: float, faults: float) -> Verdict:
    """The verdict that a row has; what no supervisor says is handed on as it is, for `safety.last_word` to refuse."""
    return Verdict(
        target,
        _POWERS.get(power, power),  # type: ignore[arg-type]
        _MODES.get(mode, mode),  # type: ignore[arg-type]
        _REACTIONS.get(reaction, reaction),  # type: ignore[arg-type]
        int(faults) if 0.0 <= faults < _MORE else faults,  # type: ignore[arg-type]
    )


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

    def __init__(self, law: Law, limits: Limits, filters: Filters, period: float, source: Source = TABLE) -> None:
        self.law, self.limits, self.filters, self.period, self.source = law, limits, filters, period, source
        gains = map_leaves(law.gains, lambda path, value: float(value) if name_of(path) in law.live else value)
        self._settings = CycleSettings(gains, law.conditioning, source.settings, filters, 0.0)
        self._limits = np.array(flat(limits), dtype=np.float64)
        self._given, self._output = np.zeros(_GIVEN.size // 8), np.zeros(_TAKEN)
        self._given_bytes = self._given.data.cast("B")
        self._run: Callable[..., None] = specialise(
            cycle_in_place, f"{law.name}_{source.name}", **law_and_source(law, source), **SUPERVISED
        )
        self.gains = np.array(numbers_of(law.gains), dtype=np.float64)
        """The law's gains, flat, as `Law.numbers` has them: what stands here the next cycle runs with."""
        self.reference = NOWHERE
        """Last reference of the source."""
        self.kept_bytes: memoryview
        """`kept` as bytes."""
        self.kept: Array
        """States of law, conditioner and supervisor as the last cycle handed them on, flat and in that order."""
        self._like: CycleState
        self._rows: list[Array]
        self._latched: int

    @property
    def state(self) -> CycleState:
        """State after the last cycle."""
        return CycleState(*(unflatten(part, row) for part, row in zip(self._like, self._rows, strict=True)))

    @state.setter
    def state(self, state: CycleState) -> None:
        self._like = state
        self.kept = np.array(flat((state.law, state.conditioned, state.supervisor)), dtype=np.float64)
        self.kept_bytes = self.kept.data.cast("B")
        law, conditioned = len(flat(state.law)), len(flat(state.conditioned))
        places = {"law": (0, law), "conditioned": (law, law + conditioned), "supervisor": (law + conditioned, None)}
        self._rows = [
            self.kept[slice(*places[name])] if name in places else np.array(flat(part), dtype=np.float64)
            for name, part in state._asdict().items()
        ]
        self._latched = names(state.supervisor).index("decided.latched")

    def begin(self, reading: DriveReading, thermal: ThermalState, latched: int | None = None) -> None:
        """Start stopped at this reading, and compile all that a cycle needs; takes seconds the first time.

        Args:
            reading: of the drive.
            thermal: how warm the motor is.
            latched: faults of the run before that have not been acknowledged; it starts latched by them; None for none.
        """
        joint, motor = (0.0 if math.isnan(angle) else float(angle) for angle in (reading.joint, reading.motor))
        sample = Sample(joint, motor)
        law, source = self.law.start(sample), self.source.start(Measurement(joint, motor, 0.0, math.nan))
        conditioned = condition_start(self.law.conditioning, sample)
        supervisor = begin(self.limits, reading, thermal)
        fresh = CycleState(sample, law, conditioned, source, supervisor)
        self.state = fresh
        observed = NOTHING_OBSERVED._replace(reading=reading, elapsed=self.period)
        for target_source in TargetSource:
            self.step(observed, Plan(target_source, motor, Reference(joint, 0.0, 0.0)))
        if latched is not None:
            decided = supervisor.decided._replace(mode=Mode.LATCHED, latched=latched)
            fresh = fresh._replace(supervisor=supervisor._replace(decided=decided))
        self.state = fresh

    def step(self, observed: Observed, plan: Plan) -> tuple[float, Verdict]:
        """The requested target for the motor [rad] and the verdict on it."""
        _GIVEN.pack_into(
            self._given_bytes, 0, *observed.reading, *observed[1:], plan.source, plan.motor, *plan.reference
        )
        self._run(self._settings, self._limits, self.gains, *self._rows, self._given, self._output, self.period)
        position, velocity, acceleration, requested_target, *verdict = self._output.tolist()
        self.reference = Reference(position, velocity, acceleration)
        return requested_target, verdict_of(*verdict)

    @property
    def latched(self) -> int:
        """The faults that the supervisor has latched, a bit each."""
        return int(self._rows[-1][self._latched])

    @property
    def sample(self) -> list[float]:
        """Sample of the last cycle as the law was given it, flat."""
        return self._rows[0].tolist()

    @property
    def recorded_source(self) -> list[float]:
        """Recorded part of the source's state after the last cycle, flat; empty for a table."""
        return [] if self.source is TABLE else self._rows[3].tolist()

    def recorded(self) -> CycleState:
        """Record of the last cycle: each part of the state, flat; empty for a table."""
        state = CycleState(*(row.tolist() for row in self._rows))
        return state._replace(source=[]) if self.source is TABLE else state
