"""A joint's angle from what a sensor sends: an angle, orientations of one body or two, their rates, or a curve's value.

With q₁ and q₂ the orientations of the bodies on both sides of the joint, q = q₁*·q₂ (of one body q = q₂: the other one
does not move), and the pose at zero q₀, the joint has turned by p = q·q₀*, about its axis n by

    angle = 2·atan2(n·(x, y, z), w)        of p = (w, x, y, z)

which leaves out what p turns about other axes (swing and twist; G. Dobrowolski, arXiv:1506.05481).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bowden.core.units import RADIANS


class Quaternion(NamedTuple):
    """An orientation of length 1."""

    w: float
    x: float
    y: float
    z: float

    def times(self, other: "Quaternion") -> "Quaternion":
        """This one after the other."""
        (a, b, c, d), (w, x, y, z) = self, other
        return Quaternion(
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        )

    @property
    def back(self) -> "Quaternion":
        """The turn the other way."""
        return Quaternion(self.w, -self.x, -self.y, -self.z)

    @property
    def vector(self) -> tuple[float, float, float]:
        """Its axis times the sine of half its angle."""
        return self.x, self.y, self.z


def orientation(numbers: Sequence[float]) -> Quaternion:
    """The quaternion of four numbers w, x, y, z; of no length near 1 it is NaN."""
    length = math.hypot(*numbers)
    if not 0.9 < length < 1.1:
        return Quaternion(*(math.nan,) * 4)
    return Quaternion(*(one / length for one in numbers))


def between(bodies: Sequence[Quaternion]) -> Quaternion:
    """The second body's orientation as the first one sees it; of one body its own."""
    return bodies[0] if len(bodies) == 1 else bodies[0].back.times(bodies[1])


def angle_about(turned: Quaternion, zero: Sequence[float], axis: Sequence[float]) -> float:
    """How far a joint has turned about its axis, within half a turn [rad].

    Args:
        turned: of `between`.
        zero: the same with the joint at zero.
        axis: of the joint, a vector of length 1 where `between` counts from.
    """
    p = turned.times(Quaternion(*zero).back)
    along = sum(n * one for n, one in zip(axis, p.vector, strict=True))
    return math.remainder(2.0 * math.atan2(along, p.w), math.tau)


def axis_of(motion: Sequence[Quaternion]) -> tuple[tuple[float, float, float], float]:
    """The axis about which a joint turned in a free motion, and how much of the motion was about it [–].

    The principal direction of all turns from the first orientation, flexing as the motion's furthest turn does.
    """
    turns = np.array([one.times(motion[0].back) for one in motion])
    vectors = turns[:, 1:] * np.where(turns[:, :1] < 0.0, -1.0, 1.0)
    _, sizes, directions = np.linalg.svd(vectors, full_matrices=False)
    axis = directions[0] * np.sign((vectors @ directions[0])[np.argmax(np.abs(vectors @ directions[0]))])
    share = float(sizes[0] ** 2 / max(np.sum(sizes**2), 1e-30))
    return (float(axis[0]), float(axis[1]), float(axis[2])), share


def on_curve(value: float, values: Sequence[float], angles: Sequence[float]) -> float:
    """The angle of a reading by straight lines through known poses, and on beyond their ends [rad]."""
    order = 1 if values[0] < values[-1] else -1
    xs, ys = values[::order], angles[::order]
    k = min(max(int(np.searchsorted(xs, value)) - 1, 0), len(xs) - 2)
    return ys[k] + (ys[k + 1] - ys[k]) * (value - xs[k]) / (xs[k + 1] - xs[k])


def numbers_in(source: str, gives: str, bodies: int) -> int:
    """How many numbers a sample has."""
    if source == "stretch" or gives == "angle":
        return 1
    return bodies * (4 if gives == "quaternion" else 6)


def in_degrees(value: float) -> float:
    """An angle that is sent in degrees [rad]."""
    return value * RADIANS
