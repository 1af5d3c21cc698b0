"""Gains for both motors of a pair: found for each motor and its cable, judged on the joint that they share.

The loop of two like sides is that of one side with the slope 2k·σ/(2k + s) (`bowden.design.pair_loops`), which is σ but
for the load's spring s. So gains that keep their margins on one motor's cable are what there is to begin with, and a
search on the pair itself would look where the other has looked, at twice the price. What differs (the other cable, the
bends of both, the motors that may part) is judged on the pair: the margins of both commands together, the trials, and
the error over runs of both.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.design.check import Check
from bowden.design.pair_check import Laws, at_bends, check_pair
from bowden.design.tune import NoGainsError
from bowden.design.tune_judge import keeps
from bowden.design.tune_runs import RUN, references_of
from bowden.records.metrics import rmse
from bowden.sim.pair import PairPlant, simulate_pair
from bowden.sim.parting import Range


class PairTarget(NamedTuple):
    """For what gains are sought."""

    pair: PairPlant
    bends: tuple[Range, Range]
    """Smallest and largest of each sheath, the agonist's first [rad]."""
    stroke: tuple[float, float]
    """Ends of the motions [rad]."""
    seed: int
    """Of the encoders' noise."""


class JudgedGains(NamedTuple):
    """What gains make of a pair."""

    laws: Laws
    found: Check
    worst: float
    """Largest RMSE over all runs; infinite where one ran away [rad]."""


def runs_described(target: PairTarget) -> str:
    """By what the errors are judged, in words."""
    count = len(_ends(target)) * len(references_of(target.stroke))
    return f"{count} runs of {RUN:g} s of both motors"


def judged_gains(target: PairTarget, laws: Laws) -> JudgedGains:
    """Check two laws on their joint, and run them.

    Args:
        target: the pair.
        laws: of each, the agonist's first.

    Raises:
        ParameterError: sides that no one loop can have.
    """
    found = check_pair(target.pair, laws, bends=target.bends, stroke=target.stroke, seed=target.seed)
    return JudgedGains(laws, found, _worst(target, laws))


def best_gains(
    target: PairTarget,
    before: JudgedGains,
    candidates: Sequence[Mapping[str, float]],
    report: Callable[[float], None] = lambda share: None,
) -> JudgedGains:
    """The gains, of those before and of the candidates, that keep 6 dB and 45° on the pair and follow best there.

    Args:
        target: the pair.
        before: what the laws make of it as they stand.
        candidates: gain → value, for both laws.
        report: called with the share of the work that is done.

    Raises:
        NoGainsError: none keep the margins and follow better than a joint that stands still.
    """
    judged = [before]
    for done, gains in enumerate(candidates):
        one, other = (law.with_gains(**gains) for law in before.laws)
        judged.append(judged_gains(target, (one, other)))
        report((done + 1) / len(candidates))
    still = min(float(np.std(sampled)) for sampled in _sampled(target))
    kept = [one for one in judged if keeps(one.found) and one.worst < still]
    if not kept:
        last = judged[-1].found
        raise NoGainsError(
            f"gains that keep 6 dB and 45° on each motor's own cable do not keep them on the joint of both, or do not "
            f"follow there: {last.reason}",
            do="look at what bowden check says of the pair; cables that are more alike, or another law",
        )
    return min(kept, key=lambda one: one.worst)


def _ends(target: PairTarget) -> list[tuple[float, float]]:
    return list(dict.fromkeys(itertools.product(*target.bends)))


def _sampled(target: PairTarget) -> list[np.ndarray]:
    time = np.arange(0.0, RUN, target.pair.sample_time)
    return [reference.sample(time)[:, 0] for reference in references_of(target.stroke)]


def _worst(target: PairTarget, laws: tuple[Law, Law]) -> float:
    worst = 0.0
    for bends, reference in itertools.product(_ends(target), references_of(target.stroke)):
        begin = float(reference.sample(np.zeros(1))[0, 0])
        trace, _ = simulate_pair(
            at_bends(target.pair, bends),
            laws,
            reference,
            duration=RUN,
            initial_motors=target.pair.resting_motors(begin, bends),
        )
        error = trace["joint"] - trace["reference"]
        worst = max(worst, rmse(error) if np.isfinite(error).all() else np.inf)
    return worst
