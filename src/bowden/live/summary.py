"""What a run came to, from its log."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, counted
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.ports import TorqueLeft, torque_left
from bowden.live import emg_summary, push_summary, stops
from bowden.live.figures import Damage
from bowden.live.lateness import figures
from bowden.live.mcap_log import about as describing
from bowden.live.mcap_read import Recording, read
from bowden.live.session import Session
from bowden.live.session_motor import SessionMotor
from bowden.records.metrics import rmse
from bowden.rig.families import family_of
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.state import Mode


def document(session: Session) -> dict[str, Any]:
    """The figures of a run that has ended, as JSON values."""
    emg, emg_process = session.live.emg, session.emg_process
    pushing = session.live.pushing
    more = (*(() if emg_process is None else emg_summary.NEEDED), *(() if pushing is None else push_summary.NEEDED))
    needed = tuple(dict.fromkeys((*_NEEDED, *stops.NEEDED, *more)))
    log, log_lost = _read(session, needed)
    ended = session.ended or {}
    mode = Mode(ended["mode"]).name.lower() if ended else None
    gone = ended.get("unattended", 0.0)
    each = [_followed(motor, log.only(motor.name) if motor.name else log) for motor in session.motors]
    rmse, peak = ([one[key] for one in each if one[key] is not None] for key in ("rmse_deg", "peak_deg"))
    return {
        "law": ", ".join(dict.fromkeys(motor.live.law.name for motor in session.motors)),
        "rig": session.live.logged.hash,
        "drive": session.ready["drive"],
        "twin": session.on_twin,
        "ended_well": session.ended_well,
        "mode": mode,
        "faults": [fault.meaning for fault in faults.of(ended.get("faults", 0))],
        "remedies": [
            stops.remedy_of(fault, twin=session.on_twin, recorder=session.recorded)
            for fault in faults.of(ended.get("faults", 0))
        ],
        "stalled_ms": round(1e3 * ended.get("stalled", 0.0), 3) or None,
        "unattended": stops.unattended(gone, session.live.patience) if gone else None,
        "stops": stops.document(log, session.live.limits._asdict(), twin=session.on_twin),
        "preflight": ended.get("reason") or None,
        "emergencies": [
            f"{motor.name}: {text}".removeprefix(": ")
            for motor, one in zip(session.motors, each, strict=True)
            for text in one["emergencies"]
        ],
        "torque": TorqueLeft(ended["torque"] if ended else TorqueLeft.UNKNOWN).name.lower(),
        "error": session.error or None,
        "cycles": ended.get("cycles"),
        "cycles_logged": len(log.rows),
        "seconds_led": min(one["seconds_led"] for one in each),
        "rmse_deg": max(rmse, default=None),
        "peak_deg": max(peak, default=None),
        **({"motors": _motors(session, each)} if session.live.several else {}),
        "lateness": asdict(figures(log["lateness"])) if len(log.rows) else None,
        "run_time_median_us": _median_us(log["run_time"]),
        "overruns": ended.get("overruns"),
        "emg": None if emg is None or emg_process is None else emg_summary.figures(log, emg, emg_process),
        "interaction": None if pushing is None else push_summary.figures(log, pushing, session.live.rig.sample_time),
        "grants": session.ready["grants"],
        "log": str(session.log),
        "more_logs": [str(path) for path in session.logs[1:]],
        "log_whole": log.whole,
        "log_lost": log_lost or None,
    }


def _followed(motor: SessionMotor, log: Recording) -> dict[str, Any]:
    """How well one motor followed, and what its drive said by itself."""
    led = log["source"] >= TargetSource.LAW_BEGINS
    error = (log["joint"] - log["reference"])[led]
    error = error[np.isfinite(error)]
    codes, explain = log["emergency"], family_of(motor.live.rig.drive).explain
    return {
        "seconds_led": round(len(error) * motor.live.rig.sample_time, 6),
        "rmse_deg": rmse(error) / RADIANS if len(error) else None,
        "peak_deg": float(np.abs(error).max() / RADIANS) if len(error) else None,
        "emergencies": [explain(int(code)) for code in dict.fromkeys(codes[codes > 0.0].tolist())],
    }


def _motors(session: Session, each: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What is said of each motor of several."""
    ended = (session.ended or {}).get("motors") or [None] * len(each)
    return [
        {
            "name": motor.name,
            "law": motor.live.law.name,
            "rig": motor.live.logged.hash,
            "drive": drive,
            "mode": None if end is None else Mode(end["mode"]).name.lower(),
            "faults": [fault.meaning for fault in faults.of(end["faults"])] if end else [],
            "preflight": (end or {}).get("reason") or None,
            "torque": TorqueLeft(end["torque"] if end else TorqueLeft.UNKNOWN).name.lower(),
            **one,
        }
        for motor, drive, end, one in zip(session.motors, session.ready["drives"], ended, each, strict=True)
    ]


def _read(session: Session, needed: Sequence[str]) -> tuple[Recording, str]:
    """What is left of a run's logs, and why nothing of the last one is; no row where none is left."""
    about, found, lost = session.rows.description, [], session.log_lost
    for path in session.logs[:-1] if lost else session.logs:
        try:
            found.append(read(path, needed))
        except LogError as error:
            lost = lost or str(error)
    if found:
        return _joined(found), lost
    nothing = np.empty(0, np.int64), np.empty((0, len(about.columns)))
    said, settings = describing(about, {}), dict(about.settings)
    return Recording(said, None, about.columns, about.units, *nothing, [], Damage(0, 0, 0), settings), lost


def _joined(logs: list[Recording]) -> Recording:
    """Every row once, of a run whose recorder had to be started again; whole if each of its logs is."""
    if len(logs) == 1:
        return logs[0]
    numbers, first = np.unique(np.concatenate([log.numbers for log in logs]), return_index=True)
    broken = next((log for log in logs if not log.whole), logs[0])
    return replace(broken, numbers=numbers, rows=np.concatenate([log.rows for log in logs])[first])


def _print_stops(found: dict[str, Any]) -> None:
    """What stopped the run, in the order of time, then what its log does not show."""
    named = {one["name"]: one["faults"] for one in found.get("motors", ())} or {"": found["faults"]}
    said: set[tuple[str, str]] = set()
    """Motor, or nothing of a rig with one motor, and fault."""
    for number, stop in enumerate(found["stops"], 1):
        last = number == len(found["stops"]) and not found["ended_well"]
        how = "ended" if last else "stopped"
        for line in stops.lines(stop, twin=found["twin"]):
            print(f"{how} by a fault at {stop['time_s']:.3f} s: {line}")
        whose = [stop["motor"]] if stop.get("motor") else [*named]
        told = {*stop["causes"], *stop["consequences"]}
        said |= {(motor, meaning) for motor in whose for meaning in told}
        said |= {
            (motor, meaning) for motor, faulty in named.items() for meaning in faulty if f"{motor}: {meaning}" in told
        }
    if found["stalled_ms"] and not any(stop["too_busy"] for stop in found["stops"]):
        print(stops.STALLED.format(found["stalled_ms"]))
    if found["unattended"]:
        print(f"ended before its time: {found['unattended']}")
        said |= {(motor, Fault.OPERATOR_LOST.meaning) for motor in named}
    remedies = dict(zip(found["faults"], found["remedies"], strict=True))
    for motor, faulty in named.items():
        for meaning in faulty:
            if (motor, meaning) not in said:
                how = "at the end" if found["ended_well"] else "ended by a fault"
                print(f"{how}: {f'{motor}: ' if motor else ''}{meaning}; {remedies[meaning]}")


_NEEDED = ("source", "joint", "reference", "lateness", "run_time", "emergency")
"""Columns of the log that the figures come from."""


def _median_us(values: NDArray[np.float64]) -> float | None:
    return float(np.median(values) * 1e6) if len(values) else None


def print_summary(found: dict[str, Any]) -> None:
    """The same for a person."""
    for one in found.get("motors", ()):
        said = "no law led" if one["rmse_deg"] is None else f"{one['rmse_deg']:.3f}° RMS, {one['peak_deg']:.2f}° peak"
        print(f"{one['name']}, {one['law']}: {said} over {one['seconds_led']:g} s under the law")
    if found["rmse_deg"] is not None and not found.get("motors"):
        print(f"{found['law']}: {found['rmse_deg']:.3f}° RMS, {found['peak_deg']:.2f}° peak", end="")
        home = ", the way home included" if found["ended_well"] else ""
        print(f" over {found['seconds_led']:g} s under the law{home}{', on the twin' if found['twin'] else ''}")
    late = found["lateness"]
    if late:
        print(
            f"lateness {late['p50_us']:.0f} µs median, {late['p99_us']:.0f} p99, {late['p999_us']:.0f} p99.9, "
            f"{late['max_us']:.0f} max; the cycle takes {found['run_time_median_us']:.0f} µs; ",
            end="",
        )
        if found["cycles"] is None:  # the loop said nothing at its end
            print(f"{counted(found['cycles_logged'], 'cycle')} in the log")
        else:
            print(f"{counted(found['overruns'], 'overrun')} in {counted(found['cycles'], 'cycle')}")
    if found["emg"]:
        emg_summary.print_figures(found["emg"])
    if found["interaction"]:
        push_summary.print_figures(found["interaction"])
    _print_stops(found)
    if found["torque"] != "off":
        print(torque_left(TorqueLeft[found["torque"].upper()], twin=found["twin"]))
    for text in found["emergencies"]:
        print(f"emergency: {text}")
    if found["preflight"]:
        print(f"preflight: {found['preflight']}")
    if found["error"]:
        print(f"ended by an error: {found['error']}")
    if found["ended_well"] and not found["seconds_led"]:
        print("ended as asked, before the law led")
    whole, gone = found["log_whole"], found["log_lost"]
    if not gone:
        print(f"Log: {found['log']}  ({shlex.join(['bowden', 'log', 'info' if whole else 'recover', found['log']])})")
        for path in found["more_logs"]:
            print(f"  and {path}")
    lost = (found["cycles"] or 0) - found["cycles_logged"]
    if lost > 0 or gone:
        missing = f"{lost} cycles of {found['cycles']} are not in the log, nor in these figures" if lost > 0 else ""
        print(f"bowden: note: {': '.join(filter(None, (missing, gone)))}", file=sys.stderr)
    if not whole and not gone:
        print(f"bowden: note: {found['log']} was not closed properly", file=sys.stderr)
