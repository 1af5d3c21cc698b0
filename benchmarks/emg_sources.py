"""What hard cases of surface EMG are drawn from: its sources, and what happens to electrodes that is no contraction.

Interference patterns of many motor units and of few, and a heart's cross-talk, have a standard deviation of one in the
band of surface EMG (20 to 450 Hz).
"""

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.sim.emg import background, filtered

Array = NDArray[np.float64]

RAIL = 1.5
"""Largest value that the amplifier gives [mV]."""
_HARMONICS = ((1, 1.0), (2, 0.1), (3, 0.3), (5, 0.1))
"""Of hum from an open input."""

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


class Artefact(StrEnum):
    """What happens to electrodes that is no contraction."""

    BUMP = "bump"
    """The electrode is pressed."""
    STEP = "step"
    """The skin's potential jumps, and decays."""
    CLICK = "click"
    """One to three samples."""
    CABLE = "cable"
    """The cable swings: noise below 12 Hz."""
    FLAT = "flat"
    """The input is shorted."""
    RAIL = "rail"
    """The amplifier is saturated."""
    HUM = "hum"
    """The mains' fundamental, for a while."""
    OFF = "off"
    """The electrode is off: hum with harmonics, clipped, under half as much noise again."""
    DRIFT = "drift"


class Happened(NamedTuple):
    """One artefact."""

    time: float
    """When it begins [s]."""
    kind: Artefact
    size: float
    """Its amplitude [mV]."""


def rest(
    rate: float, duration: float, seed: int = 0, mains: float = 50.0, every: float = 3.0
) -> tuple[Array, list[Happened]]:
    """A muscle at rest: noise, mains whose amplitude and frequency wander, and artefacts from 0.03 to 3 mV.

    Args:
        rate: samples a second [Hz].
        duration: [s].
        seed: of everything.
        mains: frequency [Hz]; it wanders by ± 0.1 Hz.
        every: time from one artefact to the next [s].

    Returns:
        The signal [mV] and what happened in it.
    """
    random = np.random.default_rng(seed)
    count = round(duration * rate)
    time = np.arange(count) / rate
    values = background(rate, count, random)
    phase = 2.0 * np.pi * np.cumsum(mains + 0.1 * np.sin(2.0 * np.pi * time / 97.0)) / rate
    size = 0.005 * (1.0 + np.interp(time, np.linspace(0.0, duration, 60), random.uniform(-1.0, 3.0, 60)))
    values += size * sum(share * np.sin(k * phase + k) for k, share in ((1, 1.0), (2, 0.2), (3, 0.4), (5, 0.1)))
    happened = []
    for begin in np.arange(5.0, duration - 5.0, every):
        at, kind = begin + random.uniform(0.0, 1.0), Artefact(random.choice(list(Artefact)))
        how_large = float(10.0 ** random.uniform(-1.5, 0.5))
        disturb(values, phase, round(at * rate), rate, kind, how_large, random)
        happened.append(Happened(at, kind, how_large))
    return values, happened


def disturb(
    values: Array,
    phase: Array,
    k: int,
    rate: float,
    kind: Artefact,
    size: float,
    random: np.random.Generator,
    rail: float = RAIL,
) -> float:
    """Put an artefact into a signal, in place.

    Args:
        values: [mV] (n,).
        phase: of the mains [rad] (n,).
        k: sample at which it begins.
        rate: samples a second [Hz].
        kind: of artefact.
        size: its amplitude [mV].
        random: where the rest of it comes from.
        rail: largest value that the amplifier gives [mV].

    Returns:
        How long it lasts [s].
    """
    lasts = {
        Artefact.BUMP: (0.08, 0.6),
        Artefact.CLICK: (0.0, 0.0),
        Artefact.CABLE: (0.3, 1.0),
        Artefact.HUM: (0.05, 1.0),
    }
    count = max(1, round(random.uniform(*lasts.get(kind, (0.2, 1.5))) * rate))
    if kind is Artefact.CLICK:
        count = int(random.integers(1, 4))
    part = values[k : k + count]  # a view: what is done to it is done to `values`
    n, sign = np.arange(len(part)), float(random.choice([-1.0, 1.0]))
    if kind is Artefact.BUMP:
        part += sign * size * np.sin(np.pi * n / count) ** 2
    elif kind is Artefact.STEP:
        part += sign * size * np.exp(-5.0 * n / count)
    elif kind is Artefact.CLICK:
        part += sign * size
    elif kind is Artefact.CABLE:
        cutoff = random.uniform(5.0, 12.0)
        swing = filtered(random.normal(size=len(part)), 2, cutoff, rate)
        part += size * swing / np.std(swing) * np.hanning(len(part))
    elif kind is Artefact.FLAT:
        part[:] = random.choice([0.0, 0.3, -1.0])
    elif kind is Artefact.RAIL:
        part[:] = sign * rail
    elif kind is Artefact.HUM:
        part += size * np.sin(phase[k : k + len(part)])
    elif kind is Artefact.OFF:
        hum = sum(share * np.sin(j * phase[k : k + len(part)] + j) for j, share in _HARMONICS)
        part[:] = np.clip(size * hum + 1.5 * background(rate, len(part), random), -rail, rail)
    else:
        part += size * np.sin(2.0 * np.pi * n / count)
    return count / rate
