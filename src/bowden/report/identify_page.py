"""The page of an identification: which model to use and why, what it costs, the loop, what is left, what to do next."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, new_figure, thin, widened
from bowden.identify.cable.drawing import PARTS, POINTS, draw_loads, draw_loop, draw_residual
from bowden.identify.cable.fit import Fit, to_record
from bowden.identify.cable.fitted import ModelFit
from bowden.identify.cable.hysteresis_loop import loop_lines
from bowden.plants.cable_parameters import in_degrees, meaning
from bowden.report.page import Page

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_CELLS = (48, 160)
"""Of the residual's density, up and across."""
_DENSITY = (0.2, 0.58, 0.82)
"""Its colour."""
_MEANS, _FEWEST = 40, 5
"""Stretches of the motor's angle over which residuals are averaged, and how many samples a mean needs."""
_TICKS = 8
"""Of an axis, made before its range is known; what is too many is not drawn."""

TITLES = {
    "line": "straight line",
    "play": "play operator",
    "bouc_wen": "Bouc–Wen",
    "bouc_wen_static": "Bouc–Wen with a static nonlinearity",
    "prandtl_ishlinskii": "Prandtl–Ishlinskii stack",
    "generalised_play": "generalised play between free branches",
    "scheduled": "loop of free shape, scheduled",
}
"""Name of a model → what it is called in a sentence."""


_OF_LOGS = {
    "fitted [° RMS]": "train_rms",
    "second half [° RMS]": "test_rms",
    "log left out [° RMS]": "same_rms",
    "log left out, offset known [° RMS]": "same_offset_rms",
    "load left out [° RMS]": "unseen_rms",
    "load left out, offset known [° RMS]": "unseen_offset_rms",
}
"""Head of a column → what of a log stands there; a column without any number is left out."""


def identify_page(fit: Fit) -> Page:
    """The page of a fit to one log, to several, or of a known model to one."""
    several = len(fit.logs) > 1
    page = Page(f"The cable of {f'{len(fit.logs)} logs' if several else fit.name}", _introduction(fit))
    page.heading("Which model to use")
    page.text("{why}", why=_verdict(fit))
    if ahead := _forecast(fit):
        page.text("{ahead}", ahead=ahead)
    trusted = fit.trust
    page.text(
        "<strong>Trust it? {level}</strong>: {why}.", level=trusted.level.capitalize(), why="; ".join(trusted.reasons)
    )
    next_ = "; ".join(to_record(fit)) if several else fit.cycles.counted if fit.recalibration else str(fit.cycles)
    page.text("{what}.", what=next_ if several and next_ else f"Whole cycles: {next_ or 'enough in each log'}")
    page.warnings(fit.warnings)
    if fit.recalibration:
        page.table(
            ["of the known model", "value"], [list(one) for one in fit.recalibration.lines], "Gain and offset, new"
        )
        page.heading("What is left")
        figure, (axes,) = new_figure(1, 1, height=2.8)
        draw_residual(axes, fit.logs[0])
        page.figure(figure, "Error of the recalibrated model over time, joint − model.")
        return page
    if several:
        _logs_table(page, fit)
        page.heading("The loop")
        figure, (axes,) = new_figure(1, 1, height=3.6)
        draw_loads(axes, fit.best.parameters, fit.units)
        page.figure(
            figure,
            "Both branches of the loop at the least, the middle and the largest load or bend of the logs, less one "
            "straight line (that of the middle one).",
        )
        return page
    _models_table(page, fit)
    title = TITLES[fit.best.name]
    page.heading("The loop")
    page.figure(
        loop_figure(fit),
        f"Left: joint over motor, recorded (broad) and by the recommended model ({title}, thin). Right: the same less "
        "the straight line that fits the first half best. What is left is the motion that the cable loses. Bars: two "
        "standard deviations to either side of the loop that the whole log shows.",
    )
    page.heading("Over time")
    page.figure(
        _time_figure(fit),
        "Motor and joint over time. The model was not fitted to the shaded half; there it computes the joint from the "
        "motor alone.",
    )
    page.figure(
        _residual_figure(fit),
        f"What the model leaves: {fit.chosen.test_rms * DEGREES:.3f}° RMS in the second half. Above: over time. Below: "
        "the second half over the motor's angle, darker where the error occurs more often at that angle. The lines are "
        "its means on the way up and on the way down: they are what the model misses of the cable; the rest is noise.",
    )
    page.heading("Parameters")
    page.text(
        "± is one standard deviation; it allows for errors that are correlated over time. A dash: none is given (for "
        "settings, and for generalised_play, where one parameter can make up for another). ∞: this log does not show "
        "the parameter. Unit 1: a pure number."
    )
    _loop_table(page, fit)
    names = [fit.best.name] + [name for name in ("bouc_wen",) if name != fit.best.name]
    for name in names + [name for name in fit.models if name not in names]:
        _parameter_table(page, name, fit.models[name])
    return page


def _introduction(fit: Fit) -> str:
    if fit.recalibration:
        return f"Gain and offset of {fit.recalibration.source}, fitted again; all else of the model stays."
    if len(fit.logs) > 1:
        by = " and ".join(fit.units) or "nothing: it is one loop for all"
        return f"One model fitted to all of them, scheduled by {by}."
    duration = fit.log.time[-1] - fit.log.time[0]
    return (
        f"{fit.samples} samples, {duration:.4g} s. Each model is fitted to the first half and judged on the second, "
        "then fitted again to the whole log. Errors and curves are of the first fit, parameters of the last."
    )


def _verdict(fit: Fit) -> str:
    if fit.recalibration:
        said = fit.recalibration.verdict
        return f"{said[0].upper()}{said[1:]}."
    if len(fit.logs) > 1:
        return (
            f"Use the scheduled model. Of motion that was not seen it is expected to leave "
            f"{fit.judged_rms * DEGREES:.2g}° RMS, once the joint's offset is known."
        )
    return recommendation(fit)


def _logs_table(page: Page, fit: Fit) -> None:
    page.text(
        "Fitted: error of the model, which was fitted to this log too. Second half: of a model that was fitted to the "
        "first halves of all logs. Log left out: of one fitted to all other logs. Load left out: of one fitted to the "
        "other loads (with load and bend: to all logs but those with the same load and bend). Offset known: the offset "
        "was first fitted to the log's first half; the error is that of its second."
    )
    shown = [key for key in _OF_LOGS if any(np.isfinite(getattr(one, _OF_LOGS[key])) for one in fit.logs)]
    rows = []
    for one in fit.logs:
        values = (f"{in_degrees(*pair)[0]:.4g}" for pair in zip(fit.units, one.values, strict=True))
        errors = (getattr(one, _OF_LOGS[key]) * DEGREES for key in shown)
        rows.append(
            [one.name, *values, str(one.cycles.whole)] + [f"{e:.3f}" if np.isfinite(e) else "–" for e in errors]
        )
    units = [f"{name} [{in_degrees(name, 0.0, unit)[1] or '–'}]" for name, unit in fit.units.items()]
    page.table(["log", *units, "whole cycles", *shown], rows, "Errors of the joint angle.")


def recommendation(fit: Fit) -> str:
    """One plain paragraph: which model, how good, and why it and no other."""
    best = fit.chosen
    lowest = min(fit.models, key=lambda name: fit.models[name].left_out_rms)
    unseen = "it was not fitted to" if fit.chosen_on_whole else "nothing was fitted to or chosen by"
    text = (
        f"{'Use none of them; the best is' if fit.trust.level == 'no' else 'Use the model'} {fit.best.name} "
        f"({TITLES[fit.best.name]}): on the second half of the log, which "
        f"{unseen}, it predicts the joint within {best.test_rms * DEGREES:.2g}° RMS. "
    )
    if lowest == fit.best.name:
        others = [name for name in fit.models if name != fit.best.name]
        second = min(others, key=lambda name: fit.models[name].left_out_rms)
        text += (
            f"It was chosen on stretches that were left out of the fit: there it errs by "
            f"{best.left_out_rms * DEGREES:.2g}°, the next best ({second}) by "
            f"{fit.models[second].left_out_rms * DEGREES:.2g}°."
        )
    else:
        text += (
            f"It was chosen on stretches that were left out of the fit: {lowest} errs a little less "
            f"there ({fit.models[lowest].left_out_rms * DEGREES:.3g}° against {best.left_out_rms * DEGREES:.3g}°), but "
            "not clearly, and the simpler model is taken."
        )
    if fit.best.name != "bouc_wen":
        plain = fit.models["bouc_wen"].test_rms * DEGREES
        text += (
            f" A rig simulates this model; laws begin with numbers of the plain bouc_wen, whose error is {plain:.2g}°."
        )
    return text


def _forecast(fit: Fit) -> str:
    """What a law can make of the model, in a sentence or two."""
    if fit.forecast is None:
        return ""
    left, without, counts = (value * DEGREES for value in fit.forecast)
    text = (
        f"Forecast: a law with this model as feed-forward leaves an error of {left:.2g}° RMS at the joint, on a motion "
        f"like that of this log. Without compensation it is {without:.2g}° (motor and joint related by a straight "
        "line). The servo's lag, and the time that it needs to cross the play, come on top."
    )
    return text + (f" The steps of the encoders alone make {counts:.2g}° RMS." if counts else "")


def _models_table(page: Page, fit: Fit) -> None:
    rows = [
        [
            name,
            str(fitted.fitted_count),
            f"{fitted.train_rms * DEGREES:.3f}",
            f"{fitted.left_out_rms * DEGREES:.3f}",
            f"{fitted.test_rms * DEGREES:.3f}",
        ]
        for name, fitted in fit.models.items()
    ]
    page.table(
        ["model", "parameters", "first half [° RMS]", "left-out stretches [° RMS]", "second half [° RMS]"],
        rows,
        "Errors of the joint angle. The choice rests on the left-out stretches; the second half only judges it.",
        ["best" if name == fit.best.name else "" for name in fit.models],
    )


def _loop_table(page: Page, fit: Fit) -> None:
    loop = fit.chosen.loop
    if loop is None:
        return
    page.text(
        "What the log shows best is the loop itself, whatever the model. Slope, offset and height (how far apart both "
        "ways are) are of the middle half of the stroke, clear of the reversals. The curve is the joint's angle on "
        "either way at 20 places of the stroke; model.toml has them all, and the loop's figure their deviations."
    )
    rows = [[name.removeprefix("loop's "), text] for name, text in loop_lines(loop)]
    page.table(["of the loop", "value ± one standard deviation"], rows, f"The loop of {fit.best.name}")


def _parameter_table(page: Page, name: str, fitted: ModelFit) -> None:
    rows = []
    for key, value in fitted.parameters.items():
        if key.startswith(_NODES):
            continue
        unit, text = meaning(key)
        rows.append([key, f"{value:.5g}", _spread(fitted.uncertainty[key]), unit, text])
    page.table(["parameter", "value", "±", "unit", "meaning"], rows, f"{name}: {TITLES[name]}")


_NODES = ("bend_", "gap_")
"""Parameters that are points of a curve: the loop shows them, and model.toml has them."""


def _spread(uncertainty: float) -> str:
    if math.isnan(uncertainty):
        return "–"
    return "∞" if math.isinf(uncertainty) else f"{uncertainty:.2g}"


def loop_figure(fit: Fit) -> "Figure":
    """Joint over motor, whole and without its straight line."""
    figure, panels = new_figure(1, 2, height=3.4, ticks=_TICKS)
    draw_loop(panels, fit.logs[0], fit.models["line"].model, fit.chosen.loop)
    return _placed(figure, wspace=0.28, bottom=0.16, top=0.88)


def _time_figure(fit: Fit) -> "Figure":
    """Motor and joint over time, with the model."""
    figure, (upper, lower) = new_figure(2, 1, height=3.8, share_x=True, ticks=_TICKS)
    one, log = fit.logs[0], fit.log
    time = log.time - log.time[0]
    upper.plot(*thin(time, log.motor * DEGREES, POINTS), color=COLOURS["motor"])
    upper.set_ylabel("motor [°]")
    lower.plot(*thin(time, log.joint * DEGREES, POINTS), color=PARTS["second half"], lw=4.0, label="joint")
    lower.plot(*thin(time, one.predicted * DEGREES, POINTS), color=COLOURS["model"], lw=0.9, label="model")
    lower.set(xlabel="time [s]", ylabel="joint [°]")
    legend(lower)
    for axes in (upper, lower):
        _shade(axes, time, fit)
    return _placed(figure, hspace=0.28, bottom=0.13, top=0.97)


def _residual_figure(fit: Fit) -> "Figure":
    """Joint minus model, over time and, of the second half, over the motor's angle."""
    figure, (upper, lower) = new_figure(2, 1, height=4.2, ticks=_TICKS)
    one = fit.logs[0]
    draw_residual(upper, one)
    _shade(upper, one.log.time - one.log.time[0], fit)
    late = slice(one.split, None)
    _density(lower, one.log.motor[late] * DEGREES, (one.log.joint - one.predicted)[late] * DEGREES, upper.get_ylim())
    lower.set(xlabel="motor [°]", ylabel="joint − model [°]")
    legend(lower)
    return _placed(figure, hspace=0.55, bottom=0.12, top=0.97)


def _density(axes: "Axes", motor: Array, residual: Array, ends: tuple[float, float]) -> None:
    """How often a residual occurs at a motor angle, as depth of colour, and its mean on the way up and down [°]."""
    across = float(motor.min()), float(motor.max()) or 1.0
    counts, *_ = np.histogram2d(residual, motor, bins=_CELLS, range=(ends, across))
    depth = np.sqrt(counts / np.maximum(counts.max(axis=0), 1.0))  # of each angle: the motor rests at some for long
    image = np.zeros((*depth.shape, 4))
    image[..., :3], image[..., 3] = _DENSITY, depth
    axes.imshow(image, origin="lower", aspect="auto", extent=(*across, *ends), interpolation="none")
    axes.set(xlim=widened(*across, 0.02), ylim=ends)
    step = max(1, len(motor) // 400)
    moved = np.zeros_like(motor)
    moved[step:-step] = motor[2 * step :] - motor[: -2 * step]
    slow = 0.05 * float(np.abs(moved).max())
    edges = np.linspace(*across, _MEANS + 1)
    place = np.clip(np.searchsorted(edges, motor) - 1, 0, _MEANS - 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    for there, label, dashes in ((moved > slow, "mean, motor rising", "-"), (moved < -slow, "mean, falling", "--")):
        count = np.bincount(place[there], minlength=_MEANS)
        total = np.bincount(place[there], residual[there], minlength=_MEANS)
        mean = np.where(count >= _FEWEST, total / np.maximum(count, 1), np.nan)
        axes.plot(middles, mean, dashes, color=COLOURS["error"], lw=1.2, label=label)


def _placed(figure: "Figure", **room: float) -> "Figure":
    """The figure with fixed margins: finding them costs as much time as the drawing itself."""
    figure.set_layout_engine(None)
    figure.subplots_adjust(left=0.115, right=0.985, **room)
    return figure


def _shade(axes: "Axes", time: Array, fit: Fit) -> None:
    """Mark the half that was not fitted, and the start where that was left out."""
    one = fit.logs[0]
    axes.axvspan(float(time[one.split]), float(time[-1]), color="#000000", alpha=0.06, lw=0.0)
    if one.fitted_from:
        axes.axvspan(float(time[0]), float(time[one.fitted_from]), color="#000000", alpha=0.03, lw=0.0, hatch="//")
