"""By what gains are judged: the margins of their linear loops, then their errors over a set of runs.

Everything that is handed on is plain data, and the functions are at the top of the module, so that other processes can
do the work as well.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.design.check import Check, Estimates, check, linear_points, visited_estimates
from bowden.design.trial import run_trial, slope_at
from bowden.sim.closed_loop import simulate
from bowden.sim.plant import Bench
from bowden.sim.scenario import BendPath, constant_bend, scripted_bend

Array = NDArray[np.float64]

WANTED_DB, WANTED_DEG = 6.0, 45.0
"""Margins that tuned gains keep."""
_RUN = 20.0
"""Length of one simulation [s]."""
_TIMES = (0.0, 2.0, 3.0, 4.0, 5.5, 7.0, 8.0, 10.0, 11.0, 13.0, 14.0, 15.5, 17.0, 18.0, 20.0)
_SHARES = (0.0, 0.6, 0.6, 0.4, 0.9, 0.5, 0.5, 1.0, 0.7, 0.1, 0.1, 0.5, 0.2, 0.4, 0.4)
"""When the third motion is where [s], as a share of the stroke: reversals large and small, slow and fast, and rests."""
_LONGEST_DELAY = 40
"""Cycles of delay for which the poles of many loops are quickly found."""
_UNSTABLE = 10.0
"""What an unstable loop lacks, in parts of the margins that are wanted, and its largest pole on top."""


class Rig(NamedTuple):
    """For what gains are sought."""

    bench: Bench
    bends: tuple[float, float]
    """Smallest and largest total bend [rad]."""
    stroke: tuple[float, float]
    """Ends of the motions [rad]."""


class Task(NamedTuple):
    """One set of gains to judge."""

    rig: Rig
    law: Law
    estimates: tuple[Estimates, ...]
    """At which the linear loops must have their margins."""
    order: tuple[int, ...]
    """Of the runs, the hardest first."""
    limit: float
    """Above which an error need not be known any better [rad]."""


class Judged(NamedTuple):
    """What came of it."""

    lack: float
    """0 where the margins are there, else the largest share of them that is missing."""
    errors: tuple[float, ...]
    """RMSE of each run [rad]; infinite where it is unstable, 0 where it was not needed any more."""

    @property
    def worst(self) -> float:
        """The largest of the errors; above the limit no more than a bound from below [rad]."""
        return max(self.errors, default=np.inf)


def judge(task: Task) -> Judged:
    """The margins, where they are wide enough the errors, and where these are small enough the margins on the way."""
    missing = lack(task)
    if missing:
        return Judged(missing, ())
    found = Judged(0.0, errors(task))
    return found._replace(lack=_lack_on_the_way(task)) if found.worst <= task.limit and found.worst < np.inf else found


def lack(task: Task) -> float:
    """The largest share of the wanted margins that is missing over all linear loops; 0 for none."""
    resolution = task.rig.bench.joint_encoder.resolution or 1e-6
    missing = 0.0
    for point in linear_points(_thinned(task.rig.bench), task.law, task.rig.bends, task.estimates, resolution):
        found = point.margins
        if not found.stable:
            missing = max(missing, _UNSTABLE + found.largest_pole)
        if found.gain_margin_db is not None:
            missing = max(missing, 1.0 - found.gain_margin_db / WANTED_DB)
        if found.phase_margin_deg is not None:
            missing = max(missing, 1.0 - found.phase_margin_deg / WANTED_DEG)
    return missing


def _thinned(bench: Bench) -> Bench:
    """The bench with a slower clock where its delay is many cycles long: each is a state of the loop.

    A loop that such a delay lets live is slow enough for that, and the check of what is found keeps the true clock.
    """
    cycles = -(-bench.delay // _LONGEST_DELAY) or 1
    return bench._replace(sample_time=cycles * bench.sample_time, delay=-(-bench.delay // cycles))


def _lack_on_the_way(task: Task) -> float:
    """What is missing at the ends of what these gains make of the estimates; all of it where a trial gets nowhere."""
    bench, law = task.rig.bench, task.law
    trials = [run_trial(bench, law, bend, task.rig.stroke) for bend in dict.fromkeys(task.rig.bends)]
    if not all(trial.bounded for trial in trials):
        return _UNSTABLE
    visited = visited_estimates(law, trials, bench.sample_time)
    ends = [choose(visited, key=lambda values: values[name]) for name in visited[0] for choose in (min, max)]
    different = [values for i, values in enumerate(ends) if values not in [*task.estimates, *ends[:i]]]
    return lack(task._replace(estimates=tuple(different)))


def errors(task: Task) -> tuple[float, ...]:
    """RMSE of every run [rad], as far as the limit asks for it."""
    runs = runs_of(task.rig.bends, task.rig.stroke)
    found = [0.0] * len(runs)
    for i in task.order or range(len(runs)):
        found[i] = rmse(task.rig.bench, task.law, *runs[i])
        if found[i] > task.limit:
            break
    return tuple(found)


def checked(task: Task) -> Check:
    """The full check."""
    return check(task.rig.bench, task.law, bends=task.rig.bends, stroke=task.rig.stroke)


def keeps(found: Check) -> bool:
    """Whether a check says `holds` and finds the wanted margins."""
    gain, phase = found.gain_margin_db, found.phase_margin_deg
    wide = (gain is None or gain >= WANTED_DB) and (phase is None or phase >= WANTED_DEG)
    return found.verdict == "holds" and wide


def rmse(bench: Bench, law: Law, reference: Trajectory, path: BendPath) -> float:
    """Of one run of 20 s, from rest where the reference starts [rad]; infinite where it is unstable."""
    start = float(reference.sample(np.zeros(1))[0, 0] - bench.cable.offset) / slope_at(
        bench, float(path(np.zeros(1))[0])
    )
    trace = simulate(bench, law, reference, duration=_RUN, bend=path, seed=3, initial_motor=start)
    error = trace.columns["joint"] - trace.columns["reference"]
    return float(np.sqrt(np.mean(error**2))) if trace.stable else np.inf


@lru_cache(8)
def runs_of(bends: tuple[float, float], stroke: tuple[float, float]) -> tuple[tuple[Trajectory, BendPath], ...]:
    """Minimum jerk of 4 and of 10 s, and strokes with rests; each with the sheath straight, bent, and moved."""
    low, high = stroke
    span = high - low
    paths = [constant_bend(bend) for bend in dict.fromkeys(bends)]
    if bends[0] < bends[1]:
        paths.append(scripted_bend((5.0, 10.0, 15.0), (bends[0], bends[1], bends[0])))
    references: Sequence[Trajectory] = (
        PeriodicMinimumJerk(low, high, 4.0),
        PeriodicMinimumJerk(low, high, 10.0),
        PointToPoint(_TIMES, tuple(low + span * share for share in _SHARES)),
    )
    kept = [_Kept(reference) for reference in references]
    return tuple((reference, path) for path in paths for reference in kept)


def standing_still(bends: tuple[float, float], stroke: tuple[float, float]) -> Array:
    """RMSE of each run for a joint that rests in the middle of what is asked of it [rad]."""
    time = np.arange(0.0, _RUN, 0.01)
    return np.array([np.std(reference.sample(time)[:, 0]) for reference, _ in runs_of(bends, stroke)])


class _Kept:
    """A trajectory that keeps its last samples, since every law is asked to follow the same ones."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self._times, self._samples = np.empty(0), np.empty((0, 3))

    def sample(self, time: Array) -> Array:
        """Position, velocity, acceleration (n, 3)."""
        if len(time) == 1:
            return self._trajectory.sample(time)
        if not np.array_equal(time, self._times):
            self._times, self._samples = time, self._trajectory.sample(time)
        return self._samples

    def describe(self) -> dict[str, Any]:
        """Kind and parameters."""
        return self._trajectory.describe()
