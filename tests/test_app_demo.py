"""``bowden demo``: from a log to a page, each step with its own words, and an end where a step refuses."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest

from bowden.app.main import run
from bowden.live.figures import EndedRun, RunStop
from bowden.operations import demo
from bowden.operations.schema import json_schema
from bowden.records.trace import LED, Trace
from bowden.report import demo_page
from live_runs import tries
from support.blank import blank

pytestmark = pytest.mark.usefixtures("undrawn")
WELL = blank(
    EndedRun,
    **{"ended_well": True, "seconds_led": 1.0, "rmse_deg": 0.1, "peak_deg": 0.2, "torque": "off", "drive": "a twin"},
    **{"cycles_logged": 9, "log": Path("out/demo/bowden-1.mcap"), "log_whole": True},
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(demo, "LENGTH", 3.0)
    return tmp_path


def recorded() -> Trace:
    """The columns of a live run that the page is made of."""
    time = np.arange(0.0, 1.0, 1e-3)
    columns = dict.fromkeys(("reference", "joint", "motor"), 0.1 * time) | {
        "time": time,
        "source": 0.0 * time + LED,
    }
    columns |= {"lateness": 0.0 * time + 1e-4, "run_time": 0.0 * time + 2e-4}
    return Trace(columns, dict.fromkeys(columns, "1") | dict.fromkeys(("reference", "joint", "motor"), "rad"))


@pytest.mark.parametrize("well", [True, False])
def test_it_goes_from_a_simulated_log_to_a_page_with_commands_for_ones_own(
    well: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ended = WELL if well else replace(WELL, ended_well=False, stalled_ms=80.0)
    monkeypatch.setattr(demo, "_live", lambda *_, **__: (SimpleNamespace(trace=recorded), ended))
    assert run(["demo", *(["--json"] if well else [])]) == (0 if well else 1)
    printed = capsys.readouterr().out
    page = Path("out/demo/demo.html").read_text(encoding="utf-8")
    commands = re.search(r"<pre>(.*?)</pre>", page, re.DOTALL)[1].splitlines()  # type: ignore[index]
    assert [shlex.split(line)[1] for line in commands] == ["identify", "init", "check", "simulate", "run"]
    assert "make paper" in page
    if well:
        found = json.loads(printed)
        jsonschema.validate(found, json_schema("demo"))
        without, law = (one["rmse_deg"] for one in found["runs"])
        assert law < 0.1 * without
    else:
        assert re.findall(r"^(\w+):", printed, re.MULTILINE) == [
            "Log",
            "Model",
            "Rig",
            "Check",
            "Simulation",
            "Live",
            "Live",
            "Page",
            "Next",
        ]
        assert "it was ended by this computer, which stalled, and not by the rig" in page
        assert printed.splitlines()[-1].startswith("Next: bowden demo my.csv")


def test_a_step_that_refuses_ends_it_with_its_own_message(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["demo", "my.csv"]) == 2
    assert capsys.readouterr().err == "bowden: cannot read my.csv: no such file; check the path\n"
    time = np.arange(0.0, 20.0, 0.01)
    joint = np.random.default_rng(1).normal(0.0, 1.0, len(time)).cumsum()
    rows = "\n".join(f"{t:.2f},{30 * np.sin(t):.3f},{j:.3f}" for t, j in zip(time, joint, strict=True))
    Path("my log.csv").write_text(f"time_s,a,b\n{rows}\n")
    assert run(["demo", "my log.csv", "--motor", "a", "--joint", "b", "--unit", "deg"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert "is not to be trusted: " in last
    (command,) = re.findall(r"bowden (identify .*?) draws", last)
    assert command == "identify 'my log.csv' --motor a --joint b --unit deg"
    assert not Path("out/demo/demo.toml").exists()
    assert run(shlex.split(command)) == 1, "its model is not to be trusted"


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (WELL, "ended as asked"),
        (replace(WELL, ended_well=False, stops=(RunStop(1.0, (), (), (), "late"),)), "by this computer"),
        (replace(WELL, ended_well=False, faults=("joint lost",)), "ended before its time: joint lost"),
    ],
)
def test_how_a_live_run_ended_is_said(found: EndedRun, said: str) -> None:
    assert said in demo_page.ending(found)


def test_the_commands_for_ones_own_log_are_commands() -> None:
    for line in demo_page.own_commands(["my log.csv", "--unit", "deg"], "bowden"):
        assert run([shlex.split(line)[1], "--help"]) == 0


@pytest.mark.long
@pytest.mark.live
def test_it_runs_live_on_a_twin() -> None:
    for _ in tries():
        if run(["demo", "--json"]) == 0:
            break
    assert Path("out/demo/demo.html").is_file()
    assert list(Path("out/demo").glob("bowden-*.mcap"))
