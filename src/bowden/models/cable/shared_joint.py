"""A joint that several cables pull, each one way: where it stands, and what each of them pulls.

Cable i would have the joint at an end of its own, xᵢ, if nothing but the load's spring held against it, and pulls it
upwards, sᵢ = 1, or downwards, sᵢ = −1. All are springs of one stiffness k at the joint, which pull and do not push, and
the joint is without mass:

    Σ sᵢ·k·[sᵢ·(xᵢ − q)]₊ + push = p + s·q          pretension p and spring s of the load

Where cables that pull either way are taut q lies between their ends, weighed by their stiffnesses; where those of one
way are slack it follows the others alone. Source: the balance of the torques on the joint, and nothing else. Its slope
by q is −n·k − s where n cables are taut: with linear springs co-contraction does not change how stiff the joint is
between two cables, but how far it may be pushed, or its cables may disagree, before one of them is slack and half of
the stiffness gone.

Left out: the joint's inertia, and that a cable's own friction grows with its tension.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel

Array = NDArray[np.float64]


class JointLoad(NamedTuple):
    """Load that the cables pull on."""

    stiffness: float
    """k, of each cable at the joint [N·m/rad]."""
    pretension: float
    """p [N·m]"""
    spring: float
    """s [N·m/rad]"""


@kernel
def cable_pull(end: float, joint: float, stiffness: float) -> float:
    """Torque of a cable on the joint, 0 where it is slack [N·m].

    Args:
        end: where the cable would have the joint, in the coordinate in which it pulls upwards [rad].
        joint: where that is, in the same coordinate [rad].
        stiffness: of the cable at the joint [N·m/rad].
    """
    return stiffness * max(0.0, end - joint)


@kernel
def shared_joint(ends: Array, signs: Array, push: float, load: JointLoad) -> float:
    """The joint's angle q [rad].

    The balance falls with q, and is straight between two ends: first the two between which it is zero, then where.

    Args:
        ends: of the cables, in the joint's coordinate (n,); of a torn one infinitely far on its slack side [rad].
        signs: 1 of a cable that pulls upwards, −1 of one that pulls downwards (n,).
        push: torque of whoever pushes the joint upwards [N·m].
        load: what is pulled at.
    """
    k, held = load.stiffness, load.pretension - push
    low, high = -math.inf, math.inf
    for i in range(len(ends)):
        end = ends[i]
        if math.isinf(end):
            continue
        left = -held - load.spring * end
        for j in range(len(ends)):
            left += signs[j] * cable_pull(signs[j] * ends[j], signs[j] * end, k)
        if left > 0.0 or (left == 0.0 and signs[i] > 0.0):
            low = max(low, end)
        else:
            high = min(high, end)
    stiff, pulled = load.spring, 0.0
    for i in range(len(ends)):
        if ends[i] >= high if signs[i] > 0.0 else ends[i] <= low:
            stiff += k
            pulled += k * ends[i]
    balanced = (pulled - held) / stiff if stiff > 0.0 else 0.0
    return min(max(balanced, low), high)


def shares(load: JointLoad, taut: Sequence[bool]) -> Array:
    """By how much the joint moves for each cable's end while these are taut: dq/dxᵢ of the balance (n,) [rad/rad]."""
    pulling = load.stiffness * np.array(taut, dtype=np.float64)
    shared: Array = pulling / (pulling.sum() + load.spring)
    return shared
