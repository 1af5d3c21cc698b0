"""The page of ``bowden log plot``: one recorded run, from how it ended to how punctual its loop was."""

from collections.abc import Iterator, Sequence

import numpy as np

from bowden.drawing.style import COLOURS
from bowden.live import stops
from bowden.live.figures import LogFacts
from bowden.records.trace import Trace
from bowden.report import log_figures as figures
from bowden.report.page import Page, flat
from bowden.report.simulate_figures import law_states

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
    if has({"reference", "joint"}):
        page.heading("How well the joint followed" if np.isfinite(trace.error).any() else "Motion of the joint")
        page.figure(
            figures.motion(trace),
            "Above: measured joint angle and, while there was one, the reference. Below: error, joint − reference."
            if np.isfinite(trace.error).any()
            else "Measured joint angle; this log has no reference.",
        )
    if has({"motor"}) and not {"requested_target", "command"}.isdisjoint(trace.columns):
        page.heading("Commands to the motor")
        page.figure(
            figures.commands(trace),
            "Above: the angle that was requested for the motor, the command that the supervisor sent, and the measured "
            "motor angle. Below: how far the motor was from both.",
        )
    bands = figures.states(trace)
    if bands is not None:
        page.heading("Modes, reactions and faults")
        page.figure(
            bands, "The states of the loop over time, each with its name; below them, a bar while a fault was there."
        )
    if events:
        rows = [[f"{time:.3f}", text] for time, text in events[:_MOST_EVENTS]]
        more = len(events) - len(rows)
        left_out = f"The first {_MOST_EVENTS} changes of state; {more} more are in the log."
        page.table(["time [s]", "event"], rows, caption=left_out if more > 0 else "All changes of state.")
    emg = figures.measured(trace, figures.CONTRACTIONS)
    if emg is not None:
        page.heading("EMG")
        page.figure(emg, "The muscle's level, and what was made of it: 0 rest, 1 flex, 2 hold, 3 extend.")
    loads = figures.measured(trace, figures.LOADS)
    if loads is not None:
        page.heading("Load and heat")
        page.figure(loads, "Current and temperatures that the drive measured or that were computed from them.")
    late = figures.lateness(trace)
    if late is not None:
        page.heading("How punctual the loop was")
        page.figure(
            late,
            "How many cycles began how late (left), and took how long (right). All axes are logarithmic; what is below "
            "1 µs is counted there.",
        )
        page.table(["", "p50 [µs]", "p99 [µs]", "p99.9 [µs]", "largest [µs]"], list(_punctuality(facts)))
    inside = law_states(trace, COLOURS.get(str(facts.law), COLOURS["joint"]))
    if inside is not None:
        page.heading("Inside the law")
        page.figure(
            inside,
            "The state of the law over time, each variable between its smallest and its largest value (right), in SI "
            "units and radians.",
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
