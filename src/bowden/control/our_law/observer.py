"""A disturbance observer through servo and delay, whose correction is smooth enough for the servo's inverse.

All that moves the joint beside the plan is one disturbance d, counted at the motor. With s = 1/a₀, the error
e = joint − reference and the correction F that is on its way:

    d̂ = e·s − F(t − τ), behind the joint's lag             what the joint would do without the correction
    x' = 1.5·q·(d̂ + I − x)                                 the innovation, without the fastest noise
    I' = −κ·x·x²/(x² + σ²),  |I'| ≤ v                       the correction asked for
    F'' = q²·(I − F) − 2q·F'                                the correction, twice differentiable

In d̂ the law's own correction cancels, so that where servo, delay, slope and lag are as told nothing is fed back: the
loop's gain is the error of what was told. Hence κ can be wide, and is bounded by what is not known of servo and delay.
v bounds what a wrong model can do: an unstable loop swings with a bounded amplitude and does not run away.

Backward Euler and exact exponentials: stable at every sample time. Portable subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.control.our_law.gains import BowdenGains
from bowden.core.kernel import exp, kernel
from bowden.core.quantity import Quantity

DELAYS = 1.5
"""Delays that weigh as much as 1/ω in κ: the delay itself and half of it for the sample before [–]."""

QUICKEST = 12.0
"""q over the servo's ω, at most: beyond it the lag of F is no longer what counts [–]."""

HEARD = 0.0035
"""What the joint's noise alone may make of the command's acceleration term, standard deviation [rad]."""

THIRD = 1.5
"""Pole of the innovation's filter over q: with it white noise reaches the command with a slope of three [–]."""

STOPPED = 0.05
"""Way within which servo and delay must be able to stop the correction [rad]."""

LEAST_SPEED = 1.0
"""Speed that the correction may always have [rad/s]."""

CARRIED = 2.0
"""Share of the reference's own speed that is added to it: an error of the slope asks for that [–]."""


class Observer(NamedTuple):
    """What the observer remembers."""

    asked: Annotated[float, Quantity("I, the correction asked for", "rad")]
    innovation: Annotated[float, Quantity("x, what of the disturbance is not yet in it", "rad")]
    sent: Annotated[float, Quantity("F, the correction as sent", "rad")]
    rate: Annotated[float, Quantity("its rate", "rad/s")]
    arrived: Annotated[float, Quantity("the correction that has arrived at the joint", "rad")]


class Pace(NamedTuple):
    """Rates that follow from what is told."""

    kappa: float
    """κ of a loop that does not ring [1/s]."""
    quick: float
    """q [rad/s]."""
    stopping: float
    """v where the reference rests [rad/s]."""


@kernel
def pace_of(gains: BowdenGains, inverse: float, dt: float) -> Pace:
    """κ = c/(1/ω + 1.5·τ); q from the noise; v = way/(2ζ/ω + τ) and a little.

    The noise comes through the observer as σ·√(1 − e^(−κ·Ts)) and through the servo's inverse times (q/ω)².
    """
    omega, delay = gains.servo_frequency, gains.delay
    kappa = gains.bandwidth / (1.0 / omega + DELAYS * delay)
    through = gains.noise * inverse * np.sqrt(1.0 - exp(-kappa * dt)) + 1e-9
    quick = omega * np.fmin(QUICKEST, np.sqrt(HEARD / through))
    return Pace(kappa, quick, STOPPED / (2.0 * gains.servo_damping / omega + delay) + LEAST_SPEED)


@kernel
def at_rest(offset: float) -> Observer:
    """Where the motor stands, nothing is on its way."""
    return Observer(offset, 0.0, offset, 0.0, offset)


@kernel
def arrives(before: Observer, delay: float, lag: float, dt: float) -> float:
    """The correction that has arrived at the joint: F a delay ago, behind its lag [rad]."""
    late = before.sent - delay * before.rate
    return before.arrived + (late - before.arrived) * dt / (lag + dt)


@kernel
def corrected(
    before: Observer,
    disturbance: float,
    arrived: float,
    kappa: float,
    pace: Pace,
    least: float,
    speed: float,
    dt: float,
) -> tuple[Observer, float]:
    """One cycle; the second number is F'' [rad/s²].

    Args:
        before: one cycle ago.
        disturbance: d̂; −I where nothing was seen [rad].
        arrived: the correction at the joint [rad].
        kappa: κ now [1/s].
        pace: what follows from what is told.
        least: innovation that is no news: the noise, or more where the reference rests [rad].
        speed: of the reference, at the motor [rad/s].
        dt: cycle [s].
    """
    share = THIRD * pace.quick * dt
    x = before.innovation + (disturbance + before.asked - before.innovation) * share / (1.0 + share)
    most = dt * (pace.stopping + CARRIED * np.abs(speed))
    step = (1.0 - exp(-kappa * dt)) * x * x * x / (x * x + least * least + 1e-30)
    asked = before.asked - np.fmax(-most, np.fmin(most, step))
    slower = 1.0 + pace.quick * dt
    pull = pace.quick * pace.quick * (asked - before.sent - dt * before.rate) - 2.0 * pace.quick * before.rate
    acceleration = pull / (slower * slower)
    rate = before.rate + dt * acceleration
    return Observer(asked, x, before.sent + dt * rate, rate, arrived), acceleration


@kernel
def shifted(before: Observer, asked: float, by: float) -> Observer:
    """The same where something else was asked for, and the plan takes over −`by` of the correction [rad]."""
    return Observer(asked + by, before.innovation, before.sent + by, before.rate, before.arrived + by)
