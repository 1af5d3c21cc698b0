"""Runs on which one set of gains after the other is tried: what they are given over time is made once.

Gains that are worse than a bound are given up on at the first run that shows it, and in the midst of that.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.control.source import TABLE
from bowden.core.nested import form_of, numbers_of
from bowden.sim.batch import FIGURES, BatchLimits, One
from bowden.sim.many import Case, Given, Ready

_RMSE, _ENDED = list(FIGURES).index("rmse"), list(FIGURES).index("ended")


class _Place(NamedTuple):
    """Where a run stands."""

    given: Given
    """Shared by the runs that one compiled call can take."""
    row: int
    """Among the given."""
    one: One
    """Without gains and conditioning."""
    numbers: list[float]
    """Of it; those of gains and conditioning come before them."""


class Course:
    """The runs.

    Args:
        cases: each without a law.
        duration: of each run [s].

    Raises:
        ParameterError: a duration or setting that cannot be.
    """

    def __init__(self, cases: Sequence[Case], duration: float) -> None:
        found: list[Ready] = []
        for case in cases:
            found.append(Ready(case, duration, found[-1] if found else None))
        groups: dict[object, list[int]] = {}
        ones = [ready.one((), (), TABLE) for ready in found]
        for i, one in enumerate(ones):
            groups.setdefault((one.dt, cases[i].fault is None, form_of(one)), []).append(i)
        self._places: dict[int, _Place] = {}
        for members in groups.values():
            given = Given([found[i] for i in members])
            for row, i in enumerate(members):
                self._places[i] = _Place(given, row, ones[i], numbers_of(ones[i]))
        self.spans = tuple(float(np.std(ready.reference[0])) for ready in found)
        """RMSE of each run for a joint that rests in the middle of what is asked of it [rad]."""

    def errors(
        self, laws: Sequence[Law], order: Sequence[int] = (), limit: float = np.inf, *, at_once: bool = True
    ) -> tuple[float, ...]:
        """RMSE of every run from rest [rad], as far as the limit asks for it.

        Args:
            laws: for each run its own, all of the same kernels.
            order: of the runs; as they stand if it is empty.
            limit: an error above it need not be known, and what comes after it is not run [rad].
            at_once: whether a run, too, is given up as soon as its error must be larger.

        Returns:
            For each run its RMSE; infinite where it did not end, or was given up, and 0 where it was not run.
        """
        found, limits = [0.0] * len(self._places), BatchLimits(float(limit), at_once)
        wanted = order or range(len(found))
        for _, part in itertools.groupby(wanted, key=lambda i: (id(self._places[i].given), form_of(laws[i].gains))):
            runs = list(part)
            places = [self._places[i] for i in runs]
            given, law = places[0].given, laws[runs[0]]
            numbers = np.array(
                [
                    [*numbers_of(laws[i].gains), *numbers_of(laws[i].conditioning), *place.numbers]
                    for i, place in zip(runs, places, strict=True)
                ]
            )
            figures = np.empty((len(runs), len(FIGURES)))
            rows = given.rows[[place.row for place in places]]
            like = places[0].one._replace(gains=law.gains, conditioning=law.conditioning)
            given.run(law, TABLE, like, numbers, rows, limits, figures)
            for i, row in zip(runs, figures, strict=True):
                if np.isnan(row[0]):
                    break
                found[i] = float(row[_RMSE]) if row[_ENDED] > 0.0 else np.inf
            if max(found) > limit:
                break
        return tuple(found)
