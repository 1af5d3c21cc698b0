"""Which model to recommend, decided inside the fitted part of the log.

Every stroke is cut into stretches of a twentieth of the motor's range, and the stretches are dealt out to five folds,
in turn along a stroke and shifted from one stroke to the next. Each fold is left out in turn (its nodes lose their
weight; the model is still simulated straight through them), the family is fitted to the rest, and judged on the fold. A
model so has to predict a stretch from those beside it and from the same stretch of other strokes, and not, as where
whole strokes of a short log are left out, a branch from which nothing is left. Of two models that differ by less than
the scatter of their difference the one with fewer parameters is taken, so that a richer model must earn its place; but
never one whose error is a twentieth above the least. A model of which the log does not show every parameter (or some
are at the bounds of their search) gives way to one whose error is as small within a twentieth, and all of whose
parameters are shown; never to free branches, of which no single one is.

The start of a log is never judged, where enough is left without it: a cable settles (`bowden.identify.cable.settling`).

Source: Hastie, Tibshirani and Friedman, *The Elements of Statistical Learning*, 2009, Section 7.10 (one-standard-error
rule); Roberts et al., Ecography 40(8), 2017 (blocks in cross-validation of what is correlated).
"""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.family import Array, Estimate, Family
from bowden.identify.cable.path import Path
from bowden.plants.predicted import PREDICTED

_FOLDS, _STRETCHES = 5, 20
_JUDGED = 1_000_000
"""Samples that judge a fold: of a log with twice as many and more, every so many."""
_TWENTIETH = 1.05**2 - 1.0
"""Of the squared error, what a twentieth of the error is."""


def start_ends(path: Path) -> list[int]:
    """How many strokes may be left out as the start: none, or up to the end of the first or the second long one.

    A long stroke is at least half the motor's range. At least four strokes must stay.
    """
    lengths = np.abs(np.diff(path.turning))
    ends = [int(k) + 1 for k in np.flatnonzero(lengths >= 0.5 * path.span)[:2]]
    return [0] + [end for end in ends if path.strokes - end >= 4]


def fold_of(path: Path) -> NDArray[np.int64]:
    """The fold that judges each node (n,); −1 where none does."""
    judged = (path.weight > 0) & (path.stroke >= start_ends(path)[-1])
    place = (path.motor - np.min(path.turning)) / max(path.span, 1e-300)
    stretch = np.clip(_STRETCHES * place, 0, _STRETCHES - 1).astype(np.int64)
    dealt = (stretch + 2 * (path.stroke % 2) + path.stroke // 2) % _FOLDS  # both directions shift from cycle to cycle
    return np.where(judged, dealt, -1)


def folds(path: Path) -> list[NDArray[np.bool_]]:
    """Masks (n,) of the nodes judged together."""
    fold = fold_of(path)
    return [fold == one for one in range(_FOLDS) if (fold == one).any()]


def left_out_errors(
    families: Iterable[Family],
    estimates: Mapping[str, Estimate],
    thin: Path,
    path: Path,
    counted: Array,
    time: Array,
    joint: Array,
) -> dict[str, Array]:
    """Mean squared error of every family on each left-out fold (folds,), fitted without it [rad²].

    They are fitted to the thinned path, and judged at the log's full rate: what averages the samples round a corner of
    the loop is not better on the samples themselves.

    Args:
        families: to be judged.
        estimates: their members for all of the path, by name.
        thin: the same motion, on which they are fitted without a fold.
        path: along which the joint is predicted.
        counted: how much each of its nodes counts (n,) [–].
        time: of the log's samples, on which they are judged (m,) [s].
        joint: recorded then (m,) [rad].
    """
    fold, seen, every = fold_of(path), path.weight > 0, max(1, len(time) // _JUDGED)
    time, joint, nodes, stroke = time[::every], joint[::every], path.time[seen], path.stroke[seen]
    after = np.searchsorted(nodes, time).clip(1, len(nodes) - 1)
    own = np.where((stroke[after - 1] == stroke[after]) & (time <= nodes[-1]), fold[seen][after], -1)
    thinned, judged = fold_of(thin), []
    for one in range(_FOLDS):
        mine = own == one  # of strokes that were read
        if mine.any() and (thinned == one).any():
            rest = thin.with_weight(np.where(thinned == one, 0.0, thin.weight))
            judged.append((rest, time[mine], joint[mine], np.interp(time[mine], path.time, counted)))
    found: dict[str, Array] = {}
    for family in families:
        errors = []
        for rest, at, measured, weights in judged:
            member = family.refit(rest, estimates[family.name])
            predicted = np.interp(at, nodes, PREDICTED[family.name](member.parameters, path.motor)[seen])
            errors.append(float(np.average((predicted - measured) ** 2, weights=weights)))
        found[family.name] = np.array(errors)
    return found


def simplest_of_the_best(
    errors: Mapping[Any, Array],
    complexity: Mapping[Any, int],
    unseen: Collection[Any] = (),
    trading: Collection[Any] = (),
) -> Any:
    """The key with the fewest parameters whose error is not clearly above the smallest.

    Clearly: the mean over the blocks of its difference to the best is more than one standard error of that mean, and
    more than a twentieth of the smallest squared error, below which a difference is of no use; or more than a twentieth
    in the root mean square, whatever the scatter.

    Args:
        errors: mean squared error of each on the blocks (folds,) [rad²].
        complexity: how many parameters each has.
        unseen: those of which not every parameter is shown; one of the others goes before, where its error is not more
            than a twentieth above the chosen one's.
        trading: those whose parameters trade with one another, so that none is shown by itself: they never go before.

    >>> best, near, far = np.array([1.0, 2.0, 3.0]), np.array([1.2, 1.9, 3.1]), np.array([2.0, 3.1, 4.0])
    >>> simplest_of_the_best({"c": best, "b": near, "a": far}, {"a": 1, "b": 2, "c": 3})
    'b'
    """
    best = min(errors, key=lambda key: float(np.mean(errors[key])))
    for key in sorted(errors, key=lambda key: complexity[key]):
        above = errors[key] - errors[best]
        scatter = float(np.std(above, ddof=1)) / np.sqrt(len(above)) if len(above) > 1 else 0.0
        least = float(np.mean(errors[best]))
        if float(np.mean(above)) <= min(max(scatter, 0.05 * least), _TWENTIETH * least):
            break
    else:
        key = best
    if key in unseen:
        most = (1.0 + _TWENTIETH) * float(np.mean(errors[key]))
        shown = [one for one in errors if one not in {*unseen, *trading} and float(np.mean(errors[one])) <= most]
        key = min(shown, key=lambda one: complexity[one], default=key)
    return key
