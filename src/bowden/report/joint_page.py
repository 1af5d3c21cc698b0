"""The pages of several logs fitted together, and of a recalibration."""

from typing import TYPE_CHECKING

import numpy as np

from bowden.core.style import COLOURS, legend, new_figure, note_cut, thin, widened
from bowden.core.units import DEGREES
from bowden.identify.cable.loads import JointFit
from bowden.identify.cable.recalibrate import Recalibration, verdict
from bowden.models.cable.scheduled import cable_of, hats, powers
from bowden.report.page import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS = 1500
_SHOWN = (("#0072b2", "-"), ("#009e73", "--"), ("#d55e00", "-."))
"""Colour and line at the least, the middle and the largest."""
_TITLES = {
    "fitted [° RMS]": "train_rms",
    "second half [° RMS]": "test_rms",
    "log left out [° RMS]": "same_rms",
    "log left out, offset known [° RMS]": "same_offset_rms",
    "load left out [° RMS]": "unseen_rms",
    "load left out, offset known [° RMS]": "unseen_offset_rms",
}
"""Head of a column → what of a log stands there; a column without any number is left out."""


def joint_page(fit: JointFit) -> Page:
    """Errors of each log, and the loop at the least, the middle and the largest load."""
    by = " and ".join(fit.variables) or "nothing: it is one loop for all"
    page = Page(f"The cable of {len(fit.logs)} logs", f"One model fitted to all of them, scheduled by {by}.")
    for warning in fit.warnings:
        page.notice(warning[0].upper() + warning[1:] + ".")
    page.heading("How well it predicts")
    page.text(
        "Fitted: error of the model, which was fitted to this log too. Second half: of a model that was fitted to the "
        "first halves of all logs. Log left out: of one fitted to all other logs. Load left out: of one fitted to the "
        "other loads (with load and bend: to all logs but those with the same load and bend). Offset known: the offset "
        "was first fitted to the log's first half; the error is that of its second."
    )
    shown = [key for key in _TITLES if any(np.isfinite(getattr(one, _TITLES[key])) for one in fit.logs)]
    degrees = [unit == "rad" for unit in fit.units]
    rows = [
        [
            one.name,
            *(f"{value * DEGREES if angle else value:.4g}" for value, angle in zip(one.values, degrees, strict=True)),
        ]
        + [_degrees(getattr(one, _TITLES[key])) for key in shown]
        for one in fit.logs
    ]
    units = [
        f"{name} [{'°' if angle else unit or '–'}]"
        for name, unit, angle in zip(fit.variables, fit.units, degrees, strict=True)
    ]
    page.table(["log", *units, *shown], rows, "Errors of the joint angle.")
    page.heading("The loop")
    page.figure(
        loops_figure(fit),
        "Both branches of the loop at the least, the middle and the largest load or bend of the logs, less one "
        "straight "
        "line (that of the middle one).",
    )
    return page


def loops_figure(fit: JointFit) -> "Figure":
    """Both branches over the motor, at the ends and in the middle of what schedules them."""
    cable, values = cable_of(fit.best.parameters)
    count = cable.middle.shape[1]
    motor = np.linspace(cable.first, cable.first + cable.step * (count - 1), 200)
    middle, height = (hats(motor, cable.first, cable.step, count, outward) for outward in (1.0, 0.0))
    ends = [cable.low.tolist(), list(values), cable.high.tolist()] if fit.variables else [[]]
    line = np.polyfit(motor, middle @ (powers(values, cable) @ cable.middle), 1)
    figure, (axes,) = new_figure(1, 1, height=3.6)
    degrees = [unit == "rad" for unit in fit.units]
    for at, (colour, dashes) in zip(ends, _SHOWN, strict=False):
        weights = powers(at, cable)
        curve, half = middle @ (weights @ cable.middle), height @ (weights @ cable.height)
        label = ", ".join(
            f"{name} {value * DEGREES:.3g}°" if angle else f"{name} {value:.3g} {unit}".strip()
            for name, value, unit, angle in zip(fit.variables, at, fit.units, degrees, strict=False)
        )
        for side in (1.0, -1.0):
            drawn = (curve + side * half - np.polyval(line, motor)) * DEGREES
            said = label if label and side > 0.0 else None
            axes.plot(motor * DEGREES, drawn, color=colour, ls=dashes, lw=1.3, label=said)
    axes.set(xlabel="motor [°]", ylabel="joint − straight line [°]")
    if fit.variables:
        legend(axes)
    return figure


def recalibration_page(found: Recalibration, source: str) -> Page:
    """What came out, and what the old and the new model leave."""
    page = Page(f"{source} on {found.log.name}", f"{verdict(found)[0].upper()}{verdict(found)[1:]}.")
    for warning in found.warnings:
        page.notice(warning[0].upper() + warning[1:] + ".")
    gain, offset = f"{found.gain:.4f} ± {found.gain_error:.2g}", _degrees(found.offset)
    page.table(
        ["what", "value", "unit"],
        [
            ["gain", gain, "–"],
            ["offset", offset, "°"],
            ["error on this log with the old gain and offset", _degrees(found.before_rms), "° RMS"],
            ["error on this log with the new ones", _degrees(found.after_rms), "° RMS"],
            ["error of the old model on data it had not seen, as its file says", _degrees(found.judged_rms), "° RMS"],
        ],
        f"Gain and offset of {found.best.name}, fitted again.",
    )
    page.figure(residual_figure(found), "Error of the recalibrated model over time, joint − model.")
    return page


def residual_figure(found: Recalibration) -> "Figure":
    """Joint minus model over time."""
    figure, (axes,) = new_figure(1, 1, height=2.8)
    time, rest = found.log.time - found.log.time[0], (found.log.joint - found.predicted) * DEGREES
    axes.plot(*thin(time, rest, _POINTS), color=COLOURS["error"], lw=0.8)
    axes.set_ylim(*widened(*(float(end) for end in np.quantile(rest, (0.002, 0.998))), 0.3))  # but for the start
    note_cut(axes, [rest])
    axes.set(xlabel="time [s]", ylabel="joint − model [°]")
    return figure


def _degrees(value: float) -> str:
    return f"{value * DEGREES:.3f}" if np.isfinite(value) else "–"
