"""By what gains are judged: the margins of their linear loops, then their errors over a set of runs.

Everything that is handed on is plain data, and the functions are at the top of the module, so that other processes can
do the work as well.
"""

from typing import NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.design.check import check, largest_change, linear_points, stands, visited_estimates
from bowden.design.check_result import MOST_PER_COUNT, Check, Estimates
from bowden.design.linearise import linearise
from bowden.design.trial import run_trial
from bowden.design.tune_runs import TuningRuns, TuningTarget, course_of
from bowden.plants.plant import Plant, changed

WANTED_DB, WANTED_DEG = 6.0, 45.0
"""Margins that tuned gains keep."""
_LONGEST_DELAY = 40
"""Cycles of delay for which the poles of many loops are quickly found."""
UNSTABLE = 10.0
"""What an unstable loop lacks, in parts of the margins that are wanted, and its largest pole on top."""


class Task(NamedTuple):
    """One set of gains to judge."""

    rig: TuningTarget
    law: Law
    estimates: tuple[Estimates, ...]
    """At which the linear loops must have their margins."""
    order: tuple[int, ...]
    """Of the runs, the hardest first."""
    limit: float
    """Above which an error need not be known any better [rad]."""
    runs: TuningRuns
    at_once: bool = True
    """True if a run, too, is given up as soon as its error must be above the limit."""


class Judged(NamedTuple):
    """What came of it."""

    shortfall: float
    """0 where the margins are there and nothing chatters, else the largest share that is missing of either."""
    errors: tuple[float, ...]
    """RMSE of each run [rad]; infinite where it is unstable or was given up, 0 where it was not needed any more."""

    @property
    def worst(self) -> float:
        """The largest of the errors; above the limit it says no more than that [rad]."""
        return max(self.errors, default=np.inf)


def judge(task: Task) -> Judged:
    """The margins, where they are wide enough the errors, and where these are small enough the margins on the way."""
    found = judge_apart(task)
    if not found.shortfall and found.worst <= task.limit and found.worst < np.inf:
        return found._replace(shortfall=shortfall_on_the_way(task))
    return found


def judge_apart(task: Task) -> Judged:
    """The margins and, where they are wide enough, the errors: what is missing on the way is not asked."""
    missing = shortfall(task)
    return Judged(missing, ()) if missing else Judged(0.0, errors(task))


def shortfall(task: Task) -> float:
    """The largest share of the wanted margins that is missing over all linear loops, or by which the command jumps too
    far with a count of the joint's encoder; 0 for none. Where no linear loop stands for the law, of the latter alone.
    """
    resolution = task.rig.bench.joint_encoder.resolution or 1e-6
    missing = chatter(task)
    if task.rig.refuted:
        return missing
    bench, rig = _thinned(task.rig.bench), task.rig
    for point in linear_points(bench, task.law, rig.bends, task.estimates, resolution, rig.stroke):
        share = point.margins.share(WANTED_DB, WANTED_DEG)
        missing = max(missing, 1.0 - share if point.margins.stable else UNSTABLE - share)
    return missing


def chatter(task: Task) -> float:
    """By how much one count of the joint's encoder may change the command too far in a cycle; 0 where it does not."""
    bench, count = task.rig.bench, task.rig.bench.joint_encoder.resolution
    if not count:
        return 0.0
    models = [linearise(task.law, bench.sample_time, width=count, estimates=values) for values in task.estimates]
    return max([0.0, *(largest_change(model) * count / MOST_PER_COUNT - 1.0 for model in models)])


def _thinned(bench: Plant) -> Plant:
    """The bench with a slower clock where its delay is many cycles long: each is a state of the loop.

    A loop that such a delay lets live is slow enough for that, and the check of what is found keeps the true clock.
    """
    cycles = -(-bench.delay // _LONGEST_DELAY) or 1
    return changed(bench, sample_time=cycles * bench.sample_time, delay=-(-bench.delay // cycles))


def shortfall_on_the_way(task: Task) -> float:
    """What is missing at the ends of what these gains make of the estimates; all of it where a trial gets nowhere.

    Without linear loops it is what the check asks of such a law: trials with further delay, and one without friction.
    """
    bench, law = task.rig.bench, task.law
    trials = []
    for bend in dict.fromkeys(task.rig.bends):
        trials.append(run_trial(bench, law, bend, task.rig.stroke))
        if not trials[-1].bounded:
            return UNSTABLE
    if task.rig.refuted:
        return 0.0 if stands(bench, law, task.rig.bends[-1], task.rig.stroke) else UNSTABLE
    visited = visited_estimates(law, trials, bench.sample_time)
    ends = [choose(visited, key=lambda values: values[name]) for name in visited[0] for choose in (min, max)]
    different = [values for i, values in enumerate(ends) if values not in [*task.estimates, *ends[:i]]]
    return shortfall(task._replace(estimates=tuple(different)))


def errors(task: Task) -> tuple[float, ...]:
    """RMSE of every run [rad], as far as the limit asks for it."""
    return course_of(task.runs).errors(task.runs.laws(task.law), task.order, task.limit, at_once=task.at_once)


def checked(task: Task) -> Check:
    """The full check."""
    return check(task.rig.bench, task.law, bends=task.rig.bends, stroke=task.rig.stroke)


def keeps(found: Check) -> bool:
    """True if a check says `holds`, finds the wanted margins, and no chatter."""
    gain, phase = found.gain_margin_db, found.phase_margin_deg
    wide = (gain is None or gain >= WANTED_DB) and (phase is None or phase >= WANTED_DEG)
    return found.verdict == "holds" and wide and found.command_per_count <= MOST_PER_COUNT
