"""The adaptive backlash inverse (Tao & Kokotović 1993).

Backlash with slope m and crossings c_r, c_l is joint = m·(motor − c_r) while the motor drives it upwards and
m·(motor − c_l) downwards. With χ = (1 + d)/2, d = −1…1 the direction of motion, its inverse is

    command = (φa + χ·p̂_r + (1 − χ)·p̂_l)/m̂ + (kp·e + ki·∫e dt)/m₀,   p_r = m·c_r,   p_l = m·c_l

In θ = (m, p_r, p_l) backlash is linear: joint = φᵀθ, φ = (motor, −1, 0) going up and (motor, 0, −1) going down. Both
ends are measured here, so θ̂ descends the mean squared error of prediction, each estimate at its own scale, projected
on a box:

    M = mean of φφᵀ,   q = mean of φ·joint,   with a forgetting time Tf of pushed motion
    θ̂⁺ = box(θ̂ + γ·Ts·(q − M·θ̂)ᵢ/Mᵢᵢ)

The gradient of the momentary error only turns the error of θ̂ about while φ turns slowly; the mean over the last
motions (the integral cost of Ioannou & Sun 1996) converges. It learns only where the cable is surely pushed: the motor
drags a slot as wide as the largest dead zone that is expected (`contact_travel`), and is within a hundredth of that
width of the slot's end. A shorter motion teaches nothing.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.law import Law
from bowden.control.law_parts import (
    LAG,
    LEAD,
    LEAD_SQUARE,
    LIMITS,
    clamp,
    compensate_lag,
    integrate_error,
    update_direction,
    update_hold,
)
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample

LARGEST_ANGLE = 100.0
"""A sample beyond this is not learnt from [rad]."""


class BacklashInverseGains(NamedTuple):
    """Start and box of the estimates, adaptation, and feedback."""

    slope: float = 1.0
    """m₀, slope at the start; the feedback is divided by it for good [rad/rad]."""
    lowest_slope: float = 0.4
    """Smallest m̂, of the sign of m₀ [rad/rad]."""
    highest_slope: float = 1.6
    """Largest m̂, of the sign of m₀ [rad/rad]."""
    largest_crossing: float = 0.5
    """Largest size of m̂·ĉ [rad]."""
    adaptation_gain: float = 100.0
    """γ [1/s]."""
    forgetting_time: float = 4.0
    """Tf [s]."""
    contact_travel: float = 0.3
    """Motor travel after a reversal from which on the cable is surely pushed [rad]."""
    velocity_band: float = 0.001
    """Reference speed below which the direction is kept [rad/s]."""
    switching_time: float = 0.01
    """Time constant of the inverse's change of side [s]."""
    proportional_gain: Annotated[float, Quantity("kp", live=True)] = 1.3
    integral_gain: Annotated[float, Quantity("ki", "1/s", live=True)] = 30.0
    integral_limit: float = 0.35
    """Largest size of ki·∫e dt [rad]."""
    hold: float = 0.05
    """How long the feedback is held after a change of side [s]."""
    lead: float = LEAD
    """Lag of servo and delay that is taken away [s]."""
    lead_square: float = LEAD_SQUARE
    """The same to second order [s²]."""


class Estimates(NamedTuple):
    """θ̂."""

    slope: Annotated[float, Quantity("m̂", "rad/rad")]
    right: Annotated[float, Quantity("p̂_r = m̂·ĉ_r, going up", "rad")]
    left: Annotated[float, Quantity("p̂_l = m̂·ĉ_l, going down", "rad")]


class Means(NamedTuple):
    """M and q, over the pushed motion."""

    motor_square: Annotated[float, Quantity("M₁₁, mean of motor²", "rad²")]
    motor_up: Annotated[float, Quantity("−M₁₂, mean of motor, zero going down", "rad")]
    motor_down: Annotated[float, Quantity("−M₁₃, mean of motor, zero going up", "rad")]
    share_up: Annotated[float, Quantity("M₂₂, share of going up")]
    share_down: Annotated[float, Quantity("M₃₃, share of going down")]
    product: Annotated[float, Quantity("q₁, mean of motor·joint", "rad²")]
    joint_up: Annotated[float, Quantity("−q₂, mean of joint, zero going down", "rad")]
    joint_down: Annotated[float, Quantity("−q₃, mean of joint, zero going up", "rad")]


class BacklashInverseState(NamedTuple):
    """State of the law from one cycle to the next."""

    estimates: Estimates
    means: Means
    slot: Annotated[float, Quantity("the slot that the motor drags, to know where it surely pushes the cable", "rad")]
    direction: Annotated[float, Quantity("d, −1…1, of the desired motor motion")]
    wait: Annotated[float, Quantity("time left until the feedback acts again", "s")]
    error: Annotated[float, Quantity("the error that the feedback sees", "rad")]
    integral: Annotated[float, Quantity("ki·∫e dt", "rad")]


@kernel
def start(gains: BacklashInverseGains, sample: Sample) -> BacklashInverseState:
    """Begin with the assumed slope and no backlash, in the middle of the slot."""
    means = Means(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return BacklashInverseState(Estimates(gains.slope, 0.0, 0.0), means, sample.motor, 0.0, 0.0, 0.0, 0.0)


@kernel
def average(before: Means, motor: float, joint: float, up: bool, share: float) -> Means:
    """The means with one sample more, of a motor that pushes the cable `up` or down."""
    return Means(
        before.motor_square + share * (motor * motor - before.motor_square),
        before.motor_up + share * ((motor if up else 0.0) - before.motor_up),
        before.motor_down + share * ((0.0 if up else motor) - before.motor_down),
        before.share_up + share * ((1.0 if up else 0.0) - before.share_up),
        before.share_down + share * ((0.0 if up else 1.0) - before.share_down),
        before.product + share * (motor * joint - before.product),
        before.joint_up + share * ((joint if up else 0.0) - before.joint_up),
        before.joint_down + share * ((0.0 if up else joint) - before.joint_down),
    )


@kernel
def descend(before: Estimates, means: Means, rate: float) -> Estimates:
    """One step down the mean squared error of prediction, each estimate at its own scale."""
    slope, right, left = before.slope, before.right, before.left
    on_slope = means.product - means.motor_square * slope + means.motor_up * right + means.motor_down * left
    on_right = means.motor_up * slope - means.share_up * right - means.joint_up
    on_left = means.motor_down * slope - means.share_down * left - means.joint_down
    return Estimates(
        slope + rate * on_slope / max(1e-6, means.motor_square),
        right + rate * on_right / max(1e-6, means.share_up),
        left + rate * on_left / max(1e-6, means.share_down),
    )


@kernel
def step(
    gains: BacklashInverseGains, state: BacklashInverseState, sample: Sample, reference: Reference, dt: float
) -> tuple[BacklashInverseState, float]:
    """Learn from the sample, then invert at the reference."""
    motor, joint = state.slot, 0.0
    if abs(sample.motor) <= LARGEST_ANGLE and abs(sample.joint) <= LARGEST_ANGLE:
        motor, joint = sample.motor, sample.joint
    half, most = 0.5 * gains.contact_travel, gains.largest_crossing
    slot = clamp(state.slot, motor - half, motor + half, motor)
    up, down = motor - slot > 0.98 * half, motor - slot < -0.98 * half

    means, found = state.means, state.estimates
    if up or down:
        means = average(means, motor, joint, up, dt / (gains.forgetting_time + dt))
        found = descend(found, means, gains.adaptation_gain * dt)
    slope = clamp(found.slope, gains.lowest_slope, gains.highest_slope, state.estimates.slope)
    right = clamp(found.right, -most, most, state.estimates.right)
    left = clamp(found.left, -most, most, state.estimates.left)

    velocity = (reference.velocity + gains.lead * reference.acceleration) / gains.slope
    direction = update_direction(state.direction, velocity, gains.velocity_band, gains.switching_time, dt)
    wait = update_hold(state.wait, direction - state.direction, gains.hold, dt)
    missed = reference.position - sample.joint
    error, integral = integrate_error(
        wait, state.error, state.integral, missed, gains.integral_gain, gains.integral_limit, dt
    )
    upward = 0.5 * (1.0 + direction)
    inverse = (
        compensate_lag(reference, gains.lead, gains.lead_square) + upward * right + (1.0 - upward) * left
    ) / slope
    command = inverse + (gains.proportional_gain * error + integral) / gains.slope
    return BacklashInverseState(Estimates(slope, right, left), means, slot, direction, wait, error, integral), command


def settling(gains: BacklashInverseGains) -> float:
    """Ten forgetting times [s]: they count while the cable is pushed, half of the time at least."""
    return 10.0 * gains.forgetting_time


LAW = Law(
    name="backlash_inverse",
    gains=BacklashInverseGains(),
    start_kernel=start,
    step_kernel=step,
    source="Tao, Kokotović, IEEE Transactions on Automatic Control 38(10), 1993, and their book of 1996",
    from_rig=LAG,
    compensates_lag=True,
    settling=settling,
    tunable=frozenset(
        {
            "adaptation_gain",
            "forgetting_time",
            "contact_travel",
            "velocity_band",
            "switching_time",
            "proportional_gain",
            "integral_gain",
            "integral_limit",
            "hold",
        }
    ),
    limits={
        **LIMITS,
        "largest_crossing": (0.0, math.inf),
        "adaptation_gain": (0.0, 500.0),
        "forgetting_time": (0.0, 1e6),
        "contact_travel": (0.0, math.inf),
    },
)
