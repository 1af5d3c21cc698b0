"""The loop that a model draws along its log, as it is printed as JSON too."""

import math
from dataclasses import dataclass

from bowden.core.documented import Documented, OrNull
from bowden.core.units import DEGREES


@dataclass(frozen=True)
class HysteresisLoop(Documented):
    """The hysteresis loop of a model over the motion of its log.

    Errors are single standard deviations, infinite (null in JSON) where nothing says them.
    """

    slope: float
    """Of the middle half of the stroke [rad/rad]."""
    slope_error: OrNull
    offset: float
    """Joint angle at motor angle 0 of the line through the middle half [rad]."""
    offset_error: OrNull
    height: float
    """How far apart both ways are there on average, at the joint; below zero where the joint leads [rad]."""
    height_error: OrNull
    rising_place: tuple[OrNull, ...]
    """Where the motor was on average in each twentieth of the stroke while it rose; NaN, null in JSON, where it did not
    pass (20,) [rad]."""
    rising: tuple[OrNull, ...]
    """Joint angles there (20,) [rad]."""
    rising_error: tuple[OrNull, ...]
    falling_place: tuple[OrNull, ...]
    """The same while it fell (20,) [rad]."""
    falling: tuple[OrNull, ...]
    """Joint angles there (20,) [rad]."""
    falling_error: tuple[OrNull, ...]
    curve_error: OrNull
    """Root mean square of rising_error and falling_error [rad]."""


def loop_lines(loop: HysteresisLoop) -> list[tuple[str, str]]:
    """What is said of a loop on a screen: name and text of each figure."""
    return [
        ("loop's slope", _said(loop.slope, loop.slope_error, " rad/rad")),
        ("loop's offset", _said(loop.offset * DEGREES, loop.offset_error * DEGREES, "°")),
        ("loop's height", _said(loop.height * DEGREES, loop.height_error * DEGREES, "°")),
        ("backlash at the motor", f"{abs(loop.height / loop.slope) * DEGREES:.4g}°: the height over the slope"),
        ("the curve", f"as drawn,{_spread(loop.curve_error * DEGREES, '°')}"),
    ]


def _said(value: float, error: float, unit: str) -> str:
    return f"{value:.4g}{_spread(error, unit)}"


def _spread(error: float, unit: str) -> str:
    return f" ± {error:.2g}{unit}" if math.isfinite(error) else f"{unit} (± not shown by this log)"
