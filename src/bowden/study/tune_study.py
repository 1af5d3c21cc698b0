"""Gains that are tuned against the plants of a study, and judged by others of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES
from bowden.sim.many import Outcome, simulate_many
from bowden.sim.run import Case
from bowden.study.figures import wilson
from bowden.study.results import PlantsSpread
from bowden.study.study import Study
from bowden.study.workers import packed, unpacked

TUNED, JUDGED = 24, 400
"""Plants that gains are tuned against, and others that they are judged by, at most."""
_CYCLES = 2_000_000
"""Of all plants that gains are tuned against, at most: what they are given over time stays in memory."""
_CHUNK = 10


@dataclass(frozen=True)
class StudyRuns:
    """The first runs of a study, as `bowden.design.tune_runs.TuningRuns`."""

    pack: bytes
    """The study."""
    count: int

    @property
    def duration(self) -> float:
        """Of each run [s]."""
        return unpacked(self.pack).duration

    @property
    def described(self) -> str:
        """What they are, in words."""
        return f"{self.count} plants of {unpacked(self.pack).path.name}"

    def cases(self) -> Sequence[Case]:
        """Each run, but for the law."""
        return [case._replace(laws=()) for case in _cases(self.pack, 0, self.count)]

    def laws(self, law: Law) -> Sequence[Law]:
        """The law in each run: with its gains, but for what the run says of the servo, and of its cable."""
        return [_in_run(unpacked(self.pack), case, law) for case in _cases(self.pack, 0, self.count)]


def check_study(study: Study) -> None:
    """Refuse a study that gains cannot be tuned against.

    Raises:
        ParameterError: one in which the wearer's push makes the reference, with too few runs, or that varies gains.
    """
    drawn = [c.name for c in study.columns if c.name.startswith("control.gains.")]
    if drawn:
        raise ParameterError(
            f"{study.path} varies {', '.join(drawn)}", expected="a study of plants", do="delete what is to be tuned"
        )
    if study.rig.pushing is not None:
        raise ParameterError(
            f"{study.path}: the wearer's push makes the reference, [admittance] is enabled",
            expected="runs that go by [reference]",
            do='add "admittance.enabled" = false to [set]',
        )
    if study.file.runs < 4:
        raise ParameterError(f"{study.path}: runs is {study.file.runs}", expected="4 or more: half are judged by")


def runs_of(study: Study) -> StudyRuns:
    """The runs that gains are tuned against."""
    most = int(_CYCLES * study.rig.sample_time / study.duration)
    return StudyRuns(packed(study), max(2, min(TUNED, study.file.runs // 2, most)))


class PlantGroup(NamedTuple):
    """Some of the plants that gains are judged by."""

    pack: bytes
    first: int
    last: int
    before: Law
    after: Law


def parts(runs: StudyRuns, before: Law, after: Law) -> list[PlantGroup]:
    """The plants that follow those that gains were tuned against, in parts for processes."""
    total = min(unpacked(runs.pack).file.runs, runs.count + JUDGED)
    begins = range(runs.count, total, _CHUNK)
    return [PlantGroup(runs.pack, begin, min(begin + _CHUNK, total), before, after) for begin in begins]


def judged(part: PlantGroup) -> list[tuple[Outcome, Outcome]]:
    """Each plant with the gains before and after."""
    study = unpacked(part.pack)
    cases = []
    for case in _cases(part.pack, part.first, part.last):
        cases.append(case._replace(laws=tuple(_in_run(study, case, law) for law in (part.before, part.after))))
    return [(before, after) for before, after in simulate_many(cases, study.duration)]


def spread(outcomes: Sequence[Outcome]) -> PlantsSpread:
    """How they did together."""
    errors = np.array([one.rmse if one.ended else np.inf for one in outcomes]) * DEGREES
    unstable = sum(not one.stable for one in outcomes)
    shown = [float(value) for value in np.quantile(errors, (0.5, 0.9, 1.0), method="higher")]
    median, most, worst = (value if np.isfinite(value) else None for value in shown)
    return PlantsSpread(len(outcomes), unstable, wilson(unstable, len(outcomes)), median, most, worst)


@lru_cache(2)
def _cases(pack: bytes, first: int, last: int) -> tuple[Case, ...]:
    study = unpacked(pack)
    return tuple(study.cases((number, study.drawn(number)) for number in range(first, last)))


def _in_run(study: Study, case: Case, law: Law) -> Law:
    """The law of a run with what differs in `law` from the study's own on its rig."""
    (own,) = case.laws
    (nominal,) = study.nominal
    changed = {
        name: value
        for name, value in law.numbers.items()
        if name not in study.gains_varied and value != nominal.numbers[name]
    }
    return own.with_gains(**changed)
