"""Two motors on one joint at the desk: one simulation, one linear loop, one verdict, and what the commands say."""

import json
from contextlib import nullcontext
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
from bowden.design.linearise import linearise
from bowden.design.pair_check import check_pair
from bowden.design.pair_loops import BOTH, DOWN_ALONE, UP_ALONE, SideLoop, Taut, pair_margins, pair_poles, reaches
from bowden.design.pair_tune import PairTarget, best_gains, judged_gains
from bowden.design.tune import NoGainsError
from bowden.design.tune_runs import RUN, references_of
from bowden.models.cable.backlash import Play
from bowden.models.cable.shared_joint import Ends, JointLoad, shared_joint, shares
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.encoder import Encoder
from bowden.operations.schema import json_schema
from bowden.plants.bench import Bench
from bowden.plants.cables import as_cable_plant, play
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.sim.pair import PairPlant, PairSide, simulate_pair
from bowden.sim.parting import parting_of
from bowden.sim.run import simulate
from test_pair import PAIR

BENCH = default_bench()
LAW = LAWS["bowden"]
MOTION = PeriodicMinimumJerk(0.0, 60.0 * RADIANS, 8.0)
BENDS = ((np.pi, np.pi),) * 2
STROKE = (0.0, 60.0 * RADIANS)
LOAD = JointLoad(10.0, 0.1, 0.2)


def pair_of(one: Bench = BENCH, other: Bench = BENCH, contraction: float = 4.0, stiffness: float = 10.0) -> PairPlant:
    sides = [
        PairSide(name, bench, constant_bend(bench.sheath.bend), k, sign)
        for k, (name, bench, sign) in enumerate((("flexor", one, 1.0), ("extensor", other, -1.0)))
    ]
    return PairPlant(sides[0], sides[1], stiffness, contraction * RADIANS)


def quiet(bench: Bench) -> Bench:
    """Without noise, counts and load."""
    exact = Encoder(0.0, 0.0)
    motor = bench.motor._replace(pretension=0.0, spring=0.0)
    return bench._replace(joint_encoder=exact, motor_encoder=exact, motor=motor)


def test_the_joint_is_the_same_compiled() -> None:
    random = np.random.default_rng(1)
    kept = compiled(shared_joint)
    for _ in range(200):
        up, down, push = random.uniform(-1.0, 1.0, 3).tolist()
        whole = random.integers(0, 2, 2).astype(bool).tolist()
        ends = Ends(up, down, whole[0], whole[1])
        assert kept(ends, push, LOAD) == shared_joint(ends, push, LOAD)


@pytest.mark.parametrize(("up", "down", "taut"), [(0.5, 0.3, (True, True)), (0.5, 0.9, (True, False))])
def test_the_shares_are_the_slopes_of_the_balance(up: float, down: float, taut: tuple[bool, bool]) -> None:
    step = 1e-6
    base = shared_joint(Ends(up, down, True, True), 0.0, LOAD)
    slopes = [
        (shared_joint(Ends(up + a, down + b, True, True), 0.0, LOAD) - base) / step for a, b in ((step, 0), (0, step))
    ]
    assert slopes == pytest.approx(list(shares(LOAD, *taut)), abs=1e-6)


def test_two_like_cables_without_a_load_are_one_cable() -> None:
    bench = quiet(BENCH)
    both = simulate_pair(pair_of(bench, bench, 0.0), (LAW, LAW), MOTION, duration=4.0)
    alone = simulate(as_cable_plant(bench), LAW, MOTION, duration=4.0)
    for trace in both:
        for name in ("joint", "motor", "command"):
            assert np.allclose(trace[name], alone[name], atol=1e-9), name


def test_co_contraction_keeps_both_cables_taut_under_a_push() -> None:
    push = 0.5 * np.sin(2.0 * np.pi * 0.4 * np.arange(16_000) * 1e-3)
    slack, rms = {}, {}
    for degrees in (-4.0, 0.0, 4.0):
        traces = simulate_pair(pair_of(contraction=degrees), (LAW, LAW), MOTION, duration=16.0, push=push)
        slack[degrees] = [float((trace["pull"] <= 0.0).mean()) for trace in traces]
        rms[degrees] = np.degrees(np.sqrt(np.mean(traces[0].error ** 2)))
        balance = traces[0]["pull"] - traces[1]["pull"] + push - LOAD.pretension - LOAD.spring * traces[0]["joint"]
        free = (traces[0]["pull"] == 0.0) & (traces[1]["pull"] == 0.0)
        assert np.abs(balance[~free]).max() < 1e-9
    assert slack[4.0] == [0.0, 0.0]
    assert min(slack[0.0]) > 0.2
    assert rms[4.0] < rms[0.0] < rms[-4.0]
    assert rms == pytest.approx({-4.0: 0.95, 0.0: 0.21, 4.0: 0.16}, abs=0.02)


def test_the_agonist_may_be_the_one_that_pulls_down() -> None:
    one = pair_of()
    turned = one._replace(agonist=one.antagonist, antagonist=one.agonist)
    up, down = simulate_pair(one, (LAW, LAW), MOTION, duration=3.0)
    first, second = simulate_pair(turned, (LAW, LAW), MOTION, duration=3.0)
    assert np.sqrt(np.mean((first["joint"] - up["joint"]) ** 2)) < np.radians(0.1)  # the noise is another
    assert np.mean(first["pull"] - down["pull"]) == pytest.approx(0.0, abs=0.02)
    assert np.mean(second["pull"] - up["pull"]) == pytest.approx(0.0, abs=0.02)


def side(slope: float = 0.938, law: str = "bowden") -> SideLoop:
    model = linearise(Rig().with_law(law).fitted(), 1e-3, width=BENCH.joint_encoder.resolution)
    return SideLoop(BENCH.servo, BENCH.delay, slope, model)


@pytest.mark.parametrize("law", ["bowden", "adaptive", "cascaded_pid"])
def test_two_like_sides_have_the_margins_of_one_with_the_share_of_both(law: str) -> None:
    one = side(law=law)
    plant = servo_model(one.servo, 1e-3, one.delay, 1.0)
    for taut, share in ((BOTH, 20.0 / 20.2), (UP_ALONE, 10.0 / 10.2), (DOWN_ALONE, 10.0 / 10.2)):
        found = pair_margins(one, one, LOAD, taut, 1e-3).joint
        alone = margins(plant, one.law.seen_through(share * one.slope), 1e-3)
        for name in ("gain_margin_db", "phase_margin_deg", "delay_margin_s"):
            assert getattr(found, name) == pytest.approx(getattr(alone, name), rel=1e-4), (taut, name)
        assert found.largest_pole == pytest.approx(alone.largest_pole, rel=1e-5)


def test_the_poles_are_those_of_both_alike_and_of_both_against_each_other() -> None:
    one = side()
    poles, apart = pair_poles(one, one, reaches(one, one, LOAD, BOTH), 1e-3)
    plant = servo_model(one.servo, 1e-3, one.delay, 1.0)
    for mask, slope in ((~apart, 0.938 * 20.0 / 20.2), (apart, 0.0)):
        expected = closed_loop_poles(plant, one.law.seen_through(slope))
        assert np.max(np.abs(poles[mask])) == pytest.approx(np.max(np.abs(expected)), rel=1e-6)
    assert len(frequencies(1e-3)) == 4000


@pytest.mark.parametrize("taut", [BOTH, UP_ALONE, DOWN_ALONE])
def test_a_load_much_stiffer_than_the_cables_has_its_margins_too(taut: Taut) -> None:
    one, stiff = side(), JointLoad(0.02, 0.1, 1.0)
    found = pair_margins(one, one, stiff, taut, 1e-3).joint
    share = sum(shares(stiff, taut.up, taut.down))
    alone = margins(servo_model(one.servo, 1e-3, one.delay, 1.0), one.law.seen_through(share * one.slope), 1e-3)
    assert found.largest_pole == pytest.approx(alone.largest_pole, rel=1e-5)


def test_motors_that_should_go_different_ways_and_do_not_are_seen_to_part() -> None:
    one, other = (Rig(law="bowden", cable=BENCH.cable._replace(slope=slope)) for slope in (0.95, 0.65))
    laws = (Rig(law="bowden").fitted(),) * 2  # which take both cables for the bench's
    found = check_pair(pair_of(one.bench, other.bench), laws, bends=BENDS, stroke=STROKE)
    assert found.pair is not None
    asked = 0.5 * (60.0 / 0.65 - 60.0 / 0.95)  # of each further than the joint asks, where both go alike
    assert np.degrees(found.pair.drift) == pytest.approx(asked, abs=0.5)  # type: ignore[arg-type]
    pair = pair_of(one.bench, other.bench)
    up, down = simulate_pair(pair, laws, MOTION, duration=8.0)
    pulled = 0.5 * (up["pull"] / 0.95 + down["pull"] / 0.65) / pair.stiffness
    assert np.degrees(np.ptp(pulled)) == pytest.approx(asked, abs=2.0), "which their pulls show, but for their play"


def test_the_certificate_of_the_pages_pair() -> None:
    found = check_pair(pair_of(), (LAW, LAW), bends=BENDS, stroke=STROKE)
    assert found.verdict == "holds"
    assert found.pair is not None
    taut, *alone = found.pair.loops
    assert [one.at for one in found.pair.loops] == ["both cables taut", "flexor alone taut", "extensor alone taut"]
    assert found.gain_margin_db == taut.gain_margin_db
    assert all(one.gain_margin_db > taut.gain_margin_db for one in alone)  # type: ignore[operator]
    assert found.pair.apart > 1.0, "no law feeds back what the joint does not show"
    assert found.pair.drift < np.radians(1.0), "and it comes to nothing"  # type: ignore[operator]
    assert "both cables taut" in repr(found)


def test_cables_that_rest_elsewhere_at_zero_do_not_seem_to_part() -> None:
    """An identified cable has an offset, which its motor makes up for: nothing pulls any harder."""
    off = BENCH._replace(cable=BENCH.cable._replace(offset=10.0 * RADIANS))
    pair = pair_of(off, off)
    found = check_pair(pair, (LAW, LAW), bends=BENDS, stroke=STROKE)
    assert found.verdict == "holds"
    assert found.pair is not None
    assert np.degrees(found.pair.drift) < 0.2  # type: ignore[arg-type]
    resting = pair.resting_motors(0.0, (np.pi, np.pi))
    parting = parting_of(pair, BENDS, STROKE)
    assert parting.offset == pytest.approx(resting[0] - resting[1])
    assert abs(parting.offset) > 20.0 * RADIANS
    assert parting._replace(offset=0.0) == pytest.approx(parting_of(pair_of(), BENDS, STROKE))


def test_each_bend_of_one_sheath_is_tried_with_each_of_the_other() -> None:
    ends = (np.pi, 2.0 * np.pi)
    alike = [check_pair(pair_of(), (LAW, LAW), bends=((end, end),) * 2, stroke=STROKE) for end in ends]
    found = check_pair(pair_of(), (LAW, LAW), bends=(ends, ends), stroke=STROKE)
    assert len(found.trials) == 2 * len(ends) ** 2
    assert found.pair is not None
    apart = [np.degrees(one.pair.drift) for one in alike]  # type: ignore[union-attr, arg-type]
    assert max(apart) < 0.2
    assert np.degrees(found.pair.drift) > 5.0, "cables that differ most disagree most"  # type: ignore[arg-type]
    assert "extensor alone taut, the other sheath's 180°" in {point.at for point in found.points}
    assert found.gain_margin_db == pytest.approx(min(one.gain_margin_db for one in alike), abs=1e-6)  # type: ignore[type-var]


def test_gains_and_bends_that_cannot_be_are_refused_in_a_line() -> None:
    broken = replace(LAWS["adaptive"], gains=LAWS["adaptive"].gains._replace(error_gain=np.nan))
    for laws in ((broken, LAWS["adaptive"]), (LAWS["adaptive"], broken)):
        with pytest.raises(ParameterError, match="gain error_gain of law 'adaptive' is nan; expected a finite number"):
            check_pair(pair_of(), laws, bends=BENDS, stroke=STROKE)
    with pytest.raises(ParameterError, match="expected smallest and largest, above 0 rad"):
        check_pair(pair_of(), (LAW, LAW), bends=(BENDS[0], (2.0, 1.0)), stroke=STROKE)


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
    found = check_pair(pair_of(), (PARTING, PARTING), bends=BENDS, stroke=STROKE)
    assert found.verdict == "does_not_hold"
    assert found.pair is not None
    assert found.pair.apart > 1.0


def test_sides_of_different_equations_are_refused_in_a_line() -> None:
    with pytest.raises(ParameterError, match="have the laws bowden and adaptive; expected one law for both"):
        simulate_pair(pair_of(), (LAW, LAWS["adaptive"]), MOTION, duration=1.0)
    other: Any = as_cable_plant(BENCH)._replace(cable=play(Play(0.9, 0.05, 0.0)))
    with pytest.raises(ParameterError, match="of the kinds bouc_wen and play; expected one kind for both"):
        simulate_pair(pair_of(other=other), (LAW, LAW), MOTION, duration=1.0)
    with pytest.raises(ParameterError, match="push has the shape"):
        simulate_pair(pair_of(), (LAW, LAW), MOTION, duration=1.0, push=np.zeros(3))


@pytest.fixture
def pair_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("pair.toml").write_text('[control]\nlaw = "bowden"\n[scenario]\nduration_s = 8.0\n' + PAIR)
    return Path("pair.toml")


def said(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> Any:
    assert run([*words]) == code
    return capsys.readouterr()


def document(capsys: pytest.CaptureFixture[str], command: str, *words: str) -> Any:
    found = json.loads(said(capsys, command, "pair.toml", *words, "--json").out)
    jsonschema.validate(found, json_schema(command))
    return found


@pytest.mark.usefixtures("pair_rig")
def test_simulate_says_of_a_pair_what_both_motors_do(capsys: pytest.CaptureFixture[str]) -> None:
    out = said(capsys, "simulate", "pair.toml", "--law", "bowden", "--law", "cascaded_pid", "--csv").out
    assert out.startswith("pair flexor and extensor, co-contraction 4°\n")
    assert "cascaded_pid" in out
    assert "Next: bowden check pair.toml\n" in out
    folder = Path("out/simulate/pair")
    names = {f"{law}-{axis}.{kind}" for law in ("bowden", "cascaded_pid") for axis in ("flexor", "extensor")
             for kind in ("npz", "csv")}  # fmt: skip
    assert {one.name for one in folder.iterdir()} == names | {"simulate.html"}
    page = (folder / "simulate.html").read_text(encoding="utf-8")
    assert "What each cable pulls" in page
    assert "2 laws on two motors" in page
    found = document(capsys, "simulate")
    (only,) = found["runs"]
    assert [one["axis"] for one in only["motors"]] == ["flexor", "extensor"]
    assert [one["slack_share"] for one in only["motors"]] == [0.0, 0.0]
    assert 0.0 < only["rmse_deg"] < 0.3


@pytest.mark.usefixtures("pair_rig")
def test_check_says_of_a_pair_one_verdict_with_the_margins_by_what_is_taut(capsys: pytest.CaptureFixture[str]) -> None:
    out = said(capsys, "check", "pair.toml").out
    assert out.startswith("flexor and extensor on one joint\nverdict ")
    assert "both cables taut    7.57 dB, 88.2°, 22.4 ms\n" in out
    assert "flexor alone taut   7.67 dB, 88.4°, 22.8 ms\n" in out
    assert "Next: bowden run pair.toml --twin --auto" in out
    found = document(capsys, "check")
    assert found["holds"] is True
    assert found["axes"] == []
    assert found["pair"]["motors_apart_deg"] < 1.0
    assert found["pair"]["co_contraction_deg"] == pytest.approx(4.0)
    assert document(capsys, "check", "--axis", "flexor")["pair"] is None


@pytest.mark.usefixtures("pair_rig")
def test_an_axis_beside_the_pair_is_looked_at_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("pair.toml")
    path.write_text(path.read_text() + '[[axis]]\nname = "wrist"\n[axis.drive]\nnode_id = 3\n')
    found = document(capsys, "check")
    both = "flexor and extensor on one joint"
    assert [one["axis"] for one in found["axes"]] == ["wrist", both]
    assert found["axes"][1]["pair"]["axes"] == ["flexor", "extensor"]
    assert [one["axis"] for one in document(capsys, "simulate")["runs"]] == ["wrist", both]
    assert Path("out/simulate/wrist/simulate.html").exists()
    assert [*bowden.check(path)] == ["wrist", both]


@pytest.mark.usefixtures("pair_rig")
def test_a_pair_by_emg_ends_with_its_recording_unless_a_duration_is_asked_for() -> None:
    time = np.arange(3000) * 1e-3
    signal = 0.01 * np.where(time > 2.0, 20.0, 1.0) * np.random.default_rng(1).standard_normal(len(time))
    np.savetxt("emg.csv", np.column_stack([time, signal]), "%.5f", ",", header="time_s,biceps_mV", comments="")
    path = Path("pair.toml")
    path.write_text('[emg]\nsource = "file:emg.csv"\nhigh_deg = 60.0\n' + path.read_text())
    for duration, ends in ((None, 3.0), (4.0, 4.0)):
        traces: Any = bowden.simulate("pair.toml", duration=duration)
        assert traces["flexor"].time[-1] == pytest.approx(ends, abs=0.01)


@pytest.mark.usefixtures("pair_rig")
def test_simulate_of_a_pair_by_emg_names_no_check_that_would_refuse_it(capsys: pytest.CaptureFixture[str]) -> None:
    time = np.arange(3000) * 1e-3
    signal = 0.01 * np.where(time > 2.0, 20.0, 1.0) * np.random.default_rng(1).standard_normal(len(time))
    np.savetxt("emg.csv", np.column_stack([time, signal]), "%.5f", ",", header="time_s,biceps_mV", comments="")
    path = Path("pair.toml")
    path.write_text('[emg]\nsource = "file:emg.csv"\nhigh_deg = 60.0\n' + path.read_text())
    out = said(capsys, "simulate", "pair.toml").out
    refused = said(capsys, "check", "pair.toml", code=2).err
    assert "Next: bowden" not in out
    assert f"Next: nothing yet, neither check nor run take this rig: {refused.removeprefix('bowden: ')}" in out


@pytest.mark.usefixtures("pair_rig")
def test_a_pair_with_a_negative_slope_is_refused_by_each_command(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("pair.toml")
    path.write_text(path.read_text().replace('name = "flexor"\n', 'name = "flexor"\n[axis.cable]\nslope = -0.9\n'))
    refused = {said(capsys, *words, code=2).err for words in REFUSING}
    assert len(refused) == 1
    assert "an axis has a cable whose slope is negative; expected joint angles that grow" in refused.pop()


REFUSING = (["check", "pair.toml"], ["simulate", "pair.toml"], ["run", "pair.toml", "--twin", "--auto"])


@pytest.mark.usefixtures("pair_rig")
def test_check_refuses_of_a_pair_what_a_run_refuses_in_the_same_words(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("pair.toml")
    plain, source = path.read_text(), 'source = "lsl:biceps"\n'
    path.write_text("[emg]\n" + source + plain)
    checked = said(capsys, "check", "pair.toml", code=2).err
    assert checked == said(capsys, "run", "pair.toml", "--twin", "--auto", code=2).err
    assert checked.startswith('bowden: axis "flexor": emg.source is set in a rig with several axes')
    with pytest.raises(ParameterError, match=r"emg\.source is set in a rig with several axes"):
        bowden.check("pair.toml")
    path.write_text(plain.replace('name = "flexor"\n', 'name = "flexor"\n[axis.emg]\n' + source))
    error = said(capsys, "check", "pair.toml", code=2).err
    assert '"flexor" and "extensor" have [emg] of their own; expected one' in error
    assert error.count("\n") == 1


TARGET = PairTarget(pair_of(), BENDS, STROKE, 1)


def adaptive(gain: float) -> Law:
    return LAWS["adaptive"].with_gains(feedback_gain=gain)


def test_the_best_gains_of_a_pair_keep_their_margins_on_the_joint_and_follow_best_there() -> None:
    before = judged_gains(TARGET, (adaptive(20.0), adaptive(20.0)))
    candidates = [{"feedback_gain": gain} for gain in (200.0, 60.0, 40.0)]
    best = best_gains(TARGET, before, candidates)
    assert [law.numbers["feedback_gain"] for law in best.laws] == [60.0, 60.0], "200 follows, and has 22° alone"
    assert best.found.pair is not None
    assert best.found.phase_margin_deg == pytest.approx(54.2, abs=0.1)
    assert best.worst < 0.5 * before.worst
    again = simulate_pair(
        TARGET.pair,
        best.laws,
        references_of(STROKE)[0],
        duration=RUN,
        initial_motors=TARGET.pair.resting_motors(0.0, (np.pi, np.pi)),
    )
    assert np.sqrt(np.mean(again[0].error ** 2)) <= best.worst
    assert best_gains(TARGET, best, candidates[2:]) is best, "what is better already stays"
    broken = judged_gains(TARGET, (adaptive(200.0), adaptive(200.0)))
    with pytest.raises(NoGainsError, match="do not keep them on the joint of both"):
        best_gains(TARGET, broken, candidates[:1])


@pytest.mark.parametrize("unlike", [False, True])
@pytest.mark.usefixtures("pair_rig")
def test_tune_writes_the_same_gains_for_both_motors_and_says_what_they_are_worth_on_the_joint(
    unlike: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path("pair.toml")
    text = path.read_text().replace('"bowden"', '"adaptive"')
    if unlike:
        text = text.replace('name = "extensor"\n', 'name = "extensor"\n[axis.servo]\nnatural_frequency_hz = 9.0\n')
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
    out = said(capsys, "tune", "pair.toml").out
    assert "largest RMSE over 3 runs of 20 s of both motors" in out
    assert "Next: bowden run pair.toml --twin --auto" in out
    again = Rig.read(path)
    for name in ("flexor", "extensor"):
        assert dict(again.axis(name).gains) == found["gains"]
    assert document(capsys, "check")["phase_margin_deg"] == pytest.approx(found["phase_margin_deg"])
    error = said(capsys, "tune", "pair.toml", "--study", "study.toml", code=2).err
    assert "the plants of a study have one; expected a rig with one motor, or no study; name one with --axis" in error


@pytest.mark.usefixtures("pair_rig")
def test_python_tunes_a_pair(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bowden.study.tune_law.two_workers", lambda law, plant: nullcontext(map))
    found = bowden.tune("pair.toml", "adaptive", generations=1)
    assert found.gains
    assert found.found.pair is not None
    assert found.worst_rmse < found.worst_before  # type: ignore[operator]
    for name in ("flexor", "extensor"):
        assert dict(found.rig.axis(name).gains) == dict(found.gains)


@pytest.mark.usefixtures("pair_rig")
def test_python_checks_and_simulates_a_pair() -> None:
    found = bowden.check("pair.toml")
    assert found.holds
    assert found.pair is not None
    traces: Any = bowden.simulate("pair.toml", duration=4.0)
    assert list(traces) == ["flexor", "extensor"]
    assert (traces["flexor"]["joint"] == traces["extensor"]["joint"]).all()
    both: Any = bowden.simulate("pair.toml", ["bowden", "adaptive"], duration=4.0)
    assert list(both) == ["bowden-flexor", "bowden-extensor", "adaptive-flexor", "adaptive-extensor"]
    with pytest.raises(ParameterError, match="fails the check on"):
        bowden.simulate("pair.toml", PARTING, duration=4.0)
