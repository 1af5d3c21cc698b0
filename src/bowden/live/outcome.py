"""How a run ended, in words: what a session says of itself, and what its end is a warning with."""

from typing import TYPE_CHECKING

from bowden.hardware.ports import TorqueLeft, torque_left
from bowden.live.stops import AxisFaults, remedy_of, told_apart, unattended
from bowden.live.summary import STALLED
from bowden.safety import faults
from bowden.safety.state import Mode

if TYPE_CHECKING:
    from bowden.live.session import Session


_STANDS = {
    Mode.STOPPED: "the run goes on, with its power off",
    Mode.PREFLIGHT: "the run goes on, armed",
    Mode.RUNNING: "the run goes on, under its law",
    Mode.BRIDGING: "the run goes on, on the last valid target",
    Mode.RELEASING: "the run goes on, and lets its cable out",
    Mode.LATCHED: "the run goes on, latched with its power off",
}
"""Of a run that goes on."""


def outcome(session: "Session") -> str:
    """How a run ended; of one that goes on, where it stands, and the fault that stopped it if there is one."""
    if session.ended is None and not session.error:
        if session.mode is None:
            return "not begun"
        by = _faults(session) if session.mode >= Mode.RELEASING else []
        return f"stopped by a fault: {'; '.join(by)}" if by else _STANDS[session.mode]
    return "ended as asked" if session.ended_well else f"the run was ended: {'; '.join(why(session))}"


def why(session: "Session") -> list[str]:
    """What ended a run that did not end as asked, the most dangerous first."""
    ended = session.ended or {}
    stalled = 1e3 * ended.get("stalled", 0.0)
    left = torque_left(TorqueLeft(ended.get("torque", TorqueLeft.UNKNOWN)), twin=session.on_twin)
    gone = ended.get("unattended", 0.0)
    alone = unattended(gone, session.live.patience) if gone else ""
    by = [] if alone else _faults(session)
    found = [left, STALLED.format(stalled) if stalled else "", alone, *by, ended.get("reason"), session.error]
    return [one for one in found if one]


def _faults(session: "Session") -> list[str]:
    """What came first with its remedy, and what followed from it; of several axes in the one that had it first."""
    each = [(axis.name, axis.came) for axis in session.axes if axis.came]
    if not each:
        each = [("", dict.fromkeys(faults.of((session.ended or {}).get("faults", 0)), 0.0))]
    first, *others = sorted((AxisFaults(name, *told_apart(came), came) for name, came in each), key=_order)
    where = f"{first.axis}: " if first.axis else ""
    found = [f"{where}{fault.meaning}; {remedy_of(fault, twin=session.on_twin)}" for fault in first.causes]
    later = [fault.meaning for fault in first.consequences]
    later += [f"{one.axis}: {fault.meaning}" for one in others for fault in (*one.causes, *one.consequences)]
    return found + ([f"as a consequence: {', '.join(later)}"] if later else [])


def _order(one: AxisFaults) -> tuple[float, bool]:
    return one.order() if one.came else (0.0, False)
