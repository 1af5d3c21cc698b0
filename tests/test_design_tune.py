"""Tuned gains keep their margins and beat the defaults in the worst case; rig.toml keeps everything else."""

import json
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from bowden.app.gains_text import with_gains
from bowden.app.main import run
from bowden.control import LAWS
from bowden.core.errors import OutputError, ParameterError
from bowden.design.check import check
from bowden.design.tune import WANTED_DB, WANTED_DEG, scenarios, tune, worst_rmse
from bowden.paper.bench import default_bench
from bowden.sim.plant import Bench

BENCH = default_bench()
ADAPTIVE = LAWS["adaptive"]
BENDS, STROKE = (np.pi, 2.0 * np.pi), (0.0, np.radians(70.0))
SCHEMA = Path(__file__).parents[1] / "docs" / "json" / "tune.schema.json"
SOFT = BENCH._replace(cable=BENCH.cable._replace(slope=0.6, rate=4.0))
RIGS = {"soft": SOFT}


@pytest.mark.parametrize("bench", RIGS.values(), ids=RIGS)
def test_tuned_gains_beat_the_defaults_in_the_worst_case_and_keep_their_margins(bench: Bench) -> None:
    found = tune(bench, ADAPTIVE)
    again = check(bench, found.law, bends=BENDS)
    assert again.verdict == "holds"
    assert again.gain_margin_db is not None
    assert again.gain_margin_db >= WANTED_DB
    assert again.phase_margin_deg is not None
    assert again.phase_margin_deg >= WANTED_DEG
    assert found.worst_rmse == worst_rmse(bench, found.law, list(scenarios(BENDS, STROKE)))
    assert found.worst_before is not None
    assert found.worst_rmse < 0.7 * found.worst_before
    assert found.changed == {n: v for n, v in found.law.gains._asdict().items() if v != getattr(ADAPTIVE.gains, n)}


def test_a_rig_that_no_gains_stabilise_is_refused_with_the_nearest_that_could_be() -> None:
    hopeless = BENCH._replace(servo=BENCH.servo._replace(damping=0.004))
    with pytest.raises(ParameterError, match=r"no gains of law 'adaptive'.*damping 0.004.*servo damping = 1"):
        tune(hopeless, ADAPTIVE)


def test_a_law_without_feedback_has_nothing_to_tune() -> None:
    with pytest.raises(ParameterError, match="no gains that its loop feels"):
        tune(BENCH, LAWS["uncompensated"])


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
    with pytest.raises(OutputError, match="not a section of their own"):
        with_gains("[control]\ngains = { a = 2.0 }\n", {"a": 1.0}, [], Path("rig.toml"))


def test_the_command_writes_the_gains_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rig = "# soft\n[cable]\nslope = 0.6\nrate_per_rad = 4.0\n"
    Path("rig.toml").write_text(rig)
    assert run(["tune", "rig.toml", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json.loads(SCHEMA.read_text()))
    written = Path("rig.toml").read_text(encoding="utf-8")
    assert written.startswith(rig)
    assert tomllib.loads(written)["control"]["gains"] == document["gains"]
    assert document["worst_rmse_deg"] < document["worst_rmse_before_deg"]
    assert run(["check", "rig.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "holds"
