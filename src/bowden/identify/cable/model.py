"""An identified cable: a name, its parameters, and what they predict."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.identify.cable.bouc_wen import cable_of, simulate
from bowden.identify.cable.line import Line
from bowden.identify.cable.play import PlayOperator
from bowden.identify.cable.stack import PrandtlIshlinskii
from bowden.models.cable.bouc_wen import BoucWen

Array = NDArray[np.float64]

_PREDICT = {
    "line": Line().predict,
    "play": PlayOperator().predict,
    "bouc_wen": simulate,
    "bouc_wen_static": simulate,
    "prandtl_ishlinskii": PrandtlIshlinskii().predict,
}

NAMES = tuple(_PREDICT)
"""Every family's name, from the simplest on."""

_MEANINGS = (
    (
        r"slope",
        "rad/rad",
        "αφ: joint motion per motor motion outside the play; of a stack, plus the sum of its weights",
    ),
    (r"offset", "rad", "joint angle at motor angle 0 without hysteresis"),
    (r"half_width(_\d+)?", "rad", "half the motor's travel lost at a reversal"),
    (r"weight_\d+", "rad/rad", "share of the play of that half-width"),
    (r"initial_lag", "rad", "where the play stood beside the motor at the log's start"),
    (r"hysteresis_gain", "rad", "αh: joint motion per unit of h"),
    (r"hysteresis_gain_\d+", "rad", "the same, for the Chebyshev polynomial of that degree in the motor"),
    (r"rate", "1/rad", "ρ: how fast h follows the motor"),
    (r"shape", "1", "σ: how much faster h falls than it rose"),
    (r"exponent", "1", "n: how sharply h saturates"),
    (r"initial_h", "1", "h at the log's start"),
    (r"static_\d+", "rad", "coefficient of the Chebyshev polynomial of that degree in the motor"),
    (r"static_centre", "rad", "motor angle at the middle of the fitted range"),
    (r"static_half_range", "rad", "half the fitted range; the polynomials' argument is (motor − centre)/half range"),
)


def meaning(parameter: str) -> tuple[str, str]:
    """Unit and meaning of a parameter.

    >>> meaning("rate")
    ('1/rad', 'ρ: how fast h follows the motor')

    Raises:
        ParameterError: no model has a parameter of that name.
    """
    for pattern, unit, text in _MEANINGS:
        if re.fullmatch(pattern, parameter):
            return unit, text
    raise ParameterError(f"no model has a parameter {parameter!r}")


@dataclass(frozen=True)
class CableModel:
    """One model of a cable.

    >>> model = CableModel("line", {"slope": -0.9, "offset": 0.5})
    >>> model.joint_angle(np.array([0.0, 1.0])).round(3)
    array([ 0.5, -0.4])
    """

    name: str
    """One of `NAMES`."""
    parameters: Mapping[str, float]
    """By name; SI and radians."""
    others: Mapping[str, Mapping[str, float]] = field(default_factory=dict, compare=False, repr=False)
    """The parameters of other models of the same log, by their names: a rig tells laws what ``bouc_wen`` says."""

    def joint_angle(self, motor: Array) -> Array:
        """Joint angle along a recorded motion of the motor, simulated straight through: (n,) [rad] → (n,) [rad].

        The motion begins where the log did: `initial_h` and `initial_lag` are the state at its first sample.

        Raises:
            ParameterError: an unknown model, or a parameter that is missing.
        """
        if self.name not in _PREDICT:
            raise ParameterError(f"there is no cable model {self.name!r}", expected=f"one of {', '.join(NAMES)}")
        try:
            return _PREDICT[self.name](self.parameters, np.ascontiguousarray(motor, dtype=np.float64))
        except KeyError as error:
            raise ParameterError(f"cable model {self.name!r} has no parameter {error.args[0]!r}") from error

    def to_bouc_wen(self) -> BoucWen:
        """The cable for simulation and control.

        A cable that runs backwards keeps its signs: slope below zero and hysteresis gain above it.

        Raises:
            ParameterError: another model than ``bouc_wen``, or a parameter that is missing.
        """
        if self.name != "bouc_wen":
            raise ParameterError(f"a {self.name!r} model is no plain Bouc–Wen cable", do="take the model 'bouc_wen'")
        try:
            return cable_of(self.parameters)
        except KeyError as error:
            raise ParameterError(f"cable model 'bouc_wen' has no parameter {error.args[0]!r}") from error


@dataclass(frozen=True)
class IdentifiedCable:
    """All that an identification says of a cable: the model to use, and the others."""

    best: str
    """Name of the recommended model."""
    models: Mapping[str, Mapping[str, float]]
    """Name → parameters; SI and radians."""
    file: str = field(default="", compare=False)
    """Where it was read from, as a rig.toml names it."""

    def model(self, name: str | None = None) -> CableModel:
        """A model by its name; the recommended one where it is not given.

        Raises:
            ParameterError: the identification has no such model.
        """
        wanted = name or self.best
        if wanted not in self.models:
            given = f"{self.file or 'the identified cable'} has no model {wanted!r}"
            raise ParameterError(given, expected=f"one of {', '.join(self.models)}")
        return CableModel(wanted, self.models[wanted])

    @property
    def bouc_wen(self) -> BoucWen:
        """The cable as the plain Bouc–Wen model has it, which every identification fits.

        Raises:
            ParameterError: it has none, or one with a slope of zero.
        """
        cable = self.model("bouc_wen").to_bouc_wen()
        if cable.slope == 0.0:
            raise ParameterError(
                f"{self.file or 'the identified cable'}: the slope of bouc_wen is 0",
                do="identify a log in which the joint moves",
            )
        return cable
