"""Geometry of the suit: how far its two cables move with the elbow, and how large their spools should be (Eqs 1–3).

    h1(φ) = l1 + 2·√(a²+b²)·cos(atan(a/b) + φ/2) − 2b      flexor, on the inside of the elbow; it shortens
    h2(φ) = l2 + R·φ                                       extensor, round the outside; it lengthens

One motor turns both spools, so one cable must give what the other takes: with travels f(φ) = h1(low) − h1(φ) and
g(φ) = h2(φ) − h2(low), measured from the low end of the elbow's range, both non-negative,

    mismatch over the range:                    max |f − g|           on equal spools
    residual, as flexor cable:                  max |f − k·g|         on spools of the ratio k = r_flex/r_ext
    the same slack, as extensor cable:          max |f/k − g|         (the one above, divided by k)

The best k makes the residual least. The printed a = 35 mm gives other figures than Fig. 4's; a = 57 mm
gives all three (reading 3).
Source: Dinh et al. 2017, Eqs 1–3, Fig. 4.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from bowden.core.errors import ParameterError, check_positive
from bowden.core.kernel import cos, kernel, sin

ELBOW_RANGE = (0.0, 0.5 * math.pi)
"""The elbow's range in Fig. 4, 0 to 90° [rad]."""


class SuitGeometry(NamedTuple):
    """Where the cables run; the defaults are the paper's human elbow (Section 2.2)."""

    half_width: float = 0.035
    """a, half the arm's width [m]."""
    anchor_distance: float = 0.085
    """b, from the joint's centre to the anchors [m]."""
    joint_radius: float = 0.05
    """R, of the elbow, round which the extensor runs [m]."""
    flexor_length: float = 0.0
    """l1, nominal extension of the flexor at angle zero; the paper gives none [m]."""
    extensor_length: float = 0.0
    """l2, nominal extension of the extensor at angle zero; the paper gives none [m]."""


class SpoolSizing(NamedTuple):
    """The spools' best ratio for a range of the joint, and what is left."""

    ratio: float
    """k, flexor spool's radius over the extensor's [–]."""
    mismatch: float
    """Largest difference of the cables' travels on equal spools [m]."""
    residual_flexor: float
    """Largest difference on spools of the best ratio, in flexor cable [m]."""
    residual_extensor: float
    """The same difference in extensor cable: `residual_flexor` / `ratio` [m]."""


@kernel
def flexor_extension(angle: float, geometry: SuitGeometry) -> float:
    """h1 at a joint `angle` [rad] (Eq. 1) [m].

    √(a²+b²)·cos(atan(a/b) + φ/2) is written as b·cos(φ/2) − a·sin(φ/2), which is the same.

    >>> f"{1e3 * flexor_extension(math.pi / 2, SuitGeometry()):.1f} mm"
    '-99.3 mm'
    """
    a, b = geometry.half_width, geometry.anchor_distance
    return geometry.flexor_length + 2.0 * (b * cos(0.5 * angle) - a * sin(0.5 * angle)) - 2.0 * b


@kernel
def extensor_extension(angle: float, geometry: SuitGeometry) -> float:
    """h2 at a joint `angle` [rad] (Eq. 2) [m].

    >>> f"{1e3 * extensor_extension(math.pi / 2, SuitGeometry()):.1f} mm"
    '78.5 mm'
    """
    return geometry.extensor_length + geometry.joint_radius * angle


@kernel
def flexor_moment_arm(angle: float, geometry: SuitGeometry) -> float:
    """−dh1/dφ, torque that flexes the joint per unit of tension in the flexor [m]."""
    return geometry.anchor_distance * sin(0.5 * angle) + geometry.half_width * cos(0.5 * angle)


@kernel
def extensor_moment_arm(angle: float, geometry: SuitGeometry) -> float:
    """−dh2/dφ, torque that flexes the joint per unit of tension in the extensor: always −R, it extends [m]."""
    return -geometry.joint_radius


@kernel
def spool_angle(extension: float, spool_radius: float) -> float:
    """h/r, angle of a spool of that radius [m] for a cable's `extension` [m] (Eq. 3) [rad]."""
    return extension / spool_radius


def size_spools(geometry: SuitGeometry, angles: tuple[float, float] = ELBOW_RANGE) -> SpoolSizing:
    """The ratio of the spools' radii that leaves the least slack over a range of the joint.

    f is convex and g a straight line, so |f − k·g| is largest at one place inside the range, where their slopes are
    equal, and at the high end; the best k makes the two equal (Chebyshev). One equation in that place, monotone.

    Args:
        geometry: the suit.
        angles: low and high end of the joint's range [rad].

    Raises:
        ParameterError: a length that is not positive, or a range that is empty or leaves −2·atan(a/b) … 2·atan(b/a),
            in which the flexor shortens ever faster.

    >>> sizing = size_spools(SuitGeometry())
    >>> f"{sizing.ratio:.3f}", [f"{1e3 * value:.2f}" for value in sizing[1:]]
    ('1.175', ['20.75', '6.98', '5.94'])
    """
    radius, residual = _best_radius(geometry, angles)
    ratio = radius / geometry.joint_radius
    return SpoolSizing(ratio, _mismatch(geometry, angles), residual, residual / ratio)


def _best_radius(geometry: SuitGeometry, angles: tuple[float, float]) -> tuple[float, float]:
    """k·R of the best ratio k, which no R changes, and the residual in flexor cable [m]."""
    _check(geometry, angles)
    low, high = angles
    whole, span = _flexor_travel(high, geometry, low), high - low

    def balance(angle: float) -> float:  # what is lacking inside the range, minus what is too much at its end
        slope = flexor_moment_arm(angle, geometry)
        return slope * (span + angle - low) - _flexor_travel(angle, geometry, low) - whole

    radius = flexor_moment_arm(_root(balance, low, high), geometry)
    return radius, whole - radius * span


def _mismatch(geometry: SuitGeometry, angles: tuple[float, float]) -> float:
    low, high = angles
    a, b, radius = geometry.half_width, geometry.anchor_distance, geometry.joint_radius
    inside = 2.0 * (math.asin(min(1.0, radius / math.hypot(a, b))) - math.atan2(a, b))  # where the moment arm is R
    places = (min(max(inside, low), high), high)
    return max(abs(_flexor_travel(place, geometry, low) - radius * (place - low)) for place in places)


def _flexor_travel(angle: float, geometry: SuitGeometry, low: float) -> float:
    return flexor_extension(low, geometry) - flexor_extension(angle, geometry)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a rising function passes zero between `low` and `high`, to the last bit, by bisection."""
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return middle
        low, high = (low, middle) if function(middle) > 0.0 else (middle, high)


def _check(geometry: SuitGeometry, angles: tuple[float, float]) -> None:
    lengths = geometry._asdict()
    for name in ("flexor_length", "extensor_length"):
        if not math.isfinite(lengths.pop(name)):
            raise ParameterError(f"suit geometry: {name} is {getattr(geometry, name)}", expected="a length in metres")
    check_positive("suit geometry", **lengths)
    tilt = math.atan2(geometry.half_width, geometry.anchor_distance)
    lowest, highest = -2.0 * tilt, math.pi - 2.0 * tilt
    low, high = angles
    if not lowest <= low < high <= highest:
        raise ParameterError(
            f"suit geometry: joint range {low} to {high} rad",
            expected=f"low below high, both from {lowest:.3f} to {highest:.3f} rad",
        )
