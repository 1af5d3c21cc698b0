"""Gains of a law that keep their margins over a rig's sheath, and follow best in the worst case.

1. Every gain that is a choice (`Law.tunable`) and that the loop or the errors feel is varied, on a logarithmic scale
   around where it stands; what the rig would give the law (`bowden.control.knowledge`), had nobody chosen otherwise, is
   tried first too.
2. The search is SciPy's differential evolution: gains that lack 6 dB or 45°, or whose command jumps by more than
   `MOST_PER_COUNT` with one count of the joint's encoder, are ranked by what they lack, without a simulation; the
   others by their largest RMSE over a set of sheath paths and references.
3. Whatever is to be the best so far is checked as `bowden check` does it. Where it fails at estimates that its own
   trials visit, these count for all from then on.
4. A gain that can go back to where it stood at no cost does.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bowden.control.knowledge import Knowledge, informed
from bowden.control.law import Law
from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES
from bowden.design.advice import gains_that_matter
from bowden.design.check import STROKE, check, visited_estimates
from bowden.design.check_result import MOST_PER_COUNT, Check, Estimates
from bowden.design.tune_judge import (
    UNSTABLE,
    Judged,
    Task,
    chatter,
    checked,
    errors,
    judge,
    judge_apart,
    keeps,
    shortfall,
    shortfall_on_the_way,
)
from bowden.design.tune_result import REACH, Tuning
from bowden.design.tune_runs import NineRuns, TuningRuns, TuningTarget, course_of
from bowden.models.drive.servo import Servo
from bowden.plants.estimated import measured_plant
from bowden.plants.knowledge_of import knowledge_of, with_loop
from bowden.plants.plant import Plant, changed
from bowden.plants.suit_parts import Suit

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult


GENERATIONS = 32
"""Of the search, where no other number is given and the clock is 1 kHz."""
_FEWEST = 6
_OF_SUIT = 0.25
"""Share of the generations for a suit, each of whose runs takes some thirty times a bench's [–]."""
_DRAWS, _SIMULATED, _MEMBERS = 400, 80, 24
_FULL = 8
"""Generations, and gains, from which on the first draws are as many as that; for fewer, they are fewer too."""
_FEWEST_MEMBERS = 8
_SPREADS = (0.5, 1.5, 3.0, 6.0)
"""Of the first draws, as the logarithm of a gain's share of where it began."""
_MOST_ESTIMATES = 5
_CHECKED_EVERY = 8
"""Generations."""
_SAME = 1.002
"""Share of the best error that is no change."""
_TRIED_FACTORS = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)

_LACKING = 1e6
"""What gains cost at least that lack something; no error is as large."""

Array = NDArray[np.float64]
Report = Callable[[str, float], None]
Workers = Callable[[Callable[[Task], Any], Iterable[Task]], Iterable[Any]]
"""Like `map`: the one of a process pool spreads the work."""


class NoGainsError(ParameterError):
    """No gains keep the margins and follow."""

    of_rig: bool = False
    """True if what to do changes the rig, where no gains would do."""
    instead: str = ""
    """Law to take in place of the rig's own, where one follows better; empty where none was found."""
    gains: Mapping[str, float] = {}
    """Name → value of gains with which the rig's own law holds with less margin; empty where none were found."""


class BrokenOff(KeyboardInterrupt):
    """The search was interrupted, and has gains that are better than those before: it carries them."""

    def __init__(self, tuning: Tuning) -> None:
        self.tuning = tuning


def tune(
    bench: Plant,
    law: Law,
    *,
    bends: tuple[float, float] | None = None,
    stroke: tuple[float, float] = STROKE,
    seed: int = 0,
    generations: int | None = None,
    runs: TuningRuns | None = None,
    fixed: Collection[str] = (),
    workers: Workers = map,
    report: Report = lambda what, share: None,
    nearest: bool = True,
    known: Knowledge | None = None,
) -> Tuning:
    """Find gains.

    Args:
        bench: to tune for.
        law: with the gains from which the search starts.
        bends: smallest and largest total bend [rad]; the identified one and, as the sheath may be moved, its double
            where they are not given.
        stroke: ends of the motions [rad].
        seed: of the search.
        generations: of the search, the time it takes grows with them; where it is not given 32, 8 of a suit, and fewer
            for a clock faster than 1 kHz.
        runs: by whose largest error gains are judged; nine on the rig where they are not given.
        fixed: gains that are left as they begin.
        workers: how a function is mapped over many gains; the result does not depend on it.
        report: called with what is done and the share done.
        nearest: whether the nearest rig is looked for, where there are none.
        known: what the law knows of the rig; what the bench says of itself where it is not given.

    Raises:
        ParameterError: the law has no gains that the loop knows, or none keep the margins and follow; the message has
            the reason and the nearest rig for which there are some.
        BrokenOff: interrupted, with gains that keep the margins and are better than those before.
    """
    if generations is None:
        share = _OF_SUIT if isinstance(measured_plant(bench), Suit) else 1.0
        generations = max(_FEWEST, round(share * GENERATIONS * min(1.0, bench.sample_time / 1e-3)))
    rig = TuningTarget(bench, bends or (bench.sheath.bend, 2.0 * bench.sheath.bend), stroke)
    random = np.random.default_rng(seed)
    search = _Search(rig, law, random, workers, runs, fixed, known or knowledge_of(bench), nearest=nearest)
    try:
        report("margins of random gains", 0.05)
        search.begin(min(1.0, generations / _FULL))
        while search.steps < generations and not search.settled():
            search.evolve(generations, report)
        report("checking the best", 0.9)
        return search.finish()
    except KeyboardInterrupt:
        if search.best is None or search.best[2] >= min(search.still(), max(search.errors_before)):
            raise
        raise BrokenOff(search.tuning(*search.best)) from None


class _Search:
    """One search: what is varied, the population, and the best that the full check confirmed."""

    def __init__(
        self,
        rig: TuningTarget,
        law: Law,
        random: np.random.Generator,
        workers: Workers,
        runs: TuningRuns | None,
        fixed: Collection[str],
        known: Knowledge,
        *,
        nearest: bool,
    ) -> None:
        self.before = check(rig.bench, law, bends=rig.bends, stroke=rig.stroke)
        rig = rig._replace(refuted=self.before.refuted)
        self.rig, self.law, self.random, self.workers = rig, law, random, workers
        self.runs, self.fixed, self.known, self.steps = runs or NineRuns(rig), fixed, known, 0
        self.nearest = nearest and runs is None
        usual = all(trial.bounded for trial in self.before.trials)
        estimates = visited_estimates(law, self.before.trials if usual else (), rig.bench.sample_time)
        self.estimates: tuple[Estimates, ...] = (estimates[0], estimates[-1]) if estimates[1:] else (estimates[0],)
        self.order: tuple[int, ...] = ()
        self.errors_before = errors(self._task(law))
        self.names = self._names()
        self.best: tuple[Law, Check, float] | None = None
        self.points: Array = np.empty((0, 0))
        self.costs: Array = np.empty(0)
        self.stale = False
        """True if the members were judged before the last of the estimates was known to count."""

    def begin(self, share: float) -> None:
        """Draw gains, a share of the usual number, and take those that lack the least of their margins."""
        count = len(self.names)
        part = min(1.0, count / _FULL)
        members = max(min(_FEWEST_MEMBERS, _MEMBERS), round(part * _MEMBERS))
        points = self._begun()
        for _ in range(max(members, round(share * part * _DRAWS))):
            points.append(self.random.uniform(-1.0, 1.0, count) * float(self.random.choice(_SPREADS)))
        lacking = list(self.workers(shortfall, [self._task(self._law(point)) for point in points]))
        first = [points[i] for i in sorted(range(len(points)), key=lambda i: (lacking[i], i))]
        first = first[: max(members, round(share * part * _SIMULATED))]
        best = self._best(first, members)
        self.points, self.costs = np.array([point for point, _ in best]), np.array([cost for _, cost in best])
        self._confirm()

    def _begun(self) -> list[Array]:
        """Gains that are tried first: as they stand, and as the rig would give them."""
        usual = informed(replace(self.law, overridden_gains=frozenset()), self.known).numbers
        shares = np.array([usual[name] / self.law.numbers[name] for name in self.names])
        known = np.log(np.where(shares > 0.0, shares, 1.0))  # a gain that would be off stays as it stands
        return [np.zeros(len(self.names)), np.clip(known, -REACH, REACH)]

    def evolve(self, generations: int, report: Report) -> None:
        """Some of that many generations, and a check of what leads then."""
        from scipy.optimize import Bounds, differential_evolution  # half a second, which a check need not wait for

        def stepped(intermediate_result: "OptimizeResult") -> None:
            report(f"simulating gains, step {self.steps + 1} of {generations}", 0.1 + 0.8 * self.steps / generations)
            self.steps += 1
            self.points = intermediate_result.population
            self.costs = np.array(intermediate_result.population_energies)
            if self.settled():
                raise StopIteration

        differential_evolution(
            self._costs,  # type: ignore[arg-type]  # of one point, as SciPy's types have it
            Bounds(*np.outer((-REACH, REACH), np.ones(len(self.names)))),
            strategy="currenttobest1bin",
            init=self.points,
            maxiter=min(_CHECKED_EVERY, generations - self.steps),
            mutation=(0.4, 0.9),
            recombination=0.9,
            tol=0.0,
            rng=self.random,
            callback=stepped,
            polish=False,
            vectorized=True,
            updating="deferred",
        )
        if self.steps % _CHECKED_EVERY == 0:
            self._confirm()

    def settled(self) -> bool:
        """True if the population has come together, so that nothing better is to be expected of it."""
        return bool(self.costs.max() <= min(_SAME * self.costs.min(), _LACKING))

    def finish(self) -> Tuning:
        """The best of all, with the gains that need not differ put back."""
        self._confirm(rounds=10)
        if self.best is None or self.best[2] >= self.still():
            raise self._none()
        return self.tuning(*self._put_back(*self.best))

    def tuning(self, law: Law, found: Check, worst: float) -> Tuning:
        """These gains and their evidence."""
        stood = self.law.numbers
        changed = {name: value for name, value in law.numbers.items() if value != stood[name]}
        before = max(self.errors_before)
        return Tuning(
            law=law,
            gains=changed,
            stood=stood,
            found=found,
            before=self.before,
            worst_rmse=worst,
            worst_before=before if np.isfinite(before) else None,
            bends=self.rig.bends,
            runs=self.runs.described,
            generations=self.steps,
        )

    def _names(self) -> list[str]:
        """Gains that are a choice and change the linear loop or the errors; switches are left as they are."""
        felt = gains_that_matter(self.law, self.rig.bench.sample_time, self.estimates[-1])
        if not (felt or self.rig.refuted):  # of a law for which no linear loop stands, the errors say
            raise ParameterError(
                f"law {self.law.name!r} has no gains that its loop feels", do="there is nothing to tune"
            )
        numbers = self.law.numbers
        open_ones = [
            name
            for name in self.law.choices
            if name not in self.fixed and numbers[name] != 0.0 and self.law.limits.get(name) != (0.0, 1.0)
        ]
        if not open_ones:
            raise ParameterError(
                f"law {self.law.name!r} has no gains that are a choice", do="there is nothing to tune: name another law"
            )
        varied = [self._with(self.law, name, 1.3 * self.law.numbers[name]) for name in open_ones]
        usual, *found = self.workers(errors, [self._task(law) for law in (self.law, *varied)])
        unknown = not np.isfinite(max(usual))
        return [n for n, e in zip(open_ones, found, strict=True) if n in felt or unknown or e != usual]

    def _law(self, point: Array, base: Law | None = None) -> Law:
        """The law at a point of the search: every gain as a share of where it began."""
        law = base or self.law
        begun = law.numbers
        for name, power in zip(self.names, point, strict=True):
            law = self._with(law, name, begun[name] * float(np.exp(power)))
        return law

    def _with(self, law: Law, name: str, value: float) -> Law:
        """The law with one gain rounded to three digits and kept inside its limits."""
        low, high = law.limits.get(name, (-np.inf, np.inf))
        stands = self.law.numbers[name]
        rounded = stands if np.isclose(value, stands, rtol=1e-9, atol=0.0) else float(f"{value:.3g}")
        return law.with_gains(**{name: float(np.clip(rounded, low, high))})

    def _task(self, law: Law, limit: float = np.inf) -> Task:
        return Task(self.rig, law, self.estimates, self.order, limit, self.runs)

    def _best(self, points: Sequence[Array], count: int) -> list[tuple[Array, float]]:
        """The best of some points with what they cost, the best first.

        The margins on the way take longest and are calculated last: of the smallest errors first, until enough keep
        them.
        """
        limit = 2.0 * max(self.errors_before)
        tasks = [self._task(self._law(point), limit)._replace(at_once=False) for point in points]
        scores = [(judged.shortfall, judged.worst) for judged in self.workers(judge_apart, tasks)]
        order = sorted(range(len(points)), key=lambda i: (scores[i], i))
        kept, refused = [i for i in order if scores[i][0] == 0.0], [i for i in order if scores[i][0] > 0.0]
        asked = [i for i in kept if scores[i][1] <= limit and scores[i][1] < np.inf]
        kept = kept[len(asked) :]
        passed: list[int] = []
        while asked and len(passed) < count:
            some, asked = asked[: count - len(passed)], asked[count - len(passed) :]
            for i, lacking in zip(some, self.workers(shortfall_on_the_way, [tasks[i] for i in some]), strict=True):
                scores[i] = (lacking, scores[i][1])
                (refused if lacking else passed).append(i)
        found = [*passed, *kept, *sorted(refused, key=lambda i: (scores[i], i))]
        return [(points[i], _cost(*scores[i])) for i in found[:count]]

    def _costs(self, points: Array) -> Array:
        """What points (k, m) cost (m,), all judged at once; infinite where it is more than the member's in whose place
        one would come, whose runs are then given up early."""
        if np.allclose(points.T, self.points):  # the members themselves, at the begin of a search
            if not self.stale:
                return self.costs
            self.costs, self.stale = np.full(len(self.points), np.inf), False
        tasks = [
            self._task(self._law(point), limit if limit < _LACKING else np.inf)
            for point, limit in zip(points.T, self.costs.tolist(), strict=True)
        ]
        judged: Iterable[Judged] = self.workers(judge, tasks)
        found = [
            _cost(one.shortfall, one.worst) if one.shortfall or one.worst <= task.limit else np.inf
            for task, one in zip(tasks, judged, strict=True)
        ]
        self.costs = np.minimum(self.costs, found)
        return np.array(found)

    def _confirm(self, rounds: int = 1) -> None:
        """Check members that are better than the best, the best of them first, two at a time."""
        for _ in range(rounds):
            limit = self.best[2] if self.best else _LACKING
            leading = [i for i in np.argsort(self.costs, kind="stable")[:2] if self.costs[i] < limit]
            laws = [self._law(self.points[i]) for i in leading]
            found: list[Check] = list(self.workers(checked, [self._task(law) for law in laws]))
            for i, law, one in zip(leading, laws, found, strict=True):
                if keeps(one):
                    self.best = law, one, float(self.costs[i])
                    run = errors(self._task(law))
                    self.order = tuple(sorted(range(len(run)), key=lambda k: -run[k]))
                    return
                self.costs[i] = _cost(1.0, np.inf)
                if one.worst.estimates not in self.estimates and len(self.estimates) < _MOST_ESTIMATES:
                    self.estimates, self.stale = (*self.estimates, one.worst.estimates), True
            if not leading:
                return

    def _put_back(self, law: Law, found: Check, worst: float) -> tuple[Law, Check, float]:
        """The same with every gain where it stood before that does not matter there."""
        plain = law
        for name, value in self.law.numbers.items():
            tried = plain.with_gains(**{name: value})
            if tried.gains != plain.gains:
                judged = judge(self._task(tried, worst * _SAME))
                plain = tried if judged.shortfall == 0.0 and judged.worst <= worst * _SAME else plain
        again = checked(self._task(plain))
        return (plain, again, max(errors(self._task(plain)))) if keeps(again) else (law, found, worst)

    def still(self) -> float:
        """What gains must stay below, to be of any use [rad]: the error of a joint that stands still."""
        return min(course_of(self.runs).spans)

    def _none(self) -> NoGainsError:
        """Why there are no gains, and the nearest rig that has some."""
        bench = self.rig.bench
        what = f"no gains of law {self.law.name!r} keep 6 dB and 45° and follow better than a joint that stands still"
        reason = (
            f"a servo of {bench.servo.natural_frequency / (2.0 * np.pi):.3g} Hz and damping {bench.servo.damping:.2g} "
            f"behind {1e3 * bench.delay * bench.sample_time:.3g} ms of delay leaves them too little phase or gain"
        )
        tasks = [self._task(self._law(point)) for point in self.points]
        if min(chatter(task) for task in tasks) > 0.0:
            count, most = bench.joint_encoder.resolution * DEGREES, MOST_PER_COUNT * DEGREES
            reason = f"one count of the joint's encoder, {count:.3g}°, changes the command by more than {most:g}°"
            raise NoGainsError(f"{what}: {reason}", do="take a finer encoder, or another law")
        best = self._law(self.points[int(np.argmin(self.costs))])
        found = self.before if best == self.law else checked(self._task(best))
        what += f"; the best of them {lacking(found)}"
        if keeps(found):
            worst, still = (value * DEGREES for value in (max(errors(self._task(best))), self.still()))
            reason = f"they are off by {worst:.3g}° RMS in the worst run, a joint that stands still by {still:.3g}°"
        near = self._nearest() if self.nearest else ""
        do = f"the nearest rig that has some: {near}" if near else "start from other gains, or choose another law"
        return NoGainsError(f"{what}: {reason}", do=do)

    def _nearest(self) -> str:
        """The smallest change of delay, cycle, damping or frequency for which gains hold that a search begins with."""
        bench, limit = self.rig.bench, self.still()
        for factor in _TRIED_FACTORS:
            for said, other in easier(bench, factor):
                rig, base = self.rig._replace(bench=other), informed(self.law, with_loop(self.known, other))
                tasks = [
                    self._task(self._law(point, base), limit)._replace(rig=rig, runs=NineRuns(rig))
                    for point in self._begun()
                ]
                judged = zip(tasks, self.workers(judge, tasks), strict=True)
                good = [task for task, one in judged if one.shortfall == 0.0 and one.worst < limit]
                if any(keeps(one) for one in self.workers(checked, good)):
                    return said
        return ""


def _cost(lacking: float, error: float) -> float:
    """A score as one number, by Deb's rule (2000): what lacks something comes after all that does not; what lacks no
    margin and runs away all the same, with what is unstable."""
    if not lacking and np.isfinite(error):
        return error
    return _LACKING * (1.0 + (lacking or UNSTABLE))


def lacking(found: Check) -> str:
    """How far gains are from the margins that are looked for, in words."""
    gain, phase = found.gain_margin_db, found.phase_margin_deg
    margins = [f"{value:.3g}{unit}" for value, unit in ((gain, " dB"), (phase, "°")) if value is not None]
    said = found.verdict.replace("_", " ")
    return f"have {' and '.join(margins)} ({said})" if margins else f"fail, since {found.reason}"


SHORTEST = 1e-3
"""Cycle that a rig is sent to, which the live loop keeps on a common computer [s]."""


def easier(bench: Plant, factor: float) -> Iterable[tuple[str, Plant]]:
    """The bench with a shorter delay, a shorter cycle, more damping and a faster servo, each as its key of rig.toml."""
    omega, damping = bench.servo.natural_frequency, bench.servo.damping
    if bench.delay:
        delay = int(bench.delay / factor)
        yield f"delay_cycles = {delay}", changed(bench, delay=delay)
    if bench.sample_time > SHORTEST:
        cycle = max(float(f"{bench.sample_time / factor:.3g}"), SHORTEST)
        yield f"sample_time_ms = {1e3 * cycle:.3g}", changed(bench, sample_time=cycle)
    if damping < 1.0:
        more = min(factor * damping, 1.0)
        yield f"damping = {more:.3g}", _with_servo(bench, bench.servo._replace(damping=more))
    hertz = factor * omega / (2.0 * np.pi)
    yield (
        f"natural_frequency_hz = {hertz:.3g}",
        _with_servo(bench, bench.servo._replace(natural_frequency=factor * omega)),
    )


def _with_servo(bench: Plant, servo: Servo) -> Plant:
    """The plant with another servo; a suit's is its motor's."""
    if isinstance(measured_plant(bench), Suit):
        return changed(bench, motor=bench.motor._replace(servo=servo))
    return changed(bench, servo=servo)
