"""Hard cases of EMG: drawn alike from one number, true to what they say, judged alike, looks counted."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import emg_cases as cases
import emg_draw as drawn
from bowden.sim.emg_sources import in_band

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


def test_a_contraction_has_the_ratio_that_its_case_says() -> None:
    """Of its band, over its plateau, in what is nothing but rest and contractions."""
    for number in range(25):
        case = drawn.draw("development", number)
        if any(case.families[part] != family for part, family in cases.QUIET.items()):
            continue
        band = in_band(case.values - np.mean(case.values), case.rate)
        for one in case.contractions:
            if one.rise < 0.05 and one.length > 1.0:
                part = band[round((one.onset + 0.1) * case.rate) : round((one.end - 0.5) * case.rate)]
                assert float(np.std(part)) / case.rest == pytest.approx(one.ratio, rel=0.35), number


def test_rest_that_changes_is_drawn_apart_and_as_its_families_say() -> None:
    levels = []
    for number in range(60):
        case = drawn.draw("development", number, changing=True)
        assert set(case.families) == set(drawn.CHANGING)
        if any(case.families[part] != family for part, family in cases.QUIET.items()):
            continue
        band, pauses = in_band(case.values - np.mean(case.values), case.rate), []
        edges = [0.2, *(edge for one in case.contractions for edge in (one.onset, one.end))]
        for begin, end in zip(edges[::2], edges[1::2], strict=False):
            if begin > 0.0 and end - begin > 0.5:
                pauses.append(2.0 * math.log(float(np.std(band[round(begin * case.rate) : round(end * case.rate)]))))
        levels += list(np.diff(pauses))
    assert 0.3 < float(np.sqrt(np.mean(np.square(levels)))) < 1.3, "as far as real pauses differ"
    rest, again = (drawn.draw_rest("development", 0, changing=True) for _ in range(2))
    assert np.array_equal(rest.values, again.values)
    assert not np.array_equal(rest.values[:5000], drawn.draw_rest("development", 0).values[:5000])


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
