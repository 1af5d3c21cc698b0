"""Tuned gains keep their margins and beat the defaults in the worst case; rig.toml keeps everything else."""

import importlib
import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import bowden
from bowden.app.main import run
from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk, Trajectory
from bowden.core.errors import OutputError, ParameterError
from bowden.design.check import check
from bowden.design.check_result import MOST_PER_COUNT
from bowden.design.tune import NoGainsError, easier, tune
from bowden.design.tune_judge import WANTED_DB, WANTED_DEG, Task, chatter, keeps, shortfall
from bowden.design.tune_result import REACH
from bowden.design.tune_runs import NineRuns, TuningTarget, course_of, runs_of
from bowden.models.cable.sheath_path import BendPath, constant_bend, scripted_bend
from bowden.operations.schema import json_schema
from bowden.plants.bench import Bench
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.sim.run import simulate
from bowden.study import tune_study
from bowden.study.load import load
from bowden.study.rows import table_of
from bowden.views.tune import with_gains

BENCH = default_bench()
ADAPTIVE = LAWS["adaptive"]
BENDS, STROKE = (np.pi, 2.0 * np.pi), (0.0, np.radians(70.0))
RIGS = {
    "slow": BENCH._replace(servo=BENCH.servo._replace(natural_frequency=2.0 * np.pi * 3.0)),
    "late": BENCH._replace(delay=10),
    "soft": BENCH._replace(cable=BENCH.cable._replace(slope=0.6, rate=4.0)),
}


def others(bench: Bench, law: Law) -> float:
    """Largest RMSE [rad] over runs that the search does not see: a minute of another motion and move of the sheath."""
    reference = PeriodicMinimumJerk(STROKE[0], 0.8 * STROKE[1], 6.0)
    paths = (constant_bend(BENDS[0]), scripted_bend((10.0, 13.0, 30.0, 40.0), (*BENDS, *BENDS)))
    runs = [simulate(bench, law, reference, duration=60.0, bend=path, seed=11) for path in paths]
    assert all(run.stable for run in runs)
    return max(float(np.sqrt(np.mean(run.error**2))) for run in runs)


def rmse(bench: Bench, law: Law, reference: Trajectory, path: BendPath) -> float:
    """Of one run alone, by way of its trace [rad]."""
    start = bench.resting_motor(float(reference.sample(np.zeros(1))[0, 0]), float(path(np.zeros(1))[0]))
    trace = simulate(bench, law, reference, duration=20.0, bend=path, seed=3, initial_motor=start)
    return float(np.sqrt(np.mean(trace.error**2))) if trace.stable else np.inf


def test_the_nine_runs_in_one_call_are_the_runs_alone_to_the_last_bit() -> None:
    course = course_of(NineRuns(TuningTarget(BENCH, BENDS, STROKE)))
    laws = (ADAPTIVE, ADAPTIVE.with_gains(feedback_gain=31.0, error_gain=0.02), ADAPTIVE.preset("paper"))
    alone = [tuple(rmse(BENCH, law, *run) for run in runs_of(BENDS, STROKE)) for law in laws]
    assert np.inf in alone[2]
    assert [course.errors([law] * 9) for law in laws] == alone
    mixed = [laws[i % 2] for i in range(9)]
    assert course.errors(mixed) == tuple(alone[i % 2][i] for i in range(9))
    order = tuple(sorted(range(9), key=lambda i: alone[0][i]))
    limit = alone[0][order[4]]
    stopped = course.errors([laws[0]] * 9, order, limit, at_once=False)
    assert stopped == tuple(alone[0][i] if i in order[:6] else 0.0 for i in range(9))
    given_up = course.errors([laws[0]] * 9, order, limit)
    assert given_up == tuple(np.inf if i == order[5] else value for i, value in enumerate(stopped))


@pytest.mark.long
@pytest.mark.parametrize("name", RIGS)
def test_tuned_gains_beat_the_defaults_in_the_worst_case_and_keep_their_margins(name: str) -> None:
    bench = RIGS[name]
    # the default gains have 2.8 dB on the late rig: there the first generations only find those with margins
    found = tune(bench, ADAPTIVE, generations=20 if name == "late" else 2)
    again = check(bench, found.law, bends=BENDS)
    assert again.verdict == "holds"
    assert again.gain_margin_db is not None
    assert again.gain_margin_db >= WANTED_DB
    assert again.phase_margin_deg is not None
    assert again.phase_margin_deg >= WANTED_DEG
    runs = runs_of(BENDS, STROKE)
    assert len(runs) == 9
    assert found.worst_rmse == max(rmse(bench, found.law, *run) for run in runs)
    assert found.worst_before == max(rmse(bench, ADAPTIVE, *run) for run in runs)
    assert found.worst_rmse < 0.95 * found.worst_before
    assert others(bench, found.law) < 0.95 * others(bench, ADAPTIVE)
    assert found.gains == {n: v for n, v in found.law.gains._asdict().items() if v != getattr(ADAPTIVE.gains, n)}


COARSE = BENCH._replace(joint_encoder=BENCH.joint_encoder._replace(resolution=np.radians(0.3)))


def test_gains_whose_command_jumps_with_the_encoders_counts_are_refused() -> None:
    """A law that has its margins may still send the motor each count, many times over."""
    law = LAWS["adaptive_sliding_mode"]
    usual, coarse = (TuningTarget(bench, BENDS, STROKE) for bench in (BENCH, COARSE))
    tasks = [Task(rig, law, ({},), (), np.inf, NineRuns(rig)) for rig in (usual, coarse)]
    per_count = [check(rig.bench, law, bends=BENDS).command_per_count for rig in (usual, coarse)]
    assert per_count[0] < MOST_PER_COUNT < per_count[1]
    assert shortfall(tasks[0]) == chatter(tasks[0]) == 0.0
    assert shortfall(tasks[1]) == pytest.approx(per_count[1] / MOST_PER_COUNT - 1.0, rel=0.2)
    found = check(COARSE, law, bends=BENDS)
    assert not keeps(found)
    assert "of command for one count of the encoder: more than 0.5°, so the motor buzzes" in repr(found)


@pytest.mark.usefixtures("small_search")
def test_where_no_gains_do_the_message_names_a_rig_for_which_some_do() -> None:
    """And by how much the best fall short; whoever follows the advice is given gains."""
    slow = BENCH._replace(sample_time=0.02, delay=6, servo=BENCH.servo._replace(natural_frequency=6.0 * np.pi))
    with pytest.raises(NoGainsError, match=r"have [.\d]+ dB and [.\d]+° .* 3 Hz and damping 1 behind 120 ms") as error:
        tune(slow, ADAPTIVE, generations=1)
    key, value = re.findall(r"nearest rig that has some: (\w+) = ([\d.]+)", str(error.value))[0]
    assert key == "delay_cycles"
    assert tune(slow._replace(delay=int(value)), ADAPTIVE, generations=1).found.verdict == "holds"
    assert any("sample_time_ms = 10" in said for said, _ in easier(slow, 2.0))


@pytest.mark.usefixtures("small_search")
@pytest.mark.parametrize("preset", [None, "paper"])
def test_what_the_check_says_holds_is_never_given_up(preset: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the search finds nothing: the rig's own gains or, where these do not hold, the law's usual ones."""

    def failed(*_: object, **__: object) -> None:
        raise NoGainsError("no gains keep all", do="take another servo")

    monkeypatch.setattr(importlib.import_module("bowden.study.tune_law"), "search", failed)
    found = bowden.tune(bowden.Rig(law="adaptive", preset=preset))
    assert bowden.check(found.rig).verdict == found.found.verdict == "holds"
    assert found.rig.fitted().gains == bowden.Rig(law="adaptive").fitted().gains
    assert bool(found.gains) == (preset is not None)
    assert (found.worst_before is None) == (preset is not None)
    assert found.short == "no gains keep all; take another servo; these hold"


def test_a_law_without_feedback_has_nothing_to_tune() -> None:
    with pytest.raises(ParameterError, match="no gains that its loop feels"):
        tune(BENCH, LAWS["uncompensated"])


@pytest.mark.usefixtures("small_search")
def test_tuning_moves_choices_and_leaves_facts() -> None:
    law = LAWS["bowden"].with_gains(bandwidth=1.0)
    found = tune(BENCH, law, generations=1)
    assert found.gains
    assert set(found.gains) <= {"bandwidth", "lag"}


def test_the_file_keeps_its_comments_and_the_other_keys() -> None:
    text = "# mine\n[control]\nlaw = 'adaptive'\n[control.gains]  # these\nerror_gain = 0.1  # λ\nsmoothing = 0.02\n"
    once = with_gains(text + "[servo]\n", {"error_gain": 0.05, "feedback_gain": 20.0}, ["why"], Path("rig.toml"))
    twice = with_gains(once, {"error_gain": 0.06}, ["why else"], Path("rig.toml"))
    assert "error_gain = 0.05  # λ" in once
    assert tomllib.loads(twice)["control"]["gains"] == {"error_gain": 0.06, "feedback_gain": 20.0, "smoothing": 0.02}
    assert "# mine\n" in twice
    assert "[control.gains]  # these\n# bowden tune: why else\n" in twice
    assert "why\n" not in twice
    assert tomllib.loads(with_gains("", {"a": 1.0}, [], Path("x")))["control"]["gains"] == {"a": 1.0}
    with pytest.raises(OutputError, match="not a section of its own"):
        with_gains("[control]\ngains = { a = 2.0 }\n", {"a": 1.0}, [], Path("rig.toml"))


@pytest.mark.parametrize(
    "text",
    [
        "",
        '[servo]\ndamping = 0.9\n\n[control]  # of it\nlaw = "bowden"\n[live]\ncpu = 1\n',
        "[suit]\nworn = true\n[control.gains]\nb = 2.0\n",
        '[control]\npreset = "suit"\n',
    ],
)
def test_gains_that_stand_on_a_preset_are_written_with_it(text: str) -> None:
    before = tomllib.loads(text)
    found = tomllib.loads(with_gains(text, {"a": 1.0}, ["why"], Path("rig.toml"), "suit"))
    control = before.pop("control", {})
    assert found.pop("control") == {**control, "preset": "suit", "gains": {"a": 1.0, **control.get("gains", {})}}
    assert found == before


@pytest.mark.usefixtures("small_search")
def test_the_command_writes_the_gains_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("bowden.design.tune.GENERATIONS", 3)  # of many, so that it takes seconds
    rig = "# soft\n[cable]\nslope = 0.6\nrate_per_rad = 4.0\n"
    Path("rig.toml").write_text(rig)
    assert run(["tune", "rig.toml", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json_schema("tune"))
    written = Path("rig.toml").read_text(encoding="utf-8")
    assert written.startswith(rig)
    assert tomllib.loads(written)["control"]["gains"] == document["gains"]
    assert document["worst_rmse_deg"] < document["worst_rmse_before_deg"]
    assert run(["check", "rig.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "holds"


STUDY = """
runs = 20
duration_s = 4.0
[set]
"reference.period_s" = 2.0
[vary]
"servo.natural_frequency_hz" = { uniform = [3, 5] }
"cable.slope" = { uniform = [0.6, 1.0] }
"scenario.bend.bend_deg" = { uniform = [180, 300] }
"""


@pytest.fixture
def study(small_search: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("bowden.design.tune.GENERATIONS", 1)
    Path("rig.toml").write_text("# soft\n[cable]\nrate_per_rad = 4.0\n[servo]\nnatural_frequency_hz = 4.0\n")
    Path("study.toml").write_text(STUDY)
    return Path("study.toml")


def test_gains_tuned_against_a_study_are_judged_by_plants_that_the_search_did_not_see(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["tune", "rig.toml", "--study", "study.toml", "--json"]) == 0, capsys.readouterr().err
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json_schema("tune"))
    found = document["study"]
    assert (found["name"], found["tuned_on"]) == ("study", 10)
    assert found["before"]["runs"] == found["after"]["runs"] == 10
    assert found["after"]["unstable"] == 0
    assert found["after"]["rmse_worst_deg"] < 0.95 * found["before"]["rmse_worst_deg"]
    loaded = load(study, Rig.read("rig.toml"), own_law=True)  # with the new gains now
    for numbers, worst in ((range(10), document["worst_rmse_deg"]), (range(10, 20), found["after"]["rmse_worst_deg"])):
        assert max(table_of(loaded, numbers)["rmse_deg"].to_pylist()) == pytest.approx(worst, rel=1e-12)
    assert "10 other plants, 0 unstable" in Path("rig.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (STUDY + '"control.gains.error_gain" = 0.1\n', "study.toml varies control.gains.error_gain; expected a study"),
        ("runs = 3\n", "runs is 3; expected 4 or more"),
        ('rig = "other.toml"\n', "its rig is 'other.toml', and the given one rig.toml; expected the same file"),
        (
            '[set]\n"suit.worn" = true\n"suit.cable" = "bouc_wen"\n"admittance.enabled" = true\n',
            "the wearer's push makes the reference",
        ),
    ],
)
def test_studies_that_gains_cannot_be_tuned_against(
    text: str, said: str, study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study.write_text(text)
    assert run(["tune", "rig.toml", "--study", "study.toml"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_what_a_study_tells_its_laws_is_not_tuned(study: Path) -> None:
    study.write_text(STUDY + "[known]\nservo_frequency = { uniform = [0.8, 1.2] }\n")
    Path("rig.toml").write_text('[control]\nlaw = "bowden"\n')
    loaded = load(study, Rig.read("rig.toml"), own_law=True)
    runs = tune_study.runs_of(loaded)
    (nominal,) = loaded.nominal
    laws = runs.laws(nominal.with_gains(servo_frequency=1.0, bandwidth=0.7))
    assert len({law.gains.servo_frequency for law in laws}) == 10
    assert {law.gains.bandwidth for law in laws} == {0.7}
    assert loaded.gains_varied == {"servo_frequency"}


def test_an_interrupted_search_leaves_its_best_gains(
    study: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("bowden.design.tune._Search.evolve", interrupted)
    assert run(["tune", "rig.toml"]) == 130
    assert "interrupted; the best gains after 0 generations are written to rig.toml" in capsys.readouterr().err
    text = Path("rig.toml").read_text(encoding="utf-8")
    assert "found, interrupted after 0 generations, for a servo of" in text
    assert tomllib.loads(text)["control"]["gains"]


@pytest.mark.usefixtures("small_search")
def test_a_gain_at_the_end_of_the_search_is_named_and_the_next_search_begins_there() -> None:
    found = tune(BENCH, ADAPTIVE, generations=1)
    assert found.at_bounds == ()
    value = found.law.numbers["feedback_gain"]
    far = replace(found, stood={**found.stood, "feedback_gain": value / np.exp(0.99 * REACH)})
    (said,) = far.at_bounds
    assert said.startswith("feedback_gain")
    assert said.endswith("tune once more, to go on from there")
    assert "at a bound" in repr(far)
    assert tune(BENCH, found.law, generations=1).stood["feedback_gain"] == value


@pytest.mark.usefixtures("small_search")
def test_a_gain_at_the_laws_own_limit_is_named_with_what_it_means() -> None:
    most = 0.7 * ADAPTIVE.numbers["feedback_gain"]
    bounded = replace(ADAPTIVE, limits={**ADAPTIVE.limits, "feedback_gain": (1.0, most)})
    found = tune(BENCH, bounded.with_gains(feedback_gain=0.5 * most), generations=2)
    assert found.law.numbers["feedback_gain"] == most
    (said,) = (text for text in found.at_bounds if text.startswith("feedback_gain"))
    assert "is the largest value that the law takes" in said
    free = tune(BENCH, replace(found.law, limits=ADAPTIVE.limits), generations=2)
    assert free.worst_rmse < found.worst_rmse
