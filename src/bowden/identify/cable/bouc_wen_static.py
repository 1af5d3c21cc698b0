"""Bouc–Wen with a smooth static nonlinearity, whose degrees the fitted part of the log decides.

The richest form is fitted first. With its h held, every other choice of degrees is linear, so that all of them can be
judged on left-out strokes at almost no cost; the choice is then fitted properly.
"""

import numpy as np

from bowden.identify.cable.bouc_wen import SEARCHED, fit_terms
from bowden.identify.cable.family import Array, Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import products
from bowden.identify.cable.validation import folds, simplest_of_the_best
from bowden.plants.predicted import degrees_of

_RICHEST = (7, 2)
_CHOICES = [(static, heights) for static in (2, 3, 5, 7) for heights in (0, 1, 2)]


class BoucWenStatic:
    """Between eight and fifteen parameters: four searched, the others linear."""

    name = "bouc_wen_static"

    def __init__(self, rich: Estimate) -> None:
        """`rich` is the form with all terms, fitted to the same path by `richest`."""
        self._rich = rich

    def fit(self, path: Path) -> Estimate:
        """See `Family.fit`."""
        return fit_terms(path, self._rich.theta, *_choose(path, self._rich))

    def refit(self, path: Path, near: Estimate) -> Estimate:
        """See `Family.refit`."""
        return fit_terms(path, near.theta, *degrees_of(near.parameters), rough=True)


def richest(path: Path, plain: Estimate) -> Estimate:
    """The form with all its terms, roughly fitted from the plain cable's optimum."""
    return fit_terms(path, plain.theta, *_RICHEST, rough=True)


def _choose(path: Path, rich: Estimate) -> tuple[int, int]:
    """The degrees that predict left-out strokes, h held."""
    errors = _judge(path, rich, _CHOICES)
    chosen: tuple[int, int] = simplest_of_the_best(errors, {choice: sum(choice) for choice in errors})
    return chosen


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
