"""What `bowden measure` makes of its log: cycles skipped, bridged or late on a busy machine do not spoil it."""

from typing import Any

import numpy as np
import pytest

from bowden.core.errors import SafetyError
from bowden.cycle.one_cycle import WishSource
from bowden.live.mcap_read import Recording
from bowden.live.mcap_reader import Damage
from bowden.live.measured import NEEDED, motions
from bowden.safety.supervisor import Mode

pytestmark = pytest.mark.usefixtures("undrawn")

PERIOD = 1e-3
SERVO = 600
MOTION = np.concatenate([0.3 * np.sin(2.0 * np.pi * 3.0 * PERIOD * np.arange(900)) ** 2, np.full(100, 0.1)])
"""It ends at rest, as the excitation does."""


def run(
    approach: int = 30, until: int | None = None, skipped: dict[int, int] | None = None, bridged: tuple[int, ...] = ()
) -> dict[str, np.ndarray]:
    """The rows of a run: stopped, preflight with a bridged cycle in it, the way to the motion, the motion, released."""
    skips = skipped or {}
    rows: list[dict[str, float]] = []
    tick = 0

    def cycle(mode: Mode, source: WishSource, wish: float) -> None:
        angle = 0.9 * wish
        values = {"mode": mode, "source": source, "wish": wish, "command": wish, "motor": wish, "joint": angle}
        rows.append({"time": tick * PERIOD + 4e-5, "lateness": 4e-5, "motor_age": 0.0, "joint_age": 0.0, **values})

    for mode, source, count in ((Mode.STOPPED, WishSource.HOLD, 10), (Mode.PREFLIGHT, WishSource.MOTION, 20)):
        for k in range(count):
            tick += 1
            cycle(Mode.BRIDGING if mode == Mode.PREFLIGHT and k == 7 else mode, source, 0.0)
    place = -approach - 1
    end = len(MOTION) - 1 if until is None else until
    while place < end:
        step = 1 + skips.get(place, 0)
        place, tick = place + step, tick + step
        wish = MOTION[min(place, len(MOTION) - 1)] if place >= 0 else -0.01
        cycle(Mode.BRIDGING if place in bridged else Mode.RUNNING, WishSource.MOTION, float(wish))
    for _ in range(20):
        tick += 1
        cycle(Mode.RELEASING, WishSource.HOLD, 0.0)
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


@pytest.mark.parametrize("approach", [0, 30])
def test_bridged_cycles_do_not_lose_the_measurement(approach: int) -> None:
    check(motions(log(run(approach, bridged=(100, 101, 700))), MOTION, SERVO, PERIOD))


@pytest.mark.parametrize("at", [-20, 100, 700, 990])
def test_skipped_cycles_are_drawn_in_and_nothing_is_out_of_place(at: int) -> None:
    check(motions(log(run(30, skipped={at: 6})), MOTION, SERVO, PERIOD), 1e-3)


@pytest.mark.parametrize("at", [SERVO - 3, len(MOTION) - 2])
def test_cycles_that_are_skipped_at_an_end_move_nothing(at: int) -> None:
    found = motions(log(run(30, skipped={at: 6})), MOTION, SERVO, PERIOD)["cable.csv"]
    np.testing.assert_allclose(found[:, 1], MOTION[: len(found)], atol=1e-12)
    assert SERVO - 3 <= len(found) <= SERVO


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
