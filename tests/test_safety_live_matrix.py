"""The live loop under the fault matrix's faults does, cycle by cycle, what the matrix says: it is the same cycle."""

import math
from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.signals import DriveReading, Reference
from bowden.cycle.one_cycle import HOLD, LAW, LAW_BEGINS, Cycle, Filters, Plan
from bowden.models.drive.thermal import cold
from bowden.plants.presets.bench import default_bench
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.state import Observed, PreflightResult, Request
from bowden.sim.injected import Injected
from support.fault_matrix import AFTER, LAST, MEASURED, REFERENCE, ROWS, begins
from support.injected_loop import InjectedLoop, differing
from support.supervised import supervised

BENCH = default_bench()
CASES = [
    (law, kind, seed, onset) for seed, onset in ((0, 0), (1, 3)) for law in ("adaptive", "bowden") for kind in ROWS
][:200]


def _reading() -> DriveReading:
    return DriveReading(0.0, 0.0, 0.4, math.nan, 35.0, 0.0, 0.0, 0.01, 4.0, 0.0, 0.0, 0.0, 0.0)


def compare(folder: Path, law: str, kind: Injected, seed: int, onset: int) -> None:
    live = InjectedLoop(folder, BENCH, law, (kind,), seed, onset).run()
    injected = ((kind, begins((kind,), seed, onset)[0]),)
    outcome, matrix = supervised(
        BENCH, LAWS[law], REFERENCE, MEASURED, duration=LAST + AFTER, seed=seed, injected=injected
    )
    assert len(live.cycles) > 600
    assert not differing(live, matrix).any()
    both = live.cycles < matrix.shape[1]
    np.testing.assert_array_equal(live.record[:2, both], matrix[:2, live.cycles[both]])
    began = outcome.ran <= live.cycles
    assert live.record[4, began & both].max() >= outcome.reaction


@pytest.mark.parametrize(("law", "kind", "seed", "onset"), CASES[::50], ids=lambda one: getattr(one, "name", str(one)))
def test_the_live_loop_reacts_as_the_matrix_says(
    tmp_path: Path, law: str, kind: Injected, seed: int, onset: int
) -> None:
    compare(tmp_path, law, kind, seed, onset)


@pytest.mark.long
@pytest.mark.parametrize(("law", "kind", "seed", "onset"), CASES, ids=lambda one: getattr(one, "name", str(one)))
def test_the_live_loop_reacts_as_the_matrix_says_in_200_cases(
    tmp_path: Path, law: str, kind: Injected, seed: int, onset: int
) -> None:
    compare(tmp_path, law, kind, seed, onset)


@pytest.mark.parametrize("name", ["adaptive", "bowden", "uncompensated"])
@pytest.mark.parametrize(
    "kind", [Injected.JOINT_SPIKE, Injected.MOTOR_SPIKE, Injected.JOINT_NAN], ids=lambda kind: kind.name
)
def test_an_angle_that_the_supervisor_does_not_believe_never_reaches_the_law(name: str, kind: Injected) -> None:
    """What a law sees and requested targets for is what it would be with the last good angle in the bad one's place."""
    requested = []
    for bad in (True, False):
        cycle = Cycle(LAWS[name], Limits(), Filters(), 1e-3)
        good = _reading()
        cycle.begin(good, cold(Limits().thermal))
        for k in range(400):
            wrong = bad and k == 300
            reading = good
            if wrong:
                off = {"joint": good.joint + 0.5} if kind == Injected.JOINT_SPIKE else {"motor": good.motor + 0.5}
                reading = good._replace(**({"joint": math.nan} if kind == Injected.JOINT_NAN else off))
            request = Request.ARM if k == 10 else Request.RUN
            plan = Plan(LAW_BEGINS if k == 20 else LAW if k > 20 else HOLD, 0.0, Reference(0.0, 0.0, 0.0))
            requested_target, verdict = cycle.step(
                Observed(reading, 0.0, 1e-3, request, 0.0, True, PreflightResult.PASSED, 0.0), plan
            )
            requested.append(requested_target)
            assert verdict.reaction == (1.0 if wrong else 0.0)
            assert cycle.state.sample[:2] == (good.joint, good.motor)
            if wrong:
                named = {
                    "JOINT_SPIKE": Fault.JOINT_JUMP,
                    "MOTOR_SPIKE": Fault.MOTOR_JUMP,
                    "JOINT_NAN": Fault.JOINT_LOST,
                }
                assert verdict.faults == 2.0 ** named[kind.name]
    assert requested[:400] == requested[400:]
