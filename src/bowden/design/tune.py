"""Gains of a law that keep their margins over a rig's sheath, and follow best in the worst case.

1. The gains that the linear loop knows are drawn at random, even on a logarithmic scale around where they stand. A
   draw whose linear loops lack 6 dB or 45° is dropped before anything is simulated.
2. What is left is simulated over a set of sheath paths and references, and judged by its largest RMSE; then the best is
   varied in ever smaller steps.
3. The best is checked as `bowden check` does it. Where it fails at estimates that its own trials visit, these count for
   all from then on, and the search is repeated with what is left.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from bowden.control.law import Gains, Law
from bowden.control.reference import Multisine, PeriodicMinimumJerk, Trajectory
from bowden.core.errors import ParameterError
from bowden.design.advice import gains_that_matter
from bowden.design.check import STROKE, Check, Estimates, check, linear_points, visited_estimates
from bowden.sim.closed_loop import simulate
from bowden.sim.plant import Bench
from bowden.sim.scenario import BendPath, constant_bend, scripted_bend

WANTED_DB, WANTED_DEG = 6.0, 45.0
"""Margins that tuned gains keep."""
_RUN = 20.0
"""Length of one simulation [s]."""
_DRAWS, _VARIED, _ROUNDS = 300, 40, 6
_DECADES = 1.5
"""How far the draws reach below and above where the gains stand, in powers of ten."""

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class Tuning:
    """The gains that were found, and the evidence."""

    law: Law
    """With the new gains."""
    changed: Mapping[str, float]
    """Name → value of those that differ."""
    found: Check
    """Of the new gains."""
    worst_rmse: float
    """Largest RMSE over all runs, from rest [rad]."""
    worst_before: float | None
    """The same of the gains before [rad]; None where a run was unstable."""


def tune(
    bench: Bench,
    law: Law,
    *,
    bends: tuple[float, float] | None = None,
    stroke: tuple[float, float] = STROKE,
    seed: int = 0,
    report: Report = lambda what, share: None,
) -> Tuning:
    """Find gains.

    Args:
        bench: to tune for.
        law: with the gains from which the search starts.
        bends: smallest and largest total bend [rad]; the identified one and, as the sheath may be moved, its double
            where they are not given.
        stroke: ends of the motions [rad].
        seed: of the search.
        report: called with what is done and the share done.

    Raises:
        ParameterError: the law has no gains that the loop knows, or none keep the margins; the message has the reason
            and the nearest rig for which there are some.
    """
    ends = bends or (bench.sheath.bend, 2.0 * bench.sheath.bend)
    before = check(bench, law, bends=ends, stroke=stroke)
    usual = all(trial.bounded for trial in before.trials)
    estimates = visited_estimates(law, before.trials if usual else (), bench.sample_time)
    estimates = [estimates[0], estimates[-1]] if len(estimates) > 1 else estimates
    names = gains_that_matter(law, bench.sample_time, estimates[-1])
    if not names:
        raise ParameterError(f"law {law.name!r} has no gains that its loop feels", do="there is nothing to tune")
    random = np.random.default_rng(seed)
    draws = [law, *_draws(law, names, random, _DRAWS)]
    runs = list(scenarios(ends, stroke))
    fine, fresh = draws, estimates
    judged: dict[Gains, float | None] = {}
    for turn in range(_ROUNDS):
        kept = []
        for i, drawn in enumerate(fine):
            report("margins of random gains", (turn + 0.3 * i / len(fine)) / _ROUNDS)
            if _has_margins(bench, drawn, ends, fresh):
                kept.append(drawn)
        fine = kept
        if not fine:
            break
        for i, drawn in enumerate(fine[:_VARIED]):
            report("simulating gains", (turn + 0.3 + 0.3 * i / _VARIED) / _ROUNDS)
            _judge(judged, bench, drawn, runs)
        for i in range(_VARIED):
            report("refining gains", (turn + 0.6 + 0.4 * i / _VARIED) / _ROUNDS)
            (near,) = _draws(_best(judged, fine), names, random, 1, 0.3 * 0.1 ** (i / _VARIED))
            if _has_margins(bench, near, ends, estimates):
                fine.append(near)
                _judge(judged, bench, near, runs)
        best = _best(judged, fine)
        found, worst = check(bench, best, bends=ends, stroke=stroke), judged.get(best.gains)
        if worst is not None and found.verdict == "holds" and _wide(found.gain_margin_db, found.phase_margin_deg):
            changed = {n: getattr(best.gains, n) for n in names if getattr(best.gains, n) != getattr(law.gains, n)}
            return Tuning(best, changed, found, worst, worst_rmse(bench, law, runs))
        fine = [drawn for drawn in fine if drawn is not best]
        fresh = [found.worst.estimates]  # what these gains make of the estimates counts from now on
        estimates = [*estimates, *fresh]
    raise _none(bench, law, draws, ends, estimates)


def scenarios(bends: tuple[float, float], stroke: tuple[float, float]) -> Iterator[tuple[Trajectory, BendPath]]:
    """The runs by which gains are judged: minimum jerk of 4 and 10 s, a multisine; sheath straight, bent, moved."""
    low, high = stroke
    span, middle = high - low, 0.5 * (low + high)
    paths = [constant_bend(bend) for bend in dict.fromkeys(bends)]
    if bends[0] < bends[1]:
        paths.append(scripted_bend((5.0, 10.0, 15.0), (bends[0], bends[1], bends[0])))
    for path in paths:
        yield PeriodicMinimumJerk(low, high, 4.0), path
        yield PeriodicMinimumJerk(low, high, 10.0), path
        yield Multisine((0.07, 0.19, 0.43), (0.3 * span, 0.12 * span, 0.06 * span), (0.0, 1.5, 3.0), middle), path


def worst_rmse(bench: Bench, law: Law, runs: list[tuple[Trajectory, BendPath]], limit: float = np.inf) -> float | None:
    """Largest RMSE over the runs [rad]; None where one is unstable or, to save time, where one exceeds the limit."""
    worst = 0.0
    for reference, path in runs:
        start = float(reference.sample(np.zeros(1))[0, 0] - bench.cable.offset) / bench.cable.slope
        trace = simulate(bench, law, reference, duration=_RUN, bend=path, seed=3, initial_motor=start)
        if not trace.stable:
            return None
        error = trace.columns["joint"] - trace.columns["reference"]
        worst = max(worst, float(np.sqrt(np.mean(error**2))))
        if worst > limit:
            return None
    return worst


def _judge(judged: dict[Gains, float | None], bench: Bench, law: Law, runs: list[tuple[Trajectory, BendPath]]) -> None:
    """Note a law's worst RMSE; None where it is unstable or far above the best."""
    if law.gains not in judged:
        known = [worst for worst in judged.values() if worst is not None]
        judged[law.gains] = worst_rmse(bench, law, runs, 1.5 * min(known, default=np.inf))


def _best(judged: Mapping[Gains, float | None], laws: list[Law]) -> Law:
    def worst(law: Law) -> float:
        value = judged.get(law.gains)
        return float(np.inf) if value is None else value

    return min(laws, key=worst)


def _draws(law: Law, names: list[str], random: np.random.Generator, count: int, sigma: float = 0.0) -> list[Law]:
    """Laws with random gains, rounded to three digits and kept inside their limits."""
    drawn = []
    for _ in range(count):
        gains = {}
        for name in names:
            power = random.normal(0.0, sigma) if sigma else random.uniform(-_DECADES, _DECADES)
            low, high = law.limits.get(name, (-np.inf, np.inf))
            gains[name] = float(np.clip(float(f"{getattr(law.gains, name) * 10.0**power:.3g}"), low, high))
        drawn.append(law.with_gains(**gains))
    return drawn


def _wide(gain_margin_db: float | None, phase_margin_deg: float | None) -> bool:
    enough = gain_margin_db is None or gain_margin_db >= WANTED_DB
    return enough and (phase_margin_deg is None or phase_margin_deg >= WANTED_DEG)


def _has_margins(bench: Bench, law: Law, bends: tuple[float, float], estimates: list[Estimates]) -> bool:
    for values in estimates:
        points = linear_points(bench, law, bends, [values], bench.joint_encoder.resolution or 1e-6)
        if not all(p.margins.stable and _wide(p.margins.gain_margin_db, p.margins.phase_margin_deg) for p in points):
            return False
    return True


def _none(
    bench: Bench, law: Law, draws: list[Law], bends: tuple[float, float], estimates: list[Estimates]
) -> ParameterError:
    """Why there are no gains, and the nearest rig that has some: with a shorter delay, or a stiffer damping."""
    what = (
        f"no gains of law {law.name!r} within a factor of {10**_DECADES:.0f} keep {WANTED_DB:g} dB and {WANTED_DEG:g}°"
    )
    reason = f"a servo of {bench.servo.natural_frequency / (2.0 * np.pi):.3g} Hz and damping {bench.servo.damping:.2g}"
    reason += f" behind {1e3 * bench.delay * bench.sample_time:.3g} ms of delay leaves them too little phase or gain"
    delay = bench.delay
    while delay:
        delay //= 2
        if any(_has_margins(bench._replace(delay=delay), drawn, bends, estimates) for drawn in draws[:60]):
            return ParameterError(f"{what}: {reason}", do=f"the nearest rig that has some: delay_cycles = {delay}")
    damped = bench._replace(servo=bench.servo._replace(damping=1.0))
    if bench.servo.damping < 1.0 and any(_has_margins(damped, drawn, bends, estimates) for drawn in draws[:60]):
        return ParameterError(f"{what}: {reason}", do="the nearest rig that has some: servo damping = 1")
    return ParameterError(f"{what}: {reason}", do="start from other gains, or choose another law")
