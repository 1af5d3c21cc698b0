"""`bowden run` with real processes: operator, loop, recorder and twin; and how it ends."""

import contextlib
import json
import os
import re
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.app import main
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import BowdenError
from bowden.cycle.one_cycle import TargetSource
from bowden.design import forecast, verdict
from bowden.live.mcap_read import read
from bowden.live.twin_process import RunningTwin, running_twin
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault
from bowden.sim.run import simulate
from live_runs import assert_replays, finished, started, strokes, tries

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("state")]

RIG = strokes(4.0)
SAME_END = (signal.SIGINT, signal.SIGHUP)
"""These end a run as SIGTERM does, with which another test ends one."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    path.write_text(RIG)
    return path


@pytest.fixture(scope="module")
def shared_twin(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningTwin]:
    with running_twin(rig, tmp_path_factory.mktemp("b") / "b") as running:
        yield running


@pytest.fixture
def twin(shared_twin: RunningTwin) -> RunningTwin:
    if shared_twin.control.status()["state"] not in ("SWITCH_ON_DISABLED", "READY_TO_SWITCH_ON"):
        restart(shared_twin)
    return shared_twin


def in_the_law(rig: Path, twin: RunningTwin, out: Path) -> "subprocess.Popen[str]":
    """A run that goes on, with the motor on its way: the joint moves up from where the preflight leaves it."""
    for _ in tries():
        process = started(rig, out, "--channel", twin.channel, "--duration", "60")
        while process.poll() is None:
            status = twin.control.status()
            if status["torque"] and status["motor"] > 0.3:
                return process
            time.sleep(0.02)
        said = process.communicate()
        restart(twin)
    pytest.fail(f"no run reached the law: {said}")


def test_what_was_checked_is_what_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Loop, log and twin have the feedback gain of the check, not what the file has by then, and the forecast's limit.

    The forecast is one that no run keeps to: its limit ends the run.
    """
    path, check = tmp_path / "rig.toml", verdict.verdicts
    text = RIG + "off_reference_time_s = 0.4\n[control.gains]\nfeedback_gain = "

    def edited(*given: Any, **more: Any) -> Any:
        found = check(*given, **more)
        path.write_text(text + "0.5\n")
        return found

    monkeypatch.setattr(verdict, "verdicts", edited)
    monkeypatch.setattr(forecast, "off_reference", lambda rig, law, runs: 1e-4)
    for number in tries():
        path.write_text(text + "3.0\n")
        checked = Rig.read(path).hash
        out = tmp_path / f"out{number}"
        main.run(["run", str(path), "--twin", "--auto", "--json", "--duration", "3", "--out", str(out)])
        found = json.loads(capsys.readouterr().out)
        if Fault.JOINT_OFF_REFERENCE.meaning in found["faults"]:
            break
    assert found["faults"] == [Fault.JOINT_OFF_REFERENCE.meaning]
    log = read(Path(found["log"]))
    assert found["rig"] == log.settings["rig"]["hash"] == Rig.unpack(log.settings["rig"]).hash
    assert found["rig"] != checked, "the duration and the bus are the command's"
    assert log.settings["twin"], "else a twin's late answers would be told as the drive's"
    rig = log.settings["rig"]["fields"]
    assert log.settings["gains"]["feedback_gain"] == rig["gains"]["feedback_gain"] == 3.0
    path.unlink()
    assert_replays(found["log"])


def restart(twin: RunningTwin) -> None:
    """Bring a twin whose drive is in fault back: no run resets it without an operator's word."""
    twin.control.inject("reboot")
    time.sleep(0.5)


def loop_of(process: "subprocess.Popen[str]") -> int:
    """Number of the loop's process."""
    return child_of(process, "bowden.live.loop_process")


def child_of(process: "subprocess.Popen[str]", word: str) -> int:
    """Number of the child with that word in its command line."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    everything = {int(child): Path(f"/proc/{child}/cmdline").read_text() for child in children}
    threads = Path(f"/proc/{process.pid}/task").iterdir()
    for thread in threads:
        for child in (thread / "children").read_text().split():
            everything[int(child)] = Path(f"/proc/{child}/cmdline").read_text()
    return next(number for number, line in everything.items() if word in line.split("\0"))


def wait_for_torque_off(twin: RunningTwin, since: float) -> dict[str, Any]:
    deadline = time.monotonic() + 10.0
    while twin.control.status()["torque"]:
        assert time.monotonic() < deadline, "the torque stays on"
        time.sleep(0.005)
    return [entry for entry in twin.control.journal(since) if entry["event"] == "torque_off"][-1]


def test_a_run_is_as_good_as_its_simulation_and_every_cycle_is_in_the_log(
    rig: Path, twin: RunningTwin, tmp_path: Path
) -> None:
    for _ in tries():
        found = finished(started(rig, tmp_path, "--channel", twin.channel))
        log = read(Path(found["log"]))
        assert found["cycles"] == found["cycles_logged"] == len(log.rows)
        assert log.whole
        assert log.missing == 0
        if found["ended_well"]:
            break
        restart(twin)
    assert found["ended_well"], found
    assert not twin.control.status()["torque"]
    law = log["source"] >= TargetSource.LAW_BEGINS
    assert law.sum() + log["overruns"][law].sum() > 3900
    reference = PeriodicMinimumJerk(0.0, np.radians(50.0), 4.0)
    pure = simulate(default_bench(), LAWS["adaptive"], reference, duration=4.0, seed=1)
    assert found["rmse_deg"] == pytest.approx(pure.metrics().rmse_deg, rel=0.5)


@pytest.mark.long
@pytest.mark.parametrize("end", SAME_END)
def test_a_signal_ends_in_a_controlled_release(
    end: signal.Signals, rig: Path, twin: RunningTwin, tmp_path: Path
) -> None:
    process = in_the_law(rig, twin, tmp_path)
    since = twin.control.status()["time"]
    process.send_signal(end)
    assert_released(finished(process)["log"], twin)
    assert twin.control.journal(since)


def assert_released(log: str, twin: RunningTwin) -> None:
    modes = read(Path(log))["mode"]
    order = modes[np.flatnonzero(np.diff(modes, prepend=-1.0))].astype(int).tolist()
    assert order[-2:] in ([4, 0], [4, 5]), "released, and then without power"
    assert not twin.control.status()["torque"]


def test_without_its_operator_the_loop_releases_and_ends(rig: Path, twin: RunningTwin, tmp_path: Path) -> None:
    process = in_the_law(rig, twin, tmp_path)
    since, loop = twin.control.status()["time"], loop_of(process)
    process.kill()
    process.communicate()
    off = wait_for_torque_off(twin, since)
    assert off["time"] - since < 5.0
    deadline = time.monotonic() + 10.0
    while Path(f"/proc/{loop}/cmdline").exists() and Path(f"/proc/{loop}/cmdline").read_bytes():
        assert time.monotonic() < deadline, "the loop goes on without an operator"
        time.sleep(0.05)
    log = max(tmp_path.glob("*.mcap"), key=lambda path: path.stat().st_mtime)  # a try before it may have left one
    deadline = time.monotonic() + 10.0
    while not read(log).whole:
        assert time.monotonic() < deadline, "the recorder does not close its log"
        time.sleep(0.1)
    assert 4.0 in read(log)["mode"]
    while left := [*Path("/dev/shm").glob(f"bowden-{process.pid}-*")]:
        assert time.monotonic() < deadline, f"{left} is left behind"
        time.sleep(0.1)


@pytest.mark.parametrize("end", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.long)])
def test_without_its_loop_the_torque_is_off_50_ms_after_the_last_heartbeat(
    end: signal.Signals, rig: Path, twin: RunningTwin, tmp_path: Path
) -> None:
    process = in_the_law(rig, twin, tmp_path)
    since, loop = twin.control.status()["time"], loop_of(process)
    os.kill(loop, end)
    try:
        off = wait_for_torque_off(twin, since)
        heard = twin.control.status()["last_heartbeat"]
        assert off["time"] - heard <= 0.050
    finally:
        with contextlib.suppress(ProcessLookupError):  # its parent may have noticed already
            os.kill(loop, signal.SIGKILL)
        process.terminate()
        out, errors = process.communicate(timeout=30.0)
    assert process.returncode == 1, errors
    found = json.loads(out)
    assert (found["ended_well"], found["mode"]) == (False, None)
    assert "the loop's process was ended by SIGKILL" in found["error"]


@pytest.mark.long
@pytest.mark.parametrize("stall_ms", [10, 30, 300, 1500])
def test_a_loop_that_does_not_get_the_computer_for_a_while_rides_on_or_says_so(
    stall_ms: int, rig: Path, twin: RunningTwin, tmp_path: Path
) -> None:
    strict = tmp_path / "strict.toml"
    strict.write_text(re.sub(r"(?m)^lateness_s = .*$", "lateness_s = 0.02", rig.read_text()))
    process = in_the_law(strict, twin, tmp_path)
    loop = loop_of(process)
    os.kill(loop, signal.SIGSTOP)
    time.sleep(1e-3 * stall_ms)
    os.kill(loop, signal.SIGCONT)
    time.sleep(1.0)
    process.send_signal(signal.SIGTERM)
    found = finished(process)
    assert found["ended_well"] or found["stalled_ms"], found
    if stall_ms >= 300:
        assert found["stalled_ms"] > 0.9 * stall_ms, found
    assert not twin.control.status()["torque"]


def test_a_recorder_that_is_killed_is_started_again_and_another_run_on_the_bus_is_refused(
    rig: Path, twin: RunningTwin, tmp_path: Path
) -> None:
    """No cycle is lost meanwhile, and the run ends in a controlled release."""
    for number in tries():
        process = in_the_law(rig, twin, tmp_path)
        os.kill(child_of(process, "bowden.live.recorder"), signal.SIGKILL)
        second = started(rig, tmp_path / f"second-{number}", "--channel", twin.channel)
        _, errors = second.communicate(timeout=60.0)
        still = process.poll() is None
        process.send_signal(signal.SIGTERM)
        found = finished(process)
        if still:
            break
        restart(twin)  # the first was stopped by right before the second came
    assert still
    assert second.returncode == 2
    assert "end the other run first" in errors
    assert len(errors.strip().splitlines()) == 1
    first = Path(found["log"])  # its number is that of the try
    assert found["more_logs"] == [str(first.with_name(f"{first.stem}-again1.mcap"))]
    assert found["cycles_logged"] == found["cycles"]
    assert (found["ended_well"], found["torque"], process.returncode) == (True, "off", 0)
    assert_released(found["more_logs"][0], twin)


@pytest.mark.long
def test_ctrl_c_at_the_terminal_is_no_fault_of_the_drives(rig: Path, tmp_path: Path) -> None:
    for _ in tries():
        process = with_own_twin(rig, tmp_path)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all that belong to it
        found = finished(process)
        if found["ended_well"]:
            break
    assert found["ended_well"], found
    assert found["faults"] == []
    assert not list((tmp_path / "state").rglob("*.json")), "the twin's warmth is nobody's afterwards"


@pytest.mark.long
def test_a_twin_of_a_run_that_was_killed_ends_too(rig: Path, tmp_path: Path) -> None:
    process = with_own_twin(rig, tmp_path)
    twin = child_of(process, "twin")
    process.kill()
    process.communicate()
    deadline = time.monotonic() + 30.0
    while Path(f"/proc/{twin}/cmdline").exists() and Path(f"/proc/{twin}/cmdline").read_bytes():
        assert time.monotonic() < deadline, "the twin goes on without anybody"
        time.sleep(0.1)
    left = [
        *Path("/dev/shm").glob(f"bowden-{process.pid}-*"),
        *Path(tempfile.gettempdir()).glob(f"bowden-twin-{process.pid}-*"),
    ]
    assert not left


def with_own_twin(rig: Path, out: Path) -> "subprocess.Popen[str]":
    """A run with a twin of its own, in a session of its own, under the law."""
    for _ in tries():
        before = set(out.glob("*.mcap"))
        process = started(rig, out, "--twin", "--duration", "60")
        while process.poll() is None:
            for log in set(out.glob("*.mcap")) - before:
                with contextlib.suppress(BowdenError):
                    if np.any(read(log)["source"] >= TargetSource.LAW_BEGINS):
                        return process
            time.sleep(0.1)
        said = process.communicate()
    pytest.fail(f"no run reached the law: {said}")
