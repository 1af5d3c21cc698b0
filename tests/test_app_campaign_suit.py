"""A study of suits on wearers: its rows are runs of ``bowden simulate``, and everything that may vary does."""

from pathlib import Path

import numpy as np
import pyarrow.dataset as ds
import pytest

from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES
from bowden.records.trace import Trace
from bowden.sim.rig_runs import run_of
from bowden.study.load import load
from bowden.study.rows import SUIT_FIGURES, table_of
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

STUDY = """
laws = ["uncompensated", "adaptive"]
runs = 6
duration_s = 1.5

[set]
"suit.worn" = true
"reference.high_deg" = 40.0
"reference.period_s" = 1.0
"scenario.bend" = { kind = "random", low_deg = 120.0, high_deg = 300.0, fastest_s = 0.2 }

[vary]
"wearer.mass_kg" = { uniform = [60, 90] }
"wearer.share" = { uniform = [0, 0.5] }
"suit.play_mm" = { uniform = [0.5, 2] }

[fault]
kind = { choice = ["nothing", "joint_frozen", "joint_nan"] }
begin_s = 1.0
length_s = 0.2
"""
RIG = """
[suit]
worn = true
play_mm = SUIT.PLAY_MM
[wearer]
mass_kg = WEARER.MASS_KG
share = WEARER.SHARE
[reference]
kind = "periodic_minimum_jerk"
high_deg = 40.0
period_s = 1.0
[scenario]
duration_s = 1.5
seed = SEED
bend = { kind = "random", low_deg = 120.0, high_deg = 300.0, fastest_s = 0.2 }
"""
FIGURES = ("rmse_deg", "rmse_after_10s_deg", "peak_deg", "mechanical_energy_j", "electrical_energy_j")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def test_a_row_is_the_run_of_bowden_simulate_to_the_last_bit(command: Command) -> None:
    summary = command.document("campaign study.toml --out out --workers 1")
    assert set(SUIT_FIGURES) <= set(summary["laws"][0]["figures"])
    rows = ds.dataset("out/runs").to_table().to_pylist()
    sound = next(row for row in rows if row["fault.kind"] == "nothing")
    text = RIG
    for name in ("suit.play_mm", "wearer.mass_kg", "wearer.share", "seed"):
        text = text.replace(name.upper(), repr(sound[name]))
    Path("rig.toml").write_text(text)
    names = ("uncompensated", "adaptive")
    laws = [part for name in names for part in ("--law", name)]
    simulated = command.document("simulate", "rig.toml", *laws, "--out", "simulated", "--force")
    for name, run in zip(names, simulated["runs"], strict=True):
        row = next(row for row in rows if (row["number"], row["law"]) == (sound["number"], name))
        assert [row[figure] for figure in FIGURES] == [run[figure] for figure in FIGURES]
        assert (row["ended"], row["cycles"]) == (run["stable"], 1500)
        trace = Trace.read(f"simulated/{name}.npz")
        tensions = [trace[f"{cable}{end}_tension"].max() for cable in ("flexor", "extensor") for end in ("", "_motor")]
        assert row["largest_tension_n"] == max(tensions)
        assert row["largest_torque_nm"] == np.abs(trace["interaction_torque"]).max()
        assert row["hottest_winding_c"] == trace["winding_temperature"].max()
        shown = trace["joint_measured"] - trace["reference"]
        assert row["shown_rmse_deg"] == float(np.sqrt(np.mean(np.square(shown)))) * DEGREES


def test_wearers_sheaths_noise_and_faults_differ_from_run_to_run() -> None:
    study = load(Path("study.toml"))
    time = np.linspace(0.0, 1.5, 7)
    cases = list(study.cases([(number, study.drawn(number)) for number in range(6)]))
    assert len({case.plant.arm.mass for case in cases}) == 6
    assert len({case.plant.wearer.share for case in cases}) == 6
    assert len({case.plant.flexor.half_width for case in cases}) == 6
    assert len({tuple(case.bend(time).tolist()) for case in cases}) == 6
    assert len({case.seed for case in cases}) == 6
    assert all(2.0 <= case.bend(time).min() <= case.bend(time).max() <= 5.3 for case in cases)
    rows = [row for row in table_of(study, range(6)).to_pylist() if row["law"] == "uncompensated"]
    assert {row["fault.kind"]: (row["ended"], row["cycles"]) for row in rows} == {
        "nothing": (True, 1500),
        "joint_frozen": (True, 1500),
        "joint_nan": (True, 1500),  # this law does not look at the joint
    }
    adaptive = [row for row in table_of(study, range(6)).to_pylist() if row["law"] == "adaptive"]
    lost = next(row for row in adaptive if row["fault.kind"] == "joint_nan")
    assert (lost["ended"], lost["cycles"], lost["rmse_deg"], lost["largest_tension_n"]) == (False, 1000, None, None)


def test_a_frozen_sensor_is_what_the_law_sees() -> None:
    """The run that ``--run`` shows, with its fault."""
    study = load(Path("study.toml"))
    number = next(n for n in range(6) if study.drawn(n).values["fault.kind"] == "joint_frozen")
    rig, laws, fault = study.run(number)
    trace = run_of(rig, laws[1], fault)
    (row,) = [r for r in table_of(study, [number]).to_pylist() if r["law"] == "adaptive"]
    assert trace.metrics().rmse_deg == row["rmse_deg"]
    assert len(set(trace["joint_measured"][1000:1200].tolist())) == 1
    assert len(set(trace["joint_measured"][800:1000].tolist())) > 10
    assert np.ptp(trace["joint"][1000:1200]) > 0.005


@pytest.mark.parametrize(
    "bend", ['{ kind = "scripted", times_s = [0, 1], bends_deg = [180, 360] }', '{ kind = "constant", bend_deg = 180 }']
)
def test_other_sheath_paths_vary_too(bend: str) -> None:
    scripted = "scripted" in bend
    text = STUDY.replace('{ kind = "random", low_deg = 120.0, high_deg = 300.0, fastest_s = 0.2 }', bend)
    key = "scenario.bend.bends_deg.1" if scripted else "scenario.bend.bend_deg"
    text = text.replace("[vary]", f'[vary]\n"{key}" = {{ uniform = [200, 300] }}')
    Path("study.toml").write_text(text)
    study = load(Path("study.toml"))
    for number in range(3):
        drawn = study.drawn(number)
        (case,) = study.cases([(number, drawn)])
        assert case.bend(np.array([1.0]))[0] * DEGREES == pytest.approx(float(drawn.values[key]))


def test_a_rig_that_goes_by_emg_is_refused(command: Command) -> None:
    Path("study.toml").write_text(STUDY.replace('"suit.worn"', '"emg.source" = "file:biceps.csv"\n"suit.worn"'))
    error = command("campaign study.toml", code=2).err
    assert "emg.source is 'file:biceps.csv'; expected a rig that goes by [reference]" in error


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            '"suit.drive_integral_per_s" = 20.0',
            "bowden: study.toml: suit.drive_integral_per_s is 20 under [admittance], where the loop of most wearers "
            "oscillates; expected 0; set it to 0 there\n",
        ),
        ("", "study.toml, run 0: suit.drive_integral_per_s is 1"),
    ],
)
def test_a_drive_with_an_integral_is_refused_under_admittance(line: str, said: str, command: Command) -> None:
    text = STUDY.replace("[set]", f'[set]\n"admittance.enabled" = true\n{line}')
    varied = '[vary]\n"suit.drive_integral_per_s" = { uniform = [10, 20] }'
    Path("study.toml").write_text(text if line else text.replace("[vary]", varied))
    error = command("campaign study.toml --out out", code=2).err
    assert said in error
    assert "under [admittance], where the loop of most wearers oscillates; expected 0; " in error
    assert error.count("\n") == 1
    assert not Path("out").exists()
    if line:  # of the rig's own, the rig is named
        Path("rig.toml").write_text("[suit]\ndrive_integral_per_s = 30.0\n[admittance]\nenabled = true\n")
        Path("study.toml").write_text(f'rig = "rig.toml"\n{STUDY}')
        with pytest.raises(ParameterError, match=r"^rig.toml: suit.drive_integral_per_s is 30 under \[admittance\]"):
            load(Path("study.toml"))
    Path("study.toml").write_text(STUDY.replace("[set]", '[set]\n"suit.drive_integral_per_s" = 20.0'))
    assert load(Path("study.toml")).rig.worn is not None
