"""The rows of a campaign do not depend on who computes them: one process, two, a cluster that loses a worker, kills."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

STUDY = """
laws = ["adaptive"]
runs = 48
duration_s = 4.0

[vary]
"servo.natural_frequency_hz" = { log_uniform = [4, 20] }
"control.gains.feedback_gain" = { log_uniform = [5, 60] }
"""
COMMAND = [sys.executable, "-c", "from bowden.app.main import main; main()", "campaign", "study.toml"]
LONG = 120.0
"""Generous: a process that compiles on a busy machine [s]."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("campaign")
    (found / "study.toml").write_text(STUDY)
    return found


@pytest.fixture(scope="module")
def alone(folder: Path) -> str:
    """The digest of the rows that one process computes."""
    return computed(folder, "alone", "--workers", "1")["rows_sha256"]


def computed(folder: Path, out: str, *options: str, command: list[str] = COMMAND) -> dict[str, Any]:
    done = subprocess.run(
        [*command, "--out", out, "--json", *options], cwd=folder, capture_output=True, text=True, timeout=LONG
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def parts(folder: Path, out: str) -> int:
    return len(list((folder / out / "runs").glob("part-*.parquet")))


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LONG
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


PARENT, SESSION = 1, 3
"""Places in /proc/NUMBER/stat, behind the name."""


def living(place: int, number: int) -> list[int]:
    """Processes whose parent or session has that number, by /proc."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            fields = (process / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[place]) == number and fields[0] != "Z":
            found.append(int(process.name))
    return found


def alive(process: int) -> bool:
    try:
        return (Path("/proc") / str(process) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.long
def test_a_killed_campaign_goes_on_where_it_was_though_a_worker_of_it_is_killed_too(folder: Path, alone: str) -> None:
    command = [*COMMAND, "--out", "killed", "--workers", "2", "--json"]
    running = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    try:
        until(lambda: parts(folder, "killed") >= 3)
        workers = living(PARENT, running.pid)
        assert len(workers) >= 2
    finally:
        running.kill()
        running.wait()
    until(lambda: not any(map(alive, workers)))
    there = parts(folder, "killed")
    assert 3 <= there < 16
    running = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    try:
        until(lambda: parts(folder, "killed") >= there + 2)
        victims = [
            p for p in living(PARENT, running.pid) if "spawn_main" in (Path("/proc") / str(p) / "cmdline").read_text()
        ]
        os.kill(victims[0], signal.SIGKILL)
        printed, _ = running.communicate(timeout=LONG)
    finally:
        running.kill()
        running.wait()
    found = json.loads(printed)
    assert found["chunks_kept"] == there
    assert found["rows_sha256"] == alone


@pytest.mark.long
@pytest.mark.parametrize(
    ("out", "options"),
    [
        ("stopped", ["--workers", "2"]),
        ("local", ["--cluster", "local:2"]),
    ],
)
def test_ctrl_c_ends_every_process_and_keeps_what_was_computed(out: str, options: list[str], folder: Path) -> None:
    """As a terminal sends it: to the command and to all that it has started."""
    if "--cluster" in options:
        pytest.importorskip("distributed", reason="dask.distributed is not installed")
    (folder / "long.toml").write_text(
        STUDY.replace("duration_s = 4.0", "duration_s = 20.0")
    )  # not over before it is told
    command = [*COMMAND[:-1], "long.toml"]
    running = subprocess.Popen(
        [*command, "--out", out, *options],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        until(lambda: parts(folder, out) >= 2 or running.poll() is not None)
        os.killpg(running.pid, signal.SIGINT)
        _, said = running.communicate(timeout=LONG)
        until(lambda: not living(SESSION, running.pid))
    finally:
        for process in living(SESSION, running.pid):
            os.kill(process, signal.SIGKILL)
        running.wait()
    there = parts(folder, out)
    assert running.returncode == 130, said
    assert said == (
        f"bowden: interrupted; {there} of 16 chunks are kept in {out}, and the same command goes on from there\n"
    )
    assert 2 <= there < 16
    found = computed(folder, out, *options, command=command)
    assert (found["chunks_kept"], found["chunks_computed"]) == (there, 16 - there)
    assert found["laws"][0]["runs"] == 48


@pytest.fixture
def cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """A scheduler on this machine and three workers."""
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    cli = [sys.executable, "-m", "distributed.cli"]
    scheduler = subprocess.Popen(
        [*cli[:-1], "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        cwd=folder,
        text=True,
    )
    processes = [scheduler]
    try:
        assert scheduler.stderr is not None
        address = next(m[0] for line in scheduler.stderr if (m := re.search(r"tcp://127\.0\.0\.1:\d+", line)))
        worker = [*cli[:-1], "distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard"]
        processes += [subprocess.Popen([*worker, "--host", "127.0.0.1"], text=True, **quiet) for _ in range(3)]  # type: ignore[call-overload]
        yield address, processes[1:]
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()
        assert scheduler.stderr is not None
        scheduler.stderr.close()


@pytest.mark.long
def test_a_cluster_that_loses_a_worker_gives_the_rows_of_one_process(
    folder: Path, alone: str, cluster: tuple[str, list[subprocess.Popen[str]]]
) -> None:
    address, workers = cluster
    running = subprocess.Popen(
        [*COMMAND, "--out", "cluster", "--cluster", address, "--json"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        until(lambda: parts(folder, "cluster") >= 2 or running.poll() is not None)
        workers[0].kill()
        printed, said = running.communicate(timeout=LONG)
    finally:
        running.kill()
        running.wait()
    assert running.returncode == 0, said
    assert said == ""
    assert json.loads(printed)["rows_sha256"] == alone


@pytest.mark.parametrize("address", [pytest.param("tcp://127.0.0.1:9", marks=pytest.mark.long), "nowhere"])
def test_a_scheduler_that_does_not_answer(address: str, folder: Path) -> None:
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    begin = time.monotonic()
    done = subprocess.run(
        [*COMMAND, "--out", "none", "--cluster", address],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=LONG,
    )
    assert time.monotonic() - begin < 60.0
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"bowden: no scheduler answers at {address}: ")
