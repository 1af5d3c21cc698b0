"""``bowden drive``: finding, looking at and zeroing a drive, against the twin; the motor gets no power."""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bowden.core.errors import DriveError
from bowden.core.signals import EMERGENCY_STOP, DriveReading, DriveState
from bowden.hardware.ports import Power
from bowden.live import drive_look
from bowden.live.drive_look import DriveLook, looked_at
from bowden.live.twin_process import RunningTwin, running_twin
from bowden.operations import drive
from bowden.rig.families import family_of
from support.command import Command

READING = DriveReading(0.5, 0.4, 1.0, math.nan, 30.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def test_what_came_is_kept_with_its_range_and_each_change() -> None:
    look = DriveLook()
    look.take(READING)
    look.take(READING._replace(motor=0.7, drive_state=7.0, emergency=float(0x4210)))
    look.take(READING._replace(motor=math.nan, drive_state=7.0, emergency=EMERGENCY_STOP))
    assert (look.least["motor"], look.most["motor"]) == (0.5, 0.7)
    assert "tension" not in look.least
    assert look.states == ["SWITCH_ON_DISABLED", "FAULT"]
    assert look.explained(lambda code: f"code {code:X}") == ["code 4210", "emergency stop"]


def test_an_emergency_stop_that_stays_pressed_is_said_once() -> None:
    look = DriveLook()
    for code in (0.0, EMERGENCY_STOP, EMERGENCY_STOP, 0.0, float(0x4210), EMERGENCY_STOP):
        look.take(READING._replace(emergency=code))
    assert look.emergencies == [EMERGENCY_STOP, float(0x4210), EMERGENCY_STOP]


def test_an_angle_that_comes_no_more_is_silent_and_one_that_never_came_is_not() -> None:
    look = DriveLook()
    look.take(READING._replace(motor_age=0.0, joint_age=math.inf))
    look.take(READING._replace(motor_age=400.0, joint_age=math.inf))
    assert look.silent_now(1e-3) == {"motor": pytest.approx(0.4)}
    look.take(READING._replace(motor_age=0.0, joint_age=math.inf))
    assert look.silent_now(1e-3) == {}
    assert look.oldest == {"motor": 400.0}


def shown_to(monkeypatch: pytest.MonkeyPatch, look: DriveLook) -> None:
    """Let the commands see this, without a drive."""
    monkeypatch.setattr(drive, "_brought_up", lambda _: contextlib.nullcontext(("it", lambda _: iter([look]))))


def test_a_drive_that_falls_silent_under_monitor_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("")
    look = DriveLook()
    look.take(READING)
    look.take(READING._replace(joint_age=4000.0))
    shown_to(monkeypatch, look)
    printed = command("drive", "monitor", path, "--duration", "1", code=2)
    assert "silent       the joint's angle, for 4.0 s at the longest" in printed.out
    assert "Next:" not in printed.out
    assert "the angle of the joint has not come for 4.0 s; look at the plugs" in printed.err


class Powered:
    """A drive that has torque although it is told off."""

    sent: Power | None = None

    def read(self, now: float) -> DriveReading:
        return READING._replace(drive_state=float(DriveState.OPERATION_ENABLED))

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        self.sent = power


class Still:
    """A clock that goes on with each look."""

    time = 0

    def now(self) -> int:
        return self.time

    def sleep_until(self, time: int) -> None:
        self.time = time


def test_a_drive_that_has_torque_is_not_looked_at_any_longer() -> None:
    drive: Any = Powered()
    with pytest.raises(DriveError, match="has torque although it was switched off; press the emergency stop"):
        next(looked_at(drive, Still(), 1e-3))
    assert drive.sent is Power.OFF


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, RunningTwin]]:
    folder = tmp_path_factory.mktemp("rig")
    path = folder / "rig.toml"
    path.write_text("[scenario]\nduration_s = 5.0\n")
    with running_twin(path, folder / "b") as running:
        yield path, running


@pytest.mark.live
def test_a_drive_is_found_looked_at_and_zeroed_without_power(twin: tuple[Path, RunningTwin], command: Command) -> None:
    path, running = twin
    place = [str(path), "--channel", running.channel]
    found = command.document("drive", "probe", *place)
    (device,) = found["devices"]
    assert (device["node"], device["what"], device["state"]) == (1, "servo drive (CiA 402)", "SWITCH_ON_DISABLED")
    said = command("drive", "probe", *place).out
    assert "← [drive] of this rig" in said
    assert f"Next: bowden drive monitor {path}" in said

    seen = command.document("drive", "monitor", *place, "--duration", "0.5")
    assert seen["cycles"] == 500
    assert seen["readings"]["motor_deg"]["most"] - seen["readings"]["motor_deg"]["least"] < 1.0
    assert seen["readings"]["tension_n"] == {"least": None, "most": None, "last": None}
    assert set(seen["states"]) <= {"NOT_READY_TO_SWITCH_ON", "SWITCH_ON_DISABLED"}

    wanted = command.document("drive", "zero", *place, "--motor-deg", "10", "--joint-deg", "20")
    text = path.read_text() + "[drive]\n" + "".join(f"{key} = {value}\n" for key, value in wanted["keys"].items())
    zeroed = path.with_name("zeroed.toml")
    zeroed.write_text(text)
    again = command.document("drive", "monitor", zeroed, *place[1:], "--duration", "0.2")
    assert again["readings"]["motor_deg"]["last"] == pytest.approx(10.0, abs=0.1)
    assert again["readings"]["joint_deg"]["last"] == pytest.approx(20.0, abs=0.1)
    assert not running.control.status()["torque"]


@pytest.mark.live
def test_a_load_cell_is_looked_at_and_tared_without_power(tmp_path: Path, command: Command) -> None:
    path = tmp_path / "rig.toml"
    text = "[load_cell]\nsource = 'cia404'\nscale = 0.01\nfull_scale = 300.0\n"
    path.write_text(text)
    with running_twin(path, tmp_path / "b") as running:
        place = ["--channel", running.channel]
        seen = command.document("drive", "monitor", path, *place, "--duration", "0.3")
        assert "load cell: bowden load cell twin at node 33, 0.01 N a count; it says 0.01 N itself" in seen["drive"]
        pulled = running.control.status()["tension"]
        assert seen["readings"]["tension_n"]["last"] == pytest.approx(pulled, abs=0.02)
        assert seen["readings"]["joint_torque_nm"]["last"] is None
        found = command.document("drive", "tare", path, *place, "--load", "1.0")
        assert found["read"] == pytest.approx(pulled, abs=0.02)
        tared = tmp_path / "tared.toml"
        tared.write_text(f"{text}zero = {found['keys']['zero']}\n")
        again = command.document("drive", "monitor", tared, *place, "--duration", "0.3")
        assert again["readings"]["tension_n"]["last"] == pytest.approx(1.0, abs=0.03)
        assert not running.control.status()["torque"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["probe", "--channel", "{none}"], "cannot open the bus"),
        (["monitor", "--json"], "--json needs an end; add --duration 10"),
        (["monitor", "--duration", "-1"], "--duration is -1; expected a number from 0.01"),
        (["zero", "--joint-deg", "nan"], "--joint-deg is nan; expected a number from"),
        (["tare", "--load", "nan"], "--load is nan; expected a number from"),
        (["tare", "--channel", "{none}"], "the rig has no load cell; expected [load_cell]"),
    ],
)
def test_what_cannot_be_done_is_one_line(words: list[str], said: str, tmp_path: Path, command: Command) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("")
    first, *rest = (word.format(none=tmp_path / "none") for word in words)
    printed = command("drive", first, path, *rest, code=2).err
    assert said in printed
    assert printed.count("\n") == 1


def test_a_family_whose_zero_is_its_makers_is_refused_before_a_bus_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("")
    monkeypatch.setattr(drive_look, "family_of", lambda given: replace(family_of(given), zeroed=None))
    assert "the family cia402 is not found by this command" in command.refused(
        "drive", "zero", path, "--channel", tmp_path / "none"
    )


def test_of_several_motors_the_next_command_and_the_lines_are_those_of_the_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    path = tmp_path / "leg.toml"
    path.write_text('[[motor]]\nname = "hip"\n[[motor]]\nname = "knee"\n[motor.drive]\nnode_id = 2\n')
    look = DriveLook()
    look.take(READING)
    shown_to(monkeypatch, look)
    for name in ("monitor", "zero"):
        said = command("drive", name, path, "--motor", "knee", "--channel", "can1").out
        assert f"Next: bowden confirm {path} --motor knee --channel can1" in said
    assert "below [motor.drive] of the motor knee" in said


@pytest.mark.live
def test_a_bus_on_which_nobody_answers_is_said(
    twin: tuple[Path, RunningTwin], tmp_path: Path, command: Command
) -> None:
    path, running = twin
    running.control.inject("deaf", lasting=6.0)
    assert "nobody answers on the bus" in command.refused("drive", "probe", path, "--channel", running.channel)
    running.control.clear()
