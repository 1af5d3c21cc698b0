"""Generalised play: a stack of plays between two curves that may bend, the branches of a cable's loop.

    a(motor) = slope·motor + bend(motor),    b(motor) = gap(motor) ≥ 0
    zᵢ held inside [a − reachᵢ·b, a + reachᵢ·b],    joint = (1 − Σ shareᵢ)·a + Σ shareᵢ·zᵢ + offset

With Σ shareᵢ·reachᵢ = 1 the joint runs on a − b while the motor goes on one way and on a + b on the way back: both
branches have a form of their own, and the reaches say how it goes over from one to the other. `bend` and `gap` are
straight between evenly spaced nodes. Beyond the last of them, d away from it, the mean goes on along the slope and the
bends' parabola, curve·d·(span + d), which turns into its tangent half a span further on; the gap stays. With straight
branches it is the Prandtl–Ishlinskii stack. While both branches rise, each z does: the joint never goes against the
motor, small loops close, and none gives energy back.

Source: Al Janaideh, Rakheja and Su, IEEE/ASME Transactions on Mechatronics 16(4), 2011 (the generalised
Prandtl–Ishlinskii model and its envelopes).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel

Array = NDArray[np.float64]


class Branches(NamedTuple):
    """Parameters of the generalised play."""

    slope: float
    """Of the mean of both branches [rad/rad]; either sign."""
    bends: Array
    """The mean's distance from the straight line at the nodes (k,) [rad]."""
    gaps: Array
    """Half the distance between the branches at the nodes (m,) [rad]."""
    low: float
    """Motor angle of the first node [rad]."""
    high: float
    """Motor angle of the last node [rad]."""
    reaches: Array
    """Half the slot of each z over the gap (s,) [–]."""
    shares: Array
    """Of the joint's motion that each z makes (s,) [–]."""
    offset: float
    """[rad]"""
    curve: float
    """Of the bends' least-squares parabola, along which the mean goes on beyond the nodes [1/rad]."""


_STEEPEST = 0.25
"""Most that the curve may be, over slope/span: half a span beyond the nodes half of the slope is left then."""


def with_curve(cable: Branches) -> Branches:
    """The cable with the curve that its bends have."""
    row, span = np.zeros(cable.bends.size), cable.high - cable.low
    add_curve(row, cable.bends.size, 1.0 / span**2)
    most = _STEEPEST * abs(cable.slope) / span
    return cable._replace(curve=float(np.clip(row @ cable.bends, -most, most)))


@kernel
def add_curve(row: Array, count: int, factor: float) -> None:
    """Add `factor` times the weights of the parabola's nodes: c of least-squares a + b·u + c·u², u from 0 to 1."""
    middle, last = 0.5 * (count - 1), count - 1.0
    spread = (count * count - 1.0) / 12.0
    square = count * (count * count - 1.0) * (count * count - 4.0) / 180.0
    for k in range(count):
        row[k] += factor * last * last * ((k - middle) ** 2 - spread) / square


@kernel
def bent_on(motor: float, cable: Branches) -> float:
    """Contribution of the curve to the mean beyond the nodes [rad]."""
    span = cable.high - cable.low
    away = abs(motor - max(cable.low, min(cable.high, motor)))
    near = min(away, 0.5 * span)
    return cable.curve * (near * (span + near) + (away - near) * (span + 2.0 * near))


@kernel
def between(values: Array, low: float, high: float, motor: float) -> float:
    """Values at evenly spaced nodes from `low` to `high`, straight between them and constant beyond."""
    last = values.size - 1
    place = max(0.0, min(1.0, (motor - low) / (high - low))) * last
    k = min(int(place), last - 1)
    return values[k] + (place - k) * (values[k + 1] - values[k])


@kernel
def mean_branch(motor: float, cable: Branches) -> float:
    """a(motor) [rad]."""
    return cable.slope * motor + between(cable.bends, cable.low, cable.high, motor) + bent_on(motor, cable)


@kernel
def half_gap(motor: float, cable: Branches) -> float:
    """b(motor) [rad]."""
    return between(cable.gaps, cable.low, cable.high, motor)


@kernel
def push_slots(z: Array, motor: float, width: float, cable: Branches) -> None:
    """Every z (s,) [rad] after the motor has gone monotonically to `motor`, the gap being `width` times as wide."""
    mean, gap = mean_branch(motor, cable), width * half_gap(motor, cable)
    for i in range(z.size):
        z[i] = max(mean - cable.reaches[i] * gap, min(mean + cable.reaches[i] * gap, z[i]))


@kernel
def joined(z: Array, motor: float, slope_factor: float, cable: Branches) -> float:
    """The joint's angle [rad], its motion `slope_factor` times as large."""
    mean = mean_branch(motor, cable)
    joint = mean
    for i in range(z.size):
        joint += cable.shares[i] * (z[i] - mean)
    return slope_factor * joint + cable.offset


@kernel
def fill_joint(motor: Array, before: float, cable: Branches, z: Array, joint: Array) -> None:
    """The joint along a motion (n,) [rad] that comes from `before`, where every z (s,) stood in the middle."""
    z[:] = mean_branch(before, cable)
    for k in range(motor.size):
        push_slots(z, motor[k], 1.0, cable)
        joint[k] = joined(z, motor[k], 1.0, cable)


def joint_angle(motor: Array, lag: float, cable: Branches) -> Array:
    """The joint along a recorded motion (n,) [rad]; before it the motor came from motor[0] + `lag`."""
    joint, z = np.empty(motor.size), np.empty(cable.reaches.size)
    compiled(fill_joint)(np.ascontiguousarray(motor), motor[0] + lag, cable, z, joint)
    return joint


@kernel
def fill_slots(motor: Array, before: float, cable: Branches, z: Array, slots: Array) -> None:
    """Every z along a motion, (n, s) [rad]; see `fill_joint`."""
    z[:] = mean_branch(before, cable)
    for k in range(motor.size):
        push_slots(z, motor[k], 1.0, cable)
        for s in range(z.size):
            slots[k, s] = z[s]


def slots_of(motor: Array, lag: float, cable: Branches) -> Array:
    """Every z along a recorded motion (n, s) [rad]; before it the motor came from motor[0] + `lag`."""
    slots, z = np.empty((motor.size, cable.reaches.size)), np.empty(cable.reaches.size)
    compiled(fill_slots)(np.ascontiguousarray(motor), motor[0] + lag, cable, z, slots)
    return slots


@kernel
def add_node(row: Array, first: int, count: int, place: float, factor: float) -> None:
    """Add `factor` times the weights of the nodes around `place` (0 … 1) to `row` from `first` on."""
    place = max(0.0, min(1.0, place)) * (count - 1)
    k = min(int(place), count - 2)
    row[first + k] += factor * (1.0 - (place - k))
    row[first + k + 1] += factor * (place - k)


@kernel
def beyond(place: float) -> float:
    """How far `place` lies outside 0 … 1, with its sign."""
    return place - max(0.0, min(1.0, place))


@kernel
def bulge(place: float) -> float:
    """Contribution of a unit curve to the mean at a place outside 0 … 1."""
    away = abs(beyond(place))
    near = min(away, 0.5)
    return near * (1.0 + near) + (away - near) * (1.0 + 2.0 * near)


@kernel
def add_slope(row: Array, count: int, factor: float) -> None:
    """Add `factor` times the weights of the slope's nodes: rise from first to last node of their least-squares line."""
    middle = 0.5 * (count - 1)
    scale = factor * 12.0 * (count - 1) / (count * (count * count - 1.0))
    for k in range(count):
        row[k] += scale * (k - middle)


@kernel
def fill_design(motor: Array, before: float, cable: Branches, slots: Array, design: Array) -> None:
    """∂joint/∂(a at the bends' nodes, b at the gaps' nodes) along a motion (n, k + m), for branches near `cable`'s.

    A z in contact lies on a branch where the motor is; a free one where it last was in contact. Beyond the last node
    the mean goes on along the nodes' least-squares line and parabola, as `mean_branch` has it with a curve below its
    limit and half a span from the nodes.

    Args:
        motor: (n,) [rad].
        before: where the motor came from; every z stood in the middle there [rad].
        cable: branches that say when a z is in contact.
        slots: (3, s) room for each z, where it was last in contact (0 … 1 from node to node), and on which side.
        design: (n, k + m) to be filled, zero.
    """
    z, place, side = slots[0], slots[1], slots[2]
    count, wide, span = cable.bends.size, cable.gaps.size, cable.high - cable.low
    z[:] = mean_branch(before, cable)
    place[:] = (before - cable.low) / span
    side[:] = 0.0
    rest = 1.0
    for i in range(z.size):
        rest -= cable.shares[i]
    for n in range(motor.size):
        row, here = design[n], (motor[n] - cable.low) / span
        mean, gap = mean_branch(motor[n], cable), half_gap(motor[n], cable)
        add_node(row, 0, count, here, rest)
        outside, square = rest * beyond(here), rest * bulge(here)
        for i in range(z.size):
            low, high = mean - cable.reaches[i] * gap, mean + cable.reaches[i] * gap
            if z[i] <= low:
                z[i], place[i], side[i] = low, here, -1.0
            elif z[i] >= high:
                z[i], place[i], side[i] = high, here, 1.0
            add_node(row, 0, count, place[i], cable.shares[i])
            add_node(row, count, wide, place[i], cable.shares[i] * side[i] * cable.reaches[i])
            outside += cable.shares[i] * beyond(place[i])
            square += cable.shares[i] * bulge(place[i])
        if outside != 0.0:
            add_slope(row, count, outside)
            add_curve(row, count, square)


def design_of(motor: Array, lag: float, cable: Branches) -> Array:
    """`fill_design` of a motion (n,) [rad] that comes from motor[0] + `lag`: (n, k + m)."""
    found = np.zeros((motor.size, cable.bends.size + cable.gaps.size))
    slots = np.empty((3, cable.reaches.size))
    compiled(fill_design)(np.ascontiguousarray(motor), motor[0] + lag, cable, slots, found)
    return found
