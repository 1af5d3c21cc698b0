"""Figures of a run on the suit, for `simulate_page`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from bowden.drawing.style import COLOURS, dashes_for, legend, new_figure, thin
from bowden.records.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    figure, rows = new_figure(len(drawn), 1, height=0.6 + 1.6 * len(drawn), share_x=True)
    dashes = dashes_for(list(traces))
    for axes, (column, label) in zip(rows, drawn.items(), strict=True):
        for name, trace in traces.items():
            line = thin(trace.time, trace[column])
            axes.plot(*line, color=colours[name], label=name, lw=1.1, ls=dashes[name])
        axes.set(ylabel=label)
    legend(rows[0])
    rows[-1].set_xlabel("time [s]")
    return figure
