"""The page of ``bowden demo``: a cable's loop before and after, in plain words; and what each of its steps says."""

import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from bowden.core.units import DEGREES
from bowden.design.check_result import Check
from bowden.drawing.style import COLOURS
from bowden.identify.cable.fit import Fit
from bowden.identify.log.read import Log
from bowden.live import stops
from bowden.live.figures import EndedRun
from bowden.records.trace import LED, Trace
from bowden.report import simulate_figures as figures
from bowden.report.identify_page import TITLES, loop_figure
from bowden.report.page import Page

WITHOUT = "uncompensated"
"""The law that compensates nothing."""
_UNSEEN = "on the half of the log that it was not fitted to"
_MEANT_LOST = "how far apart the joint is going up and going down, on average over this log's strokes"
_UNCOMPENSATED = "without compensation (the motor goes where the joint should)"
_SAID = {
    "holds": "it is stable over the bends and the stroke of the run, with its margins",
    "little_margin": "it is stable, with little margin",
    "limit_cycle": "it stays bounded, and swings at rest",
    "does_not_hold": "it is not stable on this rig",
}


def log_line(log: Log, *, simulated: bool) -> str:
    """Description of the log."""
    what = "simulated, since no log was given" if simulated else "yours"
    rows = len(log.time)
    length = float(log.time[-1] - log.time[0])
    return f"Log: {log.name}, {what}: {length:.3g} s, {rows} samples of motor and joint, nothing compensates"


def model_lines(fit: Fit) -> list[str]:
    """Which model, how far it errs, what the cable loses, and whether to trust it."""
    best, line = fit.chosen, fit.models["line"]
    error = f"{_angle(best.test_rms)} RMS {_UNSEEN}"
    lines = [f"Model: {TITLES[fit.best.name]}, {error} (a straight line: {_angle(line.test_rms)})"]
    if best.loop is not None:
        lines.append(f"The cable loses {_lost(fit)}: {_MEANT_LOST}")
    return [*lines, f"Trust it? {fit.trust.level.capitalize()}: {'; '.join(fit.trust.reasons)}"]


def check_line(found: Check) -> str:
    """The verdict and what the margins mean."""
    return f"Check: {found.law} {found.verdict.replace('_', ' ')}: {_SAID[found.verdict]}{_room(found)}"


def simulated_line(traces: Mapping[str, Trace]) -> str:
    """How far the joint is from where it should be, without a law and with one."""
    said = [f"{_error(one)} {_UNCOMPENSATED if name == WITHOUT else f'with {name}'}" for name, one in traces.items()]
    return f"Simulation: the joint is off by {'; by '.join(said)}{_times_less(traces)}"


def live_line(live: Trace, found: EndedRun) -> str:
    """Tracking error, end and longest cycle of the live run."""
    followed = f"{_error(live)} over {found.seconds_led:.3g} s" if found.rmse_deg is not None else "no law led"
    return f"Live: {followed}; {ending(found)}; the longest cycle took {_longest(live)}"


def by_the_computer(found: EndedRun) -> bool:
    """True if a run was ended by this computer, which stalled, and not by the rig."""
    return bool(found.stalled_ms) or any(stop.too_busy for stop in found.stops)


def ending(found: EndedRun) -> str:
    """End of the live run."""
    if found.ended_well:
        return "it ended as asked, in a controlled release"
    if by_the_computer(found):
        return "it was ended by this computer, which stalled, and not by the rig: close other programs, try again"
    why = found.error or found.unattended or found.preflight or ", ".join(found.faults) or "not known"
    return f"it was ended before its time: {why}"


def demo_page(
    fit: Fit, check: Check, traces: Mapping[str, Trace], live: Trace, found: EndedRun, log: Sequence[str]
) -> Page:
    """The page.

    Args:
        fit: of the log.
        check: of the law that ran.
        traces: of the simulation, `WITHOUT` and the law.
        live: record of the live run.
        found: how it ended.
        log: the words that name it to `bowden identify`; none of a simulated one.
    """
    law = check.law
    led = _led(live)
    runs = {
        ("without compensation" if name == WITHOUT else f"{name}, simulated"): one for name, one in traces.items()
    } | ({f"{law}, live": led} if led else {})
    colours = {name: COLOURS[kind] for name, kind in zip(runs, ("error", "joint", "bowden"), strict=False)}
    low, high = _stroke(traces)
    from markupsafe import Markup

    page = Page(
        "Your cable, before and after" if log else "A cable, before and after",
        f"From {fit.log.name} to a law that makes the joint follow. The rig is simulated and its drive is a program: "
        "nothing here has moved a motor, and until somebody has run it on hardware it is for no limb.",
    )
    page.heading("In short")
    rows = _in_short(fit, check, traces, live, found)
    page.text(
        Markup("<dl>{}</dl>").format(
            Markup("").join(Markup("<dt>{}</dt><dd><strong>{}</strong>, {}</dd>").format(*row) for row in rows)
        )
    )
    page.figure(
        figures.loops(runs, colours),
        f"Joint over reference, from {low} to {high}° and back: what the cable loses is the loop's height; a law that "
        "makes it up draws the thin diagonal. Grey: joint over motor, the cable's own loop, which stays.",
    )
    page.figure(figures.error(runs, colours), "How far the joint is from where it should be.")
    page.heading("What the log shows")
    page.text(
        "Trust the model? <strong>{level}</strong>: {why}.",
        level=fit.trust.level.capitalize(),
        why="; ".join(fit.trust.reasons),
    )
    page.warnings(fit.warnings)
    page.figure(
        loop_figure(fit),
        f"Left: joint over motor, recorded (broad) and by the model ({TITLES[fit.best.name]}, thin). Right: the same "
        "less a straight line; its height is the motion that the cable loses.",
    )
    page.heading("What was checked, and what ran")
    page.text("{check}. {reason}.", check=check_line(check), reason=check.reason[0].upper() + check.reason[1:])
    if check.advice:
        page.text("Advice: {advice}.", advice=check.advice)
    page.text("{live}.", live=live_line(live, found))
    for stop in found.stops:
        for said in stops.lines(stop, twin=True):
            page.notice(f"Stopped at {stop.time_s:.3f} s: {said}.")
    page.heading("The same step by step" if log else "With a log of your own")
    if not log:
        page.text(
            "Record motor and joint on one clock, at 100 Hz or more, without compensation, for five cycles of large "
            "and small strokes. Then <code>make demo LOG=my.csv</code> draws this page for it. Step by step:"
        )
    page.text('<div class="wide"><pre>{commands}</pre></div>', commands="\n".join(own_commands(log or ["my.csv"], law)))
    page.text(
        "The servo, the encoders and the drive of rig.toml are those of a bench in a paper: write your own into it "
        "(docs/rig.md), check again, and read docs/drives.md before a motor moves. <code>make paper</code> "
        "computes that paper's figures."
    )
    return page


def own_commands(log: Sequence[str], law: str) -> list[str]:
    """The five commands from a log to a live run on a twin.

    >>> own_commands(["my log.csv"], "bowden")[0]
    "bowden identify 'my log.csv'"
    """
    laws = [word for name in dict.fromkeys((WITHOUT, law)) for word in ("--law", name)]
    commands = (
        ["identify", *log],
        ["init", "--model", "out/identify/model.toml"],
        ["check", "rig.toml"],
        ["simulate", "rig.toml", *laws],
        ["run", "rig.toml", "--twin", "--auto", "--duration", "20"],
    )
    return [shlex.join(["bowden", *words]) for words in commands]


def _in_short(
    fit: Fit, check: Check, traces: Mapping[str, Trace], live: Trace, found: EndedRun
) -> list[tuple[str, str, str]]:
    """Step, figure, and what it means."""
    low, high = _stroke(traces)
    followed = _error(live) if found.rmse_deg is not None else "no law led"
    first = next(iter(traces.values()))
    meant = {
        WITHOUT: ("no law", f"simulated, {first.time[-1] - first.time[0]:.0f} s from {low} to {high}° and back"),
        check.law: (f"with {check.law}", f"the same motion{_times_less(traces)}"),
    }
    return [
        *([("cable loses", _lost(fit), _MEANT_LOST)] if fit.chosen.loop else []),
        ("model errs by", f"{_angle(fit.chosen.test_rms)} RMS", f"{_UNSEEN}; trust it: {fit.trust.level}"),
        *((meant[name][0], _error(trace), meant[name][1]) for name, trace in traces.items()),
        ("checked", check.verdict.replace("_", " "), f"{_SAID[check.verdict]}{_room(check)}"),
        ("live", followed, f"{found.seconds_led:.3g} s in real time on a twin; {ending(found)}"),
        ("longest cycle", _longest(live), "from when it was due until its command was out"),
    ]


def _stroke(traces: Mapping[str, Trace]) -> tuple[str, str]:
    """Both ends of the reference [°]."""
    reference = next(iter(traces.values()))["reference"] * DEGREES
    return f"{reference.min():.0f}", f"{reference.max():.0f}"


def _led(live: Trace) -> Trace | None:
    """The part of a live run in which the law led, with time from its beginning; None where it never did."""
    led = (live["source"] >= LED) & np.isfinite(live.error)
    if np.count_nonzero(led) < 2:
        return None
    columns = {name: live[name][led] for name in ("time", "reference", "joint", "motor")}
    columns["time"] = columns["time"] - columns["time"][0]
    return Trace(columns, {name: live.units[name] for name in columns}, live.settings)


def _angle(angle: float) -> str:
    return f"{angle * DEGREES:.2g}°"


def _lost(fit: Fit) -> str:
    return _angle(abs(fit.chosen.loop.height)) if fit.chosen.loop else "–"


def _error(trace: Trace) -> str:
    """RMS and largest error of a run."""
    if not trace.stable and "source" not in trace:
        return "unstable"
    found = trace.metrics()
    return f"{found.rmse_deg:.2g}° RMS, {found.peak_deg:.2g}° at most"


def _times_less(traces: Mapping[str, Trace]) -> str:
    errors = [trace.metrics().rmse_deg or 0.0 for trace in traces.values() if trace.stable]
    if len(errors) < 2 or not all(errors):
        return ""
    times = errors[0] / errors[1]
    return f", {float(f'{times:.2g}'):g} times less" if times > 1.0 else ", no less than without"


def _room(found: Check) -> str:
    """The margins as what may change before the loop swings."""
    gain, delay = found.gain_margin_db, found.delay_margin_s
    room = [f"its gains may be {10.0 ** (gain / 20.0):.1f} times as high"] if gain is not None else []
    room += [f"its commands {1e3 * delay:.0f} ms later"] if delay is not None else []
    return f"; {' or '.join(room)} before it swings" if room else ""


def _longest(live: Trace) -> str:
    """The longest cycle, from when it was due to its end, beside what it may take."""
    took = live["lateness"] + live["run_time"]
    took = took[np.isfinite(took)]
    if not len(took):
        return "–"
    return f"{1e3 * took.max():.2g} ms where a cycle has {1e3 * float(np.median(np.diff(live.time))):.2g} ms"
