"""Work on the logs of earlier runs, for a process of its own; see `bowden.console.jobs`."""

import base64
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from bowden.core.errors import BowdenError
from bowden.live.figures import LogFacts

Progress = Callable[[str, float], None]

_MOST_EVENTS = 500


def summaries(progress: Progress, paths: Sequence[str]) -> dict[str, Any]:
    """Path → what the list of earlier runs says of each; a log that cannot be read is there with its error."""
    from bowden.live.log_facts import NEEDED, facts
    from bowden.live.mcap_read import read

    done: dict[str, Any] = {}
    for number, path in enumerate(paths):
        progress("reading logs", number / len(paths))
        try:
            found = read(Path(path), NEEDED)
            done[path] = _summary(facts(found))
        except BowdenError as error:
            done[path] = {"time": "", "law": "", "rig": "", "how": error.what}
    return done


def _summary(said: LogFacts) -> dict[str, Any]:
    about, rig = said.settings.get("about") or {}, said.settings.get("rig") or {}
    return {
        "time": said.start_utc,
        "law": str(said.law or ""),
        "rig": Path(str(rig.get("origin", ""))).name,
        **{name: str(about.get(name, "")) for name in ("subject", "session", "notes")},
        "rmse_deg": said.rmse_deg,
        "peak_deg": said.peak_deg,
        "seconds": said.duration_s,
        "led_seconds": said.seconds_led,
        "how": said.outcome if said.whole else f"{said.outcome}; the log is not whole",
        "first_fault": said.stops[0].causes[0] if said.stops and said.stops[0].causes else None,
    }


def details(progress: Progress, path: str) -> dict[str, Any]:
    """All that the page of one earlier run shows, but its curves."""
    from bowden.console.state import fault_of
    from bowden.console.stream import curves_of
    from bowden.live.log_facts import NEEDED, facts
    from bowden.live.mcap_read import read
    from bowden.live.stops import stops_of_each

    found = read(Path(path), (*NEEDED, "temperature"))
    said = facts(found)
    begin = said.begin_s or 0.0
    faults = [
        fault_of(fault, first.time, motor=first.motor, emg=first.emg)
        for first in stops_of_each(found)[:1]
        for fault in (*first.causes, *first.consequences)
    ]
    whole = _summary(said)
    names, units = list(said.columns), list(said.columns.values())
    return {
        **whole,
        "first_fault": faults[0] if faults else None,
        "consequences": faults[1:],
        "metrics": list(_metrics(said)),
        "events": [{"at": round(one.time - begin, 3), "text": one.text} for one in found.events[:_MOST_EVENTS]],
        "columns": [one.document() for one in curves_of(names, units, said.settings)],
        "from": 0.0,
        "to": said.duration_s,
    }


def _metrics(said: LogFacts) -> Iterator[tuple[str, str]]:
    if said.rmse_deg is not None:
        yield "error, RMS", f"{said.rmse_deg:.3f}°"
        yield "error, peak", f"{said.peak_deg:.2f}°"
        yield "the law led for", f"{said.seconds_led:g} s"
    if late := said.lateness:
        yield "lateness, median", f"{late.p50_us:.0f} µs"
        yield "lateness, 99 %", f"{late.p99_us:.0f} µs"
        yield "lateness, largest", f"{late.max_us:.0f} µs"
    if said.run_time:
        yield "run time of a cycle, median", f"{said.run_time.p50_us:.0f} µs"
    if said.overruns is not None:
        yield "overruns", f"{said.overruns} in {said.cycles} cycles"
    yield "cycles missing in the log", f"{said.missing}"


def curves(progress: Progress, path: str, columns: Sequence[str], begin: float, end: float, pixels: int) -> str:
    """Curves of a log as a frame of the stream, in base64."""
    import numpy as np

    from bowden.console.stream import WHOLE, curves_of, packed, reduced, taken
    from bowden.core.errors import LogError
    from bowden.live.mcap_read import LogReader, read

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
