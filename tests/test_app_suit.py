"""[suit] and [wearer] of a rig.toml: from the file to the run, and wearers that cannot be."""

from pathlib import Path

import pytest

from bowden.app.simulate_command import _of_suit
from bowden.control import LAWS
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.report.simulate_page import simulation_page
from bowden.rig.presets.suit import suit
from bowden.rig.rig import Rig
from bowden.rig.settings import SuitSettings
from bowden.sim.run import simulate

pytestmark = pytest.mark.usefixtures("undrawn")

MOTION = '[reference]\nkind = "periodic_minimum_jerk"\nlow_deg = 0.0\nhigh_deg = 60.0\nperiod_s = 4.0\n'


def written(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_without_a_word_nobody_wears_a_suit(tmp_path: Path) -> None:
    setup = Rig.read(written(tmp_path, MOTION))
    assert setup.worn is None


def test_worn_and_nothing_else_is_the_papers_suit_but_for_the_encoder() -> None:
    made, papers = Rig(suit=SuitSettings(worn=True)).worn, suit()
    assert made is not None
    for name in (
        "geometry",
        "spool_radius",
        "pretension",
        "fabric",
        "arm",
        "wearer",
        "posture",
        "sample_time",
        "delay",
    ):
        assert getattr(made, name) == getattr(papers, name), name
    assert made.motor == papers.motor
    assert made.flexor.half_width == pytest.approx(papers.flexor.half_width)
    assert made.joint_sensor == pytest.approx(papers.joint_sensor)
    assert made.sheath == papers.sheath


def test_the_keys_reach_the_suit(tmp_path: Path) -> None:
    text = MOTION + (
        '[suit]\nworn = true\ncable = "capstan"\ndrive_integral_per_s = 20.0\nfriction_feedforward_nm = 1.5\n'
        "sensor_offset_deg = 0.5\n"
        "[wearer]\nmass_kg = 100.0\nload_kg = 1.0\nupper_arm_deg = 20.0\nshare = 0.3\ntremor_nm = 0.2\n"
    )
    setup = Rig.read(written(tmp_path, text))
    assert setup.worn is not None
    assert (setup.worn.flexor.kind, setup.worn.motor.integral, setup.worn.sheath.loss) == ("capstan", 20.0, 0.0)
    assert setup.worn.motor.friction_feedforward == 1.5
    assert setup.worn.arm.mass == pytest.approx(3.2)
    assert setup.worn.arm.elevation == pytest.approx(20.0 * RADIANS)
    assert (setup.worn.wearer.share, setup.worn.wearer.tremor) == (0.3, 0.2)
    law = setup.fitted("adaptive")
    assert law.gains == LAWS["adaptive"].presets["suit"]
    assert setup.with_law("adaptive", "paper").fitted().gains == LAWS["adaptive"].presets["paper"]


def test_a_rig_with_gains_of_its_own_keeps_them(tmp_path: Path) -> None:
    text = MOTION + "[suit]\nworn = true\n[control.gains]\nfeedback_gain = 2.0\n"
    setup = Rig.read(written(tmp_path, text))
    law = setup.fitted("adaptive")
    assert law.gains == LAWS["adaptive"].gains._replace(feedback_gain=2.0)


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("[wearer]\nmass_kg = 900.0\n", "mass is 900 kg"),
        ("[wearer]\nmass_kg = 200.0\nheight_m = 1.2\n", "body mass index"),
        ("[wearer]\nmass_kg = nan\n", "mass_kg"),
        ("[wearer]\nheight_m = -1.0\n", "height_m"),
        ("[wearer]\ntremor_hz = 50.0\n", "tremor_hz"),
        ('[wearer]\nshare = "weak"\n', "share"),
    ],
)
def test_an_impossible_wearer_is_one_line(tmp_path: Path, section: str, said: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Rig.read(written(tmp_path, MOTION + "[suit]\nworn = true\n" + section))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_suit_that_is_neither_worn_nor_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="true or false"):
        Rig.read(written(tmp_path, MOTION + '[suit]\nworn = "yes"\n'))


@pytest.mark.drawn
def test_the_page_of_a_run_shows_what_the_suit_pulls(tmp_path: Path) -> None:
    setup = Rig.read(written(tmp_path, MOTION + "[suit]\nworn = true\n"))
    assert setup.worn is not None
    law = setup.fitted("adaptive")
    trace = simulate(setup.worn, law, setup.trajectory, duration=4.0, initial_motor=setup.start_motor)
    path = tmp_path / "page.html"
    simulation_page({"adaptive": trace}, "A suit").write(path)
    text = path.read_text(encoding="utf-8")
    assert "Forces of the suit" in text
    assert trace.settings["plant"]["arm"]["mass"] == pytest.approx(1.65)


def test_a_drive_without_an_integral_is_said() -> None:
    worn = SuitSettings(worn=True)
    assert "drive_integral_per_s is 0" in _of_suit(Rig(suit=worn))[0]
    assert not _of_suit(Rig(suit=worn._replace(drive_integral=40.0)))
    assert not _of_suit(Rig())
