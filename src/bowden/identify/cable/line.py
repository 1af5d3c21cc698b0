"""The straight line: joint = slope·motor + offset, a cable without any loss of motion."""

import numpy as np

from bowden.identify.cable.family import Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import solve_linear


class Line:
    """Two parameters, both linear."""

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
