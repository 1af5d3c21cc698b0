"""Trust is a value of the model: given to good logs, kept from bad ones, and it goes along into every rig."""

import importlib
import json
import math
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bowden
from bowden.app.main import run
from bowden.plants.identified import load_cable
from bowden.plants.trust import Trust
from bowden.rig.rig import Rig

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
TIME = np.arange(0.0, 20.0, 0.02)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])
    return importlib.import_module("identify_trust")


def play(motor: np.ndarray, width: float = 4.0) -> np.ndarray:
    """The joint of a play of that half width, in the motor's unit."""
    joint, last = np.empty_like(motor), 0.0
    for i, angle in enumerate(motor):
        last = joint[i] = min(max(last, angle - width), angle + width)
    return 0.9 * joint


@pytest.mark.parametrize("number", range(8))
def test_a_fault_takes_the_trust_that_the_log_had_without_it(drawn: Any, number: int) -> None:
    good, bad = drawn.trust_rows("development", number)
    assert good[3] == "yes", good
    assert bad[3] != "yes", bad


@pytest.mark.parametrize("number", range(5))
def test_the_drawn_family_is_found_or_one_as_good(drawn: Any, number: int) -> None:
    row = drawn.family_row("development", number, 1e4, longest=100.0)
    assert row[7] <= drawn.WORSE or row[4] == row[1], row


def test_a_yes_to_one_amplitude_says_that_inner_loops_are_unseen_until_they_are_recorded() -> None:
    swing = 20.0 * np.sin(2.0 * np.pi * 0.5 * TIME)
    one = bowden.identify(TIME, swing, play(swing), unit="deg")
    assert one.trust.level == "yes"
    (said,) = (why for why in one.trust.reasons if "one amplitude" in why)
    assert "record strokes of a half and a quarter" in said
    several = swing * np.array([1.0, 0.5, 0.25, 1.0, 0.5])[(TIME // 4.0).astype(int)]
    found = bowden.identify(TIME, several, play(several), unit="deg")
    assert not any("one amplitude" in why for why in found.trust.reasons)


@pytest.mark.long
def test_a_longer_log_has_no_worse_model() -> None:
    """250 strokes of many are read, whose corners stay as sharp as a short log's."""
    time = np.arange(0.0, 1500.0, 0.04)
    motor = 45.0 * np.sin(2.0 * math.pi * 0.3 * time)
    draw = np.random.default_rng(3)
    joint = play(motor) + 0.03 * draw.standard_normal(len(time))
    fit = bowden.identify(time, motor, joint, unit="deg")
    assert fit.best.name == "play"
    assert np.rad2deg(fit.chosen.test_rms) < 0.031


@pytest.mark.parametrize("dither", [0.0, 0.05])
def test_rows_that_repeat_the_joint_are_left_out(dither: float) -> None:
    motor = 45.0 * np.sin(1.3 * TIME)
    held = np.repeat(play(motor)[::10], 10) + dither * np.random.default_rng(5).standard_normal(len(TIME))
    fit = bowden.identify(TIME, motor, held, unit="deg")
    assert fit.trust.level == "with care"
    assert "the joint repeats 10 rows: 5 Hz; the others were left out" in fit.trust.reasons
    assert np.rad2deg(fit.models["play"].parameters["half_width"]) == pytest.approx(4.0, abs=0.1)


def test_an_encoder_that_dithers_by_less_than_a_count_repeats_no_rows() -> None:
    time = np.arange(0.0, 40.0, 0.002)
    motor = 45.0 * (2.0 * np.abs(2.0 * ((0.1 * time) % 1.0) - 1.0) - 1.0)
    joint = play(motor, 4.5) / 0.9 * 1.4 + 0.04 * np.random.default_rng(7).standard_normal(len(time))
    fit = bowden.identify(time, motor, np.round(joint / 0.088) * 0.088, unit="deg")
    assert not [why for why in fit.trust.reasons if "repeats" in why]


def test_rows_that_repeat_both_angles_are_no_fault() -> None:
    """Unless the rows that are left are so far apart that a late one alone makes such a loop."""
    for rows, level in ((2, "yes"), (5, "with care")):
        motor = np.repeat(45.0 * np.sin(1.3 * TIME[::rows]), rows)
        trust = bowden.identify(TIME, motor, play(motor), unit="deg").trust
        assert trust.level == level, trust
        assert ("if it is one row late" in trust.reasons[0]) == (level != "yes")


@pytest.mark.parametrize(
    ("joint", "level", "why"),
    [
        (
            play(45.0 * np.sin(1.3 * TIME)) + 2.0 * TIME / 60.0 * 3.0,
            "with care",
            "the joint's sensor drifts by 6°/min",
        ),
        (np.minimum(play(45.0 * np.sin(1.3 * TIME)), 25.0), "with care", "the joint stands at 25° while"),
    ],
)
def test_what_a_sensor_does_is_not_laid_to_the_cable(joint: np.ndarray, level: str, why: str) -> None:
    fit = bowden.identify(TIME, 45.0 * np.sin(1.3 * TIME), joint, unit="deg")
    assert fit.trust.level == level
    assert why in str(fit.trust)
    assert "the cable changed" not in str(fit.trust)


def test_a_motor_that_never_reverses_is_not_called_swapped() -> None:
    motor = 100.0 - 5.0 * TIME
    trust = bowden.identify(TIME, motor, motor - 0.01 * (motor - 50.0) ** 2, unit="deg").trust
    assert trust.level == "no"
    assert "never reverses" in trust.reasons[0]
    assert "swapped" not in str(trust)


def test_a_length_is_refused_and_the_advice_works(tmp_path: Path) -> None:
    motor = 0.8 * np.sin(1.3 * TIME)
    joint = play(motor, 0.07)
    file = tmp_path / "log.csv"

    def write(name: str, values: np.ndarray) -> None:
        table = np.column_stack([TIME, values, joint])
        np.savetxt(file, table, fmt="%.6f", delimiter=",", header=f"time_s,{name},joint_rad", comments="")

    write("motor_mm", 20.0 * motor)
    with pytest.raises(
        bowden.BowdenError, match=r"in mm; expected an angle: .*; give the radius of its spool: --spool-radius-mm"
    ):
        bowden.identify(file)
    assert bowden.identify(file, spool_radius_mm=20.0).trust.level == "yes"


def test_trust_goes_from_the_log_into_each_command_on_the_rig(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    motor = 40.0 + 30.0 * np.sin(1.3 * TIME)
    noise = np.random.default_rng(1).normal(0.0, 4.0, len(TIME))
    table = np.column_stack([TIME, motor, play(motor) + noise])
    np.savetxt("log.csv", table, fmt="%.4f", delimiter=",", header="time_s,motor_deg,joint_deg", comments="")
    assert run(["identify", "log.csv"]) == 1
    said = capsys.readouterr().out.splitlines()
    assert said[-1].startswith("Next: correct the log, or record another, and identify it: the model predicts hardly")
    assert not any("bowden init" in line for line in said)
    cable = load_cable("out/identify/model.toml")
    assert cable.trust is not None
    assert cable.trust.level == "no"
    for command in (["init", "--model", "out/identify/model.toml"], ["check", "rig.toml"]):
        run(command)
        said = capsys.readouterr().out.splitlines()
        assert said[0].startswith("Trust in the cable's model: no: the model predicts hardly better")
        assert said[0].endswith(" (more: [trust] of out/identify/model.toml)") is ("check" in command)
    run(["check", "rig.toml", "--json"])
    assert json.loads(capsys.readouterr().out)["trust"] == {"level": "no", "reasons": list(cable.trust.reasons)}
    rig = Rig.read("rig.toml")
    assert Rig.unpack(rig.document()).cable.trust == cable.trust
    Path("again").mkdir()
    rig.write("again/rig.toml")
    assert isinstance(trust := Rig.read("again/rig.toml").cable.trust, Trust)
    assert trust == cable.trust

    def doubted(call: Callable[[], Any]) -> Any:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            found = call()
        (said,) = (str(one.message) for one in told if "Trust in the cable's model" in str(one.message))
        assert said.startswith("Trust in the cable's model: no: the model predicts hardly better")
        return found

    assert doubted(lambda: bowden.init("out/identify/model.toml")).cable_trust == cable.trust
    assert doubted(lambda: bowden.check(rig, "uncompensated")).cable_trust == cable.trust
    trace = doubted(lambda: bowden.simulate(rig, "uncompensated", duration=2.0))
    assert trace.settings["cable_trust"] == cable.trust._asdict()
    doubted(lambda: bowden.run(rig, twin=True))
    found = doubted(lambda: bowden.export(rig, "firmware", "uncompensated", force=True))
    assert found.cable_trust == cable.trust


def test_a_family_whose_parameters_no_cable_has_is_left_out_of_the_file(tmp_path: Path) -> None:
    motor = 45.0 * np.sin(1.3 * TIME)
    fit = bowden.identify(TIME, motor, play(motor), unit="deg")
    other = fit.models["bouc_wen_static"]
    absurd = replace(other, model=replace(other.model, parameters={**other.parameters, "slope": 1e4}))
    replace(fit, models={**fit.models, "bouc_wen_static": absurd}).write(tmp_path / "model.toml")
    assert "bouc_wen_static" not in load_cable(tmp_path / "model.toml").models
    assert run(["init", str(tmp_path / "rig.toml"), "--model", str(tmp_path / "model.toml")]) == 0
