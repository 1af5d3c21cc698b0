"""Differential evolution: the global search for a few unknowns within bounds.

A population of candidates lives in the unit cube. In each generation every one of them is challenged by a mixture: of
the best one, moved by a random multiple of the difference of two others, and of itself, coordinate by coordinate; who
costs less stays. All challengers of a generation are judged together.

With the same seed it draws the same numbers as SciPy's `differential_evolution` (best1bin, Latin hypercube, deferred),
and finds the same, which a test compares; to import that takes longer than to search.

Source: Storn and Price, Journal of Global Optimization 11(4), 1997.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CROSSED = 0.7
"""Share of coordinates that a challenger takes from the mixture."""
_WEIGHT = (0.5, 1.0)
"""Between these the weight of the difference is drawn in each generation."""


def evolve(
    costs: Callable[[Array], Array], low: Array, high: Array, seed: int, *, each: int, generations: int, spread: float
) -> Array:
    """The best candidate (k,) that was found.

    Args:
        costs: of candidates (m, k): (m,).
        low: smallest candidate (k,).
        high: largest candidate (k,).
        seed: of the random numbers.
        each: candidates for each unknown.
        generations: at most this many.
        spread: ends the search where the costs' standard deviation is a smaller share of their mean.
    """
    random, count = np.random.default_rng(seed), each * len(low)
    cells = random.uniform(size=(count, len(low))) / count + np.linspace(0.0, 1.0, count, endpoint=False)[:, None]
    people = np.stack([cells[random.permutation(count), j] for j in range(len(low))], axis=1)

    def placed(unit: Array) -> Array:
        return np.asarray(0.5 * (low + high) + (unit - 0.5) * np.abs(low - high))

    cost = costs(placed(people))
    _best_first(people, cost)
    order, everyone = np.arange(count), np.arange(count)
    for _ in range(generations):
        weight = random.uniform(*_WEIGHT)
        pairs = np.empty((count, 2), dtype=np.intp)
        for i in range(count):
            random.shuffle(order)
            first, second, third = order[:3].tolist()
            pairs[i] = (second if first == i else first), (third if i in (first, second) else second)
        mixture = people[0] + weight * (people[pairs[:, 0]] - people[pairs[:, 1]])
        always = random.integers(len(low), size=count)
        crossed = random.uniform(size=people.shape) < _CROSSED
        crossed[everyone, always] = True
        challengers = np.where(crossed, mixture, people)
        outside = (challengers > 1.0) | (challengers < 0.0)
        challengers[outside] = random.uniform(size=np.count_nonzero(outside))
        challenging = costs(placed(challengers))
        better = challenging <= cost
        people, cost = np.where(better[:, None], challengers, people), np.where(better, challenging, cost)
        _best_first(people, cost)
        if np.isfinite(cost).all() and np.std(cost) <= spread * np.abs(np.mean(cost)):
            break
    return placed(people[0])


def _best_first(people: Array, cost: Array) -> None:
    """Put the best candidate into the first place, and what was there in its."""
    best = int(np.argmin(cost))
    people[[0, best]], cost[[0, best]] = people[[best, 0]], cost[[best, 0]]
