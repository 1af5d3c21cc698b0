"""One frozen rig: the same thing from Python, a file, bytes or a log; and nothing runs but what was checked."""

import json
import math
import pickle
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden import check
from bowden.control import LAWS
from bowden.control.law_file import load
from bowden.control.reference import Chirp, Multisine, PeriodicMinimumJerk, PointToPoint, Recorded
from bowden.core.errors import BowdenError, OutputError, ParameterError
from bowden.core.quantity import in_unit
from bowden.core.units import DEGREES, HERTZ, RADIANS
from bowden.live.live_run import live_run
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.servo import Servo
from bowden.plants.bench import Bench
from bowden.plants.bends import ConstantBend, RandomBend, ScriptedBend
from bowden.plants.identified import CableModel
from bowden.plants.suit_settings import SuitSettings
from bowden.rig.declaration import items_of
from bowden.rig.rig import Rig
from bowden.rig.sections import PARTS
from bowden.rig.settings import EmgSettings
from bowden.safety.limits import Limits
from bowden.sim.rig_runs import run_of
from bowden.study.load import load as load_study

MODEL = """
best = "play"
[models.bouc_wen.parameters]
slope = 0.9
hysteresis_gain = -0.11
rate = 10.0
shape = 9.0
exponent = 2.5
offset = 0.02
initial_h = 0.0
[models.play.parameters]
slope = 0.9
half_width = 0.05
offset = 0.0
initial_lag = 0.0
"""
LAW = (
    "from dataclasses import replace\nfrom bowden.control import LAWS\nMINE = replace(LAWS['adaptive'], name='mine')\n"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def whole(folder: Path) -> Path:
    """A rig.toml that names a model, a motion and a law."""
    time = np.arange(400) * 0.01
    rows = "\n".join(f"{t},{30.0 * np.sin(t)}" for t in time)
    (folder / "motion.csv").write_text(f"time_s,joint_deg\n{rows}\n")
    (folder / "model.toml").write_text(MODEL)
    (folder / "my_law.py").write_text(LAW)
    path = folder / "rig.toml"
    path.write_text(
        "[cable]\nmodel = 'model.toml'\n[reference]\nkind = 'recorded'\nfile = 'motion.csv'\n"
        "[control]\nlaw = 'my_law.py:MINE'\n[control.gains]\nfeedback_gain = 1.5\n[scenario]\nduration_s = 3.0\n"
    )
    return path


def test_python_and_an_empty_file_are_the_same_rig(folder: Path) -> None:
    (folder / "rig.toml").write_text("")
    assert Rig.read("rig.toml") == Rig()
    assert Rig.read("rig.toml").hash == Rig().hash


@pytest.mark.parametrize(
    ("text", "rig"),
    [
        ("[servo]\nnatural_frequency_hz = 3.7\ndamping = 0.7", {"servo": Servo(3.7 * HERTZ, 0.7, 100.0)}),
        ("[encoder.motor]\nresolution_deg = 0.1", {"motor_encoder": Encoder(np.radians(0.1), 0.01 * RADIANS)}),
        ("[bench]\nsample_time_ms = 2\ndelay_cycles = 3", {"sample_time": 0.002, "delay": 3}),
        ("[cable]\nslope = 0.8\nwidth = 1", {"cable": BoucWen(slope=0.8), "width": 1}),
        (
            "[reference]\nkind = 'chirp'\namplitude_deg = 33.3\nstart_hz = 0.1\nend_hz = 2.0\nsweep_s = 10.0",
            {"reference": Chirp(np.radians(33.3), 0.1, 2.0, 10.0)},
        ),
        ("[scenario.bend]\nkind = 'constant'\nbend_deg = 200", {"bend": np.radians(200.0)}),
        (
            "[control]\nlaw = 'bowden'\n[control.gains]\nbandwidth = 2",
            {"law": "bowden", "gains": {"bandwidth": 2}},
        ),
        ("[suit]\nworn = true", {"suit": SuitSettings(worn=True)}),
    ],
)
def test_the_hash_is_that_of_what_is_said_and_not_of_where(folder: Path, text: str, rig: dict[str, Any]) -> None:
    (folder / "rig.toml").write_text(text)
    made = Rig(**rig)
    if "suit" in rig:
        made = made.replace(suit=Rig.read("rig.toml").suit)  # a file's defaults have ten digits
    assert Rig.read("rig.toml").hash == made.hash != Rig().hash


MOTIONS = [
    PeriodicMinimumJerk(0.1, 1.0, 7.0),
    PointToPoint((0.0, 1.0, 3.0), (0.0, 0.5, 0.1)),
    Chirp(0.5, 0.1, 3.0, 20.0),
    Multisine((0.1, 0.3), (0.2, 0.1), (0.0, 1.0), 0.3, 1.5),
]


@pytest.mark.parametrize("reference", MOTIONS, ids=lambda one: type(one).__name__)
@pytest.mark.parametrize("bend", [ConstantBend(2.0), ScriptedBend((1.0, 2.0), (3.0, 5.0)), RandomBend(2.0, 4.0, 1.0)])
def test_a_rig_survives_bytes_pickle_and_text(folder: Path, reference: Any, bend: Any) -> None:
    rig = Rig(reference=reference, bend=bend, initial_motor=0.25, preset="paper", duration=12.5)
    for again in (Rig.unpack(rig.pack()), pickle.loads(pickle.dumps(rig))):
        assert again == rig
        assert again.hash == rig.hash
    (folder / "again.toml").write_text(rig.to_toml())
    assert Rig.read("again.toml").hash == rig.hash


def test_what_a_file_names_is_part_of_the_rig(folder: Path) -> None:
    rig = Rig.read(whole(folder))
    packed = rig.pack()
    before = rig.trajectory.sample(np.linspace(0.0, 3.0, 50))
    for path in folder.iterdir():
        path.unlink()
    for one in (rig, Rig.unpack(packed)):
        assert one.hash == rig.hash
        assert one.fitted().name == "mine"
        assert one.fitted().gains.feedback_gain == 1.5
        assert one.cable.model("play").parameters["half_width"] == 0.05  # type: ignore[union-attr]
        assert np.array_equal(one.trajectory.sample(np.linspace(0.0, 3.0, 50)), before)
    assert isinstance(rig.moved, Bench)
    assert rig.moved.cable.name == "play"
    trace = run_of(rig.replace(duration=0.2), rig.fitted())
    assert np.isfinite(trace["joint"]).all()
    assert trace["joint"][0] == pytest.approx(rig.begin)


def test_a_rig_is_written_with_all_that_it_was_made_of(folder: Path) -> None:
    rig = Rig.read(whole(folder))
    (folder / "new").mkdir()
    rig.write("new/rig.toml")
    assert {path.name for path in (folder / "new").iterdir()} == {"rig.toml", "model.toml", "motion.csv", "my_law.py"}
    assert Rig.read("new/rig.toml").hash == rig.hash
    rig.write("new/rig.toml")
    with pytest.raises(OutputError, match=r"rig\.toml is there already"):
        rig.replace(delay=3).write("new/rig.toml")
    rig.replace(delay=3).write("new/rig.toml", force=True)
    fit = Path("new/model.toml")
    fit.write_text(f"# a fit's own, which says more\n{fit.read_text()}")
    rig.replace(delay=3).write("new/rig.toml")
    assert "says more" in fit.read_text()
    with pytest.raises(ParameterError, match=r"servo\.acceleration_limit is 9, which has no key"):
        Rig(servo=Servo(20.0, 1.0, 10.0, 9.0)).to_toml()


def test_the_same_contents_elsewhere_make_the_same_hash_and_others_another(folder: Path) -> None:
    rig = Rig.read(whole(folder))
    shutil.copytree(folder, folder / "copy")
    assert Rig.read("copy/rig.toml").hash == rig.hash
    for name, old, new in (
        ("model.toml", "0.05", "0.06"),
        ("my_law.py", "mine", "mine2"),
        ("motion.csv", "0.01", "0.0101"),
    ):
        path = folder / "copy" / name
        text = path.read_text()
        path.write_text(text.replace(old, new, 1))
        assert Rig.read("copy/rig.toml").hash != rig.hash, name
        path.write_text(text)


def test_a_file_that_changes_after_the_check_changes_nothing(folder: Path) -> None:
    """The value goes to the loop's process; the file is not looked at again."""
    path = folder / "rig.toml"
    path.write_text("[control.gains]\nfeedback_gain = 4.0\n")
    live = live_run(Rig.read(path))
    path.write_text("[control.gains]\nfeedback_gain = 0.5\n")
    handed = json.loads(json.dumps(live.rig.document()))
    path.unlink()
    loop = live_run(Rig.unpack(handed))
    assert loop.law.gains == live.law.gains
    assert loop.law.gains.feedback_gain == 4.0
    assert loop.needs == live.needs
    assert loop.limits == live.limits
    assert np.array_equal(loop.table, live.table)
    assert live.settings()["rig"]["fields"]["gains"] == {"feedback_gain": 4.0}


def test_a_cable_that_runs_the_other_way_simulates_right_in_python_too() -> None:
    plus = Rig(cable=BoucWen(slope=0.9, hysteresis_gain=-0.1), duration=3.0)
    minus = Rig(cable=BoucWen(slope=-0.9, hysteresis_gain=0.1), duration=3.0)
    assert minus.turned
    assert "other way" in minus.notes[0]
    one, other = (run_of(rig, rig.fitted()) for rig in (plus, minus))
    assert np.array_equal(one["joint"], other["joint"])
    assert one.settings["rig"] == plus.hash != minus.hash == other.settings["rig"]


def test_a_law_of_python_is_taken_and_one_of_a_file_is_handed_on(folder: Path) -> None:
    rig = Rig(law=LAWS["adaptive"].with_gains(feedback_gain=1.25))
    again = Rig.unpack(rig.pack())
    assert again.fitted().gains.feedback_gain == 1.25
    assert again.hash == rig.hash
    assert Rig(law=LAWS["bowden"]) == Rig(law="bowden")
    (folder / "my_law.py").write_text(LAW)
    assert Rig(law="my_law.py:MINE").fitted().name == "mine"


NESTED = """
from typing import NamedTuple
from bowden import kernel

class Inner(NamedTuple):
    slope: float = 0.9
    count: int = 3

class Gains(NamedTuple):
    feedback: float = 0.1
    cable: Inner = Inner()

class State(NamedTuple):
    before: float

@kernel
def start(gains, sample):
    return State(sample.motor)

@kernel
def step(gains, state, sample, reference, dt):
    error = reference.position - sample.joint
    command = reference.position / gains.cable.slope + gains.feedback * gains.cable.count * error
    return State(command), command
"""


def test_every_laws_chosen_gains_survive_bytes_and_text(folder: Path) -> None:
    (folder / "nested.py").write_text(NESTED)
    nested = load("nested.py", folder).with_gains(**{"cable.slope": 1.0 / 3.0})
    assert nested.gains.cable == type(nested.gains.cable)(1.0 / 3.0, 3)
    chosen = [
        law.with_gains(**{name: law.numbers[name] * 0.9 + 1e-17 for name in list(law.numbers)[:4]})
        for law in (*LAWS.values(), nested)
    ]
    for law in (*chosen, nested, nested.with_gains(feedback=0.2)):
        again = Rig.unpack(Rig(law=law).pack()).loaded_law
        assert again.gains._asdict() == law.gains._asdict()
        assert [type(one) for one in again.numbers.values()] == [type(one) for one in law.numbers.values()]
        assert again.overridden_gains == law.overridden_gains
        place = folder / f"{law.name}.toml"
        place.unlink(missing_ok=True)
        Rig(law=law).write(place)
        assert Rig.read(place).fitted().numbers == Rig(law=law).fitted().numbers
    for text in ("[control.gains]\ncable.slope = 0.8\n", "[control.gains.cable]\nslope = 0.8\n"):
        (folder / "bare.toml").write_text(f"[control]\nlaw = 'nested.py'\n{text}")
        assert Rig.read(folder / "bare.toml").hash == Rig(law="nested.py", gains={"cable.slope": 0.8}).hash
    with pytest.raises(ParameterError, match=r"no gain 'cable\.slop'; expected one of .*did you mean cable\.slope"):
        Rig(law="nested.py", gains={"cable.slop": 1.0})


def test_the_check_and_a_study_know_the_gains_of_a_part(folder: Path) -> None:
    (folder / "nested.py").write_text(NESTED)
    assert check(Rig(law="nested.py", gains={"cable.slope": 0.938})).verdict == "holds"
    (folder / "study.toml").write_text(
        'laws = ["nested.py"]\nruns = 2\n[vary]\n"control.gains.cable.slope" = { uniform = [0.9, 1.0] }\n'
    )
    laws = [load_study(folder / "study.toml").run(number)[1][0] for number in range(2)]
    assert 0.9 <= laws[0].numbers["cable.slope"] != laws[1].numbers["cable.slope"] <= 1.0
    assert laws[0].gains.cable.count == 3


def test_another_law_takes_none_of_this_ones_gains() -> None:
    rig = Rig(law="adaptive", gains={"feedback_gain": 1.5})
    assert rig.with_law("adaptive").fitted().gains.feedback_gain == 1.5
    assert rig.with_law("bowden").fitted().gains == rig.fitted("bowden").gains == Rig(law="bowden").fitted().gains


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"sample_time": "1 ms"}, "sample_time is '1 ms'; expected a number at least 1e-05 and at most 0.1 in s"),
        ({"sample_time": 1.0}, "sample_time is 1; expected"),
        ({"bend": 180.0}, "bend.bend is 180; expected"),
        ({"law": "adaptiv"}, "adaptive (did you mean this?)"),
        ({"preset": "papr"}, "law 'adaptive' has no preset 'papr'; expected paper (did you mean this?)"),
        ({"servo": Servo(natural_frequency=float("nan"))}, "servo.natural_frequency is nan; expected a number above 0"),
        ({"servo": Servo(natural_frequency=-1.0)}, "servo.natural_frequency is -1"),
        ({"servo": 53.0}, "servo is 53.0; expected a Servo; make one: Rig(servo={'natural_frequency': …})"),
        ({"suit": True}, "suit is True; expected a SuitSettings; make one: Rig(suit={'worn': …})"),
        ({"cable": "model.toml"}, "cable is 'model.toml'; expected a BoucWen(slope=…), or what bowden.identify gives"),
        ({"cable": BoucWen(slope=0.0)}, "cable.slope is 0"),
        ({"gains": {"feedback_gain": "1"}}, "gains['feedback_gain'] is '1'; expected a number"),
        ({"delay": 1.5}, "delay is 1.5; expected a whole number"),
        ({"duration": 1e-9}, "expected a duration that makes 2 to 10000000"),
        ({"limits": Limits(motor_high="2")}, "limits.motor_high is '2'; expected a number"),
        ({"limits": {"motor_high": None}}, "limits.motor_high is None; expected a number"),
        ({"emg": EmgSettings(source="carrier:pigeon")}, "is not a source of EMG"),
        ({"reference": 3.0}, "reference is 3.0; expected a reference such as"),
    ],
)
def test_a_wrong_argument_is_named_with_what_was_given_and_expected(given: dict[str, Any], said: str) -> None:
    with pytest.raises(BowdenError) as caught:
        Rig(**given)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_angle_in_degrees_is_said_to_look_like_it() -> None:
    with pytest.raises(ParameterError, match=r"reference\.high is 70.*looks like degrees: np\.radians\(70\)"):
        Rig(reference=PeriodicMinimumJerk(0.0, 70.0, 10.0))


def test_an_unknown_field_gets_the_one_that_was_meant() -> None:
    with pytest.raises(ParameterError, match=r"a rig has no 'servos'; expected servo \(did you mean this\?\)"):
        Rig().replace(servos=Servo())
    with pytest.raises(ParameterError, match=r"a rig has no 'dely'; expected delay \(did you mean this\?\)"):
        Rig(dely=3)  # type: ignore[call-arg]
    with pytest.raises(ParameterError, match="3 has no name"):
        Rig(3)  # type: ignore[misc]


def test_whole_numbers_and_numpys_become_plain_ones() -> None:
    rig = Rig(servo=Servo(20, np.float64(1.0), 10), duration=np.float64(5.0), delay=np.int64(2))
    assert [type(value) for value in rig.servo[:3]] == [float] * 3
    assert (type(rig.duration), type(rig.delay)) == (float, int)


def test_every_declared_key_converts_there_and_back() -> None:
    """The default in a file's unit gives the default again, to the last bit."""
    for name, part in PARTS.items():
        for item in items_of(part.kind):
            value: Any = part.default
            for one in item.path:
                value = getattr(value, one)
            if isinstance(value, float) and not math.isnan(value):  # which follows, and is not in a file
                factor = item.quantity.factor
                assert in_unit(value, factor) * factor == value, (name, item.key)
                assert not (factor == RADIANS and "deg" not in item.key), (name, item.key)


def test_an_identified_cable_is_kept_whole_and_one_without_what_laws_need_is_refused() -> None:
    play = {"slope": 0.9, "half_width": 0.05, "offset": 0.0, "initial_lag": 0.0}
    plain = {"slope": 0.9, "hysteresis_gain": -0.1, "rate": 9.0, "shape": 9.0, "exponent": 3.0, "offset": 0.0}
    rig = Rig(cable=CableModel("play", play, {"bouc_wen": plain}))
    assert rig.cable.model().parameters == play  # type: ignore[union-attr]
    assert rig.bench.cable.slope == 0.9
    assert rig.width == 1.0
    assert Rig.unpack(rig.pack()).hash == rig.hash
    with pytest.raises(ParameterError, match="has no model 'bouc_wen'"):
        Rig(cable=CableModel("play", play))


def test_a_motion_recorded_in_python_is_held_and_handed_on() -> None:
    time = np.arange(500) * 0.01
    rig = Rig(reference=Recorded(time, 0.4 * np.sin(time), name="elbow"), duration=4.0)
    again = Rig.unpack(rig.pack())
    assert again == rig
    assert np.array_equal(again.trajectory.sample(time), rig.trajectory.sample(time))
    assert abs(rig.begin) * DEGREES < 1.0


def test_a_rig_of_another_version_is_refused_in_a_line() -> None:
    with pytest.raises(ParameterError, match="has the format 99"):
        Rig.unpack(Rig().document() | {"format": 99})
    with pytest.raises(ParameterError, match="not a packed rig"):
        Rig.unpack(b"rubbish")


def test_a_section_without_a_kind_is_of_the_first_one_if_its_keys_are(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("[reference]\nhigh_deg = 50.0\n[scenario.bend]\nbend_deg = 90.0\n")
    rig = Rig.read(path)
    assert isinstance(rig.reference, PeriodicMinimumJerk)
    assert rig.reference.high == pytest.approx(50.0 * RADIANS)
    assert rig.bend_path(np.zeros(1))[0] == pytest.approx(90.0 * RADIANS)


def test_what_was_probably_meant_otherwise_is_said() -> None:
    small = Rig(reference=PeriodicMinimumJerk(0.0, 1.22 * RADIANS, 10.0))
    assert "radians? 1.22 rad would be 69.9°" in small.notes[0]
    assert not Rig().notes
    assert not Rig(emg=EmgSettings(source="lsl:EMG")).notes
    assert "[emg] has no source, so the joint follows [reference]" in Rig(emg=EmgSettings(high=1.0)).notes[0]
    still = Rig(reference=PeriodicMinimumJerk(0.0, 0.0, 10.0))
    assert not still.notes


def test_the_defaults_of_a_rig_let_it_run_by_emg() -> None:
    assert Limits().joint_low < EmgSettings().low < EmgSettings().high < Limits().joint_high


def test_with_another_law_go_the_gains_of_the_old_one() -> None:
    tuned = Rig(law="bowden", gains={"bandwidth": 4.0})
    assert tuned.replace(law="adaptive") == tuned.with_law("adaptive") == Rig(law="adaptive")
    assert tuned.replace(law="bowden", seed=5).gains == tuned.gains
    with pytest.raises(ParameterError, match="leave gains= out"):
        tuned.replace(law="adaptive", gains=tuned.gains)


def test_gains_of_another_law_are_named_as_such_whatever_law_a_command_asks_for(folder: Path) -> None:
    """`--law` comes after the rig was read, and its gains are those of the rig's own law."""
    path = folder / "other_gains.toml"
    path.write_text('[control]\nlaw = "bowden"\n[control.gains]\nerror_gain = 3.0\n')
    with pytest.raises(ParameterError, match="gains of bowden, the law of the rig") as refused:
        Rig.read(path)
    assert "these are gains of adaptive" in str(refused.value)
    assert "delete [control.gains]" in str(refused.value)
    path.write_text('[control]\nlaw = "bowden"\n[control.gains]\nnone_has_this = 3.0\n')
    with pytest.raises(ParameterError, match="has no gain 'none_has_this'; expected one of"):
        Rig.read(path)
