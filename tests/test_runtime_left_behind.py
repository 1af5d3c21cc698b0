"""What a killed operator leaves is removed by whoever comes next; what somebody still has is left alone."""

import contextlib
import mmap
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from bowden.core.clock import SECOND
from bowden.core.errors import DriveError, SafetyError
from bowden.hardware import shared_memory
from bowden.live import control_block, left_behind, loop_process
from bowden.live.live_run import live_run
from bowden.live.ring import create
from bowden.live.row import description
from bowden.models.drive.thermal import cold
from bowden.rig.rig import Rig

THIS = left_behind.name_of_this().split("-")[2]
HERE = THIS.partition("t")[0]
DEAD, ALIVE = f"4194303-{THIS}", f"{os.getpid()}-{THIS}"
LATER = f"{os.getpid()}-{HERE}t1"
"""The number of one that has ended, which another process has now."""
ELSEWHERE = f"4194303-{int(HERE) + 1}t1"
"""A process of a container that shares the memory."""


def test_only_what_nobody_has_any_more_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(left_behind, "FOLDER", tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    kept = [tmp_path / f"bowden-{who}-a1b2c3.{kind}" for who in (ALIVE, ELSEWHERE) for kind in ("ring", "block")]
    gone = [tmp_path / f"bowden-{who}-a1b2c3.{kind}" for who in (DEAD, LATER) for kind in ("ring", "block", "intent")]
    buses = {name: tmp_path / f"bowden-twin-{name}" for name in (f"{DEAD}-x", f"{DEAD}-y", f"{ELSEWHERE}-z", "z8")}
    for bus in buses.values():
        bus.mkdir()
    (buses[f"{DEAD}-x"] / "4194303-00.node").touch()
    (buses[f"{DEAD}-y"] / f"{os.getpid()}-00.node").touch()  # a loop that still lets its cable out
    for block in (*kept, *gone):
        block.touch()
    left_behind.sweep()
    assert sorted(tmp_path.iterdir()) == sorted([*kept, *list(buses.values())[1:]])


def test_an_operator_that_was_killed_is_gone_before_its_parent_has_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise what ends while a shell or a supervisor of services has not looked yet would leave its blocks."""
    monkeypatch.setattr(left_behind, "FOLDER", tmp_path)
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        block = tmp_path / f"bowden-{left_behind._owner(child.pid)}-a1b2c3.block"
        block.touch()
        left_behind.sweep()
        assert block.exists()
        child.kill()
        os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
        left_behind.sweep()
        assert not block.exists()


def test_a_process_of_a_run_clears_up_at_its_end_whatever_ended_it() -> None:
    left = left_behind.FOLDER / f"bowden-{DEAD}-a1b2c3.ring"
    left.touch()
    words = [sys.executable, "-P", "-m", "bowden.live.recorder", "nothing.ring", "nothing.mcap"]
    assert subprocess.run(words, capture_output=True).returncode == 2
    assert not left.exists()


class Slept:
    """A clock on which time passes only while somebody sleeps."""

    time = 0

    def now(self) -> int:
        return self.time

    def sleep_until(self, deadline: int) -> None:
        self.time = deadline


@pytest.mark.parametrize(
    ("owner", "held", "waited"),
    [
        (DEAD, 2.0, 2.0),  # in bring-up, or a release
        (DEAD, 1e9, left_behind.ENDS),
        (ALIVE, 2.0, 0.0),
        (ELSEWHERE, 2.0, 0.0),
        (DEAD, 0.0, 0.0),
    ],
    ids=["dead", "dead for good", "alive", "elsewhere", "dead and let go"],  # the owners hold numbers of processes
)
def test_a_loop_without_its_operator_is_waited_for_and_another_run_is_not(
    owner: str, held: float, waited: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(left_behind, "MAPS", f"{os.getpid()}/maps")  # others of this computer may be in its way
    clock, said = Slept(), list[str]()

    def claim() -> Callable[[], None]:
        if clock.time < held * SECOND:
            raise DriveError("the bus can0 (socketcan) has a host already", do="end the other run first")
        return lambda: None

    block = tmp_path / f"bowden-{owner}-a1b2c3.block"
    block.write_bytes(bytes(8))
    with block.open("r+b") as file, mmap.mmap(file.fileno(), 8):  # by this process, in place of the loop
        block.unlink()  # another one that ended has cleared up
        with contextlib.nullcontext() if held <= waited else pytest.raises(DriveError, match="has a host already"):
            left_behind.await_host(claim, said.append, clock)
    assert clock.time == pytest.approx(waited * SECOND, abs=0.1 * SECOND)
    assert len(said) == (waited > 0.0)
    assert all("has a host already" in note and "waiting up to 10 s" in note for note in said)


def test_a_loop_whose_operator_has_gone_brings_no_drive_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would claim the bus of the next run, which has found it free."""
    live, brought_up, closed = live_run(Rig()), list[str](), list[str]()
    drive = SimpleNamespace(bring_up=lambda: brought_up.append("up"), close=lambda: closed.append("closed"))
    monkeypatch.setattr("bowden.hardware.drives.of_rig.open_drive", lambda *given: drive)
    monkeypatch.setattr(signal, "signal", lambda number, handler: None)
    create(tmp_path / "ring", description(live.columns(), {}, 0, 0), 64)
    shared_memory.create(tmp_path / "block", control_block.WORDS)
    thermal = [cold(motor.limits.thermal) for motor in live.motors]
    given = {"emg": None, "start_ns": 0, "thermal": thermal, "latched": [None], "remembers": False}
    given |= {"ring": str(tmp_path / "ring"), "block": str(tmp_path / "block"), "operator": os.getpid()}
    with pytest.raises(SafetyError, match="operator's process has ended"):
        loop_process._cycle(live, given)
    assert (brought_up, closed) == ([], ["closed"])
