"""From contractions to a reference: which motion, and that it never jumps nor leaves its range."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel
from bowden.core.nested import flat, names
from bowden.core.signals import Reference
from bowden.models.minimum_jerk import minimum_jerk_from
from bowden.sensing.intent import (
    FOLLOWED_ACCELERATION,
    FOLLOWED_SPEED,
    TURNED_ACCELERATION,
    TURNED_SPEED,
    Intent,
    IntentSettings,
    intent_start,
    intent_step,
    proportional,
)

Array = NDArray[np.float64]
DT = 1e-3
ONE, TWO = IntentSettings(), IntentSettings(muscles=2)
MODE = names(intent_start(0.0)).index("mode")


@kernel
def play(by: IntentSettings, on: Array, rows: Array, modes: Array) -> None:
    state = intent_start(by.low)
    for k in range(len(on)):
        state, reference = intent_step(by, state, on[k, 0] > 0.0, on[k, 1] > 0.0, 1e-3)
        rows[k, 0], rows[k, 1], rows[k, 2] = reference
        modes[k] = flat(state)[MODE]


@kernel
def follow(by: IntentSettings, envelope: Array, rows: Array) -> None:
    reference = Reference(0.0, 0.0, 0.0)
    for k in range(len(envelope)):
        reference = proportional(by, reference, envelope[k], 0.4, 1e-3)
        rows[k, 0], rows[k, 1], rows[k, 2] = reference


def played(
    by: IntentSettings, flexor: list[tuple[float, float]], extensor: list[tuple[float, float]], seconds: float
) -> tuple[Array, Array]:
    """References (n, 3) and modes (n,) of contractions with these onsets and ends."""
    time = np.arange(round(seconds / DT)) * DT
    on = np.zeros((len(time), 2))
    for muscle, spans in enumerate((flexor, extensor)):
        for begin, end in spans:
            on[(begin <= time) & (time < end), muscle] = 1.0
    rows, modes = np.empty((len(time), 3)), np.empty(len(time))
    compiled(play)(by, on, rows, modes)
    return rows, modes


def followed(envelope: Array) -> Array:
    """References (n, 3) in proportion to an envelope (n,)."""
    rows = np.empty((len(envelope), 3))
    compiled(follow)(ONE, envelope, rows)
    return rows


def order(modes: Array) -> list[str]:
    return [Intent(int(mode)).name for mode, _ in itertools.groupby(modes.tolist())]


def smooth(rows: Array) -> None:
    """Velocity and acceleration are the derivatives of the position, and neither jumps."""
    np.testing.assert_allclose(np.gradient(rows[:, 0], DT)[1:-1], rows[1:-1, 1], atol=2e-3)
    assert np.abs(np.diff(rows[:, 1])).max() < 30.0 * DT
    assert np.abs(np.diff(rows[:, 2])).max() < 0.5


def test_one_muscle_takes_turns() -> None:
    rows, modes = played(ONE, [(0.5, 1.0), (4.0, 4.5)], [], 8.0)
    assert order(modes) == ["REST", "FLEX", "HOLD", "EXTEND", "REST"]
    assert rows[3900, 0] == ONE.high
    assert rows[-1].tolist() == [0.0, 0.0, 0.0]
    smooth(rows)


def test_two_muscles_have_a_direction_each_and_both_at_once_are_no_wish() -> None:
    rows, modes = played(TWO, [(0.5, 1.0), (4.0, 4.5), (10.0, 11.0)], [(6.0, 6.5), (10.0, 11.0)], 12.0)
    assert order(modes) == ["REST", "FLEX", "HOLD", "EXTEND", "REST"]
    assert rows[5900, 0] == TWO.high
    smooth(rows)


@pytest.mark.parametrize("overlap", [0.01, 0.1, 0.5, 2.0])
def test_a_wish_that_begins_in_the_other_muscles_tail_is_done_once_it_is_alone(overlap: float) -> None:
    """The flexor until 4 s, the extensor a second longer; and the same the other way round."""
    there, back = [(1.0, 4.0), (10.0 - overlap, 11.0)], [(4.0 - overlap, 5.0), (7.0, 10.0)]
    rows, modes = played(TWO, there, back, 13.5)
    assert order(modes) == ["REST", "FLEX", "HOLD", "EXTEND", "REST", "FLEX", "HOLD"]
    (turns,) = np.nonzero(np.diff(modes))
    assert turns[2] * DT == pytest.approx(4.15, abs=0.003)
    assert turns[4] * DT == pytest.approx(10.15, abs=0.003)
    smooth(rows)


def test_muscles_that_are_contracted_together_move_nothing_when_one_lets_go() -> None:
    """The first of two may have moved before the other one begins; after that nothing moves."""
    for skew, longer in itertools.product((-0.19, -0.05, 0.0, 0.05, 0.19), (-1.0, -0.1, 0.1, 1.0)):
        _, modes = played(TWO, [(1.0 + max(0.0, skew), 5.0)], [(1.0 + max(0.0, -skew), 5.0 + longer)], 9.0)
        assert order(modes) == (["REST", "FLEX", "HOLD"] if skew < 0.0 else ["REST"]), (skew, longer)


def test_a_stiffened_arm_that_is_let_go_stays_where_it_is() -> None:
    """The extensor joins a flexor that holds, and both end at nearly the same time; or it ends first."""
    for end in (4.9, 5.1):
        assert order(played(TWO, [(1.0, 5.0)], [(3.0, end)], 8.0)[1]) == ["REST", "FLEX", "HOLD"]


def test_a_late_wish_is_forgotten_with_its_contraction() -> None:
    """A short one, over before the flexor is; the next onset of the extensor alone is a wish of its own."""
    _, modes = played(TWO, [(1.0, 5.0)], [(3.0, 3.5), (6.0, 6.2)], 9.0)
    assert order(modes) == ["REST", "FLEX", "HOLD", "EXTEND", "REST"]
    assert np.nonzero(np.diff(modes))[0][2] * DT == pytest.approx(6.0, abs=0.002)


def test_a_long_contraction_is_one() -> None:
    assert order(played(ONE, [(0.5, 7.0)], [], 8.0)[1]) == ["REST", "FLEX", "HOLD"]


def test_a_motion_turns_round_at_any_moment_without_a_jump_and_in_its_range() -> None:
    for at in np.linspace(0.01, 1.99, 23):
        rows, modes = played(TWO, [(0.0, 0.005)], [(at, at + 0.1)], 5.0)
        assert order(modes) == ["FLEX", "EXTEND", "REST"], at
        smooth(rows)
        assert rows[:, 0].min() >= -1e-9
        assert rows[:, 0].max() <= TWO.high + 1e-9


def test_the_largest_speed_and_acceleration_are_known() -> None:
    """Of a motion that is turned round once, at the worst moment, and of what follows an envelope that steps."""
    turned = np.array([played(TWO, [(0.0, 0.005)], [(at, 3.0)], 4.0)[0] for at in np.linspace(0.02, 1.98, 50)])
    unit = TWO.high / TWO.duration
    assert np.abs(turned[:, :, 1]).max() / unit == pytest.approx(TURNED_SPEED, rel=2e-3)
    assert np.abs(turned[:, :, 2]).max() / unit * TWO.duration == pytest.approx(TURNED_ACCELERATION, rel=0.02)
    most = np.abs(followed(np.tile(np.repeat([1.0, 0.0], 1000), 3))).max(axis=0)
    assert most[1] / unit == pytest.approx(FOLLOWED_SPEED)
    assert most[2] / unit * TWO.duration == pytest.approx(FOLLOWED_ACCELERATION, rel=0.1)


@settings(max_examples=10)
@given(st.lists(st.floats(0.05, 1.5), min_size=1, max_size=12), st.floats(0.5, 4.0))
def test_many_turns_stay_in_range_and_end_at_an_end(waits: list[float], duration: float) -> None:
    by = ONE._replace(duration=duration)
    starts = np.cumsum(waits)
    rows, modes = played(by, [(at, at + 0.02) for at in starts], [], float(starts[-1]) + duration + 0.2)
    assert rows[:, 0].min() >= by.low - 0.004
    assert rows[:, 0].max() <= by.high + 0.004
    assert modes[-1] in (Intent.REST, Intent.HOLD)
    assert rows[-1, 1] == rows[-1, 2] == 0.0


def test_minimum_jerk_from_a_motion_meets_both_ends() -> None:
    begin = Reference(0.3, -0.7, 2.0)
    assert minimum_jerk_from(begin, 1.2, 1.5, 0.0) == pytest.approx(begin)
    end = minimum_jerk_from(begin, 1.2, 1.5, 1.5 - 1e-9)
    assert end == pytest.approx((1.2, 0.0, 0.0), abs=1e-6)


def test_proportional_follows_the_envelope_and_lets_go_of_an_unknown_one() -> None:
    positions = followed(np.repeat([0.2, 5.0, math.nan], [3000, 2000, 3000]))[:, 0]
    assert positions[2999] == pytest.approx(ONE.high / 2.0, abs=1e-3)
    assert positions[4999] == pytest.approx(ONE.high, abs=2e-3)
    assert positions[-1] == pytest.approx(0.0, abs=2e-3)
    assert max(positions) <= ONE.high
    assert min(positions) >= 0.0
    quickest = 1.875 * (ONE.high - ONE.low) / ONE.duration
    assert np.abs(np.diff(positions)).max() == pytest.approx(quickest * DT), "no quicker than a motion, and as quick"
