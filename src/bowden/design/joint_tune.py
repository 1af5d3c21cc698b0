"""Gains for all motors of a joint: found for each motor and its cable, judged on the joint that they share.

The loop of two like motors is that of one with the slope 2k·σ/(2k + s) (`bowden.design.joint_check`), which is σ but
for the load's spring s. So gains that keep their margins on one motor's cable are what there is to begin with, and a
search on the joint itself would look where the other has looked, at twice the price. What differs (the other cables,
all bends, the motors that may part) is judged on the joint: the margins of all commands together, the trials, and the
error over runs of all.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bowden.core.errors import counted
from bowden.design.check import Bends, Laws
from bowden.design.check_result import Check
from bowden.design.joint_check import check_joint
from bowden.design.tune import NoGainsError
from bowden.design.tune_judge import keeps
from bowden.design.tune_runs import RUN, references_of
from bowden.records.metrics import rmse
from bowden.sim.joint import CabledJoint, Range, simulate_joint


class JointTarget(NamedTuple):
    """For what gains are sought."""

    joint: CabledJoint
    bends: tuple[Range, ...]
    """Smallest and largest of each motor's sheath [rad]."""
    stroke: Range
    """Ends of the motions [rad]."""
    seed: int
    """Of the encoders' noise."""

    @property
    def ends(self) -> list[Bends]:
        """Of the bends, each with each of the others."""
        return list(dict.fromkeys(itertools.product(*self.bends)))

    @property
    def described(self) -> str:
        """By what the errors are judged, in words."""
        count, motors = len(self.ends) * len(references_of(self.stroke)), len(self.bends)
        return f"{count} runs of {RUN:g} s of {counted(motors, 'motor')}"


class JudgedGains(NamedTuple):
    """What gains make of a joint."""

    laws: Laws
    found: Check
    worst: float
    """Largest RMSE over all runs; infinite where one ran away [rad]."""


def judged_gains(target: JointTarget, laws: Laws) -> JudgedGains:
    """Check laws on their joint, and run them.

    Args:
        target: the joint.
        laws: of each motor.

    Raises:
        ParameterError: motors that no one loop can have.
    """
    found = check_joint(target.joint, laws, bends=target.bends, stroke=target.stroke, seed=target.seed)
    return JudgedGains(laws, found, _worst(target, laws))


def best_gains(
    target: JointTarget,
    before: JudgedGains,
    candidates: Sequence[Mapping[str, float]],
    report: Callable[[float], None] = lambda share: None,
) -> JudgedGains:
    """The gains, of those before and of the candidates, that keep 6 dB and 45° on the joint and follow best there.

    Args:
        target: the joint.
        before: what the laws make of it as they stand.
        candidates: gain → value, for all laws.
        report: called with the share of the work that is done.

    Raises:
        NoGainsError: none keep the margins and follow better than a joint that stands still.
    """
    judged = [before]
    for done, gains in enumerate(candidates):
        judged.append(judged_gains(target, tuple(law.with_gains(**gains) for law in before.laws)))
        report((done + 1) / len(candidates))
    time = np.arange(0.0, RUN, target.joint.first.sample_time)
    still = min(float(np.std(one.sample(time)[:, 0])) for one in references_of(target.stroke))
    kept = [one for one in judged if keeps(one.found) and one.worst < still]
    if not kept:
        last = judged[-1].found
        raise NoGainsError(
            f"gains that keep 6 dB and 45° on each motor's own cable do not keep them on the joint of all, or do not "
            f"follow there: {last.reason}",
            do="look at what bowden check says of the joint; cables that are more alike, or another law",
        )
    return min(kept, key=lambda one: one.worst)


def _worst(target: JointTarget, laws: Laws) -> float:
    worst = 0.0
    for bends, reference in itertools.product(target.ends, references_of(target.stroke)):
        begin = float(reference.sample(np.zeros(1))[0, 0])
        trace, *_ = simulate_joint(
            target.joint.at_bends(bends),
            laws,
            reference,
            duration=RUN,
            initial_motors=target.joint.resting_motors(begin, bends),
        )
        error = trace["joint"] - trace["reference"]
        worst = max(worst, rmse(error) if np.isfinite(error).all() else np.inf)
    return worst
