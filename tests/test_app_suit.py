"""[suit] and [wearer] of a rig.toml: from the file to the run, and wearers that cannot be."""

from pathlib import Path

import pytest

from bowden.control import LAWS
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.report.simulate_page import simulation_page
from bowden.rig import compose
from bowden.rig.compose_suit import suit_of
from bowden.rig.presets.bench import bench
from bowden.rig.presets.suit import suit
from bowden.rig.schema import Rig
from bowden.sim.run import simulate

MOTION = '[reference]\nkind = "periodic_minimum_jerk"\nlow_deg = 0.0\nhigh_deg = 60.0\nperiod_s = 4.0\n'


def written(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_without_a_word_nobody_wears_a_suit(tmp_path: Path) -> None:
    setup, _ = compose.setup(written(tmp_path, MOTION))
    assert setup.suit is None


def test_worn_and_nothing_else_is_the_papers_suit_but_for_the_encoder() -> None:
    rig = Rig.model_validate({"suit": {"worn": True}})
    made, papers = suit_of(rig, bench()), suit()
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
    setup, rig = compose.setup(written(tmp_path, text))
    assert setup.suit is not None
    assert (setup.suit.flexor.kind, setup.suit.motor.integral, setup.suit.sheath.loss) == ("capstan", 20.0, 0.0)
    assert setup.suit.motor.friction_feedforward == 1.5
    assert setup.suit.arm.mass == pytest.approx(3.2)
    assert setup.suit.arm.elevation == pytest.approx(20.0 * RADIANS)
    assert (setup.suit.wearer.share, setup.suit.wearer.tremor) == (0.3, 0.2)
    law = compose.law_for("adaptive", rig, setup.bench, tmp_path)
    assert law.gains == LAWS["adaptive"].presets["suit"]
    assert compose.law_for("adaptive", rig, setup.bench, tmp_path, "paper").gains == LAWS["adaptive"].presets["paper"]


def test_a_rig_with_gains_of_its_own_keeps_them(tmp_path: Path) -> None:
    text = MOTION + "[suit]\nworn = true\n[control.gains]\nfeedback_gain = 2.0\n"
    setup, rig = compose.setup(written(tmp_path, text))
    law = compose.law_for("adaptive", rig, setup.bench, tmp_path)
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
        compose.setup(written(tmp_path, MOTION + "[suit]\nworn = true\n" + section))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_suit_that_is_neither_worn_nor_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="true or false"):
        compose.setup(written(tmp_path, MOTION + '[suit]\nworn = "yes"\n'))


def test_the_page_of_a_run_shows_what_the_suit_pulls(tmp_path: Path) -> None:
    setup, rig = compose.setup(written(tmp_path, MOTION + "[suit]\nworn = true\n"))
    assert setup.suit is not None
    law = compose.law_for("adaptive", rig, setup.bench, tmp_path)
    trace = simulate(setup.suit, law, setup.reference, duration=4.0, initial_motor=setup.initial_motor)
    path = tmp_path / "page.html"
    simulation_page({"adaptive": trace}, "A suit").write(path)
    text = path.read_text(encoding="utf-8")
    assert "What the suit pulls" in text
    assert trace.settings["plant"]["arm"]["mass"] == pytest.approx(1.65)
