"""A latch outlives the processes of its run, until an operator acknowledges it."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import SafetyError
from bowden.hardware.drives.families.ak_mit import AkParameters
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.live import drive_memory
from bowden.live.preflight import Preflight
from bowden.live.row import AT
from bowden.live.script import Script
from bowden.live.session import Session, automatic
from bowden.live.session_motor import SessionMotor
from bowden.live.stops import Stop
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Request
from loop_rig import LoopRig, twin_bench
from support.simulated_drive import SimulatedDrive

REAL, TWIN = DriveParameters(interface="socketcan", channel="can0"), DriveParameters()
FAULTS = float(2**Fault.NOT_FOLLOWING + 2**Fault.SECOND_MASTER)


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def test_two_families_with_one_number_on_one_bus_have_latch_and_warmth_apart() -> None:
    other = AkParameters(interface="socketcan", channel="can0")
    assert other.node_id == REAL.node_id
    drive_memory.keep_latch(REAL, FAULTS)
    assert drive_memory.read_latch(other) is None
    drive_memory.keep_latch(other, float(2**Fault.SLACK))
    drive_memory.acknowledge(other)
    assert drive_memory.read_latch(REAL) == FAULTS
    assert drive_memory.file_of(REAL, "thermal") != drive_memory.file_of(other, "thermal")


def row(mode: Mode, faults: float = 0.0) -> np.ndarray:
    found = np.zeros(len(AT))
    found[AT["mode"]], found[AT["faults"]] = mode, faults
    return found


def session_on(drive: DriveParameters) -> Any:
    """What of a session keeps its latch."""
    live = SimpleNamespace(rig=SimpleNamespace(drive_parameters=drive))
    motor = SimpleNamespace(latched=None, _remembers=True, live=live, _at=AT)
    return SimpleNamespace(motor=motor, _remembers=True, live=live, _latching=ThreadPoolExecutor(1))


def see(session: Any, values: np.ndarray) -> None:
    """The session's motor sees a row."""
    SessionMotor._remember_latch(session.motor, values, session._latching)


def test_a_disk_that_takes_nothing_holds_up_no_sign_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    """A latch is kept by a thread of its own: whoever sees the run through gives the sign of life meanwhile."""
    takes = threading.Event()
    monkeypatch.setattr(os, "fsync", lambda handle: takes.wait(10.0))
    session = session_on(REAL)
    see(session, row(Mode.LATCHED, FAULTS))
    assert drive_memory.read_latch(REAL) is None, "not yet"
    takes.set()
    session._latching.shutdown()
    assert drive_memory.read_latch(REAL) == FAULTS


def test_a_disk_that_takes_nothing_holds_up_no_end(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    takes, ended = threading.Event(), threading.Event()
    monkeypatch.setattr(os, "fsync", lambda handle: takes.wait(10.0))
    monkeypatch.setattr("bowden.live.session._END", 0.05)
    session = session_on(REAL)
    see(session, row(Mode.LATCHED, FAULTS))
    session.emg_process, session._processes = SimpleNamespace(close=ended.set), []
    session._ring = session._block = tmp_path / "ring"
    Session.__exit__(session)
    assert ended.is_set()
    assert not takes.is_set()
    assert "is not on the disk after 0.05 s" in capsys.readouterr().err
    takes.set()


def test_it_is_there_from_the_latch_to_the_acknowledgement_whoever_ends_meanwhile() -> None:
    assert drive_memory.read_latch(REAL) is None
    session = session_on(REAL)
    for mode, kept in ((Mode.RUNNING, None), (Mode.LATCHED, FAULTS), (Mode.LATCHED, FAULTS), (Mode.STOPPED, None)):
        see(session, row(mode, FAULTS))
        session._latching.submit(int).result()
        assert drive_memory.read_latch(REAL) == kept
    drive_memory.keep_latch(REAL, FAULTS)  # as the loop's process does at its end
    assert drive_memory.read_latch(REAL._replace(channel="can1")) is None, "another drive"
    drive_memory.keep_latch(TWIN, FAULTS)
    assert drive_memory.read_latch(TWIN) is None, "a twin hurts nobody"


def test_what_cannot_be_read_is_a_latch(capsys: pytest.CaptureFixture[str]) -> None:
    drive_memory.keep_latch(REAL, FAULTS)
    path = drive_memory.file_of(REAL, "latched")
    path.write_text("{")
    assert drive_memory.read_latch(REAL) == 0.0
    assert "has to be acknowledged" in capsys.readouterr().err


def test_what_cannot_be_kept_is_told_and_leaves_nothing(
    state: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    drive_memory.keep_latch(REAL, FAULTS)
    assert "the fault of this run cannot be stored ([Errno 28] No space left" in capsys.readouterr().err
    assert not [path for path in state.rglob("*") if path.is_file()]


def test_a_run_that_begins_latched_is_armed_by_nothing_but_an_acknowledgement_first(tmp_path: Path) -> None:
    table = PeriodicMinimumJerk(0.0, 0.3, 2.0).sample(np.arange(300) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)

    def between(rig: LoopRig) -> None:
        if rig.sleeps == 100:
            rig.block.ask(Request.ACKNOWLEDGE)

    drive, arms = SimulatedDrive(twin_bench()), (10, 50, 200)
    rig = LoopRig(tmp_path, LAWS["adaptive"], Limits(), drive, script, between, arms=arms, quits=400, latched=FAULTS)
    ended, rows = rig.run()
    assert (rows["mode"][:100] == Mode.LATCHED).all()
    assert (rows["faults"][1:100] == FAULTS).all()
    assert not rows["power"][:200].any()
    assert (ended.mode, ended.faults) == (Mode.STOPPED, 0)
    assert rig.led > 0


def test_without_keys_a_run_that_begins_latched_is_refused_with_what_latched_it() -> None:
    latched = {name: float(value) for name, value in zip(AT, row(Mode.LATCHED, FAULTS), strict=True)}
    asked: list[Request] = []
    about = {"ready": {"drive": "x"}, "began_latched": True, "on_twin": False}
    came = dict.fromkeys(of(FAULTS), 0.0)
    found = [Stop(0.0, tuple(came), (), came)]
    session = SimpleNamespace(**about, last=lambda: latched, ask=asked.append, faults=lambda row: found)
    with pytest.raises(SafetyError, match="has not been acknowledged: motor does not follow its model"):
        list(automatic(session))
    session.began_latched = False
    with pytest.raises(SafetyError, match="latched a fault before this run was armed: motor does not follow its model"):
        list(automatic(session))
    assert not asked
