"""[admittance] on the command line: what the wearer feels, and one line for what cannot be rendered."""

import json
from pathlib import Path

import jsonschema
import pytest

from bowden.app import main
from bowden.core.trace import Trace

ROOT = Path(__file__).parents[1]
RIG = """
[suit]
worn = true
[wearer]
share = 1.0
resisting_nm_per_rad = 100.0
resisting_nms_per_rad = 3.0
resisting_at_deg = 45.0
swing_deg = 20.0
[control]
law = "uncompensated"
[reference]
kind = "point_to_point"
times_s = [0.0, 1.0]
positions_deg = [45.0, 45.0]
[scenario]
duration_s = 6.0
[admittance]
enabled = true
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(RIG)
    return tmp_path


def test_the_push_makes_the_reference(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["simulate", "rig.toml", "--json", "--out", "out"]) == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json.loads((ROOT / "docs" / "json" / "simulate.schema.json").read_text()))
    (run,) = document["runs"]
    assert run["interaction"]["rms_nm"] < 1.0
    assert run["interaction"]["rms_nm"] < run["interaction"]["peak_nm"]
    trace = Trace.from_parquet("out/uncompensated.parquet")
    assert trace.units["admittance.push"] == "N·m"
    assert trace.units["admittance.velocity"] == "rad/s"
    assert "What the wearer pushes" in Path("out/simulate.html").read_text()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("virtual_inertia = 0.001", "an inertia of at least 0.0"),
        ("virtual_inertia = -1.0", "admittance.virtual_inertia is -1"),
        ("virtual_inertia = 0.0\nvirtual_damping = 0.0", "inertia and damping are both 0"),
        ("low_deg = 90.0\nhigh_deg = 10.0", "the range is"),
        ('torque = "guess"', "admittance.torque is 'guess'"),
        ("virtual_mass = 1.0", "unknown key 'virtual_mass'"),
    ],
)
def test_what_cannot_be_rendered_is_one_line(keys: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("rig.toml").write_text(f"{RIG}{keys}\n")
    assert main.run(["simulate", "rig.toml", "--json"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert said in printed.err
    assert printed.err.count("\n") == 1
    assert not Path("out").exists() or not list(Path("out").rglob("*.html"))


def test_the_live_loop_refuses_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["run", "rig.toml", "--twin", "--auto"]) == 2
    assert "admittance.enabled is true; expected false" in capsys.readouterr().err


def test_no_push_without_a_suit(capsys: pytest.CaptureFixture[str]) -> None:
    Path("rig.toml").write_text(RIG.replace("worn = true", "worn = false"))
    assert main.run(["simulate", "rig.toml"]) == 2
    assert "[admittance] is enabled without a suit; expected suit.worn = true" in capsys.readouterr().err


def test_beyond_the_limit_runs_when_forced_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    Path("rig.toml").write_text(f"{RIG}virtual_inertia = 0.005\n")
    assert main.run(["simulate", "rig.toml", "--force", "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["runs"][0]["interaction"] is not None
    assert "swings up" in printed.err
    assert "it runs because of --force" in printed.err
