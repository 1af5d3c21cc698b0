"""From the bench's own log to a model and back to the bench, all by command."""

import json
from pathlib import Path

import pytest

from bowden.app.main import run
from bowden.plants.identified import load_cable
from bowden.plants.presets.bench import default_bench

pytestmark = pytest.mark.usefixtures("undrawn")

EXAMPLE = Path(__file__).parents[1] / "examples" / "identify.toml"


def test_log_model_and_simulation_follow_from_one_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["simulate", str(EXAMPLE), "--csv", "--out", "log"]) == 0
    assert run(["identify", "log/uncompensated.csv", "--out", "cable"]) == 0

    # The default bench has its play in the sheath's gap; the log shows both as one cable.
    true, gap = default_bench().cable, default_bench().sheath.gap
    found = load_cable("cable/model.toml").bouc_wen
    assert found.slope == pytest.approx(true.slope, rel=1e-3)
    assert found.hysteresis_gain == pytest.approx(true.hysteresis_gain * gap, rel=0.1)
    assert found.rate == pytest.approx(true.rate / gap, rel=0.1)
    assert found.offset == pytest.approx(0.0, abs=1e-3)

    Path("rig.toml").write_text('[cable]\nmodel = "cable/model.toml"\n[scenario]\nduration_s = 20.0\n')
    Path("default.toml").write_text("[scenario]\nduration_s = 20.0\n")
    laws = ["--law", "adaptive", "--json"]
    errors = []
    for rig in ("rig.toml", "default.toml"):
        capsys.readouterr()
        assert run(["simulate", rig, *laws]) == 0
        errors.append([figures["rmse_deg"] for figures in json.loads(capsys.readouterr().out)["runs"]])
    assert errors[0] == pytest.approx(errors[1], rel=0.02)  # the identified cable behaves as the true one
