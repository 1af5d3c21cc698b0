"""How the sheath of a rig is bent over a run: values that a rig.toml can say."""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath, constant_bend, random_bend, scripted_bend
from bowden.plants.presets.paper import document

_CHOSEN = document()["chosen"]


class ConstantBend(NamedTuple):
    """A sheath that is not moved."""

    bend: Annotated[
        float | None,
        Quantity(
            "total bend; sheath.bend_deg where it is left out", "rad", symbol="θ", gt=0.0, le=3600.0, example=np.pi
        ),
    ] = None

    def path(self, sheath: Sheath, duration: float, seed: int) -> BendPath:
        """See `Bend.path`."""
        return constant_bend(sheath.bend if self.bend is None else self.bend)


class ScriptedBend(NamedTuple):
    """A sheath moved through way points, with minimum jerk between them (Fig. 15)."""

    times: Annotated[tuple[float, ...], Quantity("when each bend is reached", "s")] = (
        _CHOSEN["moved_from_s"],
        _CHOSEN["moved_to_s"],
    )
    bends: Annotated[tuple[float, ...], Quantity("total bend at each", "rad", symbol="θ", gt=0.0, le=3600.0)] = (
        _CHOSEN["bend_deg"] * RADIANS,
        _CHOSEN["moved_bend_deg"] * RADIANS,
    )

    def path(self, sheath: Sheath, duration: float, seed: int) -> BendPath:
        """See `Bend.path`."""
        return scripted_bend(self.times, self.bends)


class RandomBend(NamedTuple):
    """A sheath moved at random, smoothly; the scenario's seed decides how."""

    low: Annotated[float, Quantity("smallest total bend", "rad", symbol="θ", gt=0.0, le=3600.0)] = (
        _CHOSEN["bend_deg"] * RADIANS
    )
    high: Annotated[float, Quantity("largest total bend", "rad", symbol="θ", gt=0.0, le=3600.0)] = (
        _CHOSEN["moved_bend_deg"] * RADIANS
    )
    fastest: Annotated[
        float, Quantity("shortest time of one move; the longest is three times it", "s", gt=0.0, le=1e5)
    ] = 2.0

    def path(self, sheath: Sheath, duration: float, seed: int) -> BendPath:
        """See `Bend.path`."""
        return random_bend(self.low, self.high, self.fastest, duration, seed)


Bend = ConstantBend | ScriptedBend | RandomBend
"""`path` makes the bend over time, of the sheath as it lies, the run's duration [s] and its seed."""
