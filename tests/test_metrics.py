"""Each figure of merit against signals whose figure is known from a formula."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from bowden.core.errors import LogError
from bowden.records import metrics

DT = 1e-3


def clock(duration: float, dt: float = DT) -> np.ndarray:
    return np.arange(round(duration / dt)) * dt


def smooth(time: np.ndarray) -> np.ndarray:
    return np.sin(0.7 * time) + 0.4 * np.sin(2.3 * time + 1.0)


def play(x: np.ndarray, width: float) -> np.ndarray:
    """The play operator, written here again as the plain rule."""
    y = np.empty_like(x)
    last = x[0]
    for i, value in enumerate(x):
        last = min(max(last, value - 0.5 * width), value + 0.5 * width)
        y[i] = last
    return y


def test_rmse_is_the_root_of_the_mean_square() -> None:
    assert metrics.rmse(np.array([1.0, -1.0, 1.0, -1.0])) == 1.0
    time = clock(10.0)
    assert metrics.rmse(3.0 * np.sin(2.0 * np.pi * time)) == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-12)


@settings(max_examples=50, deadline=None)
@given(shift=st.floats(0.0, 3.0))
def test_a_shifted_signal_has_that_delay(shift: float) -> None:
    time = clock(30.0)
    found = metrics.delay(time, smooth(time), smooth(time - shift))
    assert found == pytest.approx(shift, abs=0.1 * DT)


def test_delay_survives_noise_gain_and_offset_time() -> None:
    time = clock(60.0)
    random = np.random.default_rng(0)
    joint = 0.9 * smooth(time - 0.2345) + 0.002 * random.standard_normal(len(time))
    assert metrics.delay(time + 100.0, smooth(time), joint) == pytest.approx(0.2345, abs=2 * DT)


@pytest.mark.parametrize("period", [0.05, 0.4, 3.92, 10.0])
def test_of_a_motion_that_repeats_the_shortest_delay_counts(period: float) -> None:
    time = clock(60.0)
    reference = np.sin(2.0 * np.pi * time / period)
    joint = np.sin(2.0 * np.pi * (time - 0.012) / period) * (
        1.0 - 0.1 * np.exp(-time / 5.0)
    )  # not quite the same twice
    assert metrics.delay(time, reference, joint) == pytest.approx(0.012, abs=DT)


def test_delay_does_not_exist_without_motion_or_for_a_joint_that_leads() -> None:
    time = clock(10.0)
    assert metrics.delay(time, np.ones(len(time)), smooth(time)) is None
    assert metrics.delay(time[:5], smooth(time[:5]), smooth(time[:5])) is None
    assert metrics.delay(time, smooth(time), smooth(time + 0.3)) == 0.0


@pytest.mark.parametrize("width", [0.02, 0.3, 1.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_width_of_a_play_loop_is_its_dead_zone(width: float, sign: float) -> None:
    time = clock(20.0)
    x = 0.4 + np.cos(2.0 * np.pi * time / 4.0)
    assert metrics.hysteresis_width(x, 7.0 + sign * 0.8 * play(x, width)) == pytest.approx(0.8 * width, rel=2e-3)


def test_the_width_holds_under_noise_on_x() -> None:
    time = clock(40.0)
    x = np.cos(2.0 * np.pi * time / 10.0)
    noisy = x + 0.005 * np.random.default_rng(2).standard_normal(len(x))
    assert metrics.hysteresis_width(noisy, play(x, 0.3)) == pytest.approx(0.3, rel=0.02)


def test_a_line_has_no_width_and_a_single_stroke_no_loop() -> None:
    time = clock(20.0)
    x = np.cos(time)
    assert metrics.hysteresis_width(x, 2.0 * x) == pytest.approx(0.0, abs=1e-12)
    assert metrics.hysteresis_width(time, time) is None
    assert metrics.hysteresis_width(np.zeros(10), np.zeros(10)) is None


@pytest.mark.parametrize(
    ("natural", "damping"), [(54.4, 1.0), pytest.param(30.0, 0.7, marks=pytest.mark.long), (20.0, 0.5)]
)
def test_bandwidth_from_a_chirp_is_the_filter_s(natural: float, damping: float) -> None:
    time = clock(150.0)
    chirp = np.sin(2.0 * np.pi * (0.1 * time + 0.5 * 19.9 / 150.0 * time**2))
    _, response, _ = signal.lsim(([natural**2], [1.0, 2.0 * damping * natural, natural**2]), chirp, time)
    # |G|² = 1/2 for a second-order low-pass, solved for the frequency
    b = 1.0 - 2.0 * damping**2
    exact = natural * math.sqrt(b + math.sqrt(b * b + 1.0))
    frequencies = np.linspace(0.3, 19.5, 769)
    gain = metrics.frequency_response(time, chirp, response, frequencies, 0.15)
    assert metrics.bandwidth(frequencies, np.abs(gain)) == pytest.approx(exact, rel=0.003)
    inside = (frequencies > 0.5) & (frequencies < 15.0)
    s = 2j * np.pi * frequencies[inside]
    known = natural**2 / (s**2 + 2.0 * damping * natural * s + natural**2)
    assert np.abs(gain[inside] - known).max() < 0.005


def test_bandwidth_is_interpolated_and_may_not_exist() -> None:
    half = math.sqrt(0.5)
    assert metrics.bandwidth(np.array([1.0, 2.0]), np.array([half + 0.1, half - 0.1])) == pytest.approx(3.0 * np.pi)
    assert metrics.bandwidth(np.array([1.0, 2.0]), np.array([1.0, 0.9])) is None
    assert metrics.bandwidth(np.array([1.0, 2.0]), np.array([0.5, 0.4])) is None


def test_a_record_too_short_for_its_resolution_is_refused() -> None:
    time = clock(2.0)
    with pytest.raises(LogError, match="resolves"):
        metrics.frequency_response(time, smooth(time), smooth(time), np.array([1.0]), 0.15)
    with pytest.raises(LogError, match="reaches 500 Hz"):
        metrics.frequency_response(time, smooth(time), smooth(time), np.array([600.0]), 5.0)


@pytest.mark.parametrize("constant", [0.5, 2.0])
def test_an_exponential_converges_when_its_formula_says(constant: float) -> None:
    time = clock(30.0)
    estimate = 0.8 * (1.0 - np.exp(-time / constant))
    assert metrics.convergence_time(time, estimate) == pytest.approx(constant * math.log(20.0), abs=2 * DT)
    tight = metrics.convergence_time(time, estimate, band=0.01)
    assert tight == pytest.approx(constant * math.log(100.0), abs=2 * DT)


def test_ripple_of_the_cycle_does_not_count_as_not_converged() -> None:
    time = clock(60.0)
    estimate = 1.0 - np.exp(-time / 2.0) + 0.2 * np.sin(2.0 * np.pi * time / 5.0)
    assert metrics.convergence_time(time, estimate) is None
    found = metrics.convergence_time(time, estimate, period=5.0)
    assert found is not None
    assert 2.0 * math.log(20.0) < found < 2.0 * math.log(20.0) + 5.0  # the mean over one period lags by less than it


def test_convergence_does_not_exist_for_drift_or_nan() -> None:
    time = clock(10.0)
    assert metrics.convergence_time(time, time) is None
    assert metrics.convergence_time(time, np.where(time > 5.0, np.nan, 1.0)) is None
    assert metrics.convergence_time(time, np.full(len(time), 3.0)) == 0.0


def test_energy_of_known_powers() -> None:
    time = clock(10.0) + 50.0
    assert metrics.energy(time, np.full(len(time), 3.0)) == pytest.approx(3.0 * (10.0 - DT))
    assert metrics.energy(time, np.sin(2.0 * np.pi * time) ** 2) == pytest.approx(5.0, rel=1e-3)


def test_sample_time_wants_even_increasing_time() -> None:
    assert metrics.sample_time(np.arange(10_000_001) * 1e-3) == pytest.approx(1e-3)  # rounding of long times is even
    for bad in ([0.0], [0.0, 1.0, 3.0], [0.0, 0.0], [2.0, 1.0, 0.0], [0.0, np.nan, 2.0]):
        with pytest.raises(LogError):
            metrics.sample_time(np.array(bad))


def test_the_summary_agrees_with_its_parts() -> None:
    time = clock(25.0)
    reference = smooth(time)
    joint = play(smooth(time - 0.05), 0.1)
    figures = metrics.summarise({"time": time, "reference": reference, "joint": joint}, 0.2, 0.1)
    error = np.degrees(joint - reference)
    assert figures.rmse_deg == pytest.approx(metrics.rmse(error))
    assert figures.rmse_after_10s_deg == pytest.approx(metrics.rmse(error[10_000:]))
    assert figures.peak_deg == pytest.approx(np.abs(error).max())
    assert figures.delay_s == metrics.delay(time, reference, joint)
    assert figures.electrical_energy_j is None  # no current in this log
    short = metrics.summarise({"time": time[:50], "reference": reference[:50], "joint": joint[:50]}, None, None)
    assert short.rmse_after_10s_deg is None
    assert short.hysteresis_width_deg is None
