"""Plays fitted to a path: one, and a stack of them.

The play operator (Eqs 4–5), joint = slope·z + offset, has its half-width and its initial state searched. A jump of the
contact makes the error uneven in the half-width, so a scan of the whole range comes before the search.

The Prandtl–Ishlinskii stack has weights on fixed half-widths, none of them against the cable's direction:

    joint = slope·motor + Σ weight_i·z_i + offset,    all weights of the slope's sign

Weights of one sign keep the stack invertible and its loops dissipative; the fit (non-negative least squares) then
leaves only the few plays that the data need.
"""

import numpy as np

from bowden.core.kernel import compiled, kernel
from bowden.identify.cable.family import Array, Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import minimise, products, solve_linear, weights_of_one_sign, without
from bowden.models.cable.backlash import push
from bowden.plants.predicted import slots_along

_GRID = np.geomspace(2e-3, 0.45, 18)
"""Half-widths of a stack that are offered, over the motor's range [–]."""


def play_sensitivities(motor: Array, half_width: float, initial_lag: float) -> Array:
    """z, ∂z/∂(half-width) and ∂z/∂(initial lag) along a motion (n, 3); z starts at motor[0] + `initial_lag`.

    In contact z = motor ∓ half-width; between the contacts z and its derivatives stay.
    """
    found = np.empty((motor.size, 3))
    compiled(_fill_play_sensitivities)(motor, half_width, initial_lag, found)
    return found


@kernel
def _fill_play_sensitivities(motor: Array, half_width: float, initial_lag: float, found: Array) -> None:
    z, by_width, by_lag = motor[0] + initial_lag, 0.0, 1.0
    for k in range(motor.size):
        after = push(z, motor[k], half_width)
        if after != z:
            by_width, by_lag = (-1.0 if after > z else 1.0), 0.0
        z = after
        found[k, 0], found[k, 1], found[k, 2] = z, by_width, by_lag


class PlayOperator:
    """Four parameters: two searched, two linear."""

    name = "play"

    def __init__(self, thin: Path | None = None) -> None:
        """`thin` is the path, thinned, on which the range of half-widths is scanned; all of it where none is given."""
        self._thin = thin

    def fit(self, path: Path) -> Estimate:
        """See `Family.fit`."""
        thin = self._thin or path
        widths = 0.5 * path.span * np.geomspace(1e-3, 0.95, 40)
        starts = [np.array([width, side]) for width in widths for side in (-1.0, 0.0, 1.0)]
        costs = []
        for start in starts:
            basis = self._basis(thin, start)[0]
            linear, _ = solve_linear(basis, thin.joint, thin.weight)
            costs.append(float(thin.weight @ (basis @ linear - thin.joint) ** 2))
        return self._search(path, starts[int(np.argmin(costs))])

    def refit(self, path: Path, near: Estimate) -> Estimate:
        """See `Family.refit`."""
        return self._search(path, near.theta)

    def _search(self, path: Path, start: Array) -> Estimate:
        low, high = np.array([0.0, -1.0]), np.array([0.5 * path.span, 1.0])
        theta, linear = minimise(lambda at: self._basis(path, at), path.joint, path.weight, start, low, high)
        width, side = theta
        basis = self._basis(path, theta)[0]
        z = play_sensitivities(path.motor, width, side * width)
        offset, slope = linear
        return Estimate(
            parameters={
                "slope": float(slope),
                "half_width": float(width),
                "offset": float(offset),
                "initial_lag": float(side * width),
            },
            slopes={
                "slope": z[:, 0],
                "half_width": slope * z[:, 1],
                "offset": np.ones_like(path.motor),
                "initial_lag": slope * z[:, 2],
            },
            fitted=basis @ linear,
            theta=theta,
            variance={"initial_lag": path.start_error**2},
        )

    def _basis(self, path: Path, theta: Array) -> tuple[Array, Array]:
        """Φ = [1, z] for θ = (half-width, initial lag over half-width)."""
        width, side = float(theta[0]), float(theta[1])
        z = play_sensitivities(path.motor, width, side * width)
        slopes = np.stack([z[:, 1] + side * z[:, 2], width * z[:, 2]])[:, :, None]
        return np.stack([np.ones_like(path.motor), z[:, 0]], axis=1), slopes


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
        columns = [np.ones_like(path.motor), path.motor, slots, path.joint]
        sums = without(products(np.column_stack(columns), path.weight), 1)
        moved = np.abs(weights_of_one_sign(sums, path.direction)[0]) * np.sqrt(np.diag(sums)[:-1])
        active = np.flatnonzero(moved[1:] > 1e-6 * moved.max())
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
