"""The sheath: its total bend sets the width and the slope of the cable's hysteresis.

Section 3.2 of the paper: the backlash is proportional to the sheath's total bend angle θ and to the gap g. (The
Discussion says that it falls with the gap; that is reading 8, Section 3.2 is taken.) Fig. 15 shows that motion is lost
as well when the bend grows. Relative to the bend θ₀ and gap g₀ at which the cable was identified:

    width = (θ/θ₀)·(g/g₀),    slope = αφ·(1 − loss·(θ/θ₀ − 1))

and the cable, driven by the motor's travel over the width,

    joint = slope·motor + width·αh·h + offset,    h from Eq. 7 with u = d(motor)/width
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.kernel import kernel
from bowden.core.part import part
from bowden.core.quantity import Quantity
from bowden.models.cable.bouc_wen import BoucWen, advance


@part
class Sheath(NamedTuple):
    """How the hysteresis depends on the sheath's bend.

    >>> Sheath(gap=1.5).loss
    0.0
    """

    bend: Annotated[
        float, Quantity("total bend at which the cable was identified", "rad", symbol="θ₀", gt=0.0, le=3600.0)
    ] = np.pi
    gap: Annotated[
        float, Quantity("gap in the sheath over the one at the identification", symbol="g/g₀", gt=0.0, le=100.0)
    ] = 1.0
    loss: Annotated[float, Quantity("share of the slope lost when the bend doubles", ge=0.0, lt=1.0)] = 0.0


@kernel
def width(bend: float, sheath: Sheath) -> float:
    """Factor on the hysteresis' width and height at a total `bend` [rad]; at least 1 %."""
    return max(0.01, bend / sheath.bend * sheath.gap)


@kernel
def slope_factor(bend: float, sheath: Sheath) -> float:
    """Factor on the cable's slope αφ at a total `bend` [rad]; at least 5 %."""
    return max(0.05, 1.0 - sheath.loss * (bend / sheath.bend - 1.0))


@kernel
def advance_in_sheath(h: float, travel: float, width: float, cable: BoucWen) -> float:
    """h after a signed motor `travel` [rad] in a sheath of that `width`: the play is `width` times as wide."""
    return advance(h, travel / width, cable)


@kernel
def joint_in_sheath(motor: float, h: float, width: float, slope_factor: float, cable: BoucWen) -> float:
    """Joint angle in a sheath of that width and slope factor [rad]."""
    return slope_factor * cable.slope * motor + width * cable.hysteresis_gain * h + cable.offset
