"""Plays fitted to a path: none, which is a line, one, and a stack of them.

The play operator (Eqs 4–5), joint = slope·z + offset, has its half-width and its initial state searched. A jump of the
contact makes the error uneven in the half-width, so a scan of the whole range comes before the search.

The Prandtl–Ishlinskii stack has weights on fixed half-widths, none of them against the cable's direction:

    joint = slope·motor + Σ weight_i·z_i + offset,    all weights of the slope's sign

Weights of one sign keep the stack invertible and its loops dissipative; the fit (non-negative least squares) then
leaves only the few plays that the data need.
"""

import numpy as np

from bowden.core.kernel import compiled, kernel
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import (
    Array,
    Estimate,
    minimise,
    products,
    solve_linear,
    weights_of_one_sign,
    without,
)
from bowden.models.cable.backlash import push
from bowden.plants.predicted import slots_along

_GRID = np.geomspace(2e-3, 0.45, 18)
"""Half-widths of a stack that are offered, over the motor's range [–]."""
LAGS = 0.25 * np.array([-1.0, -0.3, -0.1, 0.0, 0.1, 0.3, 1.0])
"""Where the motor may have come from, over its range."""


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


def fit_line(path: Path, near: Estimate | None = None) -> Estimate:
    """The straight line, a cable without any loss of motion: joint = slope·motor + offset."""
    basis = np.stack([path.motor, np.ones_like(path.motor)], axis=1)
    linear, _ = solve_linear(basis, path.joint, path.weight)
    return Estimate(
        parameters={"slope": float(linear[0]), "offset": float(linear[1])},
        slopes={"slope": basis[:, 0], "offset": basis[:, 1]},
        fitted=basis @ linear,
        theta=np.empty(0),
    )


def fit_play(path: Path, near: Estimate | None = None, thin: Path | None = None) -> Estimate:
    """The play operator: four parameters, two searched, two linear.

    Args:
        path: of the log.
        near: where the search begins; where it is not given, at the best of a scan of the range of half-widths.
        thin: the path, thinned, for that scan; all of it where none is given.
    """
    start = np.empty(0) if near is None else near.theta
    if near is None:
        thin, costs = thin or path, []
        widths = 0.5 * path.span * np.geomspace(1e-3, 0.95, 40)
        starts = [np.array([width, side]) for width in widths for side in (-1.0, 0.0, 1.0)]
        for one in starts:
            basis = _slot(thin, one)[0]
            linear, _ = solve_linear(basis, thin.joint, thin.weight)
            costs.append(float(thin.weight @ (basis @ linear - thin.joint) ** 2))
        start = starts[int(np.argmin(costs))]
    low, high = np.array([0.0, -1.0]), np.array([0.5 * path.span, 1.0])
    theta, linear = minimise(lambda at: _slot(path, at), path.joint, path.weight, start, low, high)
    width, side = theta
    z = play_sensitivities(path.motor, width, side * width)
    offset, slope = linear
    values = {"slope": slope, "half_width": width, "offset": offset, "initial_lag": side * width}
    moved = (z[:, 0], slope * z[:, 1], np.ones_like(path.motor), slope * z[:, 2])
    return Estimate(
        parameters={name: float(value) for name, value in values.items()},
        slopes=dict(zip(values, moved, strict=True)),
        fitted=_slot(path, theta)[0] @ linear,
        theta=theta,
        variance={"initial_lag": path.start_error**2},
    )


def _slot(path: Path, theta: Array) -> tuple[Array, Array]:
    """Φ = [1, z] for θ = (half-width, initial lag over half-width)."""
    width, side = float(theta[0]), float(theta[1])
    z = play_sensitivities(path.motor, width, side * width)
    slopes = np.stack([z[:, 1] + side * z[:, 2], width * z[:, 2]])[:, :, None]
    return np.stack([np.ones_like(path.motor), z[:, 0]], axis=1), slopes


def fit_stack(path: Path, near: Estimate | None = None) -> Estimate:
    """The Prandtl–Ishlinskii stack; where the motor came from is tried, or known from `near`."""
    if near is not None:
        return _stack(path, float(near.theta[0]))
    found = [_stack(path, lag) for lag in LAGS * path.span]
    return found[int(np.argmin([float(path.weight @ (one.fitted - path.joint) ** 2) for one in found]))]


def _stack(path: Path, lag: float) -> Estimate:
    widths = _GRID * path.span
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
