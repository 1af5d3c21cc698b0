"""Over what a rig's loop must hold: the bends of its sheath and the stroke of its reference."""

import numpy as np

from bowden.core.errors import ParameterError
from bowden.rig.rig import Rig

_INSTANTS = 2001
_SMALLEST = np.radians(5.0)
"""Stroke that stands for a reference that does not move [rad]."""
_WHOLE = 60.0
"""A motion counts for at least so long [s]: a run that is cut short is judged as the whole one would be."""


def refuse_suit(rig: Rig, what: str) -> None:
    """Refuse a rig with a suit for what knows benches alone.

    Args:
        rig: any.
        what: is done, for the message.

    Raises:
        ParameterError: a suit is worn.
    """
    if rig.worn is not None:
        raise ParameterError(
            f"{rig.origin}: a suit is worn, and {what}",
            expected="a rig with a cable or a plant of its own",
            do="set suit.worn = false; on the suit, simulate and campaign show what a law does",
        )


def bends(rig: Rig) -> tuple[float, float]:
    """Smallest and largest total bend that the scenario comes to [rad]."""
    path = rig.bend_path(np.linspace(0.0, rig.duration, _INSTANTS))
    return float(np.min(path)), float(np.max(path))


def stroke(rig: Rig) -> tuple[float, float]:
    """Smallest and largest joint angle of the reference; 5° apart at least [rad]."""
    path = rig.trajectory.sample(np.linspace(0.0, max(rig.duration, _WHOLE), _INSTANTS))[:, 0]
    low, high = float(np.min(path)), float(np.max(path))
    return low, max(high, low + float(_SMALLEST))
