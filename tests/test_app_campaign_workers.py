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


def computed(folder: Path, out: str, *options: str) -> dict[str, Any]:
    done = subprocess.run(
        [*COMMAND, "--out", out, "--json", *options], cwd=folder, capture_output=True, text=True, timeout=LONG
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


def children(parent: int) -> list[int]:
    """Processes of a parent, by /proc."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            fields = (place / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == parent and fields[0] != "Z":
            found.append(int(place.name))
    return found


def alive(process: int) -> bool:
    try:
        return (Path("/proc") / str(process) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_killed_campaign_goes_on_where_it_was_and_leaves_no_process(folder: Path, alone: str) -> None:
    running = subprocess.Popen([*COMMAND, "--out", "killed", "--workers", "2"], cwd=folder, stdout=subprocess.DEVNULL)
    try:
        until(lambda: parts(folder, "killed") >= 3)
        workers = children(running.pid)
        assert len(workers) >= 2
    finally:
        running.kill()
        running.wait()
    until(lambda: not any(map(alive, workers)))
    there = parts(folder, "killed")
    assert 3 <= there < 16
    found = computed(folder, "killed", "--workers", "2")
    assert found["chunks_kept"] == there
    assert found["rows_sha256"] == alone


def test_two_processes_give_the_rows_of_one_though_one_of_them_is_killed(folder: Path, alone: str) -> None:
    running = subprocess.Popen(
        [*COMMAND, "--out", "lost", "--workers", "2", "--json"], cwd=folder, stdout=subprocess.PIPE, text=True
    )
    try:
        until(lambda: parts(folder, "lost") >= 2)
        victims = [p for p in children(running.pid) if "spawn_main" in (Path("/proc") / str(p) / "cmdline").read_text()]
        os.kill(victims[0], signal.SIGKILL)
        printed, _ = running.communicate(timeout=LONG)
    finally:
        running.kill()
        running.wait()
    assert json.loads(printed)["rows_sha256"] == alone


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


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nowhere"])
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
