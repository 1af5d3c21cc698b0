"""Whether an identified model is to be trusted, from what its log and its fit say."""

from typing import Literal

import numpy as np

from bowden.core.units import DEGREES
from bowden.identify.cable.advice import FOLLOWS, SLIGHT, WORSE, following, lags
from bowden.identify.cable.cycles import FOR_YES
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.turns import peak_speed
from bowden.plants.trust import QUARTER, Trust, least

_HALF = 0.5
"""Share of a straight line's error that a model leaves at most, if its loop is to be of use."""
_DRIFTS = 0.1
"""Share of a loop's height by which the joint may leave its place over a log: cables that are steady do so by 0.06."""
_COUNTS = 3.0
"""Errors below this many times the encoders' counts are their noise, and so is a loop below as many errors."""


def trust(fit: Fit) -> Trust:
    """Whether to trust the recommended model: the gravest of what its log and its fit give reason to doubt."""
    chosen, line, log = fit.chosen, fit.models["line"], fit.log
    seen, unseen = chosen.train_rms, chosen.test_rms
    counts = fit.forecast.resolution
    said = f"{_degrees(unseen)} RMS on the half that was not fitted, {_degrees(seen)} on the fitted one"
    said += f", {_degrees(line.test_rms)} of a straight line" if fit.best.name != "line" else ""
    said += f"; the encoders' rounding alone makes {_degrees(counts)}" if counts else ""
    loop = chosen.loop
    ends = f"{log.covered.joint_low * DEGREES:.1f} to {log.covered.joint_high * DEGREES:.1f}°"
    found = [Trust("yes", (f"within the motion of this log ({ends} at the joint)", said)), *log.doubts]

    def doubt(level: Literal["with care", "no"], why: str) -> None:
        found.append(Trust(level, (why,)))

    rate = fit.drift if loop and abs(fit.drift) * (log.time[-1] - log.time[0]) > _DRIFTS * abs(loop.height) else None
    correlation = following(log, fit.split)
    if correlation < FOLLOWS:
        doubt("no", f"the joint does not follow the motor (correlation {correlation:.2f})")
    if not fit.reversals:
        doubt("no", "the motor never reverses, so that no loop shows")
    elif fit.best.name == "line":
        doubt("with care", "no loop is shown by this log, a straight line is all")
    elif unseen > max(_HALF * line.test_rms, _COUNTS * counts, SLIGHT):
        doubt("no", "the model predicts hardly better than a straight line")
    elif rate is None and unseen > max(QUARTER * line.test_rms, _COUNTS * counts, SLIGHT):
        doubt("with care", "the model leaves a quarter or more of what a straight line does")
    elif rate is None and loop is not None and loop.height < max(_COUNTS * unseen, SLIGHT):
        why = f"no loop shows beside what the model leaves ({_degrees(loop.height)} high)"
        doubt("with care", f"{why}: is the joint computed from the motor, or its target?")
    apart = peak_speed(log.time, log.joint) * float(np.median(np.diff(log.time)))
    if loop is not None and loop.height < 2.0 * apart:
        why = f"the joint moves {_degrees(apart)} from row to row: if it is one row late, that alone makes such a loop"
        doubt("with care", f"{why} ({_degrees(loop.height)} high); record more rows a second, or move slower")
    if fit.reversals and (fit.chosen_on_whole or fit.cycles.whole < FOR_YES):
        few = "too few to judge a model on cycles that it has not seen"
        doubt("with care", f"{fit.cycles.counted} (up and down through the middle half of the motor's range), {few}")
    if rate is not None:
        doubt("with care", f"the joint's sensor drifts by {rate * DEGREES * 60.0:.2g}°/min")
    elif not fit.chosen_on_whole and unseen > WORSE * seen and unseen > SLIGHT and fit.best.name != "line":
        doubt("with care", "the cable changed during the log")
    if lags(fit.lag):
        doubt("with care", f"the joint is {1e3 * fit.lag[0]:.2g} ms late, which makes its loop look wider")
    judged = least(found)
    return judged if judged.level == "yes" else Trust(judged.level, (*judged.reasons, said))


def _degrees(angle: float) -> str:
    return f"{angle * DEGREES:.2g}°"
