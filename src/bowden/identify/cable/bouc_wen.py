"""The Bouc–Wen cable (Eqs 6–7) fitted to a path, alone or with a smooth static nonlinearity.

    joint = slope·motor + offset + Σ static_k·T_k(u) + (hysteresis_gain + Σ hysteresis_gain_k·T_k(u))·h

u runs from −1 to 1 over the motor's range in the fitted part. The Chebyshev polynomials T_k bend the mean line
(k = 2 … ) and let the height of the loop vary over the stroke (k = 1 … ); the plain cable has neither. Everything but
ρ, σ, n and h(0) is linear and solved exactly. Outside the fitted range a static term goes on along its tangent, and the
loop keeps its height.

A cable that runs backwards has a negative slope and then a positive hysteresis_gain: Eq. 6 is linear in both, so the
loop's shape (ρ, σ, n) is the same.
"""

import numpy as np

from bowden.identify.cable.bouc_wen_search import bounds, cable_at, search
from bowden.identify.cable.family import Array, Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import minimise
from bowden.models.cable.bouc_wen import BoucWen, slope_of_h
from bowden.models.cable.bouc_wen_sensitivity import sensitivities
from bowden.plants.predicted import chebyshev

SEARCHED = ("rate", "shape", "exponent", "initial_h")
"""The parameters that are not linear."""


class BoucWenCable:
    """Seven parameters: four searched, three linear."""

    name = "bouc_wen"

    def __init__(self, thin: Path, seed: int) -> None:
        """`thin` is the path, thinned, on which the global stage runs; `seed` is that stage's."""
        self._thin, self._seed = thin, seed

    def fit(self, path: Path) -> Estimate:
        """See `Family.fit`."""
        return fit_terms(path, search(self._thin, self._seed), 1, 0)

    def refit(self, path: Path, near: Estimate) -> Estimate:
        """See `Family.refit`."""
        return fit_terms(path, near.theta, 1, 0, rough=True)


def at_bound(path: Path, theta: Array) -> list[str]:
    """Which of ρ, σ and n the search left at the edge of its range: there the data ask for more than it offers, and
    the curvature of the error says nothing about how far."""
    low, high = bounds(path.span)
    near = np.minimum(theta - low, high - theta) < 1e-3 * (high - low)
    return [name for name, close in zip(SEARCHED[:3], near[:3], strict=True) if close]


def fit_terms(path: Path, start: Array, static: int, heights: int, *, rough: bool = False) -> Estimate:
    """The gradient stage from θ = `start`, with static terms to degree `static` and a loop height to `heights`."""
    fitted = path.motor[path.weight > 0]
    centre, half_range = 0.5 * float(fitted.max() + fitted.min()), 0.5 * float(np.ptp(fitted))
    u = (path.motor - centre) / half_range
    plain = [path.motor, np.ones_like(u)] + [chebyshev(u, k) for k in range(2, static + 1)]
    looped = [np.ones_like(u)] + [chebyshev(np.clip(u, -1.0, 1.0), k) for k in range(1, heights + 1)]
    fixed, height = np.stack(plain, axis=1), np.stack(looped, axis=1)

    def basis(theta: Array) -> tuple[Array, Array]:
        cable, initial, change = cable_at(theta)
        found = sensitivities(path.motor, initial, cable)
        by_theta = np.einsum("na,ak->kn", found[:, 1:], change)
        return np.concatenate([fixed, height * found[:, :1]], axis=1), by_theta[:, :, None] * height

    low, high = bounds(path.span)
    found = minimise(basis, path.joint, path.weight, start, low, high, rough)
    cable, initial, _ = cable_at(found.theta)
    h = sensitivities(path.motor, initial, cable)
    gains = np.einsum("np,p->n", height, found.linear[fixed.shape[1] :])
    names = ["slope", "offset"] + [f"static_{k}" for k in range(2, static + 1)]
    names += ["hysteresis_gain"] + [f"hysteresis_gain_{k}" for k in range(1, heights + 1)]
    columns = np.concatenate([fixed, height * h[:, :1]], axis=1)
    values = dict(zip(names, map(float, found.linear), strict=True))
    values |= dict(zip(SEARCHED, (cable.rate, cable.shape, cable.exponent, initial), strict=True))
    if static > 1 or heights > 0:
        values |= {"static_centre": centre, "static_half_range": half_range}
    slopes = {name: columns[:, i] for i, name in enumerate(names)}
    slopes |= {name: gains * h[:, i] for i, name in enumerate(SEARCHED, start=1)}
    order = [name for name in (*BoucWen._fields, "initial_h") if name in values]
    order += [name for name in values if name not in order]
    forward = 1.0 if len(path.turning) < 2 or path.turning[1] >= path.turning[0] else -1.0
    steepness = float(slope_of_h(initial, forward, cable))
    return Estimate(
        parameters={name: values[name] for name in order},
        slopes=slopes,
        fitted=np.einsum("np,p->n", columns, found.linear),
        theta=found.theta,
        variance={"initial_h": (steepness * path.start_error) ** 2}
        | dict.fromkeys(at_bound(path, found.theta), np.inf),
    )
