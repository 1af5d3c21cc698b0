"""The suit near rest as a linear system: spool and elbow, from the command to both angles.

Without friction the spool hangs between the drive's PD loop and two springs, and the forearm at their other ends:

    J·θ'' = J·ω²·(target − θ) − 2ζωJ·θ' − g²·(r_f²k_f + r_e²k_e)·θ + g·(r_f·E'·k_f + r_e·R·k_e)·φ
    I·φ'' = g·(r_f·E'·k_f + r_e·R·k_e)·θ − (E'²k_f + R²k_e + K + K_w + (1 − share)·m·g·c·cos(φ + φu))·φ − (B + B_w)·φ'

with E' the flexor's lever at the elbow's angle, g the slope factor of cable and sheath, and k_f, k_e the springs of
cable and fabric in series at the pretension; k_e = 0 where the extensor is slack. B has the flesh's damping too. A
drive with an integral has target + y in place of the target, y' = k_i·(target − θ), without the band in which it rests.

Left out: friction of gears and spool, what the sheaths hold back (play, capstan, or Bouc–Wen's h), the limits of
current and supply, and the flex sensor's loop and drift. Friction only takes energy: what holds without it is not made
to grow by it, though it may be left swinging within the play.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.models.drive.holding_brake import HoldingBrake
from bowden.models.suit.arm import GRAVITY
from bowden.models.suit.suit_angle import flexor_arm
from bowden.models.suit.suit_cable import PreparedSuitCable
from bowden.plants.suit_parts import Suit, prepare_suit

Array = NDArray[np.float64]


class LinearSuit(NamedTuple):
    """x⁺ = A·x + B·command; the elbow is joint·x and the motor, in the joint's coordinate, motor·x."""

    a: Array
    """(k, k)."""
    b: Array
    """(k, 1)."""
    joint: Array
    """(1, k)."""
    motor: Array
    """(1, k)."""
    slope: float
    """Joint motion per motor motion, slowly [rad/rad]."""


def linear_suit(suit: Suit, angle: float, *, extensor: bool = True, slope_factor: float = 1.0) -> LinearSuit:
    """The sampled suit with its delay.

    Args:
        suit: with its arm and wearer.
        angle: of the elbow at rest [rad].
        extensor: whether the extensor is taut.
        slope_factor: g, of the sheaths [–].

    Raises:
        ParameterError: a part of the suit that cannot be.
    """
    from scipy.linalg import expm  # a fifth of a second, which only a check need wait for

    made = prepare_suit(suit)
    motor, arm, wearer, radius = suit.motor, suit.arm, suit.wearer, made.joint_radius
    factor = slope_factor * made.flexor.slope
    lever, r_f, r_e = float(flexor_arm(angle, made.map)), factor * made.map.radius, factor * made.extensor_radius
    k_f, k_e = _spring(made.flexor, suit.pretension), _spring(made.extensor, suit.pretension) if extensor else 0.0
    omega, zeta = motor.servo.natural_frequency, motor.servo.damping
    across = r_f * lever * k_f + r_e * radius * k_e
    weight = (1.0 - wearer.share) * GRAVITY * arm.mass * arm.centre * np.cos(angle + arm.elevation)
    back = lever**2 * k_f + radius**2 * k_e + arm.stiffness + wearer.stiffness + weight
    flesh = suit.fabric.damping * (lever**2 + (radius**2 if extensor else 0.0))
    damping, gear = arm.damping + wearer.damping + flesh, lever / made.map.radius
    integral = motor.integral > 0.0  # without it there is no such state, which would stand for ever
    states = 5 if integral else 4
    whole = np.zeros((states + 1, states + 1))
    whole[0, 1] = whole[2, 3] = 1.0
    spools = (r_f**2 * k_f + r_e**2 * k_e) / motor.inertia
    whole[1, :4] = [-(omega**2) - spools, -2.0 * zeta * omega, across / motor.inertia, 0.0]
    whole[1, states] = omega**2 * gear
    whole[3, :4] = [across / arm.inertia, 0.0, -back / arm.inertia, -damping / arm.inertia]
    if integral:
        whole[1, 4] = omega**2
        whole[4, 0], whole[4, states] = -motor.integral, motor.integral * gear
    held = expm(whole * suit.sample_time)
    size = states + suit.delay
    a, b, joint, spool = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size)), np.zeros((1, size))
    a[:states, :states], joint[0, 2], spool[0, 0] = held[:states, :states], 1.0, 1.0 / gear
    if suit.delay:
        a[:states, states] = held[:states, states]
        a[np.arange(states, size - 1), np.arange(states + 1, size)] = 1.0
        b[-1, 0] = 1.0
    else:
        b[:states, 0] = held[:states, states]
    return LinearSuit(a, b, joint, spool, across * gear / back)


def without_friction(suit: Suit) -> Suit:
    """The suit with its limits, its geometry and its drive, but nothing that holds back: near rest it is `linear_suit`.

    No brake, no friction of spool, gears and feeder, no play or hysteresis of sheaths and sensor, no sensor's drift, no
    tremor or swing.
    """
    sensor, wearer = suit.joint_sensor, suit.wearer
    flexor, extensor = (
        cable._replace(
            half_width=0.0, friction=0.0, feeder_drag=0.0, bouc_wen=cable.bouc_wen._replace(hysteresis_gain=0.0)
        )
        for cable in (suit.flexor, suit.extensor)
    )
    return suit._replace(
        brake=HoldingBrake(),
        motor=suit.motor._replace(friction=0.0, efficiency=1.0, friction_feedforward=0.0),
        flexor=flexor,
        extensor=extensor,
        joint_sensor=sensor._replace(hysteresis=0.0, drift=0.0),
        wearer=wearer._replace(tremor=0.0, swing=0.0),
    )


def _spring(cable: PreparedSuitCable, tension: float) -> float:
    """Cable and fabric in series, the fabric as stiff as it is at a `tension` [N] [N/m]."""
    fabric = cable.fabric
    return 1.0 / (1.0 / cable.stiffness + 1.0 / np.sqrt(fabric.stiffness**2 + 4.0 * fabric.stiffening * tension))
