"""Wearers of a suit, one of each kind."""

from bowden.core.units import RADIANS
from bowden.models.suit.arm import Wearer

WEARERS: dict[str, Wearer] = {
    "none": Wearer(),
    "weak": Wearer(share=0.3),
    "tremor": Wearer(tremor=0.5, tremor_frequency=5.0),
    "resisting": Wearer(stiffness=1.0, damping=0.5, centre=45.0 * RADIANS),
    "constant": Wearer(constant=-1.0),
}
"""One of each kind; their sizes are stated choices."""
