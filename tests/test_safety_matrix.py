"""The fault matrix on a fake clock, a seeded sample of it; `make soak` runs it all."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.knowledge import informed
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.identified import CableModel
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.sim.injected import Injected
from soak_supervisor import MOTIONS, sheaths
from support.adversary import attack
from support.fault_matrix import (
    AFTER,
    AT_ONCE,
    LAST,
    MEASURED,
    REFERENCE,
    ROWS,
    complaints,
    pair_complaints,
    run_row,
    unfinished,
)
from support.supervised import supervised

BENCH = default_bench()
LAW = LAWS["adaptive"]
BW = BoucWen()._asdict()
DELAYS = (0, 1, 20, 100)
"""[cycles]"""


def test_every_fault_that_can_be_injected_has_a_row() -> None:
    assert set(ROWS) == set(Injected) - {Injected.NOTHING}


@pytest.mark.parametrize("kind", list(ROWS), ids=lambda kind: kind.name)
def test_a_fault_is_detected_and_has_its_reaction_in_its_time(kind: Injected) -> None:
    shown = 0
    for seed, onset in itertools.product(range(2), range(5)):
        outcome = run_row(BENCH, LAW, (kind,), seed, onset)
        assert list(complaints(kind, outcome)) == [], (seed, onset, outcome)
        shown += outcome.shown >= 0.0 or outcome.released >= 0.0
    assert shown == 10


OTHERS = {
    "play": lambda: Rig(cable=CableModel("play", {"slope": 0.9, "half_width": 0.06, "offset": 0.0}, {"bouc_wen": BW})),
    "own": lambda: Rig(plant=str(Path(__file__).parents[1] / "examples" / "my_plant.py")),
}
"""Plants beside the bench."""


@pytest.mark.parametrize("name", [pytest.param("play", marks=pytest.mark.long), "own"])
def test_faults_on_other_plants_end_without_power(name: str) -> None:
    """What a fault must come to does not depend on what is moved; when it shows does, and is the bench's to time."""
    rig = OTHERS[name]()
    law, plant = rig.fitted(), rig.moved
    still, _ = supervised(plant, law, REFERENCE, MEASURED, duration=LAST + AFTER, seed=1, initial_motor=rig.start_motor)
    assert (still.differs, still.faults, still.bad) == (0.0, 0.0, 0.0)
    for kind, row in list(ROWS.items())[::3]:
        outcome = run_row(plant, law, (kind,), 1, 0)
        assert outcome.bad == 0.0, kind
        if kind in AT_ONCE:
            assert list(complaints(kind, outcome)) == [], (kind, outcome)
        elif min(row.reactions) > 1 and outcome.shown >= 0.0:
            assert list(unfinished(outcome)) == [], (kind, outcome)


def test_a_row_that_nothing_detects_is_complained_of() -> None:
    blind = run_row(BENCH, LAW, (Injected.RECORDER_LOST,), 0, 0)
    for kind in set(ROWS) - {Injected.RECORDER_LOST}:
        assert list(complaints(kind, blind._replace(shown=1000.0, faults=0.0))), kind


def test_two_faults_end_without_power_and_r3_is_not_kept_waiting() -> None:
    two = list(itertools.permutations(ROWS, 2))
    for i in np.random.default_rng(1).choice(len(two), 250, replace=False):
        outcome = run_row(BENCH, LAW, two[i], int(i), 0)
        assert list(pair_complaints(two[i], int(i), 0, outcome)) == [], (two[i], outcome)


@pytest.mark.parametrize("limits", [MEASURED, Limits()], ids=["all_measured", "default"])
def test_a_run_in_order_is_never_touched(limits: Limits) -> None:
    bend, known = sheaths()["moved_sheath"], knowledge_of(BENCH)
    start = BENCH.resting_motor(0.0, float(bend(np.zeros(1))[0]))
    for name, (motion, (duration, reference)) in itertools.product(("adaptive", "bowden"), MOTIONS.items()):
        outcome, _ = supervised(
            BENCH,
            informed(LAWS[name], known),
            reference,
            limits,
            duration=duration,
            bend=bend,
            seed=7,
            initial_motor=start,
        )
        assert (outcome.differs, outcome.faults, outcome.bad) == (0.0, 0.0, 0.0), (name, motion)


def test_the_plants_delay_is_the_loops() -> None:
    """Twenty cycles are not one; what the motor does a tenth of a second late does not follow the servo's model."""
    late = {delay: supervised(BENCH._replace(delay=delay), LAW, REFERENCE, MEASURED, duration=3.0) for delay in DELAYS}
    for delay, other in itertools.pairwise(DELAYS):
        assert not np.array_equal(late[delay][1], late[other][1], equal_nan=True)
    for delay in (0, 1):
        assert (late[delay][0].differs, late[delay][0].faults) == (0.0, 0.0)
    assert late[100][0].reaction == 3.0
    assert Fault.NOT_FOLLOWING in of(late[100][0].stopping)


def test_whatever_comes_in_the_target_is_finite_and_within_limits_and_rate() -> None:
    wrong, powered, led = attack(MEASURED, 30_000, 1)
    assert wrong == 0
    assert powered > 9_000
    assert led > 6_000
