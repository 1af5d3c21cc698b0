"""One log: each family fitted to its first half, compared on stretches left out, judged on its second half.

A lag τ of the joint, which no rate-independent model can show, adds −τ·d(joint)/dt to it. A fitted model takes part of
that for hysteresis; what it cannot take is the part of the joint's speed that lies outside all its sensitivities, v⊥,
and the residual is then −τ·v⊥.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from bowden.core.errors import LogError
from bowden.core.units import DEGREES
from bowden.identify.cable import trust
from bowden.identify.cable.bouc_wen import BoucWenCable, BoucWenStatic
from bowden.identify.cable.family import Array, Estimate, Family, Line, Progress
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import ModelFit, described
from bowden.identify.cable.generalised import GeneralisedPlay
from bowden.identify.cable.loop import loop_of
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.plays import PlayOperator, PrandtlIshlinskii
from bowden.identify.cable.projection import solve_linear
from bowden.identify.cable.settling import Settling, settling
from bowden.identify.cable.turns import find_turns, motor_noise
from bowden.identify.cable.uncertainty import all_shown, standard_errors
from bowden.identify.cable.validation import left_out_errors, simplest_of_the_best
from bowden.identify.log.read import Log
from bowden.plants.identified import CableModel
from bowden.plants.predicted import PREDICTED
from bowden.plants.trust import Trust
from bowden.records.metrics import rmse

_FINE, _JUDGED, _SEARCHED = 2500, 600, 150
"""Nodes of the path on which models are fitted, compared with one another, and searched for globally."""

_READ = 250
"""Strokes of a long log that are fitted, spread over all of it: they say what a cable's loop is, and how it strays."""

_SEARCHED_STROKES = 30
"""The global search needs no more of a long log; the gradient stage sees all of it."""
_OUTWARD = ("line", "play", "prandtl_ishlinskii")
"""What is offered where one reversal was seen: left-out stretches then do not show how a bent loop goes on."""
_TAKEN_OUT = 3
"""Times that a lag is taken out: a loop's model takes a part of it for hysteresis, the less the smaller it is."""
_FOLLOWED = 200_000
"""Nodes of the path along which models are judged: of a shorter log each sample is one."""
_WORSE, _SLIGHT = 1.3, 0.01 / DEGREES
"""A model fitted to the whole log is not taken where its error on it exceeds that of the fit to the first half by this
factor and by this much [rad]: weights that fade towards the past cost less."""


def fit_log(log: Log, seed: int, tell: Progress) -> Fit:
    """Every family fitted to a log's first half, judged on its second, and fitted again to the whole.

    A lag of the joint that shows is taken out.

    Raises:
        LogError: the motor's or the joint's motion cannot be distinguished from its noise.
    """
    found, late = _fit_log(log, seed, tell), 0.0
    for _ in range(_TAKEN_OUT):
        if not trust.lags(found.logs[0].lag):
            break
        late += found.logs[0].lag[0]
        found = _fit_log(earlier(log, late), seed, tell)
    return found


def _fit_log(log: Log, seed: int, tell: Progress) -> Fit:
    split = int(np.searchsorted(log.time, 0.5 * (log.time[0] + log.time[-1])))
    noise = motor_noise(log.motor[:split])
    _check_motion(log, "motor", log.motor[:split], "check its column, or record a larger motion from the start")
    _check_motion(log, "joint", log.joint[:split], "check its column, its encoder and the cable")
    half = fit_part(log, split, noise, seed, tell)
    few = half.fine.strokes < trust.TOLD
    tell("fitting the whole log", 0.6)
    whole = (
        fit_part(log, len(log.time), noise, seed, lambda what, share: None) if few else refit_whole(log, noise, half)
    )
    seen = whole if few else half
    tell("comparing on left-out stretches", 0.7)
    errors = left_out_errors(seen.families, seen.estimates, seen.judged, seen.fine, seen.counted, log.time, log.joint)
    shown_by_log = seen.fine.strokes > 1 and trust.following(log, split) >= trust.FOLLOWS  # a reversal, and a cable
    names = ("line",) if not shown_by_log else _OUTWARD if seen.fine.strokes < 3 else tuple(errors)
    offered = {name: errors[name] for name in names}
    unseen = [family.name for family in seen.families if not all_shown(seen.fine, seen.estimates[family.name])]
    complexity = {name: len(seen.estimates[name].slopes) for name in offered}
    trading = [family.name for family in seen.families if seen.estimates[family.name].prior is not None]
    best: str = simplest_of_the_best(offered, complexity, unseen, trading)

    fine, start = half.fine, half.settling.start
    fitted_from = int(np.searchsorted(log.time, fine.time[np.flatnonzero(fine.weight)[0]])) if start else 0
    path = build_path(log.time, log.motor, log.joint, find_turns(log.motor, noise), min(len(log.time), _FOLLOWED))
    models: dict[str, ModelFit] = {}
    counts = np.interp(log.time, half.fine.time, half.counted)
    predicted, kept = np.empty(0), []
    for done, family in enumerate(half.families):
        tell("judging on the second half", 0.9 + 0.02 * done)
        joint = path.at(log.time, PREDICTED[family.name](half.estimates[family.name].parameters, path.motor))
        predicted = joint if family.name == best else predicted
        error = joint - log.joint
        part, before = whole, rmse(error[fitted_from:])
        final = path.at(log.time, PREDICTED[family.name](whole.estimates[family.name].parameters, path.motor))
        after = rmse((final - log.joint)[fitted_from:])
        if after > _WORSE * before + _SLIGHT:
            part = half
            kept.append(f"{family.name} ({after * DEGREES:.2g}° against {before * DEGREES:.2g}°)")
        estimate = part.estimates[family.name]
        models[family.name] = ModelFit(
            model=CableModel(family.name, estimate.parameters),
            uncertainty=standard_errors(part.fine, estimate, family),
            loop=loop_of(part.fine, estimate.fitted),
            fitted_count=len(estimate.slopes),
            train_rms=math.sqrt(float(np.average(error[fitted_from:split] ** 2, weights=counts[fitted_from:split]))),
            test_rms=rmse(error[split:]),
            left_out_rms=math.sqrt(float(np.mean(errors[family.name]))),
        )
    chosen = models[best]
    fitted = described(
        log,
        path,
        split,
        predicted,
        train_rms=chosen.train_rms,
        line_rms=models["line"].test_rms,
        loop=chosen.loop,
        lag=time_lag(fine, half.estimates[best]),
        fitted_from=fitted_from,
        one_amplitude=fine.span if trust.one_amplitude(fine) else 0.0,
    )
    warnings = trust.advise(fitted, fine, half.rest_until, models, best)
    if kept:
        warnings.append(
            f"fitted to the whole log a model was worse on it than fitted to the first half, and stays as it was: "
            f"{', '.join(kept)}; its error beyond the first half's range is not known to be small"
        )
    tell("done", 1.0)
    others = {name: dict(one.parameters) for name, one in models.items() if name != best}
    return Fit(
        models,
        replace(chosen.model, others=others, covered=log.covered, encoders=log.encoders),
        (fitted,),
        chosen.test_rms,
        (*log.warnings, *warnings),
        chosen_on_whole=few,
    )


def _check_motion(log: Log, what: str, values: Array, do: str) -> None:
    noise = motor_noise(values)
    span = float(np.ptp(np.convolve(values, np.full(9, 1.0 / 9.0), "valid")))  # nine outweigh the noise
    if not span > max(8.0 * noise, 1e-9):
        raise LogError(
            f"{log.name}: in the first half the {what} moves {np.rad2deg(span):.3g}° with {np.rad2deg(noise):.2g}° of "
            "noise",
            expected="strokes well above the encoder's noise",
            do=do,
        )


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
    others = cable, BoucWenStatic(plain), PrandtlIshlinskii(), branches
    families: tuple[Family, ...] = (Line(), PlayOperator(judged), *others)
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


def time_lag(path: Path, estimate: Estimate) -> tuple[float, float]:
    """The lag τ [s] that explains most of what a model leaves, and the share of the squared residual that it explains.

    At one speed alone a lag and a wider loop are the same: the share is then small.
    """
    counted = path.weight > 0
    weight, time = path.weight[counted], path.time[counted]
    speed = np.gradient(estimate.fitted[counted], time)
    sensitivities = np.stack([slope[counted] for slope in estimate.slopes.values()], axis=1)
    absorbed, _ = solve_linear(sensitivities, speed, weight)
    outside = speed - np.einsum("np,p->n", sensitivities, absorbed)
    residual = (path.joint - estimate.fitted)[counted]
    power = float(weight @ outside**2)
    if power <= 1e-9 * float(weight @ speed**2):
        return 0.0, 0.0
    along = float(weight @ (residual * outside))
    return -along / power, along**2 / (power * max(float(weight @ residual**2), 1e-300))


def earlier(log: Log, late: float) -> Log:
    """A log whose joint is read so much later than its motor, with both at one time; `late` may be below zero [s]."""
    kept = (log.time + late >= log.time[0]) & (log.time + late <= log.time[-1])
    time, motor = log.time[kept], log.motor[kept]
    joint = np.interp(time + late, log.time, log.joint)
    why = f"the joint was {1e3 * late:.3g} ms late; taken out, the loop is not wider by it"
    if late > 0.0:
        why += "; a controller that reads this sensor has that delay as well, in the rig's delay_cycles"
    doubts, encoders = (*log.doubts, Trust("with care", (why,))), log.encoders._replace(joint_late=max(0.0, late))
    return replace(log, time=time, motor=motor, joint=joint, doubts=doubts, counts=log.resolutions, encoders=encoders)
