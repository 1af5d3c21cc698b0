"""What the record of a run shows, as the end of the run, ``bowden log info`` and its page say it."""

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.documented import finite
from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.drives.emergencies import emergency_text
from bowden.live import stops
from bowden.live.events import EMERGENCY
from bowden.live.figures import GainChange, Lateness, LogFacts, RecordedRun, TimedText, Tracked
from bowden.live.gain_ramp import ASKED, IN_FORCE
from bowden.live.log_rig import hash_of
from bowden.live.machine import figures
from bowden.live.mcap_read import LogReader, Recording, motors_of
from bowden.live.outcome import outcome_of
from bowden.records.metrics import rmse
from bowden.rig.families import family_named
from bowden.safety.state import Mode
from bowden.sensing.intent import Intent

FOLLOWED = ("source", "joint", "joint_std", "reference")
"""Columns that `tracked` looks at."""
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
    return (*NEEDED, *(name for name in named if name.startswith((*gains, "emg.intent"))))


def facts(found: Recording) -> LogFacts:
    """All that a log says of its run."""
    time = found["time"]
    known = time[np.isfinite(time)]
    steps = np.diff(known)
    settings, run = found.settings, recorded(found)
    return LogFacts(
        **vars(run),
        outcome=outcome_of(found, run.stops, twin=bool(run.twin)),
        closed=found.closing is not None,
        whole=found.whole,
        cycles=len(found.rows),
        missing=found.missing,
        damage=found.damage,
        duration_s=float(known[-1] - known[0]) if len(known) > 1 else 0.0,
        begin_s=float(known[0]) if len(known) else None,
        running_s=_running(found),
        sample_time_s=float(np.median(steps)) if len(steps) else None,
        start_utc=datetime.fromtimestamp(int(found.about["start_utc_ns"]) // 10**9, UTC).isoformat(),
        seed=settings.get("seed"),
        overruns=_overruns(found),
        gains=_of_each(found, _gains, "name", "."),
        motions=tuple(_motions(found)),
        events=tuple(TimedText(_number(event.time), event.text) for event in found.events),
        software={key: found.about[key] for key in _ABOUT if key in found.about},
        recorder=found.closing or {},
        columns=dict(zip(json.loads(found.about["columns"]), json.loads(found.about["units"]), strict=True)),
        settings=finite(settings),
        motors={name: tracked(part) for name, part in found.parts.items() if name},
    )


def recorded(found: Recording) -> RecordedRun:
    """Figures of a recorded run, from the columns of `NEEDED`."""
    settings, each = found.settings, [tracked(part) for part in found.parts.values()]
    twin = settings.get("twin")
    largest = {
        name: max((value for one in each if (value := getattr(one, name)) is not None), default=None)
        for name in ("rmse_deg", "peak_deg", "estimate_std_deg")
    }
    return RecordedRun(
        law=", ".join(dict.fromkeys(str(one.law) for one in each)) if found.motors else each[0].law,
        rig=hash_of(settings),
        **largest,
        seconds_led=min(one.seconds_led for one in each),
        twin=twin,
        stops=stops.run_stops(found, settings.get("limits", {}), twin=bool(twin)),
        emergencies=_of_each(found, _emergencies, "text", ": "),
        lateness=_percentiles(found, "lateness"),
        run_time=_percentiles(found, "run_time"),
    )


def tracked(found: Recording) -> Tracked:
    """Tracking errors of the joint, by the record of one motor."""
    settings, error, doubt = found.settings, np.empty(0), np.empty(0)
    if {*FOLLOWED, "time"} <= {*found.columns} and len(found.rows) > 1:
        led = found["source"] >= TargetSource.LAW_BEGINS
        error, doubt = (
            every[led & np.isfinite(every)] for every in (found["joint"] - found["reference"], found["joint_std"])
        )
    if not len(error):
        return Tracked(settings.get("law"), hash_of(settings), None, None, None, 0.0)
    figures = DEGREES * rmse(error), DEGREES * float(np.abs(error).max()), DEGREES * rmse(doubt) if len(doubt) else None
    step = settings.get("sample_time") or float(np.nanmedian(np.diff(found["time"])))
    return Tracked(settings.get("law"), hash_of(settings), *figures, round(len(error) * step, 6))


def _motions(found: Recording) -> Iterator[TimedText]:
    """None in the proportional mode: there the joint follows the envelope."""
    emg = found.settings.get("emg")
    if emg and "emg.intent" in found.columns and not emg["course"]["proportional"]:
        for i in motions(found):
            yield TimedText(_number(found["time"][i]), Intent(int(found["emg.intent"][i])).name.lower())


def motions(found: Recording) -> list[int]:
    """Rows in which the wearer's EMG begins a motion, or turns it round."""
    intent, led = found["emg.intent"], found["source"] >= TargetSource.LAW_BEGINS
    begins = led[1:] & np.isin(intent[1:], (Intent.FLEX, Intent.EXTEND)) & (intent[1:] != intent[:-1])
    return [int(i) + 1 for i in np.flatnonzero(begins)]


def _of_each(found: Recording, of: Callable[[Recording], Iterable[Any]], key: str, after: str) -> tuple[Any, ...]:
    """What there is in the record of each motor, in the order of time; of several with the motor's name before it."""
    parts = found.parts
    each = [
        replace(one, **{key: f"{name}{after}{getattr(one, key)}"}) if name else one
        for name, part in parts.items()
        for one in of(part)
    ]
    return tuple(sorted(each, key=lambda one: one.time_s or 0.0) if len(parts) > 1 else each)


_ABOUT = ("software", "software_revision", "rig_revision", "python", "host", "system")


def _percentiles(found: Recording, column: str) -> Lateness | None:
    """Of the numbers of a column; None where there is no such column or no number in it."""
    if column not in found.columns:
        return None
    values: NDArray[np.float64] = found[column][np.isfinite(found[column])]
    return figures(values) if len(values) else None


def _emergencies(found: Recording) -> Iterator[TimedText]:
    """What the drive sent by itself, in the words of its family; an emergency's text has its code."""
    if EMERGENCY not in found.columns:
        return
    rig = found.settings.get("rig")
    fields = rig.get("fields") if isinstance(rig, dict) else None
    drive = fields.get("drive") if isinstance(fields, dict) else None
    family = drive.get("family") if isinstance(drive, dict) else None
    try:
        explain = family_named(family).explain if isinstance(family, str) else emergency_text
    except ParameterError:  # a family of somebody's program, which is not here
        explain = emergency_text
    codes, time = found[EMERGENCY], found["time"]
    yield from (TimedText(_number(time[i]), explain(int(codes[i]))) for i in np.flatnonzero(codes > 0.0))


def _gains(found: Recording) -> Iterator[GainChange]:
    """Changes of gains while the law ran, in the order of time."""
    time, changes = found["time"], []
    for column in found.columns:
        name = column.removeprefix(ASKED)
        if column == name or IN_FORCE + name not in found.columns:
            continue
        asked, value = found[column], found[IN_FORCE + name]
        for i in (np.flatnonzero(np.diff(asked)) + 1).tolist():
            there = np.flatnonzero(value[i:] == asked[i])
            since = _number(time[i + there[0]]) if len(there) else None
            changes.append(GainChange(name, _number(time[i]), float(value[i - 1]), float(asked[i]), since))
    yield from sorted(changes, key=lambda change: change.time_s or 0.0)


def _running(found: Recording) -> float | None:
    """Column time of the first cycle in which a motor ran; None of none."""
    each = (part["time"][part["mode"] == Mode.RUNNING] for part in found.parts.values() if "mode" in part.columns)
    return min((float(times[0]) for times in each if len(times)), default=None)


def _overruns(found: Recording) -> int | None:
    """Deadlines that were skipped; the column says how many before each cycle."""
    if "overruns" not in found.columns or not np.isfinite(found["overruns"]).any():
        return None
    return int(np.nansum(found["overruns"]))


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
