"""What a run came to, from its log and its session.

Of one that its wearer led: by EMG motions, delays from a contraction to the joint and what of the stream was lost; by
push what they felt of the suit, by the torque that the run went by.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import TargetSource
from bowden.design.felt import beside_load, rms_and_peak, settled
from bowden.hardware.ports import TorqueLeft
from bowden.hardware.realtime import Grant
from bowden.live import stops
from bowden.live.ended import SAID_NOTHING, Ended, EndedMotor
from bowden.live.figures import Damage, DelaySpread, EmgRunFigures, EndedRun, FeltInRun, RunMotor
from bowden.live.log_facts import NEEDED, motions, recorded, tracked
from bowden.live.mcap_log import about as describing
from bowden.live.mcap_read import Recording, read
from bowden.live.preflight import REASONS
from bowden.live.session import Session
from bowden.safety import faults

if TYPE_CHECKING:
    from bowden.live.emg_process import EmgProcess
    from bowden.plants.pushing import Pushing
    from bowden.rig.emg_run import EmgRun


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


Array = NDArray[np.float64]

EMG_NEEDED = ("time", "command", "emg.age", "emg.onset", "emg.intent", "emg.samples", "emg.lost")
"""Columns of the log of a run by EMG, beside those of every run."""
PUSH_NEEDED = ("joint_seen", "joint_torque", "admittance.estimate.torque", "admittance.estimate.doubt")
"""The same of one that follows its wearer's push."""
COMMAND_MOVES, JOINT_MOVES = 0.1 * RADIANS, 1.0 * RADIANS
"""Motions that count as such [rad]."""
SETTLED = 1.0
"""After the first second of a motion the error is judged [s]."""


def emg_figures(log: Recording, run: "EmgRun", emg_process: "EmgProcess") -> EmgRunFigures:
    """Of a run's log; delays count from the sample with which a contraction was detected.

    In the proportional mode the joint follows the envelope: there are no motions to speak of.
    """
    led, triggered = log["source"] >= TargetSource.LAW_BEGINS, not run.course.proportional
    at = motions(log) if triggered else []
    time, onset = log["time"], log["emg.onset"]
    end = int(np.flatnonzero(led)[-1]) + 1 if led.any() else 0
    spans = list(pairwise([*at, end]))
    moves: dict[str, list[float | None]] = {
        "cycle": [float(time[i] - onset[i]) for i in at],
        "command": [_until(time, log["command"], onset[i], i, end, COMMAND_MOVES) for i, end in spans],
        "joint": [_until(time, log["joint"], onset[i], i, end, JOINT_MOVES) for i, end in spans],
    }
    error = np.abs(log["joint"] - log["reference"])
    late = [error[i:end][time[i:end] - time[i] >= SETTLED] for i, end in spans]
    rested = np.concatenate([np.empty(0), *late])
    rested = rested[np.isfinite(rested)]
    age = log["emg.age"][led]
    return EmgRunFigures(
        source=run.source,
        stream=emg_process.stream,
        wearer=run.where or None,
        motions=len(at) if triggered else None,
        **{f"onset_to_{name}_ms": _spread(delays) for name, delays in moves.items()},
        peak_after_first_second_deg=float(rested.max() / RADIANS) if len(rested) else None,
        age_ms=_spread(age.tolist()),
        samples=int(log["emg.samples"][-1]) if len(time) else 0,
        lost=int(log["emg.lost"][-1]) if len(time) else 0,
        why_lost=emg_process.lost or None,
    )


def _until(time: Array, values: Array, onset: float, begin: int, end: int, far: float) -> float | None:
    """From the onset until a value is `far` from where it was [s]; None where it never is."""
    gone = np.flatnonzero(np.abs(values[begin:end] - values[begin]) >= far)
    return float(time[begin + gone[0]] - onset) if len(gone) else None


def _spread(delays: Sequence[float | None]) -> DelaySpread | None:
    known = np.array([delay for delay in delays if delay is not None and np.isfinite(delay)])
    if not len(known):
        return None
    return DelaySpread(
        *(round(1e3 * float(one), 3) for one in (np.median(known), np.quantile(known, 0.99), known.max()))
    )


def push_figures(log: Recording, pushing: "Pushing", period: float) -> FeltInRun | None:
    """RMS and peak of the torque less the weight that is to be carried, and the median of its doubt [N·m].

    The torque is the load cell's, of which no doubt is known, in a run that went by it, and else the loop's estimate.

    Args:
        log: of the run.
        pushing: as the run had it.
        period: of a cycle [s].
    """
    led = np.flatnonzero(log["source"] >= TargetSource.LAW_BEGINS)
    if not len(led):
        return None
    led = led[settled(period * np.arange(len(led)))]
    measured = pushing.section.torque == "load_cell"
    torque, joint = log["joint_torque" if measured else "admittance.estimate.torque"][led], log["joint_seen"][led]
    left = beside_load(torque, joint, pushing.suit.arm, pushing.section.carried)
    known = np.isfinite(left)
    if not known.any():
        return None
    rms, peak = rms_and_peak(left[known])
    doubt = 0.0 if measured else float(np.median(log["admittance.estimate.doubt"][led][known]))
    return FeltInRun(rms, peak, doubt)
