"""The recorder in a process of its own: every row in the file, whatever becomes of the disk or of the recorder."""

import contextlib
import errno
import functools
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.stream_reader import StreamReader

from bowden.core.clock import MonotonicClock
from bowden.core.errors import LogError, OutputError
from bowden.live import child, recorder, summary
from bowden.live.mcap_read import read, recover
from bowden.live.provenance import rig_revision
from bowden.live.ring import Batch, Description, RecorderState, RingReader, RingWriter, create
from bowden.live.session import Session

pytestmark = pytest.mark.live

COLUMNS = ("time", "motor", "joint", "mode", "faults", *(f"law.x{i}" for i in range(20)))
ABOUT = Description(COLUMNS, ("s", *["rad"] * (len(COLUMNS) - 1)), {"seed": 1, "law": "made up"}, 10**18)
PATIENCE = 30.0
"""How long a process may take to answer on a busy machine [s]."""


def rows_of(first: int, end: int) -> np.ndarray:
    """The rows that these tests write: row k is known from k."""
    k = np.arange(first, end, dtype=float)[:, None]
    rows = np.sin(k + np.arange(len(COLUMNS)))
    rows[:, 0], rows[:, 3], rows[:, 4] = 1e-3 * k[:, 0], k[:, 0] > 500, 0.0
    return rows


class Rig:
    """A ring, its writer, and a recorder on it."""

    def __init__(self, folder: Path) -> None:
        self.ring, self.file = folder / "a.ring", folder / "a.mcap"
        create(self.ring, ABOUT)
        self.writer, self.written = RingWriter(self.ring), 0
        self.process: subprocess.Popen[bytes] | None = None

    def start(self, file: Path | None = None) -> None:
        command = [sys.executable, "-m", "bowden.live.recorder", str(self.ring), str(file or self.file)]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE)
        self.wait_for(lambda: self.state() != RecorderState.ABSENT or self.ended())

    def write(self, count: int) -> None:
        for row in rows_of(self.written, self.written + count):
            self.writer.write(row)
        self.written += count

    def write_for(self, duration: float) -> None:
        """At 1 kHz, in bursts where the machine is late."""
        begin, before = time.monotonic(), self.written
        while (since := time.monotonic() - begin) < duration:
            self.write(before + int(1e3 * since) - self.written)
            time.sleep(0.001)

    def state(self) -> int:
        return self.writer.recorder.state(time.monotonic_ns())

    def ended(self) -> bool:
        return self.process is not None and self.process.poll() is not None

    def wait_for(self, condition: Callable[[], bool]) -> None:
        begin = time.monotonic()
        while not condition():
            assert time.monotonic() - begin < PATIENCE
            time.sleep(0.005)

    def end(self) -> tuple[int, str]:
        assert self.process is not None
        _, said = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, said.decode()

    def kill(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.communicate()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    made = Rig(tmp_path)
    yield made
    made.kill()
    made.writer.close()  # ends one that is not this process's child, too


def test_every_row_of_three_seconds_is_in_the_file(rig: Rig) -> None:
    rig.write(700)  # before the recorder is there
    rig.start()
    rig.write_for(3.0)
    assert rig.state() == RecorderState.OK
    assert rig.writer.recorder.read().rows > 0
    rig.writer.close()
    assert rig.end() == (0, "")
    found = read(rig.file)
    assert found.whole
    assert found.numbers.tolist() == list(range(rig.written))
    assert found.rows.tobytes() == rows_of(0, rig.written).tobytes()
    assert [(event.number, event.text) for event in found.events] == [(0, "mode: 0"), (501, "mode: 0 → 1")]
    assert found.about["software"].startswith("bowden ")
    assert found.about["host"]
    assert found.closing == {"lost": "0", "dropped": "0", "given_up": "0", "rows": str(rig.written)}
    assert rig.state() == RecorderState.ENDED
    with rig.file.open("rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 2 * rig.written


@pytest.mark.parametrize("how", ["stop", "SIGTERM"])
def test_it_ends_when_told_though_the_loop_goes_on_and_not_by_ctrl_c(rig: Rig, how: str) -> None:
    rig.start()
    rig.wait_for(lambda: rig.writer.recorder.read().state == RecorderState.OK)
    assert rig.process is not None
    rig.process.send_signal(signal.SIGINT)
    rig.write(1000)
    time.sleep(0.1)
    assert not rig.ended()
    if how == "stop":
        rig.writer.recorder.stop()
    else:
        rig.process.send_signal(signal.SIGTERM)
    assert rig.end() == (0, "")
    assert len(read(rig.file).rows) == 1000


def test_it_ends_when_nobody_is_left(rig: Rig) -> None:
    recording = f"{sys.executable} -m bowden.live.recorder {rig.ring} {rig.file}"
    starter = subprocess.Popen(["sh", "-c", f"{recording} & read line"], stdin=subprocess.PIPE)
    rig.wait_for(lambda: rig.state() == RecorderState.OK)
    rig.write(500)
    starter.communicate(b"go\n", PATIENCE)
    rig.wait_for(lambda: rig.state() == RecorderState.ENDED)
    assert read(rig.file).whole
    assert len(read(rig.file).rows) == 500


def test_kills_at_random_moments_lose_a_fifth_of_a_second_at_most(tmp_path: Path) -> None:
    """Four of them; `make soak` does 500."""
    chance = random.Random(4)
    for i in range(4):
        folder = tmp_path / str(i)
        folder.mkdir()
        rig = Rig(folder)
        try:
            rig.start()
            rig.write_for(chance.uniform(0.05, 0.8))
            assert rig.process is not None
            os.kill(rig.process.pid, signal.SIGKILL)
            written = rig.written
            rig.process.wait()
        finally:
            rig.kill()
        saved = recover(rig.file, folder / "saved.mcap")
        assert saved.missing == 0
        assert written - saved.rows <= 200
        found = read(folder / "saved.mcap")
        assert found.whole
        assert found.rows.tobytes() == rows_of(0, saved.rows).tobytes()
        with (folder / "saved.mcap").open("rb") as file:
            assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) >= 2 * saved.rows


def test_a_stopped_recorder_is_seen_dead_and_catches_up(rig: Rig) -> None:
    rig.start()
    rig.write_for(0.3)
    assert rig.process is not None
    rig.process.send_signal(signal.SIGSTOP)
    rig.wait_for(lambda: rig.state() == RecorderState.DEAD)
    rig.write(20_000)
    rig.process.send_signal(signal.SIGCONT)
    rig.wait_for(lambda: rig.state() == RecorderState.OK)
    rig.writer.close()
    assert rig.end() == (0, "")
    assert read(rig.file).rows.tobytes() == rows_of(0, rig.written).tobytes()


def test_what_was_overwritten_before_it_came_is_counted_and_told(rig: Rig) -> None:
    rig.write(40_000)
    rig.start()
    rig.writer.close()
    assert rig.end() == (0, "")
    found = read(rig.file)
    assert found.missing == 40_000 - 32_768
    assert found.closing is not None
    assert found.closing["lost"] == "7232"
    assert found.events[0].text == "7232 rows lost before this one"


def test_a_small_disk_ends_in_a_whole_file(rig: Rig, tmp_path: Path) -> None:
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "none", str(folder)], capture_output=True)
    if mounted.returncode != 0:
        pytest.skip("no right to mount a small disk")
    try:
        rig.start(folder / "a.mcap")
        while rig.state() != RecorderState.FULL:
            rig.write_for(0.05)
            assert rig.written < 60_000
        rig.write(100)
        assert rig.state() == RecorderState.FULL
        rig.writer.close()
        assert rig.end() == (0, "")
        found = read(folder / "a.mcap")
        assert found.whole
        assert 0 < len(found.rows) < rig.written
        assert found.closing is not None
        assert int(found.closing["dropped"]) > 0
        assert found.missing >= int(found.closing["dropped"]), "what the disk did not take is missing"
        assert found.rows.tobytes() == rows_of(0, len(found.rows)).tobytes()
    finally:
        rig.kill()
        subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_run_whose_log_would_fill_the_disk_at_once_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    about = replace(ABOUT, settings={**ABOUT.settings, "sample_time": 1e-3})
    recorder.check_room(tmp_path / "a.mcap", about, 600.0)
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=1 << 20))
    with pytest.raises(OutputError, match=r"the disk has 1 MB left; expected \d+ MB, for 60 s of this run"):
        recorder.check_room(tmp_path / "a.mcap", about, 600.0)
    with pytest.raises(OutputError, match="for 20 s of this run"):
        recorder.check_room(tmp_path / "a.mcap", about, 5.0)


def test_the_revision_of_a_folder_runs_nothing_that_the_folder_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("GLOBAL", "SYSTEM"):
        monkeypatch.setenv(f"GIT_CONFIG_{name}", os.devnull)
    folder, ran = tmp_path / "rigs", tmp_path / "ran"
    folder.mkdir()

    def git(*words: str) -> None:
        who = ("-c", "user.name=a", "-c", "user.email=a@b")
        subprocess.run(["git", "-C", str(folder), *who, *words], check=True, capture_output=True)

    git("init")
    assert rig_revision(folder) == ""
    (folder / "rig.toml").write_text("")
    git("add", ".")
    git("commit", "-m", "a rig")
    clean = rig_revision(folder)
    assert len(clean) == 40
    os.utime(folder / "rig.toml", (1, 1))
    assert rig_revision(folder) == clean
    git("config", "filter.theirs.clean", f"touch {ran}; cat")
    git("config", "core.fsmonitor", f"touch {ran}")
    (folder / ".git" / "info" / "attributes").write_text("* filter=theirs")
    (folder / "rig.toml").write_text("x = 1\n")
    assert rig_revision(folder) == f"{clean}+"
    assert not ran.exists()
    git("describe", "--always", "--dirty")
    assert ran.exists(), "what is kept from running would have run"


@pytest.mark.parametrize(("name", "length"), [(b"rigs\xff", 40), (b"rigs\nmore", 0)])
def test_no_name_of_a_folder_and_no_full_disk_keeps_a_run_from_its_revision(
    name: bytes, length: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / os.fsdecode(name)
    folder.mkdir()
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    for words in (["init"], ["commit", "--allow-empty", "-m", "none"]):
        subprocess.run(["git", "-C", str(folder), *who, *words], check=True, capture_output=True)
    assert len(rig_revision(folder)) == length

    def full(**_: object) -> None:
        raise OSError(errno.ENOSPC, "no room")

    monkeypatch.setattr("tempfile.TemporaryDirectory", full)
    assert rig_revision(folder).endswith("+") == (length > 0)


def test_no_place_for_the_file_is_told_to_the_loop(rig: Rig, tmp_path: Path) -> None:
    rig.file.touch()
    rig.start()
    code, said = rig.end()
    assert (code, said.count("\n")) == (2, 1)
    assert "cannot record to" in said
    assert rig.writer.recorder.read().state == RecorderState.FULL
    assert recorder.main([str(tmp_path / "no.ring"), str(tmp_path / "b.mcap")]) == 2


def test_a_disk_without_room_for_a_beginning_is_told_and_keeps_no_empty_file(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(recorder, "LogFile", full)
    with pytest.raises(OutputError, match=r"cannot record to .*: No space left on device; choose another place"):
        recorder.record(rig.ring, rig.file)
    assert not rig.file.exists()
    assert rig.writer.recorder.read().state == RecorderState.FULL


def in_another_place(file: Path, how: str) -> None:
    """What somebody does to a log that is being written."""
    if how == "folder removed":
        shutil.rmtree(file.parent)
    elif how == "folder renamed":
        file.parent.rename(file.parent.with_name("elsewhere"))
    else:
        file.unlink()
    if how == "file replaced":
        file.write_bytes(b"another")


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("file removed", "removed during the run, which went on: what it held is lost"),
        ("file replaced", "replaced by another file during the run, which went on: what it held is lost"),
        ("folder removed", "removed during the run, which went on: what it held is lost"),
        ("folder renamed", "moved during the run, which went on: its log is .*elsewhere/a.mcap"),
    ],
)
def test_a_log_that_is_taken_away_is_told_while_it_is_written_and_at_the_end(
    how: str, said: str, rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "SYNC_EVERY", 0.05)
    file = tmp_path / "logs" / "a.mcap"
    file.parent.mkdir()
    with ThreadPoolExecutor(1) as own:
        recording = own.submit(recorder.record, rig.ring, file)
        rig.write(100)
        rig.wait_for(lambda: rig.writer.recorder.read().rows == 100)
        time.sleep(0.1)
        assert rig.state() == RecorderState.OK
        in_another_place(file, how)
        rig.wait_for(lambda: rig.state() == RecorderState.FILE_GONE)
        rig.write(100)
        rig.writer.close()
        with pytest.raises(OutputError, match=said) as lost:
            recording.result(PATIENCE)
    assert rig.writer.recorder.read().state == RecorderState.FILE_GONE
    session: Any = SimpleNamespace(rows=RingReader(rig.ring), logs=[file], log_lost=str(lost.value))
    left, why = summary._read(session, ("time", "mode"))
    assert (len(left["time"]), left.whole, why) == (0, False, str(lost.value))
    if how == "folder renamed":
        assert len(read(tmp_path / "elsewhere" / "a.mcap").rows) == 200
    session.log_lost = ""  # taken away after the recorder had ended
    assert re.match("cannot read|.* is no MCAP file", summary._read(session, ("time",))[1])


def test_a_session_says_what_became_of_its_log(rig: Rig, tmp_path: Path) -> None:
    rig.file = tmp_path / "logs" / "a.mcap"
    rig.file.parent.mkdir()
    process = child.started("bowden.live.recorder", str(rig.ring), str(rig.file))
    ended: Any = SimpleNamespace(rows=RingReader(rig.ring), _recorder=process, logs=[rig.file], log_lost="", ready={})
    rig.wait_for(lambda: rig.state() == RecorderState.OK)
    in_another_place(rig.file, "folder removed")
    Session._end_recorder(ended)
    child.end(process)
    assert ended.logs == [rig.file], "no second recorder is started for a file that somebody took away"
    with pytest.raises(LogError, match=r"a\.mcap was removed during the run, which went on"):
        Session.require_log(ended)


def test_a_log_that_comes_back_to_its_place_is_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder, "SYNC_EVERY", 0.02)
    with (file := tmp_path / "a.mcap").open("xb") as open_file:
        there = functools.partial(recorder._is_there, file, open_file.fileno())
        disk = recorder.Disk(open_file.fileno(), ABOUT, {}, MonotonicClock(), there=there)
        file.rename(tmp_path / "b.mcap")
        wait_for_state(disk, RecorderState.FILE_GONE)
        (tmp_path / "b.mcap").rename(file)
        wait_for_state(disk, RecorderState.OK)
        disk.finish(0)


class Unwilling:
    """A disk that can be told to be slow or full."""

    def __init__(self) -> None:
        self.full, self.wait = False, 0.0

    def write(self, handle: int, data: bytes) -> int:
        time.sleep(self.wait)
        if self.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return os.write(handle, data)


@contextlib.contextmanager
def on_a_disk(path: Path, unwilling: Unwilling) -> Iterator[recorder.Disk]:
    with path.open("xb") as file:
        yield recorder.Disk(file.fileno(), ABOUT, {}, MonotonicClock(), unwilling.write)


def wait_for_state(disk: recorder.Disk, state: RecorderState) -> None:
    begin = time.monotonic()
    while disk.report(time.monotonic_ns(), 0).state != state:
        assert time.monotonic() - begin < PATIENCE
        time.sleep(0.01)


def batch(first: int, end: int) -> Batch:
    return Batch(np.arange(first, end), rows_of(first, end))


def test_room_that_comes_again_is_used_and_nothing_is_lost(tmp_path: Path) -> None:
    unwilling = Unwilling()
    with on_a_disk(tmp_path / "a.mcap", unwilling) as disk:
        disk.put(batch(0, 500))
        wait_for_state(disk, RecorderState.OK)
        unwilling.full = True
        disk.put(batch(500, 1000))
        wait_for_state(disk, RecorderState.FULL)
        unwilling.full = False
        disk.put(batch(1000, 1200))
        wait_for_state(disk, RecorderState.OK)
        assert disk.finish(0) == 0
    assert read(tmp_path / "a.mcap").rows.tobytes() == rows_of(0, 1200).tobytes()


def test_a_slow_disk_is_told_and_delays_nobody(tmp_path: Path) -> None:
    unwilling = Unwilling()
    with on_a_disk(tmp_path / "a.mcap", unwilling) as disk:
        unwilling.wait = 1.5
        disk.put(batch(0, 100))
        wait_for_state(disk, RecorderState.SLOW)
        unwilling.wait = 0.0
        wait_for_state(disk, RecorderState.OK)
        assert disk.finish(0) == 0
    assert len(read(tmp_path / "a.mcap").rows) == 100


def test_rows_that_memory_does_not_hold_are_dropped_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "MOST_WAITING", 1000)
    unwilling = Unwilling()
    with on_a_disk(tmp_path / "a.mcap", unwilling) as disk:
        unwilling.full = True
        for first in range(0, 1500, 300):
            disk.put(batch(first, first + 300))
        wait_for_state(disk, RecorderState.FULL)
        assert disk.report(0, 0).dropped == 600
        unwilling.full = False
        disk.put(batch(1500, 1501))
        assert disk.finish(0) == 600
    found = read(tmp_path / "a.mcap")
    assert found.numbers.tolist() == [*range(900), 1500]
    assert "600 rows lost before this one" in [event.text for event in found.events]
