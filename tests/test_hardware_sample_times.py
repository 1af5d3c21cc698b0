"""Times of samples: even, increasing, never in the future, and following the sender's clock through late arrivals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.hardware.emg.sample_times import LONGEST_FILL, SampleTimes

RATE = 2000.0


def arrivals(lots: np.ndarray, real_rate: float, delays: np.ndarray, begin: float = 100.0) -> np.ndarray:
    """When lots of so many samples arrive, in order, of a sender with its own clock."""
    taken = begin + np.cumsum(lots) / real_rate
    return np.maximum.accumulate(taken + delays)


def fed(lots: np.ndarray, arrived: np.ndarray, rate: float = RATE) -> tuple[np.ndarray, SampleTimes]:
    times = SampleTimes(rate)
    return np.concatenate([times.next(int(n), float(t), float(t)) for n, t in zip(lots, arrived, strict=True)]), times


@pytest.mark.parametrize("ppm", [-300.0, 0.0, 300.0])
def test_times_follow_the_senders_clock_through_late_arrivals(ppm: float) -> None:
    random = np.random.default_rng(1)
    lots = np.full(9000, 27)
    real = RATE * (1.0 + 1e-6 * ppm)
    delays = 1e-3 * random.exponential(2.0, len(lots)) + np.where(random.random(len(lots)) < 0.01, 0.1, 0.0)
    found, times = fed(lots, arrivals(lots, real, delays))
    taken = 100.0 + np.arange(1, len(found) + 1) / real
    error = (found - taken)[round(20 * RATE) :]
    assert np.abs(error).max() < 1.5e-3
    assert abs(np.median(error)) < 0.7e-3
    assert times.missed == 0.0


def test_exact_stamps_give_exact_times() -> None:
    lots = np.random.default_rng(2).integers(1, 60, 3000)
    found, _ = fed(lots, arrivals(lots, RATE, np.zeros(len(lots))))
    assert found == pytest.approx(100.0 + np.arange(1, lots.sum() + 1) / RATE, abs=1e-6)


@given(
    st.lists(st.tuples(st.integers(1, 200), st.floats(0.0, 0.5)), min_size=1, max_size=60),
    st.floats(400.0, 5000.0),
)
def test_times_increase_whatever_arrives_when(lots: list[tuple[int, float]], rate: float) -> None:
    times, now, found = SampleTimes(rate), 10.0, []
    for count, wait in lots:
        now += wait
        if wait > 0.4:
            found.append(times.gap(now))
        found.append(times.next(count, now, now))
        assert not len(found[-1]) or found[-1][-1] <= now + 1e-6
    assert np.all(np.diff(np.concatenate(found)) > 0.0)


def test_one_late_look_at_the_clock_leaves_no_trace() -> None:
    """Samples may be newer than the time that a reader took before it looked; the others keep their times."""
    times = SampleTimes(RATE)
    found = [times.next(20, 100.0 + 0.01 * k, 100.0 + 0.01 * k - (0.008 if k == 600 else 0.0)) for k in range(700)]
    taken = 100.0 - 0.01 + np.arange(1, 14001) / RATE
    error = np.concatenate(found) - taken
    assert np.abs(np.delete(error, np.arange(12000, 12020))).max() < 1e-6
    assert -0.0081 < error.min() < -0.0079


def test_samples_that_never_came_show_within_two_seconds() -> None:
    lots = np.full(1000, 20)
    arrived = arrivals(lots, RATE, np.zeros(1000))
    arrived[500:] += 0.2
    found, times = fed(lots, arrived)
    assert times.missed == pytest.approx(0.2, abs=0.01)
    assert found[-1] == pytest.approx(arrived[-1], abs=2e-3)
    assert found[round(20 * 500 + 2.0 * RATE)] - found[0] == pytest.approx(20 * 500 / RATE + 2.2, abs=5e-3)


def test_a_gap_is_filled_to_its_end_and_at_most_a_second_of_it() -> None:
    times = SampleTimes(RATE)
    last = times.next(10, 5.0)[-1]
    filled = times.gap(5.3)
    assert len(filled) == round(0.3 * RATE) - 1
    assert last < filled[0] < filled[-1] < 5.3
    assert times.next(1, 5.3) == pytest.approx([5.3])
    assert len(times.gap(60.0 - 3.0 / RATE)) == LONGEST_FILL * RATE
    assert times.next(4, 60.0, 60.0)[-1] <= 60.0


def test_a_clock_that_is_turned_back_leaves_times_increasing_at_the_nominal_rate() -> None:
    times = SampleTimes(RATE)
    found = [times.next(20, 100.0 + 0.01 * k) for k in range(50)]
    found += [times.next(20, 40.0 + 0.01 * k) for k in range(500)]
    assert np.diff(np.concatenate(found)) == pytest.approx(1.0 / RATE, rel=1e-6)


def test_nothing_is_filled_before_the_first_sample() -> None:
    assert len(SampleTimes(RATE).gap(3.0)) == 0


def test_a_stream_of_an_hour_has_times_to_its_end() -> None:
    """The first windows are small and double; the thousandth is no larger than the fourth."""
    times, now = SampleTimes(RATE), 100.0
    for _ in range(3600):
        now += 1.0
        last = times.next(round(RATE), now, now)[-1]
        assert last == pytest.approx(now, abs=1e-6)


def test_a_gap_is_never_filled_beyond_now() -> None:
    times = SampleTimes(RATE)
    times.next(100, 5.0, 5.0)
    assert times.gap(1e300, 6.0)[-1] < 6.0
    assert times.next(1, 1e300, 6.0)[0] <= 6.0
