"""Units at the rim: inside everything is SI and radians."""

import math

DEGREES = 180.0 / math.pi
"""Degrees in one radian [deg/rad]."""

RADIANS = math.pi / 180.0
"""Radians in one degree [rad/deg]."""

HERTZ = 2.0 * math.pi
"""rad/s in one hertz."""

CABLE_LOG_LIMIT = 20.0
"""Largest angle [rad] that is accepted in the log of a cable: beyond it the log is almost surely in degrees."""
