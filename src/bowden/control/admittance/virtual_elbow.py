"""Admittance: the torque with which a wearer pushes on the suit becomes a reference for the elbow.

    M·q̈ + B·q̇ + K·(q − q0) = f(τ),    f(τ) = τ − w·tanh(τ/w)

M, B, K: virtual inertia, damping and stiffness; q0: rest angle; w: dead band, whose edge is smooth: f is odd, its slope
lies in [0, 1), and it is ±w short of τ far out, so that it gives the loop no gain of its own. One cycle is one step of
the implicit Euler method,

    q̇⁺ = (M·q̇ + Ts·(f(τ) − K·(q − q0)))/(M + Ts·B + Ts²·K),    q⁺ = q + Ts·q̇⁺

which is stable for every M, B, K not below zero (M + B > 0) and only takes energy. The reference is bounded in angle,
speed and acceleration. Towards an end of its range it brakes with b, 0.8 of the largest acceleration; with d to it,

    q̇⁺ ≤ √((b·Ts/2)² + 2·b·d) − b·Ts/2   and   q̇⁺ ≤ d/Ts

is the fastest from which it can still stop there, so that it comes to rest at the end without a jump in speed. What the
bounds leave is the state: nothing winds up behind them, and a torque that turns is answered at once. A torque that is
not a number lets the reference come to rest where it is, with the time constant `decay`, and no spring pulls meanwhile.

Sources: Hogan, J. Dyn. Sys. Meas. Control 107, 1985, 1–24 (impedance control); Keemink, van der Kooij, Stienen, Int. J.
Robotics Research 37(11), 2018, 1421–1444 (admittance control). How small M and B may be:
`bowden.control.admittance.passivity`.
"""

import math
from typing import Annotated, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, sqrt, tanh
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference
from bowden.core.units import RADIANS

FRICTION_SHARE = 0.8
"""How much of the friction is made up for: less than all of it, so that the drive does not hunt [–]."""


class Admittance(NamedTuple):
    """The virtual elbow; the defaults hold on the suit as it is worn by 45 to 120 kg (docs/day_one_suit.md)."""

    inertia: float = 0.012
    """M [kg·m²]."""
    damping: float = 0.22
    """B [N·m·s/rad]."""
    stiffness: float = 0.0
    """K [N·m/rad]."""
    rest: float = 45.0 * RADIANS
    """q0 [rad]."""
    dead_band: float = 0.1
    """w; 0 for none [N·m]."""
    torque_limit: float = 30.0
    """A larger torque counts as this [N·m]."""
    low: float = 0.0
    """Smallest reference [rad]."""
    high: float = 120.0 * RADIANS
    """Largest reference [rad]."""
    speed_limit: float = 6.0
    """Largest speed of the reference [rad/s]."""
    acceleration_limit: float = 150.0
    """a, largest acceleration of the reference [rad/s²]."""
    decay: float = 0.05
    """Time in which the reference comes to rest while the torque is unknown [s]."""


class AdmittanceState(NamedTuple):
    """Where the virtual elbow is."""

    position: Annotated[float, Quantity("angle of the reference", "rad")]
    velocity: Annotated[float, Quantity("its speed", "rad/s")]
    acceleration: Annotated[float, Quantity("its acceleration over the last cycle", "rad/s²")]


def check_admittance(settings: Admittance) -> Admittance:
    """The settings, if a virtual elbow can have them.

    Raises:
        ParameterError: a number out of its range. Whether the suit can render them is another question, which
            `bowden.control.admittance.passivity` answers.
    """
    for name in ("inertia", "damping", "stiffness", "dead_band"):
        value = getattr(settings, name)
        if not 0.0 <= value < math.inf:
            raise ParameterError(f"admittance: {name} is {value:g}", expected="a number not below 0")
    for name in ("torque_limit", "speed_limit", "acceleration_limit", "decay"):
        value = getattr(settings, name)
        if not 0.0 < value < math.inf:
            raise ParameterError(f"admittance: {name} is {value:g}", expected="a number above 0")
    if not settings.inertia + settings.damping > 0.0:
        raise ParameterError("admittance: inertia and damping are both 0", expected="one of them above 0")
    if not -math.inf < settings.low < settings.high < math.inf:
        raise ParameterError(
            f"admittance: the range is {settings.low:g} to {settings.high:g} rad", expected="the low end first"
        )
    if not abs(settings.rest) < math.inf:
        raise ParameterError(f"admittance: the rest angle is {settings.rest:g}", expected="a finite number")
    return settings


@kernel
def admittance_start(settings: Admittance, joint: float) -> AdmittanceState:
    """At rest where the elbow is [rad]."""
    return AdmittanceState(joint, 0.0, 0.0)


@kernel
def beyond_band(torque: float, band: float) -> float:
    """f(τ) = τ − w·tanh(τ/w) [N·m].

    >>> beyond_band(0.25, 0.0), round(beyond_band(2.0, 0.5), 3), round(beyond_band(-0.05, 0.5), 6)
    (0.25, 1.5, -0.000166)
    """
    if band <= 0.0:
        return torque
    return torque - band * tanh(torque / band)


@kernel
def _stopping(distance: float, limit: float, dt: float) -> float:
    """The fastest that can still stop within a distance [rad] at an acceleration `limit` [rad/s²] [rad/s].

    The last step to the end brakes by up to 9/8 of the others, for which the fifth that is left has room.
    """
    brake, left = 0.8 * limit, max(0.0, distance)
    part = 0.5 * brake * dt
    return min(left / dt, sqrt(part * part + 2.0 * brake * left) - part)


@kernel
def admittance_step(
    settings: Admittance, state: AdmittanceState, torque: float, dt: float
) -> tuple[AdmittanceState, Reference]:
    """One cycle.

    Args:
        settings: of the virtual elbow.
        state: of the cycle before.
        torque: τ of the wearer on the suit, flexing positive; NaN where it is not known [N·m].
        dt: Ts, length of the cycle [s].
    """
    if math.isfinite(torque):
        bounded = max(-settings.torque_limit, min(settings.torque_limit, torque))
        spring = settings.stiffness * (state.position - settings.rest)
        wanted = settings.inertia * state.velocity + dt * (beyond_band(bounded, settings.dead_band) - spring)
        wanted = wanted / (settings.inertia + dt * (settings.damping + dt * settings.stiffness))
    else:
        wanted = state.velocity * settings.decay / (settings.decay + dt)

    most = settings.acceleration_limit * dt
    wanted = max(state.velocity - most, min(state.velocity + most, wanted))
    up = min(settings.speed_limit, _stopping(settings.high - state.position, settings.acceleration_limit, dt))
    down = min(settings.speed_limit, _stopping(state.position - settings.low, settings.acceleration_limit, dt))
    velocity = max(-down, min(up, wanted))
    acceleration = (velocity - state.velocity) / dt
    position = state.position + dt * velocity
    return AdmittanceState(position, velocity, acceleration), Reference(position, velocity, acceleration)
