"""Real cables: fitted to the first half of each log, judged on the second."""

import statistics
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bowden.core.units import DEGREES
from bowden.identify.cable import bouc_wen, projection
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.identification import identify
from bowden.identify.log.read import read_log

MOST_EVALUATIONS = 300
"""Of all six models of one cable together, each of which goes through the log once, or for a population at once."""


@pytest.fixture(scope="module")
def fits(shared_data: Path) -> Iterator[dict[str, tuple[Fit, int]]]:
    """Each cable's fit, and how often its searches evaluated a model."""
    logs = sorted((shared_data / "cable").glob("*.csv.gz"))
    assert len(logs) >= 12
    evaluations = [0]

    def counting(function: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*given: Any) -> Any:
            evaluations[0] += 1
            return function(*given)

        return counted

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(projection, "reduced_problem", counting(projection.reduced_problem))
        patch.setattr(bouc_wen, "compiled", counting(bouc_wen.compiled))
        found = {}
        for path in logs:
            before = evaluations[0]
            found[path.name.split(".")[0]] = (identify([read_log(path)]), evaluations[0] - before)
        yield found


def errors(fits: dict[str, tuple[Fit, int]], name: str | None) -> list[float]:
    return [fit.models[name or fit.best.name].test_rms * DEGREES for fit, _ in fits.values()]


def test_bouc_wen_predicts_the_half_it_has_not_seen(fits: dict[str, tuple[Fit, int]]) -> None:
    assert statistics.median(errors(fits, "bouc_wen")) <= 0.25
    assert max(errors(fits, "bouc_wen")) <= 0.40


def test_the_recommended_model_predicts_it_better(fits: dict[str, tuple[Fit, int]]) -> None:
    assert statistics.median(errors(fits, None)) <= 0.08
    assert max(errors(fits, None)) <= 0.30
    assert statistics.median(errors(fits, None)) < 0.5 * statistics.median(errors(fits, "bouc_wen"))


def test_all_six_models_together_take_few_evaluations(fits: dict[str, tuple[Fit, int]]) -> None:
    assert all(50 < count <= MOST_EVALUATIONS for _, count in fits.values())


def test_these_cables_run_backwards_and_do_not_lag(fits: dict[str, tuple[Fit, int]]) -> None:
    for fit, _ in fits.values():
        cable = fit.models["bouc_wen"].model.to_bouc_wen()
        assert -1.0 < cable.slope < -0.8
        assert cable.hysteresis_gain > 0.0
        assert not any("lag" in warning for warning in fit.warnings)
