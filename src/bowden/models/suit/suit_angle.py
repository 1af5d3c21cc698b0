"""The spool's angle of the suit as a joint angle, so that every law sees a motor whose slope to the joint is about one.

    E(φ) = h1(0) − h1(φ) = 2b·(1 − cos(φ/2)) + 2a·sin(φ/2)        travel of the flexor, from the straight arm
    spool = E(φ)/r,    φ = E⁻¹(r·spool)                            r: radius of the flexor's spool

With ρ = √(a²+b²) and α = atan(a/b), E = 2b − 2ρ·cos(φ/2 + α), so that φ = 2·(acos((b − E/2)/ρ) − α); the arc cosine is
taken by its series and three of Newton's steps, to the last bits. Below `LOW` and above `HIGH` E goes on along its
tangent, and the inverse with it: a command beyond the arm's range stays a number that can be followed.

Both kernels are portable: the live drive uses them too.
"""

import math
from typing import NamedTuple

from bowden.core.kernel import cos, kernel, sin, sqrt
from bowden.core.units import RADIANS
from bowden.models.suit.geometry import SuitGeometry

LOW, HIGH = -30.0 * RADIANS, 120.0 * RADIANS
"""Ends of the range over which E itself is taken [rad]."""


class SpoolMap(NamedTuple):
    """Constants of the maps; `spool_map` makes them."""

    radius: float
    """r, of the flexor's spool [m]."""
    a: float
    """Half the arm's width [m]."""
    b: float
    """From the joint's centre to the anchors [m]."""
    reach: float
    """ρ = √(a²+b²) [m]."""
    tilt: float
    """α = atan(a/b) [rad]."""
    low: float
    """E(LOW) [m]."""
    low_slope: float
    """dE/dφ there [m/rad]."""
    high: float
    """E(HIGH) [m]."""
    high_slope: float
    """dE/dφ there [m/rad]."""


def spool_map(geometry: SuitGeometry, radius: float) -> SpoolMap:
    """The constants of both maps for a flexor's spool of that `radius` [m]."""
    a, b = geometry.half_width, geometry.anchor_distance

    def travel(angle: float) -> float:
        return 2.0 * b - 2.0 * (b * math.cos(0.5 * angle) - a * math.sin(0.5 * angle))

    def slope(angle: float) -> float:
        return b * math.sin(0.5 * angle) + a * math.cos(0.5 * angle)

    return SpoolMap(
        radius, a, b, math.hypot(a, b), math.atan2(a, b), travel(LOW), slope(LOW), travel(HIGH), slope(HIGH)
    )


@kernel
def flexor_travel(angle: float, suit: SpoolMap) -> float:
    """E at a joint angle [rad] [m]."""
    inside = max(LOW, min(HIGH, angle))
    travel = 2.0 * suit.b - 2.0 * (suit.b * cos(0.5 * inside) - suit.a * sin(0.5 * inside))
    beyond = angle - inside
    return travel + beyond * (suit.low_slope if beyond < 0.0 else suit.high_slope)


@kernel
def flexor_arm(angle: float, suit: SpoolMap) -> float:
    """dE/dφ at a joint angle [rad]: torque per tension of the flexor [m]."""
    inside = max(LOW, min(HIGH, angle))
    return suit.b * sin(0.5 * inside) + suit.a * cos(0.5 * inside)


def steepest_spool(low: float, high: float, suit: SpoolMap) -> float:
    """Turn of the spool per joint angle, at most, between two joint angles [rad/rad]."""
    low, high = (max(LOW, min(HIGH, angle)) for angle in (low, high))  # beyond, the map goes on along its tangent
    between = (low + (high - low) * i / 64.0 for i in range(65))
    return max(float(flexor_arm(angle, suit)) for angle in between) / suit.radius


@kernel
def spool_of(motor: float, suit: SpoolMap) -> float:
    """The spool's angle for a motor angle in the joint's coordinate [rad]."""
    return flexor_travel(motor, suit) / suit.radius


@kernel
def motor_of(spool: float, suit: SpoolMap) -> float:
    """The motor angle in the joint's coordinate for an angle of the spool [rad]; the inverse of `spool_of`.

    >>> suit = spool_map(SuitGeometry(), 0.025)
    >>> f"{spool_of(motor_of(1.0, suit), suit):.15f}"
    '1.000000000000000'
    """
    travel = suit.radius * spool
    inside = max(suit.low, min(suit.high, travel))
    cosine = (suit.b - 0.5 * inside) / suit.reach
    missing = 1.0 - cosine
    u = sqrt(2.0 * missing) * (1.0 + missing * (1.0 / 12.0 + missing * 3.0 / 160.0))
    for _ in range(3):
        u = u + (cos(u) - cosine) / sin(u)
    beyond = travel - inside
    return 2.0 * (u - suit.tilt) + beyond / (suit.low_slope if beyond < 0.0 else suit.high_slope)
