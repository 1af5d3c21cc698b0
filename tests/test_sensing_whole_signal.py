"""Filters over whole recordings equal SciPy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage, signal

from bowden.sensing.biquad import butterworth
from bowden.sensing.whole_signal import band_pass, filtered, running_quantile, zero_phase


def noise(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(count)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(("low", "high", "rate"), [(20.0, 400.0, 1000.0), (30.0, 250.0, 2000.0), (0.5, 499.0, 1000.0)])
def test_a_band_pass_equals_scipys(order: int, low: float, high: float, rate: float) -> None:
    values = noise(3000)
    theirs = signal.sosfilt(signal.butter(order, (low, high), "bandpass", fs=rate, output="sos"), values)
    np.testing.assert_allclose(filtered(values, *band_pass(order, low, high, rate)), theirs, atol=1e-10)


@pytest.mark.parametrize(("cutoff", "padding"), [(6.0, 500), (1.0, 1999), (200.0, 0)])
def test_forwards_and_backwards_equals_scipys(cutoff: float, padding: int) -> None:
    values = 3.0 + np.cumsum(noise(2000))
    theirs = signal.sosfiltfilt(signal.butter(2, cutoff, fs=1000.0, output="sos"), values, padlen=padding)
    ours = zero_phase(values, butterworth(cutoff, "low", 1000.0), padding)
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * float(np.abs(values).max()))


@settings(max_examples=50, deadline=None)
@given(count=st.integers(1, 300), width=st.integers(0, 60), seed=st.integers(0, 99))
def test_a_running_quantile_equals_scipys(count: int, width: int, seed: int) -> None:
    values = np.round(noise(count, seed), 1)  # with equal ones among them
    width = 2 * width + 1
    ours = running_quantile(values, 0.9, width)
    np.testing.assert_array_equal(ours, ndimage.percentile_filter(values, 90, size=width))
