"""docs/background/hazards.md names tests and faults that there are, and leaves none of the supervisor's out."""

import ast
import re
from pathlib import Path

import pytest

from bowden.safety.faults import Fault

TESTS = Path(__file__).parent
PAGE = TESTS.parent / "docs" / "background" / "hazards.md"
HEAD = "hazard | cause | detector | reaction, time | test | residual risk. Hardware"


def hazards() -> dict[str, dict[str, str]]:
    """The rows of the page's tables of hazards, by their numbers."""
    found: dict[str, dict[str, str]] = {}
    inside = False
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        inside = line == HEAD or (inside and "|" in line)
        cells = [cell.strip() for cell in line.split("|")]
        number = re.match(r"[A-Z]\d+ ", cells[0])
        if inside and number:
            assert number[0] not in found, f"two rows {number[0]}"
            found[number[0].strip()] = dict(zip(HEAD.split(" | "), cells, strict=True))
    return found


def names_of_tests() -> set[str]:
    """Names of all tests of the suite."""
    return {
        node.name
        for path in TESTS.glob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }


def test_each_hazard_has_all_its_cells_and_names_a_test_that_there_is() -> None:
    known = names_of_tests()
    rows = hazards()
    assert len(rows) > 40
    for number, row in rows.items():
        assert all(row.values()), f"{number} has an empty cell"
        named = re.findall(r"`(test_\w+)`", row["test"])
        assert named, f"{number} names no test"
        assert not set(named) - known, f"{number} names tests that there are not"


def test_each_fault_that_a_hazard_names_is_one_of_the_supervisors_and_none_is_left_out() -> None:
    cells = " ".join(cell for row in hazards().values() for cell in row.values())
    named = set(re.findall(r"`([A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*)`", cells))
    assert named == {fault.name for fault in Fault}


@pytest.mark.parametrize("harm", [f"H{k}" for k in range(1, 7)])
def test_each_harm_is_that_of_a_hazard(harm: str) -> None:
    assert f"\n{harm} " in PAGE.read_text(encoding="utf-8")
    assert any(harm in row["hazard"] or "(all)" in row["hazard"] for row in hazards().values())
