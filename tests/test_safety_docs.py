"""docs/safety.md says what the code says."""

from pathlib import Path

import pytest

from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from safety_page import faults_table, limits_table, with_tables, write_docs

DOCS = Path(__file__).parents[1] / "docs"


def test_the_page_is_current() -> None:
    page = (DOCS / "safety.md").read_text(encoding="utf-8")
    assert page == with_tables(page), "make docs"
    assert faults_table() in page
    assert limits_table() in page


def test_every_fault_and_limit_is_in_its_table() -> None:
    assert all(f"`{fault.name}`" in faults_table() for fault in Fault)
    assert all(f"`{name}" in limits_table() for name in Limits._fields)


def test_writing_fills_an_empty_page(tmp_path: Path) -> None:
    marks = "".join(f"<!-- {name}: made by make docs -->\n<!-- end of {name} -->\n" for name in ("faults", "limits"))
    (tmp_path / "safety.md").write_text(f"head\n{marks}tail\n", encoding="utf-8")
    write_docs(tmp_path)
    text = (tmp_path / "safety.md").read_text(encoding="utf-8")
    assert text.startswith("head\n")
    assert text.endswith("tail\n")
    assert faults_table() in text


@pytest.mark.parametrize("fault", list(Fault), ids=lambda fault: fault.name)
def test_a_detector_names_the_limits_that_there_are(fault: Fault) -> None:
    words = {word.strip("|,;:…().") for word in fault.detector.replace("…", " ").split()}
    named = {word for word in words if "_" in word}
    assert named <= set(Limits._fields) | {"joint_age", "motor_age"}
