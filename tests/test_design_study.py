"""The check's verdicts against long simulations of random rigs, and the shares that its study counts."""

from bowden.control import LAWS
from bowden.design.study import Case, Study, has_margin, is_stable, study
from bowden.paper.bench import default_bench

BENCH = default_bench()
ADAPTIVE = LAWS["adaptive"]


def test_verdicts_agree_with_long_simulations() -> None:
    found = study(BENCH, 60, seed=1)
    assert found.unsafe == 0
    assert found.agreement >= 0.98 - 1.0 / 60.0  # one case of sixty is more than the two in a hundred that may differ
    assert found.recognised >= 0.95
    assert 10 <= sum(case.stable for case in found.cases) <= 50


def test_stability_in_simulation_is_judged_without_the_check() -> None:
    assert is_stable(BENCH, ADAPTIVE)
    assert has_margin(BENCH, ADAPTIVE)
    assert not is_stable(BENCH, ADAPTIVE.preset("paper"))
    assert not has_margin(BENCH, ADAPTIVE.with_gains(error_gain=0.5))


def test_shares_are_counted_as_they_are_named() -> None:
    cases = [
        Case(BENCH, ADAPTIVE, "holds", True, True),
        Case(BENCH, ADAPTIVE, "holds", False, False),
        Case(BENCH, ADAPTIVE, "little_margin", True, True),
        Case(BENCH, ADAPTIVE, "does_not_hold", False, False),
    ]
    found = Study(tuple(cases))
    assert (found.agreement, found.unsafe, found.little_margin, found.recognised) == (0.75, 1, 0.25, 0.5)
