"""What several laws share: the servo inverted for the reference, the direction of motion, the feedback, limits."""

import math
from collections.abc import Mapping

from bowden.control.knowledge import Knowledge
from bowden.control.law import FromRig
from bowden.core.kernel import kernel, sel
from bowden.core.signals import Reference

LEAD = 0.0388
"""Lag of the default bench, 2ζ/ω + (d + ½)·Ts, which `ahead` takes away [s]."""

LEAD_SQUARE = 4.05e-4
"""The same to second order, 1/ω² + (2ζ/ω)·τ + τ²/2 with τ = (d + ½)·Ts [s²]."""


def lag(known: Knowledge) -> float:
    """Lag of servo and delay, 2ζ/ω + τ [s]."""
    return 2.0 * known.servo_damping / known.servo_frequency + known.delay


def lag_square(known: Knowledge) -> float:
    """Lag of servo and delay to second order, 1/ω² + (2ζ/ω)·τ + τ²/2 [s²]."""
    omega, delay = known.servo_frequency, known.delay
    return 1.0 / omega**2 + 2.0 * known.servo_damping / omega * delay + 0.5 * delay * delay


def half_width(known: Knowledge) -> float:
    """Half of the dead zone, in motor travel [rad]."""
    return 0.5 * known.width


LAG: Mapping[str, FromRig] = {"lead": lag, "lead_square": lag_square}
"""What a law is told that has `ahead` take the lag away."""

LIMITS: Mapping[str, tuple[float, float]] = {
    "velocity_band": (0.0, math.inf),
    "switching_time": (0.0, 10.0),
    "hold": (0.0, 10.0),
    "proportional_gain": (0.0, 1e3),
    "integral_gain": (0.0, 1e4),
    "integral_limit": (0.0, math.inf),
    "lead": (0.0, 10.0),
    "lead_square": (0.0, 10.0),
}
"""`Law.limits` of gains that several laws have."""


@kernel
def ahead(reference: Reference, lead: float, lead_square: float) -> float:
    """What a servo with a known lag must be asked for, so that it is at the reference now [rad].

        position + lead·velocity + lead_square·acceleration

    This is the inverse of the servo, 1 + (2ζ/ω)·s + s²/ω², and of the dead time τ, 1 + τ·s + τ²·s²/2, to second order.

    >>> ahead(Reference(1.0, 2.0, 4.0), 0.5, 0.25)
    3.0
    """
    return reference.position + lead * reference.velocity + lead_square * reference.acceleration


@kernel
def turned(direction: float, velocity: float, band: float, time_constant: float, dt: float) -> float:
    """The direction of motion, −1…1, after one cycle: it goes to the sign of a velocity beyond ± `band`.

    It moves with the time constant [s], and stays where it is while the velocity is inside the band [rad/s] or not a
    number: what a hold leaves behind is the direction from which it was reached.

    >>> turned(0.0, 1.0, 0.1, 0.001, 0.001), turned(0.5, 0.05, 0.1, 0.001, 0.001)
    (0.5, 0.5)
    """
    goal = sel(velocity > band, 1.0, sel(velocity < -band, -1.0, direction))
    return direction + (goal - direction) * dt / (time_constant + dt)


@kernel
def waited(wait: float, change: float, hold: float, dt: float) -> float:
    """Time left until the dead zone counts as crossed [s]: `hold` while the direction changes, then down to zero.

    While it is not zero the feedback stands still. The motor needs the servo's time to cross, and a cable that is not
    monotone moves the joint the wrong way meanwhile (erratum 6); feedback would fight what the inverse is doing.

    >>> waited(0.0, 0.1, 0.2, 0.001), waited(0.25, 0.0, 0.2, 0.125), waited(0.01, 0.0, 0.2, 0.05)
    (0.2, 0.125, 0.0)
    """
    left = sel(wait > 1.5 * dt, wait - dt, 0.0)  # half a cycle of slack: rounding, in float above all, adds no cycle
    return sel((change > 1e-3) + (change < -1e-3) > 0.0, hold, left)


@kernel
def bounded(value: float, low: float, high: float, refused: float) -> float:
    """`value` cut to [low, high]; `refused` where it is not a number.

    >>> bounded(3.0, -1.0, 1.0, 0.5), bounded(float("nan"), -1.0, 1.0, 0.5)
    (1.0, 0.5)
    """
    return sel((value >= low) * (value <= high), value, sel(value > high, high, sel(value < low, low, refused)))


@kernel
def fed_back(
    wait: float, error: float, integral: float, missed: float, rate: float, limit: float, dt: float
) -> tuple[float, float]:
    """Error and its integral after one cycle; both stand still while the dead zone is crossed, see `waited` [rad].

        ∫⁺ = ∫ + rate·e·Ts, not beyond ± limit

    A `missed` (reference − joint) that is not a number counts as the `error` before.

    >>> fed_back(0.0, 0.0, 0.25, 0.5, 2.0, 1.0, 0.5), fed_back(0.1, 0.125, 0.25, 0.5, 2.0, 1.0, 0.5)
    ((0.5, 0.75), (0.125, 0.25))
    """
    error = bounded(sel(wait > 0.0, error, missed), -1e3, 1e3, error)
    summed = integral + sel(wait > 0.0, 0.0, rate * error * dt)
    return error, bounded(summed, -limit, limit, integral)
