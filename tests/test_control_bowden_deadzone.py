"""The crossing of our law: its table of phases, and that the width it believes is a lower end."""

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.our_law.deadzone import BELIEVED, DeadzoneState, update_deadzone
from bowden.control.our_law.law import shortfall_at_joint
from bowden.core.signals import Reference, Sample

DT = 1e-3
GAINS = LAWS["bowden"].gains._replace(noise=1e-4)


def at_start(width: float) -> DeadzoneState:
    cable: DeadzoneState = LAWS["bowden"].with_gains(width=width).start(Sample(0.0, 0.0)).deadzone
    return cable


def after_rows(
    cable: DeadzoneState, rows: list[tuple[float, float, float]], lag: float = 0.0, rate: float = 0.0
) -> tuple[DeadzoneState, float]:
    """After each of these joints, motors and references, slowly; the shifts summed up."""
    total, before = 0.0, rows[0][2]
    for joint, motor, position in rows:
        reference = Reference(position, 0.05 * np.sign(position - before), 0.0)
        cable, _, shift = update_deadzone(GAINS, cable, joint, True, motor, reference, lag, 0.02, rate, 0.0, 0.0, DT)
        before, total = position, total + shift
    return cable, total


def line(first: float, last: float, count: int) -> list[float]:
    return np.linspace(first, last, count).tolist()


def up(width: float) -> DeadzoneState:
    """SensorState up to 0.5 rad with a width believed, engaged."""
    cable, _ = after_rows(at_start(width), [(x, x, x) for x in line(0.0, 0.5, 500)])
    assert (cable.side, cable.crossing) == (1.0, False)
    return cable


def turned(width: float) -> tuple[DeadzoneState, float]:
    return after_rows(up(width), [(0.5, 0.5, x) for x in line(0.499, 0.46, 40)])


def test_a_turn_of_the_reference_begins_a_crossing_by_what_is_left_of_the_width() -> None:
    cable, shift = turned(0.1)
    assert (cable.side, cable.crossing) == (-1.0, True)
    assert shift == pytest.approx(-0.1, abs=0.005)
    assert turned(0.0)[1] == pytest.approx(0.0, abs=1e-9), "nothing is known, nothing is jumped"


@pytest.mark.parametrize("gone", [0.06, 0.16])
def test_a_touch_ends_it_and_the_width_stays_a_lower_end(gone: float) -> None:
    """What is narrower is believed at once, what is wider by a share."""
    cable, _ = turned(0.1)
    cable, _ = after_rows(cable, [(0.5, x, 0.45) for x in line(0.5, 0.5 - gone, 50)])
    assert (cable.side, cable.crossing) == (-1.0, True)
    cable, _ = after_rows(cable, [(0.5 - x, 0.5 - gone - x, 0.45 - x) for x in line(0.0, 0.004, 8)])
    assert (cable.side, cable.crossing) == (-1.0, False)
    expected = gone if gone < 0.1 else 0.1 + BELIEVED * (gone - 0.1)
    assert cable.width_back == pytest.approx(expected, abs=0.002)
    assert cable.width == pytest.approx(max(expected, 0.1), abs=0.002), "the other way is wider too, and not narrower"


def test_a_motor_that_sticks_within_the_dead_zone_keeps_nothing_from_the_joint() -> None:
    crossing, _ = turned(0.1)  # downward
    assert shortfall_at_joint(crossing, 0.08) == 0.0
    assert shortfall_at_joint(crossing, 0.15) == pytest.approx(0.05)
    assert shortfall_at_joint(crossing, -0.15) == -0.15, "it went further than it was asked to"
    assert shortfall_at_joint(up(0.1), 0.08) == 0.08


def test_a_reference_that_turns_back_before_the_touch_is_on_its_old_side_again() -> None:
    cable, there = turned(0.1)
    cable, back = after_rows(cable, [(0.5, 0.45, x) for x in line(0.46, 0.5, 40)])
    assert (cable.side, cable.crossing) == (1.0, False)
    assert cable.width == 0.1
    assert back == pytest.approx(-there, abs=0.005)


def test_a_reference_whose_position_steps_back_while_it_goes_on_does_not_turn() -> None:
    cable, asked = up(0.1), 0.0
    for k in range(200):
        position = 0.5 + 1e-4 * k - 0.005 * (k % 5 == 4)
        reference = Reference(position, 0.1, 0.0)
        cable, wanted, shift = update_deadzone(
            GAINS, cable, 0.5, True, 0.5, reference, 0.0, 0.02, 0.0, asked, asked, DT
        )
        asked = wanted + shift
        assert (cable.side, cable.crossing) == (1.0, False)


def test_a_still_reference_never_turns() -> None:
    cable, shift = after_rows(up(0.1), [(0.5 + 0.05 * np.sin(0.01 * k), 0.5, 0.5) for k in range(2000)])
    assert (cable.side, cable.crossing, shift) == (1.0, False, 0.0)
