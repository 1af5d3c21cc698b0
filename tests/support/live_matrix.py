"""The fault matrix against the real thing: the loop's process, its recorder, and a twin's process on a bus.

Faults come from where they would come from: the twin has them, a third node on the bus speaks to the drive, the
operator is gone, the recorder dies, the loop's process stands still. One run takes many of them, acknowledged and armed
anew between; it is begun anew where a fault leaves something behind.
"""

import contextlib
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np

from bowden.core.errors import SafetyError
from bowden.cycle.one_cycle import LAW
from bowden.hardware.buses.unix_bus import FRAME, UnixBus
from bowden.hardware.drives import canopen_frames as frames
from bowden.live.live_run import live_run
from bowden.live.row import AT
from bowden.live.session import Session, automatic
from bowden.live.twin_process import RunningTwin, running_twin
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault, of
from bowden.safety.state import Mode, Request
from bowden.sim.injected import Injected
from support.fault_matrix import RELEASE, ROWS
from support.supervised import Outcome

RIG = """
[reference]
kind = 'periodic_minimum_jerk'
low_deg = 0.0
high_deg = 70.0
period_s = 2.0
[scenario]
duration_s = 60.0
[limits]
measures_temperature = true
reading_age = 8.0
lateness_s = 1.0
"""
"""The matrix's reference, on the default bench. A computer shared with others stalls for longer than a rig's may: all
other faults are looked at here."""

PDO_OFF = 1 << 31
NODE = 1
LOOK = 0.01
"""Between two looks at a run [s]."""
SETTLED = 0.5
"""Time that a run is watched after a stop, or after a fault that stops nothing [s]."""


class Reaction(NamedTuple):
    """What came of a fault."""

    reaction: int
    """The worst until and with the first R2 or R3."""
    faults: frozenset[Fault]
    """Those of the cycle with R2 or R3; where there is none, all that were seen."""
    mode: Mode
    """At the end."""
    off_after: float
    """From R2 or R3 to power off in the log; −1 where it stayed on [s]."""
    torque: bool
    """Whether the twin's motor has torque at the end."""


class LiveMatrix:
    """A run that faults are injected into; a context.

    Args:
        folder: for its logs.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._number = folder, 0
        self._stack = contextlib.ExitStack()
        self._running = False

    def __enter__(self) -> "LiveMatrix":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()

    def end(self) -> None:
        """End run and twin; the next fault begins them anew."""
        self._running = False
        self._stack.close()

    def _begin(self) -> None:
        self._number += 1
        path = self._folder / "rig.toml"
        path.write_text(RIG)
        bus = self._stack.enter_context(tempfile.TemporaryDirectory(prefix="bowden-matrix-"))
        rig = Rig.read(path)
        self.twin: RunningTwin = self._stack.enter_context(running_twin(rig, Path(bus)))
        log = self._folder / f"{self._number}.mcap"
        live = live_run(rig.on_bus(self.twin.channel))
        self.session = self._stack.enter_context(Session(live, log, remembers=False))
        there = [path.name.split("-")[0] for path in sorted(Path(self.twin.channel).glob("*.node"))]
        self.third = UnixBus(self.twin.channel)
        self._stack.callback(self.third.shutdown)
        self._to_twin = list(self.third._links.values())[there.index(str(self.twin.process.pid))]
        self._running = self._operated = True

    def _under_the_law(self) -> None:
        """Arm and run, as `bowden run --auto` does, until the law has led for a moment.

        Raises:
            SafetyError: the supervisor did not let it run.
        """
        if not self._running:
            self._begin()
        session = self.session
        row = self._look()
        if row["mode"] == Mode.LATCHED:
            session.ask(Request.ACKNOWLEDGE)
            self._wait_for(lambda: self._look()["mode"] == Mode.STOPPED, 2.0)
        steps = automatic(session)
        if not self._wait_for(lambda: next(steps, None) is None or self._look()["source"] == LAW, 20.0):
            raise SafetyError("the run does not begin")
        if self._look()["mode"] != Mode.RUNNING:
            raise SafetyError(f"the run was ended: {of(self._look()['faults'])}")

    def _look(self) -> dict[str, float]:
        while (row := self.session.last()) is None:
            self._rest(LOOK)
        return row

    def _rest(self, seconds: float) -> None:
        """Let time pass, with the operator's signs of life while there is an operator."""
        (self.session.wait if self._operated else time.sleep)(seconds)

    def _wait_for(self, true: Callable[[], bool], patience: float) -> bool:
        ends = time.monotonic() + patience
        while time.monotonic() < ends:
            if true():
                return True
            self._rest(LOOK)
        return False

    def react(self, case: "Case", onset: float) -> Reaction:
        """Inject a fault, `onset` [s] after the law began, and see what comes of it.

        Raises:
            SafetyError: the run did not come so far.
        """
        self._under_the_law()
        session = self.session
        self._rest(onset)
        session.last()  # what was before
        rows = [session.rows.read().rows]
        case.inject(self)
        ends = time.monotonic() + case.patience
        while time.monotonic() < ends and session.running:
            rows.append(session.rows.read().rows)
            if any(np.any(one[:, AT["mode"]] >= Mode.LATCHED) or _stopped(one) for one in rows[-1:] if len(one)):
                break
            self._rest(LOOK)
        self._rest(SETTLED)
        rows.append(session.rows.read().rows)
        torque = bool(self.twin.control.status()["torque"])
        seen = np.concatenate([one for one in rows if len(one)])
        self._restore(case)
        return _reaction(seen, torque)

    def _restore(self, case: "Case") -> None:
        if case.leaves_something:
            self.end()
            return
        self.twin.control.clear()
        case.restore(self)
        if self._look()["mode"] in (Mode.RUNNING, Mode.BRIDGING):
            self.session.ask(Request.STOP)
        self._wait_for(lambda: self._look()["mode"] in (Mode.STOPPED, Mode.LATCHED), 2.0)

    def write(self, index: int, sub: int, value: int, size: int) -> None:
        """Write an object of the drive's dictionary; nobody else hears of it."""
        self._send(frames.SDO_REQUEST + NODE, frames.pack_sdo_write(index, sub, value, size))

    def command(self, order: int) -> None:
        """An NMT command; nobody else hears of it."""
        self._send(frames.NMT, bytes((order, NODE)))

    def _send(self, identifier: int, data: bytes) -> None:
        while self.third.take() is not None:
            pass  # nobody reads here
        self._to_twin.send(FRAME.pack(identifier, len(data), 0, data))  # on the bus it would be another master

    def lose_recorder(self) -> None:
        """Kill the recorder."""
        self.session._recorder.kill()

    def lose_operator(self) -> None:
        """End the operator's signs of life."""
        self._operated = False


class Case(NamedTuple):
    """A fault of the matrix, and who has it."""

    kind: Injected
    inject: Callable[[LiveMatrix], object]
    restore: Callable[[LiveMatrix], object] = lambda matrix: None
    leaves_something: bool = False
    """Whether the run must be begun anew afterwards."""
    also: tuple[Fault, ...] = ()
    """What shows it first here, beside what the matrix names: a drive that is spoken to at every SYNC has told nothing
    where it has heard nothing."""
    patience: float = 3.0
    """Until it must have shown itself [s]."""


def _has(kind: Injected, text: str, *, lasting: float | None = None, **more: object) -> Case:
    """The twin has the fault."""
    return Case(kind, lambda matrix: matrix.twin.control.inject(text, lasting=lasting), **more)  # type: ignore[arg-type]


def _written(kind: Injected, index: int, sub: int, value: int, before: int, size: int, **more: object) -> Case:
    """An object is written behind the host's back."""
    return Case(
        kind,
        lambda matrix: matrix.write(index, sub, value, size),
        lambda matrix: matrix.write(index, sub, before, size),
        **more,  # type: ignore[arg-type]
    )


_TPDO1, _TPDO2 = (0x4000_0000 | cob_id | NODE for cob_id in (frames.TPDO1, frames.TPDO2))
CASES = {
    case.kind: case
    for case in (
        _has(Injected.JOINT_NAN, "encoder_nan joint"),
        _has(Injected.JOINT_RANGE, "encoder_offset joint 1146"),
        _has(Injected.JOINT_FROZEN, "encoder_frozen joint"),
        _has(Injected.JOINT_SPIKE, "encoder_spike joint 28.6", lasting=0.0099, patience=0.3),
        _has(Injected.JOINT_SPIKES, "encoder_spike joint 28.6"),
        _written(Injected.JOINT_DROPOUT, 0x1801, 1, PDO_OFF | _TPDO2, _TPDO2, 4),
        _has(Injected.JOINT_SIGN, "encoder_flipped joint"),
        _has(Injected.MOTOR_NAN, "encoder_nan motor"),
        _has(Injected.MOTOR_RANGE, "encoder_offset motor -1146"),
        _has(Injected.MOTOR_FROZEN, "encoder_frozen motor"),
        _has(Injected.MOTOR_SPIKE, "encoder_spike motor 28.6", lasting=0.0099, patience=0.3),
        _has(Injected.MOTOR_SPIKES, "encoder_spike motor 28.6"),
        _written(Injected.MOTOR_DROPOUT, 0x1800, 1, PDO_OFF | _TPDO1, _TPDO1, 4),
        _has(Injected.MOTOR_DELAY, "delayed_readings 400"),
        _has(Injected.MOTOR_SIGN, "encoder_flipped motor"),
        _has(Injected.SLACK, "slack_cable 46"),
        _has(Injected.BROKEN_CABLE, "broken_cable"),
        _has(Injected.PEAK_CURRENT, "over_current 30"),
        _has(Injected.LONG_CURRENT, "over_current 18", leaves_something=True, patience=5.0),
        _has(Injected.DRIVE_HOT, "over_temperature 95", leaves_something=True),
        _has(Injected.DRIVE_SILENT, "silence"),
        _written(Injected.HEARTBEAT_SILENT, 0x1017, 0, 0, 10, 2),
        _has(Injected.HOST_SILENT, "deaf", also=(Fault.MOTOR_STALE, Fault.EMERGENCY, Fault.JOINT_STALE)),
        _has(Injected.BUS_OFF, "bus_off", leaves_something=True),
        _has(Injected.LATE_PDOS, "late_pdos 40"),
        _has(Injected.EMERGENCY, "drive_fault 0x5530"),
        _has(Injected.DRIVE_FAULT, "drive_fault 0x8A88", also=(Fault.EMERGENCY_STOP,)),
        _has(Injected.DRIVE_REBOOT, "reboot", leaves_something=True, also=(Fault.MOTOR_STALE,)),
        Case(
            Injected.DRIVE_DROPPED,
            lambda matrix: matrix.command(frames.NMT_PRE_OPERATIONAL),
            leaves_something=True,
        ),
        Case(Injected.OPERATOR_LOST, LiveMatrix.lose_operator, leaves_something=True),
        Case(Injected.RECORDER_LOST, LiveMatrix.lose_recorder, leaves_something=True, patience=0.5),
        Case(Injected.STOP, lambda matrix: matrix.session.ask(Request.STOP)),
    )
}
"""What can be done to the real processes, by its kind in the matrix."""

NOT_HERE = {
    *(Injected.NOTHING, Injected.JOINT_DELAY, Injected.JOINT_OVER_TRAVEL, Injected.MOTOR_OVER_TRAVEL),
    *(Injected.OVER_SPEED, Injected.OVER_TENSION, Injected.JAM, Injected.CURRENT_NAN, Injected.TENSION_NAN),
    *(
        Injected.OVERRUN,
        Injected.OVERRUNS,
        Injected.CLOCK_BACK,
        Injected.CLOCK_FORWARD,
        Injected.LAW_NAN,
        Injected.LAW_STEP,
    ),
    *(Injected.LAW_BEYOND, Injected.LAW_RAMP, Injected.LAW_SHAKES, Injected.EMG_SILENT, Injected.EMG_TIMELESS),
}
"""What neither twin nor bus can do: the loop on a fake clock has these (`support.injected_loop`)."""


def _stopped(rows: "np.ndarray[tuple[int, int], np.dtype[np.float64]]") -> bool:
    """Whether a run that was led has come to rest in these rows."""
    return bool(rows[-1, AT["mode"]] == Mode.STOPPED)


def _reaction(rows: "np.ndarray[tuple[int, int], np.dtype[np.float64]]", torque: bool) -> Reaction:
    reaction, times = rows[:, AT["reaction"]], rows[:, AT["time"]]
    stops = np.flatnonzero(reaction > 1.5)
    off = np.flatnonzero(rows[:, AT["power"]] == 0.0)
    if len(stops):
        first = int(stops[0])
        later = off[off >= first]
        after = float(times[later[0]] - times[first]) if len(later) else -1.0
        worst, found = float(reaction[: first + 1].max()), of(rows[first, AT["faults"]])
    else:
        after, worst = -1.0, float(reaction.max())
        found = of(float(np.bitwise_or.reduce(rows[:, AT["faults"]].astype(np.int64))))
    return Reaction(int(worst), frozenset(found), Mode(int(rows[-1, AT["mode"]])), after, torque)


def differences(case: Case, live: Reaction, matrix: Outcome) -> Iterator[str]:
    """Where the real processes did otherwise than the matrix says; `matrix` is one of its runs with the same fault."""
    row = ROWS[case.kind]
    if live.reaction not in row.reactions:
        yield f"reaction {live.reaction}, not {row.reactions}"
    if row.faults and not live.faults & {*row.faults, *case.also}:
        yield f"{[one.name for one in live.faults]}, not {[one.name for one in (*row.faults, *case.also)]}"
    if len(row.reactions) == 1 and live.reaction != matrix.reaction:
        yield f"reaction {live.reaction}, and {matrix.reaction:.0f} in the matrix"
    if live.mode != matrix.mode:
        yield f"ended {live.mode.name}, and in mode {matrix.mode:.0f} in the matrix"
    if live.torque is not (matrix.off < 0.0):
        yield f"torque {live.torque}, and power {'on' if matrix.off < 0.0 else 'off'} in the matrix"
    if matrix.off >= 0.0 and not 0.0 <= live.off_after <= 1e-3 * RELEASE + 0.02:
        yield f"power off {live.off_after:.3f} s after the stop"
