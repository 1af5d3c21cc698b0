"""How much of a log's beginning still speaks of the cable as it is at the end.

A cable settles: on its first strokes after a rest it often runs beside the loop on which it stays afterwards, and it
goes on creeping for some cycles. What matters is how a model predicts what comes later. So each of the later strokes is
predicted from those before it, with all of them, without the first or the second long one, and with weights that halve
every two strokes towards the past; what predicts best is taken, and nothing is left out or weighted for less than a
tenth of the error, nor where it makes the strokes of either direction worse. All are judged on the same strokes.

A log of two cycles has no later strokes to ask. But a cable that was at rest begins beside its loop, and comes to it on
the way: so, where nothing is left out or weighted, what it does on its first way through the range counts by the square
of the share of the range that is behind it, as if its distance from the loop fell with the inverse of that share. A log
begins at rest, or at a turn, where the motor takes longer than usual for the first twentieth of its range.
"""

from typing import NamedTuple

import numpy as np

from bowden.identify.cable.family import Array, Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import products
from bowden.identify.cable.validation import start_ends

_HALF_LIFE = 2.0
"""Strokes, one cycle, within which a weight halves."""
_FEWEST = 4
"""Strokes from which the next one is predicted."""
_JUDGED = 0.9
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
    if float(lengths[list(judged)].sum()) < _JUDGED * path.span:
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
