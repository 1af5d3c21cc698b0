"""The Prandtl–Ishlinskii stack: weights on fixed half-widths, none of them against the cable's direction.

    joint = slope·motor + Σ weight_i·z_i + offset,    all weights of the slope's sign

Weights of one sign keep the stack invertible and its loops dissipative; the fit (non-negative least squares) then
leaves only the few plays that the data need.
"""

import numpy as np

from bowden.identify.cable.family import Array, Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import nonnegative, products, solve_linear
from bowden.plants.predicted import slots_along

_GRID = np.geomspace(2e-3, 0.45, 18)
"""Half-widths offered, over the motor's range [–]."""


class PrandtlIshlinskii:
    """A stack of play operators."""

    name = "prandtl_ishlinskii"

    def fit(self, path: Path) -> Estimate:
        """See `Family.fit`."""
        lags = 0.25 * path.span * np.array([-1.0, -0.3, -0.1, 0.0, 0.1, 0.3, 1.0])
        found = [self._solve(path, _GRID * path.span, lag) for lag in lags]
        costs = [float(path.weight @ (one.fitted - path.joint) ** 2) for one in found]
        return found[int(np.argmin(costs))]

    def refit(self, path: Path, near: Estimate) -> Estimate:
        """See `Family.refit`."""
        return self._solve(path, _GRID * path.span, float(near.theta[0]))

    def _solve(self, path: Path, widths: Array, lag: float) -> Estimate:
        slots = slots_along(path.motor, widths, lag)
        basis = np.column_stack([path.motor, slots])
        share = path.weight / path.weight.sum()
        centred = basis - share @ basis
        joint = path.joint - share @ path.joint
        sums = products(np.column_stack([centred, joint]), path.weight)
        gram, moments = sums[:-1, :-1], sums[:-1, -1]
        weights = nonnegative(gram, np.copysign(1.0, moments[0]) * moments) * np.sqrt(np.diag(gram))
        active = np.flatnonzero(weights[1:] > 1e-6 * weights.max())
        kept = np.column_stack([path.motor, slots[:, active], np.ones_like(path.motor)])
        linear, _ = solve_linear(kept, path.joint, path.weight)
        parameters, slopes = {"slope": float(linear[0])}, {"slope": path.motor}
        for i, k in enumerate(active, start=1):
            parameters[f"half_width_{i}"] = float(widths[k])
            parameters[f"weight_{i}"] = float(linear[i])
            slopes[f"weight_{i}"] = slots[:, k]
        parameters |= {"offset": float(linear[-1]), "initial_lag": lag}
        slopes["offset"] = kept[:, -1]
        return Estimate(parameters, slopes, kept @ linear, np.array([lag]))
