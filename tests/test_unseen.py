"""The protocol of unseen cells: drawn alike from one number, apart between sets, judged alike, looks counted."""

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import unseen
import unseen_cells as cells
from bowden.control import LAWS
from bowden.control.knowledge import configured
from bowden.core.nested import numbers_of
from bowden.sim.many import simulate_many
from results_page import results

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


def test_every_family_is_drawn_and_motions_keep_to_their_strokes() -> None:
    drawn: dict[str, set[str]] = {part: set() for part in cells.FAMILIES}
    for number in range(200):
        cell = cells.draw("development", number)
        for part, family in cell.families.items():
            drawn[part].add(family)
        position, speed, _ = cell.reference.sample(TIME).T
        assert position.min() >= -1e-6
        assert position.max() < np.radians(90.01)
        if cell.families["reference"] in ("periodic", "point to point", "stop and reverse", "tiny", "slow", "fast"):
            assert np.abs(np.gradient(position, TIME)[1:-1] - speed[1:-1]).max() < 0.02 * np.abs(speed).max() + 1e-6
        bend = cell.bend(TIME)
        assert (np.ptp(bend) == 0.0) if cell.families["sheath"] == "still" else (bend.min() > 0.5)
    assert drawn == {part: set(weights) for part, weights in cells.FAMILIES.items()}


def test_every_law_knows_the_rig_by_the_one_rule() -> None:
    drawn = (cells.draw("development", n) for n in range(60))
    wrong = [cell for cell in drawn if "wrongly known" in cell.special]
    assert wrong
    for cell in wrong:
        assert cell.known.servo_frequency != cell.rig.servo.natural_frequency
        assert configured(LAWS["bowden"], cell.known).gains.servo_frequency == pytest.approx(cell.known.servo_frequency)
        assert configured(LAWS["active_disturbance_rejection"], cell.known).gains.natural_frequency == pytest.approx(
            cell.known.servo_frequency
        )


@pytest.mark.long
def test_a_rig_that_nobody_wears_is_its_cable_plant() -> None:
    law = LAWS["uncompensated"]
    drawn = (cells.draw("development", n) for n in range(99))
    cell = next(cell for cell in drawn if cell.families["wearer"] == "pushes" and cell.rig.inner.cable.name == "worn")
    bare = cell.rig._replace(worn=type(cell.rig.worn)())
    worn, inner, pushed = (
        next(simulate_many([cells.case_of(cell, (law,))._replace(plant=plant)], 11.0))[0]
        for plant in (bare, cell.rig.inner, cell.rig)
    )
    np.testing.assert_array_equal(worn, inner)
    assert pushed.rmse != worn.rmse


def _run(number: int, law: str, rmse: float, travel: float = 10.0) -> Any:
    return unseen.Run(number, "", law, math.isfinite(rmse), rmse, rmse, travel)


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
    text = unseen.document("development", range(4), runs, "bowden", 0, 1.0)
    assert text["standings"][0]["law"] in (adrc, "bowden")
    assert None in [run["rmse_deg"] for run in text["runs"]]


def test_looks_at_other_sets_than_the_development_set_are_counted(tmp_path: Path) -> None:
    file = tmp_path / "looks.toml"
    assert unseen.look("development", range(9), ["bowden"], file) == 0
    assert not file.exists()
    counts = [unseen.look(name, range(9), ["bowden"], file) for name in ("validation", "validation", "judging")]
    assert counts == [1, 2, 1]
    looks = tomllib.loads(file.read_text())["look"]
    assert [(look["set"], look["count"]) for look in looks] == [("validation", 1), ("validation", 2), ("judging", 1)]


@pytest.mark.parametrize("page", ["README.md", "docs/simulate.md", "docs/background/evidence.md"])
def test_pages_name_the_share_that_was_judged_last(page: str) -> None:
    ours, within, *_ = results("unseen_judging")["rows"][0]
    assert ours == "`bowden`"
    assert f"{within} %" in (Path(__file__).parents[1] / page).read_text(encoding="utf-8")


def test_a_set_is_played_and_shown() -> None:
    drawn = (cells.draw("development", n) for n in range(12))
    some = [cell for cell in drawn if cell.rig.inner.cable.name == "worn"]
    runs = list(unseen.play([LAWS["uncompensated"]], some[:3]))
    assert [run.number for run in runs] == [cell.number for cell in sorted(some[:3], key=lambda c: c.rig.sample_time)]
    assert all(run.stable and run.rmse_deg > 0.0 for run in runs)
    assert "uncompensated" in unseen.table(unseen.standings(runs))
