"""The runs by which gains are judged: nine on the rig itself, or others that are handed in."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.models.cable.sheath_path import BendPath, constant_bend, scripted_bend
from bowden.plants.plant import Plant
from bowden.sim.many import Course
from bowden.sim.run import Case

RUN = 20.0
"""Length of one simulation [s]."""
_TIMES = (0.0, 2.0, 3.0, 4.0, 5.5, 7.0, 8.0, 10.0, 11.0, 13.0, 14.0, 15.5, 17.0, 18.0, 20.0)
_SHARES = (0.0, 0.6, 0.6, 0.4, 0.9, 0.5, 0.5, 1.0, 0.7, 0.1, 0.1, 0.5, 0.2, 0.4, 0.4)
"""When the third motion is where [s], as a share of the stroke: reversals large and small, slow and fast, and rests."""


class TuningRuns(Protocol):
    """Closed loops whose errors count. Plain data: other processes are handed it, and what it makes is kept by it."""

    @property
    def duration(self) -> float:
        """Of each run [s]."""

    @property
    def described(self) -> str:
        """What they are, in words."""

    def cases(self) -> Sequence[Case]:
        """Each run with all that happens to it, but for the law."""

    def laws(self, law: Law) -> Sequence[Law]:
        """The law as it is in each run."""

    def __hash__(self) -> int:
        """Runs with the same name share what they are given over time."""


class TuningTarget(NamedTuple):
    """For what gains are sought."""

    bench: Plant
    bends: tuple[float, float]
    """Smallest and largest total bend [rad]."""
    stroke: tuple[float, float]
    """Ends of the motions [rad]."""
    refuted: bool = False
    """True if no linear loop stands for the law (`bowden.design.check.Check.refuted`), so that trials alone count."""


class NineRuns(NamedTuple):
    """Runs of 20 s on the rig as it is, from rest where the reference starts: those of `runs_of`, three of one bend."""

    rig: TuningTarget

    @property
    def duration(self) -> float:
        """[s]"""
        return RUN

    @property
    def described(self) -> str:
        """See `TuningRuns`."""
        count = "nine" if self.rig.bends[0] < self.rig.bends[1] else "three"
        return f"{count} runs of {RUN:g} s"

    def cases(self) -> Sequence[Case]:
        """See `TuningRuns`."""
        bench = self.rig.bench
        found = []
        for reference, path in runs_of(self.rig.bends, self.rig.stroke):
            begin = float(reference.sample(np.zeros(1))[0, 0])
            start = bench.resting_motor(begin, float(path(np.zeros(1))[0]))
            found.append(Case(bench, (), reference, path, 3, start))
        return found

    def laws(self, law: Law) -> Sequence[Law]:
        """See `TuningRuns`."""
        return (law,) * len(runs_of(self.rig.bends, self.rig.stroke))


@lru_cache(2)
def course_of(runs: TuningRuns) -> Course:
    """The runs, ready for many gains."""
    return Course(runs.cases(), runs.duration)


@lru_cache(8)
def runs_of(bends: tuple[float, float], stroke: tuple[float, float]) -> tuple[tuple[Trajectory, BendPath], ...]:
    """Minimum jerk of 4 and of 10 s, and strokes with rests; each with the sheath straight, bent, and moved."""
    paths = [constant_bend(bend) for bend in dict.fromkeys(bends)]
    if bends[0] < bends[1]:
        paths.append(scripted_bend((5.0, 10.0, 15.0), (bends[0], bends[1], bends[0])))
    return tuple((reference, path) for path in paths for reference in references_of(stroke))


def references_of(stroke: tuple[float, float]) -> tuple[Trajectory, ...]:
    """Minimum jerk of 4 and of 10 s, and strokes with rests, over a stroke [rad]."""
    low, high = stroke
    return (
        PeriodicMinimumJerk(low, high, 4.0),
        PeriodicMinimumJerk(low, high, 10.0),
        PointToPoint(_TIMES, tuple(low + (high - low) * share for share in _SHARES)),
    )
