"""The process of one piece of work of the console; see `bowden.console.jobs`."""

import base64
import json
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.core.errors import BowdenError

if TYPE_CHECKING:
    from bowden.live.mcap_read import Recording
    from bowden.live.stops import Stop
    from bowden.rig.rig import Rig

Progress = Callable[[str, float], None]

_NICE = 10
"""The loop and the page come first."""


def main() -> int:
    """``python -m bowden.console.job_process``."""
    os.nice(_NICE)
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what anything prints is no part of what is said

    def say(what: str, value: Any) -> None:
        out.write(json.dumps({what: value}, ensure_ascii=True) + "\n")
        out.flush()

    given = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_the_console, daemon=True).start()
    work = given.pop("work")
    try:
        say("done", WORKS[work](lambda what, share: say("progress", [what, share]), **given))
    except BowdenError as error:
        say("error", {"what": error.what, "expected": error.expected, "do": error.do})
    except Exception as error:  # the page says so; the terminal of the console shows the rest
        say(
            "error",
            {"what": f"the work failed: {type(error).__name__}", "expected": "", "do": "see the console's terminal"},
        )
        raise
    return 0


def _end_with_the_console() -> None:
    """Whoever waited for this is gone once nothing can come any more."""
    sys.stdin.buffer.read()
    os._exit(3)


def check(progress: Progress, rig: Mapping[str, Any]) -> dict[str, Any]:
    """What `bowden check` says of a rig's law; of one with several axes of each, and the worst of them of all."""
    from bowden.rig.rig import Rig

    whole = Rig.unpack(rig)
    found = {}
    for number, axis in enumerate(whole.parts):
        progress(f"checking {axis.name}".strip(), 0.1 + 0.9 * number / len(whole.parts))
        found[axis.name] = _checked(axis.rig)
    if not whole.axes:
        return found[""]
    name = max(found, key=lambda name: _VERDICTS.index(found[name]["name"]))
    margins = {
        key: min((one[key] for one in found.values() if one.get(key) is not None), default=None)
        for key in ("gain_margin_db", "phase_margin_deg")
    }
    return {
        "holds": all(one["holds"] for one in found.values()),
        "name": found[name]["name"],
        "text": f"{name}: {found[name]['text']}",
        "rows": [[f"{axis}: {label}", text] for axis, one in found.items() for label, text in one["rows"]],
        "of": whole.hash,
        **margins,
    }


_VERDICTS = ("holds", None, "little_margin", "limit_cycle", "does_not_hold")
"""From the best to the worst; None of a law that cannot be checked."""


def _checked(made: "Rig") -> dict[str, Any]:
    from bowden.design.findings import check_rows
    from bowden.design.linearise import NoNumberError
    from bowden.face.check import checked

    try:
        found = checked(made)
    except NoNumberError as error:
        text = f"{made.law_name} cannot be checked ({error.what}) and runs unchecked"
        return {"holds": True, "name": None, "text": text, "rows": [], "of": made.hash}
    rows = [[label, text] for label, text in check_rows(found) if text]
    margins = {"gain_margin_db": found.gain_margin_db, "phase_margin_deg": found.phase_margin_deg}
    holds = found.verdict != "does_not_hold"
    return {"holds": holds, "name": found.verdict, "text": found.reason, "rows": rows, "of": made.hash, **margins}


def summaries(progress: Progress, paths: Sequence[str]) -> dict[str, Any]:
    """Path → what the list of earlier runs says of each; a log that cannot be read is there with its error."""
    from bowden.live.log_facts import FOLLOWED, NEEDED, facts
    from bowden.live.mcap_read import read

    done: dict[str, Any] = {}
    for number, path in enumerate(paths):
        progress("reading logs", number / len(paths))
        try:
            found = read(Path(path), tuple(dict.fromkeys((*NEEDED, *FOLLOWED))))
            done[path] = _summary(found, facts(found))
        except BowdenError as error:
            done[path] = {"time": "", "law": "", "rig": "", "how": error.what}
    return done


def _summary(found: "Recording", said: Mapping[str, Any]) -> dict[str, Any]:
    from bowden.core.units import DEGREES
    from bowden.live.log_facts import followed

    about, rig = said["settings"].get("about") or {}, said["settings"].get("rig") or {}
    stops, mode = said["stops"], float(found["mode"][-1]) if "mode" in found.columns and len(found.rows) else -1.0
    how = "stopped by a fault" if stops else "as asked" if mode == 0.0 else "not known"
    tracked = followed(found)
    return {
        "time": said["start_utc"],
        "law": str(said["law"] or ""),
        "rig": Path(str(rig.get("origin", ""))).name,
        **{name: str(about.get(name, "")) for name in ("subject", "session", "notes")},
        "rmse_deg": None if tracked.rmse is None else tracked.rmse * DEGREES,
        "peak_deg": None if tracked.peak is None else tracked.peak * DEGREES,
        "seconds": said["duration_s"],
        "led_seconds": tracked.seconds,
        "how": how if said["whole"] else f"{how}; the log is not whole",
        "first_fault": stops[0]["causes"][0] if stops and stops[0]["causes"] else None,
    }


def details(progress: Progress, path: str) -> dict[str, Any]:
    """All that the page of one earlier run shows, but its curves."""
    from bowden.console.stream import curves_of
    from bowden.live.log_facts import FOLLOWED, NEEDED, facts
    from bowden.live.mcap_read import read
    from bowden.live.stops import stops
    from bowden.safety.faults import OF_OTHERS

    found = read(Path(path), tuple(dict.fromkeys((*NEEDED, *FOLLOWED, "temperature"))))
    said = facts(found)
    begin = said["begin_s"] or 0.0
    first = min(
        ((name, stop) for name, part in found.parts.items() for stop in stops(part)[:1]),
        key=lambda one: (one[1].time, {*one[1].causes} <= {*OF_OTHERS}),
        default=None,
    )
    faults = [] if first is None else list(_faults(*first))
    whole = _summary(found, said)
    names, units = list(said["columns"]), list(said["columns"].values())
    return {
        **whole,
        "first_fault": faults[0] if faults else None,
        "consequences": faults[1:],
        "metrics": list(_metrics(whole, said)),
        "events": [{"at": round(one.time - begin, 3), "text": one.text} for one in found.events[:_MOST_EVENTS]],
        "columns": [one.document() for one in curves_of(names, units, said["settings"])],
        "from": 0.0,
        "to": said["duration_s"],
    }


def _faults(axis: str, stop: "Stop") -> Iterator[dict[str, Any]]:
    """What stopped a run, of several axes with the one that it came from."""
    for fault in (*stop.causes, *stop.consequences):
        meaning = f"{axis}: {fault.meaning}" if axis else fault.meaning
        yield {"name": fault.name.lower(), "at": round(stop.time, 3), "meaning": meaning, "remedy": fault.remedy}


def _metrics(whole: Mapping[str, Any], said: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    if whole["rmse_deg"] is not None:
        yield "error, RMS", f"{whole['rmse_deg']:.3f}°"
        yield "error, peak", f"{whole['peak_deg']:.2f}°"
        yield "the law led for", f"{whole['led_seconds']:g} s"
    if said["lateness_s"]:
        yield "lateness, median", f"{1e6 * said['lateness_s']['p50']:.0f} µs"
        yield "lateness, 99 %", f"{1e6 * said['lateness_s']['p99']:.0f} µs"
        yield "lateness, largest", f"{1e6 * said['lateness_s']['max']:.0f} µs"
    if said["run_time_s"]:
        yield "run time of a cycle, median", f"{1e6 * said['run_time_s']['p50']:.0f} µs"
    if said["overruns"] is not None:
        yield "overruns", f"{said['overruns']} in {said['cycles']} cycles"
    yield "cycles missing in the log", f"{said['missing']}"


def page(progress: Progress, path: str, to: str) -> str:
    """The page of a log, as `bowden log plot` draws it."""
    from dataclasses import replace

    from bowden.live.log_facts import facts
    from bowden.live.mcap_read import read
    from bowden.report.log_page import write_log

    found = next(iter(read(Path(path)).parts.values()))  # of several axes the first
    said, trace = facts(found), found.trace()
    begin = said["begin_s"] or 0.0
    trace = replace(trace, columns={**trace.columns, "time": trace.columns["time"] - begin})
    events = [(event.time - begin, event.text) for event in found.events]
    write_log(Path(to), trace, events, said, f"Run {Path(path).name}")
    return to


def export(progress: Progress, path: str, to: str) -> str:
    """A log as Parquet or CSV, by the ending of the new file's name, as `bowden log export` writes it."""
    from bowden.live.mcap_read import traces
    from bowden.live.mcap_reader import LogReader
    from bowden.records.trace import write_traces

    write_traces(traces(LogReader(Path(path))), Path(to))
    return to


def curves(progress: Progress, path: str, columns: Sequence[str], begin: float, end: float, pixels: int) -> str:
    """Curves of a log as a frame of the stream, in base64."""
    import numpy as np

    from bowden.console.stream import WHOLE, curves_of, packed, reduced, taken
    from bowden.core.errors import LogError
    from bowden.live.mcap_read import read
    from bowden.live.mcap_reader import LogReader

    log = LogReader(Path(path), ("time",))
    named = dict(zip(json.loads(log.about["columns"]), json.loads(log.about["units"]), strict=True))
    offered = {one.name: one for one in curves_of(list(named), list(named.values()), log.settings)}
    chosen = [offered[name] for name in columns if name in offered]
    if len(chosen) != len(columns):
        raise LogError("the log has no such curve", expected=", ".join(offered), do="choose others")
    found = read(Path(path), ("time", *(source for one in chosen for source in one.source)))
    times = found["time"] - (found["time"][0] if len(found.rows) else 0.0)
    step = (end - begin) / pixels
    first = int(np.floor(begin / step + 1e-9))
    values = taken(chosen, found.columns, found.rows)
    frame = packed(WHOLE, reduced(times, values, values, first, pixels, step), 0, first * step, step)
    return base64.b64encode(frame).decode()


def identify(progress: Progress, rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """A step of the guided path."""
    from bowden.console.guided import identified

    return identified(progress, rig, folder)


def identify_servo(progress: Progress, rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """A step of the guided path."""
    from bowden.console.guided import identified_servo

    return identified_servo(progress, rig, folder)


def tune(progress: Progress, rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """A step of the guided path."""
    from bowden.console.guided import tuned_rig

    return tuned_rig(progress, rig, folder)


_MOST_EVENTS = 500

WORKS: dict[str, Callable[..., Any]] = {
    "check": check,
    "summaries": summaries,
    "details": details,
    "page": page,
    "export": export,
    "curves": curves,
    "identify": identify,
    "identify-servo": identify_servo,
    "tune": tune,
}
"""Name → the work."""

if __name__ == "__main__":
    sys.exit(main())
