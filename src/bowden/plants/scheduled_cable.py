"""A cable whose loop changes with its load or its bend, for a bench (`bowden.models.cable.scheduled`).

The sheath's width, which a run's bend drives, is what moves a scheduling variable: value = at + per_width·width.

- The bend of a model that is scheduled by it is the sheath's own: per_width = θ₀/(g/g₀).
- A load that changes goes the same way: with ``Sheath(bend=θ₀)`` the bend θ₀ is the least load that was seen, 2·θ₀ the
  largest, and between two it is between.
- A variable that stays has per_width = 0. Where none is moved, the width widens the loop as it does any cable's.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.models.cable.backlash import push
from bowden.models.cable.scheduled import (
    VARIABLES,
    ScheduledCable,
    cable_of,
    fill_powers,
    line_of,
    straight,
    turned,
)
from bowden.models.cable.sheath import Sheath
from bowden.plants.cable import Cable, Seen

Array = NDArray[np.float64]


class MovedSchedule(NamedTuple):
    """A scheduled cable with what moves its variables."""

    cable: ScheduledCable
    at: Array
    """(V,); the variables' own units."""
    per_width: Array
    """(V,); the variables' own units."""
    widens: bool
    """True if the width widens the loop; else it moves a variable."""


class ScheduledMemory(NamedTuple):
    """Where the plays are, and room to work in; changed in place."""

    z: Array
    """(k,) [rad]."""
    values: Array
    """Of the variables (V,)."""
    powers: Array
    """(M,) [–]."""


@kernel
def scheduled_start(cable: MovedSchedule, motor: float, width: float, slope_factor: float) -> ScheduledMemory:
    """At rest, every play centred on the motor."""
    plays = np.full(cable.cable.half_widths.size, motor)
    return ScheduledMemory(plays, np.empty(cable.at.size), np.empty(cable.cable.middle.shape[0]))


@kernel
def scheduled_advance(
    cable: MovedSchedule,
    memory: ScheduledMemory,
    before: float,
    after: float,
    scaled: float,
    width: float,
    dt: float,
) -> ScheduledMemory:
    """Every play pushed by the motor; in place."""
    wide = width if cable.widens else 1.0
    for i in range(memory.z.size):
        memory.z[i] = push(memory.z[i], after, wide * cable.cable.half_widths[i])
    return memory


@kernel
def scheduled_look(
    cable: MovedSchedule, memory: ScheduledMemory, motor: float, width: float, slope_factor: float
) -> Seen:
    """joint = f(0) + slope_factor·(f − f(0)) + g·Σ ηᵢ·(motor − zᵢ); a wider loop is as much higher."""
    for v in range(memory.values.size):
        memory.values[v] = cable.at[v] + cable.per_width[v] * width
    fill_powers(memory.values, cable.cable, memory.powers)
    one = cable.cable
    behind = 0.0
    for i in range(memory.z.size):
        behind += one.shares[i] * (motor - memory.z[i])
    middle = straight(motor, one.first, one.step, one.middle, memory.powers, 1.0)
    height = straight(motor, one.first, one.step, one.height, memory.powers, 0.0)
    if slope_factor != 1.0:  # f(0) is the offset, of which a bend takes nothing
        offset = straight(0.0, one.first, one.step, one.middle, memory.powers, 1.0)
        middle = offset + slope_factor * (middle - offset)
    return Seen(middle + height * behind, np.nan, np.nan)


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
    at, per_width = np.array(values, dtype=np.float64), np.zeros(len(values))
    if moved is not None:
        if moved not in variables:
            raise ParameterError(
                f"the model is scheduled by {', '.join(variables) or 'nothing'}, not by {moved!r}",
                expected="a variable of the model",
                do="identify logs that differ in it",
            )
        place = variables.index(moved)
        reach = float(cable.high[place] - cable.low[place])
        own = sheath or Sheath()
        per_width[place] = reach if moved == "load" else own.bend / own.gap
        at[place] = cable.low[place] - reach if moved == "load" else 0.0
    prepared = MovedSchedule(cable, at, per_width, moved is None)
    return Cable("scheduled", prepared, prepared, scheduled_start, scheduled_advance, scheduled_look, abs(slope))
