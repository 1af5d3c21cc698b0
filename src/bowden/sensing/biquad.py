"""Second-order sections, sample by sample, in the portable subset; their coefficients come from SciPy."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bowden.core.kernel import kernel


class Biquad(NamedTuple):
    """H(z) = (b0 + b1·z⁻¹ + b2·z⁻²)/(1 + a1·z⁻¹ + a2·z⁻²)."""

    b0: float
    b1: float
    b2: float
    a1: float
    a2: float


class Memory(NamedTuple):
    """What a section keeps from one sample to the next: its transposed direct form II."""

    first: float
    second: float


EMPTY = Memory(0.0, 0.0)
"""Before the first sample, of a signal that was zero."""
PASS = Biquad(1.0, 0.0, 0.0, 0.0, 0.0)
"""Lets every sample through as it is."""


@kernel
def biquad(section: Biquad, memory: Memory, value: float) -> tuple[Memory, float]:
    """One sample through one section; the same sums in the same order as `scipy.signal.lfilter`.

    >>> biquad(Biquad(0.5, 0.5, 0.0, 0.0, 0.0), EMPTY, 2.0)
    (Memory(first=1.0, second=0.0), 1.0)
    """
    out = section.b0 * value + memory.first
    first = section.b1 * value - section.a1 * out + memory.second
    return Memory(first, section.b2 * value - section.a2 * out), out


def section(b: ArrayLike, a: ArrayLike) -> Biquad:
    """A section from the coefficients that `scipy.signal` gives: numerator and denominator, three numbers each."""
    numerator, denominator = np.asarray(b, dtype=float), np.asarray(a, dtype=float)
    return Biquad(*(numerator / denominator[0]).tolist(), *(denominator[1:] / denominator[0]).tolist())


def butterworth(cutoff: float, kind: Literal["low", "high"], rate: float) -> Biquad:
    """A second-order Butterworth filter.

    Args:
        cutoff: −3 dB there [Hz].
        kind: ``low`` or ``high``.
        rate: samples a second [Hz].
    """
    from scipy import signal

    return section(*signal.butter(2, cutoff, kind, output="ba", fs=rate))


def critical_high_pass(cutoff: float, rate: float) -> Biquad:
    """(s/(s + ω))² by the bilinear transform: no ringing; −6 dB at `cutoff` [Hz]."""
    from scipy import signal

    omega = 2.0 * np.pi * cutoff
    return section(*signal.bilinear([1.0, 0.0, 0.0], [1.0, 2.0 * omega, omega * omega], rate))


def notch(frequency: float, width: float, rate: float) -> Biquad:
    """Takes one frequency out; −3 dB at ± `width`/2 from it [Hz]. Frequencies beyond 0.45 of the rate: `PASS`."""
    from scipy import signal

    if not 0.0 < frequency < 0.45 * rate:
        return PASS
    return section(*signal.iirnotch(frequency, frequency / width, fs=rate))
