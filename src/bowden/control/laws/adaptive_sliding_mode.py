"""Sliding mode with an adaptive gain (Plestan, Shtessel, Brégeault and Poznyak 2010), as an integral before the servo.

Its sliding variable is how far the integral d̂ is from what motor and joint show at one instant,

    σ = motor − joint/α̂ − d̂

which is the error that will be left when the motor has done what it is asked for: no servo and no delay stand in it, so
that the mode is of relative degree one and what switches does not wait for the drive. With the boundary layer Φ

    dd̂/dt → K·tanh(σ/Φ),     Φ = 2·K/q
    dK/dt = γ²·(|σ| − ε),    K_least ≤ K ≤ K_most
    command = φa/α̂ + (1 + 2ζ/ω·d/dt + 1/ω²·d²/dt²)·d̂

σ is behind a low-pass, and d̂ behind a critically damped second order, of the bandwidth q, so that the servo's inverse
has its derivatives and sends no noise through undamped. The layer follows the gain: within it the loop's gain is q/2
whatever K is, which is the gain that servo, delay and noise allow; K only says how fast d̂ may go. K grows while |σ| is
beyond ε, the noise of both encoders, and falls else. Plestan et al. have the factor |σ| on sgn(|σ| − ε); without it K
falls to K_least in finite time.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.knowledge import Knowledge
from bowden.control.law import Law
from bowden.control.law_parts import (
    CONTACT,
    LEAD,
    LEAD_SQUARE,
    LIMITS,
    Filtered,
    clamp,
    compensate_lag,
    contact_bandwidth,
    crossing_rate,
    encoder_noises,
    invert_servo,
    lowpass,
    lowpass_rate_limited,
)
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample


class AdaptiveSlidingModeGains(NamedTuple):
    """The nominal model, the loop's bandwidth, and what the gain may be."""

    slope: float = 0.938
    """α̂, joint motion per motor motion; negative where the cable runs the other way [rad/rad]."""
    natural_frequency: float = 53.58
    """ω of the servo [rad/s]."""
    damping: float = 1.0
    """ζ of the servo [–]."""
    bandwidth: Annotated[float, Quantity("q, twice the gain within the boundary layer", "rad/s", live=True)] = 190.0
    adaptation: float = 95.0
    """γ, with which the gain grows and falls [1/s]."""
    deadband: float = 0.001
    """ε, size of σ beyond which the gain grows [rad]."""
    least_gain: float = 0.536
    """K_least [rad/s]."""
    most_gain: float = 2.679
    """K_most [rad/s]."""
    lead: float = LEAD
    """Lag of servo and delay that is taken away [s]."""
    lead_square: float = LEAD_SQUARE
    """The same to second order [s²]."""


class AdaptiveSlidingModeState(NamedTuple):
    """State of the law from one cycle to the next."""

    observed: Annotated[float, Quantity("motor − joint/α̂ behind the low-pass", "rad")]
    disturbance: Filtered
    """d̂, motor − joint/α̂ as it is cancelled."""
    gain: Annotated[float, Quantity("K", "rad/s")]


@kernel
def start(gains: AdaptiveSlidingModeGains, sample: Sample) -> AdaptiveSlidingModeState:
    """Begin with the motor held where it is."""
    held = Filtered(sample.motor - sample.joint / gains.slope, 0.0, 0.0)
    return AdaptiveSlidingModeState(held.value, held, gains.least_gain)


@kernel
def step(
    gains: AdaptiveSlidingModeGains,
    state: AdaptiveSlidingModeState,
    sample: Sample,
    reference: Reference,
    dt: float,
) -> tuple[AdaptiveSlidingModeState, float]:
    """Adapt the gain, slide, and ask the servo for it."""
    before = state.disturbance
    contact = clamp(sample.motor - sample.joint / gains.slope, -1e3, 1e3, state.observed)
    observed = lowpass(state.observed, contact, gains.bandwidth, dt)
    growth = gains.adaptation * gains.adaptation * (abs(observed - before.value) - gains.deadband)
    gain = clamp(state.gain + growth * dt, gains.least_gain, gains.most_gain, gains.least_gain)
    disturbance = lowpass_rate_limited(before, observed, gains.bandwidth, gain, dt)
    command = compensate_lag(reference, gains.lead, gains.lead_square) / gains.slope
    command = command + invert_servo(disturbance, gains.natural_frequency, gains.damping)
    return AdaptiveSlidingModeState(observed, disturbance, gain), command


NOISE_SHARE = 4.0
"""ε over the standard deviation of σ by the encoders alone [–]."""

LEAST = 0.01
"""K_least over ω: a dead zone is crossed in its width over this share of the servo's frequency [rad]."""


def adaptation(known: Knowledge) -> float:
    """γ, half of q [1/s]."""
    return 0.5 * contact_bandwidth(known)


def deadband(known: Knowledge) -> float:
    """ε, four standard deviations of what the encoders add to σ [rad]."""
    noises = encoder_noises(known)
    return NOISE_SHARE * math.hypot(*noises) if noises else math.nan


def least_gain(known: Knowledge) -> float:
    """K_least, a hundredth of ω [rad/s]."""
    return LEAST * known.servo_frequency


LAW = Law(
    name="adaptive_sliding_mode",
    gains=AdaptiveSlidingModeGains(),
    start_kernel=start,
    step_kernel=step,
    source="Plestan, Shtessel, Brégeault, Poznyak, International Journal of Control 83(9), 2010",
    from_rig={
        **CONTACT,
        "adaptation": adaptation,
        "deadband": deadband,
        "least_gain": least_gain,
        "most_gain": crossing_rate,
    },
    compensates_lag=True,
    tunable=frozenset({"bandwidth", "adaptation", "deadband", "least_gain", "most_gain"}),
    limits={
        **LIMITS,
        "adaptation": (0.0, 1e5),
        "deadband": (0.0, math.inf),
        "least_gain": (1e-6, 1e6),
        "most_gain": (1e-6, 1e6),
    },
)
