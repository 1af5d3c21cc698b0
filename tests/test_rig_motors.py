"""A rig with several motors: merged from its file, checked, packed, written back; and one without them as it was."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control.reference import Chirp
from bowden.core.errors import ParameterError
from bowden.live.figures import Damage
from bowden.live.live_run import live_run
from bowden.live.log_facts import facts
from bowden.live.mcap_read import Recording
from bowden.live.row import CYCLE
from bowden.live.together import COMMON, of_all, view
from bowden.rig.motors import merged
from bowden.rig.rig import Rig, RigMotor
from bowden.safety.release import longest_release
from bowden.views.tune import with_motor_gains

LEG = """[servo]
damping = 0.9
[reference]
low_deg = 0.0
high_deg = 40.0
[control]
law = "adaptive"
[control.gains]
feedback_gain = 3.0
[[motor]]
name = "hip"
[motor.drive]
node_id = 1
[[motor]]
name = "knee"
[motor.drive]
node_id = 2
[motor.servo]
natural_frequency_hz = 12.0
[motor.encoder.joint]
noise_deg = 0.25
[motor.reference]
kind = "chirp"
amplitude_deg = 20.0
end_hz = 5.0
[motor.control]
law = "bowden"
[motor.limits]
motor_high_deg = 100.0
"""
PLAIN_HASH = "c5ae9fe92624a79c"
"""Of the default rig, which motors do not change."""


@pytest.fixture
def leg(tmp_path: Path) -> Rig:
    (tmp_path / "leg.toml").write_text(LEG)
    return Rig.read(tmp_path / "leg.toml")


def test_a_rig_with_one_motor_is_what_it_was() -> None:
    rig = Rig()
    assert rig.hash == PLAIN_HASH
    assert rig.motors == ()
    assert [one.name for one in rig.parts] == [""]
    assert rig.only() is rig
    assert "motors" not in rig.document()
    assert Rig.unpack(rig.pack()).remarks == ()
    columns = live_run(rig).columns()
    assert [*columns][: len(CYCLE)] == [*CYCLE]
    assert not {"others", "preflight_alone"} & {*columns}


def test_each_motor_is_a_whole_rig_with_what_is_its_own_in_place_of_what_is_common(leg: Rig) -> None:
    hip, knee = leg.only("hip"), leg.only("knee")
    assert [one.name for one in leg.motors] == ["hip", "knee"]
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


def test_a_rig_with_motors_is_the_same_packed_and_written_back(leg: Rig, tmp_path: Path) -> None:
    assert Rig.unpack(leg.pack()) == leg
    again = Rig.of_tree(tomllib.loads(leg.to_toml()), tmp_path / "again.toml")
    assert again.hash == leg.hash
    (tmp_path / "written").mkdir()
    leg.write(tmp_path / "written" / "rig.toml")
    assert Rig.read(tmp_path / "written" / "rig.toml").hash == leg.hash
    alone = leg.replace(independent=True)
    assert alone.hash != leg.hash
    assert Rig.of_tree(tomllib.loads(alone.to_toml()), tmp_path / "x.toml").hash == alone.hash
    other = leg.replace(motors=(leg.motors[0], RigMotor("knee", leg.only("knee").with_gain("bandwidth", 5.0))))
    assert other.hash != leg.hash


def test_a_change_of_the_whole_is_one_of_each_motor(leg: Rig) -> None:
    changed = leg.replace(duration=7.0).with_law("uncompensated").on_bus("can3")
    assert {rig.duration for _, rig, _ in changed.motors} == {7.0}
    assert {rig.law_name for _, rig, _ in changed.motors} == {"uncompensated"}
    assert {rig.drive.channel for _, rig, _ in changed.motors} == {"can3"}


def test_sections_of_another_kind_begin_anew() -> None:
    assert merged({"a": {"x": 1, "y": {"z": 2}}}, {"a": {"y": {"w": 3}}}) == {"a": {"x": 1, "y": {"z": 2, "w": 3}}}
    common = {"cable": {"slope": 0.9}, "scenario": {"bend": {"bend_deg": 9.0}}, "drive": {"channel": "can0"}}
    assert merged(common, {"cable": {"model": "m.toml"}})["cable"] == {"model": "m.toml"}
    random = {"scenario": {"bend": {"kind": "random"}}}
    assert merged(common, random)["scenario"]["bend"] == {"kind": "random"}
    assert merged(common, {"drive": {"node_id": 2}})["drive"] == {"channel": "can0", "node_id": 2}
    assert merged(common, {"scenario": {"bend": {"kind": "constant"}}})["scenario"]["bend"]["bend_deg"] == 9.0


TWO = '[[motor]]\nname = "hip"\n[motor.drive]\nnode_id = 1\n[[motor]]\nname = "knee"\n[motor.drive]\nnode_id = 2\n'
AK = '[drive]\nfamily = "ak_mit"\n'
OF_AK = "gear = 9.0\ntorque_constant_nm_per_a = 0.091\n"
CIA402 = 'gear = 5.0\n[motor.drive]\nfamily = "cia402"\nnode_id = 2\n'
TWO_AK = TWO.replace("[motor.drive]", OF_AK + "[motor.drive]", 1)
HIP_AK = TWO_AK.partition('[[motor]]\nname = "knee"\n')[0]
HIP, KNEE = TWO.split('[[motor]]\nname = "knee"\n')
MOTEUS = '[drive]\nfamily = "moteus"\n'
BAD = {
    r"drive.joint_node_id and drive.joint_node_id make the same frames \(0A0h\)": AK + TWO_AK,
    r"drive.node_id and drive.reply_id make the same frames \(001h\)": (
        f"{AK}{TWO_AK}joint_node_id = 33\nreply_id = 1\n"
    ),
    r"drive.reply_id and drive.node_id make the same frames \(182h\)": (
        f'{AK}{HIP_AK}reply_id = 0x182\n[[motor]]\nname = "knee"\n{CIA402}'
    ),
    r"drive.joint_node_id and drive.node_id make the same frames \(082h\)": (
        f'{AK}{HIP_AK}joint_node_id = 2\n[[motor]]\nname = "knee"\n{CIA402}'
    ),
    r"drive.host_id and drive.node_id make the same frames \(702h\)": (
        f'{HIP}host_id = 2\n[[motor]]\nname = "knee"\n{CIA402}'
    ),
    r"drive.node_id and drive.host_id make the same frames \(100h\)": f"{MOTEUS}{TWO}host_id = 1\n",
    r"drive.node_id and drive.node_id make the same frames \(181h\)": (
        f'{HIP}[[motor]]\nname = "knee"\ngear = 5.0\n[motor.drive]\nfamily = "odrive"\nnode_id = 12\n'
    ),
    r"load_cell.node_id and drive.node_id make the same frames": (
        f'[load_cell]\nsource = "cia404"\nfull_scale = 900.0\n{HIP}[motor.load_cell]\nnode_id = 2\n'
        '[[motor]]\nname = "knee"\n[motor.drive]\nnode_id = 2\n[motor.load_cell]\nnode_id = 34\n'
    ),
    "1000000 bit/s and 500000 bit/s: name another channel": f"{TWO}bitrate = 500000\n",
    "1000000 bit/s and 1000000 bit/s with CAN-FD": f'{TWO}family = "moteus"\n',
    "two motors have the name": TWO.replace("knee", "hip"),
    'motors "hip" and "knee" have one drive': TWO.replace("node_id = 2", "node_id = 1"),
    "bench.sample_time_ms of motor": f"{TWO}[motor.bench]\nsample_time_ms = 2.0\n",
    "scenario.duration_s of motor": f"{TWO}[motor.scenario]\nduration_s = 2.0\n",
    r"\[live\] of motor": f"{TWO}[motor.live]\ncpu = 1\n",
    "is there 5 times; expected 2 to 4": "".join(
        f'[[motor]]\nname = "a{i}"\n[motor.drive]\nnode_id = {i + 1}\n' for i in range(5)
    ),
    "is there once; expected 2 to 4": '[[motor]]\nname = "hip"\n',
    r"writes .*motor.* a second time; .*the keys of \[motor\] stand below": f"[motor]\ngear = 9.0\n{TWO}",
    "without a name": "[[motor]]\n[motor.drive]\nnode_id = 1\n",
    "unknown section 'servos'": f"{TWO}[motor.servos]\nx = 1\n",
    r'motor "knee": .*unknown key \'x\' in \[servo\]': f"{TWO}[motor.servo]\nx = 1\n",
    "motor \"knee\": .*limits.motor_high_deg is 'x'": f'{TWO}[motor.limits]\nmotor_high_deg = "x"\n',
    "motor is 3": "motor = 3\n",
    "motor is no list of sections": "motor = []\n",
    "independent is 1; expected true or false": f"independent = 1\n{TWO}",
    "independent is true in a rig with one motor": "independent = true\n",
    r"\[\[joint\]\] stands in a rig with one motor; .*; write them": '[joint]\nname = "knee"\n',
    'a motor has the name "law"': TWO.replace("knee", "law"),
    'a motor has the name "a.b"': TWO.replace("knee", "a.b"),
    'a motor has the name "event_"': TWO.replace("knee", "event_"),
    'a motor has the name "a__b"': TWO.replace("knee", "a__b"),
}


@pytest.mark.parametrize("said", BAD)
def test_motors_that_cannot_be_in_one_loop_are_refused_with_what_is_wrong(said: str, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(BAD[said])
    with pytest.raises(ParameterError, match=said):
        Rig.read(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    "text",
    [
        f"{AK}{TWO_AK}joint_node_id = 33\n",
        f'{AK}{HIP_AK}reply_id = 9\n[[motor]]\nname = "k"\n[motor.drive]\nnode_id = 2\njoint_node_id = 33\nreply_id = 9'
        "\n",
        f'{AK}{HIP_AK}[[motor]]\nname = "knee"\n{CIA402}',
        MOTEUS + TWO,
        f'{TWO}channel = "other"\nbitrate = 500000\nhost_id = 1\n',
    ],
)
def test_drives_whose_frames_differ_share_a_bus(text: str, tmp_path: Path) -> None:
    (tmp_path / "leg.toml").write_text(text)
    assert len(Rig.read(tmp_path / "leg.toml").motors) == 2


def test_what_takes_one_motor_asks_for_its_name(leg: Rig) -> None:
    with pytest.raises(ParameterError, match="has the motors hip, knee; expected one of them"):
        leg.only()
    with pytest.raises(ParameterError, match=r"has no motor 'kne'; expected knee \(did you mean this\?\) or hip"):
        leg.only("kne")
    with pytest.raises(ParameterError, match="has no motor 'hip'; expected none"):
        Rig().only("hip")
    with pytest.raises(ParameterError, match="--motor"):
        leg.with_gain("bandwidth", 2.0)
    with pytest.raises(ParameterError, match="expected a name and a rig for each motor"):
        Rig(motors=[1])  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="has motors of its own"):
        Rig(motors=(RigMotor("a", leg), RigMotor("b", Rig())))
    pairs: Any = [("a", leg.only("hip")), ("b", leg.only("knee"))]
    assert [one.name for one in Rig(motors=pairs).motors] == ["a", "b"]


@pytest.mark.parametrize(
    ("sections", "key"),
    [
        ('[emg]\nsource = "lsl:EMG"\n', "emg.source"),
        ("[suit]\nworn = true\n[admittance]\nenabled = true\n", "admittance"),
    ],
)
def test_what_moves_one_joint_only_is_refused_live_with_several_motors(sections: str, key: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(sections + TWO)
    with pytest.raises(ParameterError, match=f'motor "hip": {key}'):
        live_run(Rig.read(tmp_path / "rig.toml"))


def test_columns_of_an_motor_are_those_of_a_run_with_it_alone(leg: Rig) -> None:
    live = live_run(leg)
    columns = live.columns()
    whole = [*columns]
    for motor in live.motors:
        seen = view(whole, live.names, motor.name)
        own = live_run(motor.rig).columns()
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


def test_what_is_said_of_the_end_of_a_run_is_that_of_the_slowest_motor(leg: Rig) -> None:
    hip, knee = leg.only("hip"), leg.only("knee")
    quick = hip.replace(limits=hip.limits._replace(release_time=0.1))
    patient = knee.replace(limits=knee.limits._replace(operator_age=0.5))
    live = live_run(leg.replace(motors=(RigMotor("hip", quick), RigMotor("knee", patient))))
    assert live.patience == hip.limits.operator_age < 0.5
    late = hip.limits.operator_age + longest_release(knee.supervisor_limits) + hip.sample_time
    assert f"the power is off within {late:.2f} s" in live.losses()


def test_what_a_log_says_of_one_motor_has_its_columns_alone(leg: Rig) -> None:
    live = live_run(leg)
    columns = live.columns()
    texts = {"columns": json.dumps([*columns]), "units": json.dumps([*columns.values()])}
    about = texts | {"start_utc_ns": "0", "software": "bowden"}
    rows = np.zeros((2, len(columns)))
    parts = (np.arange(2), rows, [], Damage(0, 0, 0), live.log_settings())
    whole = Recording(about, None, (*columns,), (*columns.values(),), *parts)
    knee = whole.only("knee")
    assert [*facts(knee).columns] == [*knee.columns]
    assert facts(knee).columns["joint"] == "rad"
    assert {*facts(whole).columns} == {*columns}


def test_the_log_of_a_run_knows_the_settings_of_each_motor(leg: Rig) -> None:
    settings = live_run(leg).log_settings()
    assert (
        [motor["law"] for motor in settings["motors"]] == ["adaptive", "bowden"] == [one.rig.law for one in leg.motors]
    )
    assert settings["rig"]["hash"] == leg.hash
    assert "rig" not in settings["motors"][0]


def test_gains_are_written_into_the_section_of_their_motor(tmp_path: Path) -> None:
    path = tmp_path / "leg.toml"
    text = with_motor_gains(LEG, "hip", {"feedback_gain": 5.0}, ["found"], path)
    path.write_text(text)
    rig = Rig.read(path)
    assert dict(rig.only("hip").gains) == {"feedback_gain": 5.0}
    assert rig.only("knee").hash == Rig.of_tree(tomllib.loads(LEG), path).only("knee").hash
    text = with_motor_gains(text, "knee", {"bandwidth": 4.0}, ["found"], path)
    path.write_text(text)
    assert dict(Rig.read(path).only("knee").gains) == {"bandwidth": 4.0}
    again = with_motor_gains(text, "knee", {"bandwidth": 6.0}, ["found again"], path)
    path.write_text(again)
    assert dict(Rig.read(path).only("knee").gains) == {"bandwidth": 6.0}
    assert dict(Rig.read(path).only("hip").gains) == {"feedback_gain": 5.0}
    assert again.count("# bowden tune: ") == 2
