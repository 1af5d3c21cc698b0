"""Work of the console in a process of its own, see `bowden.app.job_process`: on logs of earlier runs, and the steps of
its guided path.
"""

import base64
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from bowden.core.errors import BowdenError
from bowden.live.figures import LogFacts
from bowden.rig.rig import Rig
from bowden.views.text import Call

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


def identified(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Identify the cable that was measured, and put it into the rig, as identify and init do."""
    from bowden.core.units import DEGREES
    from bowden.operations.identify import identify
    from bowden.plants.identified import load_cable
    from bowden.views.identify import write_identify

    place, given = Path(folder), Rig.unpack(rig)
    found = identify(place / "cable.csv", progress=progress)
    write_identify(found, Call({}, {}), out=place)
    fit = found.fit
    made = given.replace(cable=load_cable(place / "model.toml"))
    files = ["model.toml", "identify.html", *_written(made, place, "identified")]
    ahead = fit.forecast
    both = [] if ahead is None else [f"{value * DEGREES:.2g}° RMS" for value in ahead[:2]]
    forecast = f"{' left with this model as feed-forward, '.join(both)} without; " if both else ""
    said = f"{fit.best.name}: {forecast}trust: {fit.trust}"
    return {"rig": made.document(), "said": said, "files": files}


def identified_servo(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Identify the servo that was measured, and put it into the rig: the keys that identify-servo writes."""
    from bowden.operations.identify_servo import identify_servo
    from bowden.views.identify_servo import write_identify_servo

    place, given = Path(folder), Rig.unpack(rig)
    log = place / "servo.csv"
    result = identify_servo(
        log,
        time="time_s",
        command="command_rad",
        motor="motor_rad",
        sample_time_ms=1e3 * given.sample_time,
        progress=progress,
    )
    write_identify_servo(result, Call({"into": None, "log": log}, {}), out=place)
    found = result.fit
    servo = given.servo._replace(natural_frequency=found.natural_frequency.value, damping=found.damping.value)
    if found.speed_limit is not None:
        servo = servo._replace(speed_limit=found.speed_limit.value)
    made = given.replace(servo=servo, delay=result.delay_cycles)
    frequency, damping, delay = result.natural_frequency_hz, result.damping, result.delay_s
    said = (
        f"natural frequency {frequency.value:.4g} ± {frequency.uncertainty:.1g} Hz, damping "
        f"{damping.value:.3g} ± {damping.uncertainty:.1g}, delay {1e3 * delay.value:.3g} ± "
        f"{1e3 * delay.uncertainty:.1g} ms; {result.residual_deg:.2g}° RMS of the motor's motion are left"
    )
    return {"rig": made.document(), "said": said, "files": ["servo.toml", *_written(made, place, "servo")]}


def tuned_rig(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Tune the rig's law, and put the gains into the rig."""
    from bowden.core.units import DEGREES
    from bowden.study.tune_law import tuned

    given = Rig.unpack(rig)
    found = tuned(given, seed=0, progress=progress)
    made = found.rig
    said = f"{found.law.name}: largest RMSE over {found.runs} {found.worst_rmse * DEGREES:.3g}°, {found.found.verdict}"
    return {"rig": made.document(), "said": said, "files": _written(made, Path(folder), "tuned")}


def _written(rig: Rig, folder: Path, name: str) -> list[str]:
    """Write the rig, and the files that it names, into a folder of a name that is free."""
    number, target = 1, folder / name
    while target.exists():
        number += 1
        target = folder / f"{name}-{number}"
    target.mkdir(parents=True)
    rig.write(target / "rig.toml")
    return [f"{target.name}/rig.toml"]
