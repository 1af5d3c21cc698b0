"""What the preflight's last motion tells of the cable's dead zone, so that a law need not begin without knowing.

The motor goes out until the joint follows and comes back by as much; there the cable crosses its dead zone once:

    width = motor's way back − joint's way back/slope

It is that of a small stroke, and a lower bound where the joint has not come back at all: a law takes it as a first
guess in doubt, which its first crossings correct.
"""

import math

from bowden.control.knowledge import WIDEST
from bowden.core.signals import DriveReading
from bowden.live.preflight import PreflightState


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
