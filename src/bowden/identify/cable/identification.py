"""From three signals to a recommended model: each family fitted to a log's first half and judged on its second."""

import math
import time as clock
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.core.units import DEGREES
from bowden.identify.cable import advice
from bowden.identify.cable.cycles import drift, whole_cycles
from bowden.identify.cable.fit import Fit, ModelFit
from bowden.identify.cable.lag import earlier, time_lag
from bowden.identify.cable.loop import loop_of
from bowden.identify.cable.part import Progress, fit_part, refit_whole
from bowden.identify.cable.path import Path, path_of
from bowden.identify.cable.trust import trust
from bowden.identify.cable.turns import motor_noise
from bowden.identify.cable.uncertainty import all_shown, standard_errors
from bowden.identify.cable.validation import simplest_of_the_best
from bowden.identify.log.angles import SIDES, angle_units, angles_of
from bowden.identify.log.read import Log, checked_rate, prepare
from bowden.plants.identified import CableModel
from bowden.plants.trust import Trust
from bowden.records.metrics import rmse

Array = NDArray[np.float64]

_OUTWARD = ("line", "play", "prandtl_ishlinskii")
"""What is offered where one reversal was seen: left-out stretches then do not show how a bent loop goes on."""
_TAKEN_OUT = 3
"""Times that a lag is taken out: a loop's model takes a part of it for hysteresis, the less the smaller it is."""
_WORSE, _SLIGHT = 1.3, 0.01 / DEGREES
"""A model fitted to the whole log is not taken where its error on it exceeds that of the fit to the first half by this
factor and by this much [rad]: weights that fade towards the past cost less."""


def identify(
    time: Array | None,
    motor: Array,
    joint: Array,
    *,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | None = None,
    rate: float | None = None,
    name: str = "log",
    seed: int = 0,
    progress: Progress | None = None,
) -> Fit:
    """Fit every family of cable models to a log's first half, judge it on the second, and fit it again to the whole.

    Args:
        time: (n,) increasing and even [s]; None where a rate is given.
        motor: motor-side angle (n,).
        joint: joint-side angle (n,).
        unit: of the angles, ``rad``, ``deg`` or ``counts``, or one each (``counts,deg``); radians if not given.
        counts_per_turn: of the encoders, one number for both or one each.
        rate: samples a second of signals without times [Hz].
        name: of the log, for messages.
        seed: of the global search; with the same seed the result is the same.
        progress: called with what is being done and the share of the work that is behind.

    Returns:
        The models with their uncertainties and errors, and the name of the one to use.

    Raises:
        LogError: signals that nothing can be fitted to; see `bowden.identify.cable.checks`.
        ParameterError: an unknown unit, or signals of different lengths.

    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * t)
    >>> fit = identify(t, motor, 0.9 * motor + 0.1)
    >>> fit.best.name, round(fit.models["line"].parameters["slope"], 6)
    ('line', 0.9)
    """
    units = angle_units(unit, counts_per_turn)
    checked_rate(rate, time)
    x, y = (np.ascontiguousarray(values, dtype=np.float64) for values in (motor, joint))
    if time is None and rate is None:
        raise ParameterError("identify: neither times nor a rate", expected="one of them", do="give rate=, in Hz")
    t = np.arange(x.size) / (rate or 1.0) if time is None else np.ascontiguousarray(time, dtype=np.float64)
    if not (t.ndim == 1 and t.shape == x.shape == y.shape):
        raise ParameterError(f"identify: shapes {t.shape}, {x.shape}, {y.shape}", expected="three of one length")
    angles, _ = angles_of({side: (side, None) for side in SIDES}, {"motor": x, "joint": y}, units)
    angles = {side: replace(one, guessed=False) for side, one in angles.items()}  # radians are what arrays are in
    ready = prepare(t, angles, name, lambda sample: f"{name}, sample {sample + 1}", units.apart)
    return identify_log(ready, seed, progress)


def identify_log(log: Log, seed: int = 0, progress: Progress | None = None) -> Fit:
    """`identify` for a log that was read and checked. A lag of the joint that shows is taken out of it.

    Raises:
        LogError: the motor's or the joint's motion cannot be distinguished from its noise.
    """
    found, late = _identify(log, seed, progress), 0.0
    for _ in range(_TAKEN_OUT):
        if not advice.lags(found.lag):
            break
        late += found.lag[0]
        found = _identify(earlier(log, late), seed, progress)
    return found


def _identify(log: Log, seed: int, progress: Progress | None) -> Fit:
    begin = clock.perf_counter()
    tell = progress or (lambda what, share: None)
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
    errors = seen.left_out_errors(log)
    shown_by_log = seen.fine.strokes > 1 and advice.following(log, split) >= advice.FOLLOWS  # a reversal, and a cable
    names = ("line",) if not shown_by_log else _OUTWARD if seen.fine.strokes < 3 else tuple(errors)
    offered = {name: errors[name] for name in names}
    unseen = [family.name for family in seen.families if not all_shown(seen.fine, seen.estimates[family.name])]
    complexity = {name: len(seen.estimates[name].slopes) for name in offered}
    trading = [family.name for family in seen.families if seen.estimates[family.name].prior is not None]
    best: str = simplest_of_the_best(offered, complexity, unseen, trading)

    fine, start = half.fine, half.settling.start
    fitted_from = int(np.searchsorted(log.time, fine.time[np.flatnonzero(fine.weight)[0]])) if start else 0
    path = path_of(log.time, log.motor, log.joint, len(log.time), noise)
    models: dict[str, ModelFit] = {}
    counts = half.counted_at(log.time)
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
    cycles, lag = whole_cycles(path), time_lag(fine, half.estimates[best])
    warnings = advice.advise(log, split, fine, fitted_from, half.rest_until, models, best, cycles.whole)
    if kept:
        warnings.append(
            f"fitted to the whole log a model was worse on it than fitted to the first half, and stays as it was: "
            f"{', '.join(kept)}; its error beyond the first half's range is not known to be small"
        )
    tell("done", 1.0)
    found = Fit(
        models=models,
        best=replace(
            models[best].model,
            others={name: dict(one.parameters) for name, one in models.items() if name != best},
            covered=log.covered,
            encoders=log.encoders,
        ),
        trust=Trust("no", ()),
        warnings=(*log.warnings, *warnings),
        samples=len(log.time),
        cycles=cycles,
        seconds=clock.perf_counter() - begin,
        split=split,
        chosen_on_whole=few,
        fitted_from=fitted_from,
        reversals=path.strokes - 1,
        lag=lag,
        drift=drift(path),
        predicted=predicted,
        log=log,
    )
    judged = trust(found)
    return replace(found, trust=judged, best=replace(found.best, trust=judged))


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
