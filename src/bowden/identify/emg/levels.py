"""Levels of a wearer's envelope, rest and maximum contraction, from a recording with artefacts in it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import DEFAULTS as CLEANED
from bowden.sensing.envelope import EnvelopeSettings
from bowden.sensing.stream import Enveloped, EnvelopeFilter, OnsetDetector

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SETTLES = 0.5
"""An envelope is none before this long after the beginning of its signal, or after what leaves filters ringing [s]."""
_FILLS = 0.2
"""Rest is looked for from here on, since what a beginning leaves in filters only adds to it [s]."""
_LEAST = 1.0
"""What must be left of a recording [s]."""
_LONG, _CLOSE = 0.3, 0.05
"""Shorter trouble is what the end of a contraction has, too; with so short a pause it is one trouble [s]."""
_BEFORE, _AFTER = 0.15, 0.15
"""Movement and trouble are reported up to this long after their cause, and leave the envelope this long after [s]."""
_RINGS = 3.0
"""What is this many times stronger than the strongest hundredth leaves filters ringing for `SETTLES` [–]."""
_AROUND, _STANDS_OUT = 0.1, 6.0
"""A sample above this many times the 90 % quantile in this time around it is a click; a muscle has none such [s, –]."""
_CLICK = 0.02
"""What is left out before it [s]."""
_HUMS = 0.6
"""In a recording that is movement or mains for more than this share nothing says what rest is [–]."""
_SWING_HZ, _MUSCLE = 5.0, 0.7
"""Of the envelope from here on a muscle leaves at least this share to that of the chain, from 20 Hz on: 0.77 and more
was seen in three recordings wherever the envelope is above 30 % of its largest [Hz, –]."""
_CALM, _STRONG = 3.0, 0.1
"""That is asked where the chain's envelope is above this many times the calmest tenth of it and such a share of the
strongest hundredth; what is below changes neither level [–]."""
_CONTRACTION = 2.5
"""Rest's own strongest quarter second was 2.5 times its calmest half second at most in stretches of six recordings."""
_CALMEST, _STRONGEST = 0.5, 0.25
"""Lengths of the calmest part, which is rest where a recording has less than a tenth of it, and of the strongest part,
a contraction; short contractions last as long [s]."""


class EnvelopeLevels(NamedTuple):
    """An envelope's levels, in the signal's unit."""

    low: float
    """A tenth of the time it is below; or the mean of its calmest half second, where that is less."""
    middle: float
    """Half of the time."""
    high: float
    """Never above."""
    strongest: float
    """Mean over its strongest quarter second: the fluctuation of rest has little of it, as it has of `high`."""
    contraction: bool
    """True if the detector finds a contraction."""
    sigma: float
    """Size at rest as the detector measures it: a tenth of the time without contraction and trouble it is below; 0 if
    there is no such time."""
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

    Left out are dead electrodes, movement, mains and clicks, with their late detection and the time in which filters
    ring after them.

    Args:
        values: in any unit, finite (n,).
        rate: samples a second [Hz].
        where: the recording or stream, for messages.
        mains: that is taken out; 0 for none [Hz].
        detector: that says what is dead, movement or mains.

    Raises:
        LogError: too little is left.
    """
    chain = CLEANED._replace(mains_hz=mains)
    cleaned = EnvelopeFilter(rate, chain).feed(values)
    detected = OnsetDetector(rate, None, detector).feed(values)
    dead = detected.trouble == 1.0
    begin = round(SETTLES * rate)
    out = _wider(dead, 0, begin)
    out[:begin] = True
    if not out.all():
        out |= _artefacts(values, rate, cleaned, dead, chain, detector)
    left = cleaned.envelope[~out]
    if len(left) < _LEAST * rate:
        raise LogError(
            f"{where}: {len(left) / rate:.1f} of {len(values) / rate:.1f} s are free of dead electrodes, movement, "
            "mains and clicks",
            expected=f"at least {_LEAST:g} s",
            do="look at the electrodes, the amplifier's range and --mains, and record again",
        )
    low, middle, high = (float(level) for level in np.quantile(left, (0.1, 0.5, 1.0)))
    off = _wider(dead, 0, begin)
    off[: round(_FILLS * rate)] = True
    low = min(low, float(_means(cleaned.envelope, off, _CALMEST, rate).min(initial=low)))
    strongest = float(_means(cleaned.envelope, out, _STRONGEST, rate).max(initial=middle))
    contraction = bool(np.any(detected.active[~out] > 0.5))
    calm = detected.rest[~out & (detected.active < 0.5) & (detected.trouble == 0.0)]
    sigma = float(np.quantile(calm, 0.1)) if len(calm) else 0.0
    return EnvelopeLevels(low, middle, high, strongest, contraction, sigma, (len(values) - begin - len(left)) / rate)


def check_contraction(found: EnvelopeLevels, rest: float, where: str) -> None:
    """See that there is a contraction in a recording: that the detector finds one, or that its envelope shows it.

    Args:
        found: its levels.
        rest: envelope at rest, of the same recording or of another.
        where: the recording or stream, for messages.

    Raises:
        LogError: there is none.
    """
    if not found.contraction and found.strongest < _CONTRACTION * rest:
        raise LogError(
            f"{where}: no contraction: the envelope is {rest:.4g} at rest and {found.strongest:.4g} in its strongest "
            f"{_STRONGEST:g} s",
            expected=f"at least {_CONTRACTION:g} times as much, or a contraction that the detector finds",
            do="contract as hard as you can in the recording, rest longer or apart (--rest), or look at the electrodes",
        )


def _means(values: Array, out: Flags, lasting: float, rate: float) -> Array:
    """Means over every stretch this long [s] in which nothing is left out."""
    window = round(lasting * rate)
    sums, lacking = (np.concatenate([[0.0], np.cumsum(part)]) for part in (values, out.astype(np.float64)))
    whole = lacking[window:] - lacking[:-window] < 0.5
    return ((sums[window:] - sums[:-window]) / window)[whole]


def _artefacts(
    values: Array, rate: float, cleaned: Enveloped, dead: Flags, chain: EnvelopeSettings, detector: Detector
) -> Flags:
    """Samples of movement, mains and clicks, each with what is around it (n,)."""
    from scipy.ndimage import percentile_filter

    swung = EnvelopeFilter(rate, chain._replace(offset_hz=_SWING_HZ)).feed(values)
    calm, strong = (float(level) for level in np.quantile(cleaned.envelope[~dead], (0.1, 0.99)))
    large = cleaned.envelope > max(_CALM * calm, _STRONG * strong)
    moved = large & (cleaned.envelope < _MUSCLE * swung.envelope)
    odd = OnsetDetector(rate, None, detector).feed(cleaned.signal).trouble == 2.0
    for first, end in _stretches(~odd):
        odd[first:end] |= end - first <= _CLOSE * rate
    for first, end in _stretches(odd):
        odd[first:end] &= end - first >= _LONG * rate
    size = np.abs(swung.signal)
    click = size > _STANDS_OUT * percentile_filter(size, 90, size=round(_AROUND * rate) | 1)
    if np.mean(odd[~dead]) > _HUMS:
        return np.ones(len(values), dtype=bool)
    before, after = round(_BEFORE * rate), round(_AFTER * rate)
    found = _wider(moved | odd, before, after) | _wider(click, round(_CLICK * rate), after)
    rings = np.zeros(len(values), dtype=bool)
    most = _RINGS * float(np.quantile(size[~dead], 0.99))
    for first, end in _stretches(found):
        rings[first:end] = size[first:end].max() > most
    return found | _wider(rings, 0, round(SETTLES * rate))


def _wider(flags: Flags, before: int, after: int) -> Flags:
    """Flagged, and this many samples before and after it as well."""
    found = np.zeros(len(flags), dtype=bool)
    for first, end in _stretches(flags):
        found[max(0, first - before) : end + after] = True
    return found


def _stretches(flags: Flags) -> list[tuple[int, int]]:
    """First sample, and the one after the last, of every stretch that is flagged."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
