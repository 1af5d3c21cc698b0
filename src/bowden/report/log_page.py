"""The page of ``bowden log plot``: one recorded run, from how it ended to how punctual its loop was."""

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, CYCLE, legend, logarithmic, new_figure, thin
from bowden.live import stops
from bowden.live.events import UNREAD, UNREAD_EMG, UNSETTLED
from bowden.live.figures import LogFacts
from bowden.records.trace import Trace
from bowden.report.page import Page, flat
from bowden.report.simulate_figures import law_states

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
    faults = faults_of(trace)
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


def faults_of(trace: Trace) -> list[tuple[str, Array]]:
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


_MOST_EVENTS = 200
_LEFT_OUT = ("names",)  # of the settings: the page shows names in their place


def log_page(trace: Trace, events: Sequence[tuple[float, str]], facts: LogFacts, title: str) -> Page:
    """The page of a log; every figure is there only where the log has its columns.

    Args:
        trace: all rows.
        events: time [s] and text of each.
        facts: of the log.
        title: plain text.
    """
    law = f" under the law {facts.law}" if facts.law else ""
    begun = str(facts.start_utc).replace("T", " ").replace("+00:00", " UTC").replace("-", "\N{NON-BREAKING HYPHEN}")
    page = Page(title, f"{facts.duration_s:.4g} s, {facts.cycles} cycles{law}, begun {begun}.")
    if not facts.whole:
        page.notice("This log was not closed properly or is damaged: see bowden log recover.")
    if facts.missing:
        page.notice(f"{facts.missing} cycles of the run are missing in this log.")
    page.heading("How it went")
    _summary(page, trace, facts)
    has = set(trace.columns).issuperset
    if has({"reference", "joint"}) and np.isfinite(trace.error).any():
        page.part(
            "How well the joint followed",
            motion(trace),
            "Above: measured joint angle and, while there was one, the reference. Below: error, joint − reference.",
        )
    elif has({"reference", "joint"}):
        page.part("Motion of the joint", motion(trace), "Measured joint angle; this log has no reference.")
    if has({"motor"}) and not {"requested_target", "command"}.isdisjoint(trace.columns):
        page.part(
            "Commands to the motor",
            commands(trace),
            "Above: the angle that was requested for the motor, the command that the supervisor sent, and the measured "
            "motor angle. Below: how far the motor was from both.",
        )
    page.part(
        "Modes, reactions and faults",
        states(trace),
        "The states of the loop over time, each with its name; below them, a bar while a fault was there.",
    )
    if events:
        rows = [[f"{time:.3f}", text] for time, text in events[:_MOST_EVENTS]]
        more = len(events) - len(rows)
        left_out = f"The first {_MOST_EVENTS} changes of state; {more} more are in the log."
        page.table(["time [s]", "event"], rows, caption=left_out if more > 0 else "All changes of state.")
    muscle = "The muscle's level, and what was made of it: 0 rest, 1 flex, 2 hold, 3 extend."
    page.part("EMG", measured(trace, CONTRACTIONS), muscle)
    warmed = "Current and temperatures that the drive measured or that were computed from them."
    page.part("Load and heat", measured(trace, LOADS), warmed)
    if (late := lateness(trace)) is not None:
        page.part(
            "How punctual the loop was",
            late,
            "How many cycles began how late (left), and took how long (right). All axes are logarithmic; what is below "
            "1 µs is counted there.",
        )
        page.table(["", "p50 [µs]", "p99 [µs]", "p99.9 [µs]", "largest [µs]"], list(_punctuality(facts)))
    page.part(
        "Inside the law",
        law_states(trace, COLOURS.get(str(facts.law), COLOURS["joint"])),
        "The state of the law over time, each variable between its smallest and its largest value (right), in SI units "
        "and radians.",
    )
    page.heading("What made this run")
    page.text("Angles are in radians, everything else in SI units.")
    settings = {key: value for key, value in trace.settings.items() if key not in _LEFT_OUT}
    page.table(["setting", "value"], [[key, value] for key, value in flat(settings)])
    return page


def _summary(page: Page, trace: Trace, facts: LogFacts) -> None:
    """The error while the law led, how the run ended, and every stop by a fault with what to do about it."""
    rows = []
    if facts.rmse_deg is not None:
        rows.append(["RMSE while the law led", f"{facts.rmse_deg:.3f}", "°"])
        rows.append(["peak error", f"{facts.peak_deg:.2f}", "°"])
        rows.append(["the law led for", f"{facts.seconds_led:.4g}", "s"])
    if facts.lateness is not None:
        rows.append(["lateness of a cycle, 99 %", f"{facts.lateness.p99_us:.0f}", "µs"])
    if facts.overruns is not None:
        rows.append(["cycles left out (overruns)", str(facts.overruns), ""])
    page.text("How the run ended: {how}. The log ends at {at:.3f} s.", how=facts.outcome, at=trace.time[-1])
    for stop in facts.stops:
        for line in stops.lines(stop, twin=bool(facts.twin)):
            page.notice(f"Stopped by a fault at {stop.time_s:.3f} s: {line}.")
    if rows:
        page.table(["figure", "value", "unit"], rows)


def _punctuality(facts: LogFacts) -> Iterator[list[str]]:
    for name, one in (("lateness", facts.lateness), ("run time", facts.run_time)):
        if one is not None:
            yield [name, *(f"{value:.1f}" for value in (one.p50_us, one.p99_us, one.p999_us, one.max_us))]
