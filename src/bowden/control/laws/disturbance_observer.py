"""A disturbance observer (Ohnishi 1987; Chen, Yang, Guo and Li 2016) with an inverse play as feed-forward.

Ohnishi's observer sends what a nominal model does not explain through a low-pass Q and takes it off the command. Here
the model is the cable's slope, joint = α̂·motor, from the measured motor on: both angles are of one instant, so that
neither the servo nor its delay stands between the disturbance and its observation,

    o = motor − joint/α̂ − J(t − τ)            J(t − τ) ≈ J − τ·dJ/dt, what the feed-forward has already moved
    d̂ = Q·o,   Q = q³/(s + q)³, its rate at most `rate_limit`
    J = Q_J·(r·d),   Q_J = ω_J²/(s + ω_J)²     r·d: half of the known dead zone, in the direction of motion
    command = φa/α̂ + (1 + 2ζ/ω·d/dt + 1/ω²·d²/dt²)·(d̂ + J)

φa is the reference with the servo's lag and the delay taken away; the last factor is the servo's inverse, whose
derivatives are those of the filters, exactly. All filters are solved exactly over a cycle. Q is of third order, since
the servo's inverse would send the noise of the encoders through one of second order undamped.

While the cable is engaged the loop is Q·e^(−τs)·(1 − α/α̂), below one for any slope up to 2·α̂, whatever the delay. In
the dead zone it is Q·e^(−τs), an integral that crosses. A load that swings has more than one at its resonance, and no
bandwidth above that holds it: there the limit of d̂'s rate keeps the swing small,

    d̂ follows o₁ no further away than Φ: d̂ + Φ·tanh((o₁ − d̂)/Φ),   Φ = 2·rate_limit/q

o₁ being o behind the first of Q's poles. With it no swing of the frequency ν has an amplitude of d̂ beyond rate_limit/ν,
and Q's gain only falls by it.
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
    crossing_rate,
    invert_servo,
    lowpass,
    lowpass_rate_limited,
    lowpass_second_order,
    update_direction,
)
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample


class DisturbanceObserverGains(NamedTuple):
    """The nominal model, the two filters and the limit."""

    slope: float = 0.938
    """α̂, joint motion per motor motion; negative where the cable runs the other way [rad/rad]."""
    natural_frequency: float = 53.58
    """ω of the servo [rad/s]."""
    damping: float = 1.0
    """ζ of the servo [–]."""
    delay: float = 0.0015
    """τ [s]."""
    bandwidth: Annotated[float, Quantity("q, of Q", "rad/s", live=True)] = 190.0
    rate_limit: Annotated[float, Quantity("how fast d̂ may change, at most", "rad/s", live=True)] = 2.679
    half_width: float = 0.0
    """r, half of what the feed-forward crosses at a reversal, in motor travel; 0 where no width is known [rad]."""
    jump_bandwidth: float = 107.16
    """ω_J, with which it crosses [rad/s]."""
    velocity_band: float = 0.001
    """Reference speed below which the direction is kept [rad/s]."""
    lead: float = LEAD
    """Lag of servo and delay that is taken away [s]."""
    lead_square: float = LEAD_SQUARE
    """The same to second order [s²]."""


class DisturbanceObserverState(NamedTuple):
    """State of the law from one cycle to the next."""

    observed: Annotated[float, Quantity("o₁, motor − joint/α̂ behind the first pole of Q", "rad")]
    disturbance: Filtered
    """d̂."""
    jump: Filtered
    """J."""
    direction: Annotated[float, Quantity("d, the last direction of motion, −1, 0 or 1")]


@kernel
def start(gains: DisturbanceObserverGains, sample: Sample) -> DisturbanceObserverState:
    """Begin with the motor held where it is."""
    held = Filtered(sample.motor - sample.joint / gains.slope, 0.0, 0.0)
    return DisturbanceObserverState(held.value, held, Filtered(0.0, 0.0, 0.0), 0.0)


@kernel
def step(
    gains: DisturbanceObserverGains,
    state: DisturbanceObserverState,
    sample: Sample,
    reference: Reference,
    dt: float,
) -> tuple[DisturbanceObserverState, float]:
    """Observe, jump where the reference turns, and ask the servo for both."""
    moved = state.jump.value - gains.delay * state.jump.rate
    contact = clamp(sample.motor - sample.joint / gains.slope - moved, -1e3, 1e3, state.observed)
    observed = lowpass(state.observed, contact, gains.bandwidth, dt)
    disturbance = lowpass_rate_limited(state.disturbance, observed, gains.bandwidth, gains.rate_limit, dt)
    velocity = (reference.velocity + gains.lead * reference.acceleration) / gains.slope
    direction = update_direction(state.direction, velocity, gains.velocity_band, 0.0, dt)
    jump = lowpass_second_order(state.jump, gains.half_width * direction, gains.jump_bandwidth, dt)
    command = compensate_lag(reference, gains.lead, gains.lead_square) / gains.slope
    command = command + invert_servo(disturbance, gains.natural_frequency, gains.damping)
    command = command + invert_servo(jump, gains.natural_frequency, gains.damping)
    return DisturbanceObserverState(observed, disturbance, jump, direction), command


CERTAIN = 0.6
"""Share of the known dead zone that is crossed by feed-forward: what a sheath that is straightened leaves of it [–]."""

JUMP_SHARE = 2.0
"""ω_J over ω [–]."""


def certain_half_width(known: Knowledge) -> float:
    """Half of the share of the dead zone that is certain, in motor travel [rad]."""
    return 0.5 * CERTAIN * known.width


def jump_bandwidth(known: Knowledge) -> float:
    """Twice ω [rad/s]."""
    return JUMP_SHARE * known.servo_frequency


LAW = Law(
    name="disturbance_observer",
    gains=DisturbanceObserverGains(),
    start_kernel=start,
    step_kernel=step,
    source="Ohnishi, Trans. IEE Japan 107-D, 1987; Chen, Yang, Guo, Li, IEEE Trans. Industrial Electronics 63(2), 2016",
    from_rig={
        **CONTACT,
        "delay": "delay",
        "rate_limit": crossing_rate,
        "half_width": certain_half_width,
        "jump_bandwidth": jump_bandwidth,
    },
    compensates_lag=True,
    tunable=frozenset({"bandwidth", "rate_limit", "jump_bandwidth", "velocity_band"}),
    limits={
        **LIMITS,
        "delay": (0.0, 10.0),
        "rate_limit": (1e-6, 1e6),
        "half_width": (0.0, math.inf),
        "jump_bandwidth": (1e-3, 1e5),
    },
)
