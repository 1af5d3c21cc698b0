"""The Bouc–Wen cable (Eqs 6–7) fitted to a path, alone or with a smooth static nonlinearity.

    joint = slope·motor + offset + Σ static_k·T_k(u) + (hysteresis_gain + Σ hysteresis_gain_k·T_k(u))·h

u runs from −1 to 1 over the motor's range in the fitted part. The Chebyshev polynomials T_k bend the mean line
(k = 2 … ) and let the height of the loop vary over the stroke (k = 1 … ); the plain cable has neither. Everything but
ρ, σ, n and h(0) is linear and solved exactly. Outside the fitted range a static term goes on along its tangent, and the
loop keeps its height.

A cable that runs backwards has a negative slope and then a positive hysteresis_gain: Eq. 6 is linear in both, so the
loop's shape (ρ, σ, n) is the same.

The fitted part of the log decides the degrees. The richest form is fitted first. With its h held, every other choice
is linear, so that all of them can be judged on left-out strokes at almost no cost; the choice is then fitted properly.
"""

import numpy as np

from bowden.identify.cable.bouc_wen_search import bounds, cable_at, search
from bowden.identify.cable.family import Array, Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import minimise, products
from bowden.identify.cable.validation import folds, simplest_of_the_best
from bowden.models.cable.bouc_wen import BoucWen, slope_of_h
from bowden.models.cable.bouc_wen_sensitivity import sensitivities
from bowden.plants.predicted import chebyshev, degrees_of

SEARCHED = ("rate", "shape", "exponent", "initial_h")
"""The parameters that are not linear."""
_RICHEST = (7, 2)
_CHOICES = [(static, heights) for static in (2, 3, 5, 7) for heights in (0, 1, 2)]


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
    theta, linear = minimise(basis, path.joint, path.weight, start, low, high, rough)
    cable, initial, _ = cable_at(theta)
    h = sensitivities(path.motor, initial, cable)
    gains = np.einsum("np,p->n", height, linear[fixed.shape[1] :])
    names = ["slope", "offset"] + [f"static_{k}" for k in range(2, static + 1)]
    names += ["hysteresis_gain"] + [f"hysteresis_gain_{k}" for k in range(1, heights + 1)]
    columns = np.concatenate([fixed, height * h[:, :1]], axis=1)
    values = dict(zip(names, map(float, linear), strict=True))
    values |= dict(zip(SEARCHED, (cable.rate, cable.shape, cable.exponent, initial), strict=True))
    if static > 1 or heights > 0:
        values |= {"static_centre": centre, "static_half_range": half_range}
    slopes = {name: columns[:, i] for i, name in enumerate(names)}
    slopes |= {name: gains * h[:, i] for i, name in enumerate(SEARCHED, start=1)}
    order = [name for name in (*BoucWen._fields, "initial_h") if name in values]
    order += [name for name in values if name not in order]
    forward = 1.0 if len(path.turning) < 2 or path.turning[1] >= path.turning[0] else -1.0
    at_edge = np.minimum(theta - low, high - theta) < 1e-3 * (high - low)
    steepness = float(slope_of_h(initial, forward, cable))
    return Estimate(
        parameters={name: values[name] for name in order},
        slopes=slopes,
        fitted=np.einsum("np,p->n", columns, linear),
        theta=theta,
        # at an edge the data ask for more than the search offers, and the error's curvature does not say how far
        variance={"initial_h": (steepness * path.start_error) ** 2}
        | {name: np.inf for name, close in zip(SEARCHED[:3], at_edge[:3], strict=True) if close},
    )


class BoucWenStatic:
    """Between eight and fifteen parameters: four searched, the others linear."""

    name = "bouc_wen_static"

    def __init__(self, plain: Estimate) -> None:
        """`plain` is the plain cable, fitted to the same path."""
        self._plain = plain

    def fit(self, path: Path) -> Estimate:
        """See `Family.fit`."""
        rich = fit_terms(path, self._plain.theta, *_RICHEST, rough=True)
        errors = _judge(path, rich, _CHOICES)
        return fit_terms(path, rich.theta, *simplest_of_the_best(errors, {choice: sum(choice) for choice in errors}))

    def refit(self, path: Path, near: Estimate) -> Estimate:
        """See `Family.refit`."""
        return fit_terms(path, near.theta, *degrees_of(near.parameters), rough=True)


def _judge(path: Path, rich: Estimate, choices: list[tuple[int, int]]) -> dict[tuple[int, int], Array]:
    """For each choice of degrees the mean squared error of each fold (folds,), fitted without it."""
    names = [name for name in rich.slopes if name not in SEARCHED]
    columns = np.stack([*(rich.slopes[name] for name in names), path.joint], axis=1)
    total = products(columns, path.weight)
    masks = folds(path)
    blocks = [products(columns[mask], path.weight[mask]) for mask in masks]
    counts = [float(path.weight[mask].sum()) for mask in masks]
    errors: dict[tuple[int, int], Array] = {}
    for static, heights in choices:
        wanted = {"slope", "offset", "hysteresis_gain"} | {f"static_{k}" for k in range(2, static + 1)}
        wanted |= {f"hysteresis_gain_{k}" for k in range(1, heights + 1)}
        chosen = [i for i, name in enumerate(names) if name in wanted]
        errors[static, heights] = np.array(
            [_left_out(total - block, block, chosen) / count for block, count in zip(blocks, counts, strict=True)]
        )
    return errors


def _left_out(fitted: Array, judged: Array, chosen: list[int]) -> float:
    """Squared error on `judged` of the coefficients that solve `fitted`; both are Gram matrices, the joint last."""
    size = np.sqrt(np.maximum(np.diag(fitted)[chosen], 1e-300))
    gram = fitted[np.ix_(chosen, chosen)] / np.outer(size, size)
    linear = np.linalg.lstsq(gram, fitted[chosen, -1] / size, rcond=1e-13)[0] / size
    error = judged[-1, -1] - 2.0 * linear @ judged[chosen, -1] + linear @ judged[np.ix_(chosen, chosen)] @ linear
    return max(float(error), 0.0)
