"""A live run from the operator's side: recorder and loop started, signs of life, requests, and an orderly end.

A sign of life comes from whoever sees the run through, with each look at it (`last`, `ask`, `wait`, `beat`), and from
no thread of its own: it would go on for an operator who can no longer stop the run.
"""

import contextlib
import json
import os
import queue
import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.core.arguments import format_value
from bowden.core.clock import SECOND, MonotonicClock, unix_seconds
from bowden.core.errors import DriveError, LogError, OutputError, ParameterError, SafetyError, near, note
from bowden.core.guesses import answer
from bowden.cycle.one_cycle import TargetSource
from bowden.drawing import shown
from bowden.hardware import shared_memory
from bowden.live import child, control_block, left_behind
from bowden.live.control_block import ControlBlock
from bowden.live.emg_process import EmgProcess
from bowden.live.ended import Ended
from bowden.live.gain_check import GainCheck
from bowden.live.gain_ramp import RAMP
from bowden.live.live_run import Live
from bowden.live.mcap_read import read
from bowden.live.outcome import RunState, outcome, why
from bowden.live.provenance import rig_revision
from bowden.live.recorder import check_room
from bowden.live.ring import CAPACITY, FOLDER, RecorderState, RingReader, Row, create
from bowden.live.row import AT, description
from bowden.live.session_motor import SessionMotor
from bowden.live.stops import Stop, remedy_of
from bowden.live.together import OF_ALL, mode_of_all, of_all
from bowden.records.trace import Trace
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.state import Mode, Request

STANDS_STILL = 5.0
"""A loop that has done no cycle for this long does none any more; the drive has long taken its torque off [s]."""
_START = 900.0
"""A loop that has not said anything after this has failed; on a slow computer it compiles for minutes at first [s]."""
_ANSWER_WITHIN = 3.0
"""A wait of this long is explained [s]."""
_END = 10.0
"""From the request to end to the process' end [s]."""
_LOOK = 0.05
"""Between two looks at a run that is seen through [s]."""
_MOST_LOGS = 3
"""Recorders of a run, one after the other."""
_BEAT = 0.05
"""Between two signs of life [s]."""
_ASK = "session.ask(Request.{}), with: from bowden.safety.state import Request"
_GUESSES = {
    **{name: _ASK.format(name.upper()) for name in ("arm", "stop", "acknowledge")},
    "run": "session.start(), or session.complete() up to the reference's end",
    "close": "the end of the with block ends the run",
    "result": "session.outcome and session.trace()",
}
"""Name that is guessed of a session → what to write."""
_READINGS_WITHIN = 3.0
"""Time that readings are given to come in before arming is given up [s]."""
_LATE_PATIENCE = 30.0
"""The same where nothing but the loop's lateness speaks against it, which on a shared computer comes and goes [s]."""
_TAKEN_WITHIN = 2.0
"""A change of gains that is not in force this long after its ramp has not been taken [s]."""


class Session:
    """A run that goes on; `begin` makes it.

    Use as a context: leaving it ends the run in a controlled release, whatever happened.

    Args:
        live: the run.
        log: the file to record to.
        emg_process: of a run by EMG, started and ready; it is closed with the run.
        remembers: whether the motor's warmth is taken from the run before and kept for the next one.
        about: who and what for: ``subject``, ``session`` and ``notes``, for the log; those that are not empty.
        loop: a `prepared_loop`, where the run was foreseen.
        tell: called with what takes long.
    """

    def __init__(
        self,
        live: Live,
        log: Path,
        emg_process: EmgProcess | None = None,
        *,
        remembers: bool = True,
        about: Mapping[str, str] | None = None,
        loop: "subprocess.Popen[str] | None" = None,
        tell: Callable[[str], None] = lambda note: None,
    ) -> None:
        self.live, self.log, self.emg_process, self._remembers = live, log, emg_process, remembers
        self._about = {name: text for name, text in (about or {}).items() if text}
        self._prepared, self._tell = loop, tell
        self.logs = [log]
        """Files of the run: one more for each time that its recorder had to be started again."""
        self.log_lost = ""
        """Why the last of them is not there at the end: it was removed, replaced or moved during the run."""
        self.clock = MonotonicClock()
        self.ended: Ended | None = None
        """State of the loop at its end, as it reported it."""
        self.error = ""
        """Reason for which the loop ended without a report; empty where it reported."""
        self.motors: tuple[SessionMotor, ...] = ()
        """Each motor of the run, once it has begun; one where the rig has one motor."""
        self._last: Row | None = None
        self.began_latched = False
        """True if the previous run left an unacknowledged fault."""
        self._latching = ThreadPoolExecutor(1)
        self._not_kept, self._keeping = "", threading.Lock()
        self._came = self.clock.now()
        self._said: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._processes: list[subprocess.Popen[str]] = []
        self._changed: dict[str, float] = {}
        self._steps: Iterator[bool] | None = None
        name = left_behind.name_of_this()
        self._ring, self._block = FOLDER / f"{name}.ring", FOLDER / f"{name}.block"

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_") or hasattr(type(self), name) or name in type(self).__annotations__:
                return object.__getattribute__(self, name)
            raise AttributeError(answer("a session", name, dir(type(self)), _GUESSES))

    def __enter__(self) -> "Session":
        try:
            self._begin()
        except BaseException:
            self.__exit__()
            self._leave_no_empty_log()
            raise
        return self

    def _leave_no_empty_log(self) -> None:
        """Remove the log of a run that did not begin, if it is known to be ours."""
        if hasattr(self, "rows"):
            said = self.rows.recorder.read()
            if said.state == RecorderState.ENDED and not said.rows:
                self.log.unlink(missing_ok=True)

    def _begin(self) -> None:
        live, now = self.live, self.clock.now()
        left_behind.sweep()
        more = {"about": self._about} if self._about else {}
        wall = round(unix_seconds() * SECOND)
        about = description(live.columns(), {**live.log_settings(), **more, "twin": self.on_twin}, wall, now)
        check_room(self.log, about, live.length)
        create(self._ring, about, CAPACITY // len(live.motors))  # a row of several is as much longer
        shared_memory.create(self._block, control_block.WORDS)
        self.block, self.rows = ControlBlock(self._block), RingReader(self._ring)
        self.motors = tuple(
            SessionMotor(motor, about.columns, live.names, now, remembers=self._remembers) for motor in live.motors
        )
        self.beat()
        self._revision = rig_revision(Path(live.rig.origin).parent)
        self._record_to(self.log)
        self.began_latched = any(motor.latched is not None for motor in self.motors)
        given = {
            "rig": (live.whole or live.rig).document(),
            "measure": live.measure,
            "off_reference": [motor.limits.off_reference for motor in live.motors],
            "thermal": [motor.thermal for motor in self.motors],
            "latched": [motor.latched for motor in self.motors],
            "remembers": self._remembers,
            "ring": str(self._ring),
            "block": str(self._block),
            "emg": None if self.emg_process is None else str(self.emg_process.block),
            "start_ns": now,
            "operator": os.getpid(),
        }
        self._loop = self._prepared or child.started("bowden.live.loop_process")
        self._processes.append(self._loop)
        child.tell(self._loop, json.dumps(given))
        with contextlib.suppress(OSError):
            self._loop.stdin.close()  # type: ignore[union-attr]  # which it has
        self._listener = child.listen(self._loop, self._said.put)
        self.ready = self._await_ready()
        self._came = self.clock.now()
        if self.emg_process is not None:
            self.emg_process.go()

    def _record_to(self, log: Path) -> None:
        words = ("bowden.live.recorder", str(self._ring), str(log), self._revision)
        self._recorder = child.started(*words, stdin=subprocess.DEVNULL)
        self._processes.append(self._recorder)

    def _record_again(self) -> None:
        """Have another recorder write what the ring still has, some half a minute, into a file of its own."""
        self.logs.append(self.log.with_name(f"{self.log.stem}-again{len(self.logs)}.mcap"))
        join = shlex.join(["bowden", "log", "recover", *map(str, self.logs)])
        what = f"the recorder has ended unexpectedly; recording goes on in {self.logs[-1]}"
        note(f"{what}. After the run, join them: {join}")
        self._record_to(self.logs[-1])

    def _end_recorder(self) -> None:
        """Have all rows written before the ring goes: by another recorder where this one is dead or stands still."""
        self.rows.recorder.stop()
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._recorder.wait(_END)
            if self._recorder.poll() and self.rows.recorder.read().state == RecorderState.FILE_GONE:
                self.log_lost = child.complaint(self._recorder)
            if (
                self.log_lost
                or self._recorder.poll() == 0
                or not hasattr(self, "ready")
                or len(self.logs) >= _MOST_LOGS
            ):
                return
            self._recorder.kill()
            self._record_again()

    def beat(self) -> None:
        """The operator lives, and can stop the run."""
        self.block.beat(self.clock.now())

    def end(self) -> None:
        """Tell the loop to end the run, in a controlled release; nothing is waited for."""
        self.block.quit()

    def _await_ready(self) -> dict[str, Any]:
        said = self._answer()
        if said and "ready" in said:
            self._check_recorder()
            return dict(said["ready"])
        if said and "error" in said:
            raise DriveError(said["error"])
        raise DriveError(self._how_it_died())

    def _answer(self) -> dict[str, Any] | None:
        """The first thing that the loop's process says; None where it ended without a word."""
        for look in range(round(_START / _BEAT)):
            self.beat()
            with contextlib.suppress(queue.Empty):
                return self._said.get(timeout=_BEAT)
            if look == round(_ANSWER_WITHIN / _BEAT) and sys.stderr.isatty():
                print(
                    "bowden: the loop is being prepared; the first time it is compiled, which takes about a minute",
                    file=sys.stderr,
                )
        raise DriveError(f"the loop's process did not answer for {_START:g} s", do="look at bowden doctor")

    def _check_recorder(self) -> None:
        deadline = self.clock.now() + 10 * SECOND
        while self.recorder == RecorderState.ABSENT and self._recorder.poll() is None:
            self.wait(0.02)
            if self.clock.now() > deadline:
                break
        if self._recorder.poll() is not None:
            raise OutputError(child.complaint(self._recorder))

    @property
    def on_twin(self) -> bool:
        """True if the drive is a twin of this command's own."""
        return not self._remembers

    @property
    def channel(self) -> str:
        """The bus of the run, for ``bowden twin RIG.toml --inject FAULT --channel``; of a twin its own.

        Of several motors that of the first; see `SessionMotor.live`.
        """
        drive = self.live.rig.drive
        return family_of(drive).address(drive).get("channel", "")

    def inject(self, fault: str, after: float = 0.0, lasting: float | None = None, motor: str | None = None) -> None:
        """Give the run's twin a fault; ``bowden twin RIG.toml --inject list`` shows all.

        Args:
            fault: its name, with side and amount where it has them: ``"encoder_frozen joint"``.
            after: from now [s].
            lasting: for how long; to the end of the run where it is not given [s].
            motor: whose twin it is, where there are several; the first where it is not given.

        Raises:
            ParameterError: there is no such fault, or no such motor.
            DriveError: the drive is no twin of this run, or does not answer.
        """
        from bowden.hardware.twin.control import TwinControl

        if not self.on_twin:
            raise DriveError("faults are injected into a twin, and this run has a drive", do="run it with twin=True")
        self.beat()
        rig = self.live.rig if motor is None or self.live.whole is None else self.live.whole.only(motor)
        with TwinControl(family_of(rig.drive).control(rig.drive)) as twin:
            twin.inject(fault, after, lasting)

    @property
    def mode(self) -> Mode | None:
        """Where the run stands, as far as `last` has looked; None before its first cycle."""
        row = self._last
        if row is None:
            return None
        modes = [motor.mode(row) for motor in self.motors]
        return Mode(int(modes[0])) if len(modes) == 1 else mode_of_all(modes, independent=self.live.independent)

    @property
    def ended_well(self) -> bool:
        """True if the run has ended as asked, without torque."""
        return self._state.ended_well

    @property
    def outcome(self) -> str:
        """How the run ended, in words: what stopped it, and what to do; of one that goes on, where it stands."""
        return outcome(self._state)

    @property
    def why(self) -> list[str]:
        """What ended a run that did not end as asked, the most dangerous first, but for `error`."""
        return why(self._state._replace(error=""))

    @property
    def recorded(self) -> int:
        """The `RecorderState` of the newest cycle, as far as `last` has looked."""
        return RecorderState.OK if self._last is None else int(self._last[AT["recorder"]])

    @property
    def emg_loss(self) -> float | None:
        """The `EmgLoss` of that cycle; None of a run without EMG."""
        names = self.rows.description.columns
        return None if self._last is None or "emg.loss" not in names else float(self._last[names.index("emg.loss")])

    @property
    def _state(self) -> RunState:
        known = (self.ended, self.error, self.mode, self.motors, self.live.patience, self.on_twin)
        return RunState(*known, self.recorded, self.emg_loss)

    @property
    def recorder(self) -> int:
        """A `RecorderState`."""
        return self.rows.recorder.state(self.clock.now())

    @property
    def running(self) -> bool:
        """True if the loop cycles."""
        return self._loop.poll() is None

    def _await_end(self) -> None:
        """Take what the loop's process said at its end, once it has ended."""
        self._listener.join(1.0)
        with contextlib.suppress(queue.Empty):
            while True:
                said = self._said.get_nowait() or {}
                self.ended = Ended.of(said["ended"]) if "ended" in said else self.ended
                self.error = said.get("error", self.error)
        if self.ended is None:
            self.error = self.error or self._how_it_died()

    def _how_it_died(self) -> str:
        """Of a loop that did not say it itself."""
        code = self._loop.wait(_END)
        if code < 0:
            how = f"was ended by {signal.Signals(-code).name}"
            return f"the loop's process {how}; a drive without its heartbeat switches its torque off by itself"
        return f"the loop's process ended unexpectedly: {child.last_words(self._loop, _END)}"

    def last(self) -> dict[str, float] | None:
        """The newest row by its columns; None before the first.

        With several motors, `together.OF_ALL` among them are those of all: ``mode``, ``faults`` and the like.
        """
        self.beat()
        if self._recorder.poll() and self.running and len(self.logs) < _MOST_LOGS:
            self._record_again()
        rows = self.rows.read().rows
        if len(rows):
            self._last = rows[-1]
            for motor in self.motors:
                motor.see(rows, self._latching)
        row = self._last
        if len(rows):
            self._came = self.clock.now()
        return None if row is None else self.row_of(row)

    def row_of(self, row: Row) -> dict[str, float]:
        """A row of the ring by its columns, as `last` gives it.

        What the first motor has in place of what is said there of all has its name: ``hip.mode``.
        """
        found = dict(zip(self.rows.description.columns, row.tolist(), strict=True))
        own = {f"{name}.{column}": found[column] for name in self.live.names[:1] if name for column in OF_ALL}
        of_each = [motor.of(found) for motor in self.motors]
        return found | own | of_all(of_each, independent=self.live.independent)

    def judged(self, row: Mapping[str, float] | None) -> list[Mapping[str, float]]:
        """What a request is judged by, of a row of `last`: that of all, or of motors that go alone that of each."""
        if row is None:
            return []
        return [motor.of(row) for motor in self.motors] if self.live.independent else [row]

    def faults(self, row: Mapping[str, float]) -> list[Stop]:
        """The faults of a row of `last`, first those of the motor that was the first to have one; empty without any."""
        found = []
        for motor in self.motors:
            own = motor.of(row)
            came = {fault: motor.came.get(fault, own["time"]) for fault in faults.of(own["faults"])}
            found += [Stop.of(motor.name, came)] if came else []
        return sorted(found, key=Stop.order)

    @property
    def emergency(self) -> int:
        """Error code of the last emergency of a drive; 0 where there was none."""
        return next((motor.emergency for motor in self.motors if motor.emergency), 0)

    def drive_said(self, row: Mapping[str, float]) -> str:
        """What the drive says itself that is the one in fault, or its name; of several the first."""
        inside = {Fault.EMERGENCY, Fault.DRIVE_FAULT}
        for motor, drive in zip(self.motors, self.ready["drives"], strict=True):
            if not inside.isdisjoint(faults.of(motor.of(row)["faults"])):
                explain = family_of(motor.live.rig.drive).explain
                said = str(explain(motor.emergency) if motor.emergency else drive)
                return f"{motor.name}: {said}" if motor.name else said
        return str(self.ready["drive"])

    @property
    def still(self) -> float:
        """For how long the loop has done no cycle, as far as `last` has looked [s]."""
        return (self.clock.now() - self._came) / SECOND

    def ask(self, request: Request) -> None:
        """Ask the supervisor for something. A stop comes before whatever else is asked for in the same cycle."""
        self.beat()
        self.block.ask(request)

    @property
    def stop_waits(self) -> bool:
        """True if a stop was asked for that the loop has not taken yet."""
        return self.block.stop_waits

    @property
    def gains(self) -> dict[str, float]:
        """Gain → its value in force, as far as `last` has looked; those of `Law.live` may be changed, `set_gain`.

        With several motors the names begin with the motor': ``knee.feedback_gain``.
        """
        row, found = self._last, dict[str, float]()
        for motor in self.motors:
            own = motor.gains(None if row is None else motor.values(row))
            found |= {f"{motor.name}.{name}" if motor.name else name: value for name, value in own.items()}
        return found

    def set_gain(self, name: str, value: float) -> None:
        """Change a gain while the law runs: checked first, gone over to in half a second, and in force on return.

        The gains wanted are checked on this rig as `bowden.check` does it, in a process that gives way to the run: it
        takes two seconds, and up to a minute on a busy computer. Meanwhile the run goes on as it is. Each moment of it
        is a sign of life, as of `wait`.

        Args:
            name: of a gain that the law declares live, `Law.live`; with several motors ``MOTOR.GAIN``.
            value: in the law's own unit, as in rig.toml.

        Raises:
            ParameterError: the law has no such gain, it is not live, or the value is outside its limits.
            SafetyError: the gains do not hold, with the figure, or no session is live, or it is latched by a fault.
        """
        check = GainCheck(self.with_gain(name, value))
        try:
            looks = 0
            while not check.done:
                self._look_on()
                looks += 1
                if looks == round(_ANSWER_WITHIN / _LOOK):
                    self._tell(f"{name} = {value:g} is still being checked on a model; the run goes on as it is")
            check.require()
        finally:
            check.close()
        self.ask_gain(name, value)
        until = self.clock.now() + round((RAMP + _TAKEN_WITHIN) * SECOND)
        while self.gains[name] != value:
            self._look_on()
            if self.clock.now() > until:
                raise SafetyError(f"the loop has not taken {name} = {value:g}", do="see bowden log info of its log")

    def _look_on(self) -> None:
        self._require_live()
        self.last()
        self.wait(_LOOK)

    def with_gain(self, name: str, value: float) -> Rig:
        """The run's rig with the gains in force and another value of this one, to be checked before it is asked for.

        Raises:
            ParameterError: the law has no such gain, it is not live, or the value is outside its limits.
            SafetyError: no session is live, it is latched by a fault, or another change goes on.
        """
        motor, _ = self._require_gain(name, value)
        rig = motor.live.logged
        for one, number in {**self._changed, name: float(value)}.items():
            owner, gain = self._gain(one)
            rig = rig.with_gain(gain, number) if owner is motor else rig
        return rig

    def _gain(self, name: str) -> tuple[SessionMotor, str]:
        """The motor whose gain it is, and its name there."""
        if not isinstance(name, str):
            raise ParameterError(f"the gain's name is {format_value(name)}", expected="text", do="name a gain")
        if not self.live.several:
            return self.motors[0], name
        first, _, rest = name.partition(".")
        for motor in self.motors:
            if motor.name == first:
                return motor, rest
        do = f"name the motor first, such as {self.motors[0].name}.{name}"
        raise ParameterError(f"no motor has a gain {format_value(name)}", expected=near(first, self.live.names), do=do)

    def _require_gain(self, name: str, value: float) -> tuple[SessionMotor, str]:
        motor, own = self.require_value(name, value)
        self._require_live()
        if self.mode == Mode.LATCHED:
            raise SafetyError(
                f"no law runs that could take {name} = {value:g}: {self.outcome}",
                do="acknowledge it and arm again, or change the gain in its settings",
            )
        if self.changing:
            raise SafetyError("another change of gains goes on", do=f"wait until it is in force, {RAMP:g} s")
        return motor, own

    def require_value(self, name: str, value: float) -> tuple[SessionMotor, str]:
        """The motor whose live gain it is, and its name there, whether a change could be made now or not.

        Raises:
            ParameterError: the law has no such gain, it is not live, or the value is outside its limits.
        """
        motor, name = self._gain(name)
        law = motor.live.law
        if name not in law.live:
            if name not in law.numbers:
                law.with_gains(**{name: 0.0})  # which refuses it, and says what is like it
            listed = ", ".join(law.live) or "no gain of it"
            raise ParameterError(
                f"gain {name} of law {law.name!r} cannot be changed while it runs",
                expected=f"one of those that the law declares live: {listed}",
                do="end the run, change it, and start again",
            )
        if isinstance(value, bool) or not isinstance(value, Real):
            raise ParameterError(
                f"gain {name} of law {law.name!r} is {format_value(value)}", expected="a number", do="give one"
            )
        low, high = law.limits[name]
        if not low <= value <= high:  # nor is what is no number
            raise ParameterError(
                f"gain {name} of law {law.name!r} is {format_value(value)}",
                expected=f"a number from {low:g} to {high:g}",
                do="correct it",
            )
        return motor, name

    def ask_gain(self, name: str, value: float) -> None:
        """Ask the loop for another value of a live gain, whose check holds; nothing is waited for.

        Raises:
            ParameterError: as `with_gain`.
            SafetyError: as `with_gain`.
        """
        motor, gain = self._require_gain(name, value)
        self.beat()
        self._changed[name] = float(value)
        before = sum(len(one.live.law.live) for one in self.motors[: self.motors.index(motor)])
        self.block.ask_gain(before + motor.live.law.live.index(gain), float(value))

    @property
    def changing(self) -> bool:
        """True if a change of gains that was asked for is not in force yet, as far as `last` has looked."""
        now = self.gains
        return any(now[name] != value for name, value in self._changed.items())

    def _require_live(self) -> None:
        if not hasattr(self, "ready") or not self.running or self.ended is not None or self.block.quitting:
            raise SafetyError("no session is live", expected="one that goes on", do="change the gain in its settings")

    def remember(self, row: dict[str, float] | None, *, surely: bool = False) -> None:
        """Keep how warm the motor is in a row, for the next run; `surely` waits for the disk. Any thread may ask."""
        if row is not None and self._remembers:
            with self._keeping:
                why = [motor.remember(motor.of(row), surely=surely) for motor in self.motors]
                self._not_kept = next(filter(None, why), "")

    def complete(self) -> bool:
        """Arm, run the law over the rig's whole reference, and come back when that has ended.

        Returns:
            Whether it came to its end; if not, `outcome` says what stopped it.

        Raises:
            SafetyError: the supervisor or the preflight did not let it run.
            DriveError: the loop's process has ended.
        """
        ran = self._steps is not None
        for going in self._stepped():
            ran = ran or self.mode == Mode.RUNNING
            if not going:
                return ran and self.mode == Mode.STOPPED
        raise AssertionError  # it ends with what is not going

    def start(self) -> None:
        """Arm and run, and come back when the law leads; `complete` sees the run through from there.

        Raises:
            SafetyError: the supervisor or the preflight did not let it run, or it ended before the law led.
            DriveError: the loop's process has ended.
        """
        for going in self._stepped():
            if not going:
                raise SafetyError(
                    f"the run ended before the law led: {self.outcome}", do="correct the cause, try again"
                )
            row = self._last
            if self.mode == Mode.RUNNING and row is not None and row[AT["source"]] == TargetSource.LAW:
                return

    def _stepped(self) -> Iterator[bool]:
        """Arm, run and look on, one look after the other: whether it goes on; False at last."""
        self._steps = automatic(self, self.block.stops) if self._steps is None else self._steps
        while self.running:
            row = self.last()
            if row is not None and next(self._steps, None) is None:
                self._steps = None
                yield False
                return
            yield True
            if self.still > STANDS_STILL:
                break
            self.wait(_LOOK)
        how = f"has not answered for {self.still:.0f} s" if self.running else "has ended"
        raise DriveError(f"the live loop {how}", do="begin another run")

    def trace(self) -> Trace:
        """The record of the run, from its log, once it has ended.

        Raises:
            LogError: nothing was recorded, the run goes on, or the log is not there any more.
        """
        if self.running:
            raise LogError(f"the run goes on, and {self.log} is not closed", do="leave the with block first")
        self.require_log()
        return read(self.log).trace()

    def require_log(self) -> None:
        """The log is still where it was made, once the run has ended.

        Raises:
            LogError: it was removed, replaced or moved during the run.
        """
        if self.log_lost:
            raise LogError(self.log_lost)

    def __repr__(self) -> str:
        """One screen: law, rig, drive, where it stands, and the log."""
        ready = getattr(self, "ready", None)
        standing = "" if self.mode is None else self.mode.name.lower()
        rows = [
            ("rig", (self.live.whole or self.live.rig).hash),
            ("motors", ", ".join(self.live.names)),
            ("drive", "" if ready is None else str(ready["drive"])),
            ("mode", standing or "not begun"),
            ("outcome", self.outcome if self.ended is not None or self.error else ""),
            ("channel", self.channel if self.on_twin and ready is not None and self.running else ""),
            ("log", str(self.log)),
            ("ends", self.live.losses()),
        ]
        return shown.screen(f"Run of {self.live.law.name}", rows)

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        until = self.clock.now() + round(seconds * SECOND)
        while (left := until - self.clock.now()) > 0:
            self.beat()
            self.clock.sleep_until(self.clock.now() + min(left, round(_BEAT * SECOND)))

    def __exit__(self, *_: object) -> None:
        """End the run: release, power off, log closed, memory given back."""
        if hasattr(self, "block"):
            self.end()
        if hasattr(self, "_loop"):
            for _look in range(round(_END / _BEAT)):
                self.beat()  # a release without a sign of life would end as one whose operator is gone
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._loop.wait(_BEAT)
                    break
            else:
                self._loop.kill()
                self.error = f"the loop's process did not end within {_END:g} s and was killed"
            self.remember(self.last(), surely=True)
            if self._not_kept:
                note(f"the motor's temperature cannot be stored ({self._not_kept}); let it cool before the next run")
            self._await_end()
        if self.emg_process is not None:
            self.emg_process.close()
        if hasattr(self, "_recorder"):
            self._end_recorder()
        for process in self._processes:
            child.end(process)
        self._ring.unlink(missing_ok=True)
        self._block.unlink(missing_ok=True)
        try:  # last: a disk that takes nothing holds up neither the reader of EMG nor the recorder
            self._latching.submit(int).result(_END)
        except TimeoutError:
            what = f"the fault of this run is not on the disk after {_END:g} s"
            note(f"{what}; the next run may not ask for an acknowledgement")
        self._latching.shutdown(wait=False)


def _listed(row: Mapping[str, float], session: Session) -> str:
    """The faults of a row with what to do, of several motors with whose they are."""
    recorder = row.get("recorder", RecorderState.OK)
    return "; ".join(
        f"{f'{one.motor}: ' if one.motor else ''}{fault.meaning}: "
        f"{remedy_of(fault, twin=session.on_twin, recorder=recorder, emg=row.get('emg.loss'))}"
        for one in session.faults(row)
        for fault in sorted(one.came, key=lambda fault: -fault.then)
    )


def automatic(session: Session, stops: int = 0) -> Iterator[bool]:
    """Arm, run and wait for the end, one look at a time; ends when the run has ended, or does not begin.

    Args:
        session: the run.
        stops: `ControlBlock.stops` at its beginning: after another stop nothing is armed or run.

    Raises:
        SafetyError: what speaks against arming does not go.
    """
    begun, passed, announced, asked = None, None, False, False
    for request, wanted in ((Request.ARM, Mode.PREFLIGHT), (Request.RUN, Mode.RUNNING)):
        while True:
            row = session.last()
            assert row is not None
            begun = row["time"] if begun is None else begun
            if request == Request.RUN and row["mode"] == Mode.PREFLIGHT and row["preflight"] == 0.0:
                yield True
                continue
            if row["mode"] == wanted:
                break
            if request == Request.RUN and row["mode"] == Mode.PREFLIGHT:
                passed = row["time"] if passed is None else passed
                if row["faults"] and row["time"] - passed > _READINGS_WITHIN:
                    note(f"the preflight has passed, and the run does not begin: {_listed(row, session)}")
                    return
            if not asked and row["mode"] == Mode.LATCHED:
                listed = _listed(row, session)
                last = "the last run ended in a fault that has not been acknowledged"
                what = last if session.began_latched else "the supervisor has latched a fault before this run was armed"
                raise SafetyError(
                    f"{what}: {listed or 'which is not known'}",
                    do="correct the cause, and acknowledge it with k in a run without --auto",
                )
            if row["mode"] >= Mode.RELEASING or (request == Request.RUN and row["mode"] == Mode.STOPPED):
                return
            if session.block.stops != stops:
                return
            waited = row["time"] - begun
            if row["faults"] and row["mode"] == Mode.STOPPED and waited > _READINGS_WITHIN:
                found = list(faults.of(row["faults"]))
                listed = _listed(row, session)
                if found == [Fault.LATE]:
                    late = 1e3 * max(row["lateness"], row["supervisor.timers.late"])
                    listed = f"this computer is too busy, cycles come {late:.0f} ms late: {Fault.LATE.remedy}"
                if found != [Fault.LATE] or waited > _LATE_PATIENCE:
                    do = "with k, in a run without --auto" if Fault.DRIVE_FAULT in found else ""
                    raise SafetyError(f"the supervisor does not arm {session.ready['drive']}: {listed}", do=do)
                if not announced:
                    note(f"not armed yet, {listed}; waiting, for {_LATE_PATIENCE:g} s at most")
                announced = True
            session.block.ask(request, stops)
            asked = True
            yield True
    while (row := session.last()) is not None and row["mode"] in (Mode.RUNNING, Mode.BRIDGING, Mode.RELEASING):
        yield True


@contextlib.contextmanager
def prepared_loop() -> Iterator["subprocess.Popen[str]"]:
    """A loop's process that waits for its rig and has imported what every run needs; it ends with the block."""
    process = child.started("bowden.live.loop_process")
    try:
        yield process
    finally:
        process.kill()
        child.end(process)
