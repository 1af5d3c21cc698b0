"""Do the laws of several motors hold on one joint? The check of `bowden.design.check`, of all motors as one."""

import itertools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.core.units import DEGREES, RADIANS
from bowden.design.check import (
    IDEAL,
    ROUNDING,
    all_estimates,
    at_rest,
    delay_per_degree,
    further_delay,
    judge,
    largest_change,
    severity,
    usable,
)
from bowden.design.check_result import (
    Check,
    Estimates,
    Point,
    SharedFindings,
    TautLoop,
    VerdictName,
    confirmed_by,
    swing_of,
)
from bowden.design.joint_loops import MotorLoop, cases, joint_margins, reaches
from bowden.design.limit_cycle import AMPLITUDES, MEASURED, LimitCycle, describing_function, predict
from bowden.design.linear_plant import slopes_of
from bowden.design.linearise import linearise
from bowden.design.trial import AFTER, MOVING, Bounds, Trial, judged, motion, settled_after
from bowden.models.cable.shared_joint import shares
from bowden.plants.bench import Bench
from bowden.plants.plant import changed
from bowden.plants.transmission import transmission
from bowden.records.trace import Trace
from bowden.sim.joint import CabledJoint, Range, simulate_joint
from bowden.sim.parting import asked_by, parting_of

Bends = tuple[float, ...]
"""Of each motor's sheath [rad]."""
Laws = Sequence[Law]
"""Of each motor."""


class _Tried(NamedTuple):
    """What the trials showed."""

    trials: tuple[Trial, ...]
    """Of each bend and motor, by turns."""
    estimates: list[tuple[Estimates, ...]]
    """Of each motor's law."""
    drift: float
    """How far motors went apart beyond the co-contraction, or less far, each [rad]."""


def check_joint(joint: CabledJoint, laws: Laws, *, bends: Sequence[Range], stroke: Range, seed: int = 1) -> Check:
    """Judge laws on one joint.

    As `bowden.design.check.check`, with the linear loops of all motors as one (`bowden.design.joint_loops`), for all
    cables taut and for each alone, and with trials of all. Trials also show how far the motors part while the joint
    stands, which no law feeds back: further than a joint at rest may move, and the laws do not hold.

    Args:
        joint: with its motors.
        laws: of each motor.
        bends: smallest and largest of each motor's sheath [rad]; every one is tried with every one of the others, since
            it is where they differ most that the cables disagree most.
        stroke: ends of the trials' motion [rad].
        seed: of the encoders' noise.

    Raises:
        ParameterError: gains that are not finite, bends or a stroke that cannot be, motors that no one loop can have,
            or whose cables do not follow them.
    """
    joint = joint.seeded(seed)
    each = [usable(law, own, stroke) for law, own in zip(laws, bends, strict=True)]
    ends = tuple(dict.fromkeys(itertools.product(*each)))
    trials, estimates, drift = _tried(joint, laws, ends, stroke)
    count = joint.first.joint_encoder.resolution or IDEAL
    loops = _linear(joint, laws, ends, estimates, count, stroke)
    points = tuple(loop.point for loop in loops)
    deciding = min(loops, key=lambda loop: severity(loop.point))
    worst, bounded = deciding.point, all(trial.bounded for trial in trials)
    chatters = False
    if not worst.margins.stable:
        wide = _linear(joint, laws, ends, estimates, 0.5 * abs(stroke[1] - stroke[0]), stroke)
        chatters = all(loop.point.margins.largest_pole < 1.0 + ROUNDING for loop in wide)
    reserve = None
    if bounded and severity(worst) >= 1.0:
        reserve = _reserve(joint, laws, points, deciding.bends, stroke)
    cycle = _predicted_cycle(joint, laws, ends, estimates, stroke)
    verdict, reason = judge(worst, trials, None, chatters, reserve, refuted=False, whole=True)
    if verdict != "does_not_hold":
        confirmed = bool(confirmed_by(cycle, swing_of(trials)))
        zones = [zone for own in ends for zone in [_dead_zone(joint, own, stroke)] * len(laws)]
        verdict, reason = at_rest(trials, zones, verdict, reason, confirmed=confirmed)
        each_two = itertools.combinations(range(len(laws)), 2)
        most = min(parting_of(joint, bends, stroke, i, j).most for i, j in each_two)
        verdict, reason = _together(verdict, reason, drift, most)
    taut = dict.fromkeys(loop.at for loop in loops)
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
        shared=SharedFindings(
            tuple(_taut_loop(at, [loop.point for loop in loops if loop.at == at]) for at in taut),
            drift if bounded else None,
            max(loop.apart for loop in loops),
        ),
    )


def _dead_zone(joint: CabledJoint, bends: Bends, stroke: Range) -> float:
    """What the joint loses in a reversal, and what it is free by where the cables hang slack [rad]."""
    each = zip(joint.motors, bends, strict=True)
    found = [(one.sign, transmission(one.bench, bend, one.own_stroke(stroke))) for one, bend in each]
    ways = [max(one.slope for way, one in found if way == sign) for sign in (1.0, -1.0)]
    return max(one.dead_zone for _, one in found) + max(0.0, -joint.co_contraction) * sum(ways)


def _tried(joint: CabledJoint, laws: Laws, ends: Iterable[Bends], stroke: Range) -> _Tried:
    """The trials; longer ones where there are estimates that settle later, and the trials stay bounded."""
    for moving in dict.fromkeys((MOVING, max(MOVING, *(settled_after(law) for law in laws)))):
        trials, drift = list[Trial](), 0.0
        for bends in ends:
            traces = simulate_joint(
                joint.at_bends(bends),
                laws,
                motion(stroke, moving),
                duration=moving + AFTER,
                initial_motors=joint.resting_motors(stroke[0], bends),
            )
            length = abs(stroke[1] - stroke[0])
            bounds = Bounds(length, 2.0 * _dead_zone(joint, bends, stroke) + RADIANS, 0.0)
            trials += [judged(trace, length, moving, bounds) for trace in traces]
            drift = max(drift, _went_apart(joint, bends, stroke, traces))
        dt, count = joint.first.sample_time, len(laws)
        visited = [*zip(*(all_estimates(law, trials[i::count], dt) for i, law in enumerate(laws)), strict=True)]
        estimates = [one for i, one in enumerate(visited) if one not in visited[i + 1 :]]
        if not any(estimates[-1]) or not all(trial.bounded for trial in trials):
            break
    return _Tried(tuple(trials), estimates, drift)


def _went_apart(joint: CabledJoint, bends: Bends, stroke: Range, traces: Sequence[Trace]) -> float:
    """How much further, or less far, motors came to pull against each other than joint and co-contraction ask [rad].

    Each by its own cable (`bowden.sim.parting`): motors that go alike behind cables of two slopes pull ever further, or
    let go.
    """
    off = []
    for one, bend, trace in zip(joint.motors, bends, traces, strict=True):
        asked = asked_by(one, bend, stroke)
        off.append(trace["motor"] - asked.offset - asked.way * trace["joint"])
    apart = 0.5 * (np.max(off, axis=0) - np.min(off, axis=0))
    return float(np.max(apart, initial=0.0, where=np.isfinite(apart)))


class _Loop(NamedTuple):
    """One linear loop of a joint."""

    point: Point
    bends: Bends
    at: str
    """Which cables are taut."""
    apart: float
    """The largest pole with which motors part [–]."""


def _linear(
    joint: CabledJoint,
    laws: Laws,
    ends: tuple[Bends, ...],
    estimates: list[tuple[Estimates, ...]],
    width: float,
    stroke: Range,
) -> list[_Loop]:
    """Every loop: of each bend and slope, with each set of estimates, all cables taut and each alone."""
    motors, dt, found = joint.motors, joint.first.sample_time, []
    said = ["all cables taut", *(f"{one.name} alone taut" for one in motors)]
    for values in estimates:
        models = [linearise(law, dt, width=width, estimates=one) for law, one in zip(laws, values, strict=True)]
        jump = max(largest_change(model) for model in models) * joint.first.joint_encoder.resolution
        own = dict(values[0])
        for one, more in zip(motors[1:], values[1:], strict=True):
            own |= {f"{one.name}: {name}": value for name, value in more.items()}
        for bends in ends:
            others = " and ".join(f"{bend * DEGREES:.0f}°" for bend in bends[1:])
            beside = "" if len({*bends}) == 1 else f", with other bends of {others}"
            each = [slopes_of(one.bench, bend, one.own_stroke(stroke)) for one, bend in zip(motors, bends, strict=True)]
            for slopes in itertools.product(*each):
                loops = [
                    MotorLoop(one.bench.servo, one.bench.delay, slope, model)
                    for one, slope, model in zip(motors, slopes, models, strict=True)
                ]
                for taut, at in zip(cases(len(motors)), said, strict=True):
                    margins = joint_margins(loops, joint.load, taut, dt)
                    reach = float(np.sum(reaches(loops, joint.load, taut)))
                    point = Point(bends[0], reach, own, margins.joint, at + beside, jump)
                    found.append(_Loop(point, bends, at, margins.apart))
    return found


def _taut_loop(where: str, points: list[Point]) -> TautLoop:
    own = [point.margins for point in points]

    def least(name: str) -> float | None:
        values = [getattr(one, name) for one in own]
        there = [value for value in values if value is not None]
        return min(there) if there and all(one.stable for one in own) else None

    return TautLoop(where, *(least(name) for name in ("gain_margin_db", "phase_margin_deg", "delay_margin_s")))


def _reserve(joint: CabledJoint, laws: Laws, points: Sequence[Point], bends: Bends, stroke: Range) -> bool | None:
    """True if a trial stands a part of the phase margin as delay of all commands; None where nothing limits it."""
    per_degree = delay_per_degree(points)
    if per_degree is None:
        return None
    further = further_delay(per_degree, joint.first.sample_time)
    later = (one._replace(bench=changed(one.bench, delay=one.bench.delay + further)) for one in joint.motors)
    return all(trial.bounded for trial in _tried(joint._replace(motors=tuple(later)), laws, (bends,), stroke).trials)


def _predicted_cycle(
    joint: CabledJoint,
    laws: Laws,
    ends: tuple[Bends, ...],
    estimates: list[tuple[Estimates, ...]],
    stroke: Range,
) -> LimitCycle | None:
    """The largest limit cycle in which all motors go alike, all cables taut: N is what all make of it."""
    motors, cycles = joint.motors, []
    amplitudes = AMPLITUDES if all(isinstance(one.bench, Bench) for one in motors) else MEASURED
    share = shares(joint.load, (True,) * len(motors))
    width = joint.first.joint_encoder.resolution or IDEAL
    for bends in ends:
        gains = sum(
            part * describing_function(one.bench, bend, one.own_stroke(stroke), amplitudes)[1]
            for part, one, bend in zip(share, motors, bends, strict=True)
        )
        for values in (estimates[0], estimates[-1]):
            for one, law, own in zip(motors, laws, values, strict=True):
                bench = one.bench
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
