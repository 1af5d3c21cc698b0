"""What `bowden measure` makes of its log: cycles skipped, bridged or late on a busy machine do not spoil it."""

from typing import Any

import numpy as np
import pytest

from bowden.core.errors import SafetyError
from bowden.cycle.one_cycle import TargetSource
from bowden.live.figures import Damage
from bowden.live.mcap_read import Recording
from bowden.live.measured import NEEDED, motions, stalls
from bowden.safety.state import Mode

pytestmark = pytest.mark.usefixtures("undrawn")

PERIOD = 1e-3
SERVO = 600
MOTION = np.concatenate([0.3 * np.sin(2.0 * np.pi * 3.0 * PERIOD * np.arange(900)) ** 2, np.full(100, 0.1)])
"""It ends at rest, as the excitation does."""


def run(
    approach: int = 30,
    until: int | None = None,
    skipped: dict[int, int] | None = None,
    bridged: tuple[int, ...] = (),
    home: int = 0,
) -> dict[str, np.ndarray]:
    """The rows of a run: stopped, preflight with a bridged cycle, the way there, the motion, the way home, released."""
    skips = skipped or {}
    rows: list[dict[str, float]] = []
    tick = 0

    def cycle(mode: Mode, source: TargetSource, requested_target: float) -> None:
        angle = 0.9 * requested_target
        values = {
            "mode": mode,
            "source": source,
            "requested_target": requested_target,
            "command": requested_target,
            "motor": requested_target,
            "joint": angle,
        }
        rows.append({"time": tick * PERIOD + 4e-5, "lateness": 4e-5, "motor_age": 0.0, "joint_age": 0.0, **values})

    for mode, source, count in ((Mode.STOPPED, TargetSource.HOLD, 10), (Mode.PREFLIGHT, TargetSource.MOTION, 20)):
        for k in range(count):
            tick += 1
            cycle(Mode.BRIDGING if mode == Mode.PREFLIGHT and k == 7 else mode, source, 0.0)
    place = -approach - 1
    end = len(MOTION) - 1 if until is None else until
    while place < end:
        tick += 1 + skips.get(place, 0)  # after cycles that were skipped the motion goes on where it was
        place += 1
        requested_target = MOTION[min(place, len(MOTION) - 1)] if place >= 0 else -0.01
        cycle(Mode.BRIDGING if place in bridged else Mode.RUNNING, TargetSource.MOTION, float(requested_target))
    for k in range(home):
        tick += 1
        cycle(Mode.RUNNING, TargetSource.MOTION, float(MOTION[-1]) * (1.0 - (k + 1) / home) + 0.5 * (k + 1) / home)
    for _ in range(20):
        tick += 1
        cycle(Mode.RELEASING, TargetSource.HOLD, 0.0)
    return {name: np.array([row[name] for row in rows], float) for name in NEEDED}


def log(*runs: dict[str, np.ndarray], **changed: Any) -> Recording:
    """Of runs one after another."""
    later, parts = 0.0, []
    for each in runs:
        parts.append({**each, "time": each["time"] + later})
        later = float(parts[-1]["time"][-1])
    columns = {name: np.concatenate([part[name] for part in parts]) for name in NEEDED} | changed
    rows = np.stack([columns[name] for name in NEEDED], axis=1)
    return Recording({}, {}, NEEDED, ("1",) * len(NEEDED), np.arange(len(rows)), rows, [], Damage(0, 0, 0))


def check(found: Any, tolerance: float = 1e-12) -> None:
    """Both parts are the motion, each in its place."""
    for name, wanted in (("cable.csv", MOTION[:SERVO]), ("servo.csv", MOTION[SERVO:])):
        table = found[name]
        assert len(table) in (len(wanted), len(wanted) - 1)
        np.testing.assert_allclose(table[:, 0], PERIOD * np.arange(len(table)), atol=1e-12)
        for column, factor in ((1, 1.0), (2, 1.0), (3, 0.9)):
            np.testing.assert_allclose(table[:, column], factor * wanted[: len(table)], atol=tolerance)


@pytest.mark.parametrize("approach", [0, 1, 200])
def test_cable_and_servo_get_their_part_of_the_motion(approach: int) -> None:
    check(motions(log(run(approach)), MOTION, SERVO, PERIOD))


@pytest.mark.parametrize("home", [1, 5_000])
def test_the_way_home_after_the_motion_is_no_part_of_it(home: int) -> None:
    check(motions(log(run(30, home=home)), MOTION, SERVO, PERIOD))


@pytest.mark.parametrize("approach", [0, 30])
def test_bridged_cycles_do_not_lose_the_measurement(approach: int) -> None:
    check(motions(log(run(approach, bridged=(100, 101, 700))), MOTION, SERVO, PERIOD))


@pytest.mark.parametrize("at", [-20, 100, 700, 990])
def test_skipped_cycles_are_drawn_in_and_the_motion_goes_on_where_it_was(at: int) -> None:
    record = log(run(30, skipped={at: 6}))
    found = motions(record, MOTION, SERVO, PERIOD)
    for name, wanted, begin in (("cable.csv", MOTION[:SERVO], 0), ("servo.csv", MOTION[SERVO:], SERVO)):
        more = 6 if begin <= at < begin + len(wanted) else 0
        table, cut = found[name], at - begin + 1
        assert len(table) in (len(wanted) + more, len(wanted) + more - 1)
        np.testing.assert_allclose(np.diff(table[:, 0]), PERIOD, atol=1e-9)
        whole = np.concatenate([wanted[:cut], np.full(more, np.nan), wanted[cut:]]) if more else wanted
        there = np.isfinite(whole[: len(table)])
        np.testing.assert_allclose(table[there, 1], whole[: len(table)][there], atol=1e-12)
    assert stalls(record, PERIOD) == (6, pytest.approx(6.0 * PERIOD))
    assert "6 samples of the files drawn in between others" in stalls(record, PERIOD).note
    assert not stalls(log(run(30)), PERIOD).note


def test_a_computer_that_is_too_busy_to_measure_is_told_with_its_figure() -> None:
    busy = log(run(30, skipped=dict.fromkeys(range(100, 900, 40), 6)))
    with pytest.raises(SafetyError, match="too busy to measure: 12 % of the cycles were left out, for 6 ms at most"):
        motions(busy, MOTION, SERVO, PERIOD)


def test_an_angle_that_did_not_come_is_drawn_in() -> None:
    rows = run(30)
    stale = np.zeros(len(rows["time"]))
    stale[200:203] = (1.0, 2.0, 3.0)
    joint, motor = rows["joint"].copy(), rows["motor"].copy()
    joint[210] = np.nan
    motor[200:203] = motor[199]
    check(motions(log(rows, joint=joint, motor=motor, motor_age=stale), MOTION, SERVO, PERIOD), 1e-3)


@pytest.mark.parametrize("until", [-10, 0, 500, len(MOTION) - 120])
def test_a_motion_that_was_stopped_is_refused(until: int) -> None:
    for runs in ([run(until=until)], [run(), run(until=until)]):
        with pytest.raises(SafetyError, match=f"of {len(MOTION)} cycles; let it run to its end"):
            motions(log(*runs), MOTION, SERVO, PERIOD)


def test_after_a_motion_that_was_stopped_the_next_one_counts() -> None:
    check(motions(log(run(until=500), run()), MOTION, SERVO, PERIOD))


def test_nothing_at_all_is_refused() -> None:
    rows = {name: values[:10] for name, values in run().items()}
    with pytest.raises(SafetyError, match="after 0 of"):
        motions(log(rows), MOTION, SERVO, PERIOD)
