"""The protocol of unseen cells: drawn alike from one number, apart between sets, judged alike, looks counted."""

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

import unseen
import unseen_cells as cells
from bowden.core.nested import numbers_of

TIME = np.arange(0.0, 20.0, 1e-3)


def test_a_cell_is_drawn_from_its_set_and_number_alone() -> None:
    first = cells.draw("development", 7)
    cells.draw("development", 8)
    again, other = cells.draw("development", 7), cells.draw("validation", 7)
    for cell, same in ((again, True), (other, False)):
        assert (repr(cell.rig.describe()) == repr(first.rig.describe())) is same
        assert np.array_equal(cell.reference.sample(TIME), first.reference.sample(TIME)) is same
        assert np.array_equal(numbers_of(cell.known), numbers_of(first.known), equal_nan=True) is same
    assert np.array_equal(again.bend(TIME), first.bend(TIME))
    assert again.initial_motor == first.initial_motor


def test_no_set_shares_a_seed() -> None:
    assert len(set(cells.SETS.values())) == len(cells.SETS) == 3
    drawn = {tuple(cells.random_of(name, n).integers(0, 2**32, 4)) for name in cells.SETS for n in range(1000)}
    assert len(drawn) == 3000


def _run(number: int, law: str, rmse: float, travel: float = 10.0) -> Any:
    return unseen.Run(number, "", law, math.isfinite(rmse), rmse, travel)


def test_standings_are_taken_to_the_best_law_of_each_cell() -> None:
    adrc, inf = unseen.BASELINE, math.inf
    runs = [
        _run(number, law, rmse, travel)
        for law, costs, travel in (("bowden", (1.0, 3.0, 1.05, inf), 30.0), (adrc, (2.0, 2.0, 1.0, 1.0), 10.0))
        for number, rmse in enumerate(costs)
    ]
    ours, other = sorted(unseen.standings(runs), key=lambda one: one.law != "bowden")
    assert (ours.near, ours.median, ours.most, ours.worse, ours.chatter, ours.unstable) == (0.5, 1.5, inf, 0.5, 3.0, 1)
    assert (other.near, other.median, other.worse, other.unstable) == (0.75, 1.0, 0.0, 0)
    assert [one["number"] for one in unseen.worst(runs, "bowden", 2)] == [3, 1]
    assert unseen.ratio(inf, inf) == 1.0


def test_looks_at_other_sets_than_the_development_set_are_counted(tmp_path: Path) -> None:
    file = tmp_path / "looks.toml"
    assert unseen.look("development", range(9), ["bowden"], file) == 0
    assert not file.exists()
    counts = [unseen.look(name, range(9), ["bowden"], file) for name in ("validation", "validation", "judging")]
    assert counts == [1, 2, 1]
    looks = tomllib.loads(file.read_text())["look"]
    assert [(look["set"], look["count"]) for look in looks] == [("validation", 1), ("validation", 2), ("judging", 1)]
