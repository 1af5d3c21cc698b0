"""The adaptive law's margins on the linear suit, over wearers, angles and a slack extensor."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.laws.adaptive import AdaptiveGains
from bowden.control.stability import StateSpace, adaptive_model, closed_loop_poles, frequencies, margins, response
from bowden.core.units import RADIANS
from bowden.models.suit.arm import arm_of
from bowden.plants.suit_linear import linear_suit
from bowden.plants.suit_parts import Suit

BODIES = ((45.0, 1.50), (75.0, 1.75), (120.0, 1.95))
"""Mass [kg] and height [m] of the wearers for whom gains must hold."""
ANGLES = tuple(angle * RADIANS for angle in (0.0, 45.0, 90.0))
"""Of the elbow, likewise [rad]."""


def suit_model(suit: Suit, angle: float, *, extensor: bool = True) -> StateSpace:
    """From the command, in the joint's coordinate, to the elbow, sampled; see `bowden.plants.suit_linear`."""
    found = linear_suit(suit, angle, extensor=extensor)
    return StateSpace(found.a, found.b, found.joint, 0.0)


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
