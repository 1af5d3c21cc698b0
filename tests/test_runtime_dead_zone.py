"""What the preflight measures of a cable, which is recorded and told to no law, and what a model tells."""

import math
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.knowledge import dead_zone as of_model
from bowden.control.knowledge import informed
from bowden.control.law import Law
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Filters, TargetSource
from bowden.live.preflight import Preflight, begin, dead_zone, step
from bowden.live.replay import replay
from bowden.live.script import Script
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import default_bench
from bowden.safety.limits import Limits
from loop_rig import LoopRig, twin_bench
from support.simulated_drive import SimulatedDrive

LIMITS, BENCH = Limits(), default_bench()


class Guesses(NamedTuple):
    """Of a law that is told a dead zone, and how far to trust it."""

    slope: float = 1.0
    width: float = 0.0
    doubt: float = 1.0


class Kept(NamedTuple):
    """The width that it began with."""

    width: Annotated[float, Quantity("width", "rad")]


@kernel
def begin_with_it(gains: Guesses, _sample: Sample) -> Kept:
    return Kept(gains.width)


@kernel
def follow(gains: Guesses, state: Kept, _sample: Sample, reference: Reference, _dt: float) -> tuple[Kept, float]:
    return state, reference.position / gains.slope


LAW = Law(
    name="guessing",
    gains=Guesses(),
    start_kernel=begin_with_it,
    step_kernel=follow,
    source="this test",
    from_rig={"slope": "slope", "width": "width", "doubt": "doubt"},
    limits={"width": (0.0, 0.5), "doubt": (0.0, 1.0)},
)


def test_the_preflight_measures_the_dead_zone_of_the_bench() -> None:
    """Against the width that the cable's equation has: 2·αh·h_max/αφ, less what a small stroke leaves of it."""
    drive, settings, now = SimulatedDrive(twin_bench()), Preflight(moved=1.5 * RADIANS), 1.0
    state, said, requested_target = begin(settings, drive.read(now)), None, 0.0
    from bowden.hardware.ports import Power

    while said is None or said.result == 0.0:
        drive.write(requested_target, Power.ON, now)
        now += 1e-3
        reading = drive.read(now)
        state, requested_target, said = step(settings, state, reading, 1e-3)
    assert said.result == 1.0
    whole = of_model(BENCH.cable, BENCH.sheath.gap)
    assert 0.5 * whole < dead_zone(state, reading, BENCH.cable.slope) < 1.1 * whole
    assert math.isnan(dead_zone(state, reading._replace(joint=math.nan), 1.0))
    assert dead_zone(state, reading._replace(motor=99.0), 1.0) == 0.5, "no more than a law believes"


def test_what_was_measured_is_recorded_and_the_law_begins_with_what_it_was_told(tmp_path: Path) -> None:
    rest = np.zeros((300, 3))  # the preflight is what moves the motor
    script = Script(rest, 0.0, 0.5, Preflight(moved=1.5 * RADIANS), 1e-3, slope=BENCH.cable.slope)
    _, log = LoopRig(tmp_path, LAW, LIMITS, SimulatedDrive(twin_bench()), script).run()
    first = int(np.argmax(log["source"] == TargetSource.LAW_BEGINS))
    assert log["source"][first] == TargetSource.LAW_BEGINS
    width = log["play"][first]
    assert width > 0.02
    assert np.isnan(log["play"][0])
    assert log["law.width"][first] == LAW.gains.width
    same = replay(log, LAW, LIMITS, Filters(), 1e-3, same=True)
    assert (same.verdicts_differing, same.requested_target_largest, same.command_largest) == (0, 0.0, 0.0)


def test_an_identified_cable_is_a_laws_first_guess() -> None:
    law = informed(LAW, knowledge_of(BENCH._replace(sheath=BENCH.sheath._replace(gap=0.5)), identified=True))
    assert law.gains.slope == BENCH.cable.slope
    assert law.gains.width == pytest.approx(0.5 * of_model(BENCH.cable, 1.0))
    assert law.gains.doubt == 0.1
    by_hand = informed(LAW, knowledge_of(BENCH)).gains
    assert (by_hand.slope, by_hand.width, by_hand.doubt) == (1.0, 0.0, 1.0)


def test_our_law_is_told_the_lower_end_of_an_identified_dead_zone() -> None:
    law, known = LAWS["bowden"], knowledge_of(BENCH, identified=True)
    assert informed(law, known).gains.width == pytest.approx(0.8 * known.width)
    assert informed(law, knowledge_of(BENCH)).gains.width == 0.0
