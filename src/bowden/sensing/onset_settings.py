"""What the detector of contractions goes by, and which signals it takes; see `bowden.sensing.onset`."""

from typing import NamedTuple

SLOWEST, SAFE, QUICKEST = 400.0, 900.0, 5000.0
"""Rates that the detector takes, from `SLOWEST` to `QUICKEST` [Hz]. Below `SAFE` 30 ms have so few samples that an open
input may pass for a contraction: good for a recording, but nothing is moved by it."""


class OnsetSettings(NamedTuple):
    """What the detector goes by: one set for all signals."""

    band_hz: float = 60.0
    """Corner of the twofold high-pass."""
    wide_hz: float = 20.0
    """Lower end of the signal whose power the band is compared with."""
    high: float = 3.0
    """Onset: so many σ."""
    low: float = 2.0
    """End: below so many σ."""
    share: float = 0.1
    """End: or below this share of the contraction's size, twice its mean."""
    swing_hz: float = 5.0
    """Lower end of the movement whose peak the band is compared with."""
    moved: float = 0.001
    """Least share of that peak's square that must be new and in the band."""
    evidence: float = 0.03
    """Time with four times yes that makes an onset [s]."""
    doubt: float = 0.2
    """Share of the other time that is taken from the evidence [–]."""
    quiet: float = 0.15
    """Time below the lower threshold that makes an end [s]."""
    refractory: float = 0.15
    """After an end, no onset [s]."""
    new: float = 0.15
    """Least share of the band's recent peak that must be new."""
    broad: float = 0.01
    """Least share of the power that must be new and in the band."""
    flat: float = 0.02
    """A value that lasts so long is no signal [s]."""
    trouble: float = 0.15
    """Trouble that ends a contraction [s]."""
    still: float = 0.05
    """A step from one sample to the next that is less than this share of the recent largest is none [–]."""
    stuck: float = 0.6
    """Share of samples without a step that is too much [–]."""
    steps: float = 0.1
    """As long as the power is more than this share of that step's square [–]."""
    off: float = 0.15
    """A value that lasts so long while rest is measured is an electrode that is off [s]."""
    settle: float = 0.5
    """From the start, in which rest is measured; time without a signal does not count [s]."""
    wait: float = 0.05
    """The first part of that, in which filters and the memory of a period fill [s]."""
    stays: float = 1.0
    """Time constant of the share of time in trouble, above half of which trouble is what rest is like [s]."""
    level: float = 0.1
    """Least share of the movement's squared peak that the power of mains has; a slow swing has less [–]."""
    gone: float = 0.25
    """Below this share of its power, trouble that had stayed is gone [–]."""
    unsure: float = 10.0
    """Rest that has been seen for less than this is not yet known [s]."""
    unsure_time: float = 5.0
    """Time constant of σ in a contraction until then [s]."""
    least: float = 1e-12
    """σ is never less, in the signal's unit; see `of_wearer`."""
    rest_time: float = 2.0
    """Time constant of σ at rest [s]."""
    early: float = 4.0
    """Rest that has been seen for less than this may have been a contraction [s]."""
    early_time: float = 0.5
    """Time constant of σ at rest until then [s]."""
    active_time: float = 60.0
    """Time constant of σ in a contraction [s]."""
    shortest: float = 0.0
    """Contractions shorter than this are not told, and all others so much later [s]."""


DEFAULTS = OnsetSettings()


def of_wearer(rest: float) -> OnsetSettings:
    """For a wearer whose σ at `rest` has been measured, in the signal's unit: it is never below 0.7 of that.

    So a start that is quieter, as of an amplifier that is muted, makes no contraction of the rest that follows.
    """
    return DEFAULTS._replace(least=max(0.7 * rest, DEFAULTS.least))
