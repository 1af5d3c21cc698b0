"""What every family of cable models offers to the identification."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.path import Path

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A family fitted to a path."""

    parameters: dict[str, float]
    """Every parameter by name, in the order in which it is reported; SI and radians."""
    slopes: dict[str, Array]
    """∂joint/∂parameter at each node (n,), for the parameters that were fitted; the others are settings.
    Where there is a `prior`, ∂joint/∂coordinate by the coordinate's name."""
    fitted: Array
    """Joint angle of the model at each node (n,) [rad]."""
    theta: Array
    """Where the search ended, in the family's own coordinates (k,)."""
    variance: dict[str, float] = field(default_factory=dict)
    """What a parameter's variance gets from the path itself being known with noise only, by name."""
    prior: Array | None = None
    """What the fitted coordinates cost, beside the squared error, as a quadratic form (k, k); none of most families."""


class Family(Protocol):
    """One family of models."""

    @property
    def name(self) -> str:
        """Its name in reports and files."""
        ...

    def fit(self, path: Path) -> Estimate:
        """The best member for the path, searched globally."""
        ...

    def refit(self, path: Path, near: Estimate) -> Estimate:
        """The best member for the path (perhaps another part of the log, or other weights), searched from `near`."""
        ...
