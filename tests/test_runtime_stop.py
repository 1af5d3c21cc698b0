"""No stop is lost, whatever else is asked for around it, and nothing that was asked for before it comes after it."""

import sys
import threading
from pathlib import Path

import pytest

from bowden.hardware import shared_memory
from bowden.live import control_block
from bowden.live.control_block import ControlBlock
from bowden.safety.state import Mode, Request
from support.request_storm import Storm

ARM, RUN, STOP, ACKNOWLEDGE = list(Request)[1:]


@pytest.mark.parametrize(("motors", "bursts"), [(1, 1500), (2, 500)])
def test_no_stop_is_lost_in_a_storm_of_requests(motors: int, bursts: int, tmp_path: Path) -> None:
    storm = Storm(tmp_path, 1, motors, bursts)
    storm.loop.run()
    assert storm.modes == set(Mode) - {Mode.BRIDGING}


@pytest.fixture
def block(tmp_path: Path) -> Path:
    shared_memory.create(tmp_path / "block", control_block.WORDS)
    return tmp_path / "block"


@pytest.mark.parametrize(
    ("asked", "taken"),
    [
        ((STOP, ACKNOWLEDGE), (STOP, 0)),
        ((RUN, STOP), (STOP, 0)),
        ((RUN, STOP, RUN, STOP, ARM), (STOP, 0)),
        ((RUN, ARM), (ARM, 0)),
        ((STOP, None, ARM, None, ARM), (STOP, ARM, ARM, 0)),
        ((STOP, STOP), (STOP, 0)),
    ],
)
def test_a_stop_comes_first_and_alone(block: Path, asked: tuple[Request | None, ...], taken: tuple[int, ...]) -> None:
    """None is a cycle between two requests; the loop may open the block after the first of them."""
    operator, found = ControlBlock(block), list[int]()
    loop: ControlBlock | None = None
    for one in asked:
        if one is None:
            loop = loop or ControlBlock(block)
            found.append(loop.take())
        else:
            operator.ask(one)
            assert operator.stop_waits or one != STOP
    loop = loop or ControlBlock(block)
    found += [loop.take(), loop.take()]
    assert tuple(found) == taken
    assert not operator.stop_waits


def test_what_was_decided_on_before_a_stop_is_not_asked_for_after_it(block: Path) -> None:
    operator, loop = ControlBlock(block), ControlBlock(block)
    before = operator.stops
    operator.ask(STOP)
    assert loop.take() == STOP
    operator.ask(ARM, before)
    assert loop.take() == Request.NONE
    operator.ask(ARM, operator.stops)
    assert loop.take() == ARM


def test_stops_of_several_threads_are_all_counted(block: Path) -> None:
    operator, before = ControlBlock(block), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=lambda: [operator.ask(STOP) for _ in range(500)]) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(before)
    assert operator.stops == 2000
