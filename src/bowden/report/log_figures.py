"""The figures of `log_page`."""

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, CYCLE, legend, logarithmic, new_figure, thin
from bowden.live.events import UNREAD, UNREAD_EMG, UNSETTLED
from bowden.records.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_STATES = ("mode", "reaction", "power", "source")
_FAR = 1e12
"""What is later counts as this, so that a histogram has finite bins [µs]."""
_SOON = 1.0
"""What is earlier counts as this: the axis is logarithmic [µs]."""
LOADS = ("current", "tension", "joint_torque", "temperature", "supervisor.heat.winding")
CONTRACTIONS = ("emg.level", "emg.intent")


def motion(trace: Trace) -> "Figure":
    """Joint over time and, where there was a reference, that and the error."""
    follows = np.isfinite(trace.error).any()
    figure, (above, *rest) = new_figure(2 if follows else 1, 1, height=4.0 if follows else 2.4, share_x=True)
    _line(above, trace, trace["joint"] * DEGREES, "joint", COLOURS["joint"])
    for below in rest:
        _line(above, trace, trace["reference"] * DEGREES, "reference", COLOURS["reference"], 1.0, "--")
        _line(below, trace, trace.error * DEGREES, "error", COLOURS["error"])
        below.set_ylabel("error [°]")
        legend(above)
    above.set_ylabel("angle [°]" if follows else "joint [°]")
    (rest or [above])[-1].set_xlabel("time [s]")
    _same_time(trace, above, *rest)
    return figure


def commands(trace: Trace) -> "Figure":
    """Requested target, command and motor over time, and what the drive had still to do."""
    figure, (above, below) = new_figure(2, 1, height=4.0, share_x=True)
    motor = trace["motor"] * DEGREES
    colours = {"requested_target": COLOURS["limit"], "command": COLOURS["command"]}
    for name, width in (("requested_target", 3.6), ("command", 1.4)):
        if name in trace.columns and np.isfinite(trace[name]).any():
            asked = trace[name] * DEGREES
            _line(above, trace, asked, name, colours[name], width)
            _line(below, trace, asked - motor, f"{name} − motor", colours[name], width)
    _line(above, trace, motor, "motor", COLOURS["motor"], 1.0, "--")
    above.set_ylabel("angle [°]")
    below.set(ylabel="still to go [°]", xlabel="time [s]")
    _same_time(trace, above, below)
    legend(above)
    return figure


def states(trace: Trace) -> "Figure | None":
    """A band for each state column, and a bar for each fault that was ever there; None without any.

    What had not been read yet when the log begins is no fault.
    """
    columns = [name for name in _STATES if name in trace.columns]
    faults = _faults(trace)
    if not columns and not faults:
        return None
    count = len(columns) + len(faults)
    figure, (axes,) = new_figure(height=0.9 + 0.32 * count)
    names = trace.settings.get("names", {})
    for row, column in enumerate(columns):
        for first, last, value in _stretches(trace[column]):
            begin, end = trace.time[first], trace.time[last]
            axes.barh(row, end - begin, left=begin, height=0.72, color=_tint(value), linewidth=0)
            if end - begin > 0.06 * float(trace.time[-1] - trace.time[0]):
                text = _named(value, names.get(column, ()))
                axes.text((begin + end) / 2, row, text, ha="center", va="center", fontsize=8.0, clip_on=True)
    for row, (_, there) in enumerate(faults, len(columns)):
        for first, last, value in _stretches(there):
            if value:
                width = max(trace.time[last] - trace.time[first], 5e-3 * float(trace.time[-1] - trace.time[0]))
                axes.barh(row, width, left=trace.time[first], height=0.72, color=COLOURS["error"], linewidth=0)
    axes.set_yticks(range(count), [*columns, *(name.replace("_", " ") for name, _ in faults)])
    axes.set(ylim=(count - 0.5, -0.5), xlabel="time [s]", xlim=(trace.time[0], trace.time[-1]))
    axes.grid(visible=False, axis="y")
    return figure


def measured(trace: Trace, names: Sequence[str]) -> "Figure | None":
    """Columns over time, one below the other, those that are not NaN throughout; None without any."""
    columns = [name for name in names if name in trace.columns and np.isfinite(trace[name]).any()]
    if not columns:
        return None
    figure, rows = new_figure(len(columns), 1, height=0.6 + 1.3 * len(columns), share_x=True)
    for axes, name, colour in zip(rows, columns, CYCLE, strict=False):
        _line(axes, trace, trace[name], name, colour)
        axes.set_ylabel(f"{name.rpartition('.')[2]}\n[{trace.units[name]}]")
    rows[-1].set_xlabel("time [s]")
    _same_time(trace, *rows)
    return figure


def lateness(trace: Trace) -> "Figure | None":
    """Histograms of lateness and run time; None without either."""
    columns = [name for name in ("lateness", "run_time") if name in trace.columns and np.isfinite(trace[name]).any()]
    if not columns:
        return None
    figure, panels = new_figure(1, len(columns), height=2.6)
    for axes, name in zip(panels, columns, strict=True):
        values = np.clip(1e6 * trace[name][np.isfinite(trace[name])], -_FAR, _FAR)
        values = np.maximum(values, _SOON)
        bins = np.geomspace(0.9 * float(values.min()), 1.1 * float(values.max()), 60)
        axes.hist(values, bins=bins.tolist(), color=COLOURS["joint"], log=True)
        axes.set(xlabel=f"{name.replace('_', ' ')} [µs]", ylabel="cycles")
        logarithmic(axes, "x")
    return figure


def _line(
    axes: "Axes", trace: Trace, values: Array, label: str, colour: str, width: float = 1.3, style: str = "-"
) -> None:
    axes.plot(*thin(trace.time, values), color=colour, lw=width, ls=style, label=label)


def _same_time(trace: Trace, *rows: "Axes") -> None:
    for axes in rows:
        axes.set_xlim(trace.time[0], trace.time[-1])


def _faults(trace: Trace) -> list[tuple[str, Array]]:
    """Name of each fault that was ever there, and whether it was there in each cycle."""
    if "faults" not in trace.columns:
        return []
    column = trace["faults"]
    sets = np.where((column >= 0.0) & (column < 2.0**53), column, 0.0).astype(np.int64)
    ever = int(np.bitwise_or.reduce(sets))
    names = trace.settings.get("names", {}).get("faults", ())
    found, unread = [], sum(1 << bit for bit, name in enumerate(names) if name in UNREAD)
    read = int(np.argmin((sets & unread) > 0))  # the row with the first reading
    for bit in range(ever.bit_length()):
        there = (sets >> bit & 1).astype(float)
        name, begin = names[bit] if bit < len(names) else "", int(np.argmax(there))
        unsettled = name in UNSETTLED and 0 < begin == read
        if (name in UNREAD | UNREAD_EMG and there[0]) or unsettled:
            there[: begin + int(np.argmin(there[begin:])) if not there[begin:].all() else 0] = 0.0
        if there.any():
            found.append((_named(bit, names), there))
    return found


def _stretches(values: Array) -> list[tuple[int, int, float]]:
    """First index, index after the last (or the last there is) and value of each run of equal values."""
    changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    edges = [0, *changes.tolist(), len(values) - 1]
    return [(first, last, float(values[first])) for first, last in itertools.pairwise(edges)]


def _named(value: float, names: Sequence[str]) -> str:
    known = float(value).is_integer() and 0 <= value < len(names)
    return names[int(value)].replace("_", " ") if known else f"{value:g}"


_TINTS = ("#e8e8e8", "#cfe3f1", "#a9d8c6", "#f6dfa8", "#f3c39f", "#efb0a8")


def _tint(value: float) -> str:
    return _TINTS[int(value) % len(_TINTS)] if np.isfinite(value) and value >= 0 else "#ffffff"
