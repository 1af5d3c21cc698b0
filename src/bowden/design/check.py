"""Do the laws of a joint hold? Margins over all slopes of the sheaths, limit cycle, chatter, proof and trial."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.core.errors import ParameterError
from bowden.core.nested import flat, from_columns, names
from bowden.core.signals import Sample
from bowden.core.units import DEGREES, RADIANS
from bowden.design.check_result import (
    ENOUGH_DB,
    ENOUGH_DEG,
    Check,
    Estimates,
    Point,
    SharedFindings,
    TautLoop,
    VerdictName,
    confirmed_by,
    least,
    swing_of,
)
from bowden.design.limit_cycle import LimitCycle, describing_function, predict
from bowden.design.linear_plant import laws_seen, linear_plant
from bowden.design.linearise import LawModel, find_estimates, linearise
from bowden.design.trial import MOVING, Trial, run_trial, settled_after
from bowden.plants.estimated import Estimated
from bowden.plants.plant import Plant, changed
from bowden.plants.transmission import transmission, unrest

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Bends = tuple[float, ...]
"""Of each motor's sheath [rad]."""
Laws = Sequence[Law]
"""Of each motor."""
Visited = tuple[Estimates, ...]
"""Estimates of each motor's law at one time."""

STROKE = (0.0, 70.0 * RADIANS)
"""Of the trial, where none is given [rad]."""
RESERVE = 0.25
"""Of `ENOUGH_DEG`: what a loop with all its margins must stand in simulation too, play and estimates included."""
IDEAL = 1e-6
"""Width of the differences where the encoder is ideal [rad]."""
_AT_REST = 0.5 * RADIANS
"""Half of a joint's span that is rest where nothing holds it back [rad]."""
_MOST_ESTIMATES = 3
"""Of a law, that a reason names; a law with more is not understood by them."""
ROUNDING = 1e-9
"""By which a pole that is one may seem larger."""
_AFTER_COUNT = 10
"""Cycles after a count in which the command's largest change is looked for."""


@dataclass(frozen=True)
class LinearLoop:
    """One linear loop of all motors."""

    point: Point
    bends: Bends
    at: str = ""
    """Which cables are taut, of several."""
    apart: float = 0.0
    """The largest pole with which motors part [–]."""


class Subject(Protocol):
    """The motors of one joint, one or several, with a law each: what the check judges as one."""

    @property
    def laws(self) -> Laws:
        """Of each motor."""
        ...

    @property
    def plants(self) -> Sequence[Plant]:
        """Of each motor; the first has the joint's encoder."""
        ...

    @property
    def stroke(self) -> tuple[float, float]:
        """Ends of the trials' motion [rad]."""
        ...

    def trial(self, bends: Bends, moving: float, later: int) -> tuple[Sequence[Trial], float]:
        """A trial at these bends that moves for so long [s], with further cycles of delay: of each motor, and how far
        they went apart beyond what is asked [rad]."""
        ...

    def linear(
        self, ends: Sequence[Bends], estimates: Sequence[Visited], width: float, *, reversals: bool
    ) -> list[LinearLoop]:
        """The linear loops at every bend and slope with every set of estimates, seen through differences of a width."""
        ...

    def response(self, bends: Bends) -> tuple[Array, Complex]:
        """Amplitudes and describing function of the joint, all cables taut."""
        ...

    def dead_zone(self, bends: Bends) -> float:
        """What the joint loses in a reversal [rad]."""
        ...

    def most_apart(self) -> float:
        """How far motors may go apart beyond what is asked [rad]."""
        ...


@dataclass(frozen=True)
class _OneMotor:
    """A plant with one motor, of whatever kind."""

    plants: tuple[Plant]
    laws: tuple[Law]
    stroke: tuple[float, float]
    seed: int

    def trial(self, bends: Bends, moving: float, later: int) -> tuple[Sequence[Trial], float]:
        plant = changed(self.plants[0], delay=self.plants[0].delay + later) if later else self.plants[0]
        return (run_trial(plant, self.laws[0], bends[0], self.stroke, self.seed, moving),), 0.0

    def linear(
        self, ends: Sequence[Bends], estimates: Sequence[Visited], width: float, *, reversals: bool
    ) -> list[LinearLoop]:
        bends, own = [bend for (bend,) in ends], [values for (values,) in estimates]
        points = linear_points(*self.plants, *self.laws, bends, own, width, self.stroke, reversals=reversals)
        return [LinearLoop(point, (point.bend,)) for point in points]

    def response(self, bends: Bends) -> tuple[Array, Complex]:
        return describing_function(self.plants[0], bends[0], self.stroke)

    def dead_zone(self, bends: Bends) -> float:
        plant = self.plants[0]
        wander = unrest(plant, bends[0], self.stroke, 0.0).span if isinstance(plant, Estimated) else 0.0
        return transmission(plant, bends[0], self.stroke).dead_zone + wander

    def most_apart(self) -> float:
        return math.inf


def check(
    bench: Plant,
    law: Law,
    *,
    bends: tuple[float, float] | None = None,
    stroke: tuple[float, float] = STROKE,
    seed: int = 1,
) -> Check:
    """Judge a law on a bench: `check_motors` of one motor.

    Args:
        bench: with the cable.
        law: with its gains.
        bends: smallest and largest total bend of the sheath [rad]; the identified one where it is not given.
        stroke: ends of the trials' motion [rad].
        seed: of the encoders' noise.

    Raises:
        ParameterError: gains that are not finite, bends or a stroke that cannot be.
    """
    ends = usable(law, bends or (bench.sheath.bend, bench.sheath.bend), stroke)
    linear = linear_plant(bench, ends, stroke)
    found = check_motors(
        _OneMotor((bench,), (law,), stroke, seed),
        tuple((bend,) for bend in ends),
        leaves_out=linear.leaves_out,
        alone=None if linear.alone is None else _OneMotor((linear.alone,), (law,), stroke, seed),
    )
    if law.proven is None or linear.leaves_out:
        return found
    seen = transmission(bench, ends[1], stroke)
    bound = law.proven(law.gains, seen.slope, 0.5 * seen.dead_zone)
    return replace(found, ultimate_s=bound.filtered_error, ultimate_error=bound.error) if bound else found


def check_motors(
    subject: Subject, ends: Sequence[Bends], *, leaves_out: str = "", alone: Subject | None = None
) -> Check:
    """Judge the laws of a joint: `holds`, `little_margin` (below 6 dB or 30°), `limit_cycle` or `does_not_hold`.

    Each law is linearised at rest, one encoder count wide, with its estimates frozen at their start and at what they
    visit in trials (the ends of the bends, long enough for them to settle), and the joint's margins are taken for every
    slope that the cables have there. A cable that is steeper after a reversal counts with that slope; one that is
    flatter is left to the describing function and to the trials: no linear loop with an integral survives a slope of
    zero. What would hold must stand a part of its margin in a further trial. Trials also show how far several motors
    part while the joint stands, which no law feeds back: further than a joint at rest may move, and they do not hold.

    Args:
        subject: the motors with their laws.
        ends: of the bends of each motor's sheath [rad].
        leaves_out: what the linear loops leave to the trials, which then alone say whether it holds.
        alone: what the linear loops then stand for; None where that is the subject.
    """
    ends, dt, stroke = tuple(dict.fromkeys(ends)), subject.plants[0].sample_time, subject.stroke
    trials, estimates, drift = _tried(subject, ends)
    loops = subject.linear(ends, estimates, subject.plants[0].joint_encoder.resolution or IDEAL, reversals=True)
    points = tuple(loop.point for loop in loops)
    deciding = min(loops, key=lambda loop: severity(loop.point))
    worst, bounded = deciding.point, all(trial.bounded for trial in trials)
    half = 0.5 * abs(stroke[1] - stroke[0])
    wide = [] if worst.margins.stable else subject.linear(ends, estimates, half, reversals=False)
    # a memory of the path, such as a model's ĥ, keeps its value: its pole is one but for rounding, and no loop's
    chatters = bool(wide) and all(loop.point.margins.largest_pole < 1.0 + ROUNDING for loop in wide)
    later = _unstable_with((point for point in points if point.bend == worst.bend), dt)
    apart = None
    if alone is not None and later is not None and bounded and severity(worst) < 1.0:
        ((apart,), _) = alone.trial(deciding.bends, MOVING, later)
    refuted = apart is not None and _rests(apart)
    reserve = None
    if refuted:
        reserve = _stands_delay_of_servo(subject, deciding.bends)
    elif bounded and severity(worst) >= 1.0 and (per_degree := delay_per_degree(points)) is not None:
        reserve = _stands_delay(subject, per_degree, deciding.bends)
    cycle = None if leaves_out else _predicted_cycle(subject, ends, estimates)
    verdict, reason = judge(worst, trials, apart, chatters, reserve, refuted=refuted, whole=not leaves_out)
    if verdict != "does_not_hold" and not leaves_out:
        zones = [zone for bends in ends for zone in [subject.dead_zone(bends)] * len(subject.laws)]
        confirmed = bool(confirmed_by(cycle, swing_of(trials)))
        verdict, reason = at_rest(trials, zones, verdict, reason, confirmed=confirmed)
    if verdict != "does_not_hold":
        verdict, reason = _together(verdict, reason, drift, subject.most_apart())
    return Check(
        law=subject.laws[0].name,
        verdict=verdict,
        reason=reason,
        points=points,
        worst=worst,
        cycle=cycle,
        trials=trials,
        reserve=reserve,
        chatters=chatters and not refuted,
        command_per_count=max(point.per_count for point in points),
        ultimate_s=None,
        ultimate_error=None,
        leaves_out=leaves_out,
        refuted=refuted,
        shared=None if len(subject.laws) == 1 else _shared(loops, drift if bounded else None),
    )


class _Tried(NamedTuple):
    """What the trials showed."""

    trials: tuple[Trial, ...]
    """Of each bend and motor, by turns."""
    estimates: list[Visited]
    """Where they start, then what the trials visited, the last of them last."""
    drift: float
    """How far motors went apart beyond what is asked [rad]."""


def _tried(subject: Subject, ends: Sequence[Bends], later: int = 0) -> _Tried:
    """The trials; longer ones where there are estimates that settle later, and the trials stay bounded."""
    laws = subject.laws
    for moving in dict.fromkeys((MOVING, max(MOVING, *map(settled_after, laws)))):
        trials, drift = list[Trial](), 0.0
        for bends in ends:
            found, apart = subject.trial(bends, moving, later)
            trials, drift = [*trials, *found], max(drift, apart)
        each = (all_estimates(law, trials[i :: len(laws)], subject.plants[0].sample_time) for i, law in enumerate(laws))
        visited = [*zip(*each, strict=True)]
        estimates = [one for i, one in enumerate(visited) if one not in visited[i + 1 :]]
        if not any(estimates[-1]) or not all(trial.bounded for trial in trials):
            break
    return _Tried(tuple(trials), estimates, drift)


def _shared(loops: Sequence[LinearLoop], drift: float | None) -> SharedFindings:
    names = ("gain_margin_db", "phase_margin_deg", "delay_margin_s")
    each = {at: [loop.point for loop in loops if loop.at == at] for at in dict.fromkeys(loop.at for loop in loops)}
    found = tuple(TautLoop(at, *(least(points, name) for name in names)) for at, points in each.items())
    return SharedFindings(found, drift, max(loop.apart for loop in loops))


def _together(verdict: VerdictName, reason: str, drift: float, most: float) -> tuple[VerdictName, str]:
    """Whether the motors stay as far apart as they are to be."""
    if drift <= most:
        return verdict, reason
    return "does_not_hold", (
        f"the motors go apart by {drift * DEGREES:.3g}° beyond the co-contraction, where {most * DEGREES:.3g}° are "
        "borne: no law feeds back what the joint does not show"
    )


def _rests(apart: Trial) -> bool:
    """True if a trial without friction and play comes to rest."""
    return apart.bounded and (apart.swing or 0.0) <= _AT_REST


def _unstable_with(points: Iterable[Point], sample_time: float) -> int | None:
    """Cycles of further delay with which a linear loop is unstable: 0 where one is as it is, None where none does it.

    In the trial with that delay a loop that is unstable and one of little margin are judged alike: where the plant that
    the loop stands for rests although the loop does not, it is refuted.
    """
    found = [point.margins for point in points]
    if not all(one.stable for one in found):
        return 0
    least = min((one.delay_margin_s for one in found if one.delay_margin_s is not None), default=None)
    return None if least is None else int(least / sample_time) + 1


def delay_per_degree(points: Iterable[Point]) -> float | None:
    """Delay that a degree of phase is, at the fastest crossover of all loops [s/deg]; None where nothing limits it."""
    found = [(point.margins.delay_margin_s, point.margins.phase_margin_deg) for point in points]
    return min((delay / (phase % 360.0) for delay, phase in found if delay and phase), default=None)


def further_delay(per_degree: float, sample_time: float) -> int:
    """The part of the phase margin that a trial has to stand, as whole cycles of delay, `per_degree` [s/deg]."""
    return int(np.ceil(RESERVE * ENOUGH_DEG * per_degree / sample_time))


def _stands_delay(subject: Subject, per_degree: float, bends: Bends) -> bool:
    """True if the trial stands a part of the phase margin as delay, which has so much for each degree [s/deg]."""
    further = further_delay(per_degree, subject.plants[0].sample_time)
    return all(trial.bounded for trial in _tried(subject, (bends,), further).trials)


def _stands_delay_of_servo(subject: Subject, bends: Bends) -> bool:
    """The same at the servo's frequency, beyond which the motor answers to nothing: where no linear loop says it."""
    return _stands_delay(subject, RADIANS / subject.plants[0].servo.natural_frequency, bends)


def stands(bench: Plant, law: Law, bend: float, stroke: tuple[float, float]) -> bool:
    """True if a law for which no linear loop stands holds in the trials that the check then asks for.

    Args:
        bench: whose linear loops leave something out.
        law: whose trial is bounded.
        bend: total bend of the sheath [rad].
        stroke: ends of the trials' motion [rad].
    """
    alone = linear_plant(bench, (bend,), stroke).alone
    rests = alone is None or _rests(run_trial(alone, law, bend, stroke))
    return rests and _stands_delay_of_servo(_OneMotor((bench,), (law,), stroke, 1), (bend,))


def visited_estimates(law: Law, trials: Iterable[Trial], dt: float) -> list[Estimates]:
    """Values of the law's estimates: where they start, then what the trials visited, the last of them last."""
    picked = all_estimates(law, trials, dt)
    return [values for i, values in enumerate(picked) if values not in picked[i + 1 :]]


def all_estimates(law: Law, trials: Iterable[Trial], dt: float) -> list[Estimates]:
    """The same, one for each state that was visited, though it be the same as another."""
    visited = [state for trial in trials for state in trial.visited]
    start = law.start(Sample(0.0, 0.0))
    begun = dict(zip(names(start), flat(start), strict=True))
    found = find_estimates(law, from_columns(start, visited[-1]), dt) if visited else []
    return [{name: float(state[name]) for name in found} for state in (begun, *visited)]


def linear_points(
    bench: Plant,
    law: Law,
    bends: Iterable[float],
    estimates: Iterable[Estimates],
    width: float,
    stroke: tuple[float, float] = STROKE,
    *,
    reversals: bool = True,
) -> list[Point]:
    """The linear loop at every bend's slopes and with every set of estimates, seen through differences of a `width`.

    Slopes are the one with the play taken up and, if `reversals` count, the one after a reversal where it is steeper.
    """
    linear, points = linear_plant(bench, bends, stroke, reversals=reversals), []
    for values in estimates:
        model = linearise(law, bench.sample_time, width=width, estimates=values)
        jump = largest_change(model) * bench.joint_encoder.resolution
        for place, found in zip(linear.places, linear.margins(model), strict=True):
            points.append(Point(place.bend, place.slope, values, found, place.at, jump))
    return points


def largest_change(model: LawModel) -> float:
    """Largest change of the command from one cycle to the next after a step of the joint's reading [rad/rad].

    The changes after a unit step are the impulse response: D, then C·B, C·A·B, …
    """
    found, state = abs(float(model.d[0])), model.b[:, 0]
    for _ in range(_AFTER_COUNT if len(state) else 0):
        found, state = max(found, abs(float(model.c[0] @ state))), model.a @ state
    return found


def _predicted_cycle(subject: Subject, ends: Sequence[Bends], estimates: Sequence[Visited]) -> LimitCycle | None:
    """The largest cycle over the bends and over the estimates at the start and at the end of the trials; of several
    motors one in which all go alike."""
    cycles, dt, width = [], subject.plants[0].sample_time, subject.plants[0].joint_encoder.resolution or IDEAL
    for bends in ends:
        amplitudes, gains = subject.response(bends)
        for values in (estimates[0], estimates[-1]):
            for plant, law, own in zip(subject.plants, subject.laws, values, strict=True):
                model = linearise(law, dt, width=width, estimates=own)
                for seen in laws_seen(plant, model):
                    cycles.append(predict(gains, plant.servo, plant.delay, seen, dt, amplitudes))
    return max((cycle for cycle in cycles if cycle), key=lambda cycle: cycle.amplitude, default=None)


def severity(point: Point) -> float:
    """Smaller is worse: minus the largest pole of an unstable loop, else the nearer of both limits as a share."""
    return point.margins.share(ENOUGH_DB, ENOUGH_DEG)


def judge(
    worst: Point,
    trials: Sequence[Trial],
    apart: Trial | None,
    chatters: bool,
    reserve: bool | None,
    *,
    refuted: bool,
    whole: bool,
) -> tuple[VerdictName, str]:
    """The verdict; where the linear loop is not the `whole` plant, the trials alone say whether it holds."""
    bounded, why = all(trial.bounded for trial in trials), next((trial.why for trial in trials if trial.why), "")
    where = f"at a bend of {worst.bend / RADIANS:.0f}° (slope {worst.slope:.3g}{', ' if worst.at else ''}{worst.at}"
    few = worst.estimates if len(worst.estimates) <= _MOST_ESTIMATES else {}
    where += "".join(f", {name} {value:.3g}" for name, value in few.items()) + ")"
    lacking = f"the trial does not stand a further delay of {RESERVE * ENOUGH_DEG:.2g}°"
    if refuted:
        longer = " with a delay that the second bears" if worst.margins.stable else ""
        rest = f"{_calm(trials)}, with and without friction and play, although the linear loop is unstable{longer}"
        return ("little_margin", f"{rest}; but {lacking}") if reserve is False else ("holds", rest)
    if not worst.margins.stable:
        pole = f"the sampled loop is unstable {where}: its largest pole is {worst.margins.largest_pole:.4g}"
        if chatters and bounded:
            return "little_margin", f"{pole}; for large motions it is stable, so it chatters and stays bounded"
        if apart is not None:
            swing = (apart.swing or 0.0) / RADIANS
            moves = apart.why or f"the joint swings by ±{swing:.3g}° at rest"
            return "little_margin", f"friction and play alone keep it bounded; without them {moves}"
        return "does_not_hold", pole if whole else f"in the trial {why}"
    if not bounded:
        return "does_not_hold", f"the linear loop is stable, but in the trial {why}"
    if severity(worst) < 1.0:
        found = worst.margins
        shown = [f"{found.gain_margin_db:.1f} dB" if found.gain_margin_db is not None else ""]
        shown.append(f"{found.phase_margin_deg:.0f}°" if found.phase_margin_deg is not None else "")
        return "little_margin", f"only {' and '.join(part for part in shown if part)} are left {where}"
    if reserve is False:
        return "little_margin", f"every linear loop has its margins, but with the play, {lacking}"
    return "holds", f"every linear loop has its margins, and {_calm(trials)}"


def _calm(trials: Sequence[Trial]) -> str:
    """How still the trials are while the reference rests."""
    swing = swing_of(trials) or 0.0
    return "the trials come to rest" if swing <= _AT_REST else f"the trials swing by ±{swing / RADIANS:.2g}° at rest"


def at_rest(
    trials: Sequence[Trial], dead_zones: Sequence[float], verdict: VerdictName, reason: str, *, confirmed: bool
) -> tuple[VerdictName, str]:
    """Whether a bounded loop is calm at rest too: it swings no further than play leaves a joint without a law.

    That is half of the dead zone to either side. A loop that swings further is worse at rest than none, with its
    margins or with little of them.
    """
    pairs = [(trial.swing or 0.0, 0.5 * zone) for trial, zone in zip(trials, dead_zones, strict=True)]
    swing, left = max(pairs, key=lambda pair: pair[0] / max(pair[1], _AT_REST))
    play = f"the ±{left / RADIANS:.2g}° that the play leaves without a law"
    said = f"at rest the joint swings by ±{swing / RADIANS:.2g}° in a limit cycle"
    held = "every linear loop has its margins" if verdict == "holds" else reason
    if swing > max(left, _AT_REST):
        return "limit_cycle", f"{held}{', but' if verdict == 'holds' else ', and'} {said}, more than {play}"
    if confirmed and verdict == "holds":
        return "holds", f"{held}; {said}, within {play}"
    return verdict, reason


def usable(law: Law, bends: tuple[float, float], stroke: tuple[float, float]) -> tuple[float, float]:
    """The bends, known to be usable with the rest.

    Args:
        law: to be judged.
        bends: smallest and largest total bend of its sheath [rad].
        stroke: ends of the trials' motion [rad].

    Raises:
        ParameterError: gains that are not finite, bends or a stroke that cannot be.
    """
    for name, value in law.numbers.items():
        if not np.isfinite(value):
            raise ParameterError(f"gain {name} of law {law.name!r} is {value}", expected="a finite number")
    if not 0.0 < bends[0] <= bends[1] < np.inf:
        raise ParameterError(f"check: bends {bends}", expected="smallest and largest, above 0 rad")
    if not (np.isfinite(stroke).all() and stroke[0] != stroke[1]):
        raise ParameterError(f"check: stroke {stroke}", expected="two different angles")
    return bends
