"""[suit] and [wearer] of a rig.toml: from the file to the run, and wearers that cannot be."""

from dataclasses import replace
from pathlib import Path

import pytest

from bowden.control import LAWS
from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted
from bowden.core.units import RADIANS
from bowden.design.rig_of_bench import toml_text
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.operations.init import init
from bowden.operations.simulate import _of_suit
from bowden.plants.identified import CableModel, IdentifiedCable
from bowden.plants.presets.suit import suit
from bowden.plants.suit_settings import SuitSettings
from bowden.report.simulate_page import simulation_page
from bowden.rig.rig import Rig
from bowden.sim.run import simulate
from support.command import Command

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


PLAY = CableModel("play", {"slope": -0.5, "half_width": 0.03, "offset": 0.2, "initial_lag": 0.0})
CURVED = BoucWen(slope=0.4, hysteresis_gain=-0.02, rate=200.0)


@pytest.mark.parametrize("spool", [0.01, 0.04])
@pytest.mark.parametrize("kind", ["play", "bouc_wen"])
def test_a_suit_loses_at_its_spool_what_the_identified_cable_does(kind: str, spool: float) -> None:
    parameters = {"initial_h": 0.0, **CURVED._asdict()}
    cable = IdentifiedCable(kind, {"play": PLAY.parameters, "bouc_wen": parameters})
    lost = 0.03 if kind == "play" else -CURVED.hysteresis_gain * saturation(CURVED) / CURVED.slope
    made = Rig(cable=cable, suit=SuitSettings(worn=True, spool_radius=spool))
    flexor = made.moved.flexor  # type: ignore[union-attr]
    assert flexor.half_width == pytest.approx(lost * spool, rel=1e-3)
    own = flexor.bouc_wen  # the model itself loses the same length, and has the suit's slope in place of its own
    length = -own.hysteresis_gain * saturation(own) * flexor.radius
    assert (own.slope, length) == (1.0, pytest.approx(0.02 * saturation(CURVED) / 0.4 * spool))
    assert f"±{1e3 * lost * spool:.3g} mm" in made.whose_cable
    assert ("play_mm" in made.whose_cable) == (not 0.29 < 0.4 * 0.025 / spool < 0.71)
    assert not made.turned


def test_init_writes_a_suit_with_the_cable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command) -> None:
    monkeypatch.chdir(tmp_path)
    model = replace(PLAY, others={"bouc_wen": {"initial_h": 0.0, **CURVED._asdict()}})
    model.write("model.toml")
    said = command("init suit.toml --suit --model model.toml").out
    assert "what model.toml does, ±1.72° or ±0.75 mm of the spool" in said
    rig = Rig.read("suit.toml")
    assert rig == init(model, suit=True).rig
    assert f"law = {quoted(rig.law_name)}" in Path("suit.toml").read_text()
    assert any("model.toml" in note for note in rig.notes)
    assert "play of model.toml, ±0.75 mm" in str(rig)


WORN = "[suit]\nworn = true\n"
CAPSTAN = WORN + 'cable = "capstan"\n'


@pytest.mark.parametrize(
    ("text", "key", "do"),
    [
        (WORN + "[encoder.joint]\nnoise_deg = 0.1\n", "encoder.joint.noise_deg", WORN + "sensor_noise_deg = 0.1\n"),
        (WORN + "[motor]\ninertia_kg_m2 = 0.1\n", "motor.inertia_kg_m2", WORN + "rotor_inertia_kg_m2 = 0.1\n"),
        (WORN + "[cable]\nslope = 0.8\n", "cable.slope", WORN + 'cable = "bouc_wen"\n[cable]\nslope = 0.8\n'),
        (WORN + "[cable]\nwidth = 0.8\n", "cable.width", WORN + "[sheath]\ngap = 0.8\n"),
        (CAPSTAN + "play_mm = 1.0\n", "suit.play_mm", WORN + "play_mm = 1.0\n"),
        (WORN + "capstan_friction = 0.3\n", "suit.capstan_friction", CAPSTAN + "capstan_friction = 0.3\n"),
        ("[wearer]\nmass_kg = 80.0\n", "wearer.mass_kg", WORN + "[wearer]\nmass_kg = 80.0\n"),
        ("[wearer]\nmass_kg = 80.0\n", "wearer.mass_kg", "[suit]\nworn = false\n[wearer]\nmass_kg = 80.0\n"),
        ("[admittance]\nrest_deg = 3.0\n", "admittance.rest_deg", "[admittance]\nenabled = false\nrest_deg = 3.0\n"),
        ("[load_cell]\nscale = 3.0\n", "load_cell.scale", '[load_cell]\nsource = "none"\nscale = 3.0\n'),
    ],
)  # fmt: skip
def test_a_key_without_effect_is_refused_and_what_the_message_says_is_read(
    tmp_path: Path, text: str, key: str, do: str
) -> None:
    with pytest.raises(ParameterError, match=rf"{key} has no effect here"):
        Rig.read(written(tmp_path, text))
    Rig.read(written(tmp_path, do))


def test_a_default_may_be_written_anywhere(tmp_path: Path) -> None:
    whole = toml_text().replace("worn = false", "worn = true")
    assert Rig.read(written(tmp_path, whole)) == Rig.read(written(tmp_path, WORN))
