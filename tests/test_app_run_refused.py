"""What `bowden run` refuses before anything moves: settings that cannot be, and drives that will not do."""

import os
import sys
from pathlib import Path

import pytest

from bowden.app.main import run
from bowden.core.errors import ParameterError
from bowden.hardware.buses.opening import UNIX, claim
from bowden.live.session import prepared_loop
from bowden.live.twin_process import running_twin
from bowden.operations.run import run_to_end
from support.command import Command

pytestmark = pytest.mark.usefixtures("state")


@pytest.mark.parametrize(
    ("objects", "text", "said"),
    [
        ([], "[drive]\nnode_id = 5\n", "no drive answers as node 5; there is node 1"),
        pytest.param(["1000:0=0x00030191"], "", "device profile 401", marks=pytest.mark.long),
        pytest.param(["6061:0=1"], "", "stays in mode 1", marks=pytest.mark.long),
        (["607D:1=-1000", "607D:2=1000", "6502:0=0x3A5"], "", "lowest motor angle is -17.19°"),
    ],
)
def test_a_drive_that_will_not_do_is_refused_and_never_enabled(
    objects: list[str], text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("")
    options = [word for one in objects for word in ("--object", one)]
    with running_twin(rig, tmp_path / "b", options) as twin:
        rig.write_text(text)
        assert run(["run", str(rig), "--channel", twin.channel, "--out", str(tmp_path / "out"), "--auto"]) == 2
        assert "torque_on" not in [entry["event"] for entry in twin.control.journal()]
    errors = capsys.readouterr().err
    assert said in errors
    assert len(errors.strip().splitlines()) == 1
    assert not list((tmp_path / "b").glob("*.node"))


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("", ["--auto"], "start bowden twin, run with a twin of its own (--twin), or name your CAN bus"),
        ("[drive]\ninterface = 'morse'", ["--auto"], "no angle has been confirmed by hand on this drive"),
        ("[limits]\nmotor_low_deg = 120.0", ["--auto"], "limits.motor_low_deg is 120 and motor_high_deg 114.6"),
        (
            "[limits]\nthermal_winding_capacity_j_per_k = 0.0",
            ["--auto"],
            "thermal_winding_capacity_j_per_k = 0, but must be a number above 0",
        ),
        (
            "[limits]\nlowering_deg_per_s = 20.0\nmotor_high_deg = 340.0",
            ["--auto"],
            "a release takes",
        ),
        (
            "[reference]\nkind = 'periodic_minimum_jerk'\nhigh_deg = 70.0\n[limits]\njoint_high_deg = 60.0",
            ["--auto"],
            "the reference goes from 0° to 70°, and the joint's limits are -28.65° to 60°",
        ),
        ("[cable]\nslope = -0.9", ["--auto"], "write the slope as a positive number"),
        ("[control]\npreset = 'paper'", ["--auto"], "adaptive fails the check"),
        ("", [], "no terminal"),
        ("", ["--json"], "with --twin add --auto; on a rig, where people may be near, run it in a terminal"),
    ],
)
def test_what_cannot_run_is_refused_in_one_line(
    text: str, options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(text)
    code = run(["run", str(rig), "--channel", str(tmp_path / "nobody"), "--out", str(tmp_path / "out"), *options])
    captured = capsys.readouterr()
    assert code == 2
    assert said in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert not list(Path("/dev/shm").glob(f"bowden-{os.getpid()}-*"))
    assert not list(tmp_path.rglob("*.mcap")), "a run that did not begin leaves no log"


def test_a_bus_that_another_run_has_is_told_before_the_law_is_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("")
    monkeypatch.setattr("bowden.design.verdict.verdicts", lambda *_, **__: pytest.fail("the law is checked"))
    other = claim(UNIX, str(tmp_path / "b"), "host")
    assert "end the other run first" in command.refused("run", rig, "--auto", "--channel", tmp_path / "b")
    other.close()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    claim(UNIX, str(tmp_path / "loop"), "host").close()


def test_what_takes_long_to_load_is_there_before_a_run_waits_for_signs_of_life(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def begun(*_: object, **__: object) -> None:
        raise ParameterError("loaded" if "bowden.console.open" in sys.modules else "not loaded")

    monkeypatch.delitem(sys.modules, "bowden.console.open", raising=False)
    monkeypatch.setattr("bowden.live.start.live_session", begun)
    (tmp_path / "rig.toml").write_text("")
    with pytest.raises(ParameterError, match=r"^loaded"):
        run_to_end(tmp_path / "rig.toml", twin=True, auto=True, console=True)


def test_a_loop_for_which_no_run_comes_ends_without_a_word() -> None:
    with prepared_loop() as process:
        said, errors = process.communicate(timeout=60.0)
    assert (said, errors, process.returncode) == ("", "", 0)
    with prepared_loop() as process:
        pass
    assert process.returncode is not None
