"""A model as a rig counts its angles: the same cable, whatever its zeros and its motor's direction."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.core.errors import ParameterError
from bowden.design.rig_of_model import with_stroke
from bowden.plants.counting import Counting, Covered, Encoders, covered_by
from bowden.plants.identified import CableModel, IdentifiedCable, cable_text, load_cable
from bowden.plants.recounted import recalibrated, recounted
from bowden.plants.trust import Trust
from bowden.rig.rig import Rig
from support.cable_models import MODELS

MOTION = 0.4 + 0.4 * np.sin(np.linspace(0.0, 9.0, 300)) * np.linspace(1.0, 0.5, 300)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("counting", [Counting(1, 0.3, 0.8), Counting(-1), Counting(-1, 0.7, 0.4)])
def test_a_recounted_model_is_the_same_cable(name: str, counting: Counting) -> None:
    before = CableModel(name, MODELS[name]).joint_angle(MOTION)
    motor = counting.direction * (MOTION - counting.motor_zero)
    after = CableModel(name, recounted(name, MODELS[name], counting)).joint_angle(motor)
    assert np.ptp(before) > 0.3
    assert np.allclose(after, before - counting.joint_zero, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_a_recalibrated_model_is_gain_times_the_old_one_and_an_offset(name: str) -> None:
    old = CableModel(name, MODELS[name]).joint_angle(MOTION)
    new = CableModel(name, recalibrated(MODELS[name], 1.05, -0.2)).joint_angle(MOTION)
    assert np.allclose(new, 1.05 * old - 0.2, rtol=0.0, atol=1e-12)


def test_a_cable_that_is_no_logs_has_no_other_zeros() -> None:
    assert recounted("sliding", {"length": 1.0}, Counting()) == {"length": 1.0}
    with pytest.raises(ParameterError, match="not identified from a log"):
        recounted("sliding", {"length": 1.0}, Counting(-1))


def test_the_covered_motion_goes_with_the_zeros_and_is_what_all_logs_cover() -> None:
    seen = Covered(0.1, 1.1, 0.5, 1.4)
    assert seen.counted(Counting(-1, 1.1, 0.5)) == pytest.approx((0.0, 1.0, 0.0, 0.9))
    assert covered_by([seen, Covered(-0.2, 0.9, 0.6, 1.6)]) == Covered(-0.2, 1.1, 0.5, 1.6)


def test_a_rigs_file_keeps_how_it_counts(tmp_path: Path) -> None:
    models = {name: MODELS[name] for name in ("line", "play", "bouc_wen")}
    cable = IdentifiedCable("play", models, covered=Covered(0.0, 1.0, 0.6, 1.5))
    (tmp_path / "model.toml").write_text(cable_text(cable))
    assert load_cable(tmp_path / "model.toml").covered == pytest.approx(cable.covered, abs=1e-5)
    head = '[cable]\nmodel = "model.toml"\n'
    plain, file = tmp_path / "plain.toml", tmp_path / "rig.toml"
    plain.write_text(head)
    file.write_text(
        f"{head}direction = -1\nmotor_zero_deg = 57.0\njoint_zero_deg = 30.0\n[reference]\nhigh_deg = 50.0\n"
    )
    rig = Rig.read(file)
    assert Rig.read(plain).turned
    assert not rig.turned
    assert rig.cable.model().parameters["slope"] == 0.9  # type: ignore[union-attr]
    (tmp_path / "again.toml").write_text(rig.to_toml())
    assert "motor_zero_deg = 57.0" in rig.to_toml()
    other = tmp_path / "other.toml"  # of another cable, in whose file another one stands by now
    other.write_text(rig.to_toml().replace(rig.cable.digest, "1f0c9a52b6d3e874"))  # type: ignore[union-attr]
    with pytest.raises(ParameterError, match="not the model that this rig was made from") as error:
        Rig.read(other)
    (line,) = re.findall(r"model_hash = \S+", str(error.value))
    other.write_text(re.sub(r"model_hash = \S+", line, other.read_text()))
    assert Rig.read(other).hash == rig.hash
    again, unpacked = Rig.read(tmp_path / "again.toml"), Rig.unpack(rig.pack())
    assert again.hash == unpacked.hash == rig.hash
    assert unpacked.cable.covered == rig.cable.covered  # type: ignore[union-attr]
    (tmp_path / "apart").mkdir()
    rig.write(tmp_path / "apart" / "rig.toml")
    assert Rig.read(tmp_path / "apart" / "rig.toml").hash == rig.hash


def test_a_reference_beyond_the_log_is_said() -> None:
    models = {name: MODELS[name] | {"slope": 0.9} for name in ("line", "play", "bouc_wen")}
    cable = IdentifiedCable("play", models, covered=Covered(0.0, 1.0, 0.0, np.radians(65.0)))
    assert not [note for note in Rig(cable=cable).notes if "covered" in note]  # 70°, a tenth beyond at most
    narrow = IdentifiedCable("play", models, covered=Covered(0.0, 1.0, 0.0, np.radians(50.0)))
    (note,) = Rig(cable=narrow).notes
    assert note.startswith("the reference goes from 0 to 70°, and the log of the cable's model covered 0.0 to 50.0°")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("direction = -1", "[cable] has direction, and names no model"),
        ('model_hash = "1f"', "[cable] has model_hash, and names no model"),
        ('model = "model.toml"\ndirection = 0', "cable.direction is 0; expected 1 or -1"),
        ('model = "model.toml"\ndirection = true', "cable.direction is true; expected 1 or -1"),
        ('model = "model.toml"\ndirection = -1.0', "cable.direction is -1.0; expected 1 or -1"),
        ('model = "model.toml"\nslope = 1.0\ndirection = -1', "[cable] has a model and its own slope"),
    ],
)
def test_counting_that_makes_no_sense_is_refused(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(cable_text(IdentifiedCable("line", {"line": MODELS["line"]})))
    (tmp_path / "rig.toml").write_text(f"[cable]\n{text}\n")
    with pytest.raises(ParameterError) as error:
        Rig.read(tmp_path / "rig.toml")
    assert said in str(error.value)


def text_of(name: str, **more: Any) -> str:
    return cable_text(IdentifiedCable(name, {one: MODELS[one] for one in ("bouc_wen", name)}, **more))


SAID: dict[str, Any] = {"covered": Covered(-0.1, 1.1, 0.2, 1.4), "encoders": Encoders(1e-3, 2e-3, 0.005)}
SAID["trust"] = Trust("with care", ('a "reason"', "another"))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("said", [SAID, {}], ids=["all", "nothing"])
def test_a_written_cable_is_read_back(name: str, said: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(text_of(name, **said))
    back = load_cable(file)
    assert (back.best, back.models, back.trust) == (
        name,
        {one: MODELS[one] for one in ("bouc_wen", name)},
        said.get("trust"),
    )
    assert back.encoders == pytest.approx(said.get("encoders", (0.0, 0.0, 0.0)))
    assert back.covered == (pytest.approx(said["covered"], abs=1e-6) if said else None)
    assert np.isnan(back.judged)
    for key in ("test_rms_deg", "judged_rms_deg"):  # the second is nearer to what is wanted
        file.write_text(file.read_text() + f"[models.{name}]\n" * (key[0] == "t") + f"{key} = {len(key)}\n")
        assert load_cable(file).judged == pytest.approx(np.radians(len(key)))


@pytest.mark.parametrize(
    ("name", "pattern", "instead", "said"),
    [
        ("line", ".*", "best = ", "is no TOML file"),
        ("line", ".*", "best = 'line'", "has no models"),
        ("line", ".*", "models = 3\nbest = 'line'", "has no models"),
        ("line", "best = .*", 'best = "spline"', "has no model 'spline'"),
        ("line", "bouc_wen", "bouc", "has no model 'bouc_wen'"),
        ("line", r"\.parameters", "", r"\[models.bouc_wen.parameters\] is missing"),
        ("bouc_wen", "rate = .*", "rate = -1.0", "rate of bouc_wen is -1"),
        ("bouc_wen", "shape = .*", "shape = 0.5", "shape of bouc_wen is 0.5; expected a number above 0.5"),
        ("bouc_wen", "exponent = .*", "", "no parameter 'exponent'"),
        ("bouc_wen", "exponent = .*", "colour = 1.0", "no model has a parameter 'colour'"),
        ("prandtl_ishlinskii", "weight_1 = .*", "weight_1 = 0.49995", "slope of prandtl_ishlinskii is -5e-05"),
        ("scheduled", "bend_high = .*", "bend_high = 2.0", "bend_high of scheduled is 2.0; expected a number above 2"),
        ("scheduled", "knot_step = .*", "", "no parameter 'knot_step'"),
        ("generalised_play", "share_1 = .*", "", "has 2 reaches and 1 shares; expected as many of both"),
        ("generalised_play", r"gap_[2-4] = .*", "", "has 1 gaps; expected 2 or more"),
        ("generalised_play", r"bend_\d = .*", "", "has 0 bends; expected 2 or more"),
        ("generalised_play", "last_node = .*", "last_node = -0.6", "last_node -0.6; expected the last above the first"),
        *(
            ("line", r"motor_deg = \[.*", f"motor_deg = {pair}", r"motor_deg of \[covered\]")
            for pair in ("[1.0]", "[2.0, 1.0]", "[1.0, 1.0]", "[0.0, nan]", "[-1e30, 1e30]", '["a", 1.0]', "3")
        ),
        ("line", r"joint_deg = \[.*", "joint_deg = [0, 10001]", r"joint_deg of \[covered\] .* within ±10000"),
        ("line", r"motor_deg = 0.*", "motor_deg = 180.5", r"\[encoders\] is"),
        ("line", r"joint_late_s = .*", "joint_late_s = -1", r"\[encoders\] is"),
        ("line", r"joint_late_s = .*", "joint_late_s = true", r"\[encoders\] is"),
        ("line", "level = .*", 'level = "perhaps"', r"\[trust\] is"),
    ],
)
def test_a_model_file_that_is_none_is_refused(name: str, pattern: str, instead: str, said: str, tmp_path: Path) -> None:
    file, text = tmp_path / "model.toml", text_of(name, **SAID)
    with pytest.raises(ParameterError, match=r"model\.toml cannot be read"):
        load_cable(file)
    file.write_text(instead if pattern == ".*" else re.sub(pattern, instead, text))
    with pytest.raises(ParameterError, match=said) as refused:
        load_cable(file)
    assert file.read_text() != text
    assert (
        str(file) in str(refused.value) or "cable model" in str(refused.value) or "no model has" in str(refused.value)
    )


@pytest.mark.parametrize(("name", "ends"), [("bouc_wen_static", (-1.1, 0.1)), ("scheduled", (-0.6, 0.4))])
def test_a_file_without_the_covered_motion_has_its_models(name: str, ends: tuple[float, float]) -> None:
    found = with_stroke(IdentifiedCable(name, {one: MODELS[one] for one in ("bouc_wen", name)})).covered
    assert found is not None
    assert found[:2] == pytest.approx(ends)
    assert 0.6 < found.joint_high - found.joint_low < 1.3
