"""Levels of a wearer's envelope, rest and maximum contraction, from a recording with artefacts in it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import DEFAULTS as CLEANED
from bowden.sensing.envelope import EnvelopeSettings
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SETTLES = 0.5
"""An envelope is none before so long after the beginning of its signal [s]."""
_LEAST, _LEFT = 1.0, 0.4
"""What must be left of a recording [s], and what share of it [–]."""
_LONG, _CLOSE = 0.3, 0.05
"""Shorter trouble is what the end of a contraction has, too; with so short a pause it is one trouble [s]."""
_BEFORE = 0.15
"""Movement and trouble are told up to so long after their cause [s]."""
_AROUND, _STANDS_OUT = 0.1, 6.0
"""A sample above so many times the 90 % quantile in so long around it is a click; a muscle has none such [s, –]."""
_CLICK = 0.02
"""What is left out before and after it [s]."""
_MUSCLE_HZ, _MUSCLE = 20.0, 0.7
"""Of its envelope a muscle leaves at least this share without what is slower than this: 0.77 and more was seen in three
recordings wherever the envelope is above 30 % of its largest [Hz, –]."""
_CALM, _STRONG = 3.0, 0.1
"""That is asked where the envelope is above so many times the calmest tenth of it and such a share of the strongest
hundredth; the tail of a contraction is below [–]."""


class EnvelopeLevels(NamedTuple):
    """An envelope's levels, in the signal's unit."""

    low: float
    """A tenth of the time it is below."""
    middle: float
    """Half of the time."""
    high: float
    """Never above."""
    left_out: float
    """What was not looked at, beside the first half second [s]."""


def envelope_levels(
    values: Array,
    rate: float,
    where: str = "the recording",
    mains: float = CLEANED.mains_hz,
    detector: Detector = DEFAULT,
) -> EnvelopeLevels:
    """Levels of a signal's envelope without its first half second; the envelope, free of mains, that the live loop has.

    Left out are dead electrodes, movement, mains and clicks, with what tells them late and the half second in which an
    envelope begins anew after them.

    Args:
        values: in any unit, finite (n,).
        rate: samples a second [Hz].
        where: the recording or stream, for messages.
        mains: that is taken out; 0 for none [Hz].
        detector: that says what is dead, movement or mains.

    Raises:
        LogError: too little is left.
    """
    begin, parts = round(SETTLES * rate), [np.empty(0)]
    chain = CLEANED._replace(mains_hz=mains)
    for first, end in _stretches(~_artefacts(values, rate, chain, detector)):
        parts.append(EnvelopeFilter(rate, chain).feed(values[first:end]).envelope[begin:])
    envelope = np.concatenate(parts)
    if len(envelope) < max(_LEAST * rate, _LEFT * len(values)):
        raise LogError(
            f"{where}: {len(envelope) / rate:.1f} of {len(values) / rate:.1f} s are free of dead electrodes, movement, "
            "mains and clicks",
            expected=f"at least {_LEAST:g} s, and {_LEFT:g} of it",
            do="look at the electrodes, the amplifier's range and --mains, and record again",
        )
    low, middle, high = (float(level) for level in np.quantile(envelope, (0.1, 0.5, 1.0)))
    return EnvelopeLevels(low, middle, high, (len(values) - begin - len(envelope)) / rate)


def _artefacts(values: Array, rate: float, chain: EnvelopeSettings, detector: Detector) -> Flags:
    """Samples of dead electrodes, movement, mains and clicks, each with what is around it (n,)."""
    from scipy.ndimage import percentile_filter

    cleaned = EnvelopeFilter(rate, chain).feed(values)
    muscle = EnvelopeFilter(rate, chain._replace(offset_hz=_MUSCLE_HZ)).feed(values).envelope
    dead = OnsetDetector(rate, None, detector).feed(values).trouble == 1.0
    if dead.all():
        return dead
    calm, strong = float(np.quantile(cleaned.envelope[~dead], 0.1)), float(np.quantile(muscle[~dead], 0.99))
    large = cleaned.envelope > max(_CALM * calm, _STRONG * strong)
    moved = large & (muscle < _MUSCLE * cleaned.envelope)
    odd = OnsetDetector(rate, None, detector).feed(cleaned.signal).trouble == 2.0
    for first, end in _stretches(~odd):
        odd[first:end] |= end - first <= _CLOSE * rate
    for first, end in _stretches(odd):
        odd[first:end] &= end - first >= _LONG * rate
    size = np.abs(cleaned.signal)
    click = size > _STANDS_OUT * percentile_filter(size, 90, size=round(_AROUND * rate) | 1)
    before, beside = round(_BEFORE * rate), round(_CLICK * rate)
    return _wider(dead | moved | odd, before, 0) | _wider(click, beside, beside)


def _wider(flags: Flags, before: int, after: int) -> Flags:
    """Flagged, and so many samples before and after it as well."""
    found = np.zeros(len(flags), dtype=bool)
    for first, end in _stretches(flags):
        found[max(0, first - before) : end + after] = True
    return found


def _stretches(flags: Flags) -> list[tuple[int, int]]:
    """First sample, and the one after the last, of every stretch that is flagged."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
