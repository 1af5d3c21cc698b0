"""What the page shows, as one JSON document: from what the run's thread has seen, and from its rows. Pure."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bowden.console.runs import RunSeen
from bowden.console.stream import Watch
from bowden.core.signals import DriveState
from bowden.hardware.twin.injection import KINDS, SIDES
from bowden.live.gain_ramp import in_force
from bowden.live.preflight import REASONS, Reason
from bowden.live.ring import RecorderState
from bowden.live.stops import remedy_of
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.state import Mode

if TYPE_CHECKING:
    from bowden.live.session import Session

PREFLIGHT = (
    ("the drive enables", frozenset({Reason.NOT_ENABLED})),
    ("both angles are there and at rest", frozenset({Reason.SENSORS, Reason.RESTLESS})),
    ("the motor makes a small motion", frozenset({Reason.MOTOR_STILL, Reason.MOTOR_WRONG_WAY})),
    ("the joint follows it", frozenset({Reason.JOINT_STILL, Reason.JOINT_WRONG_WAY})),
    (
        "the current answers and pulls the right way",
        frozenset({Reason.CURRENT_STILL, Reason.SLACK_WRONG_WAY}),
    ),
)
"""What the preflight looks at in its order, and what it fails by."""
_MOST_ESTIMATES = 12
_MOST_EVENTS = 100
_NEXT = {
    Mode.STOPPED: "arm: the motor gets power and makes a small motion",
    Mode.PREFLIGHT: "wait for the preflight, then run",
    Mode.RUNNING: "stop ends it in a controlled release",
    Mode.BRIDGING: "stop ends it in a controlled release",
    Mode.RELEASING: "the cable is being let out",
    Mode.LATCHED: "correct the cause, then acknowledge",
}


def rig_of(rig: Rig, name: str, *, twin: bool) -> dict[str, Any]:
    """Which rig it is, and whether it is a twin or moves something."""
    drives = [motor.rig.drive for motor in rig.parts]
    simulated = twin or all(family_of(drive).simulated(drive) for drive in drives)
    buses = ", ".join(dict.fromkeys(str(getattr(drive, "channel", "")) for drive in drives))
    where = "of this console's own" if twin else buses
    return {
        **{"name": name, "hash": rig.hash, "drive": "twin" if simulated else "hardware", "bus": where},
        "faults": list(injected_faults([motor.name for motor in rig.parts])) if twin else [],
    }


def injected_faults(motors: Sequence[str] = ("",)) -> Iterator[dict[str, str]]:
    """What the twins can be given: the name that injects it, of several motors with the motor's, and what it is."""
    for motor in motors:
        whose = f"{motor}: " if motor else ""
        for name, kind in KINDS.items():
            for side in SIDES if kind.side else ("",):
                title = f"{whose}{kind.meaning}{f' ({side})' if side else ''}"
                yield {"name": f"{whose}{name} {side}".strip(), "title": title}


def run_of(seen: RunSeen, watch: Watch | None) -> dict[str, Any] | None:
    """The run; None where there is none.

    Args:
        seen: by the thread that holds it.
        watch: of its rows; None where nothing was read yet.
    """
    session, row = seen.session, seen.row
    if session is None or row is None or watch is None or watch.begin is None:
        return None
    mode = Mode(int(row["mode"]))
    shown = faults.of(row["faults"])
    listed = [
        fault_of(fault, one.came[fault] - watch.begin, row["recorder"], one.motor, row.get("emg.loss"))
        for one in session.faults(row)
        for fault in (*one.causes, *one.consequences)
    ]
    live = seen.phase == "live"
    return {
        "mode": "ready" if mode == Mode.PREFLIGHT and row["preflight"] > 0.0 else mode.name.lower(),
        "power": live and mode not in (Mode.STOPPED, Mode.LATCHED),
        "began_latched": session.began_latched,
        "preflight": [
            {**step, "name": f"{motor.name}: {step['name']}"} if motor.name else step
            for motor in session.motors
            for step in preflight_of(_alone(motor.of(row)), moves=watch.preflight_moves)
        ],
        "preflight_reason": REASONS[Reason(int(row["preflight_reason"]))],
        **times_of(session, watch, mode),
        "first_fault": listed[0] if listed else None,
        "consequences": listed[1:],
        "drive_said": "" if {Fault.EMERGENCY, Fault.DRIVE_FAULT}.isdisjoint(shown) else session.drive_said(row),
        "events": [{"at": round(one.time - watch.begin, 3), "text": one.text} for one in watch.events[-_MOST_EVENTS:]],
        "next": next_of(mode, row, shown) if live else "",
        "lost": seen.lost,
        "notes": list(seen.notes),
        "log": session.log.stem,
        "logs": list(seen.logs),
        "ended": None if live else ended_of(session),
        "columns": [column.document() for column in watch.columns],
        "estimates": dict(_estimates(session, row)[:_MOST_ESTIMATES]),
        "lateness": {
            "median_us": float(1e6 * np.median(watch.late)) if len(watch.late) else None,
            "most_us": 1e6 * watch.latest,
            "overruns": watch.overruns,
        },
        "recorder": RecorderState(seen.recorder).name.lower().replace("_", " "),
    }


def _alone(row: dict[str, float]) -> dict[str, float]:
    """A row of one motor with the outcome of its own preflight, where it is one of several."""
    return {**row, "preflight": row.get("preflight_alone", row["preflight"])}


def _estimates(session: "Session", row: Mapping[str, float]) -> list[tuple[str, float]]:
    """What the laws know, of several motors with the motor's name."""
    return [
        (f"{motor.name}: {name[4:]}" if motor.name else name[4:], value)
        for motor in session.motors
        for name, value in motor.of(row).items()
        if name.startswith("law.")
    ]


def gains_of(settings: Mapping[str, Any], seen: RunSeen, change: Mapping[str, Any] | None) -> dict[str, Any]:
    """The gains of the settings, while a session is live with what the loop says of them.

    Args:
        settings: as `RunSettings.document` has them.
        seen: by the thread that holds the run.
        change: the newest change: its ``name``, ``to``, ``state`` and ``text``.
    """
    gains: dict[str, Any] = settings["gains"]
    if seen.phase != "live" or seen.session is None or seen.row is None:
        return gains
    now = in_force(seen.row)
    return {
        name: {
            **gain,
            "value": now.get(name, gain["value"]),
            "live": name in now,
            **({"change": change} if change is not None and change["name"] == name else {}),
        }
        for name, gain in gains.items()
    }


VOLATILE = ("elapsed", "remaining", "lateness", "estimates")
"""Of a run: what changes from moment to moment, and is no news by itself."""


def fault_of(
    fault: Fault, at: float, recorder: float = RecorderState.OK, motor: str = "", emg: float | None = None
) -> dict[str, Any]:
    """A fault: since when, what it means and what to do; of several motors whose it is."""
    meaning = f"{motor}: {fault.meaning}" if motor else fault.meaning
    remedy = remedy_of(fault, twin=False, recorder=recorder, emg=emg)
    return {"name": fault.name.lower(), "at": round(at, 3), "meaning": meaning, "remedy": remedy}


def times_of(session: "Session", watch: Watch, mode: Mode) -> dict[str, float | None]:
    """How long the law or the motion has led, and what is left of the whole [s]; None where nothing was begun."""
    if math.isnan(watch.running_since):
        return {"elapsed": None, "remaining": None}
    whole = session.live.length
    until = watch.now if math.isnan(watch.led_until) else watch.led_until
    led = 0.0 if math.isnan(watch.led_since) else max(0.0, until - watch.led_since)
    left = max(0.0, whole - led) if mode in (Mode.RUNNING, Mode.BRIDGING) else None
    return {"elapsed": round(led, 2), "remaining": None if left is None else round(left, 2)}


def preflight_of(row: Mapping[str, float], *, moves: bool) -> list[dict[str, str]]:
    """What the preflight has done, as far as a row shows it: the drive's state, its motion and its outcome.

    Before arming all of it waits. A motion of the motor shows motor, joint and current at once, and they are judged
    together at its end.
    """
    mode, outcome, reason = Mode(int(row["mode"])), row["preflight"], Reason(int(row["preflight_reason"]))
    failed = next((i for i, item in enumerate(PREFLIGHT) if reason in item[1]), None)
    if failed is not None:
        states = ["done"] * failed + ["failed"] + ["waiting"] * (len(PREFLIGHT) - failed - 1)
    elif outcome > 0.0 and mode in (Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING):
        states = ["done"] * len(PREFLIGHT)
    elif mode != Mode.PREFLIGHT:
        states = ["waiting"] * len(PREFLIGHT)
    elif row["drive_state"] != DriveState.OPERATION_ENABLED:
        states = ["going"] + ["waiting"] * (len(PREFLIGHT) - 1)
    elif not moves:
        states = ["done", "going"] + ["waiting"] * (len(PREFLIGHT) - 2)
    else:
        states = ["done", "done"] + ["going"] * (len(PREFLIGHT) - 2)
    why = REASONS[reason]
    return [
        {"name": title, "state": state, "said": why if state == "failed" else ""}
        for (title, _), state in zip(PREFLIGHT, states, strict=True)
    ]


def next_of(mode: Mode, row: Mapping[str, float], shown: list[Fault]) -> str:
    """What may be done now."""
    preflight = row["preflight"]
    if mode == Mode.STOPPED and Fault.DRIVE_FAULT in shown:
        return "correct the cause, then acknowledge: that resets the drive"
    if mode == Mode.STOPPED and shown:
        remedy = remedy_of(shown[0], twin=False, recorder=row["recorder"], emg=row.get("emg.loss"))
        return f"cannot be armed: {shown[0].meaning}; {remedy}"
    if mode == Mode.PREFLIGHT and preflight:
        return "the preflight has passed: run" if preflight > 0.0 else "the preflight has failed"
    return _NEXT[mode]


def ended_of(session: "Session") -> dict[str, Any] | None:
    """How the session ended; None while it has not."""
    ended = session.ended
    if ended is None and not session.error:
        return None
    mode = None if ended is None else ended.mode.name.lower()
    reason = "" if session.ended_well else "; ".join(session.why)
    return {"well": session.ended_well, "mode": mode, "reason": reason, "error": session.error}
