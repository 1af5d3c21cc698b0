"""Several motors on one joint: the rig, the joint's statics, and a run in one loop in which neither goes on alone."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS, Law
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.signals import DriveState, Reference, Sample
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Filters, TargetSource
from bowden.hardware.drives.scale import motor_scale
from bowden.hardware.twin.bench import SharedJoint, TwinBench
from bowden.hardware.twin.of_rig import mirrored, played
from bowden.live.live_run import live_run, with_co_contraction
from bowden.live.preflight import Preflight, contradictions
from bowden.live.replay import replay
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.safety.state import Mode
from motors_rig import MotorsRig
from support.joint_runs import mirrors, shared_run

ELBOW = """
[[joint]]
name = "elbow"
co_contraction_deg = 4.0
[[motor]]
name = "flexor"
joint = "elbow"
[motor.drive]
node_id = 1
[[motor]]
name = "extensor"
joint = "elbow"
[motor.drive]
node_id = 2
[motor.limits]
slack_sign = 1.0
"""
BICEPS = """[[motor]]
name = "biceps"
joint = "elbow"
[motor.drive]
node_id = 3
"""
C = 4.0 * RADIANS
LAW = LAWS["bowden"]


def rig_of(tmp_path: Path, text: str = ELBOW) -> Rig:
    path = tmp_path / "elbow.toml"
    path.write_text(text)
    return Rig.read(path)


def test_a_shared_joint_is_read_packed_written_and_part_of_the_hash(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    (joint,) = rig.each_joint
    assert joint.names == ("flexor", "extensor")
    assert joint.settings.co_contraction == pytest.approx(C)
    assert Rig.unpack(rig.pack()).joints == rig.joints
    assert Rig.unpack(rig.pack()).hash == rig.hash
    again = tmp_path / "again.toml"
    again.write_text(rig.to_toml())
    assert Rig.read(again).hash == rig.hash == rig_of(tmp_path, ELBOW.replace("[[joint]]", "[joint]")).hash
    for old, new in (("4.0", "5.0"), ("elbow", "knee")):
        assert rig.hash != rig_of(tmp_path, ELBOW.replace(old, new)).hash
    assert rig.replace(duration=3.0).joints == rig.joints
    assert not Rig().document()["fields"]["joints"]
    assert [one.shared for one in Rig().each_joint] == [False]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('joint = "elbow"', 'joint = "elbwo"', 'names the joint "elbwo"; expected elbow'),
        ("slack_sign = 1.0", "slack_sign = -1.0", "where one pulls, the other lets out"),
        ("co_contraction_deg = 4.0", "co_contraction_deg = 60.0", "joint.co_contraction_deg is 60"),
        ("co_contraction_deg = 4.0", "co_contraction_deg = 20.0", "0.8 of limits.play_deg at most"),
        ("co_contraction_deg", "contraction_deg", "unknown key 'contraction_deg'"),
        ("slack_sign = 1.0", "slack_sign = 1.0\n[motor.reference]\nhigh_deg = 20.0", "references of their own"),
        ("[[joint]]", "independent = true\n[[joint]]", "none goes on alone"),
        ("node_id = 2", "node_id = 2\n[motor.suit]\nworn = true", "a suit is worn"),
        ('name = "elbow"', "", 'a joint has the name ""; expected small letters'),
        ("elbow", "flexor", 'a joint and a motor have the name "flexor"'),
        ('name = "elbow"', 'name = "my elbow"', 'a joint has the name "my elbow"'),
        ("[[joint]]", '[[joint]]\nname = "elbow"\n[[joint]]', "two joints have one name"),
        ("[[joint]]", '[[joint]]\nname = "knee"\n[[joint]]', 'no motor moves the joint "knee"'),
    ],
)
def test_a_joint_that_cannot_be_is_refused_in_one_line(old: str, new: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError) as refused:
        rig_of(tmp_path, ELBOW.replace(old, new, 1))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_each_motor_pulls_further_by_the_co_contraction_in_its_own_direction(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    for name, way in (("flexor", 1.0), ("extensor", -1.0)):
        own = rig.only(name)
        plain, shifted = motor_scale(own.drive_parameters), motor_scale(with_co_contraction(own, C).drive_parameters)
        assert plain.angle(shifted.counts(0.5)) == pytest.approx(0.5 + way * C)
        turned = motor_scale(mirrored(own.drive_parameters))
        assert turned.angle(plain.counts(0.7)) == pytest.approx(-0.7)


def test_a_live_run_has_one_encoder_and_two_directions(tmp_path: Path) -> None:
    live = live_run(rig_of(tmp_path))
    assert (live.encoders, live.neighbours) == ((0, 0), (1, 0))
    flexor, extensor = live.motors
    assert (flexor.opposed, extensor.opposed) == (False, True)
    assert (flexor.limits.homed, extensor.limits.homed) == (1.0, 0.0)
    assert (flexor.limits.slope_low, extensor.limits.slope_low) == (0.7, 0.0)
    checks = [motor.script()._checks for motor in live.motors]
    assert [one.pull_sign for one in checks] == [1.0, 1.0]
    assert [one.load_sign for one in checks] == [1.0, -1.0]
    assert contradictions(extensor.limits, 1e-3)
    assert not contradictions(extensor.limits, 1e-3, opposed=True)
    assert any("on one joint" in note for note in live.notes)


def cable(alone: float, torn: bool = False) -> Any:
    return SimpleNamespace(
        alone=alone, torn=torn, bench=SimpleNamespace(motor=SimpleNamespace(pretension=0.1, spring=0.2))
    )


@pytest.mark.parametrize("signs", [(1.0, -1.0), (-1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, -1.0, -1.0)])
def test_the_joint_is_where_all_torques_on_it_are_in_balance(signs: tuple[float, ...]) -> None:
    random = np.random.default_rng(3)
    for _ in range(100):
        ends = [sign * float(alone) for sign, alone in zip(signs, random.uniform(-1.0, 1.0, len(signs)), strict=True)]
        benches = [cable(end, bool(random.random() < 0.2)) for end in ends]
        joint = SharedJoint(benches, signs, 10.0)
        angles = {sign * joint.joint(one) for sign, one in zip(signs, benches, strict=True)}
        assert len(angles) == 1, "each sees it in its own coordinate"
        pulls = [joint.pull(one) for one in benches]
        assert min(pulls) >= 0.0, "a cable only pulls"
        left = sum(sign * pull for sign, pull in zip(signs, pulls, strict=True)) - 0.1 - 0.2 * angles.pop()
        assert left == pytest.approx(0.0, abs=1e-9)


def run_of(tmp_path: Path, contraction: float = C, **more: Any) -> MotorsRig:
    benches = []
    for k in range(2):
        plain = default_bench()
        benches.append(TwinBench(plain, constant_bend(plain.sheath.bend), 1.0, k, 0.0, 1.0))
    SharedJoint(benches, (1.0, -1.0), 10.0)
    drives = mirrors(benches, contraction)
    plain_limits = Limits()
    each = (plain_limits, plain_limits._replace(slack_sign=1.0, homed=0.0, slope_low=0.0))
    checks = (Preflight(), Preflight(light=math.inf))
    return MotorsRig(
        tmp_path, LAW, ("flexor", "extensor"), benches=drives, encoders=(0, 0), each=each, preflights=checks, **more
    )


def test_both_motors_take_one_joint_along_its_reference_and_the_run_replays_to_the_bit(tmp_path: Path) -> None:
    ended, rows = run_of(tmp_path, seconds=4.0).run()
    assert Mode(ended.mode) == Mode.STOPPED
    assert ended.faults == 0
    for name, part in rows.parts.items():
        led = part["source"] >= TargetSource.LAW_BEGINS
        assert np.sqrt(np.mean((part["joint"] - part["reference"])[led] ** 2)) < np.radians(2.0), name
        limits = Limits() if name == "flexor" else Limits(slack_sign=1.0, homed=0.0, slope_low=0.0)
        assert not replay(part, LAW, limits, Filters(), 1e-3, same=True).deviates, name
    flexor, extensor = (rows.parts[name] for name in ("flexor", "extensor"))
    assert (flexor["joint"] == extensor["joint"]).all(), "there is one encoder"
    led = flexor["source"] >= TargetSource.LAW_BEGINS
    assert flexor["tension"][led].min() > 0.0
    assert extensor["tension"][led].min() > 0.0, "neither cable is slack"


@pytest.mark.parametrize(("lost", "left"), [("flexor", "extensor"), ("extensor", "flexor")])
def test_a_motor_that_loses_its_torque_takes_the_others_off(lost: str, left: str, tmp_path: Path) -> None:
    rig = run_of(tmp_path)
    place = rig.names.index(lost)
    off = float(DriveState.SWITCH_ON_DISABLED)
    rig.drives[place].misread = lambda cycle, told: told._replace(drive_state=off) if cycle >= 2500 else told
    _, rows = rig.run()
    first, other = rows.parts[lost], rows.parts[left]
    at = int(np.flatnonzero(first["mode"] == Mode.LATCHED)[0])
    assert Fault.DRIVE_DROPPED in of(first["faults"][at])
    assert other["power"][at + 1] == 0.0, "one cycle later"
    assert Fault.OTHER_OFF in of(other["faults"][at + 1])


def test_a_torn_agonist_ends_the_run_and_a_torn_antagonist_is_unseen_while_the_load_holds_the_joint(
    tmp_path: Path,
) -> None:
    for place, seen in ((0, True), (1, False)):
        folder = tmp_path / str(place)
        folder.mkdir()

        def tear(rig: MotorsRig, place: int = place) -> None:
            rig.drives[place]._drive._drive._bench.torn = rig.sleeps > 3500

        ended, _ = run_of(folder, seconds=4.0, between=tear).run()
        assert (ended.faults != 0) is seen


def test_the_twin_is_one_joint_between_its_drives(tmp_path: Path) -> None:
    (joint,) = rig_of(tmp_path, ELBOW.replace("4.0", "0.0")).each_joint
    (flexor_drive, flexor), (extensor_drive, extensor) = played(joint, 0.0)
    assert motor_scale(flexor_drive).angle(1000.0) == pytest.approx(-motor_scale(extensor_drive).angle(1000.0))
    assert flexor.joint == pytest.approx(-extensor.joint)
    for plant, way in ((flexor, 1.0), (extensor, -1.0)):
        plant.doing, plant.command = 1, way * 0.5 + C
    for k in range(400):
        flexor.advance(1e-3 * k)
        extensor.advance(1e-3 * k)
    assert flexor.tension > 3.0
    assert extensor.tension > 3.0
    assert 0.2 < flexor.joint < 0.6


def test_three_motors_take_one_joint_along_its_reference(tmp_path: Path) -> None:
    rig = rig_of(tmp_path, ELBOW + BICEPS).replace(duration=4.0)
    live = live_run(rig)
    assert (live.encoders, live.neighbours) == ((0, 0, 0), (1, 2, 0))
    assert [motor.opposed for motor in live.motors] == [False, True, False]
    ended, rows = shared_run(tmp_path, rig).run()
    assert (Mode(ended.mode), ended.faults) == (Mode.STOPPED, 0)
    for name, motor in zip(("flexor", "extensor", "biceps"), live.motors, strict=True):
        part = rows.parts[name]
        led = part["source"] >= TargetSource.LAW_BEGINS
        assert np.sqrt(np.mean((part["joint"] - part["reference"])[led] ** 2)) < np.radians(2.0), name
        assert part["tension"][led].min() > 0.0, "no cable is slack"
        assert not replay(part, motor.law, motor.limits, Filters(), 1e-3, same=True).deviates, name


class Drift(NamedTuple):
    """Gains of a law that follows, and whose motor goes further and further."""

    slope: float = 0.9
    rate: float = 0.0
    """[rad/s]"""


class Since(NamedTuple):
    """Its state."""

    time: float
    """Since it began [s]."""


@kernel
def drift_start(gains: Drift, sample: Sample) -> Since:
    """Just now."""
    return Since(0.0)


@kernel
def drift_step(gains: Drift, state: Since, sample: Sample, reference: Reference, dt: float) -> tuple[Since, float]:
    """Where the cable's slope asks the motor to be, and the drift; nothing is fed back."""
    return Since(state.time + dt), reference.position / gains.slope + gains.rate * state.time


def drifting(rate: float) -> Law:
    return Law("drifting", Drift(rate=rate), drift_start, drift_step, "a test")


@pytest.mark.parametrize("rate", [20.0, -20.0])
def test_motors_that_part_are_released_before_their_cables_bear_much_more(rate: float, tmp_path: Path) -> None:
    rig = rig_of(tmp_path).replace(duration=4.0)
    found = live_run(rig)
    bound = found.motors[0].limits.parting
    assert bound == found.motors[1].limits.parting == pytest.approx(7.67 * RADIANS, abs=0.01 * RADIANS)
    each = drifting(rate * RADIANS), drifting(-rate * RADIANS)
    ended, rows = shared_run(tmp_path, rig, laws=each).run()
    assert Mode(ended.mode) == Mode.LATCHED
    for name, (law, live) in zip(("flexor", "extensor"), zip(each, found.motors, strict=True), strict=True):
        part = rows.parts[name]
        at = int(np.flatnonzero(part["mode"] == Mode.RELEASING)[0])
        assert of(part["faults"][at]) == [Fault.MOTORS_APART]
        apart = 0.5 * np.abs(part["motor"] - part["neighbour"])
        over = int(np.flatnonzero((apart > bound) & (part["supervisor.neighbour.met"] > 0.0))[0])
        assert at - over == pytest.approx(51, abs=2), "slack_time later"
        assert apart[at] < bound + 1.5 * RADIANS
        assert not replay(part, law, live.limits, Filters(), 1e-3, same=True).deviates, name


def test_each_supervisor_knows_where_both_cables_rest(tmp_path: Path) -> None:
    text = ELBOW.replace("node_id = 1\n", "node_id = 1\n[motor.cable]\noffset_deg = 6.0\n")
    one, other = (motor.limits for motor in live_run(rig_of(tmp_path, text)).motors)
    assert one.parting_offset == -other.parting_offset == pytest.approx(-6.0 * RADIANS / 0.9378, abs=1e-3)
    assert one.parting == other.parting == pytest.approx(7.67 * RADIANS, abs=0.01 * RADIANS)


def test_motors_that_hang_apart_before_a_run_come_together_unblamed(tmp_path: Path) -> None:
    rig = rig_of(tmp_path).replace(duration=2.0)

    def left(run: MotorsRig) -> None:
        """As a release leaves it: the antagonist's motor far out, with its cable slack."""
        if run.sleeps == 0:
            bench = run.drives[1]._drive._drive._bench
            bench._motion = bench._motion._replace(position=-1.4)

    run = shared_run(tmp_path, rig, between=left)
    run.arms = (100,)  # once what moved it has been forgotten
    ended, rows = run.run()
    part = rows.parts["flexor"]
    apart = np.degrees(0.5 * np.abs(part["motor"] - part["neighbour"]))
    assert apart[:300].max() > 30.0
    assert (Mode(ended.mode), ended.faults) == (Mode.STOPPED, 0)
    assert part["supervisor.neighbour.met"].max() == 1.0
