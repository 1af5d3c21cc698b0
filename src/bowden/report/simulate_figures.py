"""The figures of `simulate_page`."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.motion_plot import draw_motion
from bowden.core.style import COLOURS, legend, new_figure, stay_near, thin, widened
from bowden.core.trace import Trace
from bowden.core.units import DEGREES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Traces = Mapping[str, Trace]
Colours = Mapping[str, str]


def rate(trace: Trace) -> float:
    """Samples a second [Hz]."""
    return (len(trace) - 1) / float(trace.time[-1] - trace.time[0])


def lasted(trace: Trace) -> float:
    """How long a run's joint stayed a number [s]."""
    bad = np.flatnonzero(~np.isfinite(trace["joint"]))
    return float(trace.time[bad[0] if len(bad) else -1] - trace.time[0])


def motion(traces: Traces, colours: Colours) -> "Figure":
    """Reference and joint over time, a row for each run."""
    figure, rows = new_figure(len(traces), 1, height=0.9 + 1.7 * len(traces), share_x=True)
    for axes, (name, trace) in zip(rows, traces.items(), strict=True):
        draw_motion(axes, trace.time, trace["reference"], trace["joint"], colours[name])
        axes.set_title(name)
    rows[-1].set_xlabel("time [s]")
    return figure


def error(traces: Traces, colours: Colours) -> "Figure":
    """Error over time, all runs in one."""
    figure, (axes,) = new_figure(height=2.8)
    for name, trace in traces.items():
        _draw(axes, trace, trace.error * DEGREES, colours[name], name)
    stable = [trace.error * DEGREES for trace in traces.values() if trace.stable]
    swing = [0.1 * (trace["reference"] - np.mean(trace["reference"])) * DEGREES for trace in traces.values()]
    stay_near(axes, stable or swing, [trace.error * DEGREES for trace in traces.values()])
    axes.set(xlabel="time [s]", ylabel="error [°]")
    legend(axes)
    return figure


def loops(traces: Traces, colours: Colours) -> "Figure":
    """Joint over reference and joint over motor, a panel for each run."""
    columns = min(3, max(2, len(traces)))
    rows = math.ceil(len(traces) / columns)
    figure, panels = new_figure(rows, columns, height=0.5 + 2.5 * rows)
    for axes, (name, trace) in zip(panels, traces.items(), strict=False):
        reference, joint = trace["reference"] * DEGREES, trace["joint"] * DEGREES
        ends = [float(np.min(reference)), float(np.max(reference))]
        axes.plot(ends, ends, color=COLOURS["reference"], lw=0.7)
        if "motor" in trace.columns:
            axes.plot(*thin(trace["motor"] * DEGREES, joint), color=COLOURS["limit"], lw=1.0)
        axes.plot(*thin(reference, joint), color=colours[name], lw=1.2)
        axes.set(title=name, xlabel="reference, motor [°]", ylabel="joint [°]")
        stay_near(axes, [reference], [joint])
        if trace.stable and "motor" in trace.columns:
            motor = trace["motor"] * DEGREES
            ends = [min(ends[0], float(motor.min())), max(ends[1], float(motor.max()))]
        axes.set_xlim(*widened(ends[0], ends[1], 0.06))
    for axes in panels[len(traces) :]:
        axes.set_axis_off()
    return figure


def effort(traces: Traces, colours: Colours) -> "Figure":
    """Command, command − reference, and current over time where it was recorded."""
    with_current = all("current" in trace.columns for trace in traces.values())
    count = 3 if with_current else 2
    figure, rows = new_figure(count, 1, height=0.6 + 1.7 * count, share_x=True)
    added = {name: (trace["command"] - trace["reference"]) * DEGREES for name, trace in traces.items()}
    for name, trace in traces.items():
        _draw(rows[0], trace, trace["command"] * DEGREES, colours[name], name)
        _draw(rows[1], trace, added[name], colours[name])
        if with_current:
            _draw(rows[2], trace, trace["current"], colours[name])
    stable = [name for name, trace in traces.items() if trace.stable] or list(traces)
    references = [trace["reference"] * DEGREES for trace in traces.values()]
    stay_near(rows[0], references, [trace["command"] * DEGREES for trace in traces.values()])
    stay_near(rows[1], [added[name] for name in stable], list(added.values()))
    if with_current:
        currents = {name: trace["current"] for name, trace in traces.items()}
        stay_near(rows[2], [currents[name] for name in stable], list(currents.values()))
        rows[2].set_ylabel("current [A]")
    rows[0].set_ylabel("command [°]")
    rows[1].set_ylabel("command −\nreference [°]")
    rows[-1].set_xlabel("time [s]")
    legend(rows[0])
    return figure


def law_states(trace: Trace, colour: str) -> "Figure | None":
    """A band for each of the law's own variables but its command, over time, from its smallest to its largest value.

    One pair of axes for all of them: matplotlib takes half a second for each dozen of panels. None where the law has no
    variable that ever leaves zero.
    """
    names = [
        name
        for name in trace.columns
        if name.startswith("law.") and name != "law.command" and np.nanmax(np.abs(trace[name]), initial=0.0) > 0.0
    ]
    if not names:
        return None
    figure, (axes,) = new_figure(height=0.7 + 0.42 * len(names))
    for row, name in enumerate(names):
        values = trace[name]
        finite = values[np.isfinite(values)]
        low, high = float(finite.min()), float(finite.max())
        share = (values - low) / (high - low) if 0.0 < high - low < np.inf else np.full_like(values, 0.5)
        axes.plot(*thin(trace.time, row + 0.4 - 0.8 * share, 2000), color=colour, lw=1.0)
        unit = "" if trace.units[name] == "1" else f" {trace.units[name]}"
        said = f"{low:.3g} … {high:.3g}{unit}" if high > low else f"{low:.3g}{unit}"
        axes.text(1.01, row, said.replace("-", "−"), transform=axes.get_yaxis_transform(), va="center", fontsize=8.0)
    axes.set_yticks(range(len(names)), [name.removeprefix("law.").replace("_", " ") for name in names])
    axes.set(ylim=(len(names) - 0.5, -0.5), xlabel="time [s]")
    return figure


def sheath(traces: Traces) -> "Figure | None":
    """Width and slope of the cable's hysteresis over time; None where nobody moved the sheath."""
    trace = next(iter(traces.values()))
    drawn = [name for name in ("width", "slope") if name in trace.columns]
    if not any(np.ptp(trace[name]) > 1e-9 for name in drawn):
        return None
    figure, panels = new_figure(1, len(drawn), height=2.3)
    for axes, name in zip(panels, drawn, strict=True):
        axes.plot(*thin(trace.time, trace[name]), color=COLOURS["data"])
        axes.set(title=f"{name} [{trace.units[name]}]", xlabel="time [s]")
        axes.set_ylim(bottom=0.0)
    return figure


def _draw(axes: "Axes", trace: Trace, values: Array, colour: str, label: str = "") -> None:
    """A signal over time; a run that ran away fills its panel, so it is drawn under the others."""
    axes.plot(*thin(trace.time, values), color=colour, label=label, lw=1.1, zorder=2.0 if trace.stable else 1.8)
