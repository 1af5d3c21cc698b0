"""Model-based compensation of a dead zone with friction (Kesner & Howe 2011 and 2014, the paper's [15]).

The cable loses motion twice: it crosses a clearance of half-width b, and Coulomb friction in the sheath stretches it by
f, which builds up over the travel as the stretch spreads along the sheath (Dahl's model of friction). Both widths are
known from identification, and the inverse adds them to the motor's angle:

    command = (φa + kp·e + ki·∫e dt)/α̂ + b·d + f·q
    d: −1…1, the side of the clearance; it changes smoothly, and only for a speed beyond a dead band
    q⁺ = σ + (q − σ)·exp(−|Δφ_d|/ξ),   σ = sgn Δφ_d

The model is open-loop; the position PI loop of [15] takes up what it leaves. [15] commands a force and adds friction as
one; under a position servo friction can only show as stretch.
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
    half_width,
    integrate_error,
    update_direction,
    update_hold,
)
from bowden.core.kernel import exp, kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample


class HysteresisModelGains(NamedTuple):
    """The identified dead zone and friction, and the position PI loop."""

    slope: float = 0.938
    """α̂, joint motion per motor motion; negative where the cable runs the other way [rad/rad]."""
    half_width: float = 0.0456
    """b, half of the clearance, in motor travel [rad]."""
    friction_stretch: float = 0.001
    """f, stretch under the full Coulomb friction, in motor travel [rad]."""
    friction_travel: float = 0.02
    """ξ, joint travel over which the stretch builds up [rad]."""
    velocity_band: float = 0.001
    """Reference speed below which nothing changes side [rad/s]."""
    switching_time: float = 0.01
    """Time constant with which the clearance is crossed [s]."""
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


class HysteresisModelState(NamedTuple):
    """State of the law from one cycle to the next."""

    direction: Annotated[float, Quantity("d, the side of the clearance on which the motor is held, −1…1")]
    friction: Annotated[float, Quantity("q, share of the full friction's stretch, −1…1")]
    wait: Annotated[float, Quantity("time left until the feedback acts again", "s")]
    error: Annotated[float, Quantity("the error that the feedback sees", "rad")]
    integral: Annotated[float, Quantity("ki·∫e dt", "rad")]


@kernel
def start(gains: HysteresisModelGains, sample: Sample) -> HysteresisModelState:
    """Begin in the middle of the clearance, without stretch."""
    return HysteresisModelState(0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def step(
    gains: HysteresisModelGains, state: HysteresisModelState, sample: Sample, reference: Reference, dt: float
) -> tuple[HysteresisModelState, float]:
    """Advance the model along the desired motion, and invert it."""
    velocity = (reference.velocity + gains.lead * reference.acceleration) / gains.slope
    direction = update_direction(state.direction, velocity, gains.velocity_band, gains.switching_time, dt)
    travel = velocity * gains.slope * dt
    friction = state.friction
    if abs(velocity) > 0.0:
        side = math.copysign(1.0, velocity)
        left = exp(-abs(travel) / gains.friction_travel)
        friction = clamp(side + (state.friction - side) * left, -1.0, 1.0, state.friction)
    wait = update_hold(state.wait, direction - state.direction, gains.hold, dt)
    missed = reference.position - sample.joint
    error, integral = integrate_error(
        wait, state.error, state.integral, missed, gains.integral_gain, gains.integral_limit, dt
    )
    wanted = compensate_lag(reference, gains.lead, gains.lead_square) + gains.proportional_gain * error + integral
    lost = gains.half_width * direction + gains.friction_stretch * friction
    return HysteresisModelState(direction, friction, wait, error, integral), wanted / gains.slope + lost


LAW = Law(
    name="hysteresis_model",
    gains=HysteresisModelGains(),
    start_kernel=start,
    step_kernel=step,
    source="Kesner, Howe, IEEE ICRA 2011 and IEEE Transactions on Robotics 2014; Dinh et al. 2017, Section 1, [15]",
    from_rig={**LAG, "slope": "slope", "half_width": half_width},
    feeds_back=frozenset({"joint"}),
    compensates_lag=True,
    tunable=frozenset(
        {"velocity_band", "switching_time", "proportional_gain", "integral_gain", "integral_limit", "hold"}
    ),
    limits={
        **LIMITS,
        "half_width": (0.0, math.inf),
        "friction_stretch": (0.0, math.inf),
        "friction_travel": (1e-9, math.inf),
    },
)
