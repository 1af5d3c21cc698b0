"""One log: each family fitted to its first half, compared on stretches left out, judged on its second half."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.units import DEGREES
from bowden.identify.cable import advice
from bowden.identify.cable.cycles import drift, whole_cycles
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import FittedLog, ModelFit
from bowden.identify.cable.lag import earlier, time_lag
from bowden.identify.cable.loop import loop_of
from bowden.identify.cable.part import Progress, fit_part, refit_whole
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.turns import find_turns, motor_noise
from bowden.identify.cable.uncertainty import all_shown, standard_errors
from bowden.identify.cable.validation import left_out_errors, simplest_of_the_best
from bowden.identify.log.read import Log
from bowden.plants.identified import CableModel
from bowden.records.metrics import rmse

Array = NDArray[np.float64]

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
        if not advice.lags(found.logs[0].lag):
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
    few = half.fine.strokes < advice.TOLD
    tell("fitting the whole log", 0.6)
    whole = (
        fit_part(log, len(log.time), noise, seed, lambda what, share: None) if few else refit_whole(log, noise, half)
    )
    seen = whole if few else half
    tell("comparing on left-out stretches", 0.7)
    errors = left_out_errors(seen.families, seen.estimates, seen.judged, seen.fine, seen.counted, log.time, log.joint)
    shown_by_log = seen.fine.strokes > 1 and advice.following(log, split) >= advice.FOLLOWS  # a reversal, and a cable
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
        joint = follow(CableModel(family.name, half.estimates[family.name].parameters), path, log.time)
        predicted = joint if family.name == best else predicted
        error = joint - log.joint
        part, before = whole, rmse(error[fitted_from:])
        final = follow(CableModel(family.name, whole.estimates[family.name].parameters), path, log.time)
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
    cycles, chosen = whole_cycles(path), models[best]
    warnings = advice.advise(log, split, fine, fitted_from, half.rest_until, models, best, cycles.whole)
    if kept:
        warnings.append(
            f"fitted to the whole log a model was worse on it than fitted to the first half, and stays as it was: "
            f"{', '.join(kept)}; its error beyond the first half's range is not known to be small"
        )
    tell("done", 1.0)
    fitted = FittedLog(
        log=log,
        cycles=cycles,
        split=split,
        predicted=predicted,
        train_rms=chosen.train_rms,
        test_rms=chosen.test_rms,
        reversals=path.strokes - 1,
        line_rms=models["line"].test_rms,
        loop=chosen.loop,
        drift=drift(path),
        lag=time_lag(fine, half.estimates[best]),
        fitted_from=fitted_from,
        one_amplitude=fine.span if advice.one_amplitude(fine) else 0.0,
    )
    others = {name: dict(one.parameters) for name, one in models.items() if name != best}
    return Fit(
        models,
        replace(chosen.model, others=others, covered=log.covered, encoders=log.encoders),
        (fitted,),
        chosen.test_rms,
        (*log.warnings, *warnings),
        chosen_on_whole=few,
    )


def follow(model: CableModel, path: Path, time: Array) -> Array:
    """The model's joint angle at each sample (n,) [rad], simulated straight through a path at the log's full rate.

    The path is the motor's motion freed of encoder noise. Bouc–Wen needs that: its small loops do not close, so that a
    flicker of the encoder, at rest most of all, drives h towards zero, which the cable itself does not do.
    """
    counted = path.weight > 0
    return np.interp(time, path.time[counted], model.joint_angle(path.motor)[counted])


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
