"""The figures of `simulate_page`."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, dashes_for, draw_motion, legend, legend_height, new_figure, stay_near, thin
from bowden.records.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Array = NDArray[np.float64]
Traces = Mapping[str, Trace]
Colours = Mapping[str, str]
Panel = tuple[Mapping[str, Array], list[Array]]
"""A signal of each run, and those that the axis is to show wholly."""

_MANY = 4
"""With more runs than these, the panel of each is lower."""


def rate(trace: Trace) -> float:
    """Samples a second [Hz]."""
    return (len(trace) - 1) / float(trace.time[-1] - trace.time[0])


def lasted(trace: Trace) -> float:
    """Time for which the joint of a run stayed finite [s]."""
    bad = np.flatnonzero(~np.isfinite(trace["joint"]))
    return float(trace.time[bad[0] if len(bad) else -1] - trace.time[0])


def motion(traces: Traces, colours: Colours) -> "Figure":
    """Reference and joint over time, a row for each run."""
    each = 1.7 if len(traces) <= _MANY else 1.25
    figure, rows = new_figure(len(traces), 1, height=0.9 + each * len(traces), share_x=True)
    for axes, (name, trace) in zip(rows, traces.items(), strict=True):
        draw_motion(axes, trace.time, trace["reference"], trace["joint"], colours[name])
        axes.set_title(name)
    rows[-1].set_xlabel("time [s]")
    return figure


def error(traces: Traces, colours: Colours) -> "Figure":
    """Error over time, all runs in one."""
    errors = {name: trace.error * DEGREES for name, trace in traces.items()}
    swing = [0.1 * (trace["reference"] - np.mean(trace["reference"])) * DEGREES for trace in traces.values()]
    return _together(traces, colours, {"error [°]": (errors, _of_stable(traces, errors) or swing)}, 2.8)


def loops(traces: Traces, colours: Colours) -> "Figure":
    """Joint over reference and joint over motor, a panel for each run; all axes have one scale and one range."""
    columns = min(3, max(2, len(traces)))
    rows = math.ceil(len(traces) / columns)
    figure, panels = new_figure(rows, columns, height=0.3 + (7.0 / columns) * rows)
    low, high = math.inf, -math.inf
    for axes, (name, trace) in zip(panels, traces.items(), strict=False):
        reference, joint = trace["reference"] * DEGREES, trace["joint"] * DEGREES
        shown = [reference]
        if "motor" in trace.columns:
            motor = trace["motor"] * DEGREES
            axes.plot(*thin(motor, joint), color=COLOURS["limit"], lw=1.0)
            shown += [motor] if trace.stable else []
        ends = [float(np.min(reference)), float(np.max(reference))]
        axes.plot(ends, ends, color=COLOURS["reference"], lw=0.7)
        axes.plot(*thin(reference, joint), color=colours[name], lw=1.2)
        stay_near(axes, shown, [joint])
        low, high = min(low, axes.get_ylim()[0]), max(high, axes.get_ylim()[1])
        axes.set(title=_broken(name, 60 // columns), xlabel="reference, motor [°]", ylabel="joint [°]")
        axes.locator_params(nbins=6)
    for axes in panels[: len(traces)]:
        axes.set(xlim=(low, high), ylim=(low, high), aspect="equal")
    for axes in panels[len(traces) :]:
        axes.set_axis_off()
    return figure


def _broken(name: str, most: int) -> str:
    """A name in two lines, broken behind an underscore, where it is longer than that."""
    cut = name.rfind("_", 0, most) + 1
    return f"{name[:cut]}\n{name[cut:]}" if len(name) > most and cut else name


def effort(traces: Traces, colours: Colours) -> "Figure":
    """Command, command − reference, and current over time where it was recorded."""
    references = [trace["reference"] * DEGREES for trace in traces.values()]
    added = {name: (trace["command"] - trace["reference"]) * DEGREES for name, trace in traces.items()}
    panels: dict[str, Panel] = {
        "command [°]": ({name: trace["command"] * DEGREES for name, trace in traces.items()}, references),
        "command −\nreference [°]": (
            added,
            _of_stable(traces, added) or [0.5 * (one - one.mean()) for one in references],
        ),
    }
    if all("current" in trace.columns for trace in traces.values()):
        panels["current [A]"] = _column(traces, "current")
    return _together(traces, colours, panels, 0.6 + 1.7 * len(panels))


def pulls(traces: Traces, colours: Colours) -> "Figure":
    """Torque of the cables on the joint that they share, over time."""
    return _together(traces, colours, {"torque on the joint [N·m]": _column(traces, "pull")}, 2.8)


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
        there = _there(values)
        axes.plot(*thin(trace.time[:there], (row + 0.4 - 0.8 * share)[:there], 2000), color=colour, lw=1.0)
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


def _together(traces: Traces, colours: Colours, panels: Mapping[str, Panel], height: float) -> "Figure":
    """Signals of all runs over time, a row each; a run that ran away fills its panel: it is drawn under the others."""
    figure, rows = new_figure(len(panels), 1, height=height + legend_height(list(traces)), share_x=True)
    dashes = dashes_for(list(traces)) if len(traces) > 1 else dict.fromkeys(traces, "-")  # alone nothing is mistaken
    for axes, (label, (values, near)) in zip(rows, panels.items(), strict=True):
        for name, trace in traces.items():
            order = 2.0 if trace.stable else 1.8
            there = _there(values[name])
            shown = thin(trace.time[:there], values[name][:there])
            axes.plot(*shown, color=colours[name], label=name, lw=1.1, ls=dashes[name], zorder=order)
        stay_near(axes, near, list(values.values()))
        axes.set_ylabel(label)
    rows[-1].set_xlabel("time [s]")
    legend(rows[0])
    return figure


def _column(traces: Traces, name: str) -> Panel:
    values = {run: trace[name] for run, trace in traces.items()}
    return values, _of_stable(traces, values) or list(values.values())


def _there(values: Array) -> int:
    """How many samples a signal has until it is no number any more, for good."""
    return len(values) - int(np.argmax(np.isfinite(values[::-1]))) if np.isfinite(values).any() else len(values)


def _of_stable(traces: Traces, values: Mapping[str, Array]) -> list[Array]:
    """The signals of the runs that were stable."""
    return [values[name] for name, trace in traces.items() if trace.stable]


def is_suit(traces: Mapping[str, Trace]) -> bool:
    """True if every run was on a suit."""
    return all("flexor_tension" in trace.columns for trace in traces.values())


def tensions(traces: Mapping[str, Trace]) -> "Figure":
    """Tensions of both cables at the arm and at the spool, a row for each run."""
    figure, rows = new_figure(len(traces), 1, height=0.9 + 1.7 * len(traces), share_x=True)
    for axes, (name, trace) in zip(rows, traces.items(), strict=True):
        for side, colour in (("flexor", COLOURS["joint"]), ("extensor", COLOURS["motor"])):
            axes.plot(*thin(trace.time, trace[f"{side}_tension"]), color=colour, label=f"{side}, arm")
            axes.plot(*thin(trace.time, trace[f"{side}_motor_tension"]), color=colour, ls=":", lw=1.0, label="spool")
        axes.set(title=name, ylabel="tension [N]")
        axes.set_ylim(bottom=0.0)
    legend(rows[0], columns=4)
    rows[-1].set_xlabel("time [s]")
    return figure


def is_pushed(traces: Mapping[str, Trace]) -> bool:
    """True if the wearer's push made the reference of every run."""
    return all("admittance.push.torque" in trace.columns for trace in traces.values())


def pushes(traces: Mapping[str, Trace], colours: Mapping[str, str]) -> "Figure":
    """The push that the admittance follows, and the estimated torque beside the true one, over time."""
    figure, rows = new_figure(1 + len(traces), 1, height=0.9 + 1.7 * (1 + len(traces)), share_x=True)
    for name, trace in traces.items():
        rows[0].plot(*thin(trace.time, trace["admittance.push.torque"]), color=colours[name], label=name, lw=1.1)
    rows[0].set(ylabel="push [N·m]")
    legend(rows[0])
    for axes, (name, trace) in zip(rows[1:], traces.items(), strict=True):
        axes.plot(*thin(trace.time, trace["interaction_torque"]), color=COLOURS["reference"], label="true", lw=1.1)
        axes.plot(*thin(trace.time, trace["admittance.estimate.torque"]), color=colours[name], label="estimate", lw=0.9)
        axes.set(title=name, ylabel="suit's torque\n[N·m]")
        legend(axes)
    rows[-1].set_xlabel("time [s]")
    return figure


def torques(traces: Mapping[str, Trace], colours: Mapping[str, str]) -> "Figure":
    """Torque of the suit and, where there is any, of the wearer on the elbow, and the motor's winding, over time."""
    drawn = {"interaction_torque": "suit [N·m]", "wearer_torque": "wearer [N·m]", "winding_temperature": "winding [°C]"}
    if not any(np.any(trace["wearer_torque"]) for trace in traces.values()):
        del drawn["wearer_torque"]
    panels = {label: _column(traces, column) for column, label in drawn.items()}
    return _together(traces, colours, panels, 0.6 + 1.6 * len(panels))
