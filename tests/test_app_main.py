"""The command line: what it prints, what it writes, and that a failure is one line, code 2 and nothing written."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from bowden import __version__
from bowden.app import command_line, main
from bowden.design import rig_of_bench
from bowden.operations.schema import json_schema
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).parents[1]
SHORT = "[reference]\nkind = 'periodic_minimum_jerk'\nperiod_s = 4.0\n[scenario]\nduration_s = 8.0\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder with a short rig in it."""
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(SHORT)
    return tmp_path


def check(document: str, schema: str) -> Any:
    parsed = json.loads(document)
    jsonschema.validate(parsed, json_schema(schema))
    return parsed


@pytest.mark.drawn
def test_simulate_prints_one_document_and_writes_what_it_names(command: Command) -> None:
    names = ("uncompensated", "observer", "adaptive")
    laws = [part for name in names for part in ("--law", name)]
    document = command.document("simulate", "rig.toml", *laws, "--csv", "--out", "deep/er")
    assert [run["law"] for run in document["runs"]] == list(names)
    assert [run["check"] for run in document["runs"]] == ["holds", "little_margin", "holds"]
    assert document["runs"][0]["rmse_deg"] > 3.0 * document["runs"][2]["rmse_deg"]
    assert document["runs"][0]["rmse_after_10s_deg"] is None
    written = sorted(str(path) for path in Path("deep/er").iterdir())
    assert sorted(document["files"]) == written
    trace = Trace.read("deep/er/adaptive.npz")
    assert len(trace) == 8000
    assert Trace.read("deep/er/adaptive.csv").columns.keys() == trace.columns.keys()
    assert trace.metrics().rmse_deg == document["runs"][2]["rmse_deg"]
    assert "adaptive" in Path("deep/er/simulate.html").read_text()


def test_an_unstable_run_that_is_forced_is_a_result_with_nulls(command: Command) -> None:
    printed = command("simulate rig.toml --preset paper --force --json")
    (run,) = check(printed.out, "simulate")["runs"]
    assert run.pop("law") == "adaptive"
    assert run.pop("check") == "does_not_hold"
    assert run.pop("stable") is False
    assert (run.pop("joint"), run.pop("motors")) == ("", [])
    assert set(run.values()) == {None}
    assert printed.err.startswith("bowden: note: adaptive fails the check on rig.toml, and runs because of --force: ")


def test_gains_that_do_not_hold_are_refused_before_anything_runs(folder: Path, command: Command) -> None:
    (folder / "slow.toml").write_text(SHORT + "[servo]\nnatural_frequency_hz = 1.0\n")
    printed = command("simulate slow.toml --law uncompensated --law cascaded_pid --json", code=2)
    assert printed.out == ""
    assert printed.err.startswith(
        "bowden: cascaded_pid fails the check on slow.toml: the sampled loop is unstable at a "
    )
    assert "; set " in printed.err
    assert "; the law bowden holds here, with " in printed.err
    assert printed.err.endswith(" (--law bowden); or run it anyway with --force (of 2 laws, none was run)\n")
    assert printed.err.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == ["rig.toml", "slow.toml"]


def test_the_bends_of_the_scenario_count(folder: Path, capsys: pytest.CaptureFixture[str], command: Command) -> None:
    gains = "[control]\nlaw = 'adaptive'\n[control.gains]\nerror_gain = 0.15\nfeedback_gain = 10.0\n"
    moved = "[scenario.bend]\nkind = 'scripted'\ntimes_s = [1.0, 2.0]\nbends_deg = [180.0, 3600.0]\n"
    (folder / "still.toml").write_text(SHORT + gains)
    (folder / "moved.toml").write_text(SHORT + moved + gains)
    reasons = []
    for rig in ("still.toml", "moved.toml"):
        main.run(["check", rig, "--json"])
        verdict = json.loads(capsys.readouterr().out)
        printed = command("simulate", rig, "--force", "--json")
        assert json.loads(printed.out)["runs"][0]["check"] == verdict["verdict"]
        assert (verdict["reason"] in printed.err) is (verdict["verdict"] != "holds")
        reasons.append(verdict["reason"])
    assert reasons[0] != reasons[1]


def test_little_margin_runs_with_a_note(command: Command) -> None:
    printed = command("simulate rig.toml --law observer --json")
    assert check(printed.out, "simulate")["runs"][0]["check"] == "little_margin"
    assert printed.err.startswith("bowden: note: observer has little margin on rig.toml: ")


def test_a_law_that_cannot_be_checked_is_not_locked_out(
    folder: Path, capsys: pytest.CaptureFixture[str], command: Command
) -> None:
    """The root of the joint's angle is no number a count below zero, where the check looks; the run is above."""
    (folder / "above.toml").write_text(SHORT.replace("period_s", "low_deg = 10.0\nperiod_s"))
    source = (ROOT / "examples" / "my_law.py").read_text().replace("import tanh", "import power, tanh")
    root = "return State(integral), command + 1e-9 * power(sample.joint, 0.5)"
    (folder / "law.py").write_text(source.replace("return State(integral), command", root))
    printed = command("simulate above.toml --law law.py --json")
    (figures,) = check(printed.out, "simulate")["runs"]
    assert (figures["check"], figures["stable"]) == (None, True)
    why = "law has no linear model: its command is no finite number at rest at 0° or a count of the encoder beside it"
    assert printed.err == f"bowden: note: law cannot be checked ({why}) and runs unchecked\n"
    assert main.run(["check", "above.toml", "--law", "law.py"]) == 2
    assert capsys.readouterr().err == f"bowden: {why}; expected a law that is defined there; correct the law\n"


def test_simulate_prints_a_table_and_tells_laws_of_one_name_apart(command: Command) -> None:
    own = str(ROOT / "examples" / "my_law.py")
    printed = command("simulate", "rig.toml", "--law", own, "--law", own, "--duration", "2", "--seed", "7")
    assert "my_law-2" in printed.out
    assert "out/simulate/simulate.html" in printed.out.replace("\\", "/")
    assert printed.err == ""
    assert Trace.read("out/simulate/my_law-2.npz").seed == 7


def test_a_rig_finds_its_own_law_beside_itself(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "rigs").mkdir()
    (folder / "rigs" / "my_law.py").write_text((ROOT / "examples" / "my_law.py").read_text())
    text = SHORT + "[control]\nlaw = 'my_law.py'\n[control.gains]\nintegral_gain = 0.0\n"
    (folder / "rigs" / "rig.toml").write_text(text)
    assert main.run(["simulate", "rigs/rig.toml", "--duration", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["runs"][0]["law"] == "my_law"
    assert Trace.read("out/simulate/my_law.npz").settings["gains"]["integral_gain"] == 0.0


def test_reproduce_keeps_to_its_schema(command: Command) -> None:
    document = command.document("reproduce --only fig4")
    assert {claim["id"] for claim in document["claims"]} == {
        f"fig4.{name}" for name in ("half_width", "ratio", "mismatch", "residual")
    }
    assert [Path(file).name for file in document["files"] if Path(file).is_file()] == ["reproduce.html"]


def test_init_writes_the_commented_default_and_never_over_a_file(
    capsys: pytest.CaptureFixture[str], command: Command
) -> None:
    assert main.run(["init", "new.toml", "--json"]) == 0
    assert check(capsys.readouterr().out, "init")["files"] == ["new.toml"]
    assert Path("new.toml").read_text(encoding="utf-8") == rig_of_bench.toml_text("new.toml", "bowden")
    assert "--force" in command.refused("init")
    assert Path("rig.toml").read_text() == SHORT
    assert main.run(["init", "--force"]) == 0
    assert capsys.readouterr().out.endswith("Next: bowden simulate rig.toml\n")
    assert Path("rig.toml").read_text(encoding="utf-8") == rig_of_bench.toml_text(law="bowden")
    assert Rig.read("rig.toml") == Rig(law="bowden", origin="rig.toml")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["simulate", "none.toml"], "cannot read none.toml: no such file or directory; write one with: bowden init"),
        (["simulate", "rig.toml", "--law", "adaptve"], "there is no law 'adaptve'; expected adaptive (did you mean"),
        (
            ["simulate", "rig.toml", "--preset", "papier"],
            "law 'adaptive' has no preset 'papier'; expected paper (did you mean this?)",
        ),
        (["simulate", "rig.toml", "--duration", "-3"], "a run of -3 s has 0 cycles"),
        (["simulate", "rig.toml", "--duration", "1e9"], "expected a duration that makes 2 to 10000000"),
        (["simulate", "rig.toml", "--out", "rig.toml"], "rig.toml is not a folder; choose another one with --out"),
        (["simulate"], "see bowden simulate --help"),
        (["init", "."], "is a folder; name the file: rig.toml"),
        (["simulat"], "simulat"),
    ],
)
@pytest.mark.parametrize("as_json", [False, True])
def test_a_failure_is_one_line_code_2_and_nothing_written(
    folder: Path, command: Command, arguments: list[str], said: str, as_json: bool
) -> None:
    printed = command(*[*arguments, "--json"] if as_json and arguments else arguments, code=2)
    assert printed.out == ""
    assert said in printed.err.replace("\\", "/")
    assert printed.err.startswith("bowden: ")
    assert printed.err.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["rig.toml"]


def test_an_interruption_is_code_130_and_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: Any) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(rig_of_bench, "toml_text", interrupted)
    assert main.run(["init", "new.toml"]) == 130
    assert capsys.readouterr().err == "bowden: interrupted\n"
    assert [path.name for path in Path().iterdir()] == ["rig.toml"]


def test_a_mistake_of_ours_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command_line, "seconds", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main.run(["init", "new.toml", "--json"])


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The installed command, in a process of its own."""
    return subprocess.run([Path(sys.executable).with_name("bowden"), *arguments], capture_output=True, text=True)


def test_the_installed_command(folder: Path) -> None:
    done = command("--version")
    assert (done.returncode, done.stdout) == (0, f"bowden {__version__}\n")
    done = command("simulate", "none.toml", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    done = command("init", "new.toml")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="nothing is read-only for root")
def test_a_read_only_folder_is_refused_before_anything_runs(folder: Path, command: Command) -> None:
    (folder / "locked").mkdir(mode=0o500)
    assert "locked is read-only" in command.refused("simulate rig.toml --out locked/deep")
