"""Every command takes every kind of plant, or says in words of its user why it does not."""

import json
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

import bowden
from bowden.app import main
from bowden.core.errors import ParameterError
from bowden.hardware.twin.of_rig import twin_plant_of
from bowden.hardware.twin.plant import FOLLOW, OFF
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.identified import CableModel, IdentifiedCable
from bowden.plants.suit_settings import SuitSettings
from bowden.rig.rig import Rig
from bowden.study.tune_law import tuned
from live_runs import SHARED_LIMITS, tries

pytestmark = [
    pytest.mark.filterwarnings("ignore:the cable's slope is negative"),  # notes, which Python has as warnings
    pytest.mark.filterwarnings("ignore:adaptive has little margin"),  # on the paper's PD drive of the suit
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


def each(kinds: Iterable[str], *usual: str) -> pytest.MarkDecorator:
    """Kinds of plant, of which the `usual` ones are for every run of the tests and the others for the long one."""
    marked = [pytest.param(kind, marks=[] if kind in usual else [pytest.mark.long]) for kind in kinds]
    return pytest.mark.parametrize("kind", marked)


def short(kind: str, duration: float = 3.0) -> Rig:
    return RIGS[kind]().replace(duration=duration)


@pytest.mark.filterwarnings("ignore:suit.drive_integral_per_s is 0")
@each(RIGS, "own", "suit")
def test_a_plant_is_simulated(kind: str) -> None:
    rig = short(kind)
    trace = bowden.simulate(rig, "adaptive", force=True)
    assert trace.ended
    assert np.isfinite(trace["joint"]).all()
    assert trace.settings["rig"] == rig.hash


@each(RIGS, "own")
def test_a_plant_is_checked(kind: str) -> None:
    found = bowden.check(short(kind))
    assert found.verdict in ("holds", "little_margin", "does_not_hold")
    assert found.gain_margin_db is not None


@each(RIGS)
@pytest.mark.usefixtures("small_search")
def test_a_plant_is_tuned_for(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if kind == "suit":  # few gains keep their margins there: the small search finds none
        for size, value in (("_DRAWS", 400), ("_SIMULATED", 80), ("_MEMBERS", 24)):
            monkeypatch.setattr(f"bowden.design.tune.{size}", value)
    rig = short(kind)
    found = tuned(rig, seed=0, generations=1, progress=lambda what, share: None)
    assert found.found.verdict == "holds"
    assert found.rig.gains == found.gains
    assert found.rig.fitted().gains == found.law.gains
    assert found.rig.replace(preset=None, gains={}).hash == rig.hash


@each(RIGS, "own")
def test_a_plant_is_drawn_in_a_campaign(kind: str, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text('runs = 2\nduration_s = 2.0\n[vary]\n"servo.damping" = { uniform = [0.8, 1.0] }\n')
    rig = RIGS[kind]()
    found = bowden.campaign(study, tmp_path / "out", rig=rig, workers=1)
    assert found.table()["ended"].to_pylist() == [True, True]
    assert found.trace(1)["adaptive"].ended
    assert found.study.rig.replace(duration=rig.duration).hash == rig.hash


@each(RIGS, "own", "suit")
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


@each(RIGS, "own", "suit")
def test_a_twin_takes_a_command_as_late_as_its_rig_says(kind: str) -> None:
    """Beyond the cycle that the loop itself takes; power that goes and comes again leaves no command on its way."""
    rig, cycles = short(kind), 5
    courses = []
    for delay in (1, 1 + cycles):
        twin = twin_plant_of(rig.replace(delay=delay), 0.0)
        start, course = twin.motor, []
        twin.doing = FOLLOW
        for k in range(1, 400):
            twin.advance(k * rig.sample_time)
            course.append(twin.motor)
            twin.command = start + (0.8 if k >= 50 else 0.0)
        courses.append(np.array(course))
        twin.command, twin.doing = start, OFF
        twin.advance(400 * rig.sample_time)
        twin.command, twin.doing = start + 0.2, FOLLOW
        twin.advance(401 * rig.sample_time)
        assert twin.command == start + 0.2
    early, late = courses
    assert late[cycles:] == pytest.approx(early[:-cycles], abs=1e-3)
    assert abs(late - early).max() > 0.01


@pytest.mark.live
@each([kind for kind in RIGS if kind not in ("suit", "turned bench")], "own")
def test_a_plant_is_run_behind_its_twin(kind: str, tmp_path: Path) -> None:
    """In the loop's own process; a joint that falls is to be turned round in [drive], and a run says so."""
    rig = short(kind, 4.0)
    rig = rig.replace(limits=rig.limits._replace(**SHARED_LIMITS))
    for _ in tries():
        with warnings.catch_warnings(record=True) as said, bowden.run(rig, twin=True, out=tmp_path) as session:
            warnings.simplefilter("always")
            session.complete()
        if not said:
            break
    assert not said
    assert np.nanmax(session.trace().array("joint", "deg")) > 50.0


@pytest.mark.filterwarnings("ignore:.*counts a turn")
@each(RIGS, "own")
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


def test_parameters_of_a_model_in_python_are_numbers_and_keep_the_way_its_joint_goes() -> None:
    cable = IdentifiedCable("prandtl_ishlinskii", {"prandtl_ishlinskii": STACK | {"slope": -0.01, "weight_1": 0.7}})
    assert cable.with_parameters({"slope": 0.1}).parameters["slope"] == 0.1
    assert cable.with_parameters({"slope": 0.0}).with_parameters({"weight_1": 0.5}).parameters["weight_1"] == 0.5
    for given, said in (
        ({"weight_1": -2.0}, "the slope of the model 'prandtl_ishlinskii', of all its parts, would be -1.81; expected"),
        ({"slope": np.nan}, "slope of the model 'prandtl_ishlinskii' is nan; expected a finite number"),
        ({"offset": "x"}, "offset of the model 'prandtl_ishlinskii' is 'x'; expected a finite number"),
    ):
        with pytest.raises(ParameterError, match=said):
            cable.with_parameters(given)
