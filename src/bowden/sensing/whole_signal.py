"""Filters over a whole recording that is there from the beginning: forwards, or forwards and backwards.

They equal `sosfilt`, `sosfiltfilt`, `butter` and `percentile_filter` of SciPy, which tests compare; SciPy itself is not
needed to run bowden (docs/decisions/0035).
"""

import math
from bisect import bisect_left, insort

import numpy as np
from numpy.typing import NDArray

from bowden.sensing.biquad import Biquad

Array = NDArray[np.float64]


def filtered(values: Array, *sections: Biquad) -> Array:
    """Through one section after another, from rest (n,)."""
    for section in sections:
        values = _through(section, values, 0.0)
    return values


def zero_phase(values: Array, section: Biquad, padding: int) -> Array:
    """Through a section forwards and then backwards, which leaves no delay (n,).

    Args:
        values: (n,).
        section: as large at rest as `values` are there: a low-pass.
        padding: samples by which the signal is continued at both ends, turned about its end, below n.
    """
    begin = 2.0 * values[0] - values[padding:0:-1]
    end = 2.0 * values[-1] - values[-2 : -padding - 2 : -1]
    whole = np.concatenate([begin, values, end])
    forwards = _through(section, whole, float(whole[0]))[::-1]
    found = _through(section, forwards, float(forwards[0]))[::-1]
    return np.ascontiguousarray(found[padding : padding + len(values)])


def _through(section: Biquad, values: Array, before: float) -> Array:
    """One section after a signal that was `before` for long; the sums of `biquad`, in its order."""
    b0, b1, b2, a1, a2 = section
    rest = (b0 + b1 + b2) / (1.0 + a1 + a2)  # out of it, for one in
    second = (b2 - a2 * rest) * before
    first = (b1 - a1 * rest) * before + second
    found = []
    for value in values.tolist():
        out = b0 * value + first
        first = b1 * value - a1 * out + second
        second = b2 * value - a2 * out
        found.append(out)
    return np.array(found, dtype=np.float64)


def band_pass(order: int, low: float, high: float, rate: float) -> list[Biquad]:
    """A Butterworth band-pass by the bilinear transform, −3 dB at both ends: as many sections as `order`.

    Args:
        order: of the low-pass that it is made from, 1 or 2; the band-pass has twice that.
        low: end of the band [Hz].
        high: the other, below half the rate [Hz].
        rate: samples a second [Hz].
    """
    first, last = math.tan(math.pi * low / rate), math.tan(math.pi * high / rate)
    wide, middle = last - first, first * last
    prototype = -1.0 + 0.0j if order == 1 else complex(-1.0, 1.0) / math.sqrt(2.0)
    half = 0.5 * wide * prototype
    root = (half * half - middle) ** 0.5
    poles = [half + root, half - root]
    turned = [(1.0 + pole) / (1.0 - pole) for pole in poles]
    if order == 1:  # both of one section, a pair or two real ones
        gain = (wide / ((1.0 - poles[0]) * (1.0 - poles[1]))).real
        return [Biquad(gain, 0.0, -gain, -(turned[0] + turned[1]).real, (turned[0] * turned[1]).real)]
    found = []
    for pole, at in zip(poles, turned, strict=True):  # each with its conjugate
        gain = wide / abs(1.0 - pole) ** 2
        found.append(Biquad(gain, 0.0, -gain, -2.0 * at.real, abs(at) ** 2))
    return found


def running_quantile(values: Array, share: float, width: int) -> Array:
    """Of the `width` values about each one, that which `share` of them are below; mirrored at both ends (n,).

    Args:
        values: (n,).
        share: from 0 to below 1.
        width: an odd number.
    """
    half, rank = width // 2, int(width * share)
    around = np.pad(values, half, mode="symmetric").tolist()
    window = sorted(around[:width])
    found = [window[rank]]
    for old, new in zip(around, around[width:], strict=False):
        del window[bisect_left(window, old)]
        insort(window, new)
        found.append(window[rank])
    return np.array(found, dtype=np.float64)
