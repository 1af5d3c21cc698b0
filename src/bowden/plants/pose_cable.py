"""One cable that goes over into another while it runs, as a tool's does when its wrist turns: poses on a line.

The sheath's width is the pose: 1 is the first cable, 2 the second, and between two the joint is their weighted mean.
All of them feel the motor all the time, so that each has its hysteresis ready when the pose comes to it.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.models.cable.bouc_wen import advance_prepared
from bowden.models.cable.bouc_wen_static import joint_angle
from bowden.plants.cable_body import Seen
from bowden.plants.cable_plant import Cable
from bowden.plants.cables import Bent


class PoseMemory(NamedTuple):
    """The h of every pose's cable; changed in place."""

    h: NDArray[np.float64]
    """(k,) [–]."""


class PoseParameters(NamedTuple):
    """What the cable is made of."""

    poses: tuple[Any, ...]
    """Of each cable, from width 1 on."""


@kernel
def poses_start(cable: tuple[Bent, ...], motor: float, width: float, slope_factor: float) -> PoseMemory:
    """At rest, every h = 0."""
    return PoseMemory(np.zeros(len(cable)))


@kernel
def poses_advance(
    cable: tuple[Bent, ...],
    memory: PoseMemory,
    before: float,
    after: float,
    width: float,
    slope_factor: float,
    dt: float,
) -> PoseMemory:
    """Every pose's Eq. 7 over the motor's travel; in place."""
    for i in range(len(cable)):
        memory.h[i] = advance_prepared(memory.h[i], after - before, cable[i].hysteresis)
    return memory


@kernel
def poses_look(cable: tuple[Bent, ...], memory: PoseMemory, motor: float, width: float, slope_factor: float) -> Seen:
    """The weighted mean of the two poses on either side; the first or the last one beyond them."""
    joint = 0.0
    for i in range(len(cable)):
        near = max(1.0, min(float(len(cable)), width))
        weight = max(0.0, 1.0 - abs(near - (i + 1.0)))
        if weight > 0.0:
            joint += weight * joint_angle(motor, memory.h[i], 1.0, slope_factor, cable[i].cable, cable[i].terms)
    return Seen(joint, math.nan, math.nan)


def poses(cables: Sequence[Cable]) -> Cable:
    """A cable that is one of several, or between two, as the sheath's width says.

    With ``Sheath(bend=θ₀)`` the bend θ₀ is the first cable, 2·θ₀ the second, and so on.

    Args:
        cables: two or more of `bowden.plants.cables.bouc_wen`, or of identification's ``bouc_wen`` and
            ``bouc_wen_static``.

    Raises:
        ParameterError: fewer than two, or a cable of another kind.
    """
    kinds = [cable.name for cable in cables]
    if len(kinds) < 2 or not all(isinstance(cable.prepared, Bent) for cable in cables):
        raise ParameterError(f"poses of the kinds {kinds}", expected="two cables or more, bouc_wen or bouc_wen_static")
    prepared = tuple(cable.prepared for cable in cables)
    parameters = PoseParameters(tuple(cable.parameters for cable in cables))
    return Cable("poses", parameters, prepared, poses_start, poses_advance, poses_look, cables[0].slope)
