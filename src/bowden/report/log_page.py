"""The page of ``bowden log plot``: one recorded run, from motion to lateness."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from bowden.core.style import COLOURS
from bowden.core.trace import Trace
from bowden.report import log_figures as figures
from bowden.report.page import Page

_MOST_EVENTS = 200
_LEFT_OUT = ("names",)  # of the settings: the page shows names in their place


def write_log(
    path: Path | str, trace: Trace, events: Sequence[tuple[float, str]], facts: Mapping[str, Any], title: str
) -> None:
    """Write the page; every figure is there only where the log has its columns.

    Args:
        path: of the HTML file.
        trace: all rows.
        events: time [s] and text of each.
        facts: ``whole``, ``cycles``, ``missing``, ``duration_s``, ``law``, ``start_utc``, ``lateness_s``,
            ``run_time_s``, ``overruns`` and ``software``, as ``bowden log info --json`` has them.
        title: plain text.

    Raises:
        OutputError: the file cannot be written.
    """
    log_page(trace, events, facts, title).write(path)


def log_page(trace: Trace, events: Sequence[tuple[float, str]], facts: Mapping[str, Any], title: str) -> Page:
    """The page that `write_log` writes."""
    law = f" under the law {facts['law']}" if facts["law"] else ""
    page = Page(title, f"{facts['duration_s']:.4g} s, {facts['cycles']} cycles{law}, begun {facts['start_utc']}.")
    if not facts["whole"]:
        page.notice("This log was not closed properly or is damaged: see bowden log recover.")
    if facts["missing"]:
        page.notice(f"{facts['missing']} cycles of the run are missing in this log.")
    has = set(trace.columns).issuperset
    if has({"reference", "joint"}):
        page.heading("How well the joint followed")
        page.figure(
            figures.motion(trace),
            "Reference and measured joint angle, and the error, joint − reference, while there was a reference.",
        )
    if has({"motor"}) and not {"wish", "command"}.isdisjoint(trace.columns):
        page.heading("What the motor was told")
        page.figure(
            figures.commands(trace),
            "What was wished for the motor, what the supervisor let through, and the measured motor angle; "
            "below, how far the two commands are from the motor.",
        )
    bands = figures.states(trace)
    if bands is not None:
        page.heading("Modes, reactions and faults")
        page.figure(bands, "The number of each state, by its name, as long as it held; a bar for each fault.")
    if events:
        rows = [[f"{time:.3f}", text] for time, text in events[:_MOST_EVENTS]]
        more = len(events) - len(rows)
        page.table(["time [s]", "event"], rows, caption=f"And {more} more." if more > 0 else "Every change.")
    loads = figures.loads(trace)
    if loads is not None:
        page.heading("Load and heat")
        page.figure(loads, "What the drive measured beside the angles.")
    late = figures.lateness(trace)
    if late is not None:
        page.heading("How punctual the loop was")
        page.figure(late, "How often a cycle began so late, and took so long; the count's axis is logarithmic.")
        page.table(["", "p50 [µs]", "p99 [µs]", "p99.9 [µs]", "largest [µs]"], list(_punctuality(facts)))
    inside = figures.law_states(trace, COLOURS["joint"])
    if inside is not None:
        page.heading("Inside the law")
        page.figure(inside, "What the law remembers from one cycle to the next, in SI units and radians.")
    page.heading("What made this run")
    settings = {key: value for key, value in trace.settings.items() if key not in _LEFT_OUT}
    page.table(["setting", "value"], [[key, value] for key, value in _flat(settings)])
    return page


def _punctuality(facts: Mapping[str, Any]) -> Iterator[list[str]]:
    for name, key in (("lateness", "lateness_s"), ("run time", "run_time_s")):
        if facts[key] is not None:
            yield [name, *(f"{1e6 * facts[key][share]:.1f}" for share in ("p50", "p99", "p99_9", "max"))]


def _flat(value: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(inner, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(value, float):
        yield prefix, f"{value:.6g}"
    else:
        text = "none" if value is None else str(value)
        yield prefix, text if len(text) <= 200 else text[:199] + "…"
