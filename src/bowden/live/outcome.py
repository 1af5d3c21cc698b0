"""How a run ended, in words: what a session says of itself, what its end is a warning with, and what its log says."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bowden.core.errors import counted
from bowden.hardware.ports import torque_left
from bowden.live.ended import SAID_NOTHING, Ended
from bowden.live.figures import RunStop
from bowden.live.mcap_read import Recording
from bowden.live.ring import RecorderState
from bowden.live.session_motor import SessionMotor
from bowden.live.stops import OF_THE_COMPUTER, STALLED, Stop, remedy_of, unattended
from bowden.live.together import mode_of_all
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.state import Mode


class RunState(NamedTuple):
    """State of a session's run, and its end."""

    ended: Ended | None
    """State of the loop at its end, as it reported it."""
    error: str
    """Reason for which the loop ended without a report."""
    mode: Mode | None
    motors: Sequence[SessionMotor]
    patience: float
    """Longest silence of the operator that is allowed [s]."""
    on_twin: bool
    recorder: int = RecorderState.OK
    """The `RecorderState` of the newest cycle."""
    emg: float | None = None
    """Its `EmgLoss`, in a run by EMG."""

    @property
    def ended_well(self) -> bool:
        """True if the run has ended as asked, without torque, and not because a fault kept it from beginning."""
        ended = self.ended
        if ended is None or self.error or ended.mode != Mode.STOPPED or ended.torque or ended.unattended:
            return False
        return ended.ran or not held_back(ended.faults)


AS_ASKED = "ended as asked"
BEFORE_IT_RAN = "ended as asked, before it ran"


def held_back(bits: float) -> tuple[Fault, ...]:
    """The faults of a run's last cycle that kept it from beginning, where it never ran; a late cycle alone did not.

    Args:
        bits: the sum of 2**fault.
    """
    return tuple(fault for fault in faults.of(bits) if fault not in OF_THE_COMPUTER)


def outcome_of(log: Recording, found: Sequence[RunStop], *, twin: bool) -> str:
    """Outcome of a recorded run, its first cause first.

    Args:
        log: of the run, with the columns ``mode``, ``faults`` and ``recorder``.
        found: its stops, as `stops.run_stops` has them.
        twin: whether the drive was the command's own twin.
    """
    parts = log.parts.values()
    if not len(log.rows) or any("mode" not in one.columns or one["mode"][-1] not in {*Mode} for one in parts):
        return "not known: the log does not say"
    modes = [part["mode"] for part in parts]
    mode = mode_of_all([float(one[-1]) for one in modes], independent=False)
    latched = any(one[-1] == Mode.LATCHED for one in modes)
    bits = [float(np.nan_to_num(part["faults"][-1])) if "faults" in part.columns else 0.0 for part in parts]
    recorder = log["recorder"][-1] if "recorder" in log.columns else RecorderState.OK
    at_end = dict.fromkeys(fault for one in bits for fault in held_back(one))
    emg = log["emg.loss"][-1] if "emg.loss" in log.columns else None
    said = "; ".join(f"{fault.meaning}; {remedy_of(fault, twin=twin, recorder=recorder, emg=emg)}" for fault in at_end)
    if latched and found:
        last = found[-1]
        motor = f"{last.motor}: " if last.motor else ""
        return f"ended by a fault at {last.time_s:.3f} s: {motor}{', '.join(last.causes)}"
    if latched:
        return f"ended by a fault: {said or 'which is not in the log'}"
    if mode != Mode.STOPPED:
        return f"not known: the log ends in the mode {mode.name.lower()}"
    if not any((one == Mode.RUNNING).any() for one in modes):
        return f"ended before it ran: {said}" if said else BEFORE_IT_RAN
    return f"{AS_ASKED}, after {counted(len(found), 'stop')} by a fault" if found else AS_ASKED


_STANDS = {
    Mode.STOPPED: "the run goes on, with its power off",
    Mode.PREFLIGHT: "the run goes on, armed",
    Mode.RUNNING: "the run goes on, under its law",
    Mode.BRIDGING: "the run goes on, on the last valid target",
    Mode.RELEASING: "the run goes on, and lets its cable out",
    Mode.LATCHED: "the run goes on, latched with its power off",
}
"""Of a run that goes on."""


def outcome(run: RunState) -> str:
    """How a run ended; of one that goes on, where it stands, and the fault that stopped it if there is one."""
    ended = run.ended
    if ended is None and not run.error:
        if run.mode is None:
            return "not begun"
        by = _faults(run) if run.mode >= Mode.RELEASING else []
        return f"stopped by a fault: {'; '.join(by)}" if by else _STANDS[run.mode]
    if ended is None or not run.ended_well:
        return f"the run was ended: {'; '.join(why(run))}"
    return AS_ASKED if ended.ran else BEFORE_IT_RAN


def why(run: RunState) -> list[str]:
    """Causes of a run's end, the most dangerous first; empty if it ended as asked."""
    ended = run.ended or SAID_NOTHING
    stalled = STALLED.format(1e3 * ended.stalled) if ended.stalled else ""
    alone = unattended(ended.unattended, run.patience) if ended.unattended else ""
    by, failed = [] if alone else _faults(run), ended.why_not([motor.name for motor in run.motors])
    found = [torque_left(ended.torque, twin=run.on_twin), stalled, alone, *by, failed, run.error]
    return [one for one in found if one]


def _faults(run: RunState) -> list[str]:
    """What came first with its remedy, and what followed from it; of several motors in the one that had it first."""
    each = [Stop.of(motor.name, motor.came) for motor in run.motors if motor.came]
    at_end = Stop.of("", dict.fromkeys(faults.of((run.ended or SAID_NOTHING).faults), 0.0))
    first, *others = sorted(each or [at_end], key=Stop.order)
    where = f"{first.motor}: " if first.motor else ""
    found = [
        f"{where}{fault.meaning}; {remedy_of(fault, twin=run.on_twin, recorder=run.recorder, emg=run.emg)}"
        for fault in first.causes
    ]
    later = [fault.meaning for fault in first.consequences]
    later += [f"{one.motor}: {fault.meaning}" for one in others for fault in (*one.causes, *one.consequences)]
    return found + ([f"as a consequence: {', '.join(later)}"] if later else [])
