"""Encoders: finite resolution and noise."""

from typing import NamedTuple

import numpy as np

from bowden.core.kernel import kernel


class Encoder(NamedTuple):
    """An incremental encoder."""

    resolution: float = 0.0
    """Angle of one count; zero for an ideal encoder [rad]."""
    noise: float = 0.0
    """Standard deviation of the angle before it is counted [rad]."""


@kernel
def reading(angle: float, normal: float, encoder: Encoder) -> float:
    """What the encoder shows for a true `angle` [rad], given a standard normal number."""
    noisy = angle + encoder.noise * normal
    if encoder.resolution > 0.0:
        return encoder.resolution * np.floor(noisy * (1.0 / encoder.resolution) + 0.5)  # one division for a whole run
    return noisy
