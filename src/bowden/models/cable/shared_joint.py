"""A joint that two cables pull, one up and one down: where it stands, and what each of them pulls.

Each cable would have the joint at an end of its own, x₁ and x₂, if nothing but the load's spring held against it. Both
are springs of one stiffness k at the joint, which pull and do not push, and the joint is without mass:

    k·[x₁ − q]₊ − k·[q − x₂]₊ + push = p + s·q          pretension p and spring s of the load

Where both are taut q lies between x₁ and x₂, weighed by their stiffnesses; where one is slack it follows the other
alone. Source: the balance of the torques on the joint, and nothing else. Its slope by q is −2k − s where both are taut
and −k − s where one is: with linear springs co-contraction does not change how stiff the joint is between both cables,
but how far it may be pushed, or its cables may disagree, before one of them is slack and half of the stiffness gone.

Left out: the joint's inertia, and that a cable's own friction grows with its tension.
"""

from typing import NamedTuple

from bowden.core.kernel import kernel


class JointLoad(NamedTuple):
    """What two cables pull at."""

    stiffness: float
    """k, of each cable at the joint [N·m/rad]."""
    pretension: float
    """p [N·m]"""
    spring: float
    """s [N·m/rad]"""


class Ends(NamedTuple):
    """Where each cable would have the joint, in the joint's coordinate."""

    up: float
    """x₁, of the cable that pulls upwards [rad]."""
    down: float
    """x₂, of the one that pulls downwards [rad]."""
    up_whole: bool
    """Whether the first is not torn."""
    down_whole: bool
    """Whether the second is not."""


@kernel
def shared_joint(ends: Ends, push: float, load: JointLoad) -> float:
    """The joint's angle q [rad].

    Args:
        ends: of both cables.
        push: torque of whoever pushes the joint upwards [N·m].
        load: what is pulled at.
    """
    k, held = load.stiffness, load.pretension - push
    if ends.up_whole and ends.down_whole:
        both = (k * (ends.up + ends.down) - held) / (2.0 * k + load.spring)
        if ends.down <= both <= ends.up:
            return both
    if ends.up_whole:
        alone = (k * ends.up - held) / (k + load.spring)
        if alone <= ends.up and not (ends.down_whole and alone > ends.down):
            return alone
    if ends.down_whole:
        alone = (k * ends.down - held) / (k + load.spring)
        if alone >= ends.down:
            return alone
    rest = -held / load.spring if load.spring > 0.0 else 0.0
    high = ends.down if ends.down_whole else rest
    low = ends.up if ends.up_whole else rest
    return min(max(rest, min(low, high)), max(low, high))


@kernel
def cable_pull(end: float, joint: float, stiffness: float) -> float:
    """Torque of a cable on the joint, 0 where it is slack [N·m].

    Args:
        end: where the cable would have the joint, in the coordinate in which it pulls upwards [rad].
        joint: where that is, in the same coordinate [rad].
        stiffness: of the cable at the joint [N·m/rad].
    """
    return stiffness * max(0.0, end - joint)


class Shares(NamedTuple):
    """By how much the joint moves for each cable's end [rad/rad]."""

    up: float
    down: float


def shares(load: JointLoad, up_taut: bool, down_taut: bool) -> Shares:
    """By how much the joint moves for each cable's end while these are taut: dq/dx₁ and dq/dx₂ of the balance."""
    k = load.stiffness
    whole = k * (up_taut + down_taut) + load.spring
    return Shares(k * up_taut / whole, k * down_taut / whole)
