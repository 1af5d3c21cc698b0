"""Pictures of a fit: the loop as it was recorded and as the model draws it, at each load, and what is left."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, note_cut, thin, widened
from bowden.identify.cable.fitted import FittedLog
from bowden.identify.cable.hysteresis_loop import HysteresisLoop
from bowden.models.cable.scheduled import cable_of, hats, powers
from bowden.plants.identified import CableModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 1500
"""Of a curve: more make no visible difference."""
PARTS = {"first half": "#c9ced3", "second half": "#b5d3e7"}
"""Half of the log → its colour: pale and broad, so that the model's thin line hides nothing of it."""
_SHOWN = (("#0072b2", "-"), ("#009e73", "--"), ("#d55e00", "-."))
"""Colour and line at the least, the middle and the largest load."""


def draw_loop(axes: "Sequence[Axes]", one: FittedLog, straight: CableModel, loop: HysteresisLoop | None) -> None:
    """Joint over motor as recorded and as the recommended model has it, and on second axes without the line."""
    log, line = one.log, straight.joint_angle(one.log.motor)
    motor = log.motor * DEGREES
    for panel, base in zip(axes, (np.zeros_like(line), line), strict=False):
        for part, (label, colour) in zip((slice(0, one.split), slice(one.split, None)), PARTS.items(), strict=True):
            shown = thin(motor[part], (log.joint - base)[part] * DEGREES, POINTS)
            panel.plot(*shown, color=colour, lw=2.8, label=label)
        late = slice(one.split, None)
        drawn = thin(motor[late], (one.predicted - base)[late] * DEGREES, POINTS)
        panel.plot(*drawn, color=COLOURS["model"], lw=0.8, label="model")
        panel.set_xlabel("motor [°]")
    axes[0].set_ylabel("joint [°]")
    if len(axes) > 1:
        if loop is not None:
            _draw_deviations(axes[1], straight, loop)
        axes[1].set_ylabel("joint − straight line [°]")
    legend(axes[-1], 3)


def _draw_deviations(axes: "Axes", straight: CableModel, loop: HysteresisLoop) -> None:
    """Two deviations to either side of the loop, at each of its places."""
    ways = (loop.rising_place, loop.rising, loop.rising_error), (loop.falling_place, loop.falling, loop.falling_error)
    for way in ways:
        place, joint, error = (np.array(one)[np.isfinite(way[2])] for one in way)
        middle, reach = joint - straight.joint_angle(place), 2.0 * error
        ends = (middle - reach) * DEGREES, (middle + reach) * DEGREES
        axes.vlines(place * DEGREES, *ends, color=COLOURS["model"], lw=1.6)


def draw_loads(axes: "Axes", scheduled: Mapping[str, float], units: Mapping[str, str]) -> None:
    """Both branches over the motor, at the ends and in the middle of what schedules them."""
    cable, values = cable_of(scheduled)
    count = cable.middle.shape[1]
    motor = np.linspace(cable.first, cable.first + cable.step * (count - 1), 200)
    middle, height = (hats(motor, cable.first, cable.step, count, outward) for outward in (1.0, 0.0))
    ends = [cable.low.tolist(), list(values), cable.high.tolist()] if units else [[]]
    line = np.polyfit(motor, middle @ (powers(values, cable) @ cable.middle), 1)
    for at, (colour, dashes) in zip(ends, _SHOWN, strict=False):
        weights = powers(at, cable)
        curve, half = middle @ (weights @ cable.middle), height @ (weights @ cable.height)
        label = ", ".join(
            f"{name} {value * DEGREES:.3g}°" if unit == "rad" else f"{name} {value:.3g} {unit}".strip()
            for (name, unit), value in zip(units.items(), at, strict=False)
        )
        for side in (1.0, -1.0):
            drawn = (curve + side * half - np.polyval(line, motor)) * DEGREES
            said = label if label and side > 0.0 else None
            axes.plot(motor * DEGREES, drawn, color=colour, ls=dashes, lw=1.3, label=said)
    axes.set(xlabel="motor [°]", ylabel="joint − straight line [°]")
    if units:
        legend(axes)


def draw_residual(axes: "Axes", one: FittedLog) -> None:
    """Joint minus model over time."""
    time, rest = one.log.time - one.log.time[0], (one.log.joint - one.predicted) * DEGREES
    axes.plot(*thin(time, rest, POINTS), color=COLOURS["error"], lw=0.8)
    low, high = np.quantile(rest[one.fitted_from :], (0.001, 0.999))  # the start may lie far outside
    axes.set_ylim(*widened(float(low), float(high), 0.3))
    note_cut(axes, [rest])
    axes.set(xlabel="time [s]", ylabel="joint − model [°]")
