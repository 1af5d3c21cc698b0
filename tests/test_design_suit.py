"""Gains for the suit by margin, and random wearers."""

import numpy as np
import pytest

from bowden.control.reference import PointToPoint
from bowden.core.units import DEGREES, RADIANS
from bowden.plants.presets.suit import suit
from bowden.sim.run import simulate
from bowden.sim.suit_runs import DRIVE_INTEGRAL, FRICTION_FEEDFORWARD, run_suit, suit_adaptive, suit_ours
from wearers import wear


@pytest.mark.parametrize("number", [3, 8, 13])
def test_the_compensated_suit_on_a_few_random_wearers(number: int) -> None:
    """All of them stable, and far nearer than the 30° without compensation; the 500 are in the benchmarks."""
    made = suit()
    made = made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL))
    found = wear(number, made, suit_ours())
    assert found.stable
    assert found.largest_deg < 8.0
    assert found.rmse_deg < 1.5


@pytest.mark.xfail(strict=True, reason="0.46 s instead of 0.3 s until the elbow has moved by half a degree")
def test_the_elbow_sets_out_with_the_reference_after_a_rest() -> None:
    """Flexions of 2 s with rests: the dead zone is crossed as the reference sets out, and the elbow rests where it
    should."""
    made = suit()
    made = made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL, friction_feedforward=FRICTION_FEEDFORWARD))
    top = 90.0 * RADIANS
    rests = PointToPoint(
        (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0), (0.0, 0.0, top, top, 0.0, 0.0, top, top, 0.0)
    )
    trace = simulate(made, suit_ours(), rests, duration=16.0, seed=400)
    for begin, way in ((10.0, 1.0), (14.0, -1.0)):  # the first stroke is to learn from
        start = round(begin * 1000)
        moved = way * (trace["joint"][start:] - trace["joint"][start])
        assert np.argmax(moved > 0.5 * RADIANS) < 300  # the reference itself takes 166
        assert np.abs(trace.error[start - 200 : start]).max() * DEGREES < 3.0
    late = trace.time > 5.0
    assert np.abs(trace.error[late]).max() * DEGREES < 6.0


def test_a_stroke_that_goes_on_after_a_rest_is_followed_all_the_same() -> None:
    """A rest is no turn: there is nothing to cross."""
    made = suit()
    made = made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL, friction_feedforward=FRICTION_FEEDFORWARD))
    step = 30.0 * RADIANS
    steps = (0.0, 0.0, step, step, 2.0 * step, 2.0 * step, 3.0 * step)
    stairs = PointToPoint((0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0), steps)
    trace = simulate(made, suit_ours(), stairs, duration=12.0, seed=400)
    assert np.abs(trace.error).max() * DEGREES < 12.0
    resting = (trace.time > 9.5) & (trace.time < 10.0)
    assert np.abs(trace.error[resting]).max() * DEGREES < 3.5


def test_a_spool_that_sticks_on_a_pd_drive_is_turned_sooner_than_by_the_adaptive_law() -> None:
    """Fast flexions and extensions, 0–70° in 2 s with rests: after some our law has asked for what they take."""
    top = 70.0 * RADIANS
    fast = PointToPoint(tuple(2.0 * k for k in range(20)), tuple((0.0, top, top, 0.0)[k % 4] for k in range(20)))
    late = [
        np.abs(run_suit(law, reference=fast, duration=38.0).error[22_000:]) for law in (suit_ours(), suit_adaptive())
    ]
    assert late[0].max() < 0.6 * late[1].max()
