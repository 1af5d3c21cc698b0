"""References: every velocity and acceleration is the derivative that it claims to be."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from bowden.control.reference import (
    Chirp,
    Multisine,
    PeriodicMinimumJerk,
    PointToPoint,
    Recorded,
    Trajectory,
)
from bowden.core.errors import ParameterError
from bowden.core.signals import Reference
from bowden.core.units import DEGREES, RADIANS
from bowden.models.minimum_jerk import minimum_jerk, minimum_jerk_from, minimum_jerk_over, minimum_jerk_share


def wave(count: int = 400, dt: float = 0.01) -> Recorded:
    time = 3.0 + np.arange(count) * dt
    return Recorded(time, 0.5 * np.sin(2.0 * time) + 0.1 * np.cos(5.0 * time), cutoff=0.0)


EVERY_KIND = {
    "periodic": PeriodicMinimumJerk(-0.2, 1.2, 4.0),
    "point to point": PointToPoint((0.0, 1.0, 2.5, 3.0), (0.1, 0.9, 0.9, -0.4)),
    "chirp": Chirp(0.8, 0.1, 5.0, 6.0),
    "falling chirp": Chirp(0.8, 5.0, 0.1, 6.0),
    "multisine": Multisine((0.3, 1.1, 2.9), (0.5, 0.2, 0.1), (0.0, 1.0, 4.0), centre=0.6, ramp=2.0),
    "recorded": wave(),
}


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_velocity_and_acceleration_are_the_derivatives(kind: str) -> None:
    """Against fourth-order central differences."""
    trajectory: Trajectory = EVERY_KIND[kind]
    time, d = np.random.default_rng(0).uniform(0.01, 3.9, 2000), 1e-4
    time = time[np.abs(2.0 * time - np.round(2.0 * time)) > 0.01]  # away from where motions join: the jerk jumps there

    def differenced(column: int) -> np.ndarray:
        near, far = (trajectory.sample(time + k * d) - trajectory.sample(time - k * d) for k in (1, 2))
        return (8.0 * near - far)[:, column] / (12.0 * d)

    _, velocity, acceleration = trajectory.sample(time).T
    assert np.abs(velocity).max() > 0.1
    np.testing.assert_allclose(velocity, differenced(0), atol=1e-8 * np.abs(velocity).max())
    # a recorded motion's acceleration is a cubic spline, whose curvature jumps at the knots
    tolerance = 1e-6 if kind == "recorded" else 1e-8
    np.testing.assert_allclose(acceleration, differenced(1), atol=tolerance * np.abs(acceleration).max())


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=4))
def test_minimum_jerk_has_the_least_jerk(amounts: list[float]) -> None:
    """Any motion that also rests at both ends has more: its ∫jerk² is larger, and 720 is the least."""
    x = np.polynomial.Polynomial([0.0, 1.0])
    least = x**3 * (10 - 15 * x + 6 * x**2)
    for t in (0.2, 0.7):
        assert minimum_jerk(0.0, 1.0, 1.0, t).position == pytest.approx(least(t), abs=1e-14)

    def jerk(motion: np.polynomial.Polynomial) -> float:
        whole = (motion.deriv(3) ** 2).integ()
        return float(whole(1.0) - whole(0.0))

    other = least + sum((a * x**3 * (1 - x) ** 3 * x**i for i, a in enumerate(amounts)), 0 * x)
    assert jerk(least) == pytest.approx(720.0)
    assert jerk(other) >= 720.0 - 1e-6


@given(*[st.floats(-3.0, 3.0)] * 4, st.floats(0.1, 5.0), st.floats(0.0, 1.0))
def test_a_motion_from_a_moving_start_is_the_one_quintic_that_ends_at_rest(
    at: float, speed: float, bend: float, end: float, duration: float, share: float
) -> None:
    """Oracle: NumPy's solution of the six conditions at its ends."""
    powers = np.polynomial.Polynomial.basis
    rows = [[powers(k).deriv(n)(t) for k in range(6)] for t in (0.0, duration) for n in range(3)]
    quintic = np.polynomial.Polynomial(np.linalg.solve(rows, [at, speed, bend, end, 0.0, 0.0]))
    begin, time = Reference(at, speed, bend), share * duration
    found = minimum_jerk_from(begin, end, duration, time)
    scale = 1.0 + 1.0 / duration**2
    assert found == pytest.approx([quintic(time), quintic.deriv(1)(time), quintic.deriv(2)(time)], abs=1e-7 * scale)
    assert minimum_jerk_from(begin, end, duration, -1.0) == pytest.approx(begin, abs=1e-9)
    assert minimum_jerk_from(begin, end, duration, 1.5 * duration) == (end, 0.0, 0.0)


def test_minimum_jerk_is_one_motion_in_all_its_forms() -> None:
    time = np.linspace(-0.5, 4.5, 101)
    table = np.stack(minimum_jerk_over(0.2, 1.4, 4.0, time), axis=1)
    one_by_one = np.array([minimum_jerk(0.2, 1.4, 4.0, t) for t in time])
    np.testing.assert_array_equal(table, one_by_one)
    np.testing.assert_allclose(
        0.2 + 1.2 * np.array([minimum_jerk_share(t / 4.0) for t in time]), table[:, 0], atol=1e-15
    )
    from_rest = np.array([minimum_jerk_from(Reference(0.2, 0.0, 0.0), 1.4, 4.0, max(t, 0.0)) for t in time])
    np.testing.assert_allclose(from_rest, table, atol=1e-14)


def test_periodic_motion_repeats_and_turns_at_its_ends() -> None:
    motion, time = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 10.0), np.linspace(0.0, 9.99, 500)
    np.testing.assert_allclose(motion.sample(time + 20.0), motion.sample(time), atol=1e-12)
    np.testing.assert_allclose(motion.sample(10.0 - time)[:, 0], motion.sample(time)[:, 0], atol=1e-12)
    ends = motion.sample(np.array([0.0, 5.0, 10.0]))
    np.testing.assert_allclose(ends[:, 0] * DEGREES, [0.0, 70.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(ends[:, 1:], 0.0, atol=1e-12)


def test_point_to_point_rests_at_each_point_and_outside() -> None:
    motion = PointToPoint((1.0, 2.0, 4.0, 5.0), (0.3, 0.9, 0.9, -0.2))
    states = motion.sample(np.array([-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 60.0]))
    np.testing.assert_allclose(states[:, 0], [0.3, 0.3, 0.3, 0.9, 0.9, 0.9, -0.2, -0.2], atol=1e-14)
    np.testing.assert_allclose(states[:, 1:], 0.0, atol=1e-12)


def test_chirp_has_the_frequency_it_names() -> None:
    """Between zero crossings, at the middle of each half wave, and over the whole: (f0 + f1)/2·T waves."""
    chirp = Chirp(90.0 * RADIANS, 0.1, 20.0, 150.0)  # Fig. 16
    time = np.arange(0.0, 150.0, 2e-4)
    position = chirp.sample(time)[:, 0]
    before = np.flatnonzero(np.signbit(position[:-1]) != np.signbit(position[1:]))
    share = position[before] / (position[before] - position[before + 1])
    crossings = time[before] + share * 2e-4
    middle = 0.5 * (crossings[1:] + crossings[:-1])
    frequency = 0.5 / np.diff(crossings)
    late = middle > 5.0  # before, the frequency changes too much within one half wave to be read off like this
    np.testing.assert_allclose(frequency[late], 0.1 + 19.9 / 150.0 * middle[late], rtol=2e-3)
    assert len(crossings) == pytest.approx(2 * 0.5 * 20.1 * 150.0, abs=2)


def test_chirp_goes_on_at_its_last_frequency() -> None:
    chirp, after = Chirp(1.0, 0.5, 4.0, 6.0), 6.0 + np.linspace(0.0, 2.0, 300)
    position, velocity, acceleration = chirp.sample(after).T
    np.testing.assert_allclose(acceleration, -((2.0 * np.pi * 4.0) ** 2) * position, atol=1e-8)
    edge = chirp.sample(np.array([6.0 - 1e-9, 6.0 + 1e-9]))
    np.testing.assert_allclose(edge[0, :2], edge[1, :2], atol=1e-6)
    assert np.abs(velocity).max() == pytest.approx(8.0 * np.pi, rel=1e-3)


def test_multisine_starts_at_rest_and_holds_the_named_lines() -> None:
    motion = Multisine((0.5, 1.5), (0.3, 0.1), (0.4, 2.0), centre=0.2, ramp=2.0)
    np.testing.assert_allclose(motion.sample(np.array([0.0]))[0], [0.2, 0.0, 0.0], atol=1e-12)
    time = 2.0 + np.arange(2000) * 0.01
    lines = 2.0 * np.abs(np.fft.rfft(motion.sample(time)[:, 0] - 0.2)) / 2000
    np.testing.assert_allclose(lines[[10, 30]], [0.3, 0.1], atol=1e-9)
    assert np.delete(lines, [10, 30]).max() < 1e-9


def test_recorded_passes_through_its_samples_and_rests_outside() -> None:
    motion = wave()
    time = np.arange(400) * 0.01
    np.testing.assert_allclose(
        motion.sample(time)[:, 0], 0.5 * np.sin(2.0 * (3 + time)) + 0.1 * np.cos(5.0 * (3 + time)), atol=1e-12
    )
    inner = motion.sample(time[50:350] + 0.005)
    exact = np.cos(2.0 * (3.005 + time[50:350])) - 0.5 * np.sin(5.0 * (3.005 + time[50:350]))
    np.testing.assert_allclose(inner[:, 1], exact, atol=1e-6)
    outside = motion.sample(np.array([-1.0, 5.0]))
    assert outside[:, 0].tolist() == motion.sample(np.array([0.0, motion.duration]))[:, 0].tolist()
    assert not outside[:, 1:].any()


def test_recorded_filter_has_no_lag_and_takes_the_noise_away() -> None:
    time = np.arange(5000) * 1e-3
    clean = 0.6 * np.sin(2.0 * np.pi * 0.5 * time)
    noisy = clean + np.random.default_rng(0).normal(0.0, 0.01, time.size)
    smooth = Recorded(time, noisy).sample(time[500:-500])
    assert np.std(smooth[:, 0] - clean[500:-500]) < 0.2 * 0.01
    assert np.std(smooth[:, 1] - np.gradient(clean, 1e-3)[500:-500]) < 0.05


@pytest.mark.parametrize(("count", "rate", "cutoff"), [(16, 50.0, 6.0), (700, 1000.0, 6.0), (3000, 1000.0, 1.0)])
def test_recorded_is_scipys_zero_phase_filter_to_its_last_sample(count: int, rate: float, cutoff: float) -> None:
    """On three periods of the cut-off beyond its ends, or all that there is; drawn through its samples or some."""
    time = 4.0 + np.arange(count) / rate
    position = np.cumsum(np.random.default_rng(count).normal(0.0, 1.0, count)) / math.sqrt(rate)
    sections = signal.butter(2, cutoff, fs=rate, output="sos")
    smooth = signal.sosfiltfilt(sections, position, padlen=min(count - 1, int(3.0 * rate / cutoff)))
    motion = Recorded(time, position, cutoff=cutoff)
    assert motion.duration == pytest.approx((count - 1) / rate)
    shown = motion.sample(time - 4.0)
    np.testing.assert_allclose(shown[:, 0], smooth, atol=1e-3 * np.ptp(smooth))
    assert shown[[0, -1], 0] == pytest.approx(smooth[[0, -1]], abs=1e-9)
    assert shown[-1, 1] != 0.0
    assert (motion.sample(np.array([motion.duration + 1e-3]))[0, 1:] == 0.0).all()


def test_a_real_elbow(shared_data: Path) -> None:
    """Four slow flexions: the smooth motion stays with the goniometer, and its derivatives are those of a person."""
    time, angle = np.loadtxt(shared_data / "elbow" / "arm_flexion_goniometer.csv.gz", delimiter=",", skiprows=1).T
    motion = Recorded(time, angle * RADIANS, name="elbow")
    at = time - time[0]
    position, velocity, acceleration = motion.sample(at).T * DEGREES
    difference = position - angle
    assert np.sqrt(np.mean(difference**2)) < 0.3
    assert np.abs(difference).max() < 1.5
    assert 150.0 < np.abs(velocity).max() < 180.0  # the record's own fastest is 167°/s
    assert np.abs(acceleration).max() < 2000.0
    np.testing.assert_allclose(np.gradient(position, at)[1:-1], velocity[1:-1], atol=0.02)
    np.testing.assert_allclose(np.gradient(velocity, at)[1:-1], acceleration[1:-1], atol=2.0)


EVEN = np.arange(100) * 0.01


@pytest.mark.parametrize(
    "build",
    [
        lambda: PeriodicMinimumJerk(0.0, 1.0, 0.0),
        lambda: PeriodicMinimumJerk(0.0, math.nan, 10.0),
        lambda: PointToPoint((0.0,), (0.0,)),
        lambda: PointToPoint((0.0, 1.0, 1.0), (0.0, 1.0, 2.0)),
        lambda: PointToPoint((0.0, 1.0), (0.0, 1.0, 2.0)),
        lambda: PointToPoint((0.0, 1.0), (0.0, math.inf)),
        lambda: Chirp(1.0, 0.1, 20.0, -150.0),
        lambda: Chirp(1.0, 0.0, 20.0, 150.0),
        lambda: Chirp(math.nan, 0.1, 20.0, 150.0),
        lambda: Multisine((), (), ()),
        lambda: Multisine((1.0, 2.0), (1.0,), (0.0, 0.0)),
        lambda: Multisine((1.0, -2.0), (1.0, 1.0), (0.0, 0.0)),
        lambda: Multisine((1.0, math.inf), (1.0, 1.0), (0.0, 0.0)),
        lambda: Multisine((1.0,), (1.0,), (0.0,), ramp=0.0),
        lambda: Recorded(EVEN[:10], EVEN[:10]),
        lambda: Recorded(EVEN, EVEN[:50]),
        lambda: Recorded(EVEN, np.where(EVEN > 0.5, np.nan, EVEN)),
        lambda: Recorded(np.where(EVEN > 0.5, EVEN + 0.1, EVEN), EVEN),
        lambda: Recorded(EVEN[::-1], EVEN),
        lambda: Recorded(np.zeros(100), EVEN),
        lambda: Recorded(EVEN, EVEN, cutoff=-1.0),
    ],
)
def test_absurd_references_are_refused(build) -> None:
    with pytest.raises(ParameterError, match=r"expected|remove"):
        build()
