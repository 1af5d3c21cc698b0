"""The interaction torque without a load cell: from the motor's current, both angles and the model of the cables.

Two estimates and how far each is in doubt, with x what a spool has pulled in, s what the arm has given way, u where the
cable leaves its sheath (lengths, `bowden.models.suit.suit_cable`), θ the spool's angle and d its direction, −1…1:

    stretch   T_j = K·[u − s]₊, T_m = k·[g·x − u]₊, u held in the play    τ_s = T_f,j·E'(φ) − T_e,j·R
    current   N·kτ·I − friction = g·(r_f·T_f,m − r_e·T_e,m),    friction = d·(F + (1 − η)·|N·kτ·I|)
              T_f,j = T_f,m − D_f, with T_e,m and D = T_m − T_j from the cables' model
              τ_c = T_f,j·E'(φ) − T_e,j·R

and both less the flesh's damping. The estimate is their mean, weighed by 1/doubt²:

    doubt_s = stiffness at the elbow · doubt of the angles, a share of τ_s for that of the stiffness, and one of what
              the play holds at the elbow
    doubt_c = E'/r_f · √((doubt of friction·F)² + (1 − d²)·F²/3)

Where the motor turns, its friction may be anything from −F to F, which is the second term: there the current knows
next to nothing, and the estimate is the stretch's. Where the motor moves, it knows the load to its friction's doubt.
Before a reading has come the torque is NaN.

The sheath's bend, its own and `posture`·φ more, sets the slope g and the play's width (`bowden.models.cable.sheath`):
over 90° g falls by 2 %, which is 2 mm of cable, or 1 N·m at the elbow.

Left out: the spool's inertia (0.02 N·m at 0.5 Hz), how the fabric stiffens, and a sheath that is moved otherwise.
Of the cables' kinds it models the play; with capstan friction its half-width stands for the mean loss.
"""

import math
from typing import Annotated, NamedTuple

from bowden.core.kernel import kernel, sqrt, tanh
from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS
from bowden.models.cable.sheath import Sheath, slope_factor, width
from bowden.models.suit.suit_angle import SpoolMap, flexor_arm, flexor_travel
from bowden.models.suit.suit_cable import TAUT

LEAST_DOUBT = 1e-6
"""Beside any doubt of an estimate, so that its weight is a number [N·m]."""


class Chain(NamedTuple):
    """Knowledge of motor and cables for the estimate; of a rig, as `bowden.plants.pushing.chain_of` reads it."""

    map: SpoolMap
    extensor_radius: float
    """r_e [m]."""
    joint_radius: float
    """R [m]."""
    torque_constant: float
    """N·kτ, at the spool [N·m/A]."""
    friction: float
    """F, of the drive at the spool [N·m]."""
    loss: float
    """1 − η [–]."""
    cable: float
    """k, of cable and sheath [N/m]."""
    fabric: float
    """K [N/m]."""
    flesh: float
    """Damping of the flesh under a taut cable [N·s/m]."""
    half_width: float
    """r, of the cables' play [m]."""
    start: float
    """x that makes the pretension [m]."""
    sheath: Sheath = Sheath()
    """Of both cables, bent as at its identification at the straight arm."""
    posture: float = 0.0
    """How much more the sheaths are bent per angle of the elbow [rad/rad]."""


class Doubt(NamedTuple):
    """How well the chain is known, for the weights of both estimates."""

    angle: float = 0.5 * RADIANS
    """Of the joint's angle [rad]."""
    stiffness: float = 0.2
    """Share of the springs' [–]."""
    play: float = 0.2
    """Share of the play's [–]."""
    friction: float = 0.3
    """Share of the drive's [–]."""
    turning: float = 0.05
    """Speed of the spool at which its direction counts as known [rad/s]."""
    smoothing: float = 0.01
    """Time constant of the rates' and the current's filters [s]."""


class InteractionState(NamedTuple):
    """State of the estimate."""

    spool: Annotated[float, Quantity("θ of the cycle before", "rad")]
    joint: Annotated[float, Quantity("φ of the cycle before", "rad")]
    spool_rate: Annotated[float, Quantity("dθ/dt, filtered", "rad/s")]
    joint_rate: Annotated[float, Quantity("dφ/dt, filtered", "rad/s")]
    current: Annotated[float, Quantity("current, filtered", "A")]
    flexor_node: Annotated[float, Quantity("u of the flexor", "m")]
    extensor_node: Annotated[float, Quantity("u of the extensor", "m")]
    torque: Annotated[float, Quantity("of the suit on the elbow, flexing positive", "N·m")]
    doubt: Annotated[float, Quantity("its standard deviation, as estimated", "N·m")]
    from_current: Annotated[float, Quantity("τ_c", "N·m")]
    from_stretch: Annotated[float, Quantity("τ_s", "N·m")]


@kernel
def _node(chain: Chain, node: float, pulled: float, given: float, wide: float) -> float:
    """u held where the play, `wide` times as wide, lets it: |T_m − T_j| ≤ k·r, both springs sharing x − s [m]."""
    length, k, r = pulled + chain.start - given, chain.cable, chain.half_width * wide
    low, high = length - r, length + r
    low = k * low / (k + chain.fabric) if low > 0.0 else low
    high = k * high / (k + chain.fabric) if high > 0.0 else high
    high = max(k * r / chain.fabric, high)
    if math.isnan(node):  # as after a start without a joint's angle
        return given + max(low, high)
    return given + max(low, min(high, node - given))


@kernel
def interaction_start(chain: Chain, spool: float, joint: float) -> InteractionState:
    """With nothing known of the play but that it is in its middle.

    Args:
        chain: motor and cables.
        spool: θ [rad].
        joint: φ [rad].
    """
    share = chain.cable / (chain.cable + chain.fabric)
    given, radius = flexor_travel(joint, chain.map), -chain.joint_radius * joint
    slope = slope_factor(chain.sheath.bend + chain.posture * joint, chain.sheath)
    flexor = given + share * (slope * chain.map.radius * spool + chain.start - given)
    extensor = radius + share * (-slope * chain.extensor_radius * spool + chain.start - radius)
    return InteractionState(spool, joint, 0.0, 0.0, 0.0, flexor, extensor, math.nan, math.inf, math.nan, math.nan)


@kernel
def interaction_step(
    chain: Chain, doubt: Doubt, state: InteractionState, spool: float, joint: float, current: float, dt: float
) -> InteractionState:
    """The estimate one cycle later; a reading that is not a number leaves everything but the torque, which is NaN.

    Args:
        chain: motor and cables.
        doubt: about them.
        state: of the cycle before.
        spool: θ, measured [rad].
        joint: φ, measured [rad].
        current: I, measured [A].
        dt: length of the cycle [s].
    """
    known = abs(spool) <= 1e4 and abs(joint) <= 1e4 and abs(current) <= 1e4
    theta, phi, drawn = (spool, joint, current) if known else (state.spool, state.joint, state.current)
    follow = dt / (doubt.smoothing + dt)
    spool_rate = state.spool_rate + follow * ((theta - state.spool) / dt - state.spool_rate)
    joint_rate = state.joint_rate + follow * ((phi - state.joint) / dt - state.joint_rate)
    smooth = state.current + follow * (drawn - state.current)

    bend = chain.sheath.bend + chain.posture * phi
    slope, wide = slope_factor(bend, chain.sheath), width(bend, chain.sheath)
    r_f, r_e = slope * chain.map.radius, slope * chain.extensor_radius
    lever, radius = flexor_arm(phi, chain.map), chain.joint_radius
    given, gone = flexor_travel(phi, chain.map), -radius * phi
    flexor = _node(chain, state.flexor_node, r_f * theta, given, wide)
    extensor = _node(chain, state.extensor_node, -r_e * theta, gone, wide)
    pull_f, pull_e = chain.fabric * max(0.0, flexor - given), chain.fabric * max(0.0, extensor - gone)
    motor_f = chain.cable * max(0.0, r_f * theta + chain.start - flexor)
    motor_e = chain.cable * max(0.0, chain.start - r_e * theta - extensor)
    taut_f, taut_e = pull_f / (pull_f + TAUT), pull_e / (pull_e + TAUT)
    damping = chain.flesh * (taut_f * lever * lever + taut_e * radius * radius) * joint_rate
    stretch = lever * pull_f - radius * pull_e

    torque = chain.torque_constant * smooth
    direction = tanh(spool_rate / doubt.turning)
    load = torque - direction * (chain.friction + chain.loss * abs(torque))
    driven = (load + r_e * motor_e) / r_f - (motor_f - pull_f)
    by_current = lever * max(0.0, driven) - radius * pull_e

    soft = chain.cable * chain.fabric / (chain.cable + chain.fabric)
    stiff = soft * (taut_f * lever * lever + taut_e * radius * radius)
    held = soft * chain.half_width * wide * (taut_f * lever + taut_e * radius)
    stretch_doubt = stiff * doubt.angle + doubt.stiffness * abs(stretch) + doubt.play * held + LEAST_DOUBT
    unknown = doubt.friction * doubt.friction + (1.0 - direction * direction) / 3.0
    current_doubt = lever / r_f * chain.friction * sqrt(unknown) + LEAST_DOUBT
    heavy, light = 1.0 / (stretch_doubt * stretch_doubt), 1.0 / (current_doubt * current_doubt)
    mean = (heavy * stretch + light * by_current) / (heavy + light)
    return InteractionState(
        theta,
        phi,
        spool_rate,
        joint_rate,
        smooth,
        flexor,
        extensor,
        mean - damping if known else math.nan,
        1.0 / sqrt(heavy + light),
        by_current - damping,
        stretch - damping,
    )
