"""What a run came to, from its log and its session."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bowden.core.errors import LogError
from bowden.hardware.ports import TorqueLeft
from bowden.hardware.realtime import Grant
from bowden.live import stops
from bowden.live.ended import SAID_NOTHING, Ended, EndedMotor
from bowden.live.figures import Damage, EndedRun, RunMotor
from bowden.live.led_summary import EMG_NEEDED, PUSH_NEEDED, emg_figures, push_figures
from bowden.live.log_facts import NEEDED, recorded, tracked
from bowden.live.mcap_log import about as describing
from bowden.live.mcap_read import Recording, read
from bowden.live.preflight import REASONS
from bowden.live.session import Session
from bowden.safety import faults


def ended_run(session: Session) -> EndedRun:
    """The figures of a run that has ended."""
    emg, emg_process = session.live.emg, session.emg_process
    pushing = session.live.pushing
    more = (*(() if emg_process is None else EMG_NEEDED), *(() if pushing is None else PUSH_NEEDED))
    log, log_lost = _read(session, tuple(dict.fromkeys((*NEEDED, *more))))
    ended, known = session.ended or SAID_NOTHING, session.ended is not None
    gone, bits = ended.unattended, faults.of(ended.faults)
    return EndedRun(
        **vars(recorded(log)),
        **_end(session.ended, ended.why_not(session.live.names)),
        drive=session.ready["drive"],
        ended_well=session.ended_well,
        remedies=tuple(
            stops.remedy_of(one, twin=session.on_twin, recorder=session.recorded, emg=session.emg_loss) for one in bits
        ),
        stalled_ms=round(1e3 * ended.stalled, 3) or None,
        unattended=stops.unattended(gone, session.live.patience) if gone else None,
        error=session.error or None,
        cycles=ended.cycles if known else None,
        cycles_logged=len(log.rows),
        overruns=ended.overruns if known else None,
        emg=None if emg is None or emg_process is None else emg_figures(log, emg, emg_process),
        interaction=None if pushing is None else push_figures(log, pushing, session.live.rig.sample_time),
        grants=tuple(Grant(**one) for one in session.ready["grants"]),
        log=session.log,
        more_logs=tuple(session.logs[1:]),
        log_whole=log.whole,
        log_lost=log_lost or None,
        motors=_motors(session, log) if session.live.several else (),
    )


def _end(ended: Ended | EndedMotor | None, failed: str) -> dict[str, Any]:
    """What the loop said at its end, of all or of one motor, and why the preflight failed."""
    return {
        "mode": None if ended is None else ended.mode.name.lower(),
        "faults": () if ended is None else tuple(fault.meaning for fault in faults.of(ended.faults)),
        "preflight": failed or None,
        "torque": (TorqueLeft.UNKNOWN if ended is None else ended.torque).name.lower(),
    }


def _motors(session: Session, log: Recording) -> tuple[RunMotor, ...]:
    """What is said of each motor of several."""
    ends = session.ended.motors if session.ended else [None] * len(session.motors)
    return tuple(
        RunMotor(
            **vars(tracked(log.only(motor.name))),
            **_end(end, REASONS[end.reason] if end else ""),
            name=motor.name,
            drive=drive,
        )
        for motor, drive, end in zip(session.motors, session.ready["drives"], ends, strict=True)
    )


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
