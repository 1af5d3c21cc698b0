"""How the paper draws each bench run: angles over time, and joint over reference."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, new_figure, thin
from bowden.records.metrics import rmse
from bowden.records.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def time_and_loop(trace: Trace, colour: str, name: str, seconds: float = 30.0) -> "Figure":
    """Desired and measured motion over time (A) and against one another (B), as the paper does."""
    figure, (left, right) = new_figure(columns=2, width=8.6, height=3.9)
    over_time(left, trace, colour, name, seconds)
    left.set_title("A")
    legend(left, columns=2)
    loop(right, trace, colour)
    right.set_title("B")
    return figure


def loops(traces: Mapping[str, Trace]) -> "Figure":
    """Joint over desired angle of several runs side by side, all axes of one scale."""
    figure, panels = new_figure(columns=len(traces), width=8.6, height=0.9 + 7.6 / len(traces))
    for axes, (name, trace) in zip(panels, traces.items(), strict=True):
        loop(axes, trace, COLOURS[name])
        axes.set_title(f"{name}, {rmse(trace.error) * DEGREES:.2f}° RMS")
    return figure


def over_time(axes: "Axes", trace: Trace, colour: str, name: str, seconds: float) -> None:
    """φd and φout over the first `seconds` of a run."""
    part = trace.time <= seconds
    for column, label, shade in (("reference", "desired", COLOURS["reference"]), ("joint", name, colour)):
        x, y = thin(trace.time[part], trace[column][part] * DEGREES, most=1200)
        axes.plot(x, y, label=label, color=shade, linestyle="--" if column == "reference" else "-")
    axes.set(xlabel="time [s]", ylabel="joint angle [°]")


def loop(axes: "Axes", trace: Trace, colour: str, start: float = 0.0, end: float = 1e9, label: str = "") -> None:
    """φout over φd within a stretch of a run, with the straight line that it should be."""
    part = (trace.time >= start) & (trace.time < end)
    step = max(1, int(part.sum() / 3000))
    axes.plot(
        trace["reference"][part][::step] * DEGREES,
        trace["joint"][part][::step] * DEGREES,
        color=colour,
        label=label or None,
        linewidth=1.0,
    )
    span = [float(trace["reference"].min() * DEGREES), float(trace["reference"].max() * DEGREES)]
    axes.plot(span, span, color=COLOURS["reference"], linestyle=":", linewidth=1.0)
    axes.set(xlabel="desired angle [°]", ylabel="joint angle [°]", aspect="equal")
