"""Plays between two branches as a cable for `CablePlant`: of one log, and of several at the load where they stand."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel
from bowden.models.cable.generalised_play import Branches, joined, mean_branch, push_slots
from bowden.plants.cable_body import Seen


class Slots(NamedTuple):
    """Where the slots are; changed in place."""

    z: NDArray[np.float64]
    """(k,) [rad]."""


@kernel
def branches_start(cable: Branches, motor: float, width: float, slope_factor: float) -> Slots:
    """Every z in the middle between the branches."""
    return Slots(np.full(cable.reaches.size, mean_branch(motor, cable)))


@kernel
def branches_advance(
    cable: Branches, memory: Slots, before: float, after: float, width: float, slope_factor: float, dt: float
) -> Slots:
    """Every z pushed by the branches, `width` times as far apart; in place."""
    push_slots(memory.z, after, width, cable)
    return memory


@kernel
def branches_look(cable: Branches, memory: Slots, motor: float, width: float, slope_factor: float) -> Seen:
    """See `bowden.models.cable.generalised_play`."""
    return Seen(joined(memory.z, motor, slope_factor, cable), np.nan, np.nan)
