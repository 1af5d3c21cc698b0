"""``bowden identify``: its document, its two files, and that a failure is one line, code 2 and nothing written."""

import json
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import bowden
from bowden.app.main import run
from bowden.core.errors import OutputError
from bowden.identify.cable.fit import Fit, model_text
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.operations.identify import identify as operation
from bowden.operations.schema import json_schema
from bowden.plants.identified import load_cable
from bowden.plants.predicted import NAMES
from bowden.views.identify import _show_models

pytestmark = pytest.mark.usefixtures("undrawn")


TIME = np.arange(2000) / 100.0
MOTOR = np.radians(20.0 * np.sin(1.4 * TIME + 0.4) + 12.0 * np.sin(3.9 * TIME))
JOINT = -(0.938 * MOTOR - 0.129 * hysteresis(MOTOR, 0.0, BoucWen())) + 0.5
JOINT += 1e-4 * np.random.default_rng(0).standard_normal(len(TIME))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder with a log in it."""
    monkeypatch.chdir(tmp_path)
    write_log("log.csv", MOTOR, JOINT)
    return tmp_path


def write_log(name: str, motor: Any, joint: Any, header: str = "time_s,motor_deg,joint_deg") -> None:
    lines = [f"{t:.3f},{np.degrees(m):.6f},{np.degrees(j):.6f}" for t, m, j in zip(TIME, motor, joint, strict=True)]
    Path(name).write_text("\n".join([header, *lines]) + "\n")


@pytest.fixture(scope="module")
def fit() -> Fit:
    return bowden.identify(TIME, MOTOR, JOINT)


def document(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert run(["identify", *arguments, "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    parsed = json.loads(printed.out)
    jsonschema.validate(parsed, json_schema("identify"))
    return parsed


@pytest.mark.drawn
def test_the_document_and_the_files(capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, "log.csv", "--out", "deep/er")
    assert found["best"] == "bouc_wen"
    assert found["samples"] == len(TIME)
    assert found["models"]["bouc_wen"]["parameters"]["slope"] == pytest.approx(-0.938, rel=1e-3)
    assert 0.0 < found["models"]["bouc_wen"]["test_rms_deg"] < 0.01
    assert 0.5 < found["forecast"]["compensated_rms_deg"] / found["models"]["bouc_wen"]["test_rms_deg"] < 1.5
    assert found["forecast"]["uncompensated_rms_deg"] == found["models"]["line"]["test_rms_deg"]
    assert found["logs"][0]["cycles"] == {"whole": 5, "more": 0, "advice": None}
    kept = tomllib.loads(Path("deep/er/model.toml").read_text())
    assert kept["whole_cycles"] == 5
    assert kept["forecast"].keys() == found["forecast"].keys()
    assert kept["loop"].keys() == found["loop"].keys() - {"curve_error"}
    assert kept["loop"]["height_error"] == pytest.approx(found["loop"]["height_error"], rel=1e-4)
    assert sorted(path.name for path in Path("deep/er").iterdir()) == ["identify.html", "model.toml"]
    for name in NAMES:
        loaded = load_cable("deep/er/model.toml").model(name)
        assert dict(loaded.parameters) == found["models"][name]["parameters"]
    page = Path("deep/er/identify.html").read_text()
    assert "Use the model bouc_wen" in page
    assert "Forecast: a law with this model as feed-forward" in page
    assert page.count("<svg") == 3
    assert all(name in page for name in NAMES)


def test_what_does_not_exist_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    write_log("ramp.csv", 0.02 * TIME, 0.9 * 0.02 * TIME)
    found = document(capsys, "ramp.csv")
    assert found["models"]["play"]["uncertainty"]["half_width"] is None
    assert found["loop"] is None
    assert any("does not reverse" in warning for warning in found["warnings"])
    text = Path("out/identify/model.toml").read_text()
    assert tomllib.loads(text)["models"]["play"]["uncertainty"]["half_width"] == float("inf")
    assert "not identifiable from this log" in text
    assert "∞" in Path("out/identify/identify.html").read_text()


def test_a_table_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    write_log("odd.csv", MOTOR, JOINT, header="a,b,c")
    assert run(["identify", "odd.csv", "--time", "a", "--motor", "b", "--joint", "c", "--unit", "deg"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "bouc_wen *" in printed.out
    assert "as feed-forward" in printed.out
    assert "out/identify/model.toml" in printed.out.replace("\\", "/")


def test_a_model_without_deviations_says_those_of_its_loop(fit: Fit, capsys: pytest.CaptureFixture[str]) -> None:
    unknown = replace(fit.chosen, uncertainty=dict.fromkeys(fit.chosen.uncertainty, math.nan))
    found = operation(fit.log)
    _show_models(replace(found, fit=replace(fit, models={**fit.models, fit.best.name: unknown})))
    said = capsys.readouterr().out
    assert re.search(r"loop's slope +-0\.\d+ ± \S+ rad/rad\n", said)
    assert re.search(r"loop's height +\d\.\d+ ± \S+°\n", said)
    assert "no deviation of a single one is given: take those of the loop" in said


def test_the_same_log_writes_the_same_bytes(capsys: pytest.CaptureFixture[str]) -> None:
    document(capsys, "log.csv", "--out", "one")
    document(capsys, "log.csv", "--out", "two")
    for name in ("model.toml", "identify.html"):
        assert Path("one", name).read_bytes() == Path("two", name).read_bytes()


BAD = {
    "no such file": (["none.csv"], "cannot read none.csv: no such file"),
    "a folder": (["."], "is a folder"),
    "not a number": (["text.csv"], "line 5: motor_deg is 'x'; expected a number"),
    "a file in the way": (["log.csv", "--out", "log.csv"], "log.csv"),
    "unknown option": (["log.csv", "--colour", "red"], "--colour"),
}


@pytest.mark.parametrize(("arguments", "said"), BAD.values(), ids=BAD)
@pytest.mark.parametrize("json_too", [False, True], ids=["text", "json"])
def test_bad_input_is_one_line_code_two_and_nothing_written(
    arguments: list[str], said: str, json_too: bool, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = Path("log.csv").read_text().splitlines()
    Path("text.csv").write_text("\n".join([*lines[:4], "0.03,x,1.0", *lines[5:]]))
    before = sorted(folder.rglob("*"))
    assert run(["identify", *arguments, *(["--json"] if json_too else [])]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert said in printed.err
    assert sorted(folder.rglob("*")) == before


def test_the_file_reads_back_as_it_was_written(fit: Fit, tmp_path: Path) -> None:
    fit.write(tmp_path / "model.toml")
    best = load_cable(tmp_path / "model.toml").model()
    assert best == fit.best
    assert np.array_equal(best.joint_angle(MOTOR), fit.best.joint_angle(MOTOR))
    assert load_cable(tmp_path / "model.toml").bouc_wen.slope < 0.0


def test_every_parameter_stands_with_unit_and_meaning(fit: Fit) -> None:
    (one,) = fit.logs
    named = replace(one, log=replace(one.log, name='odd "name"\nof\\a log'))
    text = model_text(replace(fit, logs=(named,)))
    assert tomllib.loads(text)["source"] == 'odd "name" of\\a log'
    assert f"# The cable of {'odd'}" in text
    for name in NAMES:
        section = text.split(f"[models.{name}.parameters]\n")[1].split("\n\n")[0].splitlines()
        assert len(section) == len(fit.models[name].parameters)
        assert all("  # [" in line and "; " in line for line in section)


def test_a_model_file_that_cannot_be_written(fit: Fit, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        fit.write(tmp_path / "no" / "model.toml")
