"""Do two laws hold on one joint? The check of `bowden.design.check`, of both motors and cables as one."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.core.units import DEGREES, RADIANS
from bowden.design.check import (
    IDEAL,
    ROUNDING,
    Check,
    Estimates,
    PairFindings,
    Point,
    TautLoop,
    VerdictName,
    all_estimates,
    at_rest,
    confirmed_by,
    delay_per_degree,
    further_delay,
    judge,
    largest_change,
    severity,
    swing_of,
    usable,
)
from bowden.design.limit_cycle import AMPLITUDES, MEASURED, LimitCycle, describing_function, predict
from bowden.design.linearise import LawModel, linearise
from bowden.design.pair_loops import BOTH, DOWN_ALONE, UP_ALONE, SideLoop, Taut, pair_margins, reaches
from bowden.design.trial import AFTER, MOVING, Bounds, Trial, judged, motion, settled_after
from bowden.models.cable.shared_joint import shares
from bowden.plants.bench import Bench
from bowden.plants.plant import changed
from bowden.plants.transmission import transmission
from bowden.records.trace import Trace
from bowden.sim.pair import PairPlant, PairSide, simulate_pair
from bowden.sim.parting import Range, asked_by, parting_of
from bowden.sim.scenario import constant_bend

Bends = tuple[float, float]
"""Of both sheaths, the agonist's first [rad]."""
Laws = tuple[Law, Law]
"""The agonist's first."""


class _Tried:
    """What the trials of a pair showed."""

    def __init__(self) -> None:
        self.trials: list[Trial] = []  # the agonist's and the antagonist's of each bend, by turns
        self.drift = 0.0
        """How far the motors went apart beyond the co-contraction, or less far, each [rad]."""
        self.estimates: list[tuple[Estimates, Estimates]] = []


def check_pair(
    pair: PairPlant, laws: Laws, *, bends: tuple[Range, Range], stroke: tuple[float, float], seed: int = 1
) -> Check:
    """Judge two laws on one joint.

    As `bowden.design.check.check`, with the linear loops of both sides as one (`bowden.design.pair_loops`), for both
    cables taut and for each alone, and with trials of both. Trials also show how far the motors part while the joint
    stands, which no law feeds back: further than a joint at rest may move, and the pair does not hold.

    Args:
        pair: both sides.
        laws: of each.
        bends: smallest and largest of each sheath, the agonist's first [rad]; every one of the agonist's is tried with
            every one of the antagonist's, since it is where they differ most that the cables disagree most.
        stroke: ends of the trials' motion [rad].
        seed: of the encoders' noise.

    Raises:
        ParameterError: gains that are not finite, bends or a stroke that cannot be, sides that no one loop can have, or
            that do not follow their motors.
    """
    pair = _seeded(pair, seed)
    one, other = (usable(law, own, stroke) for law, own in zip(laws, bends, strict=True))
    ends = tuple(dict.fromkeys(itertools.product(one, other)))
    tried = _tried(pair, laws, ends, stroke)
    trials, count = tuple(tried.trials), pair.agonist.bench.joint_encoder.resolution or IDEAL
    found = _linear(pair, laws, ends, tried.estimates, count, stroke)
    points, worst = found.points, found.worst
    bounded = all(trial.bounded for trial in trials)
    chatters = False
    if not worst.margins.stable:
        wide = _linear(pair, laws, ends, tried.estimates, 0.5 * abs(stroke[1] - stroke[0]), stroke)
        chatters = all(point.margins.largest_pole < 1.0 + ROUNDING for point in wide.points)
    reserve = None
    if bounded and severity(worst) >= 1.0:
        reserve = _reserve(pair, laws, points, found.worst_bends, stroke)
    cycle = _predicted_cycle(pair, laws, ends, tried.estimates, stroke)
    verdict, reason = judge(worst, trials, None, chatters, reserve, refuted=False, whole=True)
    if verdict != "does_not_hold":
        confirmed = bool(confirmed_by(cycle, swing_of(trials)))
        zones = [zone for both in ends for zone in [_dead_zone(pair, both, stroke)] * 2]
        verdict, reason = at_rest(trials, zones, verdict, reason, confirmed=confirmed)
        verdict, reason = _together(verdict, reason, tried.drift, parting_of(pair, bends, stroke).most)
    return Check(
        law=laws[0].name,
        verdict=verdict,
        reason=reason,
        points=points,
        worst=worst,
        cycle=cycle,
        trials=trials,
        reserve=reserve,
        chatters=chatters,
        command_per_count=max(point.per_count for point in points),
        ultimate_s=None,
        ultimate_error=None,
        pair=PairFindings(found.taut, tried.drift if bounded else None, found.apart),
    )


def _seeded(pair: PairPlant, seed: int) -> PairPlant:
    return pair._replace(agonist=pair.agonist._replace(seed=seed), antagonist=pair.antagonist._replace(seed=seed + 1))


def at_bends(pair: PairPlant, bends: Bends) -> PairPlant:
    """The pair with its sheaths held at these bends."""
    one, other = (side._replace(bend=constant_bend(bend)) for side, bend in zip(pair.sides, bends, strict=True))
    return pair._replace(agonist=one, antagonist=other)


def _dead_zone(pair: PairPlant, bends: Bends, stroke: tuple[float, float]) -> float:
    """What the joint loses in a reversal, and what it is free by where both cables hang slack [rad]."""
    found = [
        transmission(side.bench, bend, side.own_stroke(stroke)) for side, bend in zip(pair.sides, bends, strict=True)
    ]
    slack = max(0.0, -pair.co_contraction) * sum(one.slope for one in found)
    return max(one.dead_zone for one in found) + slack


def _tried(pair: PairPlant, laws: Laws, ends: Iterable[Bends], stroke: tuple[float, float]) -> _Tried:
    """The trials; longer ones where there are estimates that settle later, and the trials stay bounded."""
    for moving in dict.fromkeys((MOVING, max(MOVING, *(settled_after(law) for law in laws)))):
        found = _Tried()
        for bends in ends:
            trials, drift = _trial(pair, laws, bends, stroke, moving)
            found.trials += trials
            found.drift = max(found.drift, drift)
        pairs = zip(
            *(all_estimates(law, found.trials[i::2], pair.sample_time) for i, law in enumerate(laws)), strict=True
        )
        visited = list(pairs)
        found.estimates = [one for i, one in enumerate(visited) if one not in visited[i + 1 :]]
        if not any(found.estimates[-1]) or not all(trial.bounded for trial in found.trials):
            break
    return found


def _trial(
    pair: PairPlant, laws: Laws, bends: Bends, stroke: tuple[float, float], moving: float
) -> tuple[tuple[Trial, Trial], float]:
    """One run of both, as each side shows it, and how far the motors went apart [rad]."""
    traces = simulate_pair(
        at_bends(pair, bends),
        laws,
        motion(stroke, moving),
        duration=moving + AFTER,
        initial_motors=pair.resting_motors(stroke[0], bends),
    )
    length = abs(stroke[1] - stroke[0])
    bounds = Bounds(length, 2.0 * _dead_zone(pair, bends, stroke) + RADIANS, 0.0)
    one, other = (judged(trace, length, moving, bounds) for trace in traces)
    return (one, other), _went_apart(pair, bends, stroke, traces)


def _went_apart(pair: PairPlant, bends: Bends, stroke: tuple[float, float], traces: tuple[Trace, Trace]) -> float:
    """How much further, or less far, each motor came to pull than joint and co-contraction ask [rad].

    Each by its own cable (`bowden.sim.parting`): motors that go alike behind cables of two slopes pull ever further, or
    let go.
    """
    apart = np.zeros(len(traces[0].time))
    for sign, side, bend, trace in zip((0.5, -0.5), pair.sides, bends, traces, strict=True):
        asked = asked_by(side, bend, stroke)
        apart += sign * (trace["motor"] - asked.offset - asked.way * trace["joint"])
    return float(np.max(np.abs(apart), initial=0.0, where=np.isfinite(apart)))


def _slopes(side: PairSide, bend: float, stroke: tuple[float, float]) -> list[float]:
    found = transmission(side.bench, bend, side.own_stroke(stroke))
    return [found.slope, found.steepest] if found.steepest > found.slope else [found.slope]


class _Loops(NamedTuple):
    """Every linear loop of a pair."""

    points: tuple[Point, ...]
    bends: tuple[Bends, ...]
    """Of each point."""
    taut: tuple[TautLoop, ...]
    """The smallest margins of each case."""
    apart: float
    """The largest pole with which the motors part [–]."""

    @property
    def worst(self) -> Point:
        """The one that decides."""
        return min(self.points, key=severity)

    @property
    def worst_bends(self) -> Bends:
        """Of both sheaths there."""
        return self.bends[self.points.index(self.worst)]


def _linear(
    pair: PairPlant,
    laws: Laws,
    ends: tuple[Bends, ...],
    estimates: list[tuple[Estimates, Estimates]],
    width: float,
    stroke: tuple[float, float],
) -> _Loops:
    """Every loop: of each bend and slope, with each set of estimates, both cables taut and each alone."""
    up, dt = pair.up, pair.sample_time
    names = [pair.sides[i].name for i in (up, 1 - up)]
    said = {BOTH: "both cables taut", UP_ALONE: f"{names[0]} alone taut", DOWN_ALONE: f"{names[1]} alone taut"}
    points, of, cases, apart = list[Point](), list[Bends](), list[Taut](), 0.0
    for values in estimates:
        models = [linearise(law, dt, width=width, estimates=one) for law, one in zip(laws, values, strict=True)]
        jump = max(largest_change(model) for model in models) * pair.agonist.bench.joint_encoder.resolution
        own = values[0] | {f"{pair.antagonist.name}: {name}": value for name, value in values[1].items()}
        for bends in ends:
            each = [_slopes(side, bend, stroke) for side, bend in zip(pair.sides, bends, strict=True)]
            beside = "" if bends[0] == bends[1] else f", the other sheath's {bends[1] * DEGREES:.0f}°"
            for slopes in itertools.product(*each):
                loops = [_side(pair, i, slopes[i], models[i]) for i in (up, 1 - up)]
                for taut, where in said.items():
                    found = pair_margins(loops[0], loops[1], pair.load, taut, dt)
                    reach = float(np.sum(reaches(loops[0], loops[1], pair.load, taut)))
                    points.append(Point(bends[0], reach, own, found.joint, where + beside, jump))
                    of.append(bends)
                    cases.append(taut)
                    apart = max(apart, found.apart)
    loops_of = [
        _taut_loop(where, [point for point, case in zip(points, cases, strict=True) if case == taut])
        for taut, where in said.items()
    ]
    return _Loops(tuple(points), tuple(of), tuple(loops_of), apart)


def _side(pair: PairPlant, i: int, slope: float, model: LawModel) -> SideLoop:
    bench = pair.sides[i].bench
    return SideLoop(bench.servo, bench.delay, slope, model)


def _taut_loop(where: str, points: list[Point]) -> TautLoop:
    own = [point.margins for point in points]

    def least(name: str) -> float | None:
        values = [getattr(one, name) for one in own]
        there = [value for value in values if value is not None]
        return min(there) if there and all(one.stable for one in own) else None

    return TautLoop(where, *(least(name) for name in ("gain_margin_db", "phase_margin_deg", "delay_margin_s")))


def _reserve(
    pair: PairPlant, laws: Laws, points: Sequence[Point], bends: Bends, stroke: tuple[float, float]
) -> bool | None:
    """Whether a trial stands a part of the phase margin as delay of both commands; None where nothing limits it."""
    per_degree = delay_per_degree(points)
    if per_degree is None:
        return None
    further = further_delay(per_degree, pair.sample_time)
    one, other = (side._replace(bench=changed(side.bench, delay=side.bench.delay + further)) for side in pair.sides)
    later = _tried(pair._replace(agonist=one, antagonist=other), laws, (bends,), stroke)
    return all(trial.bounded for trial in later.trials)


def _predicted_cycle(
    pair: PairPlant,
    laws: Laws,
    ends: tuple[Bends, ...],
    estimates: list[tuple[Estimates, Estimates]],
    stroke: tuple[float, float],
) -> LimitCycle | None:
    """The largest limit cycle in which both motors go alike, both cables taut: N is what both make of it."""
    amplitudes = AMPLITUDES if all(isinstance(side.bench, Bench) for side in pair.sides) else MEASURED
    share, cycles = shares(pair.load, True, True), []
    width = pair.agonist.bench.joint_encoder.resolution or IDEAL
    for bends in ends:
        both = [
            describing_function(side.bench, bend, side.own_stroke(stroke), amplitudes)[1]
            for side, bend in zip(pair.sides, bends, strict=True)
        ]
        gains = share.up * both[pair.up] + share.down * both[1 - pair.up]
        for values in (estimates[0], estimates[-1]):
            for side, law, own in zip(pair.sides, laws, values, strict=True):
                bench = side.bench
                model = linearise(law, bench.sample_time, width=width, estimates=own)
                cycles.append(predict(gains, bench.servo, bench.delay, model, bench.sample_time, amplitudes))
    return max((cycle for cycle in cycles if cycle), key=lambda cycle: cycle.amplitude, default=None)


def _together(verdict: VerdictName, reason: str, drift: float, most: float) -> tuple[VerdictName, str]:
    """Whether the motors stay as far apart as they are to be."""
    if drift <= most:
        return verdict, reason
    return "does_not_hold", (
        f"the motors go apart by {drift * DEGREES:.3g}° beyond the co-contraction, where {most * DEGREES:.3g}° are "
        "borne: no law feeds back what the joint does not show"
    )


def with_advice(found: Check, pair: PairPlant) -> Check:
    """The check with what to do where it does not hold."""
    if found.holds:
        return found
    one, other = (side.name for side in pair.sides)
    return replace(found, advice=f"check each alone (--axis {one}, --axis {other}), and lower the gains of both alike")
