"""Whether an identified model is to be trusted, what its log cannot show, and what to record instead."""

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np

from bowden.core.units import DEGREES
from bowden.identify.cable.cycles import ENOUGH, FOR_YES
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import FittedLog, ModelFit
from bowden.identify.cable.path import Path
from bowden.identify.cable.turns import motor_noise, peak_speed, resolution
from bowden.identify.log.read import Log
from bowden.plants.trust import QUARTER, Trust, least

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
    log, loop, seen, unseen, counts = one.log, one.loop, one.train_rms, one.test_rms, _rounding(fit, one)
    alone, found = len(fit.logs) == 1, list(log.doubts)

    def doubt(level: Literal["with care", "no"], why: str) -> None:
        found.append(Trust(level, (why,)))

    drifts = loop is not None and abs(one.drift) * (log.time[-1] - log.time[0]) > _DRIFTS * abs(loop.height)
    correlation = following(log, one.split)
    if correlation < FOLLOWS:
        doubt("no", f"the joint does not follow the motor (correlation {correlation:.2f})")
    if not one.reversals:
        doubt("no", "the motor never reverses, so that no loop shows")
    elif fit.best.name == "line":
        doubt("with care", "no loop is shown by this log, a straight line is all")
    elif unseen > max(_HALF * one.line_rms, _COUNTS * counts, SLIGHT):
        doubt("no", "the model predicts hardly better than a straight line")
    elif not drifts and unseen > max(QUARTER * one.line_rms, _COUNTS * counts, SLIGHT):
        doubt("with care", "the model leaves a quarter or more of what a straight line does")
    elif not drifts and loop is not None and loop.height < max(_COUNTS * unseen, SLIGHT):
        why = f"no loop shows beside what the model leaves ({_degrees(loop.height)} high)"
        doubt("with care", f"{why}: is the joint computed from the motor, or its target?")
    apart = peak_speed(log.time, log.joint) * float(np.median(np.diff(log.time)))
    if loop is not None and loop.height < 2.0 * apart:
        why = f"the joint moves {_degrees(apart)} from row to row: if it is one row late, that alone makes such a loop"
        doubt("with care", f"{why} ({_degrees(loop.height)} high); record more rows a second, or move slower")
    if one.reversals and (fit.chosen_on_whole or one.cycles.whole < FOR_YES):
        few = "too few to judge a model on cycles that it has not seen"
        doubt(
            "with care" if one.cycles.whole else "no",
            f"{one.cycles.counted} (up and down through the middle half of the motor's range), {few}",
        )
    if drifts:
        doubt("with care", f"the joint's sensor drifts by {one.drift * DEGREES * 60.0:.2g}°/min")
    elif alone and not fit.chosen_on_whole and unseen > WORSE * seen and unseen > SLIGHT and fit.best.name != "line":
        doubt("with care", "the cable changed during the log")
    if lags(one.lag):
        doubt("with care", f"the joint is {1e3 * one.lag[0]:.2g} ms late, which makes its loop look wider")
    return (
        found if alone else [Trust(each.level, tuple(f"{one.name}: {why}" for why in each.reasons)) for each in found]
    )


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
    found = _about_motion(path, one.cycles.whole)
    if rest_until is not None:
        found.append(
            f"the first {seconds_text(rest_until - log.time[0])} count less: the log begins at rest or at a turn, and "
            "a cable that rested comes to its loop on the motor's first way through the range"
        )
    elif one.fitted_from:
        found.append(
            f"the first {seconds_text(log.time[one.fitted_from] - log.time[0])} were not fitted: the strokes after it "
            "are predicted better without them, as after a cable that was still settling"
        )
    found += [*_about_size(log, split, path, models), *_about_parameters(models[best], best)]
    low, high = float(np.min(path.turning)), float(np.max(path.turning))
    beyond = max(low - float(log.motor[split:].min()), float(log.motor[split:].max()) - high)
    if beyond > 0.1 * path.span:
        found.append(
            f"the second half goes {beyond * DEGREES:.3g}° beyond the range of the first: the models are judged where "
            "they were not fitted"
        )
    return found


def _about_motion(path: Path, whole: int) -> list[str]:
    found = []
    if path.strokes < 2:
        found.append(
            "the motor does not reverse in the first half, so no hysteresis shows there and its errors in the second "
            f"half say nothing: move faster or record longer, {ENOUGH} whole cycles or more"
        )
    elif path.strokes < ENOUGH:  # of enough whole cycles, half of the log has as many strokes
        do = f"record at least {ENOUGH} whole cycles" if whole < ENOUGH else "record as many cycles in each half"
        found.append(
            f"the first half has only {path.strokes - 1} reversal{'s' * (path.strokes > 2)}, too few to separate a "
            f"loop from what happens once{', and the whole log chose the model' * (path.strokes < TOLD)}: {do}"
        )
    if one_amplitude(path):
        found.append(INNER_UNSEEN.format(path.span * DEGREES))
    return found


INNER_UNSEEN = (
    "all strokes have one amplitude ({:.3g}° peak to peak of the motor): play and slope of smaller loops inside that "
    "one are not seen; record strokes of a half and a quarter of it as well"
)
"""Of a log whose `one_amplitude` is true, with its motor's span [deg]."""


def one_amplitude(path: Path) -> bool:
    """True if all strokes that were fitted go between the same two ends, within a tenth of the motor's span."""
    fitted = path.stroke[path.weight > 0]
    inner = path.turning[int(fitted[0]) + 1 : -1]
    return len(inner) >= 2 and max(float(np.ptp(inner[0::2])), float(np.ptp(inner[1::2]))) < 0.1 * path.span


def seconds_text(time: float) -> str:
    """With two digits, or whole seconds."""
    return f"{time:.0f} s" if time >= 10.0 else f"{time:.2g} s"


def _about_size(log: Log, split: int, path: Path, models: Mapping[str, ModelFit]) -> list[str]:
    found = []
    lost = 2.0 * models["play"].parameters["half_width"]
    if path.strokes > 1 and path.span < 3.0 * lost:
        found.append(
            f"the motion is too small: of {path.span * DEGREES:.3g}° the motor's play takes {lost * DEGREES:.2g}°; "
            f"record at least {5.0 * lost * DEGREES:.2g}°"
        )
    for name, values in (("motor", log.motor[:split]), ("joint", log.joint[:split])):
        count, noise = resolution(values), motor_noise(values)
        if float(np.ptp(values)) < 50.0 * max(count, 2.0 * noise):
            found.append(
                f"the motion is too small for the {name}'s encoder: {np.ptp(values) * DEGREES:.3g}° with steps of "
                f"{count * DEGREES:.2g}° and {noise * DEGREES:.2g}° of noise; record a larger one"
            )
    return found


def _about_parameters(fitted: ModelFit, name: str) -> list[str]:
    """What the log shows of the recommended model's shape, where it is a Bouc–Wen one."""
    shape = ("hysteresis_gain", "rate", "shape", "exponent")
    vague = [
        key for key in shape if key in fitted.parameters and not fitted.uncertainty[key] < abs(fitted.parameters[key])
    ]
    if not vague:
        return []
    listed = ", ".join(
        f"{key} = {fitted.parameters[key]:.3g}"
        + (
            f" ± {fitted.uncertainty[key]:.2g}"
            if math.isfinite(fitted.uncertainty[key])
            else " (at the bound of its search, or not shown)"
        )
        for key in vague
    )
    return [
        f"nearly unidentifiable in {name}: {listed}; the curve it draws is still determined, single values are not: "
        "record reversals in the middle of strokes, at several amplitudes, and move slowly through them"
    ]


def lags(lag: tuple[float, float]) -> bool:
    """True if a lag [s] explains so much of what the model leaves that it is one."""
    seconds, share = lag
    return share > _LAG and abs(seconds) > 2e-3
