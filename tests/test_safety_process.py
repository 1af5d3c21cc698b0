"""The loop's own process against the twin's, under the fault matrix's faults: the same reactions."""

from collections.abc import Iterator

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.errors import BowdenError
from bowden.plants.presets.bench import default_bench
from bowden.sim.injected import Injected
from live_runs import tries
from support.fault_matrix import run_row
from support.live_matrix import CASES, NOT_HERE, LiveMatrix, differences

FEW = (Injected.JOINT_SPIKE, Injected.MOTOR_NAN, Injected.STOP)
"""One of each reaction, and the operator's own."""
SEEDS = range(7)


@pytest.fixture(scope="module")
def matrix(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveMatrix]:
    with LiveMatrix(tmp_path_factory.mktemp("matrix")) as running:
        yield running


def compare(matrix: LiveMatrix, kind: Injected, seed: int) -> None:
    """A fault whose reaction is not the matrix's is injected again: a busy computer stops runs by right."""
    expected = run_row(default_bench(), LAWS["adaptive"], (kind,), seed, 0)
    onset = float(np.random.default_rng([seed, kind]).uniform(0.1, 1.2))
    told: list[object] = []
    for _ in tries():
        try:
            live = matrix.react(CASES[kind], onset)
        except BowdenError as error:
            matrix.end()
            told.append(str(error))
            continue
        found = list(differences(CASES[kind], live, expected))
        if not found:
            return
        told.append((live, found))
        matrix.end()
    pytest.fail(f"{told}, and {expected} in the matrix")


def test_every_fault_of_the_matrix_is_done_to_the_processes_or_said_not_to_be() -> None:
    assert set(CASES) | NOT_HERE == set(Injected)
    assert not set(CASES) & NOT_HERE


@pytest.mark.live
@pytest.mark.parametrize("kind", FEW, ids=lambda kind: kind.name)
def test_the_loops_process_reacts_as_the_matrix_says(matrix: LiveMatrix, kind: Injected) -> None:
    compare(matrix, kind, 0)


@pytest.mark.live
@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", CASES, ids=lambda kind: kind.name)
def test_the_loops_process_reacts_as_the_matrix_says_in_200_cases(
    matrix: LiveMatrix, kind: Injected, seed: int
) -> None:
    compare(matrix, kind, seed)
