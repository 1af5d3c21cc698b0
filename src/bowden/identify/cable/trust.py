"""Whether an identified model is to be trusted, from what its log and its fit say."""

import math
from typing import Literal

import numpy as np

from bowden.core.units import DEGREES
from bowden.identify.cable.advice import FOLLOWS, INNER_UNSEEN, SLIGHT, WORSE, following, lags
from bowden.identify.cable.cycles import FOR_YES
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import FittedLog
from bowden.identify.cable.turns import peak_speed
from bowden.plants.trust import QUARTER, Trust, least

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
