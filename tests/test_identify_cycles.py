"""How many whole cycles a log has, and what is said of it."""

import numpy as np
import pytest
from numpy.typing import NDArray

import bowden
from bowden.identify.cable.cycles import ENOUGH, Cycles, whole_cycles
from bowden.identify.cable.path import build_path
from bowden.identify.cable.trust import seconds_text
from bowden.identify.cable.turns import find_turns

Array = NDArray[np.float64]
TIME = np.arange(0.0, 40.0, 0.01)


def cycles_of(motor: Array) -> Cycles:
    return whole_cycles(build_path(TIME[: len(motor)], motor, motor, find_turns(motor), len(motor)))


@pytest.mark.parametrize("phase", [0.0, 0.9, np.pi / 2, 2.5, np.pi, 4.0, 3 * np.pi / 2])
@pytest.mark.parametrize("turns", [1, 2, 5, 7])
def test_a_sine_has_its_cycles_wherever_it_begins(turns: int, phase: float) -> None:
    motor = np.sin(2.0 * np.pi * turns * TIME / TIME[-1] + phase)
    assert cycles_of(motor).whole == turns
    assert cycles_of(1e-3 * motor + 4.0) == cycles_of(motor)


def test_what_is_not_whole_does_not_count() -> None:
    assert cycles_of(np.sin(2.0 * np.pi * 1.7 * TIME / TIME[-1])).whole == 1
    assert cycles_of(np.linspace(0.0, 1.0, len(TIME))).whole == 0


def test_small_strokes_are_no_cycles() -> None:
    """Twelve turns near one end, then two strokes through the range."""
    small = 0.1 + 0.1 * np.sin(2.0 * np.pi * 12.0 * np.linspace(0.0, 1.0, 3000) - np.pi / 2)
    wide = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.linspace(0.0, 1.0, 1000))
    assert cycles_of(np.concatenate([small, wide])).whole == 1


def test_several_amplitudes_count_where_they_pass() -> None:
    """Strokes of three quarters of the range do not pass its ends, but its middle."""
    motor = np.sin(2.0 * np.pi * 8.0 * TIME / TIME[-1]) * np.where(TIME < 20.0, 1.0, 0.75)
    assert cycles_of(motor).whole == 8


def test_fewer_than_five_ask_for_the_rest_of_them() -> None:
    for whole in range(8):
        cycles = Cycles(whole, max(0, ENOUGH - whole))
        assert bool(cycles.advice) == (whole < ENOUGH)
        assert ("the stated error" in cycles.advice) == (whole in (2, 3))
        assert "\n" not in str(cycles)
    assert str(Cycles(5, 0)) == "5 whole cycles"
    assert str(Cycles(4, 1)).startswith("4 whole cycles; record 1 more whole cycle (up and down): expect ")
    assert str(Cycles(0, 5)).startswith("no whole cycles; record 5 more whole cycles")


def test_a_log_that_comes_back_without_a_whole_cycle_is_not_said_to_show_no_way_back() -> None:
    """One stroke up, then six cycles in the upper half of the range."""
    up, cycles = np.linspace(0.0, 1.0, 1000), 0.75 + 0.25 * np.cos(2.0 * np.pi * 6.0 * np.linspace(0.0, 1.0, 3000))
    found = cycles_of(np.concatenate([up, cycles]))
    assert found.whole == 0
    assert found.advice.endswith("nothing says how the loop closes over the middle of the motor's range")


def test_a_fit_says_it_of_the_whole_log() -> None:
    motor = 0.5 * np.sin(2.0 * np.pi * 3.0 * TIME / TIME[-1])
    fit = bowden.identify(TIME, motor, 0.9 * motor)
    assert fit.cycles == Cycles(3, 2)
    assert fit.cycles.advice in " ".join(repr(fit).split())


@pytest.mark.parametrize(("time", "said"), [(4.23, "4.2 s"), (10.2, "10 s"), (198.7, "199 s")])
def test_how_much_counts_less_is_said_in_seconds_whatever_their_number(time: float, said: str) -> None:
    assert seconds_text(time) == said
