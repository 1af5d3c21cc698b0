"""Wearers and suits that the admittance was not chosen on: what they feel, with a source that believes the usual suit.

Each is drawn from its number alone: suit and body are those of `wearers.py` (45–120 kg, stiffness of cables
and fabric 0.7–1.4 times, friction 0.7–1.3 times, play 0.5–1.5 times, pretension of 15–35 N, flex sensor off by up to
0.4° between zero and scale) in sheaths that are not moved; the wearer swings the elbow by ±15–30° about its middle at
0.3–0.8 Hz, with 60–150 N·m/rad and 2–5 N·m·s/rad behind it.
"""

from typing import NamedTuple

import numpy as np

from admittance_study import PushedReference, pushed, swinging
from bowden.core.units import RADIANS
from bowden.design.felt import Felt, felt
from bowden.models.suit.arm import Wearer
from bowden.plants.suit_parts import Suit
from wearers import random_wearer


class Unseen(NamedTuple):
    """A drawn suit and who moves in it."""

    suit: Suit
    wearer: Wearer
    mass: float
    """[kg]"""
    amplitude: float
    """[rad]"""
    frequency: float
    """[Hz]"""


def unseen(number: int, suit: Suit) -> Unseen:
    """The wearer of that number, in a suit that varies about the given one."""
    drawn, random = random_wearer(number, suit), np.random.default_rng([number, 11])
    amplitude = float(random.uniform(15.0, 30.0)) * RADIANS
    frequency = float(random.uniform(0.3, 0.8))
    firmness = float(random.uniform(60.0, 150.0)), float(random.uniform(2.0, 5.0))
    return Unseen(
        drawn.suit._replace(wearer=Wearer()),
        swinging(amplitude, frequency=frequency, firmness=firmness),
        drawn.mass,
        amplitude,
        frequency,
    )


def unseen_felt(number: int, suit: Suit, how: PushedReference, *, duration: float = 12.0) -> Felt:
    """What the wearer of that number feels, where the source knows their arm but believes the given suit."""
    drawn = unseen(number, suit)
    believed = suit._replace(arm=drawn.suit.arm)
    run = pushed(drawn.suit, how, drawn.wearer, believed=believed, duration=duration, seed=number)
    return felt(run, drawn.suit.arm, how.carried)
