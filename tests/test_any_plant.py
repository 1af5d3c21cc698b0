"""Every command takes every kind of plant, or says in words of its user why it does not."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bowden
from bowden.app import main
from bowden.core.errors import ParameterError
from bowden.face.tune import tuned
from bowden.hardware.twin.bench import FOLLOW
from bowden.identify.cable.model import CableModel, IdentifiedCable
from bowden.models.cable.bouc_wen import BoucWen
from bowden.rig.rig import Rig
from bowden.rig.settings import SuitSettings
from bowden.rig.twin_plant import twin_plant_of

pytestmark = [
    pytest.mark.filterwarnings("ignore:the cable's slope is negative"),  # notes, which Python has as warnings
    pytest.mark.filterwarnings("ignore:.* on a suit. margins are not checked"),
]

ROOT = Path(__file__).parents[1]
OWN = ROOT / "examples" / "my_plant.py"
BOUC_WEN = BoucWen()._asdict() | {"slope": 0.9}
PLAY = {"slope": 0.9, "half_width": 0.06, "offset": 0.0}
STACK = {"slope": 0.5, "half_width_1": 0.02, "half_width_2": 0.08, "weight_1": 0.2, "weight_2": 0.2, "offset": 0.0}
STATIC = BOUC_WEN | {
    "static_centre": 0.6,
    "static_half_range": 0.7,
    "static_2": 0.01,
    "hysteresis_gain_1": 0.01,
}


def identified(name: str, parameters: dict[str, float]) -> Rig:
    return Rig(cable=IdentifiedCable(name, {name: parameters, "bouc_wen": dict(BOUC_WEN)}))


RIGS: dict[str, Callable[[], Rig]] = {
    "bench": Rig,
    "turned bench": lambda: Rig(cable=BoucWen(slope=-0.9, hysteresis_gain=0.1)),
    "play": lambda: identified("play", PLAY),
    "Prandtl–Ishlinskii": lambda: identified("prandtl_ishlinskii", STACK),
    "static": lambda: identified("bouc_wen_static", STATIC),
    "sliding": lambda: Rig(cable=CableModel("sliding", {"friction": 0.1})),
    "lumped": lambda: Rig(cable=CableModel("lumped_dahl", {"friction": 0.1, "elements": 6.0})),
    "own": lambda: Rig(plant=str(OWN)),
    "suit": lambda: Rig(suit=SuitSettings(worn=True)),
}
"""Kind of plant → a rig with one."""
CABLED = [name for name in RIGS if name != "suit"]


def each(kinds: Iterable[str], *usual: str) -> pytest.MarkDecorator:
    """Kinds of plant, of which the `usual` ones are for every run of the tests and the others for the long one."""
    marked = [pytest.param(kind, marks=[] if kind in usual else [pytest.mark.long]) for kind in kinds]
    return pytest.mark.parametrize("kind", marked)


def short(kind: str, duration: float = 3.0) -> Rig:
    return RIGS[kind]().replace(duration=duration)


@pytest.mark.parametrize("kind", RIGS)
def test_a_plant_is_simulated(kind: str) -> None:
    rig = short(kind)
    trace = bowden.simulate(rig, "adaptive", force=True)
    assert trace.ended
    assert np.isfinite(trace["joint"]).all()
    assert trace.settings["rig"] == rig.hash


@each(CABLED, "turned bench", "play", "lumped", "own")
def test_a_plant_is_checked(kind: str) -> None:
    found = bowden.check(short(kind))
    assert found.verdict in ("holds", "little_margin", "does_not_hold")
    assert found.gain_margin_db is not None


@each(CABLED, "turned bench", "own")
@pytest.mark.usefixtures("small_search")
def test_a_plant_is_tuned_for(kind: str) -> None:
    rig = short(kind)
    found = tuned(rig, seed=0, generations=1, progress=lambda what, share: None)
    assert found.found.verdict == "holds"
    assert found.rig.gains == found.gains
    assert found.rig.replace(gains={}).hash == rig.hash


@each(CABLED, "play", "sliding", "own")
def test_a_plant_plays_in_the_league(kind: str) -> None:
    rig = RIGS[kind]()
    found = bowden.league(rig, ["uncompensated"], plants=["rig"], scenarios=["fast"])
    (cell,) = found.cells
    assert (cell.plant, cell.stable, found.rig) == ("rig", True, rig.hash)


@each(RIGS, "bench", "sliding", "own", "suit")
def test_a_plant_is_drawn_in_a_campaign(kind: str, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text('runs = 2\nduration_s = 2.0\n[vary]\n"servo.damping" = { uniform = [0.8, 1.0] }\n')
    rig = RIGS[kind]()
    found = bowden.campaign(study, tmp_path / "out", rig=rig, workers=1)
    assert found.table()["ended"].to_pylist() == [True, True]
    assert found.trace(1)["adaptive"].ended
    assert found.study.rig.replace(duration=rig.duration).hash == rig.hash


@pytest.mark.parametrize("kind", RIGS)
def test_a_plant_is_behind_the_twin(kind: str) -> None:
    rig = short(kind)
    twin = twin_plant_of(rig, 0.0)
    start = twin.motor
    twin.doing, twin.command = FOLLOW, start + 0.8
    for k in range(1, 1001):
        twin.advance(k * 1e-3)
    joint, motor = twin.read_encoders()
    assert motor == pytest.approx(start + 0.8, abs=0.4 if kind == "suit" else 0.05), (
        "friction holds a suit's motor back"
    )
    assert joint > rig.begin + 0.05


@each(RIGS, "turned bench", "own", "suit")
def test_a_law_is_exported_for_a_plant(kind: str, tmp_path: Path) -> None:
    found = bowden.export(short(kind), tmp_path / "c", "adaptive", force=True)
    assert any(file.suffix == ".c" for file in found.files)


@pytest.mark.parametrize("kind", RIGS)
def test_a_plant_says_what_it_is_and_is_the_same_in_another_process(kind: str) -> None:
    rig = RIGS[kind]()
    again = Rig.unpack(rig.pack())
    assert again.hash == rig.hash
    assert str(again) == str(rig)
    assert "plant" in str(rig)
    assert json.loads(rig.pack())["hash"] == rig.hash


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (bowden.check, "a suit is worn, and margins are not checked on one"),
        (bowden.tune, "a suit is worn, and gains are not tuned on one"),
        (bowden.league, "a suit is worn, and the league plays on cables"),
    ],
)
def test_what_knows_benches_alone_refuses_a_suit(command: Any, said: str) -> None:
    with pytest.raises(ParameterError, match=f"{said}; expected a rig with a cable or a plant of its own"):
        command(RIGS["suit"]())


def test_a_study_varies_parameters_of_a_users_plant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my_plant.py").write_text(OWN.read_text())
    Path("rig.toml").write_text('[cable]\nplant = "my_plant.py"\n[cable.parameters]\nfriction = 0.02\n')
    text = 'rig = "rig.toml"\nruns = 3\nduration_s = 2.0\n[vary]\n"cable.parameters.slope" = { uniform = [0.6, 1.0] }\n'
    Path("study.toml").write_text(text)
    assert main.run(["campaign", "study.toml", "--workers", "2", "--json"]) == 0
    found = bowden.campaign("study.toml", tmp_path / "other", workers=1)
    slopes = found.table()["cable.parameters.slope"].to_pylist()
    assert len(set(slopes)) == 3
    rig, _, _ = found.study.run(1)
    assert rig.own_plant.parameters.slope == slopes[1]
    assert rig.own_plant.parameters.friction == 0.02
    Path("study.toml").write_text(text.replace("slope", "slop"))
    with pytest.raises(
        ParameterError, match=r"unknown key 'cable\.parameters\.slop'; expected cable\.parameters\.slope"
    ):
        bowden.campaign("study.toml")


@pytest.mark.usefixtures("small_search")
def test_tune_takes_a_study_in_python(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text('runs = 6\nduration_s = 5.0\n[vary]\n"cable.slope" = { uniform = [0.8, 1.0] }\n')
    rig = Rig(law=bowden.LAWS["adaptive"].with_gains(feedback_gain=20.0))
    found = bowden.tune(rig, study=study, generations=1)
    assert found.study is not None
    assert (found.study["tuned_on"], found.study["after"]["runs"]) == (3, 3)
    assert found.rig.gains == found.gains
    assert "3 plants of study.toml" in str(found)


def test_a_law_of_the_leagues_rig_has_the_rigs_gains() -> None:
    rig = Rig(gains={"feedback_gain": 5.0}, delay=3)
    soft, usual = (
        bowden.league(one, ["adaptive"], plants=["bench", "rig"], scenarios=["fast"])
        for one in (rig, rig.replace(gains={}))
    )
    assert soft.cells[0].rmse_deg != usual.cells[0].rmse_deg
    assert soft.cells[0].rmse_deg == pytest.approx(soft.cells[1].rmse_deg, rel=1e-9)
    trace = bowden.simulate(rig, "adaptive", duration=20.0)
    assert trace.settings["gains"]["feedback_gain"] == 5.0


def test_a_model_file_names_a_distributed_cable(tmp_path: Path) -> None:
    rig = RIGS["sliding"]()
    rig.write(tmp_path / "rig.toml")
    assert "[models.sliding.parameters]\nfriction = 0.1  # [1]" in (tmp_path / "model.toml").read_text()
    again = Rig.read(tmp_path / "rig.toml")
    assert again.hash == rig.hash
    assert again.knowledge.slope == pytest.approx(again.bench.cable.slope)
    assert 0.02 < again.knowledge.width < 0.3
    (tmp_path / "model.toml").write_text('best = "sliding"\n[models.sliding.parameters]\nfriktion = 0.1\n')
    with pytest.raises(ParameterError, match="friktion"):
        Rig.read(tmp_path / "rig.toml")
