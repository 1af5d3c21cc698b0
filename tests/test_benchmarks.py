"""The benchmarks still fit the package: every module imports, and ours is fitted to the genetic peer's log."""

import importlib
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(autouse=True)
def among_the_benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])


@pytest.mark.parametrize("name", sorted(file.stem for file in BENCHMARKS.glob("*.py") if file.stem != "fresh_process"))
def test_every_module_imports(name: str) -> None:
    importlib.import_module(name)


def test_our_side_of_the_genetic_comparison() -> None:
    peer = importlib.import_module("peer_genetic")
    log = peer.simulated_log()
    parameters = peer.ours(log)
    assert parameters["slope"] == pytest.approx(0.938, abs=0.005)
    assert log.test_rms(parameters) < 0.001
