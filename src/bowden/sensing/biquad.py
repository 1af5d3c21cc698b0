"""Second-order sections, sample by sample, in the portable subset."""

import math
from typing import Literal, NamedTuple

from bowden.core.kernel import kernel


class Biquad(NamedTuple):
    """H(z) = (b0 + b1·z⁻¹ + b2·z⁻²)/(1 + a1·z⁻¹ + a2·z⁻²)."""

    b0: float
    b1: float
    b2: float
    a1: float
    a2: float


class Memory(NamedTuple):
    """State of a section in transposed direct form II."""

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


def _section(b: tuple[float, float, float], a: tuple[float, float, float]) -> Biquad:
    return Biquad(*(part / a[0] for part in (*b, *a[1:])))


def butterworth(cutoff: float, kind: Literal["low", "high"], rate: float) -> Biquad:
    """A second-order Butterworth filter: 1 or s² over s² + √2·s + 1, by the bilinear transform, k = tan(π·cutoff/rate).

    The coefficients are those of `scipy.signal.butter`, whose import takes a second.

    Args:
        cutoff: −3 dB there [Hz].
        kind: ``low`` or ``high``.
        rate: samples a second [Hz].
    """
    k = math.tan(math.pi * cutoff / rate)
    numerator = (k * k, 2.0 * k * k, k * k) if kind == "low" else (1.0, -2.0, 1.0)
    bend = math.sqrt(2.0) * k
    return _section(numerator, (1.0 + bend + k * k, 2.0 * (k * k - 1.0), 1.0 - bend + k * k))


def critical_high_pass(cutoff: float, rate: float) -> Biquad:
    """(s/(s + ω))² by the bilinear transform, s = (1 − z⁻¹)/(1 + z⁻¹)·2·rate: no ringing; −6 dB at `cutoff` [Hz]."""
    k = math.pi * cutoff / rate
    return _section((1.0, -2.0, 1.0), ((1.0 + k) ** 2, 2.0 * (k * k - 1.0), (1.0 - k) ** 2))


def notch(frequency: float, width: float, rate: float) -> Biquad:
    """Takes one frequency out; −3 dB at ± `width`/2 from it [Hz]. Frequencies beyond 0.45 of the rate: `PASS`.

    The coefficients are those of `scipy.signal.iirnotch`.
    """
    if not 0.0 < frequency < 0.45 * rate:
        return PASS
    middle = -2.0 * math.cos(2.0 * math.pi * frequency / rate)
    wide = math.tan(math.pi * width / rate)
    return _section((1.0, middle, 1.0), (1.0 + wide, middle, 1.0 - wide))
