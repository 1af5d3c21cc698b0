"""The laws of the identification: what it recovers, what it does not depend on, what it chooses and why."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import bowden
from bowden.core.errors import BowdenError, LogError, ParameterError
from bowden.core.units import DEGREES
from bowden.identify.cable import identification
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import forecast
from bowden.identify.cable.generalised import fit_branches, rough_branches
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.plays import fit_stack
from bowden.identify.cable.projection import Estimate
from bowden.identify.cable.turns import find_turns
from bowden.identify.cable.validation import folds, simplest_of_the_best
from bowden.models.cable.bouc_wen import BoucWen, joint_angle
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.cable.generalised_play import Branches, design_of, half_gap, mean_branch, with_curve
from bowden.models.cable.generalised_play import joint_angle as branched
from bowden.models.cable.prandtl_ishlinskii import plays
from bowden.plants.identified import CableModel
from bowden.plants.predicted import NAMES, branches_of, chebyshev, generalised_play
from bowden.records.metrics import rmse

Array = NDArray[np.float64]

TIME = np.arange(8000) / 400.0
MOTOR = np.radians(20.0 * np.sin(1.4 * TIME + 0.4) + 12.0 * np.sin(3.9 * TIME))
CABLE = BoucWen(offset=0.1)
TRUE = {**CABLE._asdict(), "initial_h": 0.05}


def cable(motor: Array, true: BoucWen = CABLE) -> Array:
    h = hysteresis(np.ascontiguousarray(motor), 0.05, true)
    return np.asarray(true.slope * motor + true.hysteresis_gain * h + true.offset)


def noise(seed: int, size_deg: float = 0.01) -> Array:
    return np.asarray(np.radians(size_deg) * np.random.default_rng(seed).standard_normal(len(TIME)))


@pytest.fixture(scope="module")
def known() -> Fit:
    """A log with known parameters, and noise on both encoders."""
    return bowden.identify(TIME, MOTOR + noise(1), cable(MOTOR) + noise(2))


def test_known_parameters_come_back_within_their_uncertainty(known: Fit) -> None:
    fitted = known.models["bouc_wen"]
    assert known.best.name == "bouc_wen"
    for name, value in TRUE.items():
        assert abs(fitted.parameters[name] - value) < 3.0 * fitted.uncertainty[name], name
    assert fitted.uncertainty["slope"] < 1e-4
    assert fitted.uncertainty["exponent"] < 0.1
    assert known.samples == len(TIME)


def test_the_error_on_the_unseen_half_is_the_noise(known: Fit) -> None:
    both = math.hypot(0.01, 0.938 * 0.01)  # the motor's own noise is averaged in the path, so a little less is left
    assert 0.009 < known.models["bouc_wen"].test_rms * DEGREES < both
    assert known.models["bouc_wen"].train_rms == pytest.approx(known.models["bouc_wen"].test_rms, rel=0.1)


def test_the_forecast_is_what_the_models_inverse_leaves() -> None:
    fit = bowden.identify(TIME, MOTOR, cable(MOTOR))
    play, line = (fit.models[name] for name in ("play", "line"))
    reference = line.parameters["slope"] * MOTOR + line.parameters["offset"]
    slot = (reference - play.parameters["offset"]) / play.parameters["slope"]
    motor = slot + play.parameters["half_width"] * np.sign(np.gradient(slot))
    left = cable(motor) - reference
    drawn = play.model.joint_angle(MOTOR)
    known = line.parameters["slope"], play.test_rms, line.test_rms
    one = replace(fit.logs[0], predicted=drawn)
    said = forecast(one, *known)
    assert 0.85 < np.sqrt(np.mean(left[fit.logs[0].split :] ** 2)) / said.compensated < 1.15
    assert said.compensated < 0.2 * said.uncompensated
    counted = np.round(MOTOR / 1e-3) * 1e-3
    counts = forecast(replace(one, log=replace(fit.log, motor=counted)), *known).resolution
    assert counts == pytest.approx(1e-3 * line.parameters["slope"] / math.sqrt(12.0), rel=1e-3)


def test_all_models_are_there_and_the_richer_is_not_worse(known: Fit) -> None:
    assert tuple(known.models) == NAMES
    errors = {name: fitted.train_rms for name, fitted in known.models.items()}
    assert errors["bouc_wen"] < errors["prandtl_ishlinskii"] < errors["play"] < errors["line"]
    assert errors["bouc_wen_static"] <= errors["bouc_wen"] * 1.001
    for fitted in known.models.values():
        assert all(math.isfinite(value) for value in fitted.parameters.values())
        assert fitted.uncertainty.keys() == fitted.parameters.keys()


def test_the_identified_cable_plugs_into_the_simulation(known: Fit) -> None:
    found = known.models["bouc_wen"].model.to_bouc_wen()
    h = hysteresis(MOTOR, 0.05, found)
    joint = joint_angle(MOTOR, h, found)
    assert joint == pytest.approx(cable(MOTOR), abs=np.radians(0.02))
    with pytest.raises(ParameterError, match="take the model 'bouc_wen'"):
        known.models["play"].model.to_bouc_wen()


def test_the_same_log_gives_the_same_model(known: Fit) -> None:
    again = bowden.identify(TIME, MOTOR + noise(1), cable(MOTOR) + noise(2))
    assert again.models["play"] == known.models["play"]
    assert [again.models[name].parameters for name in NAMES] == [known.models[name].parameters for name in NAMES]
    assert (again.best.name, again.warnings) == (known.best.name, known.warnings)
    assert np.array_equal(again.logs[0].predicted, known.logs[0].predicted)


def test_degrees_and_radians_are_one_log(known: Fit) -> None:
    degrees = [np.degrees(MOTOR + noise(1)), np.degrees(cable(MOTOR) + noise(2))]
    other = bowden.identify(TIME, *degrees, unit="deg")
    for name in NAMES:
        assert other.models[name].parameters == pytest.approx(dict(known.models[name].parameters), rel=1e-4, abs=1e-7)


def test_time_does_not_matter(known: Fit) -> None:
    slow = bowden.identify(7.0 * TIME + 3.0, MOTOR + noise(1), cable(MOTOR) + noise(2))
    for name in NAMES:
        assert slow.models[name].parameters == pytest.approx(dict(known.models[name].parameters), rel=1e-9, abs=1e-12)


def test_a_cable_that_runs_backwards_is_the_same_cable(known: Fit) -> None:
    """The joint counted the other way round turns the sign of every linear coefficient, and of nothing else."""
    flipped = bowden.identify(TIME, MOTOR + noise(1), -(cable(MOTOR) + noise(2)))
    assert flipped.best.name == known.best.name
    for name in NAMES:
        fitted = flipped.models[name]
        for key, value in known.models[name].parameters.items():
            linear = key.startswith(("slope", "offset", "hysteresis_gain", "weight", "bend"))
            sign = -1.0 if linear or (key[7:].isdigit() and key.startswith("static_")) else 1.0
            assert fitted.parameters[key] == pytest.approx(sign * value, rel=2e-3, abs=1e-6), (name, key)
        assert fitted.test_rms == pytest.approx(known.models[name].test_rms, rel=1e-3)


SLOTS = plays(MOTOR, np.array([0.01, 0.04, 0.12]))
FROM_BESIDE = plays(np.concatenate([[MOTOR[0] + 0.02], MOTOR]), np.array([0.06]))[1:, 0]
PLAY = {"slope": -0.9, "half_width": 0.06, "offset": 0.2, "initial_lag": 0.02}


@pytest.mark.parametrize(
    ("name", "joint", "true"),
    [
        ("line", -0.9 * MOTOR + 0.3, {"slope": -0.9, "offset": 0.3}),
        ("play", -0.9 * FROM_BESIDE + 0.2, PLAY),
        ("prandtl_ishlinskii", 0.4 * MOTOR + SLOTS @ np.array([0.2, 0.2, 0.1]), {}),
        ("bouc_wen_static", cable(MOTOR) + 0.02 * (MOTOR / np.max(np.abs(MOTOR))) ** 3, {}),
    ],
)
def test_a_cable_of_each_family_is_recognised(name: str, joint: Array, true: dict[str, float]) -> None:
    fit = bowden.identify(TIME, MOTOR + noise(1), joint + noise(2))
    assert fit.best.name == name
    assert fit.chosen.test_rms * DEGREES < (0.03 if name == "prandtl_ishlinskii" else 0.015)
    for key, value in true.items():
        assert abs(fit.chosen.parameters[key] - value) < 3.0 * fit.chosen.uncertainty[key]


def test_a_finely_bent_loop_needs_free_branches_and_is_no_worse_outward() -> None:
    """Bends of a tenth of the stroke: drawn inside; on a stroke half as large again as good as the next best."""
    nodes = np.arange(40)
    bends, gaps = 0.004 * np.sin(1.3 * nodes), 0.05 + 0.005 * np.cos(0.9 * nodes)
    low, high = float(MOTOR.min()), float(MOTOR.max())
    bent = Branches(0.9, bends, gaps, low, high, np.array([0.5, 1.5]), np.array([0.5, 0.5]), 0.1, 0.0)
    fit = bowden.identify(TIME, MOTOR + noise(1), branched(MOTOR, 0.0, bent) + noise(2))
    assert fit.best.name == "generalised_play"
    assert fit.chosen.test_rms < 0.7 * fit.models["bouc_wen_static"].test_rms
    further, others = 1.5 * MOTOR, ("bouc_wen_static", "prandtl_ishlinskii")
    truth = branched(further, 0.0, bent)
    errors = {name: rmse(fit.models[name].model.joint_angle(further) - truth) for name in NAMES}
    assert errors["generalised_play"] < 1.1 * min(errors[name] for name in others)
    joint = fit.best.joint_angle(further)
    assert (np.diff(joint) * np.diff(further) >= -1e-12).all()


def test_the_final_model_holds_where_the_second_half_reaches_further() -> None:
    """Its nodes are laid anew over the whole log, so that it is as good there as on the first half."""
    nodes, time = np.arange(40), np.arange(0.0, 30.0, 0.01)
    motor = -np.where(time < 15.0, 0.5, 0.55) * np.cos(4.0 * math.pi / 3.0 * time)
    bends, gaps = 0.004 * np.sin(1.3 * nodes), 0.05 + 0.005 * np.cos(0.9 * nodes)
    bent = Branches(0.9, bends, gaps, -0.5, 0.5, np.array([0.5, 1.5]), np.array([0.5, 0.5]), 0.1, 0.0)
    paths = []
    for stop in (1500, 3000):
        path_turns = find_turns(motor[:stop], 1e-9)
        paths.append(build_path(time[:stop], motor[:stop], branched(motor, 0.0, bent)[:stop], path_turns, 1500))
    near = fit_branches(paths[0])
    whole = fit_branches(paths[1], near)
    assert whole.parameters["last_node"] > 0.54 > 0.51 > near.parameters["last_node"]
    error = generalised_play(whole.parameters, motor) - branched(motor, 0.0, bent)
    assert rmse(error[1500:]) * DEGREES < 0.05
    assert rmse(error) * DEGREES < 0.1


@pytest.mark.parametrize("ratio", [1.1, 1.3])
def test_a_loop_with_a_slope_of_its_own_either_way_is_two_lines(ratio: float) -> None:
    """Eq. 4 with c₁ ≠ c₂: branches are found again to 1 %, along which the joint goes on beyond what was fitted."""
    up, down = 0.9 * math.sqrt(ratio), 0.9 / math.sqrt(ratio)
    time = np.arange(0.0, 20.0, 0.01)
    motor = 0.4 * np.sin(0.8 * math.pi * time)
    noise = 1e-3 * np.random.default_rng(4).standard_normal(len(time))
    joint, held = np.empty_like(motor), 0.0
    for k, angle in enumerate(motor):
        joint[k] = held = min(max(held, up * angle - 0.12), down * angle + 0.12)
    path = build_path(time, motor, joint + noise, find_turns(motor, 1e-9), 1500)
    found = branches_of(fit_branches(path).parameters)
    ends = np.array([mean_branch(at, found) for at in (-0.45, 0.45)]) + found.offset
    gaps = np.array([half_gap(at, found) for at in (-0.45, 0.45)])
    assert np.diff(ends - gaps)[0] / 0.9 == pytest.approx(up, rel=0.01)
    assert np.diff(ends + gaps)[0] / 0.9 == pytest.approx(down, rel=0.01)


def test_the_design_is_the_model_beyond_the_last_node_too() -> None:
    nodes = np.arange(40)
    ends = (-0.3, 0.3)
    shares = np.array([0.5, 0.5])
    cable = Branches(0.9, np.zeros(40), 0.05 + 0.0 * nodes, *ends, np.array([0.5, 1.5]), shares, 0.0, 0.0)
    mean, gaps = 0.9 * np.linspace(*ends, 40) + 0.004 * np.sin(1.3 * nodes), 0.05 + 0.005 * np.cos(0.9 * nodes)
    slope, offset = np.polyfit(np.linspace(*ends, 40), mean, 1)
    bends = mean - slope * np.linspace(*ends, 40) - offset
    cable = with_curve(cable._replace(slope=slope, offset=offset, bends=bends, gaps=gaps))
    assert cable.curve != 0.0
    motor = 0.5 * np.sin(np.linspace(0.3, 20.0, 3000))
    drawn = design_of(motor, 0.4, cable) @ np.concatenate([mean, gaps])
    assert drawn == pytest.approx(branched(motor, 0.4, cable), abs=1e-12)


def test_branches_of_a_cable_without_play_are_its_line() -> None:
    """Noise bends them against the motor; however far λ has to grow, the line stays."""
    noisy = np.random.default_rng(0).standard_normal((4, 2000))
    time = np.arange(0.0, 20.0, 0.01)
    motor = 0.5 * np.sin(0.8 * math.pi * time)
    for slope, (of_motor, of_joint) in ((0.9, noisy[:2]), (-0.9, noisy[2:])):
        seen, joint = motor + 1e-3 * of_motor, slope * motor + 1e-3 * of_joint
        path = build_path(time, seen, joint, find_turns(seen, 1e-3), 600)
        found = fit_branches(path)
        assert rmse(found.fitted - slope * path.motor) < 1e-3


@pytest.mark.parametrize("strengths", [(1e-3, 1e-3), (1e9, 1e9)])
def test_no_smoothing_lets_a_branch_go_against_the_motor(strengths: tuple[float, float]) -> None:
    """Joints that turn back in mid-stroke, so that free branches would too; a straight line is what is left."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 20.0, 0.02)
    motor = 0.5 * np.sin(0.8 * math.pi * time)
    joint = -0.02 * motor + 0.05 * np.sin(20.0 * motor) + 0.01 * rng.standard_normal(len(time))
    path = build_path(time, motor, joint, find_turns(motor, 1e-9), 600)
    near = rough_branches(path)
    found = fit_branches(path, replace(near, theta=np.array([near.theta[0], *strengths])))
    cable = branches_of(found.parameters)
    place = np.linspace(cable.low, cable.high, 40)
    mean = cable.slope * place + cable.bends
    steps = np.diff(mean) * np.sign(mean[-1] - mean[0])
    assert (cable.gaps >= 0.0).all()
    assert (steps >= np.abs(np.diff(cable.gaps)) - 1e-12).all()
    assert rmse(found.fitted - path.joint) < 1.05 * rmse(path.joint)


def test_a_model_that_the_whole_log_spoils_stays_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoilt(path: Path, near: Estimate) -> Estimate:
        found = fit_stack(path, near)
        return replace(found, parameters={**found.parameters, "offset": found.parameters["offset"] + 0.05})

    monkeypatch.setitem(identification.FAMILIES, "prandtl_ishlinskii", spoilt)
    fit = bowden.identify(TIME, MOTOR + noise(1), cable(MOTOR) + noise(2))
    assert any("stays as it was: prandtl_ishlinskii (" in warning for warning in fit.warnings)
    stack = fit.models["prandtl_ishlinskii"]
    whole = stack.model.joint_angle(MOTOR) - cable(MOTOR)
    assert rmse(whole) < 1.2 * max(stack.test_rms, stack.train_rms)


def test_free_branches_state_the_uncertainty_of_their_loop_alone(known: Fit) -> None:
    branches = known.models["generalised_play"]
    assert all(math.isnan(value) for value in branches.uncertainty.values())
    assert branches.fitted_count == 80
    loop, same = branches.loop, known.models["bouc_wen"].loop
    assert loop is not None
    assert same is not None
    for name in ("slope", "offset", "height"):
        error = math.hypot(getattr(loop, f"{name}_error"), getattr(same, f"{name}_error"))
        assert 0.0 < error < 0.01
        assert abs(getattr(loop, name) - getattr(same, name)) < 3.0 * error, name


def test_folds_shift_from_cycle_to_cycle() -> None:
    """A stretch of one direction is left out in five folds in turn."""
    time = np.arange(0.0, 30.0, 0.01)
    motor = 0.5 * np.sin(0.8 * math.pi * time)
    path = build_path(time, motor, motor, find_turns(motor, 1e-9), 3000)
    masks = folds(path)
    for direction in (0, 1):
        for place in (-0.4, 0.01, 0.3):
            chosen = []
            for stroke in range(10 + direction, 20, 2):
                node = np.argmin(np.where(path.stroke == stroke, np.abs(path.motor - place), np.inf))
                chosen.append(next(fold for fold, mask in enumerate(masks) if mask[node]))
            assert sorted(chosen) == [0, 1, 2, 3, 4]
    assert np.all(np.sum(masks, axis=0) <= 1)


def test_one_reversal_offers_no_bent_loop() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    motor = 0.5 * np.cos(0.2 * math.pi * time)
    fit = bowden.identify(time, motor, cable(motor) + 0.02 * np.sin(6.0 * motor))
    assert fit.best.name in ("play", "prandtl_ishlinskii")
    assert fit.chosen.left_out_rms > fit.models["bouc_wen_static"].left_out_rms


@pytest.mark.parametrize(("cycles", "on_whole"), [(2.2, True), (6.0, False)])
def test_few_strokes_in_the_first_half_let_the_whole_log_choose(cycles: float, on_whole: bool) -> None:
    time = np.arange(0.0, 20.0, 0.02)
    motor = 0.5 * np.sin(2.0 * math.pi * cycles * time / 20.0)
    fit = bowden.identify(time, motor, cable(motor))
    assert fit.chosen_on_whole is on_whole
    assert any("the whole log chose the model" in warning for warning in fit.warnings) is on_whole


def test_the_second_half_decides_nothing() -> None:
    """Spoiling the judging half changes its error, and neither the choice nor what it rests on."""
    joint = cable(MOTOR) + noise(2)
    spoilt = joint.copy()
    spoilt[len(joint) // 2 + 1 :] += 0.2 * np.sin(9.0 * TIME[len(joint) // 2 + 1 :])
    good, bad = bowden.identify(TIME, MOTOR, joint), bowden.identify(TIME, MOTOR, spoilt)
    assert good.best.name == bad.best.name
    for name in NAMES:
        assert good.models[name].train_rms == bad.models[name].train_rms
        assert good.models[name].left_out_rms == bad.models[name].left_out_rms
        assert bad.models[name].test_rms > 0.1
    assert bad.trust.level != "yes"


def test_a_start_off_the_loop_is_left_out_and_said() -> None:
    motor = np.radians(30.0 * np.cos(2.2 * TIME))
    joint = cable(motor) + noise(2)
    settling = np.where(math.pi / 2.2 > TIME, 0.03 * np.sin(2.2 * TIME) ** 2, 0.0)
    fit = bowden.identify(TIME, motor, joint + settling)
    assert 0.5 < TIME[fit.logs[0].fitted_from] < 3.5
    assert any("were not fitted" in warning for warning in fit.warnings)
    assert fit.models["bouc_wen"].test_rms * DEGREES < 0.015
    assert bowden.identify(TIME, motor, joint).logs[0].fitted_from == 0


@pytest.mark.parametrize(
    ("motor", "said"),
    [
        (0.02 * TIME, "does not reverse in the first half"),
        (0.4 * np.abs(TIME / 5.0 - 1.0), "only 1 reversal"),
        (0.25 - 0.25 * np.cos(14.0 * math.pi * (TIME / TIME[-1]) ** 3), "as many cycles in each half"),
        (0.5 * np.sin(2.0 * TIME), "one amplitude"),
        (0.1 * np.sin(2.0 * TIME), "too small: of"),
        (0.3 * np.sin(2.0 * TIME) * (1.0 + TIME / 20.0), "beyond the range of the first"),
    ],
    ids=["no reversal", "one reversal", "slow at first", "one amplitude", "small", "growing"],
)
def test_what_the_motion_cannot_show_is_said(motor: Array, said: str) -> None:
    fit = bowden.identify(TIME, motor, cable(motor))
    assert any(said in warning for warning in fit.warnings), fit.warnings
    assert not any("the cable changed" in reason for reason in fit.trust.reasons)


@pytest.mark.long
def test_a_lag_in_time_is_said_and_taken_out() -> None:
    rate = 0.2 + 0.05 * TIME
    motor = 0.3 * np.sin(2.0 * math.pi * rate * TIME)
    late = np.interp(TIME - 0.03, TIME, cable(motor))
    fit = bowden.identify(TIME, motor, late)
    (said,) = (reason for reason in fit.trust.reasons if "ms late" in reason)
    assert float(re.findall(r"([\d.e+]+) ms", said)[0]) == pytest.approx(30.0, abs=1.0)
    assert fit.trust.level == "with care"
    loop, known = fit.chosen.loop, bowden.identify(TIME, motor, cable(motor)).chosen.loop
    assert loop is not None
    assert known is not None
    assert loop.height == pytest.approx(known.height, rel=0.05)


def test_a_joint_that_does_not_follow_is_said() -> None:
    fit = bowden.identify(TIME, MOTOR, 0.3 * np.sin(7.3 * TIME + 1.0))
    assert fit.best.name == "line"
    assert fit.trust.level == "no"
    assert "does not follow the motor" in str(fit.trust)


def test_progress_goes_on_to_the_end() -> None:
    told: list[tuple[str, float]] = []
    bowden.identify(TIME, MOTOR, cable(MOTOR), progress=lambda what, share: told.append((what, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


RESTS = np.where(TIME < 15.0, 0.0, MOTOR)
FAR = np.where(TIME < 1.0, 2000.0, np.degrees(MOTOR))


@pytest.mark.parametrize(
    ("signals", "unit", "said"),
    [
        ((TIME, MOTOR[:-1], MOTOR), None, "joint has 8000 samples; expected one length"),
        ((TIME, MOTOR, MOTOR), "grad", "expected deg, mdeg, rad, mrad, turns, counts, mm or cm"),
        ((TIME, RESTS, MOTOR), None, "of noise; expected strokes"),
        ((TIME, MOTOR, 0.1 + noise(3)), None, r"the joint moves .* of noise; expected .*; check its column"),
        ((TIME, np.degrees(MOTOR), MOTOR), None, "look like degrees"),
        ((TIME, FAR, np.degrees(MOTOR)), "deg", "motor is 2000°; expected an angle within ±1146°"),
        ((TIME[:30], MOTOR[:30], MOTOR[:30]), None, "too short"),
    ],
)
def test_signals_that_cannot_be_fitted_are_refused(signals: tuple[Array, ...], unit: str | None, said: str) -> None:
    with pytest.raises(BowdenError, match=said):
        bowden.identify(*signals, unit=unit)


@pytest.mark.parametrize(
    "motor",
    [
        np.where(TIME < 3.0, np.sin(TIME), np.sin(3.0)),
        np.where(TIME < 8.0, 0.0, np.sin(TIME - 8.0)),
        np.sign(np.sin(2.0 * TIME)) * np.minimum(1.0, TIME),
        np.round(3.0 * np.sin(TIME)) / 3.0,
        1e-5 * np.sin(3.0 * TIME),
        9.0 * np.sin(3.0 * TIME) + 9.0,
    ],
    ids=["rests at the end", "rests at the start", "steps", "six counts", "tiny", "many turns"],
)
@pytest.mark.parametrize("size_deg", [pytest.param(0.0, marks=pytest.mark.long), 0.01])
def test_odd_motions_end_in_figures_or_in_one_line(motor: Array, size_deg: float) -> None:
    try:
        fit = bowden.identify(TIME, motor + noise(1, size_deg), cable(motor) + noise(2, size_deg))
    except LogError:
        return
    for fitted in fit.models.values():
        assert math.isfinite(fitted.test_rms)
        assert all(math.isfinite(value) for value in fitted.parameters.values())
        assert not any(value < 0.0 for value in fitted.uncertainty.values())


@pytest.mark.parametrize("samples", [60, 4000])
def test_without_a_reversal_only_the_line_is_recommended(samples: int) -> None:
    motor = np.linspace(0.0, 1.0, samples)
    joint = np.where(motor < 0.1, 0.0, motor - 0.1) + 0.01 * np.sin(20.0 * motor)
    fit = bowden.identify(0.01 * np.arange(samples), motor + np.resize(noise(1, 0.005), samples), joint)
    assert fit.best.name == "line"
    assert any("does not reverse" in warning for warning in fit.warnings)
    assert math.isinf(fit.models["play"].uncertainty["half_width"])
    assert not any("nearly unidentifiable" in warning for warning in fit.warnings)  # of a family that was not chosen


def test_a_model_says_what_it_lacks() -> None:
    with pytest.raises(ParameterError, match="no cable model 'spline'"):
        CableModel("spline", {}).joint_angle(MOTOR)
    with pytest.raises(ParameterError, match="no parameter 'slope'"):
        CableModel("line", {}).joint_angle(MOTOR)


def test_polynomials_go_on_along_their_tangents() -> None:
    u = np.linspace(-2.0, 2.0, 4001)
    for degree in range(1, 8):
        values = chebyshev(u, degree)
        inside = np.abs(u) <= 1.0
        assert values[inside] == pytest.approx(np.polynomial.Chebyshev.basis(degree)(u[inside]), abs=1e-12)
        slopes = np.diff(values) / np.diff(u)
        assert slopes[-1] == pytest.approx(degree**2)
        assert slopes[0] == pytest.approx(degree**2 * (-1) ** (degree + 1))


def test_the_richer_model_must_earn_its_place() -> None:
    noise = np.array([0.1, -0.1, 0.05, -0.05])
    simple, rich = 1.0 + noise, 0.98 + noise[::-1]
    assert simplest_of_the_best({"rich": rich, "simple": simple}, {"rich": 9, "simple": 2}) == "simple"
    assert simplest_of_the_best({"rich": 0.5 * rich, "simple": simple}, {"rich": 9, "simple": 2}) == "rich"


def test_parameters_that_are_not_shown_decide_for_the_simpler_model() -> None:
    size = {"rich": 9, "simple": 2}
    errors = {"rich": np.array([1.0, 1.1, 0.9]), "simple": np.array([1.5, 1.6, 1.4])}
    assert simplest_of_the_best(errors, size) == "rich"
    near = errors | {"simple": 1.08 * errors["rich"]}  # above, but by less than a twentieth in the root mean square
    assert simplest_of_the_best(near, size) == "rich"
    assert simplest_of_the_best(near, size, unseen=["rich"]) == "simple"
    assert simplest_of_the_best(errors, size, unseen=["rich"]) == "rich"


@pytest.mark.parametrize("seed", [8, 22, 27, 50])
def test_a_rigid_joint_is_a_line(seed: int) -> None:
    """No play is taken up, and so a constant gap is an offset: nothing in the log holds its height."""
    time = np.arange(2000) * 2e-3
    motor = 0.5 - 0.5 * np.cos(2.0 * math.pi * 2.5 * time)
    joint = 0.9 * motor + 1e-3 * np.random.default_rng(seed).standard_normal(len(time))
    fit = bowden.identify(time, motor, joint)
    assert fit.best.name == "line"
    assert abs(fit.best.parameters["slope"] - 0.9) < 1e-3
