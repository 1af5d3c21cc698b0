"""The three signals that pass between a law and its surroundings, all in radians and seconds."""

from typing import NamedTuple


class Sample(NamedTuple):
    """What the encoders say at one instant."""

    joint: float
    """Joint-side (distal) angle, the paper's φ_out [rad]."""
    motor: float
    """Motor-side (proximal) angle, the paper's φ_in [rad]."""


class Reference(NamedTuple):
    """Where the joint should be at one instant, with its exact derivatives."""

    position: float
    """Desired joint angle φ_d [rad]."""
    velocity: float
    """dφ_d/dt [rad/s]."""
    acceleration: float
    """d²φ_d/dt² [rad/s²]."""


Command = float
"""The motor's target angle [rad]."""
