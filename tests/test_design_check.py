"""The check before anything moves: its verdicts, the limit cycle, chatter, advice."""

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from bowden.app.main import run
from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.laws.adaptive import ultimate_bounds
from bowden.control.stability import adaptive_model, margins, servo_model
from bowden.core.errors import ParameterError
from bowden.design.advice import advise
from bowden.design.check import STROKE, check
from bowden.design.check_rig import check_rig
from bowden.design.limit_cycle import describing_function, hysteresis_response
from bowden.design.trial import LONGEST, MOVING, run_trial, settled_after
from bowden.models.cable.bouc_wen import prepare_cable
from bowden.operations.schema import json_schema
from bowden.plants.bench import Bench
from bowden.plants.presets.bench import default_bench
from bowden.plants.transmission import transmission
from bowden.rig.rig import Rig
from study import random_rigs

BENCH = default_bench()
BENDS = (np.pi, 2.0 * np.pi)
ADAPTIVE = LAWS["adaptive"]
PAPER = ADAPTIVE.preset("paper")


def monotone(bench: Bench = BENCH) -> Bench:
    return bench._replace(cable=bench.cable._replace(rate=5.0))


def test_the_printed_gains_do_not_hold_and_the_defaults_do() -> None:
    good, bad = check(BENCH, ADAPTIVE, bends=BENDS), check(BENCH, PAPER, bends=BENDS)
    assert good.verdict == "holds"
    assert bad.verdict == "does_not_hold"
    assert (bad.gain_margin_db, bad.phase_margin_deg, bad.delay_margin_s, bad.swing) == (None, None, None, None)
    assert good.gain_margin_db is not None
    assert good.gain_margin_db > 12.0
    assert good.phase_margin_deg is not None
    assert good.phase_margin_deg > 60.0


def test_margins_are_those_of_the_model_worked_out_by_hand() -> None:
    found = check(BENCH, ADAPTIVE, bends=BENDS)
    assert {point.slope for point in found.points} == {transmission(BENCH, bend, STROKE).slope for bend in BENDS}
    assert len({point.estimates["slope_inverse"] for point in found.points}) > 5
    for point in found.points[::3]:
        law = adaptive_model(ADAPTIVE.gains, 1e-3, point.estimates["slope_inverse"], point.estimates["bound"])
        by_hand = margins(servo_model(BENCH.servo, 1e-3, BENCH.delay, point.slope), law, 1e-3)
        assert point.margins.gain_margin_db == pytest.approx(by_hand.gain_margin_db, rel=0.01)
        assert point.margins.phase_margin_deg == pytest.approx(by_hand.phase_margin_deg, rel=0.01)


def test_a_cable_that_is_steeper_after_a_reversal_counts_with_that_slope() -> None:
    steep = BENCH._replace(cable=BENCH.cable._replace(hysteresis_gain=0.129))
    after = 0.938 + 0.129 * 9.256 * (1.0 + 1.0 / (2.0 * 9.427 - 1.0))
    assert max(point.slope for point in check(steep, ADAPTIVE).points) == pytest.approx(after)


@pytest.mark.parametrize(
    ("law", "verdict"),
    [
        (ADAPTIVE.with_gains(error_gain=0.25), "little_margin"),
        (ADAPTIVE.with_gains(error_gain=0.6), "does_not_hold"),
        (LAWS["uncompensated"], "holds"),
    ],
)
def test_verdicts(law: Law, verdict: str) -> None:
    assert check(monotone(), law).verdict == verdict


def test_the_limit_cycle_is_predicted_and_confirmed_on_the_printed_cable_and_absent_on_a_monotone_one() -> None:
    found = check(BENCH, ADAPTIVE, bends=BENDS)
    assert found.cycle is not None
    assert found.cycle_confirmed is True
    assert found.swing == pytest.approx(found.cycle.amplitude, rel=0.3)
    calm = check(monotone(), ADAPTIVE, bends=BENDS)
    assert calm.cycle is None
    assert calm.cycle_confirmed is None
    assert calm.swing is not None
    assert calm.swing < 2.0 * BENCH.joint_encoder.resolution


def test_the_describing_function_is_a_slope_for_small_and_for_large_motions() -> None:
    cable = BENCH.cable
    small, large = describing_function(BENCH, BENCH.sheath.bend, STROKE, np.array([1e-5, 300.0]))[1]
    assert small == pytest.approx(cable.slope + cable.hysteresis_gain * cable.rate, rel=1e-3)
    assert large == pytest.approx(cable.slope, rel=2e-3)


def test_the_hysteresis_response_leads_and_is_resolved() -> None:
    amplitudes = np.array([0.05, 0.2, 1.0])
    coarse, fine = np.empty(3, np.complex128), np.empty(3, np.complex128)
    for points, gains in ((128, coarse), (1024, fine)):
        hysteresis_response(amplitudes, prepare_cable(BENCH.cable), points, 3, gains)
    assert (fine.imag > 0.0).all()  # h leads like a friction, so that with αh below zero the joint lags
    np.testing.assert_allclose(coarse, fine, rtol=0.02)


def test_chatter_of_a_steep_tanh_is_seen_and_bounded() -> None:
    found = check(monotone(), ADAPTIVE.with_gains(smoothing=1e-5))
    assert found.chatters
    assert found.verdict == "little_margin"
    assert not check(monotone(), ADAPTIVE).chatters


def test_estimates_that_drift_away_in_minutes_are_seen() -> None:
    """At rest after 40 s and still so after 60 s, this loop throws the joint off after two minutes."""
    servo = BENCH.servo._replace(natural_frequency=2.0 * np.pi * 5.8, damping=0.86)
    rig = BENCH._replace(servo=servo, delay=2, cable=BENCH.cable._replace(slope=0.66))
    law = ADAPTIVE.with_gains(error_gain=0.163, feedback_gain=5.0)
    assert run_trial(rig, law, np.pi, STROKE, moving=40.0).bounded
    assert check(rig, law).verdict == "does_not_hold"


def test_a_law_is_tried_until_its_own_estimates_have_settled() -> None:
    """The adaptive law's leakage takes 4/(δ·σ), all that the check ever gives; a trial is whole motions long."""
    assert settled_after(ADAPTIVE) == LONGEST == 4.0 / (2.0 * 0.005)
    assert settled_after(ADAPTIVE.with_gains(slope_leakage=0.0)) == LONGEST
    assert settled_after(ADAPTIVE.with_gains(slope_leakage=0.03, bound_leakage=0.016)) == 126.0
    assert settled_after(replace(LAWS["bowden"], settling=None)) == LONGEST
    assert [trial.moving for trial in check(BENCH, ADAPTIVE).trials] == [LONGEST]
    assert [trial.moving for trial in check(BENCH, LAWS["bowden"]).trials] == [MOVING]


def test_what_holds_must_stand_a_part_of_its_margin_with_the_play() -> None:
    """Linear loops with 7 dB and 33°, whose estimates the play drives off after seven minutes."""
    rig, law = next(itertools.islice(random_rigs(BENCH, 400, seed=4), 381, None))
    found = check(rig, law)
    assert all(point.margins.stable for point in found.points)
    assert found.reserve is False
    assert found.verdict == "little_margin"
    assert check(BENCH, ADAPTIVE).reserve is True
    assert check(BENCH, LAWS["uncompensated"]).reserve is None


def test_the_papers_bounds_stand_beside_the_simulation() -> None:
    found = check(BENCH, ADAPTIVE)
    cable = transmission(BENCH, np.pi, STROKE)
    bounds = ultimate_bounds(ADAPTIVE.gains, cable.slope, 0.5 * cable.dead_zone)
    assert (found.ultimate_s, found.ultimate_error) == bounds
    assert all(trial.peak is not None and trial.peak < bounds.error for trial in found.trials)
    assert check(BENCH, LAWS["uncompensated"]).ultimate_error is None
    assert check(BENCH, ADAPTIVE.with_gains(slope_leakage=0.0)).ultimate_error is None


@pytest.mark.parametrize(
    ("bench", "law"),
    [(BENCH, PAPER), (monotone(), ADAPTIVE.with_gains(error_gain=0.6)), (BENCH, LAWS["observer"])],
    ids=["paper", "error_gain", "observer"],
)
def test_the_advice_mends_it(bench: Bench, law: Law) -> None:
    said = advise(bench, law, check(bench, law)).split(";")[0]
    words = said.split()
    assert words[0] == "set"
    assert check(bench, law.with_gains(**{words[1]: float(words[3])})).verdict == "holds"


def test_a_delay_that_no_gain_mends_is_named() -> None:
    late = monotone()._replace(delay=20)
    said = advise(late, ADAPTIVE, check(late, ADAPTIVE))
    assert said.startswith(("shorten the delay to ", "set "))


@pytest.mark.parametrize(
    ("law", "options", "said"),
    [
        (
            ADAPTIVE.__class__(**{**vars(ADAPTIVE), "gains": ADAPTIVE.gains._replace(feedback_gain=np.nan)}),
            {},
            "gain feedback_gain of law 'adaptive' is nan",
        ),
        (ADAPTIVE, {"bends": (2.0, 1.0)}, "bends"),
        (ADAPTIVE, {"stroke": (1.0, 1.0)}, "stroke"),
    ],
)
def test_what_cannot_be_checked_is_refused(law: Law, options: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        check(BENCH, law, **options)


@pytest.mark.parametrize("preset", [[], ["--preset", "paper"]])
def test_the_command_prints_one_document(
    preset: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text("")
    code = 1 if preset else 0
    assert run(["check", "rig.toml", *preset, "--json"]) == code
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json_schema("check"))
    assert document["verdict"] == ("does_not_hold" if preset else "holds")
    assert document["holds"] is not bool(preset)
    assert (document["gain_margin_db"] is None) is bool(preset)
    assert document["limit_cycle"]["confirmed"] is (None if preset else True)
    assert bool(preset) is document["advice"].startswith("set error_gain to ")
    assert run(["check", "rig.toml", *preset]) == code
    printed = capsys.readouterr().out
    assert printed.startswith(f"verdict       {document['verdict']}: ")
    assert "come to rest" not in document["reason"], "where a limit cycle is confirmed"
    assert ("proven bound  no help here" in printed) is not bool(preset), "a bound of many turns"
    assert "±none" not in printed


def test_a_law_that_shows_no_feedback_in_so_short_a_cycle_is_not_called_good() -> None:
    """Its trial's difference of the joint is a jump there, which the law leaves out: no loop would be seen."""
    rig = Rig(law="bowden", sample_time=0.25e-3)
    with pytest.raises(ParameterError, match=r"cannot be judged in cycles of 0\.25 ms"):
        check_rig(rig, rig.fitted())
