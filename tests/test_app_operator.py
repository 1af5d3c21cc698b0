"""What the operator sees and how a run is ended, without a run: signals, `--auto`, the screen, the motor's warmth."""

import contextlib
import io
import math
import os
import pwd
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from bowden.control import LAWS
from bowden.core.clock import boot_seconds
from bowden.core.errors import SafetyError
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.drives.emergencies import emergency_text
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import TorqueLeft, torque_left
from bowden.hardware.realtime import Grant
from bowden.live import drive_memory, operator, stops
from bowden.live.figures import Damage, EndedRun, Lateness, RunMotor, RunStop, TimedText
from bowden.live.mcap_read import Recording
from bowden.live.preflight import Reason
from bowden.live.ring import RecorderState
from bowden.live.row import columns
from bowden.live.screen import picture
from bowden.live.session import automatic
from bowden.live.stops import Stop, split_root_causes
from bowden.live.twin_process import PATIENCE, relax_twin_limits
from bowden.models.drive.thermal import Thermal, cold
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Request
from bowden.views.run import print_summary
from support.blank import blank
from support.command import Command

DRIVE, LIMITS = DriveParameters(), Limits()
WARM = {"supervisor.heat.winding": 80.0, "supervisor.heat.housing": 60.0, "supervisor.heat.i2t": 12.0}


def row(**values: float) -> dict[str, float]:
    """A row in which all is zero but what is given; ``_`` in a name is as it stands."""
    return {**dict.fromkeys(columns(LAWS["adaptive"]), 0.0), **values}


def faults_of(row: dict[str, float], came: dict[Fault, float]) -> list[Stop]:
    """The faults of a row as a session with one motor has them."""
    there = {fault: came.get(fault, row["time"]) for fault in of(row["faults"])}
    return [Stop.of("", there)] if there else []


@dataclass
class FakeSession:
    """Rows that come one a look, the last of them for ever; what was asked for."""

    rows: list[dict[str, float]]
    asked: list[Request] = field(default_factory=list)
    seen: int = 0
    ready: dict[str, Any] = field(
        default_factory=lambda: {"grants": [], "drive": "EPOS4, node 1; in fault, 0x8130: heartbeat lost"}
    )

    beats: int = 0
    stops: int = 0
    stop_waits: bool = False
    ended: bool = False
    running: bool = True
    began_latched: bool = False
    on_twin: bool = False
    still: float = 0.0

    def beat(self) -> None:
        self.beats += 1

    def end(self) -> None:
        self.ended = True

    def last(self) -> dict[str, float]:
        self.seen += 1
        return self.rows[min(self.seen, len(self.rows)) - 1]

    @property
    def block(self) -> "FakeSession":
        return self

    def ask(self, request: Request, stops: int | None = None) -> None:
        self.asked.append(request)

    def judged(self, row: dict[str, float]) -> list[dict[str, float]]:
        return [row]

    def faults(self, row: dict[str, float]) -> list[Stop]:
        return faults_of(row, {})

    def remember(self, row: dict[str, float] | None) -> None:
        pass

    def wait(self, seconds: float) -> None:
        pass


def test_what_the_system_does_not_grant_is_said_with_its_remedy(capsys: pytest.CaptureFixture[str]) -> None:
    refused = Grant("priority 80", False, "is refused", "ulimit -r 80")
    operator._tell_grants(SimpleNamespace(ready={"grants": [asdict(refused)]}))  # type: ignore[arg-type]
    assert "priority 80 is refused; ulimit -r 80" in capsys.readouterr().err


def test_a_loop_that_stands_still_is_not_waited_for(capsys: pytest.CaptureFixture[str]) -> None:
    session: Any = FakeSession([row()], still=6.0)
    operator.operate(session, operator.Ending(), auto=True, quiet=True)
    assert session.ended
    assert "the loop has not answered for 6 s" in capsys.readouterr().err


def test_whoever_gives_the_sign_of_life_is_woken_before_what_computes_where_that_is_allowed() -> None:
    seen: list[int] = []

    class Looked(FakeSession):
        def beat(self) -> None:
            seen.append(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)

    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
        allowed = os.SCHED_RR
    except OSError:
        allowed = os.SCHED_OTHER
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    session: Any = Looked([row(mode=Mode.STOPPED), row(mode=Mode.STOPPED), row(mode=Mode.LATCHED)])
    operator.operate(session, operator.Ending(), auto=True, quiet=True)
    assert set(seen) == {allowed}
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_a_disk_that_is_slow_holds_up_no_sign_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, disk = threading.Event(), threading.Event()

    class Slow(FakeSession):
        def remember(self, row: dict[str, float] | None) -> None:
            asked.set()
            assert disk.wait(60.0)

        def beat(self) -> None:
            super().beat()
            if self.beats == 500:  # while the disk takes nothing
                assert asked.wait(60.0)
                disk.set()

    monkeypatch.setattr(operator, "_REMEMBER", 10)
    session: Any = Slow([row(mode=Mode.STOPPED)] * 1200 + [row(mode=Mode.PREFLIGHT), row(mode=Mode.LATCHED)])
    operator.operate(session, operator.Ending(), auto=True, quiet=True)
    assert session.beats > 500


def test_a_terminal_that_takes_no_more_holds_up_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hung connection, Ctrl-S: the picture waits, and nothing else does."""
    master, slave = os.openpty()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("rich._console", None)
    monkeypatch.setattr("bowden.live.screen.picture", lambda *_: "\n".join(["x" * 70] * 20))
    monkeypatch.setattr(operator, "_CLEARED", 0.05)
    session, patience, threads = FakeSession([row()]), time.monotonic() + 60.0, threading.active_count()

    def until(what: Callable[[], Any]) -> None:
        while not what():
            assert time.monotonic() < patience
            time.sleep(0.01)

    with contextlib.suppress(OSError), open(slave, closefd=False) as keys, open(slave, "w", closefd=False) as screen:
        monkeypatch.setattr("sys.stdin", keys)
        monkeypatch.setattr("sys.stdout", screen)
        given: Any = session
        seen_through = threading.Thread(
            target=operator.operate, args=(given, operator.Ending()), kwargs={"auto": False, "quiet": False}
        )
        seen_through.start()
        until(lambda: not select.select([], [slave], [], 0.0)[1])
        beats = session.beats
        os.write(master, b"s")
        until(lambda: Request.STOP in session.asked)
        until(lambda: session.beats > beats + 2)
        os.write(master, b"q")
        seen_through.join(60.0)
        assert not seen_through.is_alive()
        assert session.ended, "before the terminal is put in order"
        os.close(master)
        until(lambda: threading.active_count() == threads)
    os.close(slave)


def test_of_keys_that_wait_together_a_stop_is_taken_and_nothing_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Typed at once, pasted, or held up by a connection: looked at together, and not one a round."""
    master, slave = os.openpty()
    rounds: dict[str, int] = {}

    class Typed(FakeSession):
        def beat(self) -> None:
            super().beat()
            if self.beats == self.typed + 1:  # the terminal has been set up, or the last burst was answered
                os.write(master, self.bursts[0].encode())

        def ask(self, request: Request, stops: int | None = None) -> None:
            super().ask(request, stops)
            rounds[self.bursts.pop(0)] = self.beats - self.typed
            self.typed = self.beats

    bursts = {" k": Request.STOP, "ks": Request.STOP, "arka rr": Request.STOP, "ar": Request.RUN}
    bursts |= {"x" * 4000 + "s": Request.STOP, "q": Request.NONE}
    session: Any = Typed([row()])
    session.typed, session.bursts = 0, list(bursts)
    with open(slave) as keys:
        monkeypatch.setattr("sys.stdin", keys)
        operator.operate(session, operator.Ending(), auto=False, quiet=True)
    os.close(master)
    assert session.asked == list(bursts.values())[:-1]
    assert max(rounds.values()) < 50, rounds


def test_nothing_is_armed_without_keys_after_a_stop() -> None:
    session = FakeSession([row()])
    steps = automatic(session, session.stops)  # type: ignore[arg-type]
    assert next(steps)
    session.stops = 1
    assert list(steps) == []
    assert session.asked == [Request.ARM]


def test_a_signal_interrupts_once_while_a_run_is_put_together_and_is_noted_afterwards() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with operator.ending_signals() as ending:
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
            if number == signal.SIGTERM:
                with pytest.raises(KeyboardInterrupt):
                    os.kill(os.getpid(), number)
            else:
                os.kill(os.getpid(), number)
        assert ending.asked
    with operator.ending_signals() as ending:
        told: list[int] = []
        ending.ends(lambda: told.append(1))
        assert not ending.asked
        os.kill(os.getpid(), signal.SIGHUP)
        assert ending.asked
        os.kill(os.getpid(), signal.SIGTERM)
        assert told == [1, 1], "the loop is told by the signal itself"
    assert signal.getsignal(signal.SIGTERM) is before


def test_readings_are_given_time_to_come_in_however_long_the_loop_took_to_begin() -> None:
    missing = {"mode": float(Mode.STOPPED), "faults": 2.0**Fault.MOTOR_STALE}
    late = [row(time=20.0 + 0.05 * k, **missing) for k in range(40)]
    session = FakeSession([*late, row(time=22.0), row(time=22.1, mode=float(Mode.PREFLIGHT))])
    steps = automatic(session)  # type: ignore[arg-type]
    for _ in range(50):
        next(steps)
    assert Request.ARM in session.asked
    session = FakeSession([row(time=20.0 + 0.05 * k, **missing) for k in range(100)])
    with pytest.raises(SafetyError, match=r"does not arm EPOS4, node 1; .*: motor angle is late"):
        for _ in automatic(session):  # type: ignore[arg-type]
            pass


def test_a_loop_that_is_late_now_and_then_is_waited_for_and_that_is_said_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    sums = {"supervisor.timers.late": 0.023}
    late = [row(time=0.05 * k, faults=2.0**Fault.LATE, **sums) for k in range(400)]
    session = FakeSession([*late, row(time=20.1, mode=float(Mode.PREFLIGHT))])
    steps = automatic(session)  # type: ignore[arg-type]
    for _ in range(405):
        next(steps)
    assert session.asked.count(Request.ARM) >= 400
    said = capsys.readouterr().err
    assert said.startswith("bowden: note: not armed yet, this computer is too busy, cycles come 23 ms late: ")
    assert said.count("\n") == 1
    told = ("this computer is too busy", 0.0, 30.0), ("loop too late", 2.0**Fault.MOTOR_STALE, 3.0)
    for what, and_more, seconds in told:
        session = FakeSession([row(time=0.05 * k, faults=2.0**Fault.LATE + and_more) for k in range(1000)])
        with pytest.raises(SafetyError, match=rf"does not arm EPOS4, node 1; .*{what}"):
            for _ in automatic(session):  # type: ignore[arg-type]
                pass
        assert session.seen == pytest.approx(seconds / 0.05, abs=3)


def test_what_keeps_a_run_from_beginning_after_its_preflight_is_not_waited_for_with_power_on(
    capsys: pytest.CaptureFixture[str],
) -> None:
    stopped, passed = row(mode=float(Mode.STOPPED)), {"mode": float(Mode.PREFLIGHT), "preflight": 1.0}
    full = [row(time=0.05 * k, faults=2.0**Fault.RECORDER_LOST, **passed) for k in range(1000)]
    session = FakeSession([stopped, *full])
    for _ in automatic(session):  # type: ignore[arg-type]
        pass
    assert session.seen == pytest.approx(3.0 / 0.05, abs=4)
    assert session.asked.count(Request.RUN) > 10
    assert "has passed, and the run does not begin: nothing is recorded: make" in capsys.readouterr().err


def shown(
    values: dict[str, float], emergency: int = 0, log: str = "run.mcap", came: dict[Fault, float] | None = None
) -> str:
    ready = {"drive": "EPOS4, node 1"}
    session: Any = SimpleNamespace(
        live=SimpleNamespace(rig=SimpleNamespace(drive=DRIVE), several=()),
        motors=[SimpleNamespace(name="", of=dict)],
        faults=lambda row: faults_of(row, came or {}),
        drive_said=lambda row: emergency_text(emergency) if emergency else ready["drive"],
        recorder=int(RecorderState.OK),
        log=Path(log),
        ready=ready,
        emg_process=None,
        on_twin=False,
    )
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(picture(session, values, auto=False))
    return console.export_text()


def test_the_screen_tells_what_a_fault_refers_to() -> None:
    faults = 2.0**Fault.EMERGENCY + 2.0**Fault.PREFLIGHT_FAILED
    values = row(mode=float(Mode.LATCHED), faults=faults, preflight_reason=float(Reason.JOINT_STILL))
    text = shown(values, emergency=0x4210)
    assert "read the text of the code" in text
    assert "0x4210: " in text
    assert "the joint does not follow the motor" in text
    assert "k to acknowledge" in text
    assert "0x4210" not in shown(row(), emergency=0x4210)
    found = shown(row(faults=2.0**Fault.DRIVE_FAULT))
    assert "k to reset the drive" in found
    assert "EPOS4, node 1" in found, "what bring-up says of a drive that is in fault already"
    assert "cannot be armed" in shown(row(faults=2.0**Fault.RECORDER_LOST))


def test_a_push_is_shown_only_while_it_makes_the_reference() -> None:
    heard = {"admittance.push.torque": 1.25, "admittance.estimate.doubt": 0.5}
    for source, told in (
        (TargetSource.HOLD, "–"),
        (TargetSource.MOTION, "–"),
        (TargetSource.LAW_BEGINS, "+1.25 N·m, in doubt by 0.50"),
        (TargetSource.LAW, "+1.25 N·m, in doubt by 0.50"),
    ):
        lines = shown(row(source=float(source), **heard)).splitlines()
        assert [line.split(maxsplit=1)[1].strip() for line in lines if line.startswith("push")] == [told]
    assert "not known" in shown(row(source=float(TargetSource.LAW), **(heard | {"admittance.push.torque": math.nan})))
    assert "push" not in shown(row(source=float(TargetSource.LAW)))


def test_the_summary_says_what_ended_the_run_and_what_its_log_lacks(capsys: pytest.CaptureFixture[str]) -> None:
    found = blank(
        EndedRun,
        **{"ended_well": False, "faults": ("drive in fault",), "remedies": ("read the error code",), "torque": "off"},
        **{"error": "the loop failed", "cycles": 100, "cycles_logged": 40, "log": Path("a.mcap"), "log_whole": False},
        emergencies=(TimedText(1.0, "0x4210: over-temperature of the power stage"),),
    )
    both = tuple(
        blank(RunMotor, name=name, law="bowden", seconds_led=0.0, faults=faulty)
        for name, faulty in (("hip", ("drive in fault",)), ("knee", ("another motor is off", "drive in fault")))
    )
    stop = RunStop(
        *(1.0, ("drive in fault",), ("read the error code",), ("knee: another motor is off",)), None, motor="hip"
    )
    of_two = {"motors": both, "stops": (stop,), "faults": ("drive in fault", "another motor is off")}
    print_summary(replace(found, **of_two, remedies=("read the error code", "correct it")))
    said = capsys.readouterr()
    assert "ended by a fault: knee: drive in fault; read the error code" in said.out
    assert said.out.count("another motor is off") == 1
    print_summary(found)
    said = capsys.readouterr()
    for line in ("ended by a fault: drive in fault; read", "emergency: 0x4210", "ended by an error: the loop failed"):
        assert line in said.out
    assert "bowden log recover a.mcap" in said.out
    assert "60 cycles of 100 are not in the log" in said.err
    assert "not closed properly" in said.err
    late = Lateness(1.0, 1.0, 1.0, 1.0, 1)
    print_summary(replace(found, cycles=None, lateness=late, run_time=late))
    said = capsys.readouterr()
    assert "40 cycles in the log" in said.out
    assert "None" not in said.out
    print_summary(replace(found, ended_well=True, seconds_led=0.04, cycles=40, log_whole=True))
    said = capsys.readouterr()
    assert "ended by a fault" not in said.out
    assert said.err == ""
    print_summary(replace(found, cycles_logged=0, log_lost="a.mcap was removed during the run"))
    said = capsys.readouterr()
    assert "a.mcap" not in said.out, "nothing is advised that finds no file"
    assert said.err.count("\n") == 1
    assert "100 cycles of 100 are not in the log, nor in these figures: a.mcap was removed" in said.err


@pytest.fixture
def state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "bowden"


def test_a_warm_motor_is_warm_after_a_restart_and_another_rigs_is_not(state: Path) -> None:
    drive_memory.keep_heat(DRIVE, WARM)
    again = drive_memory.read_heat(DRIVE, LIMITS)
    assert again.winding == pytest.approx(80.0, abs=2.0)
    assert again.housing == pytest.approx(60.0, abs=1.0)
    assert drive_memory.read_heat(DRIVE._replace(node_id=2), LIMITS) == cold(Thermal())
    assert drive_memory.read_heat(DRIVE._replace(channel="another"), LIMITS) == cold(Thermal())
    assert len(list(state.iterdir())) == 1


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", "null", '{"winding": 1}', '{"winding": NaN, "housing": 1, "i2t": 0, "unix_s": 0}', "\0", '"x"'],
)
def test_a_file_that_says_nothing_is_a_hot_motor_and_is_told(
    text: str, state: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert drive_memory.read_heat(DRIVE, LIMITS) == cold(Thermal())
    assert capsys.readouterr().err == "", "the first run"
    drive_memory.keep_heat(DRIVE, WARM)
    next(state.iterdir()).write_text(text)
    found = drive_memory.read_heat(DRIVE, LIMITS)
    assert (found.winding, found.housing) == (LIMITS.winding_limit, LIMITS.housing_limit)
    assert "it is assumed to be as hot as allowed" in capsys.readouterr().err


def test_nothing_is_colder_than_its_surroundings(state: Path) -> None:
    drive_memory.keep_heat(DRIVE, dict.fromkeys(WARM, -1000.0))
    assert drive_memory.read_heat(DRIVE, LIMITS) == cold(Thermal())


def test_a_motor_cools_by_the_time_that_this_computer_has_counted(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No clock that can be set has a say; of a computer that was started anew, the time since is what is certain."""
    drive_memory.keep_heat(DRIVE, WARM, surely=True)
    boot, now = boot_seconds()
    for again, passed, winding in ((boot, 0.0, 80.0), (boot, -1e3, 80.0), ("another", -now, 80.0)):
        monkeypatch.setattr(drive_memory, "boot_seconds", lambda found=(again, now + passed): found)
        assert drive_memory.read_heat(DRIVE, LIMITS).winding == pytest.approx(winding, abs=0.5)
    for again, at in ((boot, now + 1e4), ("another", 1e4)):
        monkeypatch.setattr(drive_memory, "boot_seconds", lambda found=(again, at): found)
        assert drive_memory.read_heat(DRIVE, LIMITS)[:] == pytest.approx(cold(Thermal())[:], abs=0.1)


def test_a_place_that_cannot_be_written_is_told(state: Path) -> None:
    state.write_text("a file where the folder should be")
    assert str(state) in drive_memory.keep_heat(DRIVE, WARM)


def test_who_has_no_home_begins_cold_and_is_not_stopped_by_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody(_: int) -> Any:
        raise KeyError("no such user")

    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    assert "home" in drive_memory.keep_heat(DRIVE, WARM)
    assert drive_memory.read_heat(DRIVE, LIMITS) == cold(Thermal())


def test_faults_are_told_in_the_order_of_time_and_consequences_as_such() -> None:
    came = {Fault.HEARTBEAT_LOST: 2.0, Fault.JOINT_FROZEN: 1.0}
    lines = shown(row(mode=float(Mode.LATCHED), faults=sum(2.0**fault for fault in came)), came=came).splitlines()
    assert lines[1].split()[0] == "fault"
    assert "joint angle does not change: " in lines[1]
    assert lines[2].split() == ["follows", "drive", "silent"]
    at_once = dict.fromkeys((Fault.MOTOR_JUMP, Fault.LATE, Fault.JOINT_OVER_TRAVEL), 1.0)
    assert split_root_causes(at_once) == ((*at_once,), ()), "no lateness moves a joint"
    lost = {Fault.EMG_LOST: 1.0, Fault.LATE: 1.3, Fault.HEARTBEAT_LOST: 1.3}
    found = (Fault.EMG_LOST, Fault.LATE), (Fault.HEARTBEAT_LOST,)
    assert split_root_causes(lost) == found, "electrodes, or this computer"
    del at_once[Fault.JOINT_OVER_TRAVEL]
    assert split_root_causes(at_once) == ((Fault.LATE,), (Fault.MOTOR_JUMP,)), "a loose plug is not looked for"


def log_of(*modes_and_faults: tuple[Mode, int, tuple[Fault, ...]], late: float = 0.0, alone: float = 0.0) -> Recording:
    """A log of 1 kHz with so many rows of a mode and its faults after one another."""
    parts = [[mode, float(sum(1 << fault for fault in there))] for mode, n, there in modes_and_faults for _ in range(n)]
    zeros = np.zeros(len(parts))
    time = np.arange(len(parts)) * 1e-3 + 40.465
    columns = (time, *np.array(parts).T, zeros, zeros + late, zeros + alone, zeros)
    about = (stops.NEEDED, ("1",) * len(stops.NEEDED), np.arange(len(parts)), np.column_stack(columns))
    return Recording({}, {}, *about, [], Damage(0, 0, 0))


def test_what_stopped_a_run_is_found_in_its_log_though_it_was_acknowledged() -> None:
    log = log_of(
        (Mode.RUNNING, 100, ()),
        (Mode.RELEASING, 50, (Fault.SATURATED,)),
        (Mode.LATCHED, 50, (Fault.SATURATED, Fault.DRIVE_DROPPED)),
        (Mode.STOPPED, 50, ()),
        (Mode.RUNNING, 50, ()),
        (Mode.RELEASING, 20, ()),
        (Mode.STOPPED, 20, ()),
    )
    (found,) = stops.run_stops(log, LIMITS._asdict(), twin=False)
    assert found.time_s == pytest.approx(0.1)
    assert (found.causes, found.consequences) == (
        ("drive at its limit",),
        ("drive switched off or restarted by itself",),
    )
    assert not stops.stops(log_of((Mode.LATCHED, 9, (Fault.LATE,)), (Mode.STOPPED, 9, ()))), "it was of the run before"


def test_a_busy_computer_is_said_with_its_figure_and_is_no_fault_of_the_rig() -> None:
    late = log_of((Mode.RUNNING, 99, ()), (Mode.LATCHED, 9, (Fault.LATE, Fault.MOTOR_STALE)), late=0.031)
    (found,) = stops.run_stops(late, LIMITS._asdict(), twin=False)
    line, beside = stops.lines(found)
    assert beside == f"at the same time: {Fault.MOTOR_STALE.meaning}; {Fault.MOTOR_STALE.remedy}"
    assert line.startswith("this computer is too busy: cycles came 31 ms late (20 ms are allowed, lateness_s of ")
    assert not stops.run_stops(late, {}, twin=True)[0].too_busy, "a log without limits says none"


@pytest.mark.parametrize("twin", [False, True])
def test_a_drive_that_falls_silent_is_blamed_and_no_computer_that_was_in_time(twin: bool) -> None:
    old, rest = (Fault.MOTOR_STALE, Fault.JOINT_STALE), (Mode.RUNNING, 99, ())
    silent = log_of(rest, (Mode.LATCHED, 9, old), (Mode.LATCHED, 9, (*old, Fault.HEARTBEAT_LOST, Fault.NOT_DISABLED)))
    first, *others = stops.lines(stops.run_stops(silent, LIMITS._asdict(), twin=twin)[0], twin=twin)
    assert first == f"drive silent; {stops.remedy_of(Fault.HEARTBEAT_LOST, twin=twin)}"
    assert others == ["as a consequence: motor angle is late, joint angle is late, drive keeps its torque"]
    deaf = log_of(rest, (Mode.LATCHED, 9, old), (Mode.LATCHED, 9, (*old, Fault.EMERGENCY)))
    joint = log_of(rest, (Mode.LATCHED, 9, old[1:]), (Mode.LATCHED, 9, (*old[1:], Fault.HEARTBEAT_LOST)))
    for log, causes in ((deaf, old), (joint, old[1:])):
        (found,) = stops.run_stops(log, LIMITS._asdict(), twin=twin)
        assert [*found.causes] == [fault.meaning for fault in causes]
        assert not any("too busy" in line for line in stops.lines(found, twin=twin))


def test_a_command_that_was_not_let_run_is_no_fault_of_the_rig() -> None:
    lost = log_of((Mode.RUNNING, 99, ()), (Mode.LATCHED, 9, (Fault.OPERATOR_LOST,)), alone=0.312)
    for twin in (False, True):
        (line,) = stops.lines(stops.run_stops(lost, LIMITS._asdict(), twin=twin)[0], twin=twin)
        assert "gave no sign of life for 312 ms (280 ms are allowed, operator_age_s of [limits])" in line
    wider = LIMITS._replace(operator_age=1.0)._asdict()
    assert not stops.run_stops(lost, wider, twin=True)[0].too_busy, "less than is allowed: it is something else"


@pytest.mark.parametrize("left", list(TorqueLeft))
def test_nobody_is_asked_to_stop_a_twin_by_hand(left: TorqueLeft) -> None:
    assert "press" not in torque_left(left, twin=True)
    assert ("press the emergency stop" in torque_left(left, twin=False)) == (left != TorqueLeft.OFF)
    for fault in Fault:
        said = stops.remedy_of(fault, twin=True)
        assert said
        assert "press" not in said
        assert stops.remedy_of(fault, twin=False) == fault.remedy


def test_a_computer_that_is_late_after_a_fault_hides_no_fault() -> None:
    log = log_of(
        (Mode.RUNNING, 99, ()),
        (Mode.LATCHED, 200, (Fault.DRIVE_FAULT,)),
        (Mode.LATCHED, 400, (Fault.DRIVE_FAULT, Fault.LATE)),
        (Mode.LATCHED, 500, (Fault.DRIVE_FAULT, Fault.LATE, Fault.HEARTBEAT_LOST)),
    )
    (found,) = stops.run_stops(log, LIMITS._asdict(), twin=True)
    assert (found.causes, found.consequences) == ((Fault.DRIVE_FAULT.meaning,), (Fault.LATE.meaning,))
    assert next(stops.lines(found)) == f"{Fault.DRIVE_FAULT.meaning}; {Fault.DRIVE_FAULT.remedy}"
    (found,) = stops.run_stops(
        log_of((Mode.RUNNING, 9, ()), (Mode.LATCHED, 9, (Fault.CLOCK,))), LIMITS._asdict(), twin=False
    )
    assert not found.too_busy, "no cycle was late"
    assert list(stops.lines(found)) == [f"{Fault.CLOCK.meaning}; {Fault.CLOCK.remedy}"]


@pytest.mark.parametrize(
    ("request_", "values", "said"),
    [
        (Request.RUN, {"mode": Mode.STOPPED}, "r does nothing now: it is not armed: press a first"),
        (Request.RUN, {"mode": Mode.PREFLIGHT}, "the preflight has not ended"),
        (Request.RUN, {"mode": Mode.PREFLIGHT, "preflight": 1.0}, ""),
        (Request.ARM, {"mode": Mode.STOPPED, "faults": 2.0**Fault.SLACK}, "a does nothing now: cable slack or torn"),
        (Request.ARM, {"mode": Mode.LATCHED}, "acknowledge the fault first, with k"),
        (Request.ACKNOWLEDGE, {"mode": Mode.STOPPED}, "no fault to acknowledge"),
        (Request.STOP, {"mode": Mode.STOPPED}, ""),
    ],
)
def test_a_key_that_does_nothing_is_answered(request_: Request, values: dict[str, float], said: str) -> None:
    told = operator.ignored(request_, [row(**values)])
    assert (said in told) if said else not told


@pytest.mark.parametrize("word", ["run", "measure"])
def test_a_rig_is_not_run_over_ssh_unless_somebody_stands_at_it(
    word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    """A connection that hangs does not stop a run, so a real drive needs its user's word; a twin needs none."""
    rig = tmp_path / "rig.toml"
    rig.write_text('[drive]\ninterface = "socketcan"\nchannel = "none0"\n')
    monkeypatch.setenv("SSH_CONNECTION", "192.0.2.1 50000 192.0.2.2 22")
    arguments = [word, str(rig), "--auto", "--out", str(tmp_path / "out")]
    assert "a connection that hangs does not stop the run" in command.refused(*arguments)
    assert "reached by ssh" not in command.refused(*arguments, "--attended")
    operator.refuse_over_ssh(Rig(), attended=False)


def test_a_twin_of_the_commands_own_may_answer_late_and_a_drive_may_not() -> None:
    rig = Rig()
    assert rig.supervisor_limits.reading_age == 2.0
    assert relax_twin_limits(rig).limits == rig.limits._replace(reading_age=20.0, operator_age=1.0), (
        "as late as the loop"
    )
    assert relax_twin_limits(rig.replace(sample_time=0.002)).limits.reading_age == 10.0
    strict = rig.replace(limits=rig.limits._replace(reading_age=3.0, operator_age=0.1))
    assert relax_twin_limits(strict).limits == strict.limits
    measured = relax_twin_limits(rig, measure=True).supervisor_limits
    assert measured.lateness + measured.bridge_time < measured.heartbeat_age <= PATIENCE
    assert (measured.reading_age, measured.operator_age) == (50.0, PATIENCE)
    assert relax_twin_limits(strict, measure=True).limits.reading_age == 3.0
