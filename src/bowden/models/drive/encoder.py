"""Encoders: finite resolution and noise."""

from typing import Annotated, NamedTuple

from bowden.core.kernel import floor, kernel
from bowden.core.part import part
from bowden.core.quantity import Quantity


@part
class Encoder(NamedTuple):
    """An incremental encoder.

    >>> Encoder(resolution=0.0004).noise
    0.0
    """

    resolution: Annotated[
        float,
        Quantity(
            "one count; 0 for an ideal encoder",
            "rad",
            ge=0.0,
            le=90.0,
            hint="of {value:g} counts a turn one is 2*numpy.pi/{value:g}",
        ),
    ] = 0.0
    noise: Annotated[float, Quantity("standard deviation, before counting", "rad", ge=0.0, le=90.0)] = 0.0


@kernel
def reading(angle: float, normal: float, encoder: Encoder) -> float:
    """Reading of the encoder at a true `angle` [rad], given a standard normal number."""
    noisy = angle + encoder.noise * normal
    if encoder.resolution > 0.0:
        return encoder.resolution * floor(noisy * (1.0 / encoder.resolution) + 0.5)  # one division for a whole run
    return noisy
