"""What the detector of contractions goes by, and which signals it takes; see `bowden.sensing.onset`."""

from typing import NamedTuple

SLOWEST, SAFE, QUICKEST = 400.0, 900.0, 5000.0
"""Rates that the detector takes, from `SLOWEST` to `QUICKEST` [Hz]. Below `SAFE` hum's harmonics have few samples to a
period, so that an open input may pass for a contraction: good for a recording, but nothing is moved by it."""

LARGEST = 1e12
"""What is larger no converter gives, in whatever unit: it is missing, since its square would outlast all else."""


class OnsetSettings(NamedTuple):
    """What the detector goes by: one set for all signals.

    Four are what is asked of it (`ratio`, `hours`, `brief`, `quiet`), from which the thresholds follow; the others say
    what rest and what is beside the muscle are like.
    """

    ratio: float = 1.8
    """Contractions are reported from this many times the largest value of rest on [–]."""
    hours: float = 10.0
    """Rest alone passes for a contraction once in this time [h]."""
    brief: float = 0.05
    """Nothing that lasts less is an onset, however large: a click's ringing, and twice the 20 ms of hum that begins and
    ends [s]."""
    quiet: float = 0.2
    """Rest of less does not end a contraction [s]."""
    bandwidth: float = 100.0
    """Of a muscle's spectrum: this many independent pairs of samples there are in a second [Hz]."""
    band_hz: float = 40.0
    """Lower end of the band: the corner of a twofold high-pass [Hz]."""
    top_hz: float = 400.0
    """Upper end of the band, where the rate has it; a muscle has little beyond [Hz]."""
    wide_hz: float = 20.0
    """Lower end of all that is not slow: muscle, mains, and the quick part of movement [Hz]."""
    swing_hz: float = 5.0
    """Lower end of movement [Hz]."""
    sure: float = 1.5
    """Rest is taken for at most its level and this many standard deviations [–]."""
    unknown: float = 1.4
    """Standard deviation of the log of rest's power, of which nothing has been seen yet: a factor of two in size."""
    learnt: float = 1.5
    """By e less of that variance in this much rest; after a contraction, rest is as well known as then [s]."""
    spread: float = 0.2
    """Standard deviation of the log of power, averaged over 0.1 s, of noise as wide as the band."""
    weight: float = 3.0
    """That counts as much as this much of rest that is seen [s]."""
    memory: float = 12.0
    """Rest older than this does not count [s]."""
    falls: float = 0.3
    """Time constant of a level that was taken for too high: a muscle that contracted from the start [s]."""
    doubt: float = 0.15
    """What is larger than rest is learnt this much slower: it may be a contraction [–]."""
    forget: float = 0.05
    """So much less of rest is known with each second of a contraction: what is well known outlasts minutes [–]."""
    share: float = 0.1
    """Size of what a contraction leaves when it has ended, over its own [–]."""
    moved: float = 0.001
    """Power in the band of movement, over the square of its recent peak [–]."""
    broad: float = 0.01
    """Power in the band of movement and mains, over that above `wide_hz` [–]."""
    repeats: float = 0.03
    """Power of hum that is left after subtracting what was one period ago, over that in the band [–]."""
    level: float = 0.1
    """Least share of the movement's squared peak that the power of mains has; a slow swing has less [–]."""
    stays: float = 1.0
    """Time constant of the share of time that mains cover; above half of it the input is another when they go [s]."""
    gone: float = 0.25
    """Below this share of their power mains have gone [–]."""
    flat: float = 0.02
    """A value that lasts this long is no signal [s]."""
    off: float = 0.5
    """A value that lasts this long is an electrode that is off: rest is measured again [s]."""
    still: float = 0.05
    """A step from one sample to the next that is less than this share of the recent largest is none [–]."""
    stuck: float = 0.6
    """Share of samples without a step that is too much [–]."""
    steps: float = 0.1
    """As long as the power is more than this share of that step's square [–]."""
    least: float = 1e-12
    """σ is never less, in the signal's unit; see `of_wearer`."""
    shortest: float = 0.0
    """Contractions shorter than this are left out, and all others are reported this much later [s]."""


DEFAULTS = OnsetSettings()


def of_wearer(rest: float) -> OnsetSettings:
    """For a wearer whose σ at `rest` has been measured, in the signal's unit: it is never below 0.7 of that.

    So a start that is quieter, as of an amplifier that is muted, makes no contraction of the rest that follows.
    """
    return DEFAULTS._replace(least=max(0.7 * rest, DEFAULTS.least))
