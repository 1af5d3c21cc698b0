"""Whether an identified model is to be trusted, what its log cannot show, and what to record instead."""

import math
from collections.abc import Mapping

import numpy as np

from bowden.core.units import DEGREES
from bowden.identify.cable.cycles import ENOUGH, FOR_YES
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import FittedLog, ModelFit
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import Array
from bowden.identify.cable.turns import motor_noise, peak_speed, resolution
from bowden.identify.log.read import Log
from bowden.plants.trust import QUARTER, Level, Trust, least

_LAG = 0.3
"""Share of the squared residual that a lag explains, from which on it is taken for one [–]."""

WORSE, SLIGHT = 1.5, 0.05 / DEGREES
"""Error on the half that was not fitted over that on the fitted one, and its size [rad], from which on the cable is
taken to have changed."""
TOLD = 4
"""Strokes from which on the first half decides between families, and tells a cable that changes from what happens once;
with fewer of them the whole log decides."""
FOLLOWS = 0.5
"""Least correlation with the motor of a joint that follows it; below it nothing but a line is recommended."""
_HALF = 0.5
"""Share of a straight line's error that a model leaves at most, if its loop is to be of use."""
_DRIFTS = 0.1
"""Share of a loop's height by which the joint may leave its place over a log: cables that are steady do so by 0.06."""
_COUNTS = 3.0
"""Errors below this many times the encoders' counts are their noise, and so is a loop below as many errors."""

INNER_UNSEEN = (
    "all strokes have one amplitude ({:.3g}° peak to peak of the motor): play and slope of smaller loops inside that "
    "one are not seen; record strokes of a half and a quarter of it as well"
)
"""Of a log whose `one_amplitude` is true, with its motor's span [deg]."""
_CARE: Level = "with care"


def trust(fit: Fit, known: Trust | None = None) -> Trust:
    """Whether to trust the recommended model: the gravest of what its logs and its fit give reason to doubt.

    Args:
        fit: of one log, of several, or of a known model.
        known: trust in that model; None where nothing says it.
    """
    if fit.recalibration:
        unsaid = Trust("with care", ("nothing says whether the model that was recalibrated is to be trusted",))
        changed = [Trust("no", ("the cable has changed since its model was identified",))] * bool(
            fit.recalibration.changed
        )
        return least([known or unsaid, *changed, *fit.log.doubts])
    doubts = [one for log in fit.logs for one in _doubts(fit, log)]
    if len(fit.logs) > 1:
        return least([Trust("yes", ("within the motion of these logs",)), *doubts])
    (one,) = fit.logs
    ends = f"{one.log.covered.joint_low * DEGREES:.1f} to {one.log.covered.joint_high * DEGREES:.1f}°"
    said = f"{_degrees(one.test_rms)} RMS on the half that was not fitted, {_degrees(one.train_rms)} on the fitted one"
    said += f", {_degrees(one.line_rms)} of a straight line" if fit.best.name != "line" else ""
    counts = _rounding(fit, one)
    said += f"; the encoders' rounding alone makes {_degrees(counts)}" if counts else ""
    inner = (INNER_UNSEEN.format(one.one_amplitude * DEGREES),) if one.one_amplitude else ()
    judged = least([Trust("yes", (f"within the motion of this log ({ends} at the joint)", *inner, said)), *doubts])
    return judged if judged.level == "yes" else Trust(judged.level, (*judged.reasons, said))


def _doubts(fit: Fit, one: FittedLog) -> list[Trust]:
    """What one of the logs, and how the model predicts it, gives reason to doubt."""
    log, seen, unseen, counts = one.log, one.train_rms, one.test_rms, _rounding(fit, one)
    alone, turns, line = len(fit.logs) == 1, one.reversals > 0, fit.best.name == "line"
    height = math.inf if one.loop is None else one.loop.height
    drifts = abs(one.drift) * (log.time[-1] - log.time[0]) > _DRIFTS * abs(height)
    correlation = following(log, one.split)
    apart = peak_speed(log.time, log.joint) * float(np.median(np.diff(log.time)))
    poor, fair = (unseen > max(share * one.line_rms, _COUNTS * counts, SLIGHT) for share in (_HALF, QUARTER))
    flat = not fair and height < max(_COUNTS * unseen, SLIGHT)
    steady = turns and not line and not drifts
    few = turns and (fit.chosen_on_whole or one.cycles.whole < FOR_YES)
    changed = alone and not fit.chosen_on_whole and not line and unseen > max(WORSE * seen, SLIGHT)
    left = "the model leaves a quarter or more of what a straight line does"
    no_loop = f"no loop shows beside what the model leaves ({_degrees(height)} high)"
    late = f"the joint moves {_degrees(apart)} from row to row: if it is one row late, that alone makes such a loop"
    cycles = f"{one.cycles.counted} (up and down through the middle half of the motor's range), too few to judge"
    table: tuple[tuple[bool, Level, str], ...] = (
        (correlation < FOLLOWS, "no", f"the joint does not follow the motor (correlation {correlation:.2f})"),
        (not turns, "no", "the motor never reverses, so that no loop shows"),
        (turns and line, _CARE, "no loop is shown by this log, a straight line is all"),
        (turns and not line and poor, "no", "the model predicts hardly better than a straight line"),
        (steady and fair and not poor, _CARE, left),
        (steady and flat, _CARE, f"{no_loop}: is the joint computed from the motor, or its target?"),
        (height < 2.0 * apart, _CARE, f"{late} ({_degrees(height)} high); record more rows a second, or move slower"),
        (few, _CARE if one.cycles.whole else "no", f"{cycles} a model on cycles that it has not seen"),
        (drifts, _CARE, f"the joint's sensor drifts by {one.drift * DEGREES * 60.0:.2g}°/min"),
        (changed and not drifts, _CARE, "the cable changed during the log"),
        (lags(one.lag), _CARE, f"the joint is {1e3 * one.lag[0]:.2g} ms late, which makes its loop look wider"),
    )
    found = [*log.doubts, *(Trust(level, (why,)) for holds, level, why in table if holds)]
    name = "" if alone else f"{one.name}: "
    return [Trust(level, tuple(name + why for why in reasons)) for level, reasons in found]


def _rounding(fit: Fit, one: FittedLog) -> float:
    """What both encoders' counts alone make of an error at the joint [rad]."""
    ahead = fit.forecast
    return ahead.resolution if ahead else one.log.resolutions[1] / math.sqrt(12.0)


def _degrees(angle: float) -> str:
    return f"{angle * DEGREES:.2g}°"


def following(log: Log, split: int) -> float:
    """Size of the correlation between joint and motor before the sample `split` [–]."""
    return abs(float(np.corrcoef(log.motor[:split], log.joint[:split])[0, 1]))


def advise(
    one: FittedLog, path: Path, rest_until: float | None, models: Mapping[str, ModelFit], best: str
) -> list[str]:
    """Warnings about a log and what was identified from it.

    Args:
        one: the log, and how it is predicted.
        path: of its first half, as it was fitted.
        rest_until: time to which the log counts less since it begins at rest [s]; None where it does not.
        models: what was identified.
        best: the recommended model.
    """
    log, split = one.log, one.split
    if following(log, split) < FOLLOWS:
        return [
            "do not rely on these results: check the columns, the units, and whether both were recorded on one clock; "
            "or the motion is too small for the cable's play, and a larger one is needed"
        ]
    begun = seconds_text((log.time[one.fitted_from] if rest_until is None else rest_until) - log.time[0])
    few = path.strokes < TOLD
    do = f"at least {ENOUGH} whole cycles" if one.cycles.whole < ENOUGH else "as many cycles in each half"
    lost = 2.0 * models["play"].parameters["half_width"]
    low, high = float(np.min(path.turning)), float(np.max(path.turning))
    beyond = max(low - float(log.motor[split:].min()), float(log.motor[split:].max()) - high)
    vague = _vague(models[best])
    table = (
        (
            path.strokes < 2,
            "the motor does not reverse in the first half, so no hysteresis shows there and its errors in the second "
            f"half say nothing: move faster or record longer, {ENOUGH} whole cycles or more",
        ),
        (
            2 <= path.strokes < ENOUGH,  # of enough whole cycles, half of the log has as many strokes
            f"the first half has only {path.strokes - 1} reversal{'s' * (path.strokes > 2)}, too few to separate a "
            f"loop from what happens once{', and the whole log chose the model' * few}: record {do}",
        ),
        (one_amplitude(path), INNER_UNSEEN.format(path.span * DEGREES)),
        (
            rest_until is not None,
            f"the first {begun} count less: the log begins at rest or at a turn, and a cable that rested comes to its "
            "loop on the motor's first way through the range",
        ),
        (
            rest_until is None and one.fitted_from > 0,
            f"the first {begun} were not fitted: the strokes after it are predicted better without them, as after a "
            "cable that was still settling",
        ),
        (
            path.strokes > 1 and path.span < 3.0 * lost,
            f"the motion is too small: of {path.span * DEGREES:.3g}° the motor's play takes {lost * DEGREES:.2g}°; "
            f"record at least {5.0 * lost * DEGREES:.2g}°",
        ),
        *(_smallness(name, values[:split]) for name, values in (("motor", log.motor), ("joint", log.joint))),
        (
            bool(vague),
            f"nearly unidentifiable in {best}: {vague}; the curve it draws is still determined, single values are not: "
            "record reversals in the middle of strokes, at several amplitudes, and move slowly through them",
        ),
        (
            beyond > 0.1 * path.span,
            f"the second half goes {beyond * DEGREES:.3g}° beyond the range of the first: the models are judged where "
            "they were not fitted",
        ),
    )
    return [words for holds, words in table if holds]


def _smallness(name: str, values: Array) -> tuple[bool, str]:
    """Whether a side moves too little for its encoder, and the words for it."""
    span, count, noise = float(np.ptp(values)), resolution(values), motor_noise(values)
    return span < 50.0 * max(count, 2.0 * noise), (
        f"the motion is too small for the {name}'s encoder: {span * DEGREES:.3g}° with steps of "
        f"{count * DEGREES:.2g}° and {noise * DEGREES:.2g}° of noise; record a larger one"
    )


def _vague(fitted: ModelFit) -> str:
    """Parameters of a Bouc–Wen model's shape that the log does not show."""
    shape = [key for key in ("hysteresis_gain", "rate", "shape", "exponent") if key in fitted.parameters]
    found = [(key, fitted.parameters[key], fitted.uncertainty[key]) for key in shape]
    return ", ".join(
        f"{key} = {value:.3g}"
        + (f" ± {error:.2g}" if math.isfinite(error) else " (at the bound of its search, or not shown)")
        for key, value, error in found
        if not error < abs(value)
    )


def one_amplitude(path: Path) -> bool:
    """True if all strokes that were fitted go between the same two ends, within a tenth of the motor's span."""
    fitted = path.stroke[path.weight > 0]
    inner = path.turning[int(fitted[0]) + 1 : -1]
    return len(inner) >= 2 and max(float(np.ptp(inner[0::2])), float(np.ptp(inner[1::2]))) < 0.1 * path.span


def seconds_text(time: float) -> str:
    """With two digits, or whole seconds."""
    return f"{time:.0f} s" if time >= 10.0 else f"{time:.2g} s"


def lags(lag: tuple[float, float]) -> bool:
    """True if a lag [s] explains so much of what the model leaves that it is one."""
    seconds, share = lag
    return share > _LAG and abs(seconds) > 2e-3
