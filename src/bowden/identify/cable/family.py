"""What every family of cable models offers to the identification; the simplest of them, the straight line."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import solve_linear

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""What is being done now, and the share of the work that is behind."""


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


class Line:
    """The straight line, a cable without any loss of motion: joint = slope·motor + offset."""

    name = "line"

    def fit(self, path: Path) -> Estimate:
        """See `Family.fit`."""
        basis = np.stack([path.motor, np.ones_like(path.motor)], axis=1)
        linear, _ = solve_linear(basis, path.joint, path.weight)
        return Estimate(
            parameters={"slope": float(linear[0]), "offset": float(linear[1])},
            slopes={"slope": basis[:, 0], "offset": basis[:, 1]},
            fitted=basis @ linear,
            theta=np.empty(0),
        )

    def refit(self, path: Path, near: Estimate) -> Estimate:
        """See `Family.refit`."""
        return self.fit(path)
