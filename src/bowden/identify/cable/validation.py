"""Which model to recommend, decided inside the fitted part of the log.

The fitted part is cut into blocks of following strokes. Each block is left out in turn (its nodes lose their weight;
the model is still simulated straight through it), the family is fitted to the rest, and judged on the block. Of two
models that differ by less than the scatter of their difference the one with fewer parameters is taken, so that a richer
model must earn its place.

A cable settles: on its first strokes after a rest it often runs beside the loop on which it stays afterwards. What
matters is how a model predicts what comes later, so the start of the log is fitted but never judged; and if leaving it
out of the fit predicts the later strokes better, by the same rule, it is left out.

Source: Hastie, Tibshirani and Friedman, *The Elements of Statistical Learning*, 2009, Section 7.10 (one-standard-error
rule).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.order import distinct
from bowden.identify.cable.family import Array, Estimate, Family
from bowden.identify.cable.path import Path

_FOLDS = 5


def start_ends(path: Path) -> list[int]:
    """How many strokes may be left out as the start: none, or up to the end of the first or the second long one.

    A long stroke is at least half the motor's range. At least four strokes must stay.
    """
    lengths = np.abs(np.diff(path.turning))
    ends = [int(k) + 1 for k in np.flatnonzero(lengths >= 0.5 * path.span)[:2]]
    return [0] + [end for end in ends if path.strokes - end >= 4]


def folds(path: Path) -> list[NDArray[np.bool_]]:
    """Masks (n,) of the nodes judged together: following strokes, or stretches where there are too few strokes."""
    start = start_ends(path)[-1]
    judged = (path.weight > 0) & (path.stroke >= start)
    strokes = distinct(path.stroke[judged])
    if len(strokes) >= 4:
        return [
            (path.stroke >= group[0]) & (path.stroke <= group[-1]) & judged
            for group in np.array_split(strokes, min(_FOLDS, len(strokes)))
        ]
    found = [np.zeros(len(path.stroke), dtype=np.bool_) for _ in range(_FOLDS)]
    for mask, block in zip(found, np.array_split(np.flatnonzero(judged), _FOLDS), strict=True):
        mask[block] = True
    return found


def without_start(path: Path, strokes: int) -> Path:
    """The path with its first strokes simulated, but not fitted."""
    return path.with_weight(np.where(path.stroke < strokes, 0.0, path.weight))


def held_out_errors(family: Family, path: Path, near: Estimate, masks: Sequence[NDArray[np.bool_]]) -> Array:
    """Mean squared error of each left-out block (folds,) [rad²]."""
    return np.array([_held_out(family, path, near, mask) for mask in masks])


def _held_out(family: Family, path: Path, near: Estimate, mask: NDArray[np.bool_]) -> float:
    kept = np.where(mask, 0.0, path.weight)
    fitted = family.refit(path.with_weight(kept), near).fitted
    return float(np.average((fitted - path.joint)[mask] ** 2, weights=path.weight[mask]))


def simplest_of_the_best(errors: Mapping[Any, Array], complexity: Mapping[Any, int]) -> Any:
    """The key with the fewest parameters whose error is not clearly above the smallest.

    Clearly: the mean over the blocks of its difference to the best is more than one standard error of that mean, and
    more than a twentieth of the smallest error, below which a difference is of no use.

    >>> best, near, far = np.array([1.0, 2.0, 3.0]), np.array([1.2, 1.9, 3.1]), np.array([2.0, 3.1, 4.0])
    >>> simplest_of_the_best({"c": best, "b": near, "a": far}, {"a": 1, "b": 2, "c": 3})
    'b'
    """
    best = min(errors, key=lambda key: float(np.mean(errors[key])))
    for key in sorted(errors, key=lambda key: complexity[key]):
        above = errors[key] - errors[best]
        scatter = float(np.std(above, ddof=1)) / np.sqrt(len(above)) if len(above) > 1 else 0.0
        if float(np.mean(above)) <= max(scatter, 0.05 * float(np.mean(errors[best]))):
            return key
    return best
