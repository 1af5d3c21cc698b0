"""The log of a run: its facts in a terminal, and its page."""

from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.core.errors import OutputError, counted
from bowden.core.files import printable
from bowden.live.figures import LogFacts
from bowden.operations.log import LogDrawn, LogExported, LogInfo, LogRecovered, LogReplay
from bowden.views.text import Call

if TYPE_CHECKING:
    from bowden.live.mcap_read import Recording


def show_log_info(found: LogInfo, call: Call) -> None:
    """A line for each fact."""
    print(found.file)
    for name, value in lines(found):
        print(f"  {name:<16} {value}")


_MOST_EVENTS = 12
"""Half of them from the end; the JSON document has them all."""


def lines(found: LogFacts) -> Iterator[tuple[str, str]]:
    """The facts as pairs of texts."""
    from bowden.live import stops

    yield "outcome", found.outcome
    if found.rmse_deg is not None:
        figures = f"{found.rmse_deg:.3f}° RMS, {found.peak_deg:.2f}° peak"
        yield "error", f"{figures} over {found.seconds_led:g} s under the law"
    if found.estimate_std_deg is not None:
        yield "joint", f"estimated; 1 σ {found.estimate_std_deg:.3f}° RMS under the law"
    yield "begun", found.start_utc
    if found.begin_s:
        yield "first cycle", f"{found.begin_s:.3f} s later, by the column time; counted from here on below"
    if found.running_s is not None:
        yield "running", f"from {found.running_s - (found.begin_s or 0.0):.3f} s on, once armed and told to run"
    yield "duration", f"{found.duration_s:.3f} s, {found.cycles} cycles"
    yield "missing", counted(found.missing, "cycle") if found.missing else "nothing"
    yield "closed properly", "yes" if found.closed else "no"
    if not found.whole and found.closed:
        yield "damage", ", ".join(f"{value} {name}" for name, value in asdict(found.damage).items())
    for name in ("law", "rig", "seed"):
        if (value := getattr(found, name)) is not None:
            yield name, str(value)
    for name, motor in found.motors.items():
        yield "motor", f"{name}: {motor.law}, rig {motor.rig}"
    about = found.settings.get("about")
    for name, text in about.items() if isinstance(about, dict) else ():
        yield printable(str(name)), printable(str(text))
    if found.twin is not None:
        yield "drive", "the command's own twin" if found.twin else "on the rig's bus"
    for name, one in (("lateness", found.lateness), ("run time", found.run_time)):
        if one is not None:
            shares = f"p50 {one.p50_us:.1f}, p99 {one.p99_us:.1f}, p99.9 {one.p999_us:.1f}, max {one.max_us:.1f}"
            yield name, f"{shares} µs"
    if found.overruns is not None:
        yield "overruns", str(found.overruns)
    yield "software", ", ".join(found.software.values())
    for stop in found.stops:
        for line in stops.lines(stop, twin=bool(found.twin)):
            yield "stopped", f"{stop.time_s:.3f} s: {line}"
    events, begin = found.events, found.begin_s or 0.0
    for emergency in found.emergencies:
        yield "emergency", f"{(emergency.time_s or begin) - begin:.3f} s: {emergency.text}"
    for change in found.gains:
        there = change.in_force_s
        when = "not in force at the log's end" if there is None else f"in force at {there - begin:.3f} s"
        values = f"{change.name} {change.before:.6g} → {change.to:.6g}"
        yield "gain", f"{(change.time_s or begin) - begin:.3f} s: {values}, {when}"
    for motion in found.motions:
        yield "motion", f"{(motion.time_s or begin) - begin:.3f} s: {motion.text}"
    left_out = len(events) - _MOST_EVENTS
    for number, event in enumerate(events):
        if left_out > 0 and number == _MOST_EVENTS // 2:
            yield "", f"… {counted(left_out, 'more event')}, all of them with --json …"
        if left_out <= 0 or not _MOST_EVENTS // 2 <= number < len(events) - _MOST_EVENTS // 2:
            time = "" if event.time_s is None else f"{event.time_s - begin:.3f} s: "
            yield "event", f"{time}{event.text}"


def show_log_recover(found: LogRecovered, call: Call) -> None:
    """Show what was saved, and what may be missing."""
    print(f"{found.files[0]}: {found.rows} cycles")
    if found.missing:
        print(f"missing before the last of them: {found.missing} cycles, {found.missing_seconds:.3f} s")
    damaged = found.damage.chunks or found.damage.skipped
    if damaged:
        print(f"left out: {found.damage.chunks} damaged chunks, {found.damage.skipped} bytes that are no record")
    if found.tail_seconds:
        print(
            f"{call['file']} has no proper end: after its last cycle up to {found.tail_seconds:g} s of the run may be "
            "missing, more where the disk was slow or full or the power went"
        )
    elif not (found.missing or damaged):
        print("nothing was missing")


def show_log_export(found: LogExported, call: Call) -> None:
    """The trace."""
    print(f"{found.files[0]}: {found.cycles} cycles of {len(found.columns)} columns")


def write_log_plot(found: LogDrawn, call: Call, *, out: Path | None = None) -> list[Path]:
    """Write a page for each motor.

    Args:
        found: the log.
        call: of the command.
        out: the page; NAME.html by default.
    """
    file, motor = call["file"], call["motor"]
    target = out or file.with_suffix(".html")
    if target.absolute() == file.absolute():
        raise OutputError(f"{target} is the log itself", do="choose another name with --out")
    parts = found.recording.parts if motor is None else {"": found.recording}
    files = [target.with_stem(f"{target.stem}-{name}") if name else target for name in parts]
    for page, (name, part) in zip(files, parts.items(), strict=True):
        draw_log(part, page, f"Run {file.name}{f', {name or motor}' if name or motor else ''}")
    return files


def draw_log(found: "Recording", target: Path, title: str) -> None:
    """Write the page of one motor."""
    from bowden.live.log_facts import facts
    from bowden.report.log_page import log_page

    said, trace = facts(found), found.trace()
    begin = said.begin_s or 0.0  # the column time begins with the command, which compiles first
    trace = replace(trace, columns={**trace.columns, "time": trace.columns["time"] - begin})
    events = [(event.time - begin, event.text) for event in found.events]
    log_page(trace, events, said, title).write(target)


def show_log_plot(found: LogDrawn, call: Call) -> None:
    """Where the pages are."""
    for page in call.files:
        print(f"Page: {page}  ({call.seconds:.1f} s)")


def show_log_replay(found: LogReplay, call: Call) -> None:
    """Show the comparison of each motor."""
    for one in found.motors or (found,):
        if one.motor:
            print(f"motor {one.motor}")
        whose = "with the record's gains" if one.same_law else "with its default gains, in place of the record's law"
        print(f"{one.law}, {whose}: {one.cycles} cycles, the law had the motor in {one.law_cycles}")
        if one.requested_target_largest is not None:
            print(
                f"requested target: differs by {one.requested_target_largest:.3g} rad at most, "
                f"{one.requested_target_rms:.3g} rad RMS"
            )
        first = "" if one.first_other_verdict is None else f", first at {one.first_other_verdict:.3f} s"
        target = f"target by {one.command_largest:.3g} rad at most"
        print(f"verdict: differs in {one.verdicts_differing} cycles{first}; {target}")
        if one.torque_largest is not None:
            print(f"torque offset: differs by {one.torque_largest:.3g} N·m at most")
