"""The play operator: the discontinuous backlash of Eqs 4–5 as a state that the motor pushes before it.

The paper writes two lines, joint = c1·(motor − B1) going up and c2·(motor + B2) going down, with a dead zone
between. With one slope c this is the play (or backlash) operator: a slot of half-width r in which the motor moves
freely, ``joint = c·z + offset`` with z held inside ``[motor − r, motor + r]``. Two different slopes c1 ≠ c2 would let
the joint drift by (c1 − c2)·amplitude in every cycle, so that form is not offered.
"""

import math
from typing import NamedTuple

from bowden.core.kernel import kernel


class Play(NamedTuple):
    """Parameters of the play operator."""

    slope: float = 0.938
    """c, joint motion per motor motion in contact [rad/rad]; either sign."""
    half_width: float = 0.0527
    """r = (B1 + B2)/2, half the motor travel lost at a reversal [rad]."""
    offset: float = 0.0
    """Joint angle for z = 0 [rad]; takes up (B2 − B1)/2."""


@kernel
def push(z: float, motor: float, half_width: float) -> float:
    """The slot's position after the motor has moved monotonically to `motor` [rad].

    >>> push(0.0, 0.5, 0.25), push(0.2, 0.15, 0.1)
    (0.25, 0.2)
    """
    if math.isnan(motor):
        return z
    return max(motor - half_width, min(motor + half_width, z))


@kernel
def joint_angle(z: float, play: Play) -> float:
    """joint = c·z + offset [rad]."""
    return play.slope * z + play.offset
