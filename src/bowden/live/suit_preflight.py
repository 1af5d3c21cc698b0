"""What the preflight asks of a suit."""

from bowden.core.units import RADIANS
from bowden.live.preflight import Preflight
from bowden.plants.suit_parts import Suit, spool_friction

FIRST, SETTLE = 8.0 * RADIANS, 0.6
"""First motion [rad], and the wait after each, in which the drive's integral works [s]."""

SOFT_FIRST, SOFT_FOLLOWS = 20.0 * RADIANS, 0.25
"""First motion of a drive without an integral [rad], and the share of it that the motor must make against friction and
cables [–]."""


def on_suit(checks: Preflight, suit: Suit) -> Preflight:
    """The checks on a suit: its gears, which friction holds at first, and its flex sensor, which is less still.

    No more of the current counts than the gears' friction takes: a drive that holds against it, and a wearer who
    does not keep still, load the motor either way.
    """
    noise = checks.noise + 8.0 * suit.joint_sensor.noise + suit.joint_sensor.resolution
    friction = spool_friction(suit) / (suit.motor.gear * suit.motor.torque_constant)
    checks = checks._replace(first=FIRST, settle=SETTLE, noise=noise, light=max(checks.light, friction))
    return checks if suit.motor.integral > 0.0 else checks._replace(first=SOFT_FIRST, follows=SOFT_FOLLOWS)
