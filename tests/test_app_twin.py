"""`bowden run` against a twin apart: faults end it, the sheath moves with the law."""

import json
import subprocess
import time
from pathlib import Path

import pytest

from bowden.cycle.one_cycle import TargetSource
from bowden.live.mcap_read import read
from bowden.live.twin_process import running_twin
from live_runs import COMMAND, started, strokes, tries
from support.command import Command

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("state")]

RIG = strokes(4.0, "[scenario.bend]\nkind = 'scripted'\ntimes_s = [0.0, 4.0]\nbends_deg = [180.0, 200.0]\n")


@pytest.mark.parametrize(
    ("fault", "meaning", "emergency"),
    [
        ("drive_fault 0x8A88", "emergency stop pressed", "emergency stop pressed, or 0x8A88: safe torque off"),
        pytest.param("bus_off", "bus fails", None, marks=pytest.mark.long),
    ],
)
def test_a_fault_injected_by_the_command_line_ends_the_run_and_is_told(
    fault: str, meaning: str, emergency: str | None, tmp_path: Path
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG)
    inject = [*COMMAND, "twin", str(rig), "--channel", str(tmp_path / "b"), "--inject", fault]
    told: list[object] = []
    for number in tries():
        with running_twin(rig, tmp_path / "b") as twin:
            process = started(rig, tmp_path / str(number), "--duration", "30", "--channel", twin.channel)
            while process.poll() is None and not (twin.control.status()["torque"]):
                time.sleep(0.02)
            since = twin.control.status()["time"]
            subprocess.run(inject, check=True, capture_output=True, timeout=60)
            out, errors = process.communicate(timeout=60.0)
            found = json.loads(out) if out else {"faults": []}
            assert process.returncode != 0
            events = [entry["event"] for entry in twin.control.journal(since)]
        told.append((found, errors))
        if events.count("inject") and meaning in found["faults"]:
            assert process.returncode == 1
            assert len(found["remedies"]) == len(found["faults"])
            assert emergency is None or emergency in [one["text"] for one in found["emergencies"]]
            return
    pytest.fail(f"no run was ended by it: {told}")


@pytest.mark.long
def test_the_sheath_begins_to_move_with_the_law_in_every_run(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG)
    with running_twin(rig, tmp_path / "b") as twin:
        for number in range(2):
            since = twin.control.status()["time"]
            out = tmp_path / str(number)
            words = ["run", str(rig), "--auto", "--json", "--duration", "1", "--channel", twin.channel]
            subprocess.run([*COMMAND, *words, "--out", str(out)], check=False, capture_output=True, timeout=60)
            log = read(next(out.glob("*.mcap")))
            led = log["source"] >= TargetSource.LAW_BEGINS
            told = [float(entry["detail"]) for entry in twin.control.journal(since) if entry["event"] == "scenario"]
            assert told[0] == float("inf")
            if led.any():
                begun = int(log.about["start_monotonic_ns"]) * 1e-9 + float(log["time"][led][0])
                assert told[1:] == [pytest.approx(begun, abs=1e-5)]


def test_times_that_are_none_are_refused(tmp_path: Path, command: Command) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG)
    for words in (["--after", "nan"], ["--after", "-1"], ["--for", "0"], ["--for", "inf"]):
        assert "expected a time from now" in command.refused(
            "twin", rig, "--inject", "silence", *words, "--channel", tmp_path / "b"
        )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--after", "3"], "--after and --for belong to a fault; expected --inject FAULT together with them"),
        (["--for", "3", "--status"], "--after and --for belong to a fault"),
        (["--status", "--object", "6502:0=0"], "--object belongs to a twin that is being started"),
        (["--inject", "encoder_frozn joint"], "expected encoder_frozen (did you mean this?)"),
        (
            ["--inject", "silence"],
            "start one with bowden twin RIG.toml; the twin of bowden run --twin lives as long as its run",
        ),
    ],
)
def test_what_a_twin_cannot_be_told_is_refused(words: list[str], said: str, tmp_path: Path, command: Command) -> None:
    (tmp_path / "rig.toml").write_text(RIG)
    assert said in command.refused("twin", tmp_path / "rig.toml", *words, "--channel", tmp_path / "b")


@pytest.mark.parametrize("family", ["dynamixel", "feetech"])
def test_the_first_hour_with_a_serial_servo(family: str, tmp_path: Path) -> None:
    """What init writes is run on its twin as it is, and replayed without a difference."""
    rig, out = tmp_path / "rig.toml", tmp_path / "out"
    subprocess.run([*COMMAND, "init", str(rig), "--drive", family], check=True, capture_output=True, timeout=60)
    run = [*COMMAND, "run", str(rig), "--twin", "--auto", "--duration", "3", "--json", "--out", str(out)]
    said: list[str] = []
    for _ in tries():
        done = subprocess.run(run, capture_output=True, text=True, timeout=120, check=False)
        said.append(done.stderr)
        if done.returncode == 0:
            log = max(out.glob("*.mcap"), key=lambda path: path.stat().st_mtime)
            replay = [*COMMAND, "log", "replay", str(log), "--json"]
            again = subprocess.run(replay, capture_output=True, text=True, timeout=60, check=True)
            assert json.loads(again.stdout)["differs"] is False
            return
    pytest.fail(f"no run came through: {said}")
