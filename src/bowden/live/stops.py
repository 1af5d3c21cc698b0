"""What stopped a run: every stop of it, its faults in the order in which they came, and which follow from others.

A fault that comes in a later cycle than the first, at most half a second after the power went off, may follow from it;
and a loop that is late, or a clock that is stepped, in the first of these cycles explains what is old, jumps, or is not
noticed in that cycle. What comes later, such as a computer that is busy while everything is latched, explains nothing.
EMG that is lost before a loop is late has one of two causes, and both are told. Angles that come no more, and then no
heartbeat either, are a drive that has fallen silent.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.hardware.emg.intent_block import EmgLoss
from bowden.live.figures import RunStop
from bowden.live.mcap_read import Recording
from bowden.live.ring import RecorderState
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.state import Mode

STALLED = "this computer stopped for {:.0f} ms, which is not a fault of the rig: see bowden doctor"
"""Why a run was ended that nothing else was wrong with; a drive whose host is silent for longer than its watch over it
lasts takes its torque off itself."""
Array = NDArray[np.float64]

_MUST = ("time", "mode", "faults", "lateness", "supervisor.timers.late")
NEEDED = (*_MUST, "operator_age", "emg.loss")
"""Columns of the log that are looked at; the last two may be missing."""
OF_THE_COMPUTER = frozenset({Fault.LATE, Fault.CLOCK})
"""Faults of this computer, and not of the rig."""
_OLD = frozenset({Fault.JOINT_STALE, Fault.MOTOR_STALE})
FOLLOWS_LATENESS = _OLD | {
    *(Fault.JOINT_LOST, Fault.JOINT_JUMP, Fault.JOINT_OVER_SPEED, Fault.MOTOR_LOST, Fault.MOTOR_JUMP),
    *(Fault.MOTOR_OVER_SPEED, Fault.NOT_FOLLOWING, Fault.CURRENT_LOST, Fault.HEARTBEAT_LOST, Fault.DRIVE_DROPPED),
    *(
        Fault.DRIVE_FAULT,
        Fault.EMERGENCY,
        Fault.TARGET_STEP,
        Fault.TARGET_TOO_FAR,
        Fault.TARGET_TOO_HARD,
        Fault.OPERATOR_LOST,
    ),
    *(Fault.EMG_LOST, Fault.NOT_ENABLED),
}
"""What a computer that stalls brings about as well."""
_STOPPING = sum(1 << fault for fault in Fault if fault.then)
"""Bits of the faults that end a run."""
_ALIVE = frozenset({Fault.OPERATOR_LOST})
_SILENT = "a fault was injected into it, it ended, or it was not let run (`bowden doctor`); begin again"
_ASTRAY = "it was injected into the twin, or slope_low, slope_high and play_deg of [limits] are not of the rig's cable"
_OF_TWIN = {
    Fault.NOT_DISABLED: f"no motor has torque; the twin is silent, or its current is wrong: {_SILENT}",
    Fault.HEARTBEAT_LOST: f"the twin is silent: {_SILENT}",
    Fault.BUS_ERRORS: f"a twin's bus has no cable; the twin is silent: {_SILENT}",
    Fault.MOTOR_STALE: f"the twin is late or silent: {_SILENT}",
    Fault.JOINT_STALE: f"the twin is late or silent: {_SILENT}",
    Fault.JOINT_MOTOR_MISMATCH: _ASTRAY,
    Fault.EMERGENCY_STOP: "it was injected into the twin; begin again",
    Fault.MOTOR_HOT: "the twin's motor is a model; begin again, it is cold then",
    Fault.DRIVE_HOT: "the twin's drive is a model; begin again",
    Fault.OPERATOR_LOST: "close other programs, and begin again",
    Fault.OVER_TENSION: "look at the rig's cable and reference: nobody is caught in a twin",
    Fault.JOINT_OVER_TRAVEL: "look at the reference and at joint_low_deg and joint_high_deg of [limits]",
    Fault.MOTOR_OVER_TRAVEL: "look at the reference and at motor_low_deg and motor_high_deg of [limits]",
}
"""Remedies that are others where the drive is a twin of the command's own: there is nothing to touch."""
_LOOKED_BACK = 0.5
"""How long before a stop its computer is judged [s]."""
_LOOKED_ON = 0.5
"""How long after the end of power a fault may follow from what ended it [s]."""


_RECORD_AGAIN = "begin another run; a running loop goes on, no new one is armed"
_OF_RECORDER: Mapping[float, str] = {
    RecorderState.FILE_GONE: f"its log was removed, replaced or moved: leave it where it is, and {_RECORD_AGAIN}",
    RecorderState.FULL: f"the disk takes nothing, it is full, read-only or gone: make room there, and {_RECORD_AGAIN}",
    RecorderState.SLOW: "the disk is behind by more than a second: end what else writes to it, or choose another with "
    f"--out, and {_RECORD_AGAIN}",
    RecorderState.DEAD: f"the recorder was killed, or not let run (`bowden doctor`): {_RECORD_AGAIN}",
}
"""Remedies where it is known why nothing is recorded."""
_OF_EMG: Mapping[float, str] = {
    EmgLoss.READER: "the process that reads the stream stalled or ended, whatever the electrodes do: close other "
    "programs, run `bowden doctor`, and begin another run",
    EmgLoss.STREAM: "no new samples came, whatever the electrodes do: look at the program that sends, its base station "
    "and its network; then begin again",
    EmgLoss.DEAD: "samples came, of a signal that is flat, at its limit, missing or repeated: look at the electrodes, "
    "their contact and their sender; then begin again",
    EmgLoss.NOISY: "samples came, full of movement or mains: look at the electrodes, their contact and their cables; "
    "then begin again",
}
"""Remedies where it is known what was lost."""


def remedy_of(fault: Fault, *, twin: bool, recorder: float = RecorderState.OK, emg: float | None = EmgLoss.NONE) -> str:
    """What to do about a fault; of a command's own twin without what only a drive asks for.

    Args:
        fault: to be mended.
        twin: whether the drive is the command's own twin.
        recorder: the `RecorderState` of the cycle that shows it.
        emg: the `EmgLoss` of that cycle.
    """
    if fault == Fault.EMG_LOST:
        return _OF_EMG.get(emg or EmgLoss.NONE, fault.remedy)
    if fault == Fault.RECORDER_LOST:
        return _OF_RECORDER.get(recorder, fault.remedy)
    return _OF_TWIN.get(fault, fault.remedy) if twin else fault.remedy


class Stop(NamedTuple):
    """The faults of one motor: of one end of its power, or those that it has."""

    time: float
    """When the first of them came; of a recorded run since the first cycle [s]."""
    causes: tuple[Fault, ...]
    """What came first."""
    consequences: tuple[Fault, ...]
    """What came after it, or follows from it, in its order."""
    came: Mapping[Fault, float]
    """When each came [s]."""
    latest: float = 0.0
    """Largest lateness of a cycle, or of the last ones together, in the half second before [s]."""
    alone: float = 0.0
    """Largest age of the operator's sign of life in that time [s]."""
    emg: float = EmgLoss.NONE
    """Which `EmgLoss` it was, in a run by EMG."""
    motor: str = ""
    """Name of the motor; empty of a rig with one motor."""

    @classmethod
    def of(cls, motor: str, came: Mapping[Fault, float]) -> "Stop":
        """The faults that a motor has, parted by `split_root_causes`."""
        return cls(min(came.values(), default=0.0), *split_root_causes(came), came, motor=motor)

    def order(self) -> tuple[float, bool]:
        """For sorting: what came first; of those at once, what has a cause of its own."""
        return self.time, {*self.causes} <= {*faults.OF_OTHERS}


def stops(log: Recording) -> list[Stop]:
    """Every stop of a run by a fault, in their order; empty where there was none, or the log does not say.

    Args:
        log: of the run, with the columns of `NEEDED`.
    """
    return list(_stops(log)) if len(log.rows) and {*_MUST} <= {*log.columns} else []


def stops_of_each(log: Recording) -> list[Stop]:
    """Every stop of every motor of a run, in their order."""
    parts = log.parts.items()
    return sorted((one._replace(motor=name) for name, part in parts for one in stops(part)), key=Stop.order)


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
        came = onsets(bits[begin:over], time[begin:over])
        yield Stop(
            float(time[begin] - time[0]),
            *split_root_causes(came),
            came,
            _most(log["lateness"][since], log["supervisor.timers.late"][since]),
            _most(log["operator_age"][since]) if "operator_age" in log.columns else 0.0,
            float(log["emg.loss"][at]) if "emg.loss" in log.columns else EmgLoss.NONE,
        )


def _most(*parts: Array) -> float:
    return float(np.nanmax(np.concatenate([*parts, [0.0]])))


def onsets(bits: Array | NDArray[np.int64], times: Array) -> dict[Fault, float]:
    """Onset of each fault [s], in the order of time.

    Args:
        bits: of the faults in each cycle (n,).
        times: of these cycles (n,) [s].
    """
    order: dict[Fault, float] = {}
    for i in np.flatnonzero(np.diff(bits, prepend=0)):
        for fault in faults.of(float(bits[i])):
            order.setdefault(fault, float(times[i]))
    return order


def split_root_causes(came: Mapping[Fault, float]) -> tuple[tuple[Fault, ...], tuple[Fault, ...]]:
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
    if first == [Fault.EMG_LOST]:  # a stream's sender stalls before the loop does, which comes first on its computer
        first += [fault for fault in came if fault in OF_THE_COMPUTER]
    if Fault.MOTOR_STALE in first and {*first} <= _OLD and Fault.HEARTBEAT_LOST in came:
        first = [Fault.HEARTBEAT_LOST]
    return tuple(first), tuple(fault for fault in came if fault not in first)


def run_stops(log: Recording, limits: Mapping[str, Any], *, twin: bool) -> tuple[RunStop, ...]:
    """Every stop of a run in words.

    Args:
        log: see `stops`.
        limits: see `too_busy`.
        twin: likewise.
    """
    limits_of = {"": limits} | {str(one["name"]): one.get("limits", limits) for one in log.settings.get("motors") or ()}
    groups: list[list[Stop]] = []
    for one in stops_of_each(log):
        together = groups and not log.settings.get("independent") and one.time - groups[-1][0].time <= _SPREADS
        if together and one.motor not in [other.motor for other in groups[-1]]:
            groups[-1].append(one)
        else:
            groups.append([one])
    return tuple(_said(group, limits_of, len(log.motors), twin=twin) for group in groups)


_SPREADS = 0.05
"""Within this time a stop of one motor is that of the others, which see it a cycle later, or late cycles later [s]."""


def _said(group: Sequence[Stop], limits: Mapping[str, Mapping[str, Any]], count: int, *, twin: bool) -> RunStop:
    """A stop in words; of several motors what came first, in which motor, and what followed in it and in the others."""
    first, *others = group
    later = [fault.meaning for fault in first.consequences]
    at_once = len(group) == count and all(one[:2] == first[:2] for one in others)
    if not at_once:
        later += [f"{one.motor}: {fault.meaning}" for one in others for fault in (*one.causes, *one.consequences)]
    return RunStop(
        round(first.time, 6),
        tuple(fault.meaning for fault in first.causes),
        tuple(remedy_of(fault, twin=twin, emg=first.emg) for fault in first.causes),
        tuple(later),
        too_busy(first, limits[first.motor]) or None,
        None if at_once else first.motor or None,
    )


def lines(stop: RunStop, *, twin: bool = False) -> Iterator[str]:
    """A stop for a person: its causes with what to do, and what followed from them.

    Beside a busy computer what followed has its remedies too: it may have a cause of its own.

    Args:
        stop: one of `run_stops`.
        twin: whether the drive was the command's own twin.
    """
    motor = f"{stop.motor}: " if stop.motor else ""
    if stop.too_busy:
        yield stop.too_busy
        remedies = {fault.meaning: remedy_of(fault, twin=twin) for fault in Fault}
        for meaning in stop.consequences:
            yield f"at the same time: {meaning}; {remedies[meaning.rpartition(': ')[2]]}"
        return
    for meaning, remedy in zip(stop.causes, stop.remedies, strict=True):
        yield f"{motor}{meaning}; {remedy}"
    if stop.consequences:
        yield f"as a consequence: {', '.join(stop.consequences)}"


def too_busy(stop: Stop, limits: Mapping[str, Any]) -> str:
    """That it was this computer that stopped a run, by how much, and what to do; empty where its loop was in time.

    Args:
        stop: of the run.
        limits: the supervisor's, by their names in `safety.limits.Limits`.
    """
    lateness = limits.get("lateness")
    if OF_THE_COMPUTER & {*stop.causes}:
        if lateness is None or not stop.latest > lateness:
            return ""  # a clock that is stepped, or the row that was late is not in the log
        allowed = f"{1e3 * lateness:.3g} ms are allowed, lateness_s of [limits]"
        return f"this computer is too busy: cycles came {1e3 * stop.latest:.0f} ms late ({allowed}); {_LESS}"
    alone = limits.get("operator_age")
    if {*stop.causes} == _ALIVE and alone is not None and stop.alone > alone:
        return unattended(stop.alone, alone)
    return ""


def unattended(age: float, allowed: float) -> str:
    """That a run was ended because its own command was not seen, by how much, and what to do.

    Args:
        age: of the command's last sign of life [s].
        allowed: the largest, `operator_age` of the limits [s].
    """
    what = f"the command that started the run gave no sign of life for {1e3 * age:.0f} ms"
    given = f"{1e3 * allowed:.0f} ms are allowed, operator_age_s of [limits]"
    return f"{what} ({given}): this computer is too busy, or the command was stopped; {_LESS}"


_LESS = "close other programs, and run `bowden doctor`"
