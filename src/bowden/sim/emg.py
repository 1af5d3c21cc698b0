"""Made-up surface EMG: a muscle at rest, contractions of known onset, and mains."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOISE = 0.004
"""Standard deviation of the signal at rest, as of the recordings that we know [mV]."""


def background(rate: float, count: int, random: np.random.Generator) -> Array:
    """`count` samples of noise [mV]: half of skin and amplifier, white, half of the muscle's band."""
    shaped = filtered(random.normal(size=count), 1, (20.0, min(400.0, 0.4 * rate)), rate)
    return NOISE * (shaped / max(float(np.std(shaped)), 1e-12) + random.normal(size=count)) / np.sqrt(2.0)


def contractions(rate: float, spans: Sequence[tuple[float, float, float]], count: int, seed: int = 0) -> Array:
    """Contractions to be added to a signal: noise between 30 and 250 Hz under a ramp of 50 ms at both ends [mV].

    Args:
        rate: samples a second [Hz].
        spans: onset [s], end [s] and standard deviation [mV] of each.
        count: samples.
        seed: of the noise.
    """
    noise = np.random.default_rng(seed).normal(size=count)
    carrier = filtered(noise, 2, (30.0, min(250.0, 0.4 * rate)), rate)
    carrier /= np.std(carrier)
    time, size = np.arange(count) / rate, np.zeros(count)
    for onset, end, amplitude in spans:
        size += amplitude * np.interp(time, [onset, onset + 0.05, end - 0.05, end], [0.0, 1.0, 1.0, 0.0])
    return carrier * size


def hum(rate: float, count: int, mains: float, harmonics: float, random: np.random.Generator) -> Array:
    """Mains at an RMS of 1, whose size and frequency wander, with harmonics up to the ninth, (count,).

    Args:
        rate: samples a second [Hz].
        count: samples.
        mains: frequency; it wanders by ± 0.1 Hz [Hz].
        harmonics: share of the third one; others have less [–].
        random: where it comes from.
    """
    time = np.arange(count) / rate
    duration = max(float(time[-1]), 1e-9)
    knots = np.linspace(0.0, duration, 3 + int(duration / 8.0))
    wander = np.interp(time, knots, random.uniform(-0.1, 0.1, len(knots)))
    phase = 2.0 * math.pi * np.cumsum(mains + wander) / rate
    out = np.sin(phase)
    for k, share in ((2, 0.3), (3, 1.0), (4, 0.15), (5, 0.6), (7, 0.4), (9, 0.2)):
        if k * mains < 0.45 * rate:
            out += harmonics * share * random.uniform(0.3, 1.0) * np.sin(k * phase + random.uniform(0.0, 6.3))
    out *= np.interp(time, knots, random.uniform(0.7, 1.3, len(knots)))
    return out / max(float(np.std(out)), 1e-12)


def filtered(values: Array, order: int, edges: float | tuple[float, float], rate: float) -> Array:
    """Through a Butterworth low-pass, or a band-pass between two edges [Hz], from rest (n,)."""
    from scipy import signal  # a second, which only made-up EMG need wait for

    sections = signal.butter(order, edges, "band" if isinstance(edges, tuple) else "low", fs=rate, output="sos")
    return np.asarray(signal.sosfilt(sections, values))
