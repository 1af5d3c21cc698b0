"""Made-up surface EMG: a muscle at rest under everything that is no contraction, and contractions of known onset."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOISE = 0.004
"""Standard deviation of the signal at rest, as of the recordings that we know [mV]."""
RAIL = 1.5
"""Largest value that the amplifier gives [mV]."""
_HARMONICS = ((1, 1.0), (2, 0.1), (3, 0.3), (5, 0.1))
"""Of hum from an open input."""


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


def background(rate: float, count: int, random: np.random.Generator) -> Array:
    """`count` samples of noise [mV]: half of skin and amplifier, white, half of the muscle's band."""
    shaped = _filtered(random.normal(size=count), 1, (20.0, min(400.0, 0.4 * rate)), rate)
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
    carrier = _filtered(noise, 2, (30.0, min(250.0, 0.4 * rate)), rate)
    carrier /= np.std(carrier)
    time, size = np.arange(count) / rate, np.zeros(count)
    for onset, end, amplitude in spans:
        size += amplitude * np.interp(time, [onset, onset + 0.05, end - 0.05, end], [0.0, 1.0, 1.0, 0.0])
    return carrier * size


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
        swing = _filtered(random.normal(size=len(part)), 2, cutoff, rate)
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


def _filtered(values: Array, order: int, edges: float | tuple[float, float], rate: float) -> Array:
    """Through a Butterworth low-pass, or a band-pass between two edges [Hz], from rest (n,)."""
    from scipy import signal  # a second, which only made-up EMG need wait for

    sections = signal.butter(order, edges, "band" if isinstance(edges, tuple) else "low", fs=rate, output="sos")
    return np.asarray(signal.sosfilt(sections, values))
