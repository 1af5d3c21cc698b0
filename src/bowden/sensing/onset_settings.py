"""Settings of the detector of contractions, and the signals that it takes; see `bowden.sensing.onset`."""

from typing import NamedTuple

from bowden.sensing.envelope import PLAIN_THRESHOLD

SLOWEST, SAFE, QUICKEST = 400.0, 900.0, 5000.0
"""Rates that the detector takes, from `SLOWEST` to `QUICKEST` [Hz]. Below `SAFE` hum's harmonics have few samples to a
period, so that an open input may pass for a contraction: good for a recording, but nothing is moved by it."""

LARGEST = 1e12
"""A larger number, which no converter gives in any unit, counts as missing: its square would outlast all else."""


class OnsetSettings(NamedTuple):
    """Requirements on the detector: one set for all signals.

    What rest and what is beside the muscle are like are constants of `bowden.sensing.onset_constants`.
    """

    ratio: float = 1.8
    """Contractions are reported from this many times the largest value of rest on [–]."""
    hours: float = 10.0
    """Noise of which rest alone is made passes for a contraction once in this time [h]."""
    brief: float = 0.05
    """Nothing that lasts less is an onset, however large: a click's ringing, and twice the 20 ms of hum that begins and
    ends [s]."""
    quiet: float = 0.2
    """Rest of less does not end a contraction [s]."""
    least: float = 1e-12
    """σ is never less until 2 s of rest have been seen, in the signal's unit; see `of_wearer`."""
    weakest: float = 0.0
    """Nothing much smaller is a contraction, however quiet the rest, in the signal's unit; see `of_wearer`."""
    strong: float = 0.0
    """What is larger is no rest unless rest is seen to be, in the signal's unit; 0 where it is not known; see
    `of_wearer`."""
    shortest: float = 0.0
    """Contractions shorter than this are left out, and all others are reported this much later [s]."""


DEFAULTS = OnsetSettings()

WEAKEST = 0.05
"""A contraction that is meant has this share of the maximum one: days of a muscle are measured with thresholds of up to
0.04 (Klein et al., J. Applied Physiology 108, 2010)."""


def of_wearer(rest: float, mvc: float = 0.0) -> OnsetSettings:
    """For a wearer whose σ at `rest` and envelope of the maximum contraction `mvc` (0: unknown) have been measured.

    σ is at least 0.7 of the file's for 2 s of rest. Both in the signal's unit; an envelope is about a σ in the band.
    Rest is bounded from both sides of the maximum, too: what is below 5 % of it is no contraction, and what is above
    20 %, the paper's threshold, no rest that is only possible.

    What is below a tenth of that is none. So a start that is quieter, as of an amplifier that is muted, makes no
    contraction of the rest that follows. Later rest is as it is: pauses of one recording differ by a factor of two and
    more.
    """
    least = max(0.7 * rest, DEFAULTS.least)
    return DEFAULTS._replace(least=least, weakest=WEAKEST * mvc, strong=PLAIN_THRESHOLD * mvc)
