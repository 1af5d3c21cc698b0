"""Over what a rig's loop must hold: the bends of its sheath and the stroke of its reference."""

import numpy as np

from bowden.rig.compose import Setup

_INSTANTS = 2001
_SMALLEST = np.radians(5.0)
"""Stroke that stands for a reference that does not move [rad]."""
_WHOLE = 60.0
"""A motion counts for at least so long [s]: a run that is cut short is judged as the whole one would be."""


def bends(setup: Setup) -> tuple[float, float]:
    """Smallest and largest total bend that the scenario comes to [rad]."""
    path = setup.bend(np.linspace(0.0, setup.duration, _INSTANTS))
    return float(np.min(path)), float(np.max(path))


def stroke(setup: Setup) -> tuple[float, float]:
    """Smallest and largest joint angle of the reference; 5° apart at least [rad]."""
    path = setup.reference.sample(np.linspace(0.0, max(setup.duration, _WHOLE), _INSTANTS))[:, 0]
    low, high = float(np.min(path)), float(np.max(path))
    return low, max(high, low + float(_SMALLEST))
