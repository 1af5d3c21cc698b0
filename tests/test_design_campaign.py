"""Distributions, sensitivity and the store of a campaign, against independent ones."""

import itertools
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from bowden.core.errors import OutputError, ParameterError
from bowden.study.distributions import Distribution
from bowden.study.figures import ranked, sensitivity
from bowden.study.store import Store, differences, row_bytes

SHARES = [0.0, 0.01, 0.2, 0.5, 0.77, 0.99]


@pytest.mark.parametrize(
    ("kind", "given", "oracle"),
    [
        ("uniform", (2.0, 5.0), stats.uniform(2.0, 3.0)),
        ("log_uniform", (2.0, 20.0), stats.loguniform(2.0, 20.0)),
        ("normal", (1.0, 0.5, 0.6, 3.0), stats.truncnorm(-0.8, 4.0, 1.0, 0.5)),
        ("normal", (0.0, 1.0, 6.0, 9.0), stats.truncnorm(6.0, 9.0)),
    ],
)
def test_a_distribution_is_scipys(kind: str, given: tuple[float, ...], oracle: stats.rv_continuous) -> None:
    found = Distribution(kind, given)
    np.testing.assert_allclose([found.value(u) for u in SHARES], oracle.ppf(SHARES), rtol=1e-6, atol=1e-9)
    assert found.ends == (min(found.ends), max(found.ends))


def test_whole_numbers_and_choices_come_equally_often() -> None:
    dice, words = Distribution("integer", (1, 6)), Distribution("choice", ("a", "b", "a"))
    even = np.linspace(0.0, 1.0, 6000, endpoint=False)
    assert np.bincount([int(dice.value(u)) for u in even]).tolist() == [0, *[1000] * 6]
    assert [words.value(u) for u in even].count("a") == 4000
    assert {type(dice.value(u)) for u in even} == {int}
    assert Distribution("fixed", (3.5,)).value(0.9) == 3.5


@pytest.mark.parametrize(
    ("kind", "given"),
    [
        ("uniform", (2.0, 2.0)),
        ("uniform", (2.0, 1.0)),
        ("uniform", (2.0,)),
        ("uniform", ("a", "b")),
        ("uniform", (0.0, float("inf"))),
        ("log_uniform", (0.0, 1.0)),
        ("normal", (0.0, 0.0, -1.0, 1.0)),
        ("normal", (0.0, 1.0, 1.0, -1.0)),
        ("normal", (0.0, 1.0, 40.0, 41.0)),
        ("integer", (3, 1)),
        ("integer", (1.0, 3.0)),
        ("choice", ()),
        ("fixed", (1.0, 2.0)),
    ],
)
def test_a_distribution_that_cannot_be_is_refused(kind: str, given: tuple[float, ...]) -> None:
    with pytest.raises(ParameterError, match=f"{kind} is .*; expected "):
        Distribution(kind, given)


def test_sensitivity_ranks_what_matters() -> None:
    """A line through one parameter, a valley over another, and nothing of a third."""
    random = np.random.default_rng(5)
    line, valley, nothing = random.uniform(-1.0, 1.0, (3, 8000))
    figure = 3.0 * line + 4.0 * valley**2 + 0.1 * random.standard_normal(8000)
    found = [sensitivity(n, v, figure) for n, v in (("nothing", nothing), ("valley", valley), ("line", line))]
    assert [one.parameter for one in ranked(found)] == ["line", "valley", "nothing"]
    by_name = {one.parameter: one for one in found}
    assert by_name["line"].rank_correlation == pytest.approx(stats.spearmanr(line, figure).statistic, abs=1e-12)
    assert abs(by_name["valley"].rank_correlation or 1.0) < 0.05 < by_name["valley"].share
    assert by_name["nothing"].share < 0.005
    assert sum(one.share for one in found) == pytest.approx(1.0, abs=0.05)


def test_the_share_of_a_line_in_noise_is_the_analytic_one() -> None:
    """Of two even numbers' sum, ranks or not, one has half of the variance."""
    random = np.random.default_rng(6)
    a, b = random.standard_normal((2, 20_000))
    assert sensitivity("a", a, a + b).share == pytest.approx(0.5, abs=0.03)
    assert sensitivity("b", b, a + 2.0 * b).share == pytest.approx(0.8, abs=0.03)


def test_a_run_that_ran_away_is_the_worst_and_what_does_not_vary_has_no_share() -> None:
    parameter = np.arange(100.0)
    figure = np.where(parameter > 80.0, np.inf, 100.0 - parameter)
    assert sensitivity("p", parameter, figure).share > 0.5
    assert sensitivity("p", np.zeros(100), figure).share == 0.0
    words = sensitivity("w", np.repeat([0.0, 1.0], 50), np.repeat([1.0, 2.0], 50), ordered=False)
    assert (words.share, words.rank_correlation) == (1.0, None)


def rows(first: int, last: int) -> pa.Table:
    numbers = np.repeat(np.arange(first, last), 2)
    figures = [None if n == 3 else float(n) ** 0.5 for n in numbers]
    laws = ["a", "b"] * (last - first)
    return pa.table({"number": numbers, "law": laws, "rmse_deg": pa.array(figures, pa.float64())})


def filled(folder: Path, cuts: list[int], order: list[int]) -> Store:
    store = Store(folder, {"seed": 1}, [2 * (b - a) for a, b in itertools.pairwise(cuts)])
    assert store.open() == []
    for chunk in order:
        store.write(chunk, rows(cuts[chunk], cuts[chunk + 1]))
    return store


def test_neither_order_nor_cut_change_the_digest(tmp_path: Path) -> None:
    stores = [
        filled(tmp_path / name, cuts, order)
        for name, cuts, order in (("a", [0, 4, 8], [0, 1]), ("b", [0, 4, 8], [1, 0]), ("c", [0, 1, 7, 8], [2, 0, 1]))
    ]
    assert len({store.digest() for store in stores}) == 1
    mixed = rows(0, 8).take(np.random.default_rng(0).permutation(16))
    assert row_bytes(mixed) == row_bytes(rows(0, 8)) != row_bytes(rows(0, 7))


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "another"])
def test_a_damaged_chunk_is_set_aside(tmp_path: Path, damage: str) -> None:
    store = filled(tmp_path, [0, 4, 8], [0, 1])
    path, whole = store.path(1), store.path(1).read_bytes()
    broken = {
        "cut": whole[: len(whole) // 2],
        "flipped": whole.replace(whole[60:64], bytes(b ^ 0xFF for b in whole[60:64]), 1),
        "empty": b"",
        "another": store.path(0).read_bytes(),
    }
    path.write_bytes(broken[damage])
    with pytest.raises(OutputError, match="cannot read"):
        store.digest()
    (note,) = store.open()
    assert "set aside" in note
    assert store.missing() == [1]
    assert (store.folder / "aside" / path.name).read_bytes() == broken[damage]
    store.write(1, rows(4, 8))
    assert store.missing() == store.open() == []


def test_another_study_is_told_what_differs(tmp_path: Path) -> None:
    filled(tmp_path, [0, 4], [0])
    with pytest.raises(ParameterError, match="another study: seed was 1 and is 2; give another folder"):
        Store(tmp_path, {"seed": 2}, [8]).open()
    assert differences({"a": {"b": 1}}, {"a": {"c": 2}}) == ["a.b was 1 and is not there", "a.c was not there and is 2"]


def test_what_a_killed_process_left_half_written_is_removed(tmp_path: Path) -> None:
    store = filled(tmp_path, [0, 4], [0])
    rest = store.folder / "runs" / ".bowden-abc"
    rest.mkdir()
    (rest / "part-000001.parquet").write_bytes(b"PAR1")
    assert store.open() == []
    assert not rest.exists()


@pytest.mark.parametrize(("runs", "least", "most"), [(40, 0.10, 0.15), (200, 0.050, 0.066), (2000, 0.004, 0.007)])
def test_what_chance_gives_is_what_permutations_give(runs: int, least: float, most: float) -> None:
    random = np.random.default_rng(5)
    found = [sensitivity("p", random.random(runs), random.random(runs)) for _ in range(400)]
    assert least < (found[0].chance_share or 0.0) < most
    assert np.mean([one.above_chance for one in found]) == pytest.approx(0.05, abs=0.03)
    line = np.linspace(0.0, 1.0, runs)
    assert sensitivity("p", line, line).above_chance
