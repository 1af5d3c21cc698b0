"""The check of a worn suit: trials of the whole suit decide, margins are those of spool and arm in their springs."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import bowden
from bowden.app import main
from bowden.control import LAWS
from bowden.control.stability import StateSpace, adaptive_model, margins
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.design.check import check
from bowden.design.linear_plant import linear_plant
from bowden.design.linearise import linearise
from bowden.design.trial import run_trial
from bowden.design.tune import NoGainsError
from bowden.models.cable.sheath import slope_factor
from bowden.operations.schema import json_schema
from bowden.plants.presets.bench import default_bench
from bowden.plants.presets.suit import suit
from bowden.plants.push_settings import AdmittanceSettings
from bowden.plants.suit_linear import linear_suit
from bowden.plants.suit_parts import Suit
from bowden.plants.suit_settings import SuitSettings, WearerSettings
from bowden.plants.transmission import unrest
from bowden.rig.rig import Rig
from bowden.sim import ranges
from bowden.sim.suit_runs import DRIVE_INTEGRAL, suit_adaptive, suit_ours

STROKE = (0.0, 70.0 * RADIANS)
BEND = float(np.pi)
RIG = """
[suit]
worn = true
drive_integral_per_s = 40.0
[control]
law = "bowden"
[scenario]
duration_s = 2.0
"""


def integral() -> Suit:
    return suit()._replace(motor=suit().motor._replace(integral=DRIVE_INTEGRAL))


def test_margins_of_a_suit_are_those_of_the_linear_suit_worked_out_by_hand() -> None:
    worn, law, dt = integral(), suit_adaptive(), 1e-3
    frozen = {"slope_inverse": 0.9, "bound": 0.3}
    found = linear_plant(worn, (BEND,), STROKE)
    model = linearise(law, dt, width=worn.joint_encoder.resolution, estimates=frozen)
    by_hand = adaptive_model(law.gains, dt, *frozen.values())
    for place, one in zip(found.places, found.margins(model), strict=True):
        factor = float(slope_factor(BEND + worn.posture * place.angle, worn.sheath))
        near = linear_suit(worn, place.angle, extensor=place.taut, slope_factor=factor)
        other = margins(StateSpace(near.a, near.b, near.joint, 0.0), by_hand, dt)
        assert one.largest_pole == pytest.approx(other.largest_pole, rel=1e-6)
        assert one.gain_margin_db == pytest.approx(other.gain_margin_db, rel=0.01)
        assert one.phase_margin_deg == pytest.approx(other.phase_margin_deg, rel=0.01)


def test_the_motor_of_the_linear_suit_is_where_its_springs_leave_it() -> None:
    """Slowly, the joint goes by `slope` of the motor, whatever the drive does."""
    near = linear_suit(suit(), 0.6)
    gain = np.linalg.solve(np.eye(len(near.a)) - near.a, near.b)
    assert (near.joint @ gain).item() == pytest.approx(near.slope * (near.motor @ gain).item(), rel=1e-6)


def test_what_a_joint_does_with_no_law_is_the_suits_alone() -> None:
    assert unrest(default_bench(), BEND, STROKE, 10.0) == (0.0, 0.0)
    trembling = suit()._replace(wearer=suit().wearer._replace(tremor=1.0))
    still, moved = (unrest(worn, BEND, STROKE, 2.0) for worn in (suit(), trembling))
    assert still.off == moved.off > 15.0 * RADIANS, "friction under a PD drive"
    assert unrest(integral(), BEND, STROKE, 2.0).off < 0.5 * still.off
    assert still.span == 0.0
    assert moved.span > 1.0 * RADIANS


def test_our_law_holds_on_a_suit_by_its_trials(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No linear loop one count wide stands for it: the suit without friction and play comes to rest all the same."""
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    assert main.run(["check", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, json_schema("check"))
    assert (found["verdict"], found["refuted"], found["gain_margin_db"]) == ("holds", True, None)
    assert "friction, play" in found["leaves_out"]
    assert found["worst"]["at"].startswith("elbow at ")
    assert found["worst"]["largest_pole"] > 1.0
    assert found["simulated_peak_deg"] < 10.0
    assert (found["limit_cycle"]["predicted"], found["ultimate_bound_deg"]) == (False, None)
    assert main.run(["check", str(path)]) == 0
    assert "gain margin   not defined for a suit: trials decide" in capsys.readouterr().out


def test_of_a_suit_a_margin_counts_until_a_trial_refutes_it_however_small_it_is() -> None:
    """A linear law has the margin that its loop says; ours, on a PD drive, bears a delay at which its loop does not."""
    whole = {"integral_gain": 4.0, "proportional_gain": 0.0, "derivative_gain": 0.0}
    linear = LAWS["cascaded_pid"].with_gains(**whole, motor_gain=0.0, motor_rate_gain=0.0)
    found = check(integral(), linear, stroke=STROKE)
    assert (found.verdict, found.refuted) == ("little_margin", False)
    assert 3.0 < (found.gain_margin_db or 0.0) < 4.0
    ours = check(suit(), suit_ours(), stroke=STROKE)
    assert all(point.margins.stable for point in ours.points)
    assert min(point.margins.gain_margin_db or np.inf for point in ours.points) < 6.0
    assert (ours.verdict, ours.refuted, ours.gain_margin_db) == ("holds", True, None)


def test_gains_of_the_bench_do_not_hold_on_a_suit() -> None:
    found = check(integral(), LAWS["adaptive"], stroke=STROKE)
    assert found.verdict == "does_not_hold"
    assert "in the trial it runs away" in found.reason


def test_a_missing_integral_is_named_by_check_and_tune_and_mends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failed(*_: object, **__: object) -> None:
        raise NoGainsError("no gains")

    for name in ("search", "_narrower"):
        monkeypatch.setattr(f"bowden.study.tune_law.{name}", failed)
    path, line = tmp_path / "suit.toml", "drive_integral_per_s = 40"
    path.write_text(RIG.replace(f"{line}.0\n", ""))
    assert main.run(["check", str(path)]) == 0
    checked = capsys.readouterr().out
    assert "verdict       holds" in checked, "our law bears a PD drive"
    ((without, with_one),) = re.findall(
        r"in the trials by (\d[\d.]*)°, with one by (\d[\d.]*)°", " ".join(checked.split())
    )
    assert float(without) > float(with_one), "but less well"
    assert main.run(["tune", str(path)]) == 2
    tuned = capsys.readouterr().err
    assert tuned.splitlines()[-1] == f"Next: bowden check {path}  # once that is in it"
    assert all(f"{line} into [suit]" in " ".join(said.split()) for said in (checked, tuned))
    path.write_text(path.read_text().replace("worn = true", f"worn = true\n{line}"))
    assert bowden.check(path).verdict == "holds", "the advice mends it"


@pytest.mark.filterwarnings("ignore:suit.drive_integral_per_s is 0")
def test_a_run_asks_the_check_of_the_suit() -> None:
    rig = Rig(suit=SuitSettings(worn=True), law=LAWS["adaptive"].with_gains(feedback_gain=40.0), duration=2.0)
    with pytest.raises(ParameterError, match=r"adaptive fails the check on this rig: in the trial [^;]*; .*force=True"):
        bowden.simulate(rig)
    with pytest.warns(UserWarning, match="runs because of force=True"):
        bowden.simulate(rig, force=True)


def test_under_the_wearers_push_the_loop_inside_is_judged() -> None:
    firm = WearerSettings(share=1.0, resisting_stiffness=100.0, resisting_damping=3.0, swing=0.3)
    rig = Rig(suit=SuitSettings(worn=True), wearer=firm, law="bowden")
    pushed = rig.replace(admittance=AdmittanceSettings(enabled=True, high=1.5))
    judged, before = ranges.judged(pushed), ranges.judged(rig)
    assert isinstance(judged, Suit)
    assert isinstance(before, Suit)
    assert (before.wearer.stiffness, before.wearer.swing) == (100.0, 0.3)
    assert (judged.wearer.stiffness, judged.wearer.swing, judged.wearer.share) == (0.0, 0.0, 1.0)
    assert ranges.stroke(pushed) == (0.0, 1.5)
    assert bowden.check(pushed).verdict == "holds"


def test_an_arm_that_its_wearer_holds_fast_does_not_hold_though_it_rests() -> None:
    held = suit()._replace(wearer=suit().wearer._replace(constant=-50.0))
    found = run_trial(held, LAWS["uncompensated"], BEND, STROKE, moving=4.0)
    assert not found.bounded
    assert "are asked for" in found.why
