"""Several motors by the commands: run on twins, logged, replayed, stopped together; refused where one is asked for."""

import contextlib
import io
import subprocess
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bowden.app.main import run
from bowden.core.errors import SafetyError
from bowden.cycle.one_cycle import TargetSource
from bowden.live import twin_process
from bowden.live.mcap_read import read
from bowden.live.session import Session
from bowden.live.twin_process import own_twin
from bowden.operations.run import run as live
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault, of
from bowden.safety.state import Mode
from bowden.views.run import say_next_of
from bowden.views.text import Call
from live_runs import COMMAND, SHARED, finished_well, tries
from support.command import Command

SECTIONS = f"""[scenario]
duration_s = 2.0
[control]
law = "bowden"
[limits]
{SHARED}"""
LEG = """[[motor]]
name = "hip"
[motor.drive]
node_id = 1
[[motor]]
name = "knee"
[motor.drive]
node_id = 2
[motor.reference]
high_deg = 20.0
"""


@pytest.fixture
def leg(tmp_path: Path) -> Path:
    path = tmp_path / "leg.toml"
    path.write_text(SECTIONS + LEG)
    return path


@pytest.mark.live
@pytest.mark.parametrize("buses", [1, pytest.param(2, marks=pytest.mark.long)])
def test_two_twins_run_in_one_loop_and_each_motor_replays_to_the_bit(
    buses: int, leg: Path, tmp_path: Path, command: Command
) -> None:
    if buses == 2:
        leg.write_text(leg.read_text().replace("node_id = 2", 'node_id = 1\nchannel = "other"'))
    found = finished_well(leg, tmp_path / "out", "--twin")
    assert [motor["name"] for motor in found["motors"]] == ["hip", "knee"]
    assert all(motor["mode"] == "stopped" and motor["rmse_deg"] < 1.5 for motor in found["motors"])
    log = read(Path(found["log"]))
    for part in log.parts.values():
        assert part["mode"].max() == Mode.RELEASING or part["mode"].max() == Mode.RUNNING
    assert float(np.nanmax(log["knee.reference"])) < 0.5 * float(np.nanmax(log["reference"]))
    again = command.document("log", "replay", found["log"])
    assert [motor["motor"] for motor in again["motors"]] == ["hip", "knee"]
    for motor in again["motors"]:
        assert motor["law_cycles"] > 1000
        assert (motor["requested_target_largest"], motor["verdicts_differing"], motor["command_largest"]) == (
            0.0,
            0,
            0.0,
        )
    one = command.document("log", "replay", found["log"], "--motor", "knee")
    assert one["law_cycles"] == again["motors"][1]["law_cycles"]
    told = command.document("log", "info", found["log"])
    assert [*told["motors"]] == ["hip", "knee"]
    files = command.document("log", "plot", found["log"], "--out", tmp_path / "page.html")["files"]
    assert [Path(file).name for file in files] == ["page-hip.html", "page-knee.html"]
    columns = command.document("log", "export", found["log"], "--motor", "knee", "--out", tmp_path / "knee.parquet")[
        "columns"
    ]
    assert "joint" in columns
    assert not any(column.startswith("knee.") for column in columns)


@pytest.mark.live
def test_a_shared_joint_with_a_load_cell_runs_on_one_twin_and_replays_to_the_bit(
    tmp_path: Path, command: Command
) -> None:
    path = tmp_path / "elbow.toml"
    joint = '[[joint]]\nname = "elbow"\nco_contraction_deg = 4.0\n'
    motors = """[[motor]]
name = "flexor"
joint = "elbow"
[motor.drive]
node_id = 1
[motor.load_cell]
source = "can"
scale = 0.01
full_scale = 300.0
[[motor]]
name = "extensor"
joint = "elbow"
[motor.drive]
node_id = 2
[motor.limits]
slack_sign = 1.0
"""
    path.write_text(SECTIONS + joint + motors)
    found = finished_well(path, tmp_path / "out", "--twin")
    assert all(motor["mode"] == "stopped" and motor["rmse_deg"] < 1.5 for motor in found["motors"])
    log = read(Path(found["log"]))
    assert np.array_equal(log["joint"], log["extensor.joint"], equal_nan=True)
    led = log["source"] >= TargetSource.LAW_BEGINS
    assert log["tension"][led].min() > 2.0
    assert np.isnan(log["extensor.tension"]).all()
    again = command.document("log", "replay", found["log"])
    for motor in again["motors"]:
        assert motor["law_cycles"] > 1000
        assert (motor["requested_target_largest"], motor["verdicts_differing"], motor["command_largest"]) == (
            0.0,
            0,
            0.0,
        )


def stopped(leg: Path, out: Path, fault: str, motor: str) -> Session:
    """A run that a fault of one twin has ended."""
    with live(leg, twin=True, out=out) as session:
        session.start()
        session.inject(fault, motor=motor)
        while (row := session.last()) is not None and row["mode"] in (Mode.RUNNING, Mode.BRIDGING, Mode.RELEASING):
            session.wait(0.02)
    return session


@pytest.mark.live
@pytest.mark.parametrize(("motor", "fault", "seen", "shown"), [
    ("hip", "drive_fault", {Fault.EMERGENCY, Fault.DRIVE_FAULT}, Fault.OTHER_OFF),
    ("knee", "encoder_frozen joint", {Fault.JOINT_FROZEN, Fault.JOINT_MOTOR_MISMATCH, Fault.TARGET_LOST},
     Fault.OTHER_RELEASED),
])  # fmt: skip
def test_a_fault_of_one_twin_stops_both_and_is_told_with_its_motor(
    motor: str, fault: str, seen: set[Fault], shown: Fault, leg: Path, tmp_path: Path
) -> None:
    for number in tries():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a fault ended it
            try:
                session = stopped(leg, tmp_path / f"o{number}", fault, motor)
            except SafetyError:  # a late loop does not let it begin
                continue
        assert session.ended is not None
        log = read(session.log)
        first = {name: int(np.flatnonzero(part["mode"] >= Mode.RELEASING)[0]) for name, part in log.parts.items()}
        sick, other = log.only(motor), log.only("hip" if motor == "knee" else "knee")
        if not seen & {*of(float(sick["faults"][first[motor]]))}:
            continue  # this computer was late first
        assert first["hip" if motor == "knee" else "knee"] == first[motor] + 1
        assert shown in of(float(other["faults"][first[motor] + 1]))
        assert {one.mode for one in session.ended.motors} == {Mode.LATCHED}
        assert f"{motor}: " in session.outcome
        break
    else:
        pytest.fail("another fault came first in every try")


def test_check_and_simulate_tell_each_motor(leg: Path, tmp_path: Path, command: Command) -> None:
    checked = command.document("check", leg)
    assert [joint["joint"] for joint in checked["joints"]] == ["hip", "knee"]
    simulated = command.document("simulate", leg, "--out", tmp_path / "sim")
    assert [run["joint"] for run in simulated["runs"]] == ["hip", "knee"]
    assert (tmp_path / "sim" / "knee" / "bowden.npz").exists()
    alone = command.document("simulate", leg, "--motor", "hip", "--out", tmp_path / "one")
    assert alone["runs"][0]["rmse_deg"] == simulated["runs"][0]["rmse_deg"]


@pytest.mark.parametrize(
    "words",
    [
        ("tune", "{}"),
        ("export", "{}", "--to", "firmware"),
        ("measure", "{}", "--twin", "--auto"),
        ("twin", "{}"),
    ],
    ids=lambda words: words[0],
)
def test_a_command_on_one_motor_asks_for_its_name(
    words: tuple[str, ...], leg: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ended = run([word.format(leg) for word in words])
    said = capsys.readouterr().err
    assert ended == 2
    assert len(said.strip().splitlines()) == 1
    assert "has the motors hip, knee; expected one of them" in said


def test_a_command_without_an_option_for_an_motor_does_not_name_it(leg: Path, command: Command) -> None:
    study = leg.with_name("study.toml")
    study.write_text('runs = 1\n[vary]\n"servo.damping" = { uniform = [0.8, 1.0] }\n')
    said = command("campaign", study, "--rig", leg, code=2).err
    assert "has several motors; expected the rig of one motor; write one without [[motor]] for this" in said


def test_a_rig_of_motors_that_cannot_be_gets_no_power(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(SECTIONS + LEG.replace("node_id = 2", "node_id = 1"))
    words = [*COMMAND, "run", str(tmp_path / "bad.toml"), "--twin", "--auto", "--out", str(tmp_path / "out")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert 'motors "hip" and "knee" have one drive' in done.stderr
    assert not (tmp_path / "out").exists()


def test_what_is_said_to_come_next_names_the_motor(capsys: pytest.CaptureFixture[str]) -> None:
    switches = {name: f"--{name}" for name in ("law", "preset", "motor")}
    both = [SimpleNamespace(name=name, law="bowden") for name in ("hip", "knee")]
    ended = {"ended_well": True, "law": "bowden", "log_whole": True, "log": "b.mcap"}
    for rig, more, given in (
        ("leg.toml", {"motors": both}, {}),
        ("leg.toml", {}, {"law": "bowden", "motor": "knee"}),
        ("rig.toml", {}, {}),
        ("rig.toml", {"log_whole": False}, {}),
    ):
        call = Call({"rig": rig, "motor": None} | given, switches)
        say_next_of(SimpleNamespace(**{"motors": ()} | ended | more), call)  # type: ignore[arg-type]
    assert capsys.readouterr().out.splitlines() == [
        "Next: bowden export leg.toml --motor hip --to firmware/hip",
        "Next: bowden export leg.toml --motor knee --to firmware/knee",
        "Next: bowden export leg.toml --law bowden --motor knee --to firmware/bowden",
        "Next: bowden export rig.toml --to firmware/bowden",
        "Next: bowden log recover b.mcap",
    ]


def test_how_each_twin_is_reached_is_said(
    leg: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextlib.contextmanager
    def played(rig: Rig, channel: Path, options: list[str]) -> Iterator[Any]:
        yield SimpleNamespace(channel=str(channel), process=SimpleNamespace(poll=lambda: None))

    monkeypatch.setattr(twin_process, "running_twin", played)
    leg.write_text(leg.read_text().replace("node_id = 2", 'node_id = 2\ninterface = "socketcan"\nchannel = "can1"'))
    with own_twin(Rig.read(leg)) as rig:
        channels = [one.drive.channel for _, one, _ in rig.motors]
    with own_twin(Rig.read(leg).only("hip"), alone="hip") as alone:
        channels.append(alone.drive.channel)
    told = capsys.readouterr().err
    assert f"bowden twin {leg} --motor hip --channel {channels[2]}\n" in told
    assert f"bowden twin {leg} --motor hip --channel {channels[0]}\n" in told
    assert f"bowden twin {leg} --motor knee --channel {channels[1]} --interface bowden_unix\n" in told


def test_a_twin_that_ends_before_its_run_is_said_with_its_last_line(
    leg: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextlib.contextmanager
    def ended(rig: Rig, channel: Path, options: list[str]) -> Iterator[Any]:
        died = SimpleNamespace(poll=lambda: 1, returncode=1, stderr=io.StringIO("Traceback\nValueError: no\n"))
        yield SimpleNamespace(channel=str(channel), process=died)

    monkeypatch.setattr(twin_process, "running_twin", ended)
    with own_twin(Rig.read(leg).only("hip"), alone="hip"):
        pass
    assert "ended before the run, with exit code 1: ValueError: no; begin again" in capsys.readouterr().err
