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
from bowden.control.law_parts import LAG, LEAD, LEAD_SQUARE, LIMITS, ahead, bounded, fed_back, turned, waited
from bowden.core.kernel import kernel, sel
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


class BacklashInverseState(NamedTuple):
    """What the law remembers."""

    slope: Annotated[float, Quantity("m̂", "rad/rad")]
    right: Annotated[float, Quantity("p̂_r = m̂·ĉ_r, going up", "rad")]
    left: Annotated[float, Quantity("p̂_l = m̂·ĉ_l, going down", "rad")]
    motor_square: Annotated[float, Quantity("M₁₁, mean of motor² over the pushed motion", "rad²")]
    motor_up: Annotated[float, Quantity("−M₁₂, mean of motor, zero going down", "rad")]
    motor_down: Annotated[float, Quantity("−M₁₃, mean of motor, zero going up", "rad")]
    share_up: Annotated[float, Quantity("M₂₂, share of going up")]
    share_down: Annotated[float, Quantity("M₃₃, share of going down")]
    product: Annotated[float, Quantity("q₁, mean of motor·joint", "rad²")]
    joint_up: Annotated[float, Quantity("−q₂, mean of joint, zero going down", "rad")]
    joint_down: Annotated[float, Quantity("−q₃, mean of joint, zero going up", "rad")]
    slot: Annotated[float, Quantity("the slot that the motor drags, to know where it surely pushes the cable", "rad")]
    direction: Annotated[float, Quantity("d, −1…1, of the desired motor motion")]
    wait: Annotated[float, Quantity("time left until the feedback acts again", "s")]
    error: Annotated[float, Quantity("the error that the feedback sees", "rad")]
    integral: Annotated[float, Quantity("ki·∫e dt", "rad")]


@kernel
def start(gains: BacklashInverseGains, sample: Sample) -> BacklashInverseState:
    """Begin with the assumed slope and no backlash, in the middle of the slot."""
    return BacklashInverseState(
        gains.slope, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, sample.motor, 0.0, 0.0, 0.0, 0.0
    )


@kernel
def step(
    gains: BacklashInverseGains, state: BacklashInverseState, sample: Sample, reference: Reference, dt: float
) -> tuple[BacklashInverseState, float]:
    """Learn from the sample, then invert at the reference."""
    top = LARGEST_ANGLE
    believed = (sample.motor >= -top) * (sample.motor <= top) * (sample.joint >= -top) * (sample.joint <= top)
    motor, joint = sel(believed, sample.motor, state.slot), sel(believed, sample.joint, 0.0)
    half = 0.5 * gains.contact_travel
    slot = bounded(state.slot, motor - half, motor + half, motor)
    up, down = sel(motor - slot > 0.98 * half, 1.0, 0.0), sel(motor - slot < -0.98 * half, 1.0, 0.0)

    part = (up + down) * dt / (gains.forgetting_time + dt)
    motor_square = state.motor_square + part * (motor * motor - state.motor_square)
    motor_up = state.motor_up + part * (up * motor - state.motor_up)
    motor_down = state.motor_down + part * (down * motor - state.motor_down)
    share_up = state.share_up + part * (up - state.share_up)
    share_down = state.share_down + part * (down - state.share_down)
    product = state.product + part * (motor * joint - state.product)
    joint_up = state.joint_up + part * (up * joint - state.joint_up)
    joint_down = state.joint_down + part * (down * joint - state.joint_down)

    on_slope = product - motor_square * state.slope + motor_up * state.right + motor_down * state.left
    on_right = motor_up * state.slope - share_up * state.right - joint_up
    on_left = motor_down * state.slope - share_down * state.left - joint_down
    rate, most = (up + down) * gains.adaptation_gain * dt, gains.largest_crossing
    slope = state.slope + rate * on_slope / sel(motor_square > 1e-6, motor_square, 1e-6)
    slope = bounded(slope, gains.lowest_slope, gains.highest_slope, state.slope)
    right = bounded(state.right + rate * on_right / sel(share_up > 1e-6, share_up, 1e-6), -most, most, state.right)
    left = bounded(state.left + rate * on_left / sel(share_down > 1e-6, share_down, 1e-6), -most, most, state.left)

    velocity = (reference.velocity + gains.lead * reference.acceleration) / gains.slope
    direction = turned(state.direction, velocity, gains.velocity_band, gains.switching_time, dt)
    wait = waited(state.wait, direction - state.direction, gains.hold, dt)
    missed = reference.position - sample.joint
    error, integral = fed_back(wait, state.error, state.integral, missed, gains.integral_gain, gains.integral_limit, dt)
    upward = 0.5 * (1.0 + direction)
    inverse = (ahead(reference, gains.lead, gains.lead_square) + upward * right + (1.0 - upward) * left) / slope
    command = inverse + (gains.proportional_gain * error + integral) / gains.slope
    after = BacklashInverseState(
        slope,
        right,
        left,
        motor_square,
        motor_up,
        motor_down,
        share_up,
        share_down,
        product,
        joint_up,
        joint_down,
        slot,
        direction,
        wait,
        error,
        integral,
    )
    return after, command


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
