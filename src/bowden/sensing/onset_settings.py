"""What the detector of contractions goes by, and which signals it takes; see `bowden.sensing.onset`."""

from typing import NamedTuple

SLOWEST, SAFE, QUICKEST = 400.0, 900.0, 5000.0


class OnsetSettings(NamedTuple):
    band_hz: float = 40.0
    top_hz: float = 400.0
    wide_hz: float = 20.0
    swing_hz: float = 5.0
    ratio: float = 2.0
    hours: float = 10.0
    bandwidth: float = 100.0
    brief: float = 0.05
    quiet: float = 0.15
    sure: float = 2.5
    between: float = 0.6
    same: float = 1.2
    spread: float = 0.3
    memory: float = 12.0
    clip: float = 1.5
    prior: float = 3.0
    down: float = 0.3
    doubt: float = 0.15
    after: float = 0.3
    forget: float = 30.0
    share: float = 0.1
    moved: float = 0.001
    broad: float = 0.01
    flat: float = 0.02
    still: float = 0.05
    stuck: float = 0.6
    steps: float = 0.1
    off: float = 0.5
    gone: float = 0.25
    stays: float = 1.0
    periodic: float = 0.03
    least: float = 1e-12
    shortest: float = 0.0


DEFAULTS = OnsetSettings()


def of_wearer(rest: float) -> OnsetSettings:
    """For a wearer whose envelope at `rest` is known, in the signal's unit: σ is never below half of it.

    So a start that is quieter, as of an amplifier that is muted, makes no contraction of the rest that follows.
    """
    return DEFAULTS._replace(least=max(0.5 * rest, DEFAULTS.least))
