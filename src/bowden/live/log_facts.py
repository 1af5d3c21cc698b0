"""The facts of a log, as ``bowden log info`` and its page show them."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError, counted
from bowden.core.files import printable
from bowden.core.units import DEGREES
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.drives.emergencies import emergency_text
from bowden.live import stops
from bowden.live.events import EMERGENCY
from bowden.live.gain_ramp import ASKED, IN_FORCE
from bowden.live.log_rig import hash_of
from bowden.live.mcap_read import Recording, motors_of
from bowden.live.mcap_reader import LogReader
from bowden.live.outcome import outcome_of
from bowden.records.metrics import rmse
from bowden.rig.families import family_named

FOLLOWED = ("source", "joint", "reference")
"""Columns that `followed` looks at."""
NEEDED = (
    *dict.fromkeys(("time", "lateness", "run_time", "overruns", "recorder", EMERGENCY, *stops.NEEDED, *FOLLOWED)),
)
"""Columns of the log that are looked at."""


def needed(path: Path) -> tuple[str, ...]:
    """`NEEDED`, and the columns of the gains that this log has, of each motor.

    Raises:
        LogError: it is none that can be read.
    """
    log = LogReader(path, ())
    named, motors = json.loads(log.about["columns"]), motors_of(log.settings)
    gains = tuple(
        f"{prefix}{part}" for prefix in ("", *(f"{motor}." for motor in motors[1:])) for part in (IN_FORCE, ASKED)
    )
    return (*NEEDED, *(name for name in named if name.startswith(gains)))


_MOST_EVENTS = 12  # printed, half of them from the end; the JSON document has them all


def facts(found: Recording) -> dict[str, Any]:
    """What ``bowden log info --json`` says of a log, but its name."""
    time = found["time"]
    known = time[np.isfinite(time)]
    steps = np.diff(known)
    settings, parts = found.settings, found.parts
    twin = bool(settings.get("twin", False))
    stopped = stops.document(found, settings.get("limits", {}), twin=twin)
    led = [followed(part) for part in parts.values()]
    return {
        "outcome": outcome_of(found, stopped, twin=twin),
        "rmse_deg": _largest(one.rmse for one in led),
        "peak_deg": _largest(one.peak for one in led),
        "seconds_led": min(one.seconds for one in led),
        "closed": found.closing is not None,
        "whole": found.whole,
        "cycles": len(found.rows),
        "missing": found.missing,
        "damage": asdict(found.damage),
        "duration_s": float(known[-1] - known[0]) if len(known) > 1 else 0.0,
        "begin_s": float(known[0]) if len(known) else None,
        "sample_time_s": float(np.median(steps)) if len(steps) else None,
        "start_utc": datetime.fromtimestamp(int(found.about["start_utc_ns"]) // 10**9, UTC).isoformat(),
        "law": ", ".join(dict.fromkeys(str(part.settings.get("law")) for part in parts.values()))
        if found.motors
        else settings.get("law"),
        "rig": hash_of(settings),
        "seed": settings.get("seed"),
        "twin": settings.get("twin"),
        "lateness_s": _percentiles(found, "lateness"),
        "run_time_s": _percentiles(found, "run_time"),
        "overruns": _overruns(found),
        "stops": stopped,
        "emergencies": _of_each(parts, _emergencies, "text", ": "),
        "gains": _of_each(parts, _gains, "name", "."),
        **({"motors": {name: _of_motor(part) for name, part in parts.items()}} if found.motors else {}),
        "events": [{"time_s": _number(event.time), "text": event.text} for event in found.events],
        "software": {key: found.about[key] for key in _ABOUT if key in found.about},
        "recorder": found.closing or {},
        "columns": dict(zip(json.loads(found.about["columns"]), json.loads(found.about["units"]), strict=True)),
        "settings": _finite(settings),
    }


def _of_each(
    parts: Mapping[str, Recording], of: Callable[[Recording], Iterable[dict[str, Any]]], key: str, after: str
) -> list[dict[str, Any]]:
    """What there is in the record of each motor, in the order of time; of several with the motor's name before it."""
    found = [
        {**one, key: f"{name}{after}{one[key]}" if name else one[key]}
        for name, part in parts.items()
        for one in of(part)
    ]
    return sorted(found, key=lambda one: one["time_s"] or 0.0) if len(parts) > 1 else found


def _of_motor(part: Recording) -> dict[str, Any]:
    """What is said of one motor of several."""
    return {"law": part.settings.get("law"), "rig": hash_of(part.settings)}


_ABOUT = ("software", "software_revision", "rig_revision", "python", "host", "system")


class Tracking(NamedTuple):
    """How well the joint followed its reference while a law led; None where none did."""

    rmse: float | None
    """[rad]"""
    peak: float | None
    """[rad]"""
    seconds: float
    """For how long [s]."""


def followed(found: Recording) -> Tracking:
    """How well the joint followed, by a log with the columns of `FOLLOWED`, and ``time``."""
    if not {*FOLLOWED, "time"} <= {*found.columns} or len(found.rows) < 2:
        return Tracking(None, None, 0.0)
    led = found["source"] >= TargetSource.LAW_BEGINS
    error = (found["joint"] - found["reference"])[led]
    error = error[np.isfinite(error)]
    if not len(error):
        return Tracking(None, None, 0.0)
    step = float(np.nanmedian(np.diff(found["time"])))
    return Tracking(rmse(error), float(np.abs(error).max()), round(len(error) * step, 3))


def _largest(angles: Iterable[float | None]) -> float | None:
    """The largest of the angles that there are [deg]."""
    return max((one * DEGREES for one in angles if one is not None), default=None)


def _percentiles(found: Recording, column: str) -> dict[str, float] | None:
    """p50, p99, p99.9 and the largest; None where there is no such column or no number in it."""
    if column not in found.columns:
        return None
    values: NDArray[np.float64] = found[column][np.isfinite(found[column])]
    if not len(values):
        return None
    shares = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
    return {name: float(np.percentile(values, share)) for name, share in shares.items()}


def _emergencies(found: Recording) -> list[dict[str, Any]]:
    """What the drive sent by itself, in the words of its family; an emergency's text has its code."""
    if EMERGENCY not in found.columns:
        return []
    rig = found.settings.get("rig")
    tree = rig.get("tree") if isinstance(rig, dict) else None
    drive = tree.get("drive") if isinstance(tree, dict) else None
    family = drive.get("family") if isinstance(drive, dict) else None
    try:
        explain = family_named(family).explain if isinstance(family, str) else emergency_text
    except ParameterError:  # a family of somebody's program, which is not here
        explain = emergency_text
    codes, time = found[EMERGENCY], found["time"]
    return [{"time_s": _number(time[i]), "text": explain(int(codes[i]))} for i in np.flatnonzero(codes > 0.0)]


def _gains(found: Recording) -> Iterator[dict[str, Any]]:
    """Changes of gains while the law ran, in the order of time."""
    time, changes = found["time"], []
    for column in found.columns:
        name = column.removeprefix(ASKED)
        if column == name or IN_FORCE + name not in found.columns:
            continue
        asked, value = found[column], found[IN_FORCE + name]
        for i in (np.flatnonzero(np.diff(asked)) + 1).tolist():
            there = np.flatnonzero(value[i:] == asked[i])
            changes.append(
                {
                    "name": name,
                    "time_s": _number(time[i]),
                    "before": float(value[i - 1]),
                    "to": float(asked[i]),
                    "in_force_s": _number(time[i + there[0]]) if len(there) else None,
                }
            )
    yield from sorted(changes, key=lambda change: change["time_s"] or 0.0)


def _overruns(found: Recording) -> int | None:
    """Deadlines that were skipped; the column says how many before each cycle."""
    if "overruns" not in found.columns or not np.isfinite(found["overruns"]).any():
        return None
    return int(np.nansum(found["overruns"]))


def _finite(value: Any) -> Any:
    """Settings with None in place of a number that JSON does not have."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def lines(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The facts as pairs of texts."""
    yield "outcome", document["outcome"]
    if document["rmse_deg"] is not None:
        figures = f"{document['rmse_deg']:.3f}° RMS, {document['peak_deg']:.2f}° peak"
        yield "error", f"{figures} over {document['seconds_led']:g} s under the law"
    yield "begun", document["start_utc"]
    if document["begin_s"]:
        yield "first cycle", f"{document['begin_s']:.3f} s later, by the column time; counted from here on below"
    yield "duration", f"{document['duration_s']:.3f} s, {document['cycles']} cycles"
    yield "missing", counted(document["missing"], "cycle") if document["missing"] else "nothing"
    yield "closed properly", "yes" if document["closed"] else "no"
    if not document["whole"] and document["closed"]:
        yield "damage", ", ".join(f"{value} {name}" for name, value in document["damage"].items())
    for name in ("law", "rig", "seed"):
        if document[name] is not None:
            yield name, str(document[name])
    for name, motor in document.get("motors", {}).items():
        yield "motor", f"{name}: {motor['law']}, rig {motor['rig']}"
    about = document["settings"].get("about")
    for name, text in about.items() if isinstance(about, dict) else ():
        yield printable(str(name)), printable(str(text))
    if document["twin"] is not None:
        yield "drive", "the command's own twin" if document["twin"] else "on the rig's bus"
    for name, column in (("lateness", "lateness_s"), ("run time", "run_time_s")):
        if document[column] is not None:
            shares = (f"{share.replace('_', '.')} {1e6 * value:.1f}" for share, value in document[column].items())
            yield name, f"{', '.join(shares)} µs"
    if document["overruns"] is not None:
        yield "overruns", str(document["overruns"])
    yield "software", ", ".join(document["software"].values())
    for stop in document["stops"]:
        for line in stops.lines(stop, twin=bool(document["twin"])):
            yield "stopped", f"{stop['time_s']:.3f} s: {line}"
    events, begin = document["events"], document["begin_s"] or 0.0
    for emergency in document["emergencies"]:
        yield "emergency", f"{(emergency['time_s'] or begin) - begin:.3f} s: {emergency['text']}"
    for change in document["gains"]:
        there = change["in_force_s"]
        when = "not in force at the log's end" if there is None else f"in force at {there - begin:.3f} s"
        values = f"{change['name']} {change['before']:.6g} → {change['to']:.6g}"
        yield "gain", f"{(change['time_s'] or begin) - begin:.3f} s: {values}, {when}"
    left_out = len(events) - _MOST_EVENTS
    for number, event in enumerate(events):
        if left_out > 0 and number == _MOST_EVENTS // 2:
            yield "", f"… {counted(left_out, 'more event')}, all of them with --json …"
        if left_out <= 0 or not _MOST_EVENTS // 2 <= number < len(events) - _MOST_EVENTS // 2:
            time = "" if event["time_s"] is None else f"{event['time_s'] - begin:.3f} s: "
            yield "event", f"{time}{event['text']}"
