"""Hard cases of EMG: drawn alike from one number, true to what they say, judged alike, looks counted."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import emg_cases as cases
import emg_draw as drawn

NUMBERS = (0, 9, 17)
"""Development cases of 1 kHz."""


def test_a_case_is_drawn_from_its_set_and_number_alone() -> None:
    first = drawn.draw("development", 3)
    drawn.draw("development", 4)
    again, other = drawn.draw("development", 3), drawn.draw("validation", 3)
    assert np.array_equal(first.values, again.values)
    assert first.contractions == again.contractions
    assert first.contractions != other.contractions
    assert len(set(drawn.SETS.values())) == len(drawn.SETS) == 3


def test_a_detection_belongs_to_one_contraction_or_to_none() -> None:
    def contraction(onset: float, end: float, judged: bool = True) -> drawn.Contraction:
        return drawn.Contraction(onset, end, 5.0, 0.01, onset, end, judged)

    known = (contraction(-0.5, 1.0, judged=False), contraction(3.0, 4.0), contraction(6.0, 7.0), contraction(8.0, 9.0))
    families = {part: next(iter(weights)) for part, weights in drawn.FAMILIES.items()}
    case = drawn.Case(0, families, np.zeros(12_000), 1000.0, known, 1.0)
    found = [(0.1, 1.1), (2.5, 2.6), (3.1, 3.5), (3.7, 4.1), (6.2, 8.5), (10.0, 10.1)]
    result = cases.judge(case, found)
    assert result.false == 2, "before the second one, and at the end"
    assert [one.found for one in result.told] == [True, True, False], "what goes on from another one is not found"
    assert [one.split for one in result.told] == [1, 0, 0]
    assert result.told[0].latency == pytest.approx(0.1)
    assert result.told[1].late_end == pytest.approx(1.5)
    assert math.isnan(result.told[2].latency)


def test_looks_are_counted_but_for_development(tmp_path: Path) -> None:
    file = tmp_path / "looks.toml"
    assert cases.look("development", range(9), "onset", file) == 0
    assert not file.exists()
    assert [cases.look(name, range(9), "onset", file) for name in ("judging", "judging", "validation")] == [1, 2, 1]
    assert [entry["count"] for entry in tomllib.loads(file.read_text())["look"]] == [1, 2, 1]


def test_contractions_well_above_rest_are_found_and_nothing_else() -> None:
    find = cases.ours("onset")
    results = [cases.judge(case, find(case)) for case in (drawn.draw("development", number) for number in NUMBERS)]
    told = [one for result in results for one in result.told if one.ratio >= 8.0 and one.length > 0.3]
    assert len(told) > 3
    assert all(one.found for one in told)
    assert sum(result.false for result in results) == 0


@pytest.mark.long
def test_a_wearers_file_hides_nothing_that_is_found_without() -> None:
    alone, known = cases.ours("onset"), cases.Known("onset", "development")
    for number in range(100):
        case = drawn.draw("development", number)
        results = [cases.judge(case, find(case)) for find in (alone, known)]
        without, with_it = ([one.found for one in result.told] for result in results)
        assert all(after or not before for before, after in zip(without, with_it, strict=True)), number
        assert results[1].false <= results[0].false, number


@pytest.mark.long
def test_drawn_cases_are_judged_no_worse_than_was_published() -> None:
    find = cases.ours("onset")
    results = [cases.judge(case, find(case)) for case in (drawn.draw("development", n) for n in range(200))]
    told = [one for result in results for one in result.told]
    rows = {row.kind: row for row in cases.curve(told)}
    for kind, share in (("4–6", 0.15), ("8–16", 0.05), ("64–250", 0.02), ("250–1000", 0.02)):
        assert rows[kind].missed <= share * rows[kind].count, kind
    assert sum(result.false for result in results) <= 2
