"""Real cables: fitted to the first half of each log, judged on the second."""

import statistics
import time
from pathlib import Path

import pytest

from bowden.core.units import DEGREES
from bowden.identify.cable.fit import Fit, identify_log
from bowden.identify.log.read import read_log


@pytest.fixture(scope="module")
def fits(shared_data: Path) -> dict[str, tuple[Fit, float]]:
    """Each cable's fit, and the processor's time for it [s]."""
    logs = sorted((shared_data / "cable").glob("*.csv.gz"))
    assert len(logs) >= 12
    found = {}
    for path in [logs[0], *logs]:  # the first one is compiled
        before = time.process_time()
        found[path.name.split(".")[0]] = (identify_log(read_log(path)), time.process_time() - before)
    return found


def errors(fits: dict[str, tuple[Fit, float]], name: str | None) -> list[float]:
    return [fit.models[name or fit.best.name].test_rms * DEGREES for fit, _ in fits.values()]


def test_bouc_wen_predicts_the_half_it_has_not_seen(fits: dict[str, tuple[Fit, float]]) -> None:
    assert statistics.median(errors(fits, "bouc_wen")) <= 0.25
    assert max(errors(fits, "bouc_wen")) <= 0.40


def test_the_recommended_model_predicts_it_better(fits: dict[str, tuple[Fit, float]]) -> None:
    assert statistics.median(errors(fits, None)) <= 0.16
    assert statistics.median(errors(fits, None)) < 0.7 * statistics.median(errors(fits, "bouc_wen"))


def test_all_five_models_together_take_a_moment(fits: dict[str, tuple[Fit, float]]) -> None:
    assert max(seconds for _, seconds in fits.values()) <= 1.5


def test_these_cables_run_backwards_and_do_not_lag(fits: dict[str, tuple[Fit, float]]) -> None:
    for fit, _ in fits.values():
        cable = fit.models["bouc_wen"].model.to_bouc_wen()
        assert -1.0 < cable.slope < -0.8
        assert cable.hysteresis_gain > 0.0
        assert not any("lag" in warning for warning in fit.warnings)
