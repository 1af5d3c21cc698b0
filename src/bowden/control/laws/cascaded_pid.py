"""Cascaded PID (Wu et al., the paper's [16]): joint position outside, motor inside.

    outer   w = kp·e + ki·∫e dt + kd·(φ̇_d − joint rate),   |w| limited, the integral held while it is
    inner   command = (φa + w)/α̂ + ka·((φ_d + w)/α̂ − motor) + kv·(φ̇_d/α̂ − motor rate)

The outer loop moves the motor's target, the inner one closes a faster loop on the measured motor around the drive's
own: with gains ka and kv a servo of natural frequency ω and damping ζ answers like one of ω·√(1 + ka) and
(2ζω + kv·ω²)/(2ω·√(1 + ka)). Both rates are differences of the encoders through a first-order low-pass with time
constant τ. The reference's velocity and acceleration are fed forward through φa, as cascades in drives do. Nothing in
the law knows of a dead zone.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.law import Law
from bowden.control.law_parts import LAG, LEAD, LEAD_SQUARE, LIMITS, clamp, compensate_lag
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample


class CascadedPidGains(NamedTuple):
    """Gains of both loops."""

    slope: float = 0.938
    """α̂, joint motion per motor motion; negative where the cable runs the other way [rad/rad]."""
    proportional_gain: Annotated[float, Quantity("kp", live=True)] = 0.4
    integral_gain: Annotated[float, Quantity("ki", "1/s", live=True)] = 40.0
    derivative_gain: float = 0.01
    """kd [s]."""
    correction_limit: float = 0.35
    """Largest size of w [rad]."""
    motor_gain: float = 0.5
    """ka, of the inner loop [–]."""
    motor_rate_gain: float = 0.0084
    """kv, of the inner loop [s]."""
    derivative_time: float = 0.02
    """τ, time constant of both derivatives' filters [s]."""
    lead: float = LEAD
    """Lag of servo and delay that is taken away [s]."""
    lead_square: float = LEAD_SQUARE
    """The same to second order [s²]."""


class CascadedPidState(NamedTuple):
    """State of the law from one cycle to the next."""

    integral: Annotated[float, Quantity("ki·∫e dt", "rad")]
    joint: Annotated[float, Quantity("last measured joint angle", "rad")]
    joint_rate: Annotated[float, Quantity("filtered rate of the joint", "rad/s")]
    motor: Annotated[float, Quantity("last measured motor angle", "rad")]
    motor_rate: Annotated[float, Quantity("filtered rate of the motor", "rad/s")]


@kernel
def start(gains: CascadedPidGains, sample: Sample) -> CascadedPidState:
    """Begin at rest."""
    return CascadedPidState(0.0, sample.joint, 0.0, sample.motor, 0.0)


@kernel
def step(
    gains: CascadedPidGains, state: CascadedPidState, sample: Sample, reference: Reference, dt: float
) -> tuple[CascadedPidState, float]:
    """Outer loop, limit, inner loop."""
    follow = dt / (gains.derivative_time + dt)
    joint_rate = state.joint_rate + follow * ((sample.joint - state.joint) / dt - state.joint_rate)
    motor_rate = state.motor_rate + follow * ((sample.motor - state.motor) / dt - state.motor_rate)

    error = reference.position - sample.joint
    limit = gains.correction_limit
    summed = clamp(state.integral + gains.integral_gain * error * dt, -limit, limit, state.integral)
    demanded = gains.proportional_gain * error + summed + gains.derivative_gain * (reference.velocity - joint_rate)
    correction = clamp(demanded, -limit, limit, 0.0)
    saturated = (demanded - correction) * error > 0.0  # and the error would drive it further
    integral = state.integral if saturated else summed

    command = (
        (compensate_lag(reference, gains.lead, gains.lead_square) + correction) / gains.slope
        + gains.motor_gain * ((reference.position + correction) / gains.slope - sample.motor)
        + gains.motor_rate_gain * (reference.velocity / gains.slope - motor_rate)
    )
    return CascadedPidState(integral, sample.joint, joint_rate, sample.motor, motor_rate), command


LAW = Law(
    name="cascaded_pid",
    gains=CascadedPidGains(),
    start_kernel=start,
    step_kernel=step,
    source="Wu et al., cascaded PID for a cable-driven lower-limb exoskeleton; Dinh et al. 2017, Section 1, [16]",
    from_rig={**LAG, "slope": "slope"},
    compensates_lag=True,
    tunable=frozenset(
        {
            "proportional_gain",
            "integral_gain",
            "derivative_gain",
            "correction_limit",
            "motor_gain",
            "motor_rate_gain",
            "derivative_time",
        }
    ),
    limits={
        **LIMITS,
        "derivative_gain": (0.0, 10.0),
        "correction_limit": (0.0, math.inf),
        "motor_gain": (0.0, 1e3),
        "motor_rate_gain": (0.0, 10.0),
        "derivative_time": (0.0, 10.0),
    },
)
