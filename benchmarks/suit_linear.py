"""The suit near rest as a linear system, and the adaptive law's margins on it.

Without friction the spool hangs between the drive's PD loop and two springs, and the forearm at their other ends:

    J·θ'' = J·ω²·(target − θ) − 2ζωJ·θ' − (r_f²k_f + r_e²k_e)·θ + (r_f·E'·k_f + r_e·R·k_e)·φ
    I·φ'' = (r_f·E'·k_f + r_e·R·k_e)·θ − (E'²k_f + R²k_e + K + m·g·c·cos φ)·φ − B·φ'

with E' the flexor's lever at the elbow's angle and k_f, k_e the cable's and the fabric's springs in series; k_e = 0
where the extensor is slack. A drive with an integral has target + y in place of the target, y' = k_i·(target − θ),
here without the band in which it rests. Friction is left out because it only takes energy: what holds without it is not
made to grow by it, though it may be left swinging within the play.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from bowden.control.laws.adaptive import AdaptiveGains
from bowden.control.stability import StateSpace, adaptive_model, closed_loop_poles, frequencies, margins, response
from bowden.core.units import RADIANS
from bowden.models.suit.arm import GRAVITY, arm_of
from bowden.models.suit.suit_angle import flexor_arm
from bowden.plants.suit_parts import Suit, prepare_suit

BODIES = ((45.0, 1.50), (75.0, 1.75), (120.0, 1.95))
"""Mass [kg] and height [m] of the wearers for whom gains must hold."""
ANGLES = tuple(angle * RADIANS for angle in (0.0, 45.0, 90.0))
"""Of the elbow, likewise [rad]."""


def suit_model(suit: Suit, angle: float, *, extensor: bool = True) -> StateSpace:
    """From the command, in the joint's coordinate, to the elbow, sampled.

    Args:
        suit: with its arm.
        angle: of the elbow at rest [rad].
        extensor: whether the extensor is taut.
    """
    made = prepare_suit(suit)
    motor, arm, radius = suit.motor, suit.arm, made.joint_radius
    lever, r_f, r_e = flexor_arm(angle, made.map), made.map.radius, made.extensor_radius
    k_f, k_e = (1.0 / (1.0 / c.stiffness + 1.0 / c.fabric.stiffness) for c in (made.flexor, made.extensor))
    k_e = k_e if extensor else 0.0
    omega, zeta = motor.servo.natural_frequency, motor.servo.damping
    across = r_f * lever * k_f + r_e * radius * k_e
    weight = GRAVITY * arm.mass * arm.centre * np.cos(angle + arm.elevation)
    back = lever**2 * k_f + radius**2 * k_e + arm.stiffness + weight
    damping = arm.damping + suit.fabric.damping * (lever**2 + (radius**2 if extensor else 0.0))
    integral = motor.integral > 0.0  # without it there is no such state, which would stand for ever
    states = 5 if integral else 4
    whole = np.zeros((states + 1, states + 1))
    whole[0, 1] = whole[2, 3] = 1.0
    whole[1, :4] = [
        -(omega**2) - (r_f**2 * k_f + r_e**2 * k_e) / motor.inertia,
        -2.0 * zeta * omega,
        across / motor.inertia,
        0.0,
    ]
    whole[1, states] = omega**2 * lever / r_f
    whole[3, :4] = [across / arm.inertia, 0.0, -back / arm.inertia, -damping / arm.inertia]
    if integral:
        whole[1, 4] = omega**2
        whole[4, 0], whole[4, states] = -motor.integral, motor.integral * lever / r_f
    held = expm(whole * suit.sample_time)
    size = states + suit.delay
    a, b, c = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    a[:states, :states], c[0, 2] = held[:states, :states], 1.0
    if suit.delay:
        a[:states, states] = held[:states, states]
        a[np.arange(states, size - 1), np.arange(states + 1, size)] = 1.0
        b[-1, 0] = 1.0
    else:
        b[:states, 0] = held[:states, states]
    return StateSpace(a, b, c, 0.0)


class Corner(NamedTuple):
    """One suit on one arm at one angle."""

    plant: StateSpace
    answer: NDArray[np.complex128]
    """Of the plant at `bowden.control.stability.frequencies`."""


def corners(suit: Suit) -> list[Corner]:
    """The suit on each of `BODIES` at each of `ANGLES`, with the extensor taut and slack."""
    arms = [arm_of(mass, height) for mass, height in BODIES]
    plants = [
        suit_model(suit._replace(arm=arm), angle, extensor=taut)
        for arm, angle, taut in itertools.product(arms, ANGLES, (True, False))
    ]
    dt = suit.sample_time
    return [Corner(plant, response(plant, frequencies(dt), dt)) for plant in plants]


def worst_margins(
    at: Sequence[Corner],
    gains: AdaptiveGains,
    dt: float,
    estimates: Sequence[tuple[float, float]],
    least: tuple[float, float] = (0.0, 0.0),
) -> tuple[float, float] | None:
    """The smallest gain margin [dB] and phase margin [deg] over corners and frozen estimates (β̂, D̂m).

    Args:
        at: the corners.
        gains: of the law.
        dt: sample time [s].
        estimates: at which the margins must hold.
        least: gain margin [dB] and phase margin [deg] below which nobody asks by how much.

    Returns:
        None where a loop is unstable, or has less than `least`.
    """
    laws = [adaptive_model(gains, dt, *estimate) for estimate in estimates]
    if any(np.max(np.abs(closed_loop_poles(corner.plant, law))) >= 1.0 for law in laws for corner in at):
        return None
    decibels = degrees = float("inf")
    for law, corner in itertools.product(laws, at):
        found = margins(corner.plant, law, dt, corner.answer)
        decibels = min(decibels, float("inf") if found.gain_margin_db is None else found.gain_margin_db)
        degrees = min(degrees, float("inf") if found.phase_margin_deg is None else found.phase_margin_deg)
        if decibels < least[0] or degrees < least[1]:
            return None
    return decibels, degrees
