"""What an identified cable spares a law that learns one while it runs: its first guesses."""

import math

from bowden.control import Law
from bowden.models.cable.bouc_wen import BoucWen, saturation

DOUBT = 0.1
"""About guesses that come from an identified model; 1 is nothing known (docs/our_law.md) [–]."""
_GUESSES = {"slope", "width", "doubt"}


def dead_zone(cable: BoucWen, factor: float) -> float:
    """Motor travel that the cable loses at a reversal, 2·|αh|·h_max/αφ [rad].

    Args:
        cable: Eqs 6-7 of the paper.
        factor: on its play, of the sheath as it lies.

    >>> round(dead_zone(BoucWen(), 1.0), 3)
    0.105
    """
    return float(2.0 * factor * abs(cable.hysteresis_gain) * saturation(cable) / abs(cable.slope))


def knowing(law: Law, cable: BoucWen, factor: float) -> Law:
    """The law with slope and dead zone of an identified cable as its first guesses, if it takes such.

    Args:
        law: one that takes them has the gains `slope`, `width` and `doubt`.
        cable: as identified.
        factor: see `dead_zone`.
    """
    if not set(law.gains._fields) >= _GUESSES:
        return law
    widest = law.limits.get("width", (0.0, math.inf))[1]
    return law.with_gains(slope=cable.slope, width=min(widest, dead_zone(cable, factor)), doubt=DOUBT)
