"""A rig with several axes: merged from its file, checked, packed, written back; and one without them as it was."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control.reference import Chirp
from bowden.core.errors import ParameterError
from bowden.design.gains_text import with_axis_gains
from bowden.live.axis_columns import COMMON, of_all, view
from bowden.live.figures import Damage
from bowden.live.live_run import live_run
from bowden.live.log_facts import facts
from bowden.live.mcap_read import Recording
from bowden.live.row import CYCLE
from bowden.rig.axes import merged
from bowden.rig.rig import Axis, Rig
from bowden.safety.release import longest_release

LEG = """[servo]
damping = 0.9
[reference]
low_deg = 0.0
high_deg = 40.0
[control]
law = "adaptive"
[control.gains]
feedback_gain = 3.0
[[axis]]
name = "hip"
[axis.drive]
node_id = 1
[[axis]]
name = "knee"
[axis.drive]
node_id = 2
[axis.servo]
natural_frequency_hz = 12.0
[axis.encoder.joint]
noise_deg = 0.25
[axis.reference]
kind = "chirp"
amplitude_deg = 20.0
[axis.control]
law = "bowden"
[axis.limits]
motor_high_deg = 100.0
"""
PLAIN_HASH = "c5ae9fe92624a79c"
"""Of the default rig, which axes do not change."""


@pytest.fixture
def leg(tmp_path: Path) -> Rig:
    (tmp_path / "leg.toml").write_text(LEG)
    return Rig.read(tmp_path / "leg.toml")


def test_a_rig_with_one_motor_is_what_it_was() -> None:
    rig = Rig()
    assert rig.hash == PLAIN_HASH
    assert rig.axes == ()
    assert [one.name for one in rig.parts] == [""]
    assert rig.axis() is rig
    assert not {"axes", "independent"} & {*rig.document()}
    assert Rig.unpack(rig.pack()).remarks == ()
    columns = live_run(rig).columns()
    assert [*columns][: len(CYCLE)] == [*CYCLE]
    assert not {"others", "preflight_alone"} & {*columns}


def test_each_axis_is_a_whole_rig_with_what_is_its_own_in_place_of_what_is_common(leg: Rig) -> None:
    hip, knee = leg.axis("hip"), leg.axis("knee")
    assert [one.name for one in leg.axes] == ["hip", "knee"]
    assert hip.servo.damping == knee.servo.damping == 0.9
    assert knee.servo.natural_frequency == pytest.approx(2.0 * np.pi * 12.0)
    assert knee.joint_encoder.noise == pytest.approx(np.radians(0.25))
    assert knee.joint_encoder.resolution == hip.joint_encoder.resolution
    assert isinstance(knee.reference, Chirp)
    assert (hip.law, knee.law) == ("adaptive", "bowden")
    assert dict(hip.gains) == {"feedback_gain": 3.0}
    assert dict(knee.gains) == {}
    assert (hip.drive.node_id, knee.drive.node_id) == (1, 2)
    assert knee.limits.motor_high == pytest.approx(np.radians(100.0))


def test_a_rig_with_axes_is_the_same_packed_and_written_back(leg: Rig, tmp_path: Path) -> None:
    assert Rig.unpack(leg.pack()) == leg
    again = Rig.of_tree(tomllib.loads(leg.to_toml()), tmp_path / "again.toml")
    assert again.hash == leg.hash
    (tmp_path / "written").mkdir()
    leg.write(tmp_path / "written" / "rig.toml")
    assert Rig.read(tmp_path / "written" / "rig.toml").hash == leg.hash
    alone = leg.replace(independent=True)
    assert alone.hash != leg.hash
    assert Rig.of_tree(tomllib.loads(alone.to_toml()), tmp_path / "x.toml").hash == alone.hash
    other = leg.replace(axes=(leg.axes[0], Axis("knee", leg.axis("knee").with_gain("bandwidth", 5.0))))
    assert other.hash != leg.hash


def test_a_change_of_the_whole_is_one_of_each_axis(leg: Rig) -> None:
    changed = leg.replace(duration=7.0).with_law("uncompensated").on_bus("can3")
    assert {rig.duration for _, rig in changed.axes} == {7.0}
    assert {rig.law_name for _, rig in changed.axes} == {"uncompensated"}
    assert {rig.drive.channel for _, rig in changed.axes} == {"can3"}


def test_sections_of_another_kind_begin_anew() -> None:
    assert merged({"a": {"x": 1, "y": {"z": 2}}}, {"a": {"y": {"w": 3}}}) == {"a": {"x": 1, "y": {"z": 2, "w": 3}}}
    common = {"cable": {"slope": 0.9}, "scenario": {"bend": {"bend_deg": 9.0}}, "drive": {"channel": "can0"}}
    assert merged(common, {"cable": {"model": "m.toml"}})["cable"] == {"model": "m.toml"}
    random = {"scenario": {"bend": {"kind": "random"}}}
    assert merged(common, random)["scenario"]["bend"] == {"kind": "random"}
    assert merged(common, {"drive": {"node_id": 2}})["drive"] == {"channel": "can0", "node_id": 2}
    assert merged(common, {"scenario": {"bend": {"kind": "constant"}}})["scenario"]["bend"]["bend_deg"] == 9.0


TWO = '[[axis]]\nname = "hip"\n[axis.drive]\nnode_id = 1\n[[axis]]\nname = "knee"\n[axis.drive]\nnode_id = 2\n'
AK = '[motor]\ngear = 9.0\ntorque_constant_nm_per_a = 0.091\n[drive]\nfamily = "ak_mit"\n'
CIA402 = '[axis.motor]\ngear = 5.0\n[axis.drive]\nfamily = "cia402"\nnode_id = 2\n'
HIP, KNEE = TWO.split('[[axis]]\nname = "knee"\n')
MOTEUS = '[drive]\nfamily = "moteus"\n'
BAD = {
    r"drive.joint_node_id and drive.joint_node_id make the same frames \(0A0h\)": AK + TWO,
    r"drive.node_id and drive.reply_id make the same frames \(001h\)": f"{AK}{TWO}joint_node_id = 33\nreply_id = 1\n",
    r"drive.reply_id and drive.node_id make the same frames \(182h\)": (
        f'{AK}{HIP}reply_id = 0x182\n[[axis]]\nname = "knee"\n{CIA402}'
    ),
    r"drive.joint_node_id and drive.node_id make the same frames \(082h\)": (
        f'{AK}{HIP}joint_node_id = 2\n[[axis]]\nname = "knee"\n{CIA402}'
    ),
    r"drive.host_id and drive.node_id make the same frames \(702h\)": (
        f'{HIP}host_id = 2\n[[axis]]\nname = "knee"\n{CIA402}'
    ),
    r"drive.node_id and drive.host_id make the same frames \(100h\)": f"{MOTEUS}{TWO}host_id = 1\n",
    r"drive.node_id and drive.node_id make the same frames \(181h\)": (
        f'{HIP}[[axis]]\nname = "knee"\n[axis.motor]\ngear = 5.0\n[axis.drive]\nfamily = "odrive"\nnode_id = 12\n'
    ),
    r"load_cell.node_id and drive.node_id make the same frames": (
        f'[load_cell]\nsource = "cia404"\nfull_scale = 900.0\n{HIP}[axis.load_cell]\nnode_id = 2\n'
        '[[axis]]\nname = "knee"\n[axis.drive]\nnode_id = 2\n[axis.load_cell]\nnode_id = 34\n'
    ),
    "1000000 bit/s and 500000 bit/s: name another channel": f"{TWO}bitrate = 500000\n",
    "1000000 bit/s and 1000000 bit/s with CAN-FD": f'{TWO}family = "moteus"\n',
    "two axes have the name": TWO.replace("knee", "hip"),
    'axes "hip" and "knee" have one drive': TWO.replace("node_id = 2", "node_id = 1"),
    "bench.sample_time_ms of axis": f"{TWO}[axis.bench]\nsample_time_ms = 2.0\n",
    "scenario.duration_s of axis": f"{TWO}[axis.scenario]\nduration_s = 2.0\n",
    r"\[live\] of axis": f"{TWO}[axis.live]\ncpu = 1\n",
    "is there 5 times; expected 2 to 4": "".join(
        f'[[axis]]\nname = "a{i}"\n[axis.drive]\nnode_id = {i + 1}\n' for i in range(5)
    ),
    "is there once; expected 2 to 4": '[[axis]]\nname = "hip"\n',
    "without a name": "[[axis]]\n[axis.drive]\nnode_id = 1\n",
    "unknown section 'servos'": f"{TWO}[axis.servos]\nx = 1\n",
    r'axis "knee": .*unknown key \'x\' in \[servo\]': f"{TWO}[axis.servo]\nx = 1\n",
    "axis \"knee\": .*limits.motor_high_deg is 'x'": f'{TWO}[axis.limits]\nmotor_high_deg = "x"\n',
    "axis is no list of sections": "axis = 3\n",
    "axis is an empty list": "axis = []\n",
    "independent is 1; expected true or false": f"independent = 1\n{TWO}",
    r"independent is true in a rig without \[\[axis\]\]": "independent = true\n",
    r"\[pair\] stands in a rig without \[\[axis\]\]; .*; write them": '[pair]\nagonist = "hip"\nantagonist = "knee"\n',
    'an axis has the name "law"': TWO.replace("knee", "law"),
    'an axis has the name "pair"': TWO.replace("knee", "pair"),
    'an axis has the name "a.b"': TWO.replace("knee", "a.b"),
    'an axis has the name "event_"': TWO.replace("knee", "event_"),
    'an axis has the name "a__b"': TWO.replace("knee", "a__b"),
}


@pytest.mark.parametrize("said", BAD)
def test_axes_that_cannot_be_in_one_loop_are_refused_with_what_is_wrong(said: str, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(BAD[said])
    with pytest.raises(ParameterError, match=said):
        Rig.read(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    "text",
    [
        f"{AK}{TWO}joint_node_id = 33\n",
        f'{AK}{HIP}reply_id = 9\n[[axis]]\nname = "k"\n[axis.drive]\nnode_id = 2\njoint_node_id = 33\nreply_id = 9\n',
        f'{AK}{HIP}[[axis]]\nname = "knee"\n{CIA402}',
        MOTEUS + TWO,
        f'{TWO}channel = "other"\nbitrate = 500000\nhost_id = 1\n',
    ],
)
def test_drives_whose_frames_differ_share_a_bus(text: str, tmp_path: Path) -> None:
    (tmp_path / "leg.toml").write_text(text)
    assert len(Rig.read(tmp_path / "leg.toml").axes) == 2


def test_what_takes_one_axis_asks_for_its_name(leg: Rig) -> None:
    with pytest.raises(ParameterError, match="has the axes hip, knee; expected one of them"):
        leg.axis()
    with pytest.raises(ParameterError, match=r"has no axis 'kne'; expected knee \(did you mean this\?\) or hip"):
        leg.axis("kne")
    with pytest.raises(ParameterError, match="has no axis 'hip'; expected none"):
        Rig().axis("hip")
    with pytest.raises(ParameterError, match="--axis"):
        leg.with_gain("bandwidth", 2.0)
    with pytest.raises(ParameterError, match="expected pairs of a name and a rig"):
        Rig(axes=[1])  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="has axes of its own"):
        Rig(axes=(Axis("a", leg), Axis("b", Rig())))
    pairs: Any = [("a", leg.axis("hip")), ("b", leg.axis("knee"))]
    assert [one.name for one in Rig(axes=pairs).axes] == ["a", "b"]


@pytest.mark.parametrize(
    ("sections", "key"),
    [
        ('[emg]\nsource = "lsl:EMG"\n', "emg.source"),
        ("[suit]\nworn = true\n[admittance]\nenabled = true\n", "admittance"),
    ],
)
def test_what_moves_one_joint_only_is_refused_live_with_several_axes(sections: str, key: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(sections + TWO)
    with pytest.raises(ParameterError, match=f'axis "hip": {key}'):
        live_run(Rig.read(tmp_path / "rig.toml"))


def test_columns_of_an_axis_are_those_of_a_run_with_it_alone(leg: Rig) -> None:
    live = live_run(leg)
    columns = live.columns()
    whole = [*columns]
    for axis in live.axes:
        seen = view(whole, live.names, axis.name)
        own = live_run(axis.rig).columns()
        assert {*seen.columns} == {*own, "others", "preflight_alone"}
        assert all(
            columns[whole[i]] == {**own, "others": "1", "preflight_alone": "1"}[name]
            for i, name in zip(*seen, strict=True)
        )
    assert [*view(whole, live.names, "hip").columns][: len(CYCLE)] == [*CYCLE]
    assert len(whole) == len({*whole})
    blocks = {"a": {"time": "s", "x": "1"}, "b": {"time": "s", "x": "1"}}
    assert of_all(blocks) == {"time": "s", "x": "1", "b.x": "1"}
    assert {*CYCLE} > COMMON


def test_what_is_said_of_the_end_of_a_run_is_that_of_the_slowest_axis(leg: Rig) -> None:
    hip, knee = leg.axis("hip"), leg.axis("knee")
    quick = hip.replace(limits=hip.limits._replace(release_time=0.1))
    patient = knee.replace(limits=knee.limits._replace(operator_age=0.5))
    live = live_run(leg.replace(axes=(Axis("hip", quick), Axis("knee", patient))))
    assert live.patience == hip.limits.operator_age < 0.5
    late = hip.limits.operator_age + longest_release(knee.supervisor_limits) + hip.sample_time
    assert f"the power is off within {late:.2f} s" in live.losses()


def test_what_a_log_says_of_one_axis_has_its_columns_alone(leg: Rig) -> None:
    live = live_run(leg)
    columns = live.columns()
    texts = {"columns": json.dumps([*columns]), "units": json.dumps([*columns.values()])}
    about = texts | {"start_utc_ns": "0", "software": "bowden"}
    rows = np.zeros((2, len(columns)))
    parts = (np.arange(2), rows, [], Damage(0, 0, 0), live.log_settings())
    whole = Recording(about, None, (*columns,), (*columns.values(),), *parts)
    knee = whole.axis("knee")
    assert [*facts(knee)["columns"]] == [*knee.columns]
    assert facts(knee)["columns"]["joint"] == "rad"
    assert {*facts(whole)["columns"]} == {*columns}


def test_the_log_of_a_run_knows_the_settings_of_each_axis(leg: Rig) -> None:
    settings = live_run(leg).log_settings()
    assert [axis["law"] for axis in settings["axes"]] == ["adaptive", "bowden"] == [rig.law for _, rig in leg.axes]
    assert settings["rig"]["hash"] == leg.hash
    assert "rig" not in settings["axes"][0]


def test_gains_are_written_into_the_section_of_their_axis(tmp_path: Path) -> None:
    path = tmp_path / "leg.toml"
    text = with_axis_gains(LEG, "hip", {"feedback_gain": 5.0}, ["found"], path)
    path.write_text(text)
    rig = Rig.read(path)
    assert dict(rig.axis("hip").gains) == {"feedback_gain": 5.0}
    assert rig.axis("knee").hash == Rig.of_tree(tomllib.loads(LEG), path).axis("knee").hash
    text = with_axis_gains(text, "knee", {"bandwidth": 4.0}, ["found"], path)
    path.write_text(text)
    assert dict(Rig.read(path).axis("knee").gains) == {"bandwidth": 4.0}
    again = with_axis_gains(text, "knee", {"bandwidth": 6.0}, ["found again"], path)
    path.write_text(again)
    assert dict(Rig.read(path).axis("knee").gains) == {"bandwidth": 6.0}
    assert dict(Rig.read(path).axis("hip").gains) == {"feedback_gain": 5.0}
    assert again.count("# bowden tune: ") == 2
