"""`bowden sample`: what is written can be identified, scored and run, and is what the file of the truth says."""

import itertools
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from bowden.app.main import run
from bowden.core.units import DEGREES
from bowden.identify.cable.identification import identify
from bowden.identify.log.read import read_log
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.operations.schema import json_schema
from bowden.rig.rig import Rig
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

KINDS = ("cable", "emg", "suit")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def truth(path: str) -> dict[str, Any]:
    return tomllib.loads(Path(path).read_text(encoding="utf-8"))


@pytest.mark.parametrize("kind", KINDS)
def test_a_sample_is_written_whole_and_names_the_next_command(kind: str, command: Command) -> None:
    found = command.document(f"sample {kind} 'of mine'")
    jsonschema.validate(found, json_schema("sample"))
    assert {str(path) for path in Path("of mine").iterdir()} == set(found["files"])
    assert list(found["files"])[-1] == f"of mine/{kind}.truth.toml"
    printed = command("sample", kind, ".").out
    assert all(re.search(rf"^  {re.escape(Path(file).name)} ", printed, re.MULTILINE) for file in found["files"])
    (following,) = re.findall(r"^Next: bowden (.*)$", printed, re.MULTILINE)
    files = [word.removeprefix("file:") for word in shlex.split(following) if re.search(r"\.(csv|toml)$", word)]
    assert files
    assert all(Path(file).is_file() for file in files)
    assert shlex.split(found["next"]) == [
        "bowden",
        *(re.sub(r"(file:)?(\S+\.(csv|toml))", r"\1of mine/\2", word) for word in shlex.split(following)),
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_gives_the_same_files_and_another_one_others(kind: str) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert run(["sample", kind, name, "--seed", str(seed)]) == 0
    for path in Path("a").iterdir():
        assert path.read_bytes() == Path("b", path.name).read_bytes()
    name = "log.csv" if kind == "cable" else "biceps.csv"
    assert Path("a", name).read_bytes() != Path("c", name).read_bytes()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("cable .", "log.csv is there already; choose another folder, or overwrite it with --force"),
        ("cable mine", "mine is not a folder; choose another one with FOLDER"),
        ("cable ''", "FOLDER is ''; expected the name of a folder; use FOLDER . for this one"),
        ("cable . --seed -1", "--seed is -1; expected a whole number from 0 to 4294967295"),
        ("cabel .", "'cabel' is not one of 'cable', 'emg', 'suit'"),
        ("cable", "Missing argument 'FOLDER'"),
    ],
)
def test_what_cannot_be_written_is_one_line_and_nothing_is_touched(words: str, said: str, command: Command) -> None:
    for name in ("log.csv", "mine"):
        Path(name).write_text("mine")
    printed = command("sample", *shlex.split(words), code=2)
    assert said in printed.err
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert {path.name: path.read_text() for path in Path().iterdir()} == {"log.csv": "mine", "mine": "mine"}


def test_with_force_files_are_overwritten() -> None:
    Path("log.csv").write_text("mine")
    assert run(["sample", "cable", ".", "--force"]) == 0
    assert Path("log.csv").read_text().startswith("time_s,motor_deg,joint_deg\n")


def half_width(cable: BoucWen) -> float:
    """Of the loop, at the motor [rad]."""
    return abs(cable.hysteresis_gain) * saturation(cable) / cable.slope


def test_the_cable_is_found_in_its_log(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sample", "cable", "."]) == 0
    fit = identify([read_log(Path("log.csv"))])
    true = BoucWen(**truth("cable.truth.toml")["log"])
    assert fit.best.name == "bouc_wen"
    assert all("count less: the log begins at rest or at a turn" in said for said in fit.warnings)
    found = BoucWen(**{name: fit.best.parameters[name] for name in BoucWen._fields})
    assert found.slope == pytest.approx(true.slope, rel=1e-3)
    assert found.offset == pytest.approx(true.offset, abs=0.02 / DEGREES)
    assert half_width(found) == pytest.approx(half_width(true), rel=0.01)
    assert fit.models["bouc_wen"].test_rms * DEGREES < 0.025  # noise of 0.01° and counts of 0.022 and 0.044°


def test_the_other_logs_of_a_cable_and_a_servo_are_what_the_truth_says(
    capsys: pytest.CaptureFixture[str], command: Command
) -> None:
    assert run(["sample", "cable", "."]) == 0
    assert run(["identify", "log.csv"]) == 0
    true = truth("cable.truth.toml")
    capsys.readouterr()
    new = command.document("identify new.csv --model out/identify/model.toml --out new")["recalibration"]
    assert (new["gain"], new["offset_deg"]) == pytest.approx((true["new"]["gain"], true["new"]["offset_deg"]), rel=0.01)
    assert not new["changed"]
    loads = command.document("identify low.csv mid.csv high.csv")
    known = [true[name]["load_nm"] for name in ("low", "mid", "high")]
    assert [one["load"] for one in loads["logs"]] == pytest.approx(known, abs=1e-4)  # the mean of its column
    assert all(one["test_rms_deg"] < 0.03 for one in loads["logs"])
    for log in ("step.csv", "chirp.csv --command target --unit deg"):
        servo = command.document(f"identify-servo {log}")
        for name in ("natural_frequency_hz", "damping"):
            assert servo[name]["value"] == pytest.approx(true["servo"][name], rel=2e-3)
        assert 1e3 * servo["delay_s"]["value"] == pytest.approx(true["servo"]["delay_ms"], abs=0.05)
    raw = read_log(Path("raw.csv"), unit="counts", counts_per_turn="8192,4000", rate=1000.0)
    assert identify([raw]).best.parameters["slope"] == pytest.approx(true["log"]["slope"], rel=1e-3)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 10))])
@pytest.mark.parametrize("kind", ["emg", "suit"])
def test_all_contractions_are_found_and_no_others(
    kind: str, seed: int, capsys: pytest.CaptureFixture[str], command: Command
) -> None:
    assert run(["sample", kind, ".", "--seed", str(seed)]) == 0
    true = truth(f"{kind}.truth.toml")["biceps"]
    capsys.readouterr()
    score = command.document("emg score biceps.csv --labels biceps.labels.csv")
    assert (score["detections"], score["misses"], score["false_activations"]) == (len(true["onset_s"]), 0, 0)
    assert [on for on, _ in score["contractions_s"]] == pytest.approx(true["onset_s"], abs=0.25)
    if kind == "emg":
        wearer = command.document("emg calibrate mvc.csv --rest rest.csv")
        assert 50.0 * wearer["rest"] < wearer["mvc"] < 1.5 * max(truth("emg.truth.toml")["mvc"]["contraction_mv"])


def test_the_rig_of_a_suit_is_one() -> None:
    assert run(["sample", "suit", "."]) == 0
    rig = Rig.read("suit.toml")
    assert rig.suit.worn
    onsets = truth("suit.truth.toml")["biceps"]["onset_s"]
    pauses = [later - earlier for earlier, later in itertools.pairwise(onsets)]
    assert min(pauses) > rig.emg.duration + 1.0, "a motion ends before the next one begins"
