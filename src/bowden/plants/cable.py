"""Any cable as a bench runs it: three kernels with their parameters; and the paper's own, of Bouc–Wen's hysteresis.

    start(cable, motor, width, slope_factor) -> memory
    advance(cable, memory, before, after, scaled, width, dt) -> memory
    look(cable, memory, motor, width, slope_factor) -> Seen

`memory` is a NamedTuple of floats and arrays (the arrays may be changed in place). `advance` gets that the motor has
gone one way from `before` to `after` within `dt`; a cable that does not know time leaves `dt` alone. `width` and
`slope_factor` are what the sheath's bend makes of them (`bowden.models.cable.sheath`); `scaled` is the motor's way over
the width that the sheath had meanwhile, ∫dm/w.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.nested import form_of, numbers_of
from bowden.models.cable.bouc_wen import BoucWen, PreparedCable, advance_prepared, prepare_cable
from bowden.models.cable.bouc_wen_static import StaticTerms, joint_angle
from bowden.models.cable.sheath import joint_in_sheath


class Seen(NamedTuple):
    """Observable quantities of a cable."""

    joint: float
    """Joint angle, before the load's lag [rad]."""
    torque: float
    """Of the cable on the motor's spool; NaN of a cable that knows no forces [N·m]."""
    h: float
    """The internal variable of a cable that has just one, else NaN [–]."""


@dataclass(frozen=True, eq=False)
class Cable:
    """Any cable, ready for a bench; `bowden.plants.cables` makes them. Equal to another that moves alike."""

    name: str
    """Its kind."""
    parameters: Any
    """A NamedTuple of what its maker was given; goes to the trace's settings."""
    prepared: Any
    """Argument `cable` of the kernels."""
    start: Callable[..., Any]
    advance: Callable[..., Any]
    look: Callable[..., Seen]
    slope: float
    """Joint motion per motor motion once the play is taken up, at the identified bend [rad/rad]."""
    physical: bool = False
    """True if it computes the loss in its sheath; then the sheath's own `loss` must be 0."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Cable) and self._moves == other._moves

    def __hash__(self) -> int:
        return hash(self._moves)

    @property
    def _moves(self) -> tuple[Any, ...]:
        """All that its motion depends on, where arrays are numbers."""
        kernels = (self.start, self.advance, self.look)
        return (self.name, kernels, tuple(numbers_of(self.prepared)), form_of(self.prepared), self.slope, self.physical)


class BentCable(NamedTuple):
    """A Bouc–Wen cable with static terms."""

    cable: BoucWen
    terms: StaticTerms


class Prepared(NamedTuple):
    """A Bouc–Wen cable, plain or with static terms, and its constants."""

    cable: Any
    hysteresis: PreparedCable


class Hysteresis(NamedTuple):
    """The Bouc–Wen cable's memory."""

    h: float
    """[–]"""


@kernel
def bouc_wen_start(cable: Prepared, motor: float, width: float, slope_factor: float) -> Hysteresis:
    """At rest with h = 0."""
    return Hysteresis(0.0)


@kernel
def bouc_wen_advance(
    cable: Prepared, memory: Hysteresis, before: float, after: float, scaled: float, width: float, dt: float
) -> Hysteresis:
    """Eq. 7 over the motor's travel, the play being as wide as the sheath makes it."""
    return Hysteresis(advance_prepared(memory.h, scaled, cable.hysteresis))


@kernel
def bouc_wen_look(cable: Prepared, memory: Hysteresis, motor: float, width: float, slope_factor: float) -> Seen:
    """See `bowden.models.cable.sheath.joint_in_sheath`."""
    return Seen(joint_in_sheath(motor, memory.h, width, slope_factor, cable.cable), np.nan, memory.h)


@kernel
def bouc_wen_static_look(cable: Prepared, memory: Hysteresis, motor: float, width: float, slope_factor: float) -> Seen:
    """See `bowden.models.cable.bouc_wen_static`."""
    return Seen(
        joint_angle(motor, memory.h, width, slope_factor, cable.cable.cable, cable.cable.terms), np.nan, memory.h
    )


def bouc_wen(cable: BoucWen | None = None, terms: StaticTerms | None = None) -> Cable:
    """The Bouc–Wen cable, with static terms if they are given (then it is called ``bouc_wen_static``).

    Raises:
        ParameterError: a half range that is not above 0, or a cable whose h has no bound.
    """
    cable = cable or BoucWen()
    for name, least in (("rate", 0.0), ("shape", 0.5), ("exponent", 0.0)):
        value = getattr(cable, name)
        if not least < value < math.inf:
            raise ParameterError(f"the cable's {name} is {value:g}", expected=f"a number above {least:g}")
    hysteresis, kernels = prepare_cable(cable), (bouc_wen_start, bouc_wen_advance)
    if terms is None:
        return Cable("bouc_wen", cable, Prepared(cable, hysteresis), *kernels, bouc_wen_look, cable.slope)
    if not terms.half_range > 0.0:
        raise ParameterError(f"bouc_wen_static: half_range is {terms.half_range}", expected="a number above 0")
    bent = BentCable(cable, terms)
    return Cable(
        "bouc_wen_static",
        bent,
        Prepared(bent, hysteresis),
        bouc_wen_start,
        bouc_wen_advance,
        bouc_wen_static_look,
        cable.slope,
    )
