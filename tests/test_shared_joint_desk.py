"""Several motors on one joint at the desk: one simulation, one linear loop, one verdict, and what the commands say."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import jsonschema
import numpy as np
import pytest

import bowden
from bowden.app.main import run
from bowden.control import LAWS, Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.control.stability import closed_loop_poles, frequencies, margins, servo_model
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, kernel
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS
from bowden.design.joint_check import MotorLoop, cases, check_joint, joint_margins, joint_poles, reaches
from bowden.design.joint_tune import JointTarget, best_gains, judged_gains
from bowden.design.linearise import linearise
from bowden.design.tune import NoGainsError
from bowden.design.tune_runs import RUN, references_of
from bowden.models.cable.backlash import Play
from bowden.models.cable.shared_joint import JointLoad, shared_joint, shares
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.encoder import Encoder
from bowden.operations.schema import json_schema
from bowden.plants.bench import Bench
from bowden.plants.cables import play
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.sim.joint import CabledJoint, JointMotor, simulate_joint
from bowden.sim.parting import parting_of
from bowden.sim.run import simulate
from test_shared_joint import BICEPS, ELBOW

BENCH = default_bench()
LAW = LAWS["bowden"]
MOTION = PeriodicMinimumJerk(0.0, 60.0 * RADIANS, 8.0)
BENDS = ((np.pi, np.pi),) * 2
STROKE = (0.0, 60.0 * RADIANS)
LOAD = JointLoad(10.0, 0.1, 0.2)


def joint_of(*benches: Bench, contraction: float = 4.0, signs: tuple[float, ...] = (1.0, -1.0)) -> CabledJoint:
    each = zip(("flexor", "extensor", "biceps"), benches or (BENCH,) * len(signs), signs, strict=False)
    motors = [
        JointMotor(name, own, constant_bend(own.sheath.bend), k, sign) for k, (name, own, sign) in enumerate(each)
    ]
    return CabledJoint(tuple(motors), 10.0, contraction * RADIANS)


def quiet(bench: Bench) -> Bench:
    """Without noise, counts and load."""
    exact = Encoder(0.0, 0.0)
    motor = bench.motor._replace(pretension=0.0, spring=0.0)
    return bench._replace(joint_encoder=exact, motor_encoder=exact, motor=motor)


def test_the_joint_stands_where_the_torques_balance_interpreted_and_compiled() -> None:
    random, kept = np.random.default_rng(1), compiled(shared_joint)
    for _ in range(200):
        signs = random.choice([-1.0, 1.0], random.integers(1, 5))
        ends = np.where(random.random(len(signs)) < 0.2, -signs * np.inf, random.uniform(-1.0, 1.0, len(signs)))
        push = float(random.uniform(-1.0, 1.0))
        joint = shared_joint(ends, signs, push, LOAD)
        assert kept(ends, signs, push, LOAD) == joint
        pulls = signs * 10.0 * np.maximum(0.0, signs * (ends - joint))  # a torn cable pulls nothing
        assert pulls.sum() + push == pytest.approx(0.1 + 0.2 * joint, abs=1e-9)


def test_a_joint_that_nothing_holds_rests_between_slack_cables() -> None:
    free = JointLoad(10.0, 0.0, 0.0)
    for ends, rest in (((-0.5, 0.5), 0.0), ((0.1, 0.5), 0.1), ((-0.5, -0.1), -0.1), ((-np.inf, np.inf), 0.0)):
        assert shared_joint(np.array(ends), np.array([1.0, -1.0]), 0.0, free) == rest


@pytest.mark.parametrize(
    ("ends", "taut"),
    [((0.5, 0.3), (True, True)), ((0.5, 0.9), (True, False)), ((0.5, 0.3, 0.45), (True, True, True))],
)
def test_the_shares_are_the_slopes_of_the_balance(ends: tuple[float, ...], taut: tuple[bool, ...]) -> None:
    step, signs, given = 1e-6, np.array([1.0, -1.0, 1.0])[: len(ends)], np.array(ends)
    base = shared_joint(given, signs, 0.0, LOAD)
    slopes = [(shared_joint(given + step * one, signs, 0.0, LOAD) - base) / step for one in np.eye(len(ends))]
    assert slopes == pytest.approx(list(shares(LOAD, taut)), abs=1e-6)


def test_two_like_cables_without_a_load_are_one_cable() -> None:
    bench = quiet(BENCH)
    both = simulate_joint(joint_of(bench, bench, contraction=0.0), (LAW, LAW), MOTION, duration=4.0)
    alone = simulate(bench, LAW, MOTION, duration=4.0)
    for trace in both:
        for name in ("joint", "motor", "command"):
            assert np.allclose(trace[name], alone[name], atol=1e-9), name


def test_co_contraction_keeps_both_cables_taut_under_a_push() -> None:
    push = 0.5 * np.sin(2.0 * np.pi * 0.4 * np.arange(16_000) * 1e-3)
    slack, rms = {}, {}
    for degrees in (-4.0, 0.0, 4.0):
        traces = simulate_joint(joint_of(contraction=degrees), (LAW, LAW), MOTION, duration=16.0, push=push)
        slack[degrees] = [float((trace["pull"] <= 0.0).mean()) for trace in traces]
        rms[degrees] = np.degrees(np.sqrt(np.mean(traces[0].error ** 2)))
        balance = traces[0]["pull"] - traces[1]["pull"] + push - LOAD.pretension - LOAD.spring * traces[0]["joint"]
        free = (traces[0]["pull"] == 0.0) & (traces[1]["pull"] == 0.0)
        assert np.abs(balance[~free]).max() < 1e-9
    assert slack[4.0] == [0.0, 0.0]
    assert min(slack[0.0]) > 0.2
    assert rms[4.0] < rms[0.0] < rms[-4.0]


def test_the_encoder_may_be_that_of_the_motor_that_pulls_down() -> None:
    up, down = simulate_joint(joint_of(), (LAW, LAW), MOTION, duration=3.0)
    first, second = simulate_joint(joint_of(signs=(-1.0, 1.0)), (LAW, LAW), MOTION, duration=3.0)
    assert np.sqrt(np.mean((first["joint"] - up["joint"]) ** 2)) < np.radians(0.1)  # the noise is another
    assert np.mean(first["pull"] - down["pull"]) == pytest.approx(0.0, abs=0.02)
    assert np.mean(second["pull"] - up["pull"]) == pytest.approx(0.0, abs=0.02)


def test_two_of_three_motors_share_what_one_of_two_pulls() -> None:
    signs = (1.0, -1.0, 1.0)
    flexor, extensor, biceps = simulate_joint(joint_of(signs=signs), (LAW,) * 3, MOTION, duration=6.0)
    total = flexor["pull"] + biceps["pull"] - extensor["pull"]
    assert np.abs(total - LOAD.pretension - LOAD.spring * flexor["joint"]).max() < 1e-9
    assert np.mean(flexor["pull"]) == pytest.approx(np.mean(biceps["pull"]), rel=0.05)
    found = check_joint(joint_of(signs=signs), (LAW,) * 3, bends=BENDS[:1] * 3, stroke=STROKE)
    assert found.verdict == "holds"
    assert found.shared is not None
    assert len(found.shared.loops) == 4


def side(slope: float = 0.938, law: str = "bowden") -> MotorLoop:
    model = linearise(Rig().with_law(law).fitted(), 1e-3, width=BENCH.joint_encoder.resolution)
    return MotorLoop(BENCH.servo, BENCH.delay, slope, model)


@pytest.mark.parametrize("load", [LOAD, JointLoad(0.02, 0.1, 1.0)])
@pytest.mark.parametrize("law", ["bowden", "adaptive", "cascaded_pid"])
def test_like_motors_have_the_margins_of_one_with_the_share_of_all(law: str, load: JointLoad) -> None:
    one = side(law=law)
    plant = servo_model(one.servo, 1e-3, one.delay, 1.0)
    for taut in (*cases(2), *cases(3)):
        found = joint_margins((one,) * len(taut), load, taut, 1e-3).joint
        alone = margins(plant, one.law.seen_through(sum(shares(load, taut)) * one.slope), 1e-3)
        if load is LOAD:
            for name in ("gain_margin_db", "phase_margin_deg", "delay_margin_s"):
                assert getattr(found, name) == pytest.approx(getattr(alone, name), rel=1e-4), (taut, name)
        assert found.largest_pole == pytest.approx(alone.largest_pole, rel=1e-5)


def test_the_poles_are_those_of_both_alike_and_of_both_against_each_other() -> None:
    one = side()
    poles, apart = joint_poles((one, one), reaches((one, one), LOAD, (True, True)), 1e-3)
    plant = servo_model(one.servo, 1e-3, one.delay, 1.0)
    for mask, slope in ((~apart, 0.938 * 20.0 / 20.2), (apart, 0.0)):
        expected = closed_loop_poles(plant, one.law.seen_through(slope))
        assert np.max(np.abs(poles[mask])) == pytest.approx(np.max(np.abs(expected)), rel=1e-6)
    assert len(frequencies(1e-3)) == 4000


def test_motors_that_should_go_different_ways_and_do_not_are_seen_to_part() -> None:
    one, other = (Rig(law="bowden", cable=BENCH.cable._replace(slope=slope)) for slope in (0.95, 0.65))
    laws = (Rig(law="bowden").fitted(),) * 2  # which take both cables for the bench's
    found = check_joint(joint_of(one.bench, other.bench), laws, bends=BENDS, stroke=STROKE)
    assert found.shared is not None
    asked = 0.5 * (60.0 / 0.65 - 60.0 / 0.95)  # of each further than the joint asks, where both go alike
    assert np.degrees(found.shared.drift) == pytest.approx(asked, abs=0.5)  # type: ignore[arg-type]
    joint = joint_of(one.bench, other.bench)
    up, down = simulate_joint(joint, laws, MOTION, duration=8.0)
    pulled = 0.5 * (up["pull"] / 0.95 + down["pull"] / 0.65) / joint.stiffness
    assert np.degrees(np.ptp(pulled)) == pytest.approx(asked, abs=2.0), "which their pulls show, but for their play"


def test_the_certificate_of_the_pages_joint() -> None:
    found = check_joint(joint_of(), (LAW, LAW), bends=BENDS, stroke=STROKE)
    assert found.verdict == "holds"
    assert found.shared is not None
    taut, *alone = found.shared.loops
    assert [one.at for one in found.shared.loops] == ["all cables taut", "flexor alone taut", "extensor alone taut"]
    assert found.gain_margin_db == taut.gain_margin_db
    assert all(one.gain_margin_db > taut.gain_margin_db for one in alone)  # type: ignore[operator]
    assert found.shared.apart == pytest.approx(1.0, abs=5e-3), "but for its own motor's shortfall no law feeds it back"
    assert found.shared.drift < np.radians(1.0), "and it comes to nothing"  # type: ignore[operator]
    assert "all cables taut" in repr(found)


def test_cables_that_rest_elsewhere_at_zero_do_not_seem_to_part() -> None:
    """An identified cable has an offset, which its motor makes up for: nothing pulls any harder."""
    off = BENCH._replace(cable=BENCH.cable._replace(offset=10.0 * RADIANS))
    joint = joint_of(off, off)
    found = check_joint(joint, (LAW, LAW), bends=BENDS, stroke=STROKE)
    assert found.verdict == "holds"
    assert found.shared is not None
    assert np.degrees(found.shared.drift) < 0.2  # type: ignore[arg-type]
    resting = joint.resting_motors(0.0, (np.pi, np.pi))
    parting = parting_of(joint, BENDS, STROKE)
    assert parting.offset == pytest.approx(resting[0] - resting[1])
    assert abs(parting.offset) > 20.0 * RADIANS
    assert parting._replace(offset=0.0) == pytest.approx(parting_of(joint_of(), BENDS, STROKE))


def test_each_bend_of_one_sheath_is_tried_with_each_of_the_other() -> None:
    ends = (np.pi, 2.0 * np.pi)
    alike = [check_joint(joint_of(), (LAW, LAW), bends=((end, end),) * 2, stroke=STROKE) for end in ends]
    found = check_joint(joint_of(), (LAW, LAW), bends=(ends, ends), stroke=STROKE)
    assert len(found.trials) == 2 * len(ends) ** 2
    assert found.shared is not None
    apart = [np.degrees(one.shared.drift) for one in alike]  # type: ignore[union-attr, arg-type]
    assert max(apart) < 0.2
    assert np.degrees(found.shared.drift) > 5.0, "cables that differ most disagree most"  # type: ignore[arg-type]
    assert "extensor alone taut, with other bends of 180°" in {point.at for point in found.points}
    assert found.gain_margin_db == pytest.approx(min(one.gain_margin_db for one in alike), abs=1e-6)  # type: ignore[type-var]


def test_gains_and_bends_that_cannot_be_are_refused_in_a_line() -> None:
    broken = replace(LAWS["adaptive"], gains=LAWS["adaptive"].gains._replace(error_gain=np.nan))
    for laws in ((broken, LAWS["adaptive"]), (LAWS["adaptive"], broken)):
        with pytest.raises(ParameterError, match="gain error_gain of law 'adaptive' is nan; expected a finite number"):
            check_joint(joint_of(), laws, bends=BENDS, stroke=STROKE)
    with pytest.raises(ParameterError, match="expected smallest and largest, above 0 rad"):
        check_joint(joint_of(), (LAW, LAW), bends=(BENDS[0], (2.0, 1.0)), stroke=STROKE)


class Free(NamedTuple):
    """Gains of a law that lets its motor go where it goes."""

    motor: float = 1.01
    joint: float = 1.5


class Nothing(NamedTuple):
    """Its state."""

    unused: float = 0.0


@kernel
def free_start(gains: Free, sample: Sample) -> Nothing:
    """Nothing to remember."""
    return Nothing(0.0)


@kernel
def free_step(gains: Free, state: Nothing, sample: Sample, reference: Reference, dt: float) -> tuple[Nothing, float]:
    """The motor's own angle, and on top the joint's error."""
    return state, gains.motor * sample.motor - gains.joint * (sample.joint - reference.position)


PARTING = Law("parting", Free(), free_start, free_step, "a test")


def test_laws_that_hold_alone_and_part_on_one_joint_do_not_hold() -> None:
    from bowden.design.check import check

    assert check(BENCH, PARTING, stroke=STROKE).holds
    found = check_joint(joint_of(), (PARTING, PARTING), bends=BENDS, stroke=STROKE)
    assert found.verdict == "does_not_hold"
    assert found.shared is not None
    assert found.shared.apart > 1.0


def test_sides_of_different_equations_are_refused_in_a_line() -> None:
    with pytest.raises(ParameterError, match="have the laws bowden and adaptive; expected one law for all"):
        simulate_joint(joint_of(), (LAW, LAWS["adaptive"]), MOTION, duration=1.0)
    other: Any = BENCH._replace(cable=play(Play(0.9, 0.05, 0.0)))
    with pytest.raises(ParameterError, match="of the kinds bouc_wen and play; expected one kind for all"):
        simulate_joint(joint_of(BENCH, other), (LAW, LAW), MOTION, duration=1.0)
    with pytest.raises(ParameterError, match="push has the shape"):
        simulate_joint(joint_of(), (LAW, LAW), MOTION, duration=1.0, push=np.zeros(3))


@pytest.fixture
def elbow_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("elbow.toml").write_text('[control]\nlaw = "bowden"\n[scenario]\nduration_s = 8.0\n' + ELBOW)
    return Path("elbow.toml")


def said(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> Any:
    assert run([*words]) == code
    return capsys.readouterr()


def document(capsys: pytest.CaptureFixture[str], command: str, *words: str) -> Any:
    found = json.loads(said(capsys, command, "elbow.toml", *words, "--json").out)
    jsonschema.validate(found, json_schema(command))
    return found


@pytest.mark.usefixtures("elbow_rig")
def test_simulate_says_of_a_joint_what_both_motors_do(capsys: pytest.CaptureFixture[str]) -> None:
    out = said(capsys, "simulate", "elbow.toml", "--law", "bowden", "--law", "cascaded_pid", "--csv").out
    assert out.startswith("joint elbow: flexor and extensor, co-contraction 4°\n")
    assert "cascaded_pid" in out
    assert "Next: bowden check elbow.toml\n" in out
    folder = Path("out/simulate/elbow")
    names = {f"{law}-{motor}.{kind}" for law in ("bowden", "cascaded_pid") for motor in ("flexor", "extensor")
             for kind in ("npz", "csv")}  # fmt: skip
    assert {one.name for one in folder.iterdir()} == names | {"simulate.html"}
    page = (folder / "simulate.html").read_text(encoding="utf-8")
    assert "What each cable pulls" in page
    assert "2 laws on 2 motors" in page
    found = document(capsys, "simulate")
    (only,) = found["runs"]
    assert [one["motor"] for one in only["motors"]] == ["flexor", "extensor"]
    assert [one["slack_share"] for one in only["motors"]] == [0.0, 0.0]
    assert 0.0 < only["rmse_deg"] < 0.3


@pytest.mark.usefixtures("elbow_rig")
def test_check_says_of_a_joint_one_verdict_with_the_margins_by_what_is_taut(capsys: pytest.CaptureFixture[str]) -> None:
    out = said(capsys, "check", "elbow.toml").out
    assert out.startswith("joint elbow\nverdict ")
    both, alone = (
        [float(one) for one in re.findall(rf"^{at} taut +(.*) dB, (.*)°, (.*) ms$", out, re.MULTILINE)[0]]
        for at in ("all cables", "flexor alone")
    )
    assert all(least < most for least, most in zip(both, alone, strict=True)), "two motors are one stiffer loop"
    assert both[0] > 6.0
    assert "Next: bowden run elbow.toml --twin --auto" in out
    found = document(capsys, "check")
    assert found["holds"] is True
    assert found["joints"] == []
    assert found["shared"]["motors_apart_deg"] < 1.0
    assert found["shared"]["co_contraction_deg"] == pytest.approx(4.0)
    assert document(capsys, "check", "--motor", "flexor")["shared"] is None


@pytest.mark.usefixtures("elbow_rig")
def test_a_motor_of_another_joint_is_looked_at_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("elbow.toml")
    path.write_text(path.read_text() + '[[motor]]\nname = "wrist"\n[motor.drive]\nnode_id = 3\n')
    found = document(capsys, "check")
    assert [one["joint"] for one in found["joints"]] == ["elbow", "wrist"]
    assert found["joints"][0]["shared"]["motors"] == ["flexor", "extensor"]
    assert [one["joint"] for one in document(capsys, "simulate")["runs"]] == ["elbow", "wrist"]
    assert Path("out/simulate/wrist/simulate.html").exists()
    assert [*bowden.check(path)] == ["elbow", "wrist"]


@pytest.mark.usefixtures("elbow_rig")
def test_a_third_motor_on_the_joint_is_checked_simulated_and_written_like_two(
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = Path("elbow.toml")
    path.write_text(path.read_text() + BICEPS)
    found = document(capsys, "check")
    assert (found["holds"], found["joints"]) == (True, [])
    assert found["shared"]["motors"] == ["flexor", "extensor", "biceps"]
    (only,) = document(capsys, "simulate")["runs"]
    assert [one["slack_share"] for one in only["motors"]] == [0.0, 0.0, 0.0]
    page = Path("out/simulate/elbow/simulate.html").read_text(encoding="utf-8")
    assert "One law on 3 motors" in page


@pytest.mark.usefixtures("elbow_rig")
def test_a_shared_joint_by_emg_ends_with_its_recording_and_names_no_check_that_would_refuse_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    time = np.arange(3000) * 1e-3
    signal = 0.01 * np.where(time > 2.0, 20.0, 1.0) * np.random.default_rng(1).standard_normal(len(time))
    np.savetxt("emg.csv", np.column_stack([time, signal]), "%.5f", ",", header="time_s,biceps_mV", comments="")
    path = Path("elbow.toml")
    path.write_text('[emg]\nsource = "file:emg.csv"\nhigh_deg = 60.0\n' + path.read_text())
    for duration, ends in ((None, 3.0), (4.0, 4.0)):  # unless a duration is asked for
        traces: Any = bowden.simulate("elbow.toml", duration=duration)
        assert traces["flexor"].time[-1] == pytest.approx(ends, abs=0.01)
    out = said(capsys, "simulate", "elbow.toml").out
    refused = said(capsys, "check", "elbow.toml", code=2).err
    assert "Next: bowden" not in out
    assert f"Next: nothing yet, neither check nor run take this rig: {refused.removeprefix('bowden: ')}" in out


@pytest.mark.usefixtures("elbow_rig")
def test_a_shared_joint_with_a_negative_slope_is_refused_by_each_command(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("elbow.toml")
    path.write_text(path.read_text().replace("node_id = 1\n", "node_id = 1\n[motor.cable]\nslope = -0.9\n"))
    refused = {said(capsys, *words, code=2).err for words in REFUSING}
    assert len(refused) == 1
    assert "a motor has a cable whose slope is negative; expected joint angles that grow" in refused.pop()


REFUSING = (["check", "elbow.toml"], ["simulate", "elbow.toml"], ["run", "elbow.toml", "--twin", "--auto"])


@pytest.mark.usefixtures("elbow_rig")
def test_check_refuses_of_a_joint_what_a_run_refuses_in_the_same_words(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("elbow.toml")
    plain, source = path.read_text(), 'source = "lsl:biceps"\n'
    path.write_text("[emg]\n" + source + plain)
    checked = said(capsys, "check", "elbow.toml", code=2).err
    assert checked == said(capsys, "run", "elbow.toml", "--twin", "--auto", code=2).err
    assert checked.startswith('bowden: motor "flexor": emg.source is set in a rig with several motors')
    with pytest.raises(ParameterError, match=r"emg\.source is set in a rig with several motors"):
        bowden.check("elbow.toml")
    path.write_text(plain.replace("node_id = 1\n", "node_id = 1\n[motor.emg]\n" + source))
    error = said(capsys, "check", "elbow.toml", code=2).err
    assert '"flexor" and "extensor" have [emg] of their own; expected one' in error
    assert error.count("\n") == 1


@pytest.mark.usefixtures("elbow_rig")
def test_a_run_judges_the_joint_and_not_each_motor(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def judged(joint: Any, laws: Any) -> Any:
        asked.append((joint.names, len(laws)))
        return SimpleNamespace(holds=False, reason="its motors part", verdict="does_not_hold")

    monkeypatch.setattr("bowden.design.verdict.check_laws", judged)
    error = said(capsys, "run", "elbow.toml", "--twin", "--auto", code=2).err
    assert asked == [(("flexor", "extensor"), 2)]
    assert 'joint "elbow": bowden fails the check on elbow.toml: its motors part; check each alone (--motor' in error


TARGET = JointTarget(joint_of(), BENDS, STROKE, 1)


def adaptive(gain: float) -> Law:
    return LAWS["adaptive"].with_gains(feedback_gain=gain)


def test_the_best_gains_of_a_joint_keep_their_margins_on_the_joint_and_follow_best_there() -> None:
    before = judged_gains(TARGET, (adaptive(20.0), adaptive(20.0)))
    candidates = [{"feedback_gain": gain} for gain in (200.0, 60.0, 40.0)]
    best = best_gains(TARGET, before, candidates)
    assert [law.numbers["feedback_gain"] for law in best.laws] == [60.0, 60.0], "200 follows, and has 22° alone"
    assert best.found.shared is not None
    assert best.found.phase_margin_deg == pytest.approx(54.2, abs=0.1)
    assert best.worst < 0.5 * before.worst
    again = simulate_joint(
        TARGET.joint,
        best.laws,
        references_of(STROKE)[0],
        duration=RUN,
        initial_motors=TARGET.joint.resting_motors(0.0, (np.pi, np.pi)),
    )
    assert np.sqrt(np.mean(again[0].error ** 2)) <= best.worst
    assert best_gains(TARGET, best, candidates[2:]) is best, "what is better already stays"
    broken = judged_gains(TARGET, (adaptive(200.0), adaptive(200.0)))
    with pytest.raises(NoGainsError, match="do not keep them on the joint of all"):
        best_gains(TARGET, broken, candidates[:1])


@pytest.mark.parametrize("unlike", [pytest.param(False, marks=pytest.mark.long), True])
@pytest.mark.usefixtures("elbow_rig")
def test_tune_writes_the_same_gains_for_both_motors_and_says_what_they_are_worth_on_the_joint(
    unlike: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path("elbow.toml")
    text = path.read_text().replace('"bowden"', '"adaptive"')
    if unlike:
        text = text.replace("node_id = 2\n", "node_id = 2\n[motor.servo]\nnatural_frequency_hz = 9.0\n")
    path.write_text(text)
    asked = []

    def one(rig: Rig, **more: Any) -> Any:
        asked.append(rig.servo.natural_frequency)
        return SimpleNamespace(law=rig.fitted().with_gains(feedback_gain=60.0), generations=3)

    monkeypatch.setattr("bowden.study.tune_law.tuned", one)
    found = document(capsys, "tune", "--dry-run")
    assert len(asked) == (2 if unlike else 1), "one search where both motors are the same"
    assert found["gains"]["feedback_gain"] == 60.0
    assert (set(found["gains"]) == {"feedback_gain"}) is not unlike, "what each had of its own servo becomes one"
    assert found["before"]["feedback_gain"] == 40.0
    assert found["files"] == []
    assert found["worst_rmse_deg"] < found["worst_rmse_before_deg"]
    out = said(capsys, "tune", "elbow.toml").out
    assert "largest RMSE over 3 runs of 20 s of 2 motors" in out
    assert "Next: bowden check elbow.toml" in out
    again = Rig.read(path)
    for name in ("flexor", "extensor"):
        assert dict(again.only(name).gains) == found["gains"]
    assert document(capsys, "check")["phase_margin_deg"] == pytest.approx(found["phase_margin_deg"])
    error = said(capsys, "tune", "elbow.toml", "--study", "study.toml", code=2).err
    assert "the plants of a study have one; expected a rig with one motor, or no study; name one with --motor" in error


@pytest.mark.usefixtures("elbow_rig", "small_search")
def test_python_tunes_a_joint() -> None:
    found = bowden.tune("elbow.toml", "adaptive", generations=1)
    assert found.gains
    assert found.found.shared is not None
    assert found.worst_rmse < found.worst_before  # type: ignore[operator]
    for name in ("flexor", "extensor"):
        assert dict(found.rig.only(name).gains) == dict(found.gains)


@pytest.mark.usefixtures("elbow_rig")
def test_python_simulates_several_laws_on_a_joint() -> None:
    both: Any = bowden.simulate("elbow.toml", ["bowden", "adaptive"], duration=4.0)
    assert list(both) == ["bowden-flexor", "bowden-extensor", "adaptive-flexor", "adaptive-extensor"]
    with pytest.raises(ParameterError, match="fails the check on"):
        bowden.simulate("elbow.toml", PARTING, duration=4.0)
