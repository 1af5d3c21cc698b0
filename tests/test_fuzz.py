"""Whatever reads what others wrote takes it or refuses it in a line: a sample of what ``make soak`` tries."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from support import fuzz


@pytest.mark.parametrize("name", fuzz.TARGETS)
def test_what_a_target_is_made_for_is_taken_and_what_once_broke_it_is_survived(name: str) -> None:
    target = fuzz.TARGETS[name]
    with fuzz.watched():
        took = [fuzz.tried(target, data) for data in target.seeds()]
        assert any(took)
        for data in fuzz.kept(name):
            fuzz.tried(target, data)


@pytest.mark.parametrize("name", [name for name in fuzz.TARGETS if name != "mat"])
@given(number=st.integers(0, 2**31))
@settings(max_examples=40)
def test_an_input_that_nobody_would_write_is_taken_or_refused(name: str, number: int) -> None:
    with fuzz.watched():
        fuzz.tried(fuzz.TARGETS[name], fuzz.changed(name, number))


@pytest.mark.parametrize("number", range(4))
def test_a_matlab_file_that_nobody_would_write_is_taken_or_refused(number: int) -> None:
    """A few: each is read in a process of its own."""
    with fuzz.watched():
        fuzz.tried(fuzz.TARGETS["mat"], fuzz.changed("mat", number))
