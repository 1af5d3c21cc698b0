"""Our law with its gains for the suit: when it crosses the dead zone, how fast, and when it goes on or gives up."""

from collections.abc import Callable

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.our_law.gains import SUIT
from bowden.control.our_law.held_feedback import LOST
from bowden.control.our_law.law import BowdenState
from bowden.control.reference import PointToPoint, Trajectory
from bowden.core.kernel import compiled
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS

DT = 1e-3


def ours(**gains: float) -> Law:
    return LAWS["bowden"].with_gains(**(SUIT._asdict() | gains))


def led(
    law: Law,
    motion: Trajectory,
    duration: float,
    joint: Callable[[float, float, float], float],
    motor: Callable[[float, float], float] = lambda time, command: command,
) -> tuple[np.ndarray, list[BowdenState]]:
    """Commands and states over a `duration` [s]; what is measured follows from time, reference and last command."""
    start, step = compiled(law.start_kernel), compiled(law.step_kernel)
    state, command, commands, states = start(law.gains, Sample(0.0, 0.0)), 0.0, [], []
    times = np.arange(0.0, duration, DT)
    for time, wanted in zip(times.tolist(), motion.sample(times).tolist(), strict=True):
        sample = Sample(joint(time, wanted[0], command), motor(time, command))
        state, command = step(law.gains, state, sample, Reference(*wanted), DT)
        commands.append(command)
        states.append(state)
    return np.array(commands), states


@pytest.mark.parametrize("told", ["the same", "nothing"])
def test_a_joint_that_does_not_answer_is_not_sought_for_ever(told: str) -> None:
    """The joint dies where a stroke ends, just before the search for its touch; without readings nothing is sought."""
    last = 0.0

    def joint(time: float, _wanted: float, command: float) -> float:
        nonlocal last
        last = command if time < 1.6 else last
        return last if told == "the same" or time < 1.6 else np.nan

    commands, states = led(ours(), PointToPoint((0.0, 2.0, 12.0), (0.0, 1.0, 1.0)), 12.0, joint)
    assert states[-1].plan.seeks == 1.0
    assert np.ptp(commands[2000:]) < (0.2 if told == "nothing" else LOST + 0.3)


@pytest.mark.parametrize(
    ("duration", "gains", "earliest", "latest"),
    [(2.0, {}, 0.25, 0.1), (12.5, {}, 0.3, 0.05), (12.5, {"stop": 10.0}, 2.0, 0.5)],
    ids=["quick", "slow", "slow, any time to stop"],
)
def test_a_stroke_is_crossed_shortly_before_its_end(
    duration: float, gains: dict[str, float], earliest: float, latest: float
) -> None:
    """What a sheath does in the second before a slow stroke ends would be on the wrong side of the dead zone."""
    strokes = PointToPoint((0.0, duration, 2.0 * duration), (0.0, 1.5, 0.0))
    _, states = led(ours(**gains), strokes, 1.3 * duration, lambda _time, wanted, _command: wanted)
    turned = np.flatnonzero(np.diff([state.plan.side for state in states]) < -1.5)
    assert len(turned) == 1
    assert latest < duration - DT * turned[0] < earliest


QUICK = PointToPoint((0.0, 2.0, 3.0, 5.0), (0.0, 1.5, 1.5, 0.0))


def gone(law: Law, held: float | None = None) -> float:
    """By how much the command turns back in the first 0.3 s of a quick stroke, while the joint stands.

    Plan and feedback are alike for all; what differs is the search. A motor that is `held` stays there.
    """
    highest = 0.0

    def joint(_time: float, wanted: float, _command: float) -> float:
        nonlocal highest
        highest = max(highest, wanted)
        return highest

    def motor(time: float, command: float) -> float:
        return command if held is None or time < 1.7 else held

    commands, _ = led(law, QUICK, 3.3, joint, motor)
    return float(commands[-1] - commands[3000])


def test_a_quick_stroke_hurries_the_search() -> None:
    assert gone(ours()) < gone(ours(rush=0.0)) - 0.05


def test_a_motor_that_friction_holds_is_not_hurried() -> None:
    """Its plan is far ahead of it: what would be sought faster now, would be gone at once when friction lets go."""
    assert gone(ours(), held=1.5) == pytest.approx(gone(ours(rush=0.0), held=1.5), abs=0.005)


CREEP = 2.0 * RADIANS


@pytest.mark.parametrize(
    ("behind", "creep", "after", "sought"),
    [
        (0.8, 0.0, 0.5, False),
        (1.35, 0.0, 0.08, False),
        (1.1, 0.0, 0.8, True),
        (1.4, CREEP, 0.4, False),
        (1.9, CREEP, 0.4, True),
    ],
    ids=["not late", "late, not stuck yet", "late and stuck", "late but moving", "very late"],
)
def test_a_crossing_that_seemed_to_have_ended_goes_on_where_the_joint_is_late(
    behind: float, creep: float, after: float, sought: bool
) -> None:
    """In a slow stroke back, seen to move, the joint falls `behind` [late], and stands or creeps on."""
    stands = 0.0

    def joint(time: float, wanted: float, _command: float) -> float:
        nonlocal stands
        stands = wanted + behind * SUIT.late if time < 8.0 else stands
        return wanted if time < 7.97 else stands - creep * max(0.0, time - 8.0)

    strokes = PointToPoint((0.0, 2.0, 2.5, 14.5), (0.0, 1.5, 1.5, 1.4))
    moved = []
    for late in (SUIT.late, 0.0):
        _, states = led(ours(late=late), strokes, 8.0 + after, joint)
        assert states[-1].plan.side == -1.0
        assert states[-1].plan.seeks == 0.0
        moved.append(states[-1].plan.motor - states[-31].plan.motor)
    assert moved[0] - moved[1] == pytest.approx(-0.03 * SUIT.search if sought else 0.0, abs=1e-4)


@pytest.mark.parametrize(("length", "waits"), [(12.5, 1.3), (60.0, 0.5)])
def test_an_error_that_changes_its_sign_in_mid_stroke_does_not_make_it_hunt(length: float, waits: float) -> None:
    """An error of 8° that turns round at 1.5 Hz; the side is kept for 0.35 s and 5 s for each rad/s."""
    middle = 0.5 * length

    def joint(time: float, wanted: float, _command: float) -> float:
        wave = 8.0 * RADIANS if (1.5 * time) % 1.0 < 0.5 else -8.0 * RADIANS
        return wanted + (wave if time > middle - 1.5 else 0.0)

    _, states = led(ours(), PointToPoint((0.0, length), (0.0, 1.5)), middle + 1.5, joint)
    sides = np.array([state.plan.side for state in states])
    up, down = (np.flatnonzero(np.diff(sides) * way > 1.5) * DT for way in (1.0, -1.0))
    kept = [down[down > back][0] - back for back in up if np.any(down > back)]
    assert min(kept) > waits


SLOW = PointToPoint((0.0, 12.5, 25.0), (0.0, 1.5, 0.0))


def short_of_the_end(_time: float, wanted: float, _command: float) -> float:
    """A joint that goes no further than 2° before the end of the stroke."""
    return min(wanted, 1.5 - 2.0 * RADIANS)


def test_a_joint_that_has_not_arrived_is_turned_round_as_the_reference_comes_back() -> None:
    """Earlier than by the foresight alone, and once the reference comes back the motor is pulled no further."""
    turned, pulled = [], []
    for sight in (SUIT.sight, 0.0):
        commands, states = led(ours(sight=sight), SLOW, 15.0, short_of_the_end)
        sides = np.array([state.plan.side for state in states])
        turned.append(DT * np.flatnonzero(np.diff(sides) < -1.5)[0])
        pulled.append(commands[: round(turned[-1] / DT)].max() - commands[12500])
    assert 12.5 < turned[0] < turned[1] - 0.3
    assert pulled[0] < 0.5 * RADIANS < pulled[1]


def sought_in(chase: float, until: float) -> float:
    """How far the plan has gone since a slow stroke back, after which the joint stands, has turned the motor."""
    highest = 0.0

    def joint(_time: float, wanted: float, _command: float) -> float:
        nonlocal highest
        highest = max(highest, wanted)
        return highest

    _, states = led(ours(chase=chase), SLOW, until, joint)
    turn = next(k for k, state in enumerate(states) if k > 11000 and state.plan.side < 0.0)
    return states[turn].plan.motor - states[-1].plan.motor


def test_a_slow_search_chases_the_reference_once_the_believed_dead_zone_is_nearly_crossed() -> None:
    """9° are believed; 3° are jumped, and the search of 9°/s is at 7° some tenths of a second later."""
    assert sought_in(SUIT.chase, 12.6) == pytest.approx(sought_in(0.0, 12.6), abs=1e-9)
    assert sought_in(SUIT.chase, 16.0) > sought_in(0.0, 16.0) + 5.0 * RADIANS


def test_a_drive_at_the_limit_of_its_current_is_not_asked_for_more_and_more() -> None:
    """Motor and joint are held in a slow stroke: the feedback does not sum up its error for ever."""
    held, found = 0.5, []
    for sight in (SUIT.sight, 0.0):
        slow = PointToPoint((0.0, 40.0), (0.0, 2.0))
        _, states = led(
            ours(sight=sight),
            slow,
            22.0,
            lambda _t, wanted, _c: min(wanted, held),
            lambda _t, command: min(command, held),
        )
        found.append(states[-1].feedback.feedback)
    assert found[0] < 0.35 < found[1]


@pytest.mark.parametrize(("when", "turns"), [(6.0, False), (11.7, True)], ids=["in mid-stroke", "near its end"])
def test_less_is_borne_of_a_joint_that_is_ahead_where_the_stroke_ends_soon(when: float, turns: bool) -> None:
    """2.6° ahead, as a sheath that straightens makes it, for the last 0.6 s."""
    ahead = 2.6 * RADIANS
    _, states = led(ours(), SLOW, when + 0.6, lambda time, wanted, _c: wanted + (ahead if time > when else 0.0))
    assert (states[-1].plan.side < 0.0) is turns
