"""Gains with margins for a rig: over a sheath that is moved, for one motor or several on one joint, against a study."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bowden.control import Law, user_law
from bowden.control.knowledge import preset_of
from bowden.control.law_file import LawFile
from bowden.core.caller import argument
from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.design.check import check
from bowden.design.check_rig import check_rig, missing_integral
from bowden.design.joint_tune import JointTarget, best_gains, judged_gains
from bowden.design.processes import Mapper, two_workers
from bowden.design.tune import BrokenOff, NoGainsError
from bowden.design.tune import tune as search
from bowden.design.tune_result import Tuning
from bowden.design.tune_runs import NineRuns, TuningTarget, course_of
from bowden.design.verdict import OtherLaw, mended_law, other_law
from bowden.drawing.shown import listed
from bowden.plants.plant_file import PlantFile
from bowden.rig.joints import RigJoint
from bowden.rig.rig import Rig
from bowden.sim import ranges
from bowden.sim.rig_runs import cabled_joint_of, joint_ranges, laws_of
from bowden.study import tune_study
from bowden.study.load import load
from bowden.study.results import JudgedByStudy
from bowden.study.study import Study

Progress = Callable[[str, float], None]


def tuned(
    rig: Rig, study: Path | None = None, *, seed: int, progress: Progress, generations: int | None = None
) -> Tuning:
    """The tuning of a rig's law, which the tuning's rig then has with these gains.

    Args:
        rig: whose bench, bends and stroke count.
        study: the path of a study, against some of whose plants the gains are tuned, and judged on others.
        seed: of the search.
        progress: called with what is being done and the share of the work that is behind.
        generations: of the search; None for as many as the rig asks for.

    Raises:
        ParameterError: no gains hold, and the message names the nearest rig that has some; or a study that cannot be.
        BrokenOff: interrupted, with gains that are better than those before.
    """
    plants = None if study is None else load(study, rig, own_law=True)
    if plants is not None:
        tune_study.check_study(plants)
    looked_at = rig if plants is None else plants.rig
    law = rig.fitted() if plants is None else plants.nominal[0]

    begun = preset_of(rig.loaded_law, rig.knowledge, preset=rig.preset, gains=rig.gains)

    def whole(found: Tuning) -> Tuning:
        """With the rig, whose gains stand on the preset that a suit's law began with, too."""
        preset = begun if found.gains else rig.preset
        return replace(found, given=rig.replace(preset=preset, gains={**rig.gains, **found.gains}))

    wide, own = bends_of(looked_at), ranges.bends(looked_at)

    with workers_for(looked_at) as workers:

        def sought(bends: tuple[float, float]) -> Tuning:
            with user_law.explained(law):
                return search(
                    ranges.judged(looked_at),
                    law,
                    bends=bends,
                    stroke=ranges.stroke(looked_at),
                    seed=seed,
                    generations=generations,
                    runs=None if plants is None else tune_study.runs_of(plants),
                    fixed=() if plants is None else plants.gains_varied,
                    workers=workers,
                    report=progress,
                    nearest=bends == own,
                    known=looked_at.knowledge,
                )

        try:
            try:
                found = sought(wide)
            except NoGainsError as error:
                if plants is not None:
                    raise
                found = _narrower(looked_at, law, error, own, sought)
        except BrokenOff as broken:
            raise BrokenOff(whole(broken.tuning)) from None
        except NoGainsError as error:
            raise _instead(looked_at, law, error) from None
        if plants is None:
            return whole(found)
        try:
            return replace(whole(found), study=_judged(plants, law, found.law, workers, progress))
        except KeyboardInterrupt:
            raise BrokenOff(whole(found)) from None


def _narrower(
    rig: Rig, law: Law, error: NoGainsError, own: tuple[float, float], sought: Callable[[tuple[float, float]], Tuning]
) -> Tuning:
    """Gains for a rig for which none keep what is looked for over a sheath that is moved: those of its own bends.

    Where there are none either, the rig's own gains or the law's usual ones, whichever follows better, that `check`
    says hold.

    Args:
        rig: whose bends and stroke count.
        law: with the gains from which the search started.
        error: that of the search over more bends.
        own: the rig's bends, which `check` looks at [rad].
        sought: the search over bends.

    Raises:
        NoGainsError: there are none at all.
    """
    if bends_of(rig) != own:
        try:
            found = sought(own)
            return replace(found, short=f"with the sheath bent to {bends_of(rig)[1] * DEGREES:.0f}°, {error.what}")
        except NoGainsError as narrow:
            error = narrow
    plant, stroke = ranges.judged(rig), ranges.stroke(rig)
    before = check(plant, law, bends=own, stroke=stroke)
    runs = NineRuns(TuningTarget(plant, own, stroke, before.refuted))
    usual = rig.replace(gains={}, preset=None).fitted()
    checks = [(law, before), *([] if usual == law else [(usual, check(plant, usual, bends=own, stroke=stroke))])]
    if all(found.verdict != "holds" for _, found in checks):
        raise error
    tried = [(max(course_of(runs).errors(runs.laws(one), (), np.inf)), one, found) for one, found in checks]
    worst, best, judged = min((one for one in tried if one[2].verdict == "holds"), key=lambda one: one[0])
    stood, worst_before = law.numbers, tried[0][0]
    return Tuning(
        law=best,
        gains={name: value for name, value in best.numbers.items() if value != stood[name]},
        stood=stood,
        found=judged,
        before=before,
        worst_rmse=worst,
        worst_before=worst_before if np.isfinite(worst_before) else None,
        bends=own,
        runs=runs.described,
        generations=0,
        short=f"{error.what}; {error.do}; these hold",
    )


def tuned_together(
    rig: Rig, study: Path | None = None, *, seed: int, progress: Progress, generations: int | None = None
) -> Tuning:
    """Gains for all motors of a rig's joint, which the laws of each of them in the tuning's rig then have.

    They are sought for each motor and its cable alone, once for those that are the same, and judged on their joint.

    Args:
        rig: with one joint that several motors share; other joints of it are left alone.
        study: none.
        seed: of the search.
        progress: called with what is being done and the share of the work that is behind.
        generations: of the search; None for as many as the rig asks for.

    Raises:
        ParameterError: as `tuned`; or a study, whose plants are of one motor.
    """
    joint, *more = (one for one in rig.each_joint if one.shared)
    if more:
        raise ParameterError(
            f"{rig.origin} has several joints that motors share",
            expected="one",
            do=f"tune a motor of each, such as {argument('motor', joint.names[0])}, and check all together",
        )
    if study is not None:
        raise ParameterError(
            f"{rig.origin} has several motors on one joint, and the plants of a study have one",
            expected="a rig with one motor, or no study",
            do=f"name one with {argument('motor', joint.names[0])}, and check all together",
        )
    laws = laws_of(joint)
    target = JointTarget(cabled_joint_of(joint), *joint_ranges(joint), joint.first.seed)
    with user_law.explained(laws[0]):
        before = judged_gains(target, laws)
        searches, sought = [], _unlike(joint, laws)
        for done, (name, own) in enumerate(sought.items()):

            def part(
                what: str, share: float, *, done: int = done, said: str = f"{own.law_name} for {name} alone"
            ) -> None:
                progress(f"{said}: {what}", 0.9 * (done + share) / len(sought))

            try:
                searches.append(tuned(own, seed=seed, generations=generations, progress=part))
            except BrokenOff:  # what is good for one motor alone is no gains for all
                raise KeyboardInterrupt from None
        names = laws[0].choices
        candidates = [{name: found.law.numbers[name] for name in names} for found in searches]
        best = best_gains(target, before, candidates, lambda share: progress("judging on the joint", 0.9 + 0.1 * share))
    stood = [law.numbers for law in laws]
    values = best.laws[0].numbers
    changed = best is not before
    gains = {name: values[name] for name in names if changed and any(values[name] != own[name] for own in stood)}
    motors = (
        one._replace(rig=one.rig.replace(gains={**one.rig.gains, **gains})) if one.name in joint.names else one
        for one in rig.motors
    )
    return Tuning(
        law=best.laws[0],
        gains=gains,
        stood=stood[0],
        found=best.found,
        before=before.found,
        worst_rmse=best.worst,
        worst_before=before.worst if np.isfinite(before.worst) else None,
        bends=(min(low for low, _ in target.bends), max(high for _, high in target.bends)),
        runs=target.described,
        generations=max(found.generations for found in searches),
        given=replace(rig, motors=tuple(motors)),
    )


def _unlike(joint: RigJoint, laws: Sequence[Law]) -> dict[str, Rig]:
    """Motors, with cable and law, that are not the same as one before them, whose gains are theirs."""
    found: dict[str, Rig] = {}
    seen: list[Any] = []
    for one, law in zip(joint.motors, laws, strict=True):
        what = (ranges.judged(one.rig), bends_of(one.rig), ranges.stroke(one.rig), law.gains)
        if what not in seen:
            found[one.name] = one.rig
        seen.append(what)
    return found


def _instead(rig: Rig, law: Law, error: NoGainsError) -> NoGainsError:
    """The same error with what may be done: an integral of a suit's drive that has none, the rig's own law with less
    margin, or another one that follows better."""
    if integral := missing_integral(rig, law, check_rig(rig, law)):
        lacks = NoGainsError(error.what, expected=error.expected, do=integral)
        lacks.of_rig = True
        return lacks
    own, other = mended_law(rig, law), other_law(rig, [law.name])
    said, instead, gains = "", "", {}
    if other is not None and (own is None or _follows_better(other, own)):
        said, instead = f"{other}: write law = {quoted(other.law)} into [control]", other.law
    elif own is not None:
        gains = dict(own.gains)
        lines = " and ".join(f"{name} = {value:.3g}" for name, value in gains.items())
        what = f": write {lines} into [control.gains]" if lines else ""
        said = f"{own}, with less margin than is looked for{what}"
    found = NoGainsError(error.what, expected=error.expected, do=listed((error.do, said), "; "))
    found.instead, found.gains = instead, gains
    return found


def _follows_better(other: OtherLaw, own: OtherLaw) -> bool:
    """True if another law's error is smaller, and it holds if the rig's own does."""
    return other.rmse_deg < own.rmse_deg and (other.verdict == "holds" or own.verdict != "holds")


def _judged(plants: Study, before: Law, after: Law, workers: Mapper, progress: Progress) -> JudgedByStudy:
    """What gains before and after make of plants that they were not tuned against."""
    runs = tune_study.runs_of(plants)
    work, found = tune_study.parts(runs, before, after), []
    for done, outcomes in enumerate(workers(tune_study.judged, work)):
        found += outcomes
        progress("judging by other plants", 0.9 + 0.1 * done / len(work))
    before_after = (tune_study.spread(one) for one in zip(*found, strict=True))
    return JudgedByStudy(plants.path.stem, runs.count, *before_after)


def bends_of(rig: Rig) -> tuple[float, float]:
    """Smallest and largest bend to tune for [rad]: a sheath that nobody moves in the rig is moved in use."""
    low, high = ranges.bends(rig)
    return (low, high) if high > low else (low, 2.0 * low)


@contextlib.contextmanager
def workers_for(rig: Rig) -> Iterator[Mapper]:
    """A `map` for the search: over two processes, where they can be handed the rig's law and plant."""
    law, plant = rig.law, rig.plant
    if isinstance(law, str | LawFile) and (plant is None or isinstance(plant, PlantFile)):
        with two_workers(law, plant) as workers:
            yield workers
    else:  # a law or a plant of this process alone
        yield map
