"""A cable whose loop changes with its load or its bend, for `CablePlant` (`bowden.models.cable.scheduled`).

The sheath's width, which a run's bend drives, is what moves a scheduling variable: value = at + per_width·width.

- The bend of a model that is scheduled by it is the sheath's own: per_width = θ₀/(g/g₀).
- A load that changes goes the same way: with ``Sheath(bend=θ₀)`` the bend θ₀ is the least load that was seen, 2·θ₀ the
  largest, and between two it is between (as the poses of `bowden.plants.pose_cable`).
- A variable that stays has per_width = 0. Where none is moved, the cable is the generalised play at its values, and the
  width widens the loop as it does any cable's.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.models.cable.generalised_play import Branches, half_gap, joined, mean_branch, push_slots
from bowden.models.cable.scheduled import (
    VARIABLES,
    ScheduledCable,
    branches_at,
    branches_of,
    cable_of,
    fill_branches,
    fill_powers,
    line_of,
    turned,
)
from bowden.models.cable.sheath import Sheath
from bowden.plants.branches_cable import branches_advance, branches_look, branches_start
from bowden.plants.cable_body import Seen
from bowden.plants.cable_plant import Cable

Array = NDArray[np.float64]


class MovedSchedule(NamedTuple):
    """A scheduled cable with what moves its variables."""

    cable: ScheduledCable
    at: Array
    """(V,); the variables' own units."""
    per_width: Array
    """(V,); the variables' own units."""


class ScheduledMemory(NamedTuple):
    """Where the plays are, the branches as they are, and room to work in; changed in place."""

    z: Array
    """(k,) [rad]."""
    width: Array
    """For which the branches are (1,) [–]."""
    values: Array
    """Of the variables (V,)."""
    powers: Array
    """(M,) [–]."""
    bends: Array
    """(K,) [rad]."""
    gaps: Array
    """(K,) [rad]."""
    line: Array
    """Slope, offset and curve (3,)."""


@kernel
def scheduled_start(cable: MovedSchedule, motor: float, width: float, slope_factor: float) -> ScheduledMemory:
    """At rest, every play centred."""
    rows, knots = cable.cable.middle.shape
    memory = ScheduledMemory(
        np.zeros(cable.cable.reaches.size),
        np.full(1, np.nan),
        np.empty(cable.at.size),
        np.empty(rows),
        np.empty(knots),
        np.empty(knots),
        np.zeros(3),
    )
    fill_at(cable, memory, width)
    memory.z[:] = mean_branch(motor, branches_of(cable.cable, memory.bends, memory.gaps, memory.line))
    return memory


@kernel
def fill_at(cable: MovedSchedule, memory: ScheduledMemory, width: float) -> None:
    """The branches at a width of the sheath, into `memory`."""
    memory.width[0] = width
    for v in range(memory.values.size):
        memory.values[v] = cable.at[v] + cable.per_width[v] * width
    fill_powers(memory.values, cable.cable, memory.powers)
    fill_branches(memory.powers, cable.cable, memory.bends, memory.gaps, memory.line)


@kernel
def follow(cable: MovedSchedule, memory: ScheduledMemory, motor: float, width: float) -> None:
    """The branches at a new width of the sheath, and every play where it was between them."""
    if width == memory.width[0]:
        return
    before = branches_of(cable.cable, memory.bends, memory.gaps, memory.line)
    mean, gap = mean_branch(motor, before), max(half_gap(motor, before), 1e-12)
    fill_at(cable, memory, width)
    after = branches_of(cable.cable, memory.bends, memory.gaps, memory.line)
    then, wide = mean_branch(motor, after), half_gap(motor, after)
    for i in range(memory.z.size):
        memory.z[i] = then + wide * (memory.z[i] - mean) / gap


@kernel
def scheduled_advance(
    cable: MovedSchedule,
    memory: ScheduledMemory,
    before: float,
    after: float,
    width: float,
    slope_factor: float,
    dt: float,
) -> ScheduledMemory:
    """Every play pushed by the motor; in place."""
    follow(cable, memory, before, width)
    push_slots(memory.z, after, 1.0, branches_of(cable.cable, memory.bends, memory.gaps, memory.line))
    return memory


@kernel
def scheduled_look(
    cable: MovedSchedule, memory: ScheduledMemory, motor: float, width: float, slope_factor: float
) -> Seen:
    """joint = a(0) + slope_factor·(joint − a(0)), of which a bend takes nothing."""
    follow(cable, memory, motor, width)
    branches = branches_of(cable.cable, memory.bends, memory.gaps, memory.line)
    joint, offset = joined(memory.z, motor, 1.0, branches), branches.offset + mean_branch(0.0, branches)
    return Seen(offset + slope_factor * (joint - offset), np.nan, np.nan)


def scheduled(parameters: Mapping[str, float], moved: str | None = None, sheath: Sheath | None = None) -> Cable:
    """The cable of a scheduled model; one that runs backwards is turned round.

    Args:
        parameters: the model's, by name.
        moved: the variable that the sheath's width moves, ``load`` or ``bend``; none where it is left out.
        sheath: that a moved bend is of.

    Raises:
        KeyError: a parameter that is missing.
        ParameterError: the model is not scheduled by that variable.
    """
    cable, values = cable_of(parameters)
    variables = [name for name in VARIABLES if name in parameters]
    slope, _, _ = line_of(cable, values)
    if slope < 0.0:
        cable = turned(cable)
    if moved is None:
        return _standing(branches_at(values, cable))
    if moved not in variables:
        raise ParameterError(
            f"the model is scheduled by {', '.join(variables) or 'nothing'}, not by {moved!r}",
            expected="a variable of the model",
            do="identify logs that differ in it",
        )
    at, per_width = np.array(values, dtype=np.float64), np.zeros(len(values))
    place, own = variables.index(moved), sheath or Sheath()
    reach = float(cable.high[place] - cable.low[place])
    per_width[place] = reach if moved == "load" else own.bend / own.gap
    at[place] = cable.low[place] - reach if moved == "load" else 0.0
    prepared = MovedSchedule(cable, at, per_width)
    return Cable("scheduled", prepared, prepared, scheduled_start, scheduled_advance, scheduled_look, abs(slope))


def _standing(branches: Branches) -> Cable:
    """The generalised play that stays, a(0) with its offset, of which a bend of the sheath takes nothing."""
    zero = mean_branch(0.0, branches)
    branches = branches._replace(bends=branches.bends - zero, offset=branches.offset + zero)
    return Cable("scheduled", branches, branches, branches_start, branches_advance, branches_look, branches.slope)
