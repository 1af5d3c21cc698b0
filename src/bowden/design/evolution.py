"""Differential evolution with constraints: a search that needs no gradient and does not stop at the first hollow.

Members are ranked by Deb's rule (2000): a feasible one before every other, feasible ones by their value, the others by
how much they lack. A trial vector (Zhang and Sanderson's current-to-best, 2009) stands where its parent does no better.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Score = tuple[float, float]
"""What is lacking (0 where it is feasible), and the value; smaller is better, and the first counts first."""
Judge = Callable[[Sequence[Array], Sequence[Score]], Sequence[Score]]
"""Points, and for each the score below which it is of any use → their scores."""

_BEST_SHARE = 6
"""The trial vectors are drawn towards the best of so many parts of the population."""
_CROSSING = 0.9


class Population:
    """Points and their scores, one generation after another."""

    def __init__(self, points: Sequence[Array], scores: Sequence[Score], random: np.random.Generator) -> None:
        self.points, self.scores = list(points), list(scores)
        self._random = random

    def ranked(self) -> list[int]:
        """The members' numbers, the best first."""
        return sorted(range(len(self.points)), key=lambda i: (self.scores[i], i))

    def step(self, judge: Judge, bounds: tuple[float, float]) -> None:
        """One generation: a trial vector for every member, all judged at once."""
        best = self.ranked()[: max(2, len(self.points) // _BEST_SHARE)]
        trials = [self._trial(i, best, bounds) for i in range(len(self.points))]
        for i, (point, score) in enumerate(zip(trials, judge(trials, list(self.scores)), strict=True)):
            if score <= self.scores[i]:
                self.points[i], self.scores[i] = point, score

    def _trial(self, i: int, best: Sequence[int], bounds: tuple[float, float]) -> Array:
        random = self._random
        points, parent = self.points, self.points[i]
        towards = points[best[int(random.integers(len(best)))]]
        one, other = random.choice(len(points), 2, replace=False)
        scale = float(random.uniform(0.4, 0.9))
        mutant = parent + scale * (towards - parent) + scale * (points[one] - points[other])
        taken = random.random(len(parent)) < _CROSSING
        taken[int(random.integers(len(parent)))] = True
        return np.clip(np.where(taken, mutant, parent), *bounds)
