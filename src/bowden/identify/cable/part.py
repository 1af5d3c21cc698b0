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
from bowden.identify.cable.path import Path, path_of
from bowden.identify.cable.play import PlayOperator
from bowden.identify.cable.settling import Settling, settling
from bowden.identify.cable.stack import PrandtlIshlinskii
from bowden.identify.cable.validation import JudgedSamples, fold_of, held_out_errors
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

    def counted_at(self, time: Array) -> Array:
        """How much the samples at those times count in the fit (n,), 0 to 1 [–]."""
        return np.interp(time, self.fine.time, self.counted)

    @property
    def rest_until(self) -> float | None:
        """Time to which the log counts less since it begins at rest [s]; None where it does not."""
        if self.settling != Settling() or (self.counted == 1.0).all():
            return None
        return float(self.fine.time[self.counted < 1.0].max())

    def left_out_errors(self, log: Log) -> dict[str, Array]:
        """Mean squared error of every family on each fold (folds,), fitted without it [rad²].

        They are fitted to the thinned path, and judged at the log's full rate: what averages the samples round a corner
        of the loop is not better on the samples themselves.
        """
        fold, counted = fold_of(self.fine), self.fine.weight > 0
        nodes, stroke = self.fine.time[counted], self.fine.stroke[counted]
        after = np.searchsorted(nodes, log.time).clip(1, len(nodes) - 1)
        own = fold[counted][after]
        inside = (
            (stroke[after - 1] == stroke[after]) & (own >= 0) & (log.time <= nodes[-1])
        )  # of a stroke that was read
        seen = JudgedSamples(log.time[inside], log.joint[inside], self.counted_at(log.time[inside]), own[inside])
        return {
            family.name: held_out_errors(family, self.judged, self.estimates[family.name], self.fine, seen)
            for family in self.families
        }


def fit_part(log: Log, stop: int, noise: float, seed: int, tell: Progress) -> FittedPart:
    """Every family, searched globally.

    Args:
        log: all of it.
        stop: how many of its samples are fitted.
        noise: of the motor's readings [rad].
        seed: of the global search.
        tell: called with what is being done and the share done.
    """
    fine, judged = (_path(log, stop, noise, nodes) for nodes in (_FINE, _JUDGED))
    searched = path_of(log.time[:stop], log.motor[:stop], log.joint[:stop], _SEARCHED, noise)
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
    raw, judged = (_path(log, len(log.time), noise, nodes) for nodes in (_FINE, _JUDGED))
    fine, judged = half.settling.weighted(raw), half.settling.weighted(judged)
    estimates = {family.name: family.refit(fine, half.estimates[family.name]) for family in half.families}
    return FittedPart(fine, _counted(raw, fine), judged, half.settling, half.families, estimates)


def _counted(raw: Path, weighted: Path) -> Array:
    """Weight over weight without settling; of a reversal, which has none, that of the node before it."""
    seen = np.flatnonzero(raw.weight > 0)
    shares = weighted.weight[seen] / raw.weight[seen]
    before = np.searchsorted(seen, np.arange(len(raw.weight)), side="right") - 1
    return np.asarray(shares[np.maximum(before, 0)])


def _path(log: Log, stop: int, noise: float, nodes: int) -> Path:
    return path_of(log.time[:stop], log.motor[:stop], log.joint[:stop], nodes, noise, _READ)
