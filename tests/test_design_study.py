"""The check's verdicts against long simulations of random rigs, and the shares that its study counts."""

import pytest

from bowden.control import LAWS
from bowden.plants.presets.bench import default_bench
from study import Case, Study, is_stable, simulated_margin, study

BENCH = default_bench()
ADAPTIVE = LAWS["adaptive"]


@pytest.mark.parametrize("count", [8, pytest.param(60, marks=pytest.mark.long)])
def test_verdicts_agree_with_long_simulations(count: int) -> None:
    """`make bench` judges 500 other rigs."""
    found = Study(tuple(study(BENCH, count, seed=1)))
    assert found.unsafe == 0
    assert found.agreement >= 0.98 - 1.0 / count  # one case of so few is more than the two in a hundred that may differ
    assert found.recognised >= 0.95
    assert count / 6 <= sum(case.stable for case in found.cases) <= 5 * count / 6


def test_stability_in_simulation_is_judged_without_the_check() -> None:
    assert is_stable(BENCH, ADAPTIVE)
    assert simulated_margin(BENCH, ADAPTIVE) > 45.0
    assert not is_stable(BENCH, ADAPTIVE.preset("paper"))
    assert simulated_margin(BENCH, ADAPTIVE.with_gains(error_gain=0.5)) < 45.0


def test_a_study_goes_on_where_it_was_left() -> None:
    whole = list(study(BENCH, 4, seed=1))
    assert list(study(BENCH, 4, seed=1, skip=2)) == whole[2:]


def test_shares_are_counted_as_they_are_named() -> None:
    cases = [
        Case(0, "holds", True, True, 50.0),
        Case(1, "holds", False, False, 0.0),
        Case(2, "little_margin", True, True, 45.0),
        Case(3, "does_not_hold", False, False, 0.0),
        Case(4, "limit_cycle", True, False, 50.0),
    ]
    found = Study(tuple(cases))
    assert (found.agreement, found.unsafe, found.little_margin, found.recognised) == (0.8, 1, 0.2, 0.5)
