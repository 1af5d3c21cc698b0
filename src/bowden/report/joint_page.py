"""The pages of several logs fitted together, and of a recalibration."""

from typing import TYPE_CHECKING

import numpy as np

from bowden.core.units import DEGREES
from bowden.drawing.style import new_figure
from bowden.identify.cable.joint_fit import JointFit, cycle_lines, draw_loads
from bowden.identify.cable.recalibrate import Recalibration, cycles_line, draw_residual, verdict
from bowden.plants.cable_parameters import in_degrees
from bowden.report.page import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    page.warnings((*fit.warnings, *cycle_lines(fit.logs)))
    page.heading("How well it predicts")
    page.text(
        "Fitted: error of the model, which was fitted to this log too. Second half: of a model that was fitted to the "
        "first halves of all logs. Log left out: of one fitted to all other logs. Load left out: of one fitted to the "
        "other loads (with load and bend: to all logs but those with the same load and bend). Offset known: the offset "
        "was first fitted to the log's first half; the error is that of its second."
    )
    shown = [key for key in _TITLES if any(np.isfinite(getattr(one, _TITLES[key])) for one in fit.logs)]
    rows = [
        [
            one.name,
            *(f"{in_degrees(*pair)[0]:.4g}" for pair in zip(fit.variables, one.values, strict=True)),
        ]
        + [str(one.cycles.whole)]
        + [_degrees(getattr(one, _TITLES[key])) for key in shown]
        for one in fit.logs
    ]
    units = [
        f"{name} [{in_degrees(name, 0.0, unit)[1] or '–'}]" for name, unit in zip(fit.variables, fit.units, strict=True)
    ]
    page.table(["log", *units, "whole cycles", *shown], rows, "Errors of the joint angle.")
    page.heading("The loop")
    page.figure(
        loops_figure(fit),
        "Both branches of the loop at the least, the middle and the largest load or bend of the logs, less one "
        "straight line (that of the middle one).",
    )
    return page


def loops_figure(fit: JointFit) -> "Figure":
    """Both branches over the motor, at the ends and in the middle of what schedules them."""
    figure, (axes,) = new_figure(1, 1, height=3.6)
    draw_loads(axes, fit)
    return figure


def recalibration_page(found: Recalibration, source: str) -> Page:
    """What came out, and what the old and the new model leave."""
    page = Page(f"{source} on {found.log.name}", f"{verdict(found)[0].upper()}{verdict(found)[1:]}.")
    page.warnings(found.warnings)
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
    page.text(f"The log has {cycles_line(found)}.")
    page.figure(residual_figure(found), "Error of the recalibrated model over time, joint − model.")
    return page


def residual_figure(found: Recalibration) -> "Figure":
    """Joint minus model over time."""
    figure, (axes,) = new_figure(1, 1, height=2.8)
    draw_residual(axes, found)
    return figure


def _degrees(value: float) -> str:
    return f"{value * DEGREES:.3f}" if np.isfinite(value) else "–"
