"""The twin as a process: two processes at 1 kHz, the host killed and stopped, faults over the control socket."""

import contextlib
import gc
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest

from bowden.app.main import run
from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import DriveState
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power
from bowden.hardware.twin.control import TwinControl, control_path
from bowden.live.twin_process import RunningTwin, running_twin
from bowden.operations.schema import json_schema
from support.drive_cycles import cycles

pytestmark = pytest.mark.live


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    path.write_text("[scenario]\nduration_s = 5.0\n")
    return path


@pytest.fixture(scope="module")
def twin(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningTwin]:
    with running_twin(rig, tmp_path_factory.mktemp("bus") / "b") as running:
        yield running


@contextlib.contextmanager
def host(channel: str) -> Iterator[CanopenDrive]:
    drive = CanopenDrive(DriveParameters(channel=channel))
    gc.collect()
    gc.disable()  # as the live loop: with all tests in memory a collection outlasts the drive's 50 ms
    try:
        drive.bring_up()
        yield drive
    finally:
        gc.enable()
        drive.close()


def enabled(drive: CanopenDrive) -> None:
    cycles(drive, 20, Power.OFF)
    drive.reset_fault()
    cycles(drive, 20, Power.OFF)
    for _ in range(100):  # a busy machine may let the twin wait
        if cycles(drive, 20, Power.ON)[-1].drive_state == DriveState.OPERATION_ENABLED:
            return
    raise AssertionError("the drive is not enabled")


def test_two_processes_follow_a_target_at_1_khz(twin: RunningTwin) -> None:
    with host(twin.channel) as drive:
        enabled(drive)
        before = twin.control.status()
        readings = cycles(drive, 1500, Power.ON, swing=0.2)
        after = twin.control.status()
        deadline = time.monotonic() + 5.0
        while after["syncs"] - before["syncs"] < 1500 and time.monotonic() < deadline:
            after = twin.control.status()
        assert cycles(drive, 100, Power.OFF)[-1].drive_state == DriveState.SWITCH_ON_DISABLED
    angles = [reading.motor for reading in readings]
    assert 0.3 < max(angles) - min(angles) < 0.41
    assert after["syncs"] - before["syncs"] == 1500, "no frame is lost"
    assert readings[-1].bus_errors == 0.0
    assert not {reading.emergency for reading in readings} - {0.0}
    assert abs(readings[-1].motor - after["motor"]) < 0.05


def test_two_hosts_on_one_bus_are_refused(twin: RunningTwin) -> None:
    with host(twin.channel), pytest.raises(DriveError, match="has a host already"):
        CanopenDrive(DriveParameters(channel=twin.channel)).bring_up()
    with host(twin.channel):
        pass


def test_two_twins_of_one_number_are_refused(rig: Path, twin: RunningTwin, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["twin", str(rig), "--channel", twin.channel]) == 2
    assert "has a node 1 already" in capsys.readouterr().err


LOOP = """
import sys, time
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power
drive = CanopenDrive(DriveParameters(channel=sys.argv[1]))
drive.bring_up()
k, start = 0, time.monotonic()
while True:
    time.sleep(max(0.0, start + 1e-3 * k - time.monotonic()))
    now = time.monotonic()
    reading = drive.read(now)
    if k == 10:
        drive.reset_fault()
    if k == 100:
        print("running", flush=True)
    target = reading.motor if k < 20 else 0.1 * (k % 200 > 100)
    drive.write(target if target == target else 0.0, Power.ON if k > 40 else Power.OFF, now)
    k += 1
"""


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_when_the_host_dies_the_torque_is_zero_within_50_ms_on_the_twins_clock(
    twin: RunningTwin, end: signal.Signals
) -> None:
    since = twin.control.status()["time"]
    process = subprocess.Popen([sys.executable, "-c", LOOP, twin.channel], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "running"
        time.sleep(0.05)
        assert twin.control.status()["torque"]
        process.send_signal(end)
        deadline = time.monotonic() + 5.0
        while (status := twin.control.status())["torque"] and time.monotonic() < deadline:
            time.sleep(0.01)
        off = [entry for entry in twin.control.journal(since) if entry["event"] == "torque_off"][-1]
        assert status["state"] == "FAULT"
        assert status["error_code"] == 0x8130
        stalled = 0.027 + status["longest_wait"]  # a twin that does not run cannot switch anything off
        assert off["time"] - status["last_heartbeat"] <= max(0.050, stalled)
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()


def test_faults_over_the_control_socket(twin: RunningTwin, rig: Path) -> None:
    with host(twin.channel) as drive:
        enabled(drive)
        twin.control.inject("encoder_frozen joint", lasting=0.3)
        assert twin.control.status()["faults"] == ["encoder_frozen joint"]
        frozen = cycles(drive, 200, Power.ON, swing=0.2)[20:]
        assert len({reading.joint for reading in frozen}) == 1
        free = cycles(drive, 300, Power.ON, swing=0.2)[150:]
        assert len({reading.joint for reading in free}) > 10
        twin.control.inject("bus_off", lasting=0.1)
        lost = cycles(drive, 300, Power.ON)
        assert lost[-1].bus_errors > 10
        assert lost[-1].motor_age <= 50, "it is back on the bus"
        assert lost[-1].drive_state == DriveState.FAULT
    twin.control.clear()
    assert twin.control.status()["faults"] == []
    with pytest.raises(ParameterError, match="there is no fault 'nonsense'"):
        twin.control.inject("nonsense")
    silence = {"do": "inject", "fault": "silence"}
    for wrong in ({"do": "dance"}, silence | {"fault": "x"}, silence | {"after": "soon"}):
        with pytest.raises(DriveError, match="the twin says"):
            twin.control.ask(**wrong)


def test_the_command_line_talks_to_it(rig: Path, twin: RunningTwin, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["twin", str(rig), "--channel", twin.channel]
    assert run([*common, "--inject", "silence", "--for", "0.2"]) == 0
    assert "silence" in capsys.readouterr().out
    assert run([*common, "--clear", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["twin"]["faults"] == []
    schema = json_schema("twin")
    for one in (document, twin.said):
        jsonschema.validate(one, schema)
    assert run([*common, "--inject", "list"]) == 0
    assert all(name in capsys.readouterr().out for name in ["broken_cable"])
    assert run([*common, "--inject", "encoder_frozen"]) == 2
    assert "encoder_frozen joint" in capsys.readouterr().err
    assert run(["twin", str(rig), "--channel", twin.channel + "x", "--status"]) == 2
    assert "it has not been started, or has ended" in capsys.readouterr().err
    assert run(["twin", str(rig), "--channel", twin.channel + "x", "--object", "what"]) == 2
    assert "--object is 'what'" in capsys.readouterr().err


def test_no_bus_and_nobody_on_it_are_said_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(DriveError, match="there is no such bus; start bowden twin, run with a twin"):
        CanopenDrive(DriveParameters(channel=str(tmp_path / "none"))).bring_up()
    (tmp_path / "empty").mkdir()
    with pytest.raises(DriveError, match="no other device is on the bus"):
        CanopenDrive(DriveParameters(channel=str(tmp_path / "empty"))).bring_up()


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.long), signal.SIGTERM])
def test_what_a_killed_twin_leaves_is_no_hindrance_and_one_that_is_ended_leaves_nothing(
    rig: Path, tmp_path: Path, number: signal.Signals
) -> None:
    channel = tmp_path / "b"
    with running_twin(rig, channel) as running:
        os.kill(running.process.pid, signal.SIGKILL)
        running.process.wait(10.0)
        with pytest.raises(DriveError, match="no other device is on the bus"):
            CanopenDrive(DriveParameters(channel=running.channel)).bring_up()
    with running_twin(rig, channel) as running:
        with host(running.channel) as drive:
            assert cycles(drive, 100, Power.OFF)[-1].motor_age < 50
        running.process.send_signal(number)
        assert running.process.wait(10.0) == 0
        assert running.process.stderr is not None
        assert running.process.stderr.read() == ""
    assert not list(channel.glob("*.node"))
    assert not list(channel.glob("*.control"))


def test_a_twin_that_does_not_start_says_why(tmp_path: Path) -> None:
    with pytest.raises(DriveError, match="cannot read"), running_twin(tmp_path / "none.toml", tmp_path / "b"):
        pass
    with pytest.raises(DriveError, match="no twin listens"):
        TwinControl(control_path("bowden_unix", str(tmp_path), 1))
