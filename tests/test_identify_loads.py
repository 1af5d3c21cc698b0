"""Several logs of one cable: what is recovered, what the plant does with it, what is refused; and recalibration."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray

import bowden
from bowden.app.main import run
from bowden.core.errors import BowdenError
from bowden.core.units import DEGREES
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import Recalibration
from bowden.identify.cable.identification import identify
from bowden.identify.cable.loads import _levels
from bowden.identify.log.read import Log, read_log
from bowden.identify.log.variables import Scheduled, variables_of
from bowden.models.cable.bouc_wen import saturation
from bowden.models.cable.scheduled import ScheduledCable, bouc_wen_at, cable_of, joint_angle, line_of, parameters_of
from bowden.operations.schema import json_schema
from bowden.plants.bends import ConstantBend
from bowden.plants.cable import Cable
from bowden.plants.identified import CableModel, IdentifiedCable, load_cable
from bowden.plants.recounted import recalibrated
from bowden.plants.scheduled_cable import scheduled

Array = NDArray[np.float64]

TIME = np.arange(1500) / 75.0
MOTOR = 0.5 * np.sin(1.7 * TIME + 0.2) + 0.02 * np.sin(0.31 * TIME)
LOADS = (0.1, 0.2, 0.35, 0.5)
KNOTS = np.linspace(-0.5, 0.5, 9)


def true_cable(slope: float = -0.9) -> ScheduledCable:
    """Offset, slope, height and shape depend on the load; the offset also on its square."""
    sign = math.copysign(1.0, slope)
    middle = np.array([slope * KNOTS + 0.03 * KNOTS**2 + 0.4, 0.15 + 0.02 * KNOTS, np.full(9, -0.04)])
    height = -sign * np.array([0.03 + 0.01 * KNOTS, np.full(9, 0.015), np.zeros(9)])
    widths = np.array([0.01, 0.05])
    shares = np.array([0.7 / 0.01, 0.3 / 0.05])
    low, high = np.array([LOADS[0]]), np.array([LOADS[-1]])
    return ScheduledCable(-0.5, 0.125, middle, height, widths, shares, low, high, np.array([2]))


def log_at(load: float, slope: float = -0.9, noise: float = 2e-4) -> Log:
    joint = joint_angle(MOTOR, true_cable(slope), [load])
    joint = joint + noise * np.random.default_rng(int(1000 * load)).standard_normal(len(TIME))
    return Log(TIME, MOTOR, joint, f"log at {load}", ())


def at_loads(logs: list[Log], loads: Any) -> Fit:
    return identify(logs, [Scheduled("load", tuple(loads), "N·m", "")])


def gain_of(log: Log, cable: IdentifiedCable, judged: float = math.nan) -> Recalibration:
    found = identify([log], known=dataclasses.replace(cable, judged=judged)).recalibration
    assert found is not None
    return found


@pytest.fixture(scope="module")
def fit() -> Fit:
    return at_loads([log_at(load) for load in LOADS], LOADS)


def test_a_load_between_those_that_were_seen_is_predicted(fit: Fit) -> None:
    expected = joint_angle(MOTOR, true_cable(), [0.27])
    error = (fit.at(load=0.27).joint_angle(MOTOR) - expected)[300:]
    assert np.sqrt(np.mean(error**2)) < 6e-4  # the loop's corners lie between knots
    assert fit.units == {"load": "N·m"}
    assert all(one.unseen_offset_rms < 0.1 / DEGREES for one in fit.logs[1:-1])


def test_both_branches_go_one_way_at_every_load_that_was_seen(fit: Fit) -> None:
    cable, _ = cable_of(fit.best.parameters)
    for load in np.linspace(LOADS[0], LOADS[-1], 7):
        weights = np.array([1.0, s := (load - LOADS[0]) / (LOADS[-1] - LOADS[0]), s * s])
        middle, height = weights @ cable.middle, weights @ cable.height
        assert np.all(np.diff(middle + height) < 0.0)
        assert np.all(np.diff(middle - height) < 0.0)


def test_beyond_its_range_a_load_goes_on_straight_and_then_stays() -> None:
    cable, width = true_cable(), LOADS[-1] - LOADS[0]
    at = [float(joint_angle(np.zeros(1), cable, [LOADS[-1] + part * width])[0]) for part in (0.0, 0.4, 0.8, 1.0, 3.0)]
    assert at[2] - at[1] == pytest.approx(at[1] - at[0], rel=1e-9)
    assert at[4] == at[3]


def moved(cable: Cable, motor: Array, widths: Array) -> Array:
    memory, joints = cable.start(cable.prepared, float(motor[0]), widths[0], 1.0), np.empty(len(motor))
    for i, after in enumerate(motor.tolist()):
        before = float(motor[max(i - 1, 0)])
        scaled = (after - before) / widths[i]
        memory = cable.advance(cable.prepared, memory, before, after, scaled, widths[i], 0.01)
        joints[i] = cable.look(cable.prepared, memory, after, widths[i], 1.0).joint
    return joints


def test_a_load_that_changes_is_moved_by_the_sheath() -> None:
    parameters = parameters_of(true_cable(), ["load"], [0.3])
    cable = scheduled(parameters, "load")
    low, high = (joint_angle(MOTOR, true_cable(), [load]) for load in (LOADS[0], LOADS[-1]))
    half = len(TIME) // 2
    joint = moved(cable, -MOTOR, np.where(np.arange(len(TIME)) < half, 1.0, 2.0))
    assert np.allclose(joint[:half], low[:half], atol=1e-12)
    assert np.allclose(joint[half:], high[half:], atol=1e-12)


def test_laws_are_told_slope_and_dead_zone_at_the_load(fit: Fit) -> None:
    rigs = [bowden.Rig(cable=fit.at(load=load)) for load in (LOADS[0], LOADS[-1])]
    for rig, load in zip(rigs, (LOADS[0], LOADS[-1]), strict=True):
        slope, _, height = line_of(true_cable(), [load])
        assert rig.knowledge.slope == pytest.approx(-slope, rel=0.01)
        assert rig.knowledge.width == pytest.approx(2.0 * abs(height / slope), rel=0.05)
        assert rig.moved.cable.name == "scheduled"
    assert rigs[1].knowledge.width > 1.3 * rigs[0].knowledge.width
    far = bowden.Rig(cable=fit.at(load=2.0))
    assert any("lies outside" in note for note in far.notes)
    assert not any("lies outside" in note for note in rigs[0].notes)


def test_the_bouc_wen_cable_has_the_loops_height_and_follows_over_its_dead_zone() -> None:
    found = [bouc_wen_at(true_cable(), [load], bowden.BoucWen()) for load in (LOADS[0], LOADS[-1])]
    heights = [line_of(true_cable(), [load])[2] for load in (LOADS[0], LOADS[-1])]
    assert [one.hysteresis_gain * float(saturation(one)) for one in found] == pytest.approx(heights, rel=1e-6)
    zones = [height / one.slope for one, height in zip(found, heights, strict=True)]
    assert found[0].rate / found[1].rate == pytest.approx(zones[1] / zones[0], rel=0.01)


def test_equal_loads_make_one_model_and_two_loads_are_said() -> None:
    found = at_loads([log_at(0.1), log_at(0.1)], [0.1, 0.1])
    assert found.units == {}
    assert any("in all logs, so that it schedules nothing" in said for said in found.warnings)
    assert not any(name.startswith("load") for name in found.best.parameters)
    assert any("two values only" in said for said in at_loads([log_at(0.1), log_at(0.5)], [0.1, 0.5]).warnings)


def test_a_log_with_another_zero_is_named() -> None:
    logs = [log_at(load) for load in (0.1, 0.1, 0.5, 0.5)]
    shifted = dataclasses.replace(logs[1], joint=logs[1].joint + 0.1, name="shifted")
    found = at_loads([logs[0], shifted, *logs[2:]], [0.1, 0.1, 0.5, 0.5])
    assert any("shifted by 2.9°" in said and "one zero" in said for said in found.warnings)
    assert not any("one zero" in said for said in at_loads(logs, [0.1, 0.1, 0.5, 0.5]).warnings)


def test_a_load_and_a_bend_that_change_together_are_refused() -> None:
    both = [Scheduled(name, tuple(k * load for load in LOADS), "", "") for name, k in (("load", 1.0), ("bend", 2.0))]
    with pytest.raises(BowdenError, match="change together"):
        identify([log_at(load) for load in LOADS], both)


@pytest.mark.parametrize(
    ("logs", "load", "message"),
    [
        ([0.1], [0.1], "load= with one log, which cannot tell what the load changes"),
        ([0.1, 0.2], [0.1], r"1 value of the load for 2 logs; expected one for each"),
        ([0.1, 0.2], [0.1, math.nan], r"the load of log at 0.2 is nan|load\[1\] is nan"),
        ([0.1, -0.2], [0.1, 0.2], r"moves \+0.8\d* times as far as the motor, in log at 0.1 -0.8\d* times"),
    ],
)
def test_logs_that_do_not_go_together_are_refused(logs: list[float], load: list[float], message: str) -> None:
    read = [log_at(abs(one), math.copysign(0.9, -one)) for one in logs]
    with pytest.raises(BowdenError, match=message):
        bowden.identify(read, load=load)


# recalibration


def known(name: str = "play") -> IdentifiedCable:
    parameters = {"slope": -0.9, "half_width": 0.03, "offset": 0.2, "initial_lag": 0.0}
    plain = dict(bowden.BoucWen(slope=-0.9, hysteresis_gain=0.03)._asdict()) | {"initial_h": 0.0}
    return IdentifiedCable(name, {"play": parameters, "bouc_wen": plain})


def new_log(gain: float, offset: float, wider: float = 1.0, samples: int = 600) -> Log:
    model = dict(known().model().parameters) | {"half_width": 0.03 * wider, "initial_lag": -0.02}
    joint = gain * CableModel("play", model).joint_angle(MOTOR[:samples]) + offset
    noise = 2e-4 * np.random.default_rng(3).standard_normal(samples)
    return Log(TIME[:samples], MOTOR[:samples], joint + noise, "new", ())


def test_gain_and_offset_come_back_from_seconds_of_motion() -> None:
    fit = identify([new_log(0.97, 0.05)], known=known())
    found = gain_of(new_log(0.97, 0.05), known(), 0.05 / DEGREES)
    assert found.gain == pytest.approx(0.97, abs=2e-3)
    assert fit.best.parameters["offset"] == pytest.approx(0.97 * 0.2 + 0.05, abs=5e-4)
    assert fit.best.parameters["half_width"] == 0.03
    assert found.changed is False
    assert found.after_rms < 0.1 * found.before_rms


def test_a_cable_that_has_changed_is_called_so_and_one_without_a_judgement_is_not() -> None:
    assert gain_of(new_log(1.0, 0.0, wider=1.6), known(), 0.05 / DEGREES).changed is True
    assert gain_of(new_log(1.0, 0.0, wider=1.6), known()).changed is None
    assert gain_of(new_log(1.0, 0.0), known(), 1e-9).changed is False  # what is left is of no use to anybody


def test_a_joint_that_moves_the_other_way_or_a_motor_that_does_not_turn_is_refused() -> None:
    with pytest.raises(BowdenError, match=r"moves -1 times as far as the model play says"):
        gain_of(new_log(-1.0, 0.0), known(), 0.01)
    with pytest.raises(BowdenError, match="does not turn back"):
        gain_of(new_log(1.0, 0.0, samples=50), known(), 0.01)


def swept(half: float, gain: float = 1.0) -> Log:
    """A play with a bent middle, moved by a stroke of that half-width."""
    motor = half * np.sin(2.5 * TIME)
    joint = CableModel("play", known().model().parameters).joint_angle(motor) + 0.02 * np.sin(8.0 * motor)
    return Log(TIME, motor, gain * joint + 3e-4 * np.random.default_rng(1).standard_normal(len(TIME)), "swept", ())


@pytest.fixture(scope="module")
def narrow() -> Fit:
    log = swept(0.25)
    return bowden.identify(log.time, log.motor, log.joint)


def test_a_wider_stroke_than_identified_gets_no_verdict(narrow: Fit) -> None:
    found = gain_of(swept(0.5), narrow.best.identified(), narrow.judged_rms)
    assert found.changed is None
    assert found.beyond == pytest.approx(0.25, abs=0.01)
    assert "outside the identified stroke" in found.verdict
    same = gain_of(swept(0.25), narrow.best.identified(), narrow.judged_rms)
    assert (same.changed, same.beyond) == (False, 0.0)


def test_a_gain_that_no_recalibration_explains_is_a_change(narrow: Fit) -> None:
    found = bowden.identify(swept(0.25, 0.5), model=narrow)
    assert found.recalibration is not None
    assert found.recalibration.changed is True
    assert found.trust.level == "no"
    assert any("further from 1 than a bend or stretch of the cable explains" in said for said in found.warnings)
    assert gain_of(swept(0.25, 0.9), narrow.best.identified(), narrow.judged_rms).changed is False


def test_all_families_get_the_gain_and_offset_of_the_best(narrow: Fit) -> None:
    found = bowden.identify(swept(0.05), model=narrow)
    gain = found.recalibration
    assert gain is not None
    for name, parameters in found.best.others.items():
        assert dict(parameters) == recalibrated(narrow.models[name].parameters, gain.gain, gain.offset), name


def test_a_gain_of_exactly_one_is_no_gain_that_was_not_fitted() -> None:
    log = new_log(1.0, 0.0)
    exact = dataclasses.replace(log, joint=CableModel("play", known().model().parameters).joint_angle(log.motor))
    found = identify([exact], known=known())
    assert gain_of(exact, known(), 0.01).gain == pytest.approx(1.0, abs=1e-3)
    assert not any("too short" in said for said in found.warnings)


def test_the_unit_of_the_load_is_compared_and_kept(fit: Fit, tmp_path: Path) -> None:
    fit.write(tmp_path / "model.toml")
    known = load_cable(tmp_path / "model.toml")
    with pytest.raises(BowdenError, match=r"the load is in mN·m, .*model.toml has it in N·m"):
        identify([log_at(0.2)], [Scheduled("load", (200.0,), "mN·m", "")], known)
    identify([log_at(0.2)], [Scheduled("load", (0.2,), "", "")], known).write(tmp_path / "new.toml")
    assert load_cable(tmp_path / "new.toml").units == {"load": "N·m"}


# what the review of several logs found


def test_loads_that_lie_close_are_levels_of_their_own() -> None:
    assert 10 <= _levels(np.linspace(1.0, 0.0, 25)).max() + 1 <= 20
    assert _levels(np.array([0.0, 1.0, 0.04, 0.97])).tolist() == [0, 1, 0, 1]


def test_a_sheath_takes_nothing_of_the_offset() -> None:
    cable = scheduled(parameters_of(true_cable(), ["load"], [0.3]))
    memory = cable.start(cable.prepared, 0.0, 1.0, 1.0)
    at = {part: cable.look(cable.prepared, memory, 0.0, 1.0, part).joint for part in (1.0, 0.9)}
    assert at[0.9] == pytest.approx(at[1.0], abs=1e-12)
    assert at[1.0] > 0.4


def test_a_rig_is_told_of_the_bends_of_its_run() -> None:
    values = parameters_of(true_cable(0.9), ["bend"], [0.3])
    plain = dict(bowden.BoucWen()._asdict()) | {"initial_h": 0.0}
    cable = CableModel("scheduled", values, others={"bouc_wen": plain})
    bent = bowden.Rig(cable=cable)
    assert any("the bend 180° lies outside" in note for note in bent.notes)
    assert any("is 180° in this run" in note and "not the 17.19°" in note for note in bent.notes)
    assert bent.moved.sheath.loss == 0.0
    within = bowden.Rig(cable=cable, bend=ConstantBend(0.5))
    assert not any("lies outside" in note for note in within.notes)
    slope, _, height = line_of(true_cable(0.9), [0.5])
    assert within.knowledge.slope == pytest.approx(slope, rel=1e-9)
    assert within.knowledge.width == pytest.approx(2.0 * abs(height / slope), rel=0.05)


# on the command line

SCHEMA = json_schema("identify")


def document(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert run(["identify", *arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, SCHEMA)
    return found


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None) -> list[str]:
    """Logs at four loads, the last without a column for it."""
    monkeypatch.chdir(tmp_path)
    for i, load in enumerate(LOADS):
        log = log_at(load)
        columns = [log.time, log.motor * DEGREES, log.joint * DEGREES, np.full(len(TIME), load)]
        names = ["time_s", "motor_deg", "joint_deg", "joint_torque_nm"]
        kept = 3 if i == 3 else 4
        rows = np.column_stack(columns[:kept])
        np.savetxt(f"{i}.csv", rows, "%.6f", ",", header=",".join(names[:kept]), comments="")
    return [f"{i}.csv" for i in range(4)]


def test_several_logs_become_a_model_that_a_rig_and_a_recalibration_take(
    files: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    found = document(capsys, *files[:3], "--out", "together")
    assert found["variables"] == {"load": "N·m", "bend": None}
    assert [one["load"] for one in found["logs"]] == pytest.approx(LOADS[:3])
    cable = load_cable("together/model.toml")
    assert dict(cable.model().parameters) == found["models"]["scheduled"]["parameters"]
    assert cable.judged * DEGREES == pytest.approx(found["judged_rms_deg"], rel=1e-5)
    Path("rig.toml").write_text('[cable]\nmodel = "together/model.toml"\n[cable.parameters]\nload = 0.15\n')
    assert bowden.Rig.read("rig.toml").cable.model().parameters["load"] == 0.15
    again = document(capsys, files[3], "--model", "together/model.toml", "--load", "0.35", "--out", "new")
    assert again["recalibration"]["gain"] == pytest.approx(1.0, abs=0.05)
    assert load_cable("new/model.toml").best == "scheduled"
    assert "loop" in Path("together/identify.html").read_text()


def test_a_bend_is_shown_in_degrees(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["identify", *files[:3], "--load", "none", "--bend", "100,140,180", "--out", "bent"]) == 0
    said = capsys.readouterr().out
    assert "rad" not in said.splitlines()[2]
    assert [line.split()[2] for line in said.splitlines() if line.strip().startswith(tuple(files[:3]))][:3] == [
        *("100", "140", "180")
    ]
    fit = bowden.identify(files[:3], load="none", bend=[1.0, 2.0, 3.0])
    assert "bend 57.3°" in repr(fit)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["0.csv", "--load", "0.1"], "--load with one log, which cannot tell what the load changes"),
        (["0.csv", "3.csv"], "3.csv has no column for the load, others have 'joint_torque_nm'"),
        (["0.csv", "1.csv", "--load", "0.1"], "1 value of the load for 2 logs"),
        (["0.csv", "1.csv", "--load", "0.1,a"], "'a' among the values '0.1,a'; expected numbers with commas between"),
        (["0.csv", "1.csv", "--load", "tension"], "no column 'tension' for the load"),
        (["0.csv", "1.csv", "--model", "model.toml"], "--model with 2 logs"),
        (["0.csv", "--model", "none.toml"], "none.toml cannot be read"),
    ],
)
def test_a_wrong_command_line_is_refused_in_one_line(
    files: list[str], capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert run(["identify", *arguments]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert not Path("out").exists()


# on a real cable


@pytest.mark.long
def test_a_load_of_a_real_cable_that_was_left_out_is_predicted(shared_data: Path) -> None:
    files = sorted((shared_data / "cable_load").glob("*.csv.gz"))
    logs = [read_log(file) for file in files]
    found = identify(logs, variables_of({"load": "joint_torque_nm"}, files, logs, None))
    errors = {
        name: float(np.median([getattr(one, name) for one in found.logs])) * DEGREES
        for name in ("unseen_rms", "unseen_offset_rms", "same_rms", "same_offset_rms")
    }
    assert errors["unseen_rms"] <= 0.35
    assert errors["unseen_offset_rms"] <= 0.25
    assert errors["same_offset_rms"] <= 0.15
