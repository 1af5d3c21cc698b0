"""What is decided inside the fitted part of the log: which model to recommend, and how much its beginning counts.

**The model.** Every stroke is cut into stretches of a twentieth of the motor's range, and the stretches are dealt out
to five folds, in turn along a stroke and shifted from one stroke to the next. Each fold is left out in turn (its nodes
lose their weight; the model is still simulated straight through them), the family is fitted to the rest, and judged on
the fold. A model so has to predict a stretch from those beside it and from the same stretch of other strokes, and not,
as where whole strokes of a short log are left out, a branch from which nothing is left. Of two models that differ by
less than the scatter of their difference the one with fewer parameters is taken, so that a richer model must earn its
place; but never one whose error is a twentieth above the least. A model of which the log does not show every parameter
(or some are at the bounds of their search) gives way to one whose error is as small within a twentieth, and all of
whose parameters are shown; never to free branches, of which no single one is.

The start of a log is never judged, where enough is left without it: a cable settles.

**The beginning.** A cable settles: on its first strokes after a rest it often runs beside the loop on which it stays
afterwards, and it goes on creeping for some cycles. What matters is how a model predicts what comes later. So each of
the later strokes is predicted from those before it, with all of them, without the first or the second long one, and
with weights that halve every two strokes towards the past; what predicts best is taken, and nothing is left out or
weighted for less than a tenth of the error, nor where it makes the strokes of either direction worse. All are judged on
the same strokes.

A log of two cycles has no later strokes to ask. But a cable that was at rest begins beside its loop, and comes to it on
the way: so, where nothing is left out or weighted, what it does on its first way through the range counts by the square
of the share of the range that is behind it, as if its distance from the loop fell with the inverse of that share. A log
begins at rest, or at a turn, where the motor takes longer than usual for the first twentieth of its range.

Source: Hastie, Tibshirani and Friedman, *The Elements of Statistical Learning*, 2009, Section 7.10 (one-standard-error
rule); Roberts et al., Ecography 40(8), 2017 (blocks in cross-validation of what is correlated).
"""

from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import Array, Estimate, products
from bowden.plants.predicted import PREDICTED

_FOLDS, _STRETCHES = 5, 20
_JUDGED = 1_000_000
"""Samples that judge a fold: of a log with twice as many and more, every so many."""
_TWENTIETH = 1.05**2 - 1.0
"""Of the squared error, what a twentieth of the error is."""

Refit = Callable[[Path, Estimate], Estimate]
"""The best member of a family for a path, perhaps another part of the log or with other weights, searched from one."""


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
    families: Mapping[str, Refit],
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
        families: to be judged, by name.
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
    for name, refit in families.items():
        errors = []
        for rest, at, measured, weights in judged:
            member = refit(rest, estimates[name])
            predicted = np.interp(at, nodes, PREDICTED[name](member.parameters, path.motor)[seen])
            errors.append(float(np.average((predicted - measured) ** 2, weights=weights)))
        found[name] = np.array(errors)
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


_HALF_LIFE = 2.0
"""Strokes, one cycle, within which a weight halves."""
_FEWEST = 4
"""Strokes from which the next one is predicted."""
_WHOLE = 0.9
"""Least way of the strokes that are judged, over the motor's range: the sliver of a stroke decides nothing."""
_OF_USE = 0.9**2
"""Share of the squared error that may stay where something is left out or weighted."""


_LEAST_GONE = 0.03
"""Share of the range that counts as behind the motor at the start."""
_FIRST, _LONGER = 0.05, 1.5
"""Share of the range, and how many times as long as usual the motor takes for it from rest; a sine that begins at a
turn takes 2.9 times as long, one that begins in its middle 0.6 times."""


class Settling(NamedTuple):
    """Which strokes are fitted, and how they are weighted."""

    start: int = 0
    """Strokes at the start that are left out."""
    half_life: float = np.inf
    """Strokes within which the weight halves towards the past."""

    def weighted(self, path: Path) -> Path:
        """The path with its start and its past weighted so; as one from rest where neither is decided."""
        if self == Settling():
            return from_rest(path)
        shares = np.where(path.stroke < self.start, 0.0, 0.5 ** ((path.stroke[-1] - path.stroke) / self.half_life))
        return path.with_weight(path.weight * shares)


def from_rest(path: Path) -> Path:
    """The path, its first way through the range weighted as that of a cable that was at rest where it was."""
    if path.strokes < 2:  # no other way says what this one should be like
        return path
    before = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path.turning)))])[path.stroke]
    gone = (before + np.abs(path.motor - path.turning[path.stroke])) / path.span
    usual = _FIRST * (path.time[-1] - path.time[0]) / gone[-1]
    if np.interp(_FIRST, gone, path.time) - path.time[0] < _LONGER * usual:  # it was moving before the log began
        return path
    return path.with_weight(path.weight * np.clip(gone, _LEAST_GONE, 1.0) ** 2)


def settling(path: Path, rich: Estimate) -> Settling:
    """What predicts later strokes best; `rich` is linear in its coordinates and was fitted to all of the path."""
    columns = np.column_stack([*rich.slopes.values(), path.joint])
    blocks = []
    for stroke in range(path.strokes):
        mask = path.stroke == stroke
        blocks.append(products(columns[mask], path.weight[mask]))
    weights = np.bincount(path.stroke, path.weight, path.strokes).astype(np.float64)
    prior = np.zeros((columns.shape[1] - 1,) * 2) if rich.prior is None else rich.prior / weights.sum()
    starts = start_ends(path)
    judged = range(max(_FEWEST, path.strokes // 2, starts[-1] + 1), path.strokes)
    lengths = np.abs(np.diff(path.turning))
    if float(lengths[list(judged)].sum()) < _WHOLE * path.span:
        return Settling()
    best, least, plain = Settling(), np.inf, np.full(2, np.inf)
    for half_life in (np.inf, _HALF_LIFE):
        for start in starts:
            given = Settling(start, half_life)
            errors = _errors(blocks, weights, prior, judged, given)
            ways = np.array([errors[0::2].sum(), errors[1::2].sum()])
            if given == Settling():
                least, plain = float(ways.sum()), ways
            error = float(ways.sum())
            helps = error < _OF_USE * least or (best != Settling() and error < least)
            if helps and (ways <= plain).all():
                best, least = given, error
    return best


def _errors(blocks: list[Array], weights: Array, prior: Array, judged: range, given: Settling) -> Array:
    """Squared error on each judged stroke of what those before it say."""
    sums, weight, fade, errors = np.zeros_like(blocks[0]), 0.0, 0.5 ** (1.0 / given.half_life), []
    for stroke in range(given.start, judged.stop):
        if stroke in judged:
            gram = sums[:-1, :-1] + weight * prior
            small = 1e-12 * float(np.trace(gram)) / len(gram)
            nodes = np.linalg.solve(gram + small * np.eye(len(gram)), sums[:-1, -1])
            own = blocks[stroke]
            errors.append(float(own[-1, -1] - 2.0 * nodes @ own[:-1, -1] + nodes @ own[:-1, :-1] @ nodes))
        sums, weight = fade * sums + blocks[stroke], fade * weight + float(weights[stroke])
    return np.array(errors)
