"""A user's own plant in a rig: held with its source, run by every loop, and blamed where it gives no number."""

from pathlib import Path

import numpy as np
import pytest

from bowden.core.errors import ParameterError
from bowden.hardware.twin.plant import FOLLOW
from bowden.hardware.twin.user import TwinUser
from bowden.models.drive.servo import Servo
from bowden.plants.plant_file import load
from bowden.plants.transmission import transmission
from bowden.plants.user_plant import UserPlant
from bowden.rig.rig import Rig
from bowden.sim.many import simulate_many
from bowden.sim.rig_runs import run_of
from bowden.sim.run import Case
from bowden.study.tune_law import workers_for

pytestmark = pytest.mark.usefixtures("undrawn")

EXAMPLE = Path(__file__).parents[1] / "examples" / "my_plant.py"
SERVO = "from bowden.models.drive.servo import Servo\nfrom bowden.plants.user_plant import UserPlant\n"
NAMED = f"{SERVO}OWN = UserPlant('own', Parameters(), rest, advance, servo=Servo(natural_frequency=40.0))\n"


def rig_of(tmp_path: Path, text: str = "") -> Rig:
    (tmp_path / "my_plant.py").write_text(EXAMPLE.read_text())
    path = tmp_path / "rig.toml"
    path.write_text(f'[cable]\nplant = "my_plant.py"\n{text}[scenario]\nduration_s = 1.0\n')
    return Rig.read(path)


def test_a_file_and_python_make_the_same_rig_and_a_pack_needs_no_file(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    assert rig.hash == Rig(plant=str(tmp_path / "my_plant.py"), duration=1.0).hash
    assert rig.hash == Rig(plant=load("my_plant.py", tmp_path), duration=1.0).hash
    assert rig.hash != Rig(duration=1.0).hash
    law = rig.fitted()
    before = run_of(rig, law)
    pack = rig.pack()
    (tmp_path / "my_plant.py").unlink()
    again = Rig.unpack(pack)
    assert again.hash == rig.hash
    assert np.array_equal(run_of(again, law)["joint"], before["joint"])
    (tmp_path / "copy").mkdir()
    again.write(tmp_path / "copy" / "rig.toml")
    assert Rig.read(tmp_path / "copy" / "rig.toml").hash == rig.hash


def test_a_changed_parameter_is_packed() -> None:
    plant = load(str(EXAMPLE))
    stiff = plant._replace(parameters=plant.parameters._replace(slope=0.5))
    rig = Rig.unpack(Rig(plant=stiff).pack())
    assert rig.own_plant.parameters.slope == 0.5


def test_what_a_plant_says_of_itself_is_the_rigs(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(EXAMPLE.read_text() + NAMED)
    rig = Rig(plant=str(tmp_path / "own.py:OWN"))
    assert rig.servo.natural_frequency == rig.knowledge.servo_frequency == 40.0
    assert rig.knowledge.slope == 0.95
    assert rig.knowledge.motor_zero == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ParameterError, match="has its own servo, and the rig has another"):
        Rig(plant=str(tmp_path / "own.py:OWN"), servo=Servo(natural_frequency=11.0))


def test_what_a_plant_says_of_itself_goes_with_it(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(EXAMPLE.read_text() + NAMED)
    (tmp_path / "other.py").write_text(EXAMPLE.read_text() + NAMED.replace("40.0", "30.0"))
    rig = Rig(plant=str(tmp_path / "own.py:OWN"), delay=3)
    for before in (rig, Rig.unpack(rig.pack())):
        assert before.replace(plant=None) == Rig(delay=3)
        assert before.replace(plant=str(tmp_path / "other.py:OWN")).servo.natural_frequency == 30.0
        assert before.replace(delay=2).servo.natural_frequency == 40.0
        given = before.replace(plant=str(EXAMPLE), servo=Servo(natural_frequency=11.0))
        assert (given.servo.natural_frequency, given.delay) == (11.0, 3)


def test_workers_of_a_search_are_handed_it(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    with workers_for(rig) as workers:
        assert list(workers(_joint_at_one, [rig.cabled])) == [0.95]


def _joint_at_one(plant: UserPlant) -> float:
    dynamics = plant.dynamics()
    return float(dynamics.rest(dynamics.plant, 1.0, None).joint)  # type: ignore[arg-type]  # its rest needs no sheath


def test_mistakes_name_key_file_and_line(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="has a plant and its own slope"):
        rig_of(tmp_path, "slope = 0.9\n")
    rig_of(tmp_path)
    (tmp_path / "my_plant.py").write_text(EXAMPLE.read_text().replace("motor, speed)", "motor, sped)"))
    with pytest.raises(ParameterError, match=r"cable\.plant: .*my_plant\.py, line \d+: NameError"):
        Rig.read(tmp_path / "rig.toml")


def test_no_number_deep_in_a_run_is_the_plants(tmp_path: Path) -> None:
    """A square root that ends only where the joint comes later than the trial does."""
    text = EXAMPLE.read_text().replace("given.slope * end, motor, speed", "given.slope * end, motor, speed * wrong")
    text = text.replace("import kernel\n", "import kernel\nfrom bowden.core.kernel import sqrt\n", 1)
    text = text.replace("    end = max", "    wrong = 1.0 + 0.0 * sqrt(0.9 - motor)\n    end = max")
    (tmp_path / "bad.py").write_text(text)
    rig = Rig(plant=str(tmp_path / "bad.py"), duration=8.0)
    said = r"bad\.py, line \d+: the plant 'bad' gave nan for .* at t = \d"
    with pytest.raises(ParameterError, match=said):
        run_of(rig, rig.fitted())
    case = Case(rig.moved, (rig.fitted(),), rig.trajectory, rig.bend_path, 1, rig.start_motor)
    with pytest.raises(ParameterError, match=said):
        list(simulate_many([case], 8.0))


def test_the_twin_moves_it_as_a_simulation_does(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    plant = rig.cabled
    twin = TwinUser(plant, rig.bend_path, 1.0, 0, 0.0, 0.0)
    twin.doing, twin.command = FOLLOW, 0.3
    twin.advance(1.0)
    dynamics, sheath = plant.dynamics(), twin._sheath_at(0.0)
    body = dynamics.rest(dynamics.plant, 0.0, sheath)
    for k in range(1000):
        body = dynamics.advance(dynamics.plant, body, 0.3 if k else 0.0, sheath, sheath)
    assert twin.joint == pytest.approx(body.joint, abs=1e-6)
    assert twin.read_encoders()[1] == pytest.approx(0.3, abs=1e-2)
    assert not twin.has_cable


def test_a_rigs_file_changes_parameters_of_its_plant(tmp_path: Path) -> None:
    rig = rig_of(tmp_path, "[cable.parameters]\nslope = 0.5\nfriction = 0.05\n")
    plant = load("my_plant.py", tmp_path)
    stiff = plant._replace(parameters=plant.parameters._replace(slope=0.5))
    assert rig.own_plant.parameters.slope == rig.knowledge.slope == rig.slope == 0.5
    assert rig.hash == Rig(plant=stiff, duration=1.0).hash != rig_of(tmp_path).hash
    (tmp_path / "copy").mkdir()
    Rig(plant=stiff, duration=1.0).write(tmp_path / "copy" / "rig.toml")
    assert Rig.read(tmp_path / "copy" / "rig.toml").hash == rig.hash
    assert Rig.unpack(rig.pack()).hash == rig.hash


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[cable.parameters]\nslop = 0.5\n", "cable.parameters: the plant 'my_plant.py' has no parameter 'slop'"),
        ('[cable.parameters]\nslope = "x"\n', "cable.parameters.slope is 'x'; expected a number"),
    ],
)
def test_parameters_that_a_plant_does_not_have_are_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        rig_of(tmp_path, text)


def test_parameters_need_a_plant(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("[cable.parameters]\nslope = 0.5\n")
    with pytest.raises(ParameterError, match="has parameters and neither plant nor model"):
        Rig.read(path)


def test_a_plant_whose_joint_falls_is_turned_round_everywhere(tmp_path: Path) -> None:
    """Its figures are those of the one whose joint rises, and its motor is counted the other way round."""
    (tmp_path / "falls.py").write_text(EXAMPLE.read_text().replace("slope: float = 0.95", "slope: float = -0.95"))
    falling, rising = Rig(plant=str(tmp_path / "falls.py")), Rig(plant=str(EXAMPLE))
    assert falling.turned
    assert not rising.turned
    assert falling.slope == falling.knowledge.slope == rising.knowledge.slope
    assert falling.start_motor == pytest.approx(rising.start_motor)
    assert any("the other way round" in note for note in falling.notes)
    runs = [run_of(rig.replace(duration=5.0, seed=3), rig.fitted()) for rig in (falling, rising)]
    for name in ("joint", "motor", "motor_velocity", "motor_measured", "command"):
        noise = 2e-3 if name == "motor_measured" else 5e-4  # the encoder's, which counts the other way round
        np.testing.assert_allclose(runs[0][name], runs[1][name], atol=noise)
    ((batch,),) = simulate_many(
        [
            Case(
                falling.moved,
                (falling.fitted(),),
                falling.trajectory,
                falling.bend_path,
                3,
                falling.start_motor,
            )
        ],
        5.0,
    )
    assert np.degrees(batch.rmse) == pytest.approx(runs[0].metrics().rmse_deg, rel=1e-9)
    assert transmission(falling.cabled, np.pi, (0.0, 1.2)).slope == pytest.approx(0.95, rel=1e-3)


def test_the_twin_counts_a_falling_plants_motor_the_other_way_round(tmp_path: Path) -> None:
    (tmp_path / "falls.py").write_text(EXAMPLE.read_text().replace("slope: float = 0.95", "slope: float = -0.95"))
    twins = []
    for file in (tmp_path / "falls.py", EXAMPLE):
        rig = Rig(plant=str(file))
        twin = TwinUser(rig.cabled, rig.bend_path, 1.0, 0, 0.1, 0.0)  # type: ignore[arg-type]
        twin.doing, twin.command = FOLLOW, 0.3
        twin.advance(0.05)
        moving = twin.velocity
        twin.advance(1.0)
        twins.append((moving, twin.motor, twin.joint, *twin.read_encoders()))
        twin.doing = 0
        twin.advance(1.5)
        assert twin.motor == pytest.approx(0.3, abs=1e-3)
    np.testing.assert_allclose(twins[0], twins[1], atol=2e-3)
