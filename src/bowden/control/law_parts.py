"""Parts that several laws share: inverse of the servo, filters, direction of motion, feedback, bandwidths, limits."""

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, NamedTuple

from bowden.control.knowledge import Knowledge
from bowden.control.law import FromRig
from bowden.core.kernel import exp, kernel, tanh
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference
from bowden.core.units import RADIANS

LEAD = 0.0388
"""Lag of the default bench, 2ζ/ω + (d + ½)·Ts, which `compensate_lag` takes away [s]."""

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


SERVO_SHARE = 190.0 / 53.58
"""`quiet_bandwidth` over the servo's ω, at most: the default bench's, where chatter stops it
(docs/background/laws.md) [–]."""

COMMAND_NOISE = 0.1 * RADIANS
"""Standard deviation of the command that the encoders alone may make, at most [rad]."""


def quiet_bandwidth(known: Knowledge, delay_share: float, noises: Iterable[float]) -> float:
    """Bandwidth of an observer whose estimate goes through the servo's inverse [rad/s].

    It is the least of 3.55·ω, delay_share/τ, and what lets 0.1° of noise through. The noise σ comes through as about
    σ·(q/ω)²·√(q·Ts) in the command.

    Args:
        known: of the rig; NaN is returned where it has no ω or no τ.
        delay_share: of the bandwidth times the delay, at most.
        noises: standard deviations [rad], NaN for what is not known.
    """
    omega, delay = known.servo_frequency, known.delay
    if math.isnan(omega) or math.isnan(delay):
        return math.nan
    bound = min(SERVO_SHARE * omega, delay_share / delay if delay > 0.0 else math.inf)
    noise = math.hypot(*(part for part in noises if not math.isnan(part)))
    if noise > 0.0 and not math.isnan(known.sample_time):
        bound = min(bound, (COMMAND_NOISE / noise * omega**2 / math.sqrt(known.sample_time)) ** 0.4)
    return bound


def encoder_noises(known: Knowledge) -> list[float]:
    """Standard deviations of what both encoders add to motor − joint/α̂, those that are known [rad]."""
    steps = (known.joint_step / math.sqrt(12.0), known.motor_step / math.sqrt(12.0))
    return [part for part in (known.joint_noise, known.motor_noise, *steps) if not math.isnan(part)]


CONTACT_DELAY_SHARE = 1.5
"""`contact_bandwidth` times the delay τ, at most: its loop is Q·(1 − α/α̂), small whatever the delay is [–]."""

CROSSING = 0.05
"""`crossing_rate` over ω: a dead zone is crossed in its width over this share of the servo's frequency [rad]."""


def contact_bandwidth(known: Knowledge) -> float:
    """q of a filter of motor − joint/α̂, no faster than servo, delay and the noise of both encoders allow [rad/s]."""
    return quiet_bandwidth(known, CONTACT_DELAY_SHARE, encoder_noises(known))


def crossing_rate(known: Knowledge) -> float:
    """How fast what is observed may change, a twentieth of ω [rad/s]."""
    return CROSSING * known.servo_frequency


LAG: Mapping[str, FromRig] = {"lead": lag, "lead_square": lag_square}
"""Gains from the rig of a law that calls `compensate_lag`."""

SERVO: Mapping[str, FromRig] = {
    **LAG,
    "slope": "slope",
    "natural_frequency": "servo_frequency",
    "damping": "servo_damping",
}
"""Gains from the rig of a law that inverts the servo: ω and ζ besides."""

CONTACT: Mapping[str, FromRig] = {**SERVO, "bandwidth": contact_bandwidth}
"""Gains from the rig of a law that observes motor − joint/α̂ through a filter of that bandwidth."""

LIMITS: Mapping[str, tuple[float, float]] = {
    "velocity_band": (0.0, math.inf),
    "switching_time": (0.0, 10.0),
    "hold": (0.0, 10.0),
    "proportional_gain": (0.0, 1e3),
    "integral_gain": (0.0, 1e4),
    "integral_limit": (0.0, math.inf),
    "lead": (0.0, 10.0),
    "lead_square": (0.0, 10.0),
    "natural_frequency": (1e-3, 1e4),
    "damping": (0.0, 100.0),
    "bandwidth": (1e-3, 1e5),
}
"""`Law.limits` of gains that several laws have."""


@kernel
def compensate_lag(reference: Reference, lead: float, lead_square: float) -> float:
    """Command to a servo with a known lag by which it is at the reference now [rad].

        position + lead·velocity + lead_square·acceleration

    This is the inverse of the servo, 1 + (2ζ/ω)·s + s²/ω², and of the dead time τ, 1 + τ·s + τ²·s²/2, to second order.

    >>> compensate_lag(Reference(1.0, 2.0, 4.0), 0.5, 0.25)
    3.0
    """
    return reference.position + lead * reference.velocity + lead_square * reference.acceleration


@kernel
def update_direction(direction: float, velocity: float, band: float, time_constant: float, dt: float) -> float:
    """The direction of motion, −1…1, after one cycle: it goes to the sign of a velocity beyond ± `band`.

    It moves with the time constant [s], and stays where it is while the velocity is inside the band [rad/s] or not a
    number: what a hold leaves behind is the direction from which it was reached.

    >>> update_direction(0.0, 1.0, 0.1, 0.001, 0.001), update_direction(0.5, 0.05, 0.1, 0.001, 0.001)
    (0.5, 0.5)
    """
    if math.isnan(velocity) or abs(velocity) <= band:
        return direction
    goal = math.copysign(1.0, velocity)
    return direction + (goal - direction) * dt / (time_constant + dt)


@kernel
def update_hold(wait: float, change: float, hold: float, dt: float) -> float:
    """Time left until the dead zone counts as crossed [s]: `hold` while the direction changes, then down to zero.

    While it is not zero the feedback stands still. The motor needs the servo's time to cross, and a cable that is not
    monotone moves the joint the wrong way meanwhile (reading 6); feedback would fight what the inverse is doing.

    >>> update_hold(0.0, 0.1, 0.2, 0.001), update_hold(0.25, 0.0, 0.2, 0.125), update_hold(0.01, 0.0, 0.2, 0.05)
    (0.2, 0.125, 0.0)
    """
    if abs(change) > 1e-3:
        return hold
    return wait - dt if wait > 1.5 * dt else 0.0  # half a cycle of slack: rounding, in float above all, adds no cycle


@kernel
def clamp(value: float, low: float, high: float, refused: float) -> float:
    """`value` cut to [low, high]; `refused` where it is not a number.

    >>> clamp(3.0, -1.0, 1.0, 0.5), clamp(float("nan"), -1.0, 1.0, 0.5)
    (1.0, 0.5)
    """
    if math.isnan(value):
        return refused
    return max(low, min(high, value))


@kernel
def integrate_error(
    wait: float, error: float, integral: float, missed: float, rate: float, limit: float, dt: float
) -> tuple[float, float]:
    """Error and its integral after one cycle; both stand still while the dead zone is crossed, see `update_hold` [rad].

        ∫⁺ = ∫ + rate·e·Ts, not beyond ± limit

    A `missed` (reference − joint) that is not a number counts as the `error` before.

    >>> integrate_error(0.0, 0.0, 0.25, 0.5, 2.0, 1.0, 0.5), integrate_error(0.1, 0.125, 0.25, 0.5, 2.0, 1.0, 0.5)
    ((0.5, 0.75), (0.125, 0.25))
    """
    summed = integral
    if wait <= 0.0:
        error = clamp(missed, -1e3, 1e3, error)
        summed = integral + rate * error * dt
    return error, clamp(summed, -limit, limit, integral)


class Filtered(NamedTuple):
    """A number behind a critically damped low-pass of second order, with its derivatives."""

    value: Annotated[float, Quantity("the number", "rad")]
    rate: Annotated[float, Quantity("its rate", "rad/s")]
    acceleration: Annotated[float, Quantity("the rate of that", "rad/s²")]


@kernel
def lowpass(before: float, goal: float, bandwidth: float, dt: float) -> float:
    """One cycle of the low-pass q/(s + q) towards a goal that is held, solved exactly.

    >>> round(lowpass(1.0, 0.0, 10.0, 0.1), 4)
    0.3679
    """
    return goal + (before - goal) * exp(-bandwidth * dt)


@kernel
def lowpass_second_order(before: Filtered, goal: float, bandwidth: float, dt: float) -> Filtered:
    """One cycle of q²/(s + q)² towards a goal that is held, solved exactly.

    >>> last = lowpass_second_order(Filtered(0.0, 0.0, 0.0), 1.0, 10.0, 1.0)
    >>> round(last.value, 4), round(lowpass_second_order(last, 1.0, 10.0, 1.0).value, 7)
    (0.9995, 1.0)
    """
    left = exp(-bandwidth * dt)
    off = before.value - goal
    push = (before.rate + bandwidth * off) * dt
    value = goal + (off + push) * left
    rate = (before.rate - bandwidth * push) * left
    return Filtered(value, rate, bandwidth * bandwidth * (goal - value) - 2.0 * bandwidth * rate)


@kernel
def lowpass_rate_limited(before: Filtered, goal: float, bandwidth: float, rate_limit: float, dt: float) -> Filtered:
    """The same towards a goal that is no further away than Φ = 2·rate_limit/q, smoothly.

    A ramp of the speed v is followed at the distance 2·v/q, so that the rate goes to `rate_limit` at most.

    >>> slow = lowpass_rate_limited(Filtered(0.0, 0.0, 0.0), 1.0, 10.0, 0.5, 1e-3)
    >>> for _ in range(1000):
    ...     slow = lowpass_rate_limited(slow, 1.0, 10.0, 0.5, 1e-3)
    >>> round(slow.value, 1), round(slow.rate, 2)
    (0.5, 0.5)
    """
    layer = 2.0 * rate_limit / bandwidth
    near = before.value + layer * tanh((goal - before.value) / layer)
    return lowpass_second_order(before, near, bandwidth, dt)


@kernel
def invert_servo(number: Filtered, natural_frequency: float, damping: float) -> float:
    """Command by which the servo is at the number, 1 + 2ζ/ω·d/dt + 1/ω²·d²/dt² [rad]."""
    lead, lead_square = 2.0 * damping / natural_frequency, 1.0 / (natural_frequency * natural_frequency)
    return number.value + lead * number.rate + lead_square * number.acceleration
