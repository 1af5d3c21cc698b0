"""The page of `bowden simulate`: one law, or several side by side, on the same bench."""

from collections.abc import Mapping

from bowden.drawing.style import colours_for
from bowden.records.run_figures import NO_FIGURES, Metrics
from bowden.records.trace import Trace
from bowden.report import simulate_figures as figures
from bowden.report.page import Page, flat

_CUT = " Where a curve leaves its panel, the panel says how far it goes on."


def simulation_page(traces: Mapping[str, Trace], title: str) -> Page:
    """The page: metrics, motion and error over time, loops, commands, the laws' states, and all settings.

    Args:
        traces: the name to show → the run, one at least; all runs have the columns ``time``, ``reference`` and
            ``joint``, others are shown where they are there.
        title: plain text.

    Raises:
        LogError: a trace without the columns that every run has.
    """
    colours = colours_for(list(traces))
    measured = {name: trace.metrics() for name, trace in traces.items()}  # first: it refuses what is no run
    page = Page(title, _lead(traces))
    for name, trace in traces.items():
        if not trace.ended:
            page.notice(
                f"{name} is unstable on this bench: its numbers ran away after {figures.lasted(trace):.2f} s, "
                "and it has no figures of merit."
            )
        elif not trace.stable:
            page.notice(f"{name} is unstable on this bench: its error is at times larger than the reference's stroke.")
    page.heading("How well the joint follows")
    _metrics_table(page, traces, measured)
    page.figure(
        figures.motion(traces, colours),
        "Reference and joint angle over time. Where only one line shows, the other lies under it."
        + (_CUT if any(not trace.stable for trace in traces.values()) else ""),
    )
    page.figure(figures.error(traces, colours), "Error, joint − reference.")
    page.part(
        "Hysteresis that is left",
        figures.loops(traces, colours),
        "Coloured: joint over reference; a law that compensates everything draws the thin diagonal. Grey: joint over "
        "motor, the cable's own loop. Both axes have the same scale.",
    )
    if all("command" in trace.columns for trace in traces.values()):
        page.part(
            "Commands to the motor",
            figures.effort(traces, colours),
            "Command to the motor; command − reference, which is the compensation itself"
            + ("; the motor's current." if "current" in next(iter(traces.values())).columns else "."),
        )
    if _is_shared(traces):
        page.part(
            "What each cable pulls",
            figures.pulls(traces, colours),
            "Torque of each cable on the joint that they share; 0 where it is slack.",
        )
    if figures.is_suit(traces):
        page.part(
            "Forces of the suit",
            figures.tensions(traces),
            "Tension of both cables where they pull at the arm, and dotted where they leave the spool: the difference "
            "is friction in the sheath.",
        )
        page.figure(
            figures.torques(traces, colours),
            "Torque of the suit on the elbow, torque of the wearer's muscles (where they do anything), and temperature "
            "of the motor's winding.",
        )
    if figures.is_pushed(traces):
        page.part(
            "Push of the wearer",
            figures.pushes(traces, colours),
            "Above: torque of the wearer on the suit, without the weight that the suit carries, as the admittance "
            "measures it. Below: torque of the suit on the elbow, and its estimate without a load cell.",
        )
    for name, trace in traces.items():
        page.part(
            f"Inside {name}",
            figures.law_states(trace, colours[name]),
            f"The state of {name} over time, each variable between its smallest and its largest value (right), in SI "
            "units and radians.",
        )
    moved = "Width and slope of the cable's hysteresis over time, as the bend of the sheath sets them."
    page.part("How the sheath was moved", figures.sheath(traces), moved)
    page.heading("What made these runs")
    page.text("Angles are in radians, everything else in SI units.")
    _settings_table(page, traces)
    return page


def _lead(traces: Mapping[str, Trace]) -> str:
    first = next(iter(traces.values()))
    motors = len(first.settings["joint"]["motors"]) if _is_shared(traces) else 1
    count = len(traces) // motors
    laws = ("One law" if count == 1 else f"{count} laws") + (f" on {motors} motors" if motors > 1 else "")
    kind = first.settings.get("reference", {}).get("kind", "")
    motion = f", reference: {kind.replace('_', ' ')}" if kind else ""
    return f"{laws}, {first.time[-1] - first.time[0]:.4g} s at {figures.rate(first):.4g} Hz{motion}."


def _is_shared(traces: Mapping[str, Trace]) -> bool:
    """True if each law has a trace for each of several motors on one joint."""
    return all("pull" in trace.columns for trace in traces.values())


def _metrics_table(page: Page, traces: Mapping[str, Trace], measured: Mapping[str, Metrics]) -> None:
    units = {name: unit for name, (_, unit) in NO_FIGURES.shown().items()}
    rows = [
        [name, *(_show(value, 1 if unit == "ms" else 3) for value, unit in one.shown().values())]
        for name, one in measured.items()
    ]
    hard = "10\N{NO-BREAK SPACE}s"
    columns = [f"{name} [{unit}]".replace("10 s", hard) for name, unit in units.items()]
    header = ["law and motor" if _is_shared(traces) else "law", *columns]
    if all(_chirp(trace) is not None for trace in traces.values()):
        header.append("bandwidth [rad/s]")
        for row, trace in zip(rows, traces.values(), strict=True):
            row.append(_show(_chirp_bandwidth(trace), 1))
    known = {name: m.rmse_deg for name, m in measured.items() if m.rmse_deg is not None}
    best = min(known, key=lambda name: known[name]) if len(known) > 1 and not _is_shared(traces) else ""
    page.table(
        header,
        rows,
        caption="Error is joint − reference; the delay is the shift that makes the two agree best; the loop's width is "
        "that of joint over reference at mid-stroke." + (" The run with the least RMSE is marked." if best else ""),
        classes=["best" if name == best else "" for name in measured],
    )


def _chirp(trace: Trace) -> tuple[float, float] | None:
    """The frequencies that a chirp passed during the run, lowest first [Hz]; None where the reference is no chirp."""
    reference = trace.settings.get("reference", {})
    if reference.get("kind") != "chirp":
        return None
    share = min(1.0, float(trace.time[-1] - trace.time[0]) / reference["duration"])
    ends = sorted((reference["f0"], reference["f0"] + share * (reference["f1"] - reference["f0"])))
    return ends[0], ends[1]


def _chirp_bandwidth(trace: Trace) -> float | None:
    passed = _chirp(trace)
    half_width = max(0.15, 2.0 / float(trace.time[-1] - trace.time[0]))  # [Hz]; a short run resolves less
    if passed is None or passed[1] - passed[0] < 4.0 * half_width:
        return None
    return trace.bandwidth(passed[0] + half_width, passed[1] - half_width, half_width)


def _show(value: float | None, digits: int = 3) -> str:
    return "–" if value is None else f"{value:.{digits}f}".replace("-", "−")


def _settings_table(page: Page, traces: Mapping[str, Trace]) -> None:
    """What all runs share once, and what differs run by run."""
    each = {name: dict(flat(trace.settings)) | {"seed": str(trace.seed)} for name, trace in traces.items()}
    keys = dict.fromkeys(key for settings in each.values() for key in settings)  # in order, each once
    shared = {}
    for key in keys:
        values = {settings.get(key) for settings in each.values()}
        if len(values) == 1:
            shared[key] = values.pop() or ""
    own = {
        name: ", ".join(f"{key.removeprefix('gains.')} {value}" for key, value in settings.items() if key not in shared)
        for name, settings in each.items()
    }
    if any(own.values()):
        page.table(["run", "gains and other settings of its own"], [list(pair) for pair in own.items()])
    caption = f"Of {'all' if len(traces) > 2 else 'both'} runs" if len(traces) > 1 else ""
    page.table(["setting", "value"], [[key, value] for key, value in shared.items()], caption=caption)
