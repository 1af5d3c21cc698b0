"""A plant whose joint falls where its motor rises, with its motor counted the other way round.

Laws, limits and checks take it that the joint follows the motor. Of a Bouc–Wen cable and of an identified one the
parameters are turned round; of any other plant, such as a user's own, what goes in and comes out of its kernels.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control.source import Measurement
from bowden.core.kernel import kernel, placeholder
from bowden.core.nested import unflatten
from bowden.plants.plant import Dynamics, SheathState


@placeholder
def own_rest(plant: Any, motor: float, sheath: SheathState) -> Any:
    """Placeholder for the plant's own ``rest``."""
    raise NotImplementedError  # always replaced


@placeholder
def own_advance(plant: Any, body: Any, applied: float, sheath: SheathState, next_sheath: SheathState) -> Any:
    """Placeholder for the plant's own ``advance``."""
    raise NotImplementedError  # always replaced


@placeholder
def own_observe(plant: Any, body: Any, normals: NDArray[np.float64]) -> tuple[Any, Measurement]:
    """Placeholder for the plant's own ``observe``."""
    raise NotImplementedError  # always replaced


@placeholder
def own_effort(plant: Any, body: Any, sheath: SheathState) -> float:
    """Placeholder for the plant's own ``effort``."""
    raise NotImplementedError  # always replaced


@placeholder
def own_look(plant: Any, body: Any) -> Any:
    """Placeholder for the plant's own ``look``."""
    raise NotImplementedError  # always replaced


@kernel
def turned_rest(plant: Any, motor: float, sheath: SheathState) -> Any:
    """At rest at a motor angle that is counted the other way round [rad]."""
    return own_rest(plant, -motor, sheath)


@kernel
def turned_advance(plant: Any, body: Any, applied: float, sheath: SheathState, next_sheath: SheathState) -> Any:
    """One cycle later under a command that is counted the other way round [rad]."""
    return own_advance(plant, body, -applied, sheath, next_sheath)


@kernel
def turned_observe(plant: Any, body: Any, normals: NDArray[np.float64]) -> tuple[Any, Measurement]:
    """Readings of its sensors, with the motor's angle and current reversed in sign."""
    body, measured = own_observe(plant, body, normals)
    return body, Measurement(measured.joint, -measured.motor, -measured.current, measured.load)


@kernel
def turned_effort(plant: Any, body: Any, sheath: SheathState) -> float:
    """The current that the motor needs, which drives it the other way [A]."""
    return -own_effort(plant, body, sheath)


@kernel
def turned_look(plant: Any, body: Any) -> Any:
    """Where it truly is; of its columns the second and third are the motor's angle and speed."""
    seen = own_look(plant, body)
    row = np.empty(len(seen))
    for i in range(len(seen)):
        row[i] = -seen[i] if i == 1 or i == 2 else seen[i]
    return unflatten(seen, row)


def turned_round(dynamics: Dynamics) -> Dynamics:
    """The same plant with its motor counted the other way round, whose columns are floats without nesting."""
    own: dict[str, Callable[..., Any]] = {
        "own_rest": dynamics.rest,
        "own_advance": dynamics.advance,
        "own_observe": dynamics.observe,
        "own_effort": dynamics.effort,
        "own_look": dynamics.look,
    }
    return replace(
        dynamics,
        rest=turned_rest,
        advance=turned_advance,
        observe=turned_observe,
        effort=turned_effort,
        look=turned_look,
        parts={**dynamics.parts, **own},
    )
