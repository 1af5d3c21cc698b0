"""What a killed operator leaves is removed by whoever comes next; what somebody still has is left alone."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from bowden.live import left_behind

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
