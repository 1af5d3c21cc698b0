"""What the preflight's last motion shows of the cable's dead zone, for the record.

The motor goes out until the joint follows and comes back by as much; there the cable crosses its dead zone once:

    width = motor's way back − joint's way back/slope

It is that of a small stroke, and a lower bound where the joint has not come back at all. No law gets it: our law's
first strokes are 3 % better with it and its next ones 2 % worse (docs/background/live.md).
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
