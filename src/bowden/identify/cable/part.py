"""Every family fitted to one part of a log."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.bouc_wen import BoucWenCable
from bowden.identify.cable.bouc_wen_static import BoucWenStatic, richest
from bowden.identify.cable.family import Estimate, Family
from bowden.identify.cable.generalised import GeneralisedPlay
from bowden.identify.cable.line import Line
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.play import PlayOperator
from bowden.identify.cable.settling import Settling, settling
from bowden.identify.cable.stack import PrandtlIshlinskii
from bowden.identify.cable.turns import find_turns
from bowden.identify.log.read import Log

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""What is being done now, and the share of the work that is behind."""

_FINE, _JUDGED, _SEARCHED = 2500, 600, 150
"""Nodes of the path on which models are fitted, compared with one another, and searched for globally."""

_READ = 250
"""Strokes of a long log that are fitted, spread over all of it: they say what a cable's loop is, and how it strays."""

_SEARCHED_STROKES = 30
"""The global search needs no more of a long log; the gradient stage sees all of it."""


@dataclass(frozen=True)
class FittedPart:
    """The beginning of a log, up to some sample, with every family's best member."""

    fine: Path
    """On which they were fitted, weighted as the cable's settling asks."""
    counted: Array
    """How much each node of it counts, over what it would on a cable that does not settle (n,), 0 to 1 [–]."""
    judged: Path
    """The same, thinned, on which they are compared."""
    settling: Settling
    families: tuple[Family, ...]
    """From the simplest on."""
    estimates: dict[str, Estimate]
    """By the family's name."""

    @property
    def rest_until(self) -> float | None:
        """Time to which the log counts less since it begins at rest [s]; None where it does not."""
        if self.settling != Settling() or (self.counted == 1.0).all():
            return None
        return float(self.fine.time[self.counted < 1.0].max())


def fit_part(log: Log, stop: int, noise: float, seed: int, tell: Progress) -> FittedPart:
    """Every family, searched globally.

    Args:
        log: all of it.
        stop: how many of its samples are fitted.
        noise: of the motor's readings [rad].
        seed: of the global search.
        tell: called with what is being done and the share done.
    """
    fine, judged, searched = _paths(log, stop, noise)
    branches = GeneralisedPlay()
    tell(branches.name, 0.1)
    weighting = settling(fine, branches.rough(fine))
    raw, searched = fine, searched.first(_SEARCHED_STROKES)
    fine, judged, searched = (weighting.weighted(path) for path in (fine, judged, searched))
    free = branches.fit(fine)
    tell("bouc_wen, searched globally", 0.2)
    cable = BoucWenCable(searched, seed)
    plain = cable.fit(fine)
    static = BoucWenStatic(richest(fine, plain))
    families: tuple[Family, ...] = (Line(), PlayOperator(judged), cable, static, PrandtlIshlinskii(), branches)
    known = {cable.name: plain, branches.name: free}
    estimates: dict[str, Estimate] = {}
    for family in families:
        tell(family.name, 0.3 + 0.03 * len(estimates))
        estimates[family.name] = known.get(family.name) or family.fit(fine)
    return FittedPart(fine, _counted(raw, fine), judged, weighting, families, estimates)


def refit_whole(log: Log, noise: float, half: FittedPart) -> FittedPart:
    """Every family fitted to the whole log, searched from where it was for its first half."""
    raw, judged, _ = _paths(log, len(log.time), noise)
    fine, judged = half.settling.weighted(raw), half.settling.weighted(judged)
    estimates = {family.name: family.refit(fine, half.estimates[family.name]) for family in half.families}
    return FittedPart(fine, _counted(raw, fine), judged, half.settling, half.families, estimates)


def _counted(raw: Path, weighted: Path) -> Array:
    """Weight over weight without settling; of a reversal, which has none, that of the node before it."""
    seen = np.flatnonzero(raw.weight > 0)
    shares = weighted.weight[seen] / raw.weight[seen]
    before = np.searchsorted(seen, np.arange(len(raw.weight)), side="right") - 1
    return np.asarray(shares[np.maximum(before, 0)])


def _paths(log: Log, stop: int, noise: float) -> tuple[Path, Path, Path]:
    """On which models are fitted, compared with one another, and searched for globally."""
    time, motor, joint = log.time[:stop], log.motor[:stop], log.joint[:stop]
    turns = find_turns(motor, noise)
    fine, judged = (build_path(time, motor, joint, turns, nodes, _READ) for nodes in (_FINE, _JUDGED))
    return fine, judged, build_path(time, motor, joint, turns, _SEARCHED)
