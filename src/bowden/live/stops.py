"""What stopped a run: every stop of it, its faults in the order in which they came, and which follow from others.

A fault that comes in a later cycle than the first, at most half a second after the power went off, may follow from it;
and a loop that is late, or a clock that is stepped, in the first of these cycles explains what is old, jumps, or is not
noticed in that cycle. What comes later, such as a computer that is busy while everything is latched, explains nothing.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.live.mcap_read import Recording
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.supervisor import Mode

Array = NDArray[np.float64]

NEEDED = ("time", "mode", "faults", "lateness", "supervisor.sums.late", "motor_age", "joint_age")
"""Columns of the log that are looked at."""
OF_THE_COMPUTER = frozenset({Fault.LATE, Fault.CLOCK})
"""Faults of this computer, and not of the rig."""
_OLD = frozenset({Fault.JOINT_STALE, Fault.MOTOR_STALE})
FOLLOWS_LATENESS = _OLD | {
    *(Fault.JOINT_LOST, Fault.JOINT_JUMP, Fault.JOINT_OVER_SPEED, Fault.MOTOR_LOST, Fault.MOTOR_JUMP),
    *(Fault.MOTOR_OVER_SPEED, Fault.NOT_FOLLOWING, Fault.CURRENT_LOST, Fault.HEARTBEAT_LOST, Fault.DRIVE_DROPPED),
    *(Fault.DRIVE_FAULT, Fault.EMERGENCY, Fault.WISH_STEP, Fault.WISH_FAR, Fault.WISH_HARD, Fault.OPERATOR_LOST),
    *(Fault.EMG_LOST, Fault.NOT_ENABLED),
}
"""What a computer that stalls brings about as well."""
_STOPPING = sum(1 << fault for fault in Fault if fault.then)
"""Bits of the faults that end a run."""
_REMEDIES = {fault.meaning: fault.remedy for fault in Fault}
_LOOKED_BACK = 0.5
"""How long before a stop its computer is judged [s]."""
_LOOKED_ON = 0.5
"""How long after the end of power a fault may follow from what ended it [s]."""


class Stop(NamedTuple):
    """One end of power by a fault."""

    time: float
    """When the first of its faults came, since the first cycle [s]."""
    causes: tuple[Fault, ...]
    """What came first."""
    consequences: tuple[Fault, ...]
    """What came after it, or follows from it, in its order."""
    latest: float
    """Largest lateness of a cycle, or of the last ones together, in the half second before [s]."""
    oldest: float
    """Largest age of an angle in that time [cycles]."""


def stops(log: Recording) -> list[Stop]:
    """Every stop of a run by a fault, in their order; empty where there was none, or the log does not say.

    Args:
        log: of the run, with the columns of `NEEDED`.
    """
    return list(_stops(log)) if len(log.rows) and {*NEEDED} <= {*log.columns} else []


def _stops(log: Recording) -> Iterator[Stop]:
    time, mode = log["time"], log["mode"]
    bits = np.nan_to_num(log["faults"]).astype(np.int64) & _STOPPING
    edges = np.diff(np.isin(mode, (Mode.RELEASING, Mode.LATCHED)).astype(int), append=0)
    ends = np.flatnonzero(edges < 0) + 1
    for off in np.flatnonzero(edges > 0) + 1:  # a latch of a run before is none of this one
        over = int(ends[ends > off][0])
        faulty = np.flatnonzero(bits[off:over])
        if not len(faulty):
            continue  # as asked
        dark = np.flatnonzero(mode[off:over] == Mode.LATCHED)
        if len(dark):
            over = min(over, int(np.searchsorted(time, time[off + dark[0]] + _LOOKED_ON, "right")))
        at = int(off + faulty[0])
        clear = np.flatnonzero((bits[:at] & bits[at]) == 0)
        begin = int(clear[-1]) + 1 if len(clear) else 0
        since = (time >= time[at] - _LOOKED_BACK) & (time <= time[at])
        yield Stop(
            float(time[begin] - time[0]),
            *told_apart(onsets(bits[begin:over], time[begin:over])),
            _most(log["lateness"][since], log["supervisor.sums.late"][since]),
            _most(log["motor_age"][since], log["joint_age"][since]),
        )


def _most(*parts: Array) -> float:
    return float(np.nanmax(np.concatenate([*parts, [0.0]])))


def onsets(bits: Array | NDArray[np.int64], times: Array) -> dict[Fault, float]:
    """When each fault came first [s], in that order.

    Args:
        bits: of the faults in each cycle (n,).
        times: of these cycles (n,) [s].
    """
    order: dict[Fault, float] = {}
    for i in np.flatnonzero(np.diff(bits, prepend=0)):
        for fault in faults.of(float(bits[i])):
            order.setdefault(fault, float(times[i]))
    return order


def told_apart(came: Mapping[Fault, float]) -> tuple[tuple[Fault, ...], tuple[Fault, ...]]:
    """Causes and consequences among faults, each in the order in which they came.

    Args:
        came: when each came [s]; of those that came together, as they stand.
    """
    came = dict(sorted(came.items(), key=lambda one: one[1]))
    begin = min(came.values(), default=0.0)
    first = [fault for fault, time in came.items() if time == begin]
    computer = OF_THE_COMPUTER & {*first} if {*first} <= OF_THE_COMPUTER | FOLLOWS_LATENESS else frozenset()
    if computer:
        first = [fault for fault in first if fault in computer]
    return tuple(first), tuple(fault for fault in came if fault not in first)


def document(log: Recording, limits: Mapping[str, Any], *, twin: bool) -> list[dict[str, Any]]:
    """Every stop as JSON values.

    Args:
        log: see `stops`.
        limits: see `too_busy`.
        twin: likewise.
    """
    return [
        {
            "time_s": round(stop.time, 6),
            "causes": [fault.meaning for fault in stop.causes],
            "remedies": [fault.remedy for fault in stop.causes],
            "consequences": [fault.meaning for fault in stop.consequences],
            "too_busy": too_busy(stop, limits, twin=twin) or None,
        }
        for stop in stops(log)
    ]


def lines(stop: dict[str, Any]) -> Iterator[str]:
    """A stop, as `document` has it, for a person: its causes with what to do, and what followed from them.

    Beside a busy computer what followed has its remedies too: it may have a cause of its own.
    """
    if stop["too_busy"]:
        yield stop["too_busy"]
        for meaning in stop["consequences"]:
            yield f"at the same time: {meaning}; {_REMEDIES[meaning]}"
        return
    for meaning, remedy in zip(stop["causes"], stop["remedies"], strict=True):
        yield f"{meaning}; {remedy}"
    if stop["consequences"]:
        yield f"as a consequence: {', '.join(stop['consequences'])}"


def too_busy(stop: Stop, limits: Mapping[str, Any], *, twin: bool) -> str:
    """That it was this computer that stopped a run, by how much, and what to do; empty where it was not.

    Args:
        stop: of the run.
        limits: the supervisor's, by their names in `safety.limits.Limits`.
        twin: whether this computer plays the drive as well, which then answers late.
    """
    do = "close other programs, and run `bowden doctor`"
    lateness, age = limits.get("lateness"), limits.get("reading_age")
    if OF_THE_COMPUTER & {*stop.causes}:
        if lateness is None or not stop.latest > lateness:
            return ""  # a clock that is stepped, or the row that was late is not in the log
        allowed = f"{1e3 * lateness:.3g} ms are allowed, lateness_s of [limits]"
        return f"this computer is too busy: cycles came {1e3 * stop.latest:.0f} ms late ({allowed}); {do}"
    if not (twin and {*stop.causes} <= _OLD | {Fault.HEARTBEAT_LOST}) or age is None or not stop.oldest > age:
        return ""
    late = f"the twin, which runs on it too, answered {stop.oldest:.0f} cycles late"
    allowed = f"{age:.3g} are allowed, reading_age of [limits]"
    return f"this computer is too busy: {late} ({allowed}); {do}"
