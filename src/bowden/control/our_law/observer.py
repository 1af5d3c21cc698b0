"""A disturbance observer through servo and delay, whose correction is smooth enough for the servo's inverse.

All that moves the joint beside the plan is one disturbance d, in motor angle. With s = 1/a₀, a₀ the slope as given, the
error e = joint − reference, the delay τ, and F, which is sent to the servo beside the plan:

    d̂ = e·s − y, y = F − τ·F' behind the joint's lag       what the joint would do without the correction
    x' = 2·q·(d̂ + I − x)                                   the innovation: what of d̂ is not yet in −I
    I' = −κ·x·x²/(x² + σ₀²),  |I'| ≤ V = v + s·|φ̇|           the correction asked for; φ̇ the reference's speed
    F'' = q²·(I − F) − 1.7q·F'                              the correction, twice differentiable

y is the correction at the joint, through a load: T²·ÿ + (lag + 2·0.25·T)·ẏ + y = F − τ·F' + u, u the motor's shortfall
(`drive`); F − τ·F' is F a delay ago. Its lag is given, with 0.35/ω for what nobody knows of it; the time T of a load
that swings is learned (`oscillation`). In d̂ the law's own correction cancels, so that where servo, delay, slope and
load are as modelled and the cable is engaged nothing is fed back: the loop's gain is the error of the model. Hence κ
can be wide, and is bounded by what is not known of servo and delay. v bounds what a wrong model can do: an unstable
loop swings with a bounded amplitude and does not run away. A step disturbance (`oscillation`) is no such swing: V is
2·v + s·|φ̇| then, as far as the widest dead zone, and where the joint is not known to be late: one that is swings if it
is hit too hard. κ, q and v follow from what is given (`derived_rates`); σ₀ is the noise of d̂, so that innovations
within it hardly count.

Backward Euler and exact exponentials: stable at every sample time.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.our_law.gains import BowdenGains
from bowden.core.kernel import exp, kernel, sqrt
from bowden.core.quantity import Quantity

DELAYS = 1.5
"""Delays that weigh as much as 1/ω in κ: the delay itself and half of it for the sample before [–]."""

QUICKEST = 12.0
"""Largest q over the servo's ω: beyond it the lag of F is no longer what counts [–]."""

COMMAND_NOISE = 0.0035
"""Bound on F''/ω² in the command from the joint's noise alone, standard deviation [rad]."""

THIRD_POLE = 2.0
"""Pole of the innovation's filter over q, beside F's two: less chatter at the same error [–]."""

FILTER_DAMPING = 0.85
"""Of F's two poles: with the third at 2q they delay F by 2.2/q. Critically damped, and with the third at 1.5q, it would
be 2.7/q, and white noise of the joint a fifth less in F''. Below 0.8 the loop bears much less of a wrong slope [–]."""

FILTER_DELAY = 2.0 * FILTER_DAMPING + 1.0 / THIRD_POLE
"""Of all three poles, times q [–]."""

STOPPED = 0.05
"""Way within which servo and delay must be able to stop the correction [rad]."""

LEAST_SPEED = 1.0
"""Speed that the correction may always have [rad/s]."""

STEP_SPEED = 2.0
"""Factor on v for a step disturbance: what is hardly a swing of the loop's own may be overshot by twice the way [–]."""

SLOW_PART = 0.15
"""Time constant of what of a disturbance is not fast [s]."""

LOAD_DAMPING = 0.25
"""Damping of a load that swings, as the observer has it: arms have 0.1 to 0.5 [–]."""


class Observer(NamedTuple):
    """State of the observer."""

    requested: Annotated[float, Quantity("I, the correction asked for", "rad")]
    innovation: Annotated[float, Quantity("x, what of the disturbance is not yet corrected", "rad")]
    sent: Annotated[float, Quantity("F, the correction as sent", "rad")]
    sent_rate: Annotated[float, Quantity("its rate", "rad/s")]
    at_joint: Annotated[float, Quantity("the correction that has arrived at the joint", "rad")]
    at_joint_rate: Annotated[float, Quantity("its rate", "rad/s")]
    slow_disturbance: Annotated[float, Quantity("the disturbance's slow part", "rad")]


class DerivedRates(NamedTuple):
    """DerivedRates that follow from what is given."""

    kappa: float
    """κ, whole: what `oscillation` leaves of it is used [1/s]."""
    quick: float
    """q, of the filters [rad/s]."""
    stopping: float
    """v, largest speed of the correction where the reference rests [rad/s]."""


@kernel
def derived_rates(gains: BowdenGains, inverse: float, dt: float) -> DerivedRates:
    """κ = c/(1/ω + 1.5·τ);  q = ω·min(12, √(0.0035 rad/(σ·s·√(1 − e^(−κ·Ts)))));  v = 0.05 rad/(2ζ/ω + τ) + 1 rad/s.

    The joint's noise σ comes through the observer as σ·s·√(1 − e^(−κ·Ts)), and through the servo's inverse by (q/ω)².
    """
    omega, delay = gains.servo_frequency, gains.delay
    kappa = gains.bandwidth / (1.0 / omega + DELAYS * delay)
    through = gains.noise * inverse * sqrt(1.0 - exp(-kappa * dt)) + 1e-9
    quick = omega * min(QUICKEST, sqrt(COMMAND_NOISE / through))
    return DerivedRates(kappa, quick, STOPPED / (2.0 * gains.servo_damping / omega + delay) + LEAST_SPEED)


@kernel
def observer_at_rest(offset: float) -> Observer:
    """Where the motor stands, nothing is on its way."""
    return Observer(offset, 0.0, offset, 0.0, offset, 0.0, 0.0)


class PropagatedCorrection(NamedTuple):
    """The correction that has come through delay and load."""

    position: float
    """y [rad]."""
    rate: float
    """[rad/s]"""


@kernel
def largest_speed(stopping: float, speed: float, step_disturbance: bool) -> float:
    """V, the largest speed of the correction [rad/s].

    Args:
        stopping: v [rad/s].
        speed: of the reference, at the motor; one that is no number counts as 0, or it would stay in I [rad/s].
        step_disturbance: one may be followed faster.
    """
    moving = 0.0 if math.isnan(speed) else abs(speed)
    return (STEP_SPEED * stopping if step_disturbance else stopping) + moving


@kernel
def propagate_correction(
    before: Observer, shortfall: float, delay: float, lag: float, time: float, most: float, dt: float
) -> PropagatedCorrection:
    """The correction at the joint: F a delay ago, and the motor's shortfall, through the load.

    T²·ÿ + (lag + 2ζT)·ẏ + y = F(t − τ) + shortfall, ζ = 0.25, in one step of backward Euler; first-order where
    T = `time` is 0. It is no faster than the correction may be, `most`, so that a motor's reading that jumps is hardly
    counted.
    """
    late = before.sent - delay * before.sent_rate + shortfall
    inertia, damping = time * time, lag + 2.0 * LOAD_DAMPING * time
    rate = (inertia * before.at_joint_rate + dt * (late - before.at_joint)) / (inertia + dt * (damping + dt))
    rate = max(-most, min(most, rate))
    return PropagatedCorrection(before.at_joint + dt * rate, rate)


@kernel
def correct(
    before: Observer,
    disturbance: float,
    slow: float,
    arrived: PropagatedCorrection,
    kappa: float,
    rates: DerivedRates,
    least: float,
    most: float,
    dt: float,
) -> tuple[Observer, float]:
    """One cycle; the second number is F'' [rad/s²].

    Args:
        before: one cycle ago.
        disturbance: d̂; −I where nothing was measured [rad].
        slow: its slow part [rad].
        arrived: the correction at the joint.
        kappa: κ now [1/s].
        rates: what follows from what is given.
        least: innovation that is no news: the noise, or more where the reference rests [rad].
        most: V, largest speed of I [rad/s].
        dt: cycle [s].
    """
    share = THIRD_POLE * rates.quick * dt
    x = before.innovation + (disturbance + before.requested - before.innovation) * (share / (1.0 + share))
    most = dt * most
    step = (1.0 - exp(-kappa * dt)) * x * x * x / (x * x + least * least + 1e-30)
    requested = before.requested - max(-most, min(most, step))
    stiff, damping = rates.quick * rates.quick, 2.0 * FILTER_DAMPING * rates.quick
    pull = stiff * (requested - before.sent - dt * before.sent_rate) - damping * before.sent_rate
    acceleration = pull / (1.0 + dt * (damping + dt * stiff))
    rate = before.sent_rate + dt * acceleration
    return Observer(requested, x, before.sent + dt * rate, rate, arrived.position, arrived.rate, slow), acceleration


@kernel
def apply_shift(before: Observer, requested: float, shift: float) -> Observer:
    """The observer with another I, `requested`, and `shift` more correction at once, which the plan takes away."""
    return Observer(
        requested + shift,
        before.innovation,
        before.sent + shift,
        before.sent_rate,
        before.at_joint + shift,
        before.at_joint_rate,
        before.slow_disturbance - shift,
    )
