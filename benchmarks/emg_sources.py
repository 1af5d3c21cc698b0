"""What surface EMG is made of, each at one standard deviation in the band of surface EMG (20 to 450 Hz).

Interference patterns of many motor units and of few, a heart's cross-talk and mains: what hard cases are drawn from.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BAND = (20.0, 450.0)
"""Of surface EMG (SENIAM's recommendation rounded outward) [Hz]; sizes of signals are compared in it."""


_WAVES = ((0.1, -0.17, 0.02), (-0.12, -0.025, 0.008), (1.0, 0.0, 0.01), (-0.25, 0.026, 0.009), (0.25, 0.27, 0.045))
"""P, Q, R, S and T: height [–], time from R and standard deviation [s]."""


def in_band(values: Array, rate: float) -> Array:
    """A signal's part in `BAND`, without phase; (n,)."""
    spectrum, frequency = np.fft.rfft(values), np.fft.rfftfreq(len(values), 1.0 / rate)
    spectrum[(frequency < BAND[0]) | (frequency > BAND[1])] = 0.0
    return np.fft.irfft(spectrum, len(values))


def one(values: Array, rate: float) -> Array:
    """A signal at a standard deviation of 1 in `BAND`."""
    return values / max(float(np.std(in_band(values, rate))), 1e-12)


def shaped(density: Array, count: int, random: np.random.Generator) -> Array:
    """Gaussian noise of `count` samples whose spectrum has the amplitudes `density` at numpy's rfftfreq."""
    return np.fft.irfft(np.fft.rfft(random.normal(size=count)) * density, count)


def interference(rate: float, count: int, low: float, high: float, random: np.random.Generator) -> Array:
    """The interference pattern of many motor units, (count,).

    Its power spectrum is Shwedyk's, P(f) ∝ f²·fh⁴ / ((f² + fl²)·(f² + fh²)²), as Stulen and De Luca (1981) fit it.

    Args:
        rate: samples a second [Hz].
        count: samples.
        low: fl, 30 to 80 Hz in large muscles [Hz].
        high: fh, 60 to 150 Hz; both fall with fatigue [Hz].
        random: where it comes from.
    """
    frequency = np.fft.rfftfreq(count, 1.0 / rate)
    density = frequency * high**2 / (np.sqrt(frequency**2 + low**2) * (frequency**2 + high**2))
    return one(shaped(density, count, random), rate)


def modulated(carrier: Array, rate: float, depth: float, correlation: float, random: np.random.Generator) -> Array:
    """A carrier whose size wanders log-normally: its power has fewer degrees of freedom than noise of its band.

    Args:
        carrier: (n,).
        rate: samples a second [Hz].
        depth: standard deviation of the logarithm of its size [–].
        correlation: time over which the size wanders [s].
        random: where it comes from.
    """
    frequency = np.fft.rfftfreq(len(carrier), 1.0 / rate)
    density = 1.0 / (1.0 + (2.0 * math.pi * frequency * correlation) ** 2)
    wander = shaped(np.asarray(density, dtype=np.float64), len(carrier), random)
    return one(carrier * np.exp(depth * wander / max(float(np.std(wander)), 1e-12)), rate)


def motor_units(rate: float, count: int, units: int, random: np.random.Generator) -> Array:
    """The sum of the trains of few motor units: spikes with little between them, (count,).

    Each unit fires 8 to 25 times a second (intervals vary by 15 %) one biphasic or triphasic potential of its own size
    and length (σ of 0.8 to 2 ms), as seen through the skin.
    """
    out, time = np.zeros(count), np.arange(-0.012, 0.012, 1.0 / rate)
    for _ in range(units):
        width, size = random.uniform(0.0008, 0.002), random.exponential()
        y = time / width
        potential = size * np.exp(-0.5 * y * y) * (y if random.random() < 0.4 else 1.0 - y * y)
        mean = 1.0 / random.uniform(8.0, 25.0)
        number = math.ceil(1.5 * count / rate / mean) + 8
        fired = np.cumsum(mean * np.clip(random.normal(1.0, 0.15, number), 0.3, 2.0)) - mean * random.random()
        at = np.round(fired * rate).astype(np.int64)
        at = at[(at >= 0) & (at < count - len(potential))]
        np.add.at(out, (at[:, None] + np.arange(len(potential))).ravel(), np.tile(potential, len(at)))
    return one(out, rate)


def heart(rate: float, count: int, beats: float, random: np.random.Generator) -> Array:
    """A heart's cross-talk, with R waves of height 1, (count,): P, QRS and T as Gaussians, `beats` a second."""
    out, time = np.zeros(count), np.arange(count) / rate
    at = random.uniform(0.0, 1.0 / beats)
    sharp = random.uniform(0.8, 1.3)
    while at < count / rate + 0.5:
        first, last = max(0, round((at - 0.35) * rate)), max(0, round((at + 0.5) * rate))
        here = time[first:last] - at
        for size, delay, width in _WAVES:
            out[first:last] += size * np.exp(-0.5 * ((here - delay) / (width * sharp)) ** 2)
        at += random.normal(1.0, 0.05) / beats
    return out
