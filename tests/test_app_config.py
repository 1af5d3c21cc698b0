"""rig.toml: what is written is what is meant, and every mistake gets one line that helps."""

import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from bowden.control import LAWS
from bowden.core.errors import BowdenError, ParameterError
from bowden.core.units import RADIANS
from bowden.design.rig_of_bench import toml_text
from bowden.models.cable.bouc_wen import BoucWen
from bowden.operations.schema import json_schema
from bowden.paper.bench import observer as paper_observer
from bowden.plants.presets.bench import default_bench
from bowden.plants.presets.paper import calibration, minimum_jerk
from bowden.rig.rig import Rig
from bowden.rig.sections import BENDS, REFERENCES, RigFile
from bowden.sim.run import simulate
from rig_page import markdown, rounded

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).parents[1]


def rig(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text)
    return path


def test_the_commented_default_says_what_an_empty_file_says() -> None:
    table = tomllib.loads(toml_text())
    assert RigFile.model_validate(table) == RigFile()
    assert set(table) == set(RigFile.model_fields)


def numbers(value: Any) -> list[float]:
    """Every number in nested NamedTuples, in order."""
    return [number for part in value for number in numbers(part)] if isinstance(value, tuple) else [value]


def test_the_default_rig_is_the_papers_bench(tmp_path: Path) -> None:
    setup = Rig.read(rig(tmp_path, toml_text()))
    assert numbers(setup.bench) == pytest.approx(numbers(default_bench()), rel=4e-16, abs=0.0)  # degrees and back
    assert setup.reference == minimum_jerk()
    assert setup.start_motor == 0.0
    assert not setup.notes


def test_every_commented_alternative_is_right_when_it_is_uncommented() -> None:
    text = toml_text()
    blocks = text.split("# Or, in place of that:\n")[1:]
    assert len(blocks) == len(REFERENCES) + len(BENDS) - 2
    for block in blocks:
        lines = block.split("\n\n")[0].splitlines()
        RigFile.model_validate(tomllib.loads("\n".join(line.removeprefix("# ") for line in lines)))
    gains = text.split("# [control.gains]\n")[1].split("\n\n")[0]
    given = tomllib.loads("\n".join(line.removeprefix("# ") for line in gains.splitlines()))
    assert given == LAWS["adaptive"].gains._asdict()


@pytest.mark.parametrize(
    ("default", "shown"),
    [("8.52699663955155", "8.527"), ("0.02197265625", "0.0219727"), ("-36000.0", "-36000.0"), ('"play"', '"play"')],
)
def test_a_default_is_shown_with_six_digits_at_most(default: str, shown: str) -> None:
    assert rounded(default) == shown


def test_the_written_documentation_is_up_to_date() -> None:
    assert (ROOT / "docs" / "rig.md").read_text(encoding="utf-8") == markdown(), "run: make docs"


def test_the_schema_takes_the_default_and_refuses_an_unknown_key() -> None:
    schema = json_schema("rig")
    table = tomllib.loads(toml_text())
    jsonschema.validate(table, schema)
    table["servo"]["dampng"] = 1.0
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(table, schema)


@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.toml")), ids=lambda path: path.name)
def test_the_examples_are_right(example: Path) -> None:
    Rig.read(example)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[servo]\ndampng = 1", "unknown key 'dampng' in [servo]; expected damping (did you mean this?)"),
        ("[servo]\ndamping = -1", "servo.damping is -1; expected a number above 0"),
        ("[servo]\ndamping = nan", "servo.damping is nan; expected a finite number"),
        ("servo = 3", "servo is 3; expected a section"),
        ("[bench]\nsubsteps = 1.5", "bench.substeps is 1.5; expected a whole number"),
        ("[cable]\nmodel = 'm.toml'\nslope = 1.0", "[cable] has a model and its own slope; expected one or the other"),
        ("[cable]\nmodel = 'none.toml'", "none.toml cannot be read: No such file or directory; check the path"),
        ("[reference]\ntimes_s = [1]", "reference.kind is missing; expected periodic_minimum_jerk, point_to_point"),
        ("[reference]\nkind = 'chrip'", "reference.kind is 'chrip'; expected chirp (did you mean this?)"),
        (
            "[reference]\nlow_deg = 7\nhigh_deg = 1.03",
            "low_deg is 7 and high_deg 1.03; radians? 1.03 rad would be 59°; expected low_deg below high_deg",
        ),
        (
            "[reference]\nkind = 'point_to_point'\ntimes_s = [1.0]",
            "reference.times_s is [1.0] and reference.positions_deg [0.0, 70.0, 70.0, 0.0]; expected two lists of one",
        ),
        (
            "[scenario.bend]\nkind = 'scripted'\ntimes_s = [20.0, 10.0]",
            "scenario.bend.times_s is [20.0, 10.0] and scenario.bend.bends_deg [180.0, 360.0]; expected two lists",
        ),
        ("[scenario.bend]\nkind = 'random'\nlow_deg = 400.0", "scenario.bend.low_deg is 400 and high_deg 360; expect"),
        (
            "[reference]\nkind = 'recorded'\nfile = 'none.csv'",
            "reference: cannot read {folder}/none.csv: no such file; check the path",
        ),
        ("[cable]\nmodel = 'rig.toml'", "cable.model: {folder}/rig.toml has no models in it; expected the model.toml"),
        ('[cable]\nmodel = "a\\u0000b"', "is no TOML file: embedded null byte; expected the model.toml"),
        ("[scenario]\nduration_s = 1e-9", "expected a duration that makes 2 to 10000000"),
        ("[servo\n", "is not TOML"),
        ("[servo]\ndamping = 1\ndamping = 2", "rig.toml: line 3 writes damping a second time; delete one of the two"),
        ('best = "play"\n[models.play]', "is the model of a cable, not a rig; expected a rig.toml; make one round it"),
    ],
)
def test_a_mistake_gets_one_line_that_helps(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BowdenError) as caught:
        Rig.read(rig(tmp_path, text))
    message = str(caught.value).replace("\\", "/")
    assert said.replace("{folder}", tmp_path.as_posix()) in message
    assert "duration" in text or f"{tmp_path.as_posix()}/rig.toml" in message
    assert caught.value.do
    assert "\n" not in message


def test_a_length_in_metres_is_pointed_out(tmp_path: Path) -> None:
    notes = Rig.read(rig(tmp_path, "[suit]\nworn = true\nspool_radius_mm = 0.025")).notes
    assert "suit.spool_radius_mm is 0.025; metres? 0.025 m would be 25" in notes


def test_a_file_that_is_no_text_or_no_file(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\x01")
    for path, said in (
        (tmp_path / "binary.toml", "not text"),
        (tmp_path, "directory"),
        (tmp_path / "x", "bowden init"),
    ):
        with pytest.raises(ParameterError, match=said):
            Rig.read(path)


def test_gains_come_from_the_rig_the_preset_and_the_cable_in_that_order(tmp_path: Path) -> None:
    text = "[cable]\nslope = 0.8\n[control]\nlaw = 'observer'\n[control.gains]\nrate = 7.0\n"
    setup = Rig.read(rig(tmp_path, text))
    observer = setup.fitted("observer")
    assert (observer.gains.slope, observer.gains.rate) == (0.8, 7.0)
    adaptive = setup.with_law("adaptive", "paper").fitted()
    assert adaptive.gains == LAWS["adaptive"].presets["paper"]


@pytest.mark.parametrize(
    ("law", "text", "said"),
    [
        ("adaptiv", "", "there is no law 'adaptiv'; expected adaptive (did you mean this?)"),
        (
            "observer",
            "[control]\npreset = 'p'\nlaw = 'observer'",
            "law 'observer' has no preset 'p'; expected paper",
        ),
        ("adaptive", "[control.gains]\nerrorgain = 1.0", "no gain 'errorgain'"),
        ("adaptive", "[control.gains]\nerror_gain = -1.0", "gain error_gain of law 'adaptive' is -1"),
    ],
)
def test_laws_presets_and_gains_that_are_not_there(tmp_path: Path, law: str, text: str, said: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Rig.read(rig(tmp_path, text)).fitted(law)
    assert said in str(caught.value)
    assert caught.value.do


def test_the_observers_preset_is_the_default_benchs(tmp_path: Path) -> None:
    assert LAWS["observer"].presets["paper"] == paper_observer(calibration()).gains
    for cable, slope in (("", 0.938), ("[cable]\nslope = 0.8\n", 0.8)):  # what the preset leaves, the rig tells
        law = Rig.read(rig(tmp_path, cable)).with_law("observer", "paper").fitted()
        assert law.gains == paper_observer(calibration()).gains._replace(slope=slope)
    assert law.gains.hysteresis_gain == pytest.approx(-0.129 * 0.8841 * 0.566, rel=1e-3)


MODEL = """
best = "{best}"
[models.bouc_wen.parameters]
slope = {slope}
hysteresis_gain = 0.11
rate = 10.0
shape = 9.0
exponent = 2.5
offset = 0.02
initial_h = 0.0
[models.line.parameters]
slope = -0.8
offset = 0.0
"""


def test_an_identified_cable_is_the_benchs_and_the_observers(tmp_path: Path) -> None:
    path = rig(tmp_path, "[cable]\nmodel = 'model.toml'\n[control]\nlaw = 'observer'")
    (tmp_path / "model.toml").write_text(MODEL.format(slope=-0.9, best="bouc_wen"))
    setup = Rig.read(path)
    assert setup.bench.cable == BoucWen(0.9, -0.11, 10.0, 9.0, 2.5, 0.02)  # it runs the other way: counted so
    assert setup.bench.sheath.gap == 1.0
    assert len(setup.notes) == 1
    observer = setup.fitted("observer")
    assert observer.gains._asdict().items() >= setup.bench.cable._asdict().items()

    (tmp_path / "model.toml").write_text(MODEL.format(slope=0.9, best="line"))
    assert "recommends 'line'" in Rig.read(path).notes[0]
    (tmp_path / "model.toml").write_text(MODEL.format(slope=0.0, best="line"))
    with pytest.raises(ParameterError, match="slope of bouc_wen is 0"):
        Rig.read(path)


def test_the_uncompensated_law_knows_slope_and_zero_and_nothing_else(tmp_path: Path) -> None:
    path = rig(tmp_path, "[cable]\nmodel = 'model.toml'\n[scenario]\nduration_s = 10.0")
    errors = []
    for offset in ("0.0", "1.25"):
        (tmp_path / "model.toml").write_text(MODEL.format(slope=-0.9, best="bouc_wen").replace("0.02", offset))
        setup = Rig.read(path)
        law = setup.fitted("uncompensated")
        assert law.numbers == pytest.approx({"slope": 0.9, "motor_zero": -float(offset) / 0.9})
        trace = simulate(setup.bench, law, setup.trajectory, duration=setup.duration, initial_motor=setup.start_motor)
        errors.append(trace.metrics().rmse_deg)
    assert errors[0] is not None
    assert 1.0 < errors[0] < 4.0  # the play
    assert errors[1] == pytest.approx(errors[0], rel=1e-6)  # wherever the motor's encoder is zeroed


def test_a_run_starts_where_the_reference_does(tmp_path: Path) -> None:
    text = (
        "[cable]\noffset_deg = 4.0\n[reference]\nkind = 'multisine'\ncentre_deg = 30.0\n[scenario]\nduration_s = 0.1\n"
    )
    setup = Rig.read(rig(tmp_path, text + "[scenario.bend]\nkind = 'constant'\nbend_deg = 300.0"))
    law = setup.fitted("observer")
    trace = simulate(
        setup.bench,
        law,
        setup.trajectory,
        duration=setup.duration,
        bend=setup.bend_path,
        initial_motor=setup.start_motor,
    )
    assert trace["joint"][0] == pytest.approx(30.0 * RADIANS)


def test_a_cable_that_runs_the_other_way_is_counted_the_other_way(tmp_path: Path) -> None:
    text = "[cable]\nslope = {}0.9\nhysteresis_gain_rad = {}0.1\n[scenario]\ninitial_motor_deg = {}5.0"
    plus = Rig.read(rig(tmp_path, text.format("", "-", "")))
    minus = Rig.read(rig(tmp_path, text.format("-", "", "-")))
    assert minus.bench == plus.bench
    assert minus.start_motor == plus.start_motor
    assert "other way" in minus.notes[0]
