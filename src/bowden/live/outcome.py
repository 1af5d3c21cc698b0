"""How a run ended, in words: what a session says of itself, and what its end is a warning with."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from bowden.hardware.ports import TorqueLeft, torque_left
from bowden.live.session_motor import SessionMotor
from bowden.live.stops import STALLED, MotorFaults, remedy_of, told_apart, unattended
from bowden.safety import faults
from bowden.safety.state import Mode


class RunState(NamedTuple):
    """What a session knows of where its run stands, and how it ended."""

    ended: Mapping[str, Any] | None
    """What the loop said at its end."""
    error: str
    """Why the loop ended without a word about how it ended."""
    mode: Mode | None
    motors: Sequence[SessionMotor]
    patience: float
    """How long the operator may be silent [s]."""
    on_twin: bool

    @property
    def ended_well(self) -> bool:
        """Whether the run has ended as asked, without torque."""
        ended = self.ended or {}
        well = ended.get("mode") == Mode.STOPPED and not ended.get("torque") and not ended.get("unattended")
        return not self.error and well


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
    if run.ended is None and not run.error:
        if run.mode is None:
            return "not begun"
        by = _faults(run) if run.mode >= Mode.RELEASING else []
        return f"stopped by a fault: {'; '.join(by)}" if by else _STANDS[run.mode]
    return "ended as asked" if run.ended_well else f"the run was ended: {'; '.join(why(run))}"


def why(run: RunState) -> list[str]:
    """What ended a run that did not end as asked, the most dangerous first."""
    ended = run.ended or {}
    stalled = 1e3 * ended.get("stalled", 0.0)
    left = torque_left(TorqueLeft(ended.get("torque", TorqueLeft.UNKNOWN)), twin=run.on_twin)
    gone = ended.get("unattended", 0.0)
    alone = unattended(gone, run.patience) if gone else ""
    by = [] if alone else _faults(run)
    found = [left, STALLED.format(stalled) if stalled else "", alone, *by, ended.get("reason"), run.error]
    return [one for one in found if one]


def _faults(run: RunState) -> list[str]:
    """What came first with its remedy, and what followed from it; of several motors in the one that had it first."""
    each = [(motor.name, motor.came) for motor in run.motors if motor.came]
    if not each:
        each = [("", dict.fromkeys(faults.of((run.ended or {}).get("faults", 0)), 0.0))]
    first, *others = sorted((MotorFaults(name, *told_apart(came), came) for name, came in each), key=_order)
    where = f"{first.motor}: " if first.motor else ""
    found = [f"{where}{fault.meaning}; {remedy_of(fault, twin=run.on_twin)}" for fault in first.causes]
    later = [fault.meaning for fault in first.consequences]
    later += [f"{one.motor}: {fault.meaning}" for one in others for fault in (*one.causes, *one.consequences)]
    return found + ([f"as a consequence: {', '.join(later)}"] if later else [])


def _order(one: MotorFaults) -> tuple[float, bool]:
    return one.order() if one.came else (0.0, False)
