"""One cycle of the loop: its parts in their order, on a law and a source that show what reaches them."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.control.conditioning import Conditioned, Conditioning, condition_start, condition_step
from bowden.control.law import Law
from bowden.control.source import Measurement, Source
from bowden.core.kernel import kernel
from bowden.core.nested import flat
from bowden.core.signals import Power, Reference, Sample
from bowden.cycle import one_cycle as module
from bowden.cycle.one_cycle import (
    BARE,
    NOTHING_OBSERVED,
    SUPERVISED,
    CycleSettings,
    CycleState,
    Filters,
    Plan,
    TargetSource,
    bare_settings,
    bare_start,
    clamp_offset,
    cycle_in_place,
    law_and_source,
    one_cycle,
    unconditioned,
    verdict_of,
)
from bowden.cycle.torque_offset import TorqueOffset
from bowden.models.drive.geared_motor import FrictionPush, turn_push
from bowden.models.drive.thermal import ThermalState
from bowden.models.suit.geometry import SuitGeometry
from bowden.models.suit.suit_angle import spool_map, spool_of
from bowden.safety.faults import Reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Verdict
from bowden.safety.supervisor import begin, supervise
from bowden.sensing.filters import low_pass

DT = 1e-3
LIMITS = Limits(motor_low=-1.0, motor_high=2.0)


class Gains(NamedTuple):
    """Of the law and of the source."""

    gain: float = 2.0


class Memory(NamedTuple):
    """Of the law and of the source."""

    joint: float
    motor: float
    current: float
    load: float


@kernel
def law_begun(gains: Gains, sample: Sample) -> Memory:
    return Memory(sample.joint, sample.motor, gains.gain, 0.0)


@kernel
def law_stepped(gains: Gains, state: Memory, sample: Sample, reference: Reference, dt: float) -> tuple[Memory, float]:
    moved = Memory(sample.joint, sample.motor, state.current + dt, reference.acceleration)
    return moved, gains.gain * reference.position + 0.1 * reference.velocity + 0.01 * state.joint


@kernel
def source_begun(settings: Gains, measured: Measurement) -> Memory:
    return Memory(measured.joint, measured.motor, measured.current, measured.load)


@kernel
def source_stepped(
    settings: Gains, state: Memory, measured: Measurement, scheduled: Reference, dt: float
) -> tuple[Memory, Reference, float]:
    given = Reference(scheduled.position + 0.1 * state.joint, settings.gain, scheduled.acceleration)
    return Memory(measured.joint, measured.motor, measured.current, measured.load + dt), given, 0.05


LAW = Law("shown", Gains(), law_begun, law_stepped, source="")
SOURCES = [Source("given", Gains(3.0), source_begun, source_stepped, conditioned=one) for one in (True, False)]
OBSERVED = NOTHING_OBSERVED._replace(
    reading=NOTHING_OBSERVED.reading._replace(joint=0.3, motor=0.4, current=0.5, joint_torque=0.6), elapsed=DT
)
REFERENCE = Reference(0.2, 0.1, 0.7)


def put_in(monkeypatch: pytest.MonkeyPatch, source: Source, parts: dict[str, Any]) -> None:
    """The kernels in the placeholders' stead, interpreted."""
    for name, part in (law_and_source(LAW, source) | parts).items():
        monkeypatch.setattr(module, name, part)


@pytest.mark.parametrize("source", SOURCES, ids=["conditioned", "as it is"])
@pytest.mark.parametrize("leads", TargetSource)
def test_a_cycle_is_sense_source_conditioner_law_and_supervisor(
    leads: TargetSource, source: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each part gets what the one before it gave, and the same on states that are kept flat."""
    put_in(monkeypatch, source, SUPERVISED)
    filters, sample = Filters(30.0, 60.0), Sample(0.25, 0.35, 0.0, 0.0)
    settings = CycleSettings(LAW.gains, LAW.conditioning, source.settings, filters, LIMITS)
    supervisor = begin(LIMITS, OBSERVED.reading, ThermalState(25.0, 25.0, 0.0))
    begun = source_begun(source.settings, Measurement(0.1, 0.2, 0.3, 0.4))
    shown = Conditioned(0.6, 0.5, 0.4, 0.6, 0.0, DT, 0.0)
    state = CycleState(sample, Memory(0.7, 0.8, 0.9, 1.0), shown, begun, supervisor)
    after, reference, target, verdict = one_cycle(settings, state, OBSERVED, Plan(leads, 0.45, REFERENCE), DT)

    seen = Sample(low_pass(0.25, 0.3, 30.0, DT), low_pass(0.35, 0.4, 60.0, DT), 0.0, 0.0)
    law, expected, wanted, added = state.law, REFERENCE, supervisor.target, 0.0
    if leads == TargetSource.LAW_BEGINS:
        law, shown = law_begun(LAW.gains, seen), condition_start(LAW.conditioning, seen)
        begun = source_begun(source.settings, Measurement(*seen[:2], 0.5, 0.6, *seen[2:]))
    if leads in (TargetSource.LAW_BEGINS, TargetSource.LAW):
        measured = Measurement(*seen[:2], 0.5, 0.6, *seen[2:])
        begun, expected, added = source_stepped(source.settings, begun, measured, REFERENCE, DT)
        conditioned = condition_step if source.conditioned else unconditioned
        shown, told = conditioned(LAW.conditioning, shown, expected, DT)
        law, wanted = law_stepped(LAW.gains, law, seen, told, DT)
        wanted += added
    elif leads == TargetSource.MOTION:
        wanted = 0.45
    assert (after.sample, after.law, after.conditioned, after.source) == (seen, law, shown, begun)
    assert (reference, target) == (expected, pytest.approx(wanted))
    said = supervise(LIMITS, supervisor, OBSERVED._replace(reference=expected.position), target, DT)
    np.testing.assert_equal((flat(after.supervisor), flat(verdict)), (flat(said[0]), flat(said[1])))

    rows = [np.array(flat(part), dtype=np.float64) for part in state]
    given, output = np.array([*flat(OBSERVED), *flat(Plan(leads, 0.45, REFERENCE))], dtype=np.float64), np.zeros(9)
    types = settings._replace(gains=Gains(0.0), limits=0.0)
    limits, gains = (np.array(flat(one), dtype=np.float64) for one in (LIMITS, LAW.gains))
    cycle_in_place(types, limits, gains, *rows, given, output, DT)
    for row, part in zip([*rows, output], [*after, (reference, target, verdict)], strict=True):
        np.testing.assert_array_equal(row, flat(part))


def test_a_bare_law_has_the_readings_as_they_are_and_no_supervisor(monkeypatch: pytest.MonkeyPatch) -> None:
    put_in(monkeypatch, SOURCES[1], BARE)
    settings, measured = bare_settings(LAW.gains, Conditioning(), Gains(3.0)), Measurement(0.3, 0.4, 0.5, 0.6)
    begun = bare_start(settings, measured)
    assert begun[:2] == (Sample(0.3, 0.4), law_begun(LAW.gains, Sample(0.3, 0.4)))
    assert begun[2:] == (condition_start(Conditioning(), Sample(0.3, 0.4)), source_begun(Gains(3.0), measured), (0.4,))
    after, reference, target, verdict = one_cycle(settings, begun, measured, Plan(TargetSource.LAW, 0.0, REFERENCE), DT)
    memory, expected, added = source_stepped(Gains(3.0), begun.source, measured, REFERENCE, DT)
    law, command = law_stepped(LAW.gains, begun.law, begun.sample, expected, DT)
    assert (after.law, after.source, after.supervisor) == (law, memory, (target,))
    assert (reference, target) == (expected, command + added)
    assert verdict == (target, Power.ON, Mode.RUNNING, Reaction.NONE, 0)


def test_what_is_not_conditioned_is_recorded_as_the_law_was_shown_it_and_never_in_doubt() -> None:
    before = Conditioned(9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0)
    assert unconditioned(Conditioning(), before, REFERENCE, DT) == ((*REFERENCE, 0.2, 0.0, 0.0, 0.0), REFERENCE)


numbers = st.floats(-3.0, 3.0)


@given(numbers, numbers)
def test_what_is_added_takes_a_command_no_further_than_the_range(command: float, added: float) -> None:
    found = clamp_offset(LIMITS, command, added)
    inside = LIMITS.motor_low <= command <= LIMITS.motor_high
    assert found == (min(LIMITS.motor_high, max(LIMITS.motor_low, command + added)) if inside else command)
    assert math.isnan(clamp_offset(LIMITS, math.nan, added))


@pytest.mark.parametrize("verdict", [Verdict(0.5, Power.OFF, Mode.LATCHED, Reaction.R2, 5)])
def test_a_row_is_its_verdict_and_what_no_supervisor_says_is_handed_on_as_it_is(verdict: Verdict) -> None:
    found = verdict_of(*(float(one) for one in verdict))
    assert found == verdict
    assert [type(one) for one in found] == [type(one) for one in verdict]
    for faults in (-1.0, 2.0**60, math.nan, math.inf):
        np.testing.assert_equal(verdict_of(0.5, 99.0, -1.0, 0.5, faults), (0.5, 99.0, -1.0, 0.5, faults))
    assert verdict_of(*(0.0,) * 5).faults == 0


def test_a_torque_offset_turns_with_the_target_while_one_leads_and_nothing_is_wrong() -> None:
    spools = spool_map(SuitGeometry(), 0.025)
    offset, push = TorqueOffset(2.5, 4, spools), FrictionPush(spool_of(0.0, spools), 0.0)
    calm = Verdict(0.0, Power.ON, Mode.RUNNING, Reaction.NONE, 0)
    others = [calm._replace(power=Power.OFF), calm._replace(mode=Mode.RELEASING), calm._replace(reaction=Reaction.R1)]
    random = np.random.default_rng(0)
    for verdict in [calm, calm._replace(mode=Mode.PREFLIGHT)] * 20 + others + [calm] * 3:
        target, dt = float(random.normal(0.0, 0.3)), 2e-3
        torque, turned = offset.step(target, verdict, dt), spool_of(target, spools)
        for _ in range(4):
            push = turn_push(push, turned, dt / 4)
        push = FrictionPush(turned, 0.0) if verdict in others else push
        assert torque == pytest.approx(2.5 * push.direction)
        assert offset.row() == pytest.approx((torque, *push))
        assert (torque != 0.0) == (verdict not in others)
    other = TorqueOffset(2.5, 4, spools)
    other.take(offset.row())
    assert other.step(0.1, calm, DT) == offset.step(0.1, calm, DT)
