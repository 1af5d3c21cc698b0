"""Sensors of benches in tests."""

from bowden.core.units import RADIANS
from bowden.models.drive.encoder import Encoder

PAPER_ENCODER = Encoder(resolution=360.0 / 16384 * RADIANS, noise=0.01 * RADIANS)
"""4096 lines counted fourfold (0.022°) and 0.01° of noise: a stated choice, the paper names none."""
