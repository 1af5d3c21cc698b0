"""A joint that does not follow its reference: how far and for how long a run may, and what is found by it."""

from typing import NamedTuple

import pytest

from bowden.control import LAWS, Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.kernel import kernel
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS
from bowden.design.forecast import HALF_AGAIN, lasting_error, off_reference
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.sim.rig_runs import run_of
from support.supervised import Outcome, supervised

REFERENCE = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 4.0)


def run(law: Law, **limits: float) -> Outcome:
    return supervised(default_bench(), law, REFERENCE, Limits(**limits), duration=9.0)[0]


@pytest.mark.parametrize("name", ["uncompensated", "adaptive"])
@pytest.mark.parametrize("time", [0.2, 1.0])
def test_the_error_that_lasts_in_simulation_is_where_the_supervisor_speaks(name: str, time: float) -> None:
    trace = run_of(Rig(law=name, reference=REFERENCE, duration=9.0), LAWS[name])
    bound = lasting_error(trace.error, 1e-3, time)
    for share, stopped in ((1.02, set()), (0.98, {Fault.JOINT_OFF_REFERENCE})):
        outcome = run(LAWS[name], off_reference=share * bound, off_reference_time=time)
        assert set(of(outcome.stopping)) == stopped, share


class Tired(NamedTuple):
    last: float = 1500.0
    """Cycle after which the command stays [1]."""


class Command(NamedTuple):
    cycles: float
    motor: float


@kernel
def tired_start(gains: Tired, sample: Sample) -> Command:
    return Command(0.0, sample.motor)


@kernel
def tired_step(gains: Tired, state: Command, sample: Sample, reference: Reference, dt: float) -> tuple[Command, float]:
    motor = reference.position if state.cycles < gains.last else state.motor
    return Command(state.cycles + 1.0, motor), motor


TIRED = Law("tired", Tired(), tired_start, tired_step, "this test")
"""A law without compensation that gives up."""


def test_a_law_that_gives_up_is_released_where_nothing_else_is_wrong() -> None:
    outcome = run(TIRED, off_reference=off_reference(Rig(), LAWS["bowden"]))
    assert (set(of(outcome.stopping)), outcome.reaction) == ({Fault.JOINT_OFF_REFERENCE}, 2.0)
    assert 2.5 < 1e-3 * outcome.released < 5.0
    blind = run(TIRED, off_reference_time=10.0)
    assert (blind.released, blind.faults) == (-1.0, 0.0), "no other detector sees it"


def test_the_limit_is_the_rigs_own_or_play_and_half_again_of_what_its_simulation_shows() -> None:
    rig, law = Rig(law="uncompensated"), LAWS["uncompensated"]
    shown = lasting_error(run_of(rig, law).error, rig.sample_time, 1.0)
    assert off_reference(rig, law) == pytest.approx(rig.supervisor_limits.play + HALF_AGAIN * shown, rel=0.02)
    wider = rig.replace(limits=rig.limits._replace(play=0.5))
    assert off_reference(wider, law) - off_reference(rig, law) == pytest.approx(0.5 - rig.supervisor_limits.play)
    assert off_reference(rig.replace(limits=rig.limits._replace(off_reference=0.2)), law) == 0.2
    assert off_reference(rig.replace(limits=rig.limits._replace(off_reference_time=0.2)), law) > off_reference(rig, law)
    assert off_reference(rig, LAWS["bowden"]) < 1.1 * rig.supervisor_limits.play
