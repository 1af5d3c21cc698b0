"""What a killed operator leaves is removed by whoever comes next; what somebody still has is left alone."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from bowden.live import left_behind

DEAD, ALIVE = "4194303", "1"


def test_only_what_nobody_has_any_more_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(left_behind, "FOLDER", tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    blocks = [tmp_path / f"bowden-{pid}-a1b2c3.{kind}" for pid in (DEAD, ALIVE) for kind in ("ring", "block", "intent")]
    buses = {name: tmp_path / name for name in (f"bowden-twin-{DEAD}-x", f"bowden-twin-{DEAD}-y", "bowden-twin-z8")}
    for bus in buses.values():
        bus.mkdir()
    (buses[f"bowden-twin-{DEAD}-x"] / f"{DEAD}-00.node").touch()
    (buses[f"bowden-twin-{DEAD}-y"] / f"{ALIVE}-00.node").touch()  # a loop that still lets its cable out
    for block in blocks:
        block.touch()
    left_behind.sweep()
    assert sorted(tmp_path.iterdir()) == sorted([*blocks[3:], *list(buses.values())[1:]])


def test_a_process_of_a_run_clears_up_at_its_end_whatever_ended_it() -> None:
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    left = left_behind.FOLDER / f"bowden-{dead.stdout.strip()}-a1b2c3.ring"
    left.touch()
    words = [sys.executable, "-P", "-m", "bowden.live.recorder", "nothing.ring", "nothing.mcap"]
    assert subprocess.run(words, capture_output=True).returncode == 2
    assert not left.exists()
