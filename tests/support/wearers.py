"""Wearers of a suit, one of each kind, and where a relaxed arm rests."""

import math

from scipy.optimize import brentq

from bowden.core.units import RADIANS
from bowden.models.suit.arm import Arm, Wearer, gravity_torque, passive_torque

WEARERS: dict[str, Wearer] = {
    "none": Wearer(),
    "weak": Wearer(share=0.3),
    "tremor": Wearer(tremor=0.5, tremor_frequency=5.0),
    "resisting": Wearer(stiffness=1.0, damping=0.5, centre=45.0 * RADIANS),
    "constant": Wearer(constant=-1.0),
}
"""One of each kind; their sizes are stated choices."""


def resting_angle(arm: Arm) -> float:
    """Where the relaxed arm hangs by itself, without a suit [rad]."""
    low, high = -0.5 * math.pi - arm.elevation, math.pi - arm.elevation  # weight flexes it, and extends it
    return float(brentq(lambda angle: gravity_torque(arm, angle) + passive_torque(arm, angle, 0.0), low, high))
