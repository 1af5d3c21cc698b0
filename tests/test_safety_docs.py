"""Pages have every fault as the code has it."""

from pathlib import Path

import pytest

import safety_page
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize("name", safety_page.TABLES)
def test_a_page_is_current(name: str) -> None:
    page = (DOCS / name).read_text(encoding="utf-8")
    assert page == safety_page.with_tables(name, page), "make docs"
    assert all(f"`{fault.name}`" in page for fault in Fault)


@pytest.mark.parametrize("fault", list(Fault), ids=lambda fault: fault.name)
def test_a_detector_names_the_limits_that_there_are(fault: Fault) -> None:
    words = {word.strip("|,;:…().") for word in fault.detector.replace("…", " ").split()}
    named = {word for word in words if "_" in word}
    assert named <= set(Limits._fields) | {"joint_age", "motor_age"}
