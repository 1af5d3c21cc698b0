"""The pages of several logs fitted together, and of a recalibration."""

from typing import TYPE_CHECKING

import numpy as np

from bowden.core.style import new_figure
from bowden.core.units import DEGREES
from bowden.identify.cable.loads import JointFit
from bowden.identify.cable.plot import draw_loads, draw_residual
from bowden.identify.cable.recalibrate import Recalibration, verdict
from bowden.report.page import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def joint_page(fit: JointFit) -> Page:
    """Errors of each log, and the loop at the least, the middle and the largest load."""
    by = " and ".join(fit.variables) or "nothing: it is one loop for all"
    page = Page(f"The cable of {len(fit.logs)} logs", f"One model fitted to all of them, scheduled by {by}.")
    for warning in fit.warnings:
        page.notice(warning[0].upper() + warning[1:] + ".")
    page.heading("How well it predicts")
    page.text(
        "“Left out” is the error of a model that was fitted to the other logs alone, “load left out” of one fitted to "
        "other loads alone (with load and bend: to all but the logs that have both of them the same); “offset” once "
        "the offset was fitted to the log's first half, judged on its second."
    )
    rows = [
        [one.name, *(f"{value:.4g}" for value in one.values)]
        + [_degrees(v) for v in (one.train_rms, one.test_rms, one.same_rms, one.same_offset_rms)]
        + [_degrees(v) for v in (one.unseen_rms, one.unseen_offset_rms)]
        for one in fit.logs
    ]
    units = [f"{name} [{unit or '–'}]" for name, unit in zip(fit.variables, fit.units, strict=True)]
    titles = ["fitted", "second half", "left out", "… offset", "load left out", "… offset"]
    page.table(["log", *units, *titles], rows, "Errors of the joint angle [° RMS]")
    page.heading("The loop")
    page.figure(
        loops_figure(fit),
        "The loop's two branches without the straight line of the middle one, at the least, the middle and the largest "
        "load or bend that was seen.",
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
    for warning in found.warnings:
        page.notice(warning[0].upper() + warning[1:] + ".")
    page.table(
        ["what", "value"],
        [
            ["gain", f"{found.gain:.4f} ± {found.gain_error:.2g}"],
            ["offset [°]", _degrees(found.offset)],
            ["error before [° RMS]", _degrees(found.before_rms)],
            ["error after [° RMS]", _degrees(found.after_rms)],
            ["judged of the old model [° RMS]", _degrees(found.judged_rms)],
        ],
        f"Gain and offset of {found.best.name}, fitted anew",
    )
    page.figure(residual_figure(found), "What the recalibrated model leaves, over time.")
    return page


def residual_figure(found: Recalibration) -> "Figure":
    """Joint minus model over time."""
    figure, (axes,) = new_figure(1, 1, height=2.8)
    draw_residual(axes, found)
    return figure


def _degrees(value: float) -> str:
    return f"{value * DEGREES:.3f}" if np.isfinite(value) else "–"
