"""What the preflight's last motion tells of the cable's dead zone, so that a law need not begin without knowing.

The motor goes out until the joint follows and comes back by as much; there the cable crosses its dead zone once:

    width = motor's way back − joint's way back/slope

It is that of a small stroke, and a lower bound where the joint has not come back at all: a law takes it as a first
guess in doubt, which its first crossings correct.
"""

import math
from typing import Any

from bowden.control.law import Law
from bowden.core.signals import DriveReading
from bowden.runtime.preflight import PreflightState

DOUBT = 0.5
"""Of a law's first guesses where the preflight measured the width; 1 is nothing known, 0.1 an identified model [–]."""
WIDEST = 0.5
"""Largest dead zone that is believed [rad]."""


def dead_zone(checked: PreflightState, reading: DriveReading, slope: float) -> float:
    """Width of the dead zone in motor angle [rad]; NaN where an angle is missing.

    Args:
        checked: of the preflight, as it passed.
        reading: at its end.
        slope: about what the joint moves by per motor angle beyond the dead zone, positive [rad/rad].
    """
    back, returned = abs(checked.far_motor - reading.motor), abs(checked.far_joint - reading.joint)
    width = back - returned / slope
    return max(0.0, min(WIDEST, width)) if math.isfinite(width) else math.nan


def told(law: Law, width: float) -> Any:
    """A law's gains with this width as first guess, if it takes one and does not know better, as from a model.

    Args:
        law: one that learns a dead zone has the gains `width` and `doubt`.
        width: [rad]; NaN where nothing was measured.
    """
    gains: Any = law.gains
    if not ({"width", "doubt"} <= set(gains._fields) and gains.doubt > DOUBT and width > 0.0):
        return gains
    return gains._replace(width=min(float(width), law.limits.get("width", (0.0, WIDEST))[1]), doubt=DOUBT)
