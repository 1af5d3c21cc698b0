"""On what a rig's loop must hold: its plant, the bends of its sheath and the stroke of its reference."""

from typing import Any, cast

import numpy as np

from bowden.plants.estimated import Estimated
from bowden.plants.plant import Plant
from bowden.rig.rig import Rig

_INSTANTS = 2001
_SMALLEST = np.radians(5.0)
"""Stroke that stands for a reference that does not move [rad]."""
_WHOLE = 60.0
"""A motion counts for at least this long [s]: a run that is cut short is judged as the whole one would be."""


def judged(rig: Rig) -> Plant:
    """What a law is judged on: what the rig moves, with the estimate of its joint where no encoder measures it.

    Under the wearer's push the law is the inner loop, and who pushes is no part of it: the suit is then judged on a
    wearer who neither resists nor moves. What the push may ask for, the limits of [admittance] say.

    Raises:
        ParameterError: a part that cannot be.
    """
    plant: Any = rig.moved
    if rig.worn is not None and rig.pushing is not None:
        plant = rig.worn._replace(wearer=rig.worn.wearer._replace(stiffness=0.0, damping=0.0, swing=0.0, tremor=0.0))
    return cast(Plant, Estimated(plant, rig.joint_model)) if rig.joint_sensor.estimated else plant


def bends(rig: Rig) -> tuple[float, float]:
    """Smallest and largest total bend that the scenario comes to [rad]."""
    path = rig.bend_path(np.linspace(0.0, rig.duration, _INSTANTS))
    return float(np.min(path)), float(np.max(path))


def stroke(rig: Rig) -> tuple[float, float]:
    """Smallest and largest joint angle of the reference, or of what the wearer's push may ask for; 5° apart at least
    [rad]."""
    if rig.pushing is not None:
        low, high = rig.pushing.admittance.low, rig.pushing.admittance.high
    else:
        path = rig.trajectory.sample(np.linspace(0.0, max(rig.duration, _WHOLE), _INSTANTS))[:, 0]
        low, high = float(np.min(path)), float(np.max(path))
    return low, max(high, low + float(_SMALLEST))
