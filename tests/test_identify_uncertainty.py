"""True parameters lie within the stated uncertainty as often as it says, with encoder noise and counts."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel
from bowden.core.units import RADIANS
from bowden.identify.cable.bouc_wen import bounds, fit_terms
from bowden.identify.cable.generalised import fit_branches
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.plays import fit_line, fit_play
from bowden.identify.cable.projection import Estimate
from bowden.identify.cable.turns import find_turns, motor_noise
from bowden.identify.cable.uncertainty import all_shown, loop_of, standard_errors
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.cable.prandtl_ishlinskii import plays
from bowden.models.drive.encoder import Encoder, reading

Array = NDArray[np.float64]

SEEDS = 40
TIME = np.arange(12_000) / 1000.0
DITHERED = Encoder(resolution=0.022 * RADIANS, noise=0.01 * RADIANS)
COARSE_JOINT = Encoder(resolution=0.09 * RADIANS, noise=0.03 * RADIANS)
NOISELESS = Encoder(resolution=0.022 * RADIANS)
CABLE = BoucWen(offset=0.1)


def motion(seed: int) -> Array:
    """Strokes of changing amplitude, starting anywhere."""
    t = TIME + 10.0 * np.random.default_rng(1000 + seed).random()
    return np.asarray(RADIANS * (22.0 + 14.0 * np.sin(0.7 * t + 1.0)) * np.sin(2.2 * t))


def read(angle: Array, encoder: Encoder, seed: int) -> Array:
    normal, seen = np.random.default_rng(seed).standard_normal(len(angle)), np.empty(len(angle))
    compiled(readings)(angle, normal, encoder, seen)
    return seen


@kernel
def readings(angle: Array, normal: Array, encoder: Encoder, seen: Array) -> None:
    for k in range(len(angle)):
        seen[k] = reading(angle[k], normal[k], encoder)


def path_of(motor: Array, joint: Array, seed: int, encoders: tuple[Encoder, Encoder]) -> Path:
    seen = read(motor, encoders[0], 2 * seed)
    return build_path(TIME, seen, read(joint, encoders[1], 2 * seed + 1), find_turns(seen, motor_noise(seen)), 1500)


def scores(estimate: Estimate, path: Path, family: str, true: dict[str, float]) -> list[float]:
    errors = standard_errors(path, estimate, family)
    return [(estimate.parameters[name] - value) / errors[name] for name, value in true.items()]


def assert_coverage(found: list[list[float]], least: float, most_mean: float = 1.0) -> None:
    """Two standard deviations hold 95 %: no parameter much less often, and not because they are too wide."""
    z = np.array(found)
    assert np.all(np.mean(np.abs(z) < 2.0, axis=0) >= least)
    assert np.all(np.abs(np.mean(z, axis=0)) < most_mean)
    assert np.all(np.std(z, axis=0) > 0.4)


@pytest.mark.parametrize("encoders", [(DITHERED, DITHERED), (DITHERED, COARSE_JOINT)], ids=["fine", "coarse joint"])
def test_bouc_wen(encoders: tuple[Encoder, Encoder]) -> None:
    true = CABLE._asdict() | {"initial_h": 0.05}
    start = np.array([np.log(CABLE.rate / saturation(CABLE)), -np.log(2.0 * CABLE.shape - 1.0), 1.0, 0.1])
    found = []
    for seed in range(SEEDS):
        motor = motion(seed)
        h = hysteresis(motor, 0.05, CABLE)
        joint = CABLE.slope * motor + CABLE.hysteresis_gain * h + CABLE.offset
        path = path_of(motor, joint, seed, encoders)
        found.append(scores(fit_terms(path, start, 1, 0), path, "bouc_wen", true))
    assert_coverage(found, least=0.85)


@pytest.mark.parametrize("encoders", [(DITHERED, DITHERED), (NOISELESS, COARSE_JOINT)], ids=["noise", "counts alone"])
@pytest.mark.long
def test_play(encoders: tuple[Encoder, Encoder]) -> None:
    true = {"slope": -0.9, "half_width": 0.05, "offset": 0.2, "initial_lag": 0.02}
    found = []
    for seed in range(SEEDS):
        motor = motion(seed)
        z = plays(np.concatenate([[motor[0] + 0.02], motor]), np.array([0.05]))[1:, 0]
        path = path_of(motor, -0.9 * z + 0.2, seed, encoders)
        found.append(scores(fit_play(path), path, "play", true))
    assert_coverage(found, least=0.8, most_mean=1.2)


def test_at_the_bound_of_its_search_a_parameter_has_no_uncertainty() -> None:
    motor = motion(0)
    z = plays(motor, np.array([0.05]))[:, 0]  # the sharpest corner there is
    path = path_of(motor, -0.9 * z, 0, (DITHERED, DITHERED))
    start = np.array([3.0, 0.0, np.log(29.0), 0.0])
    estimate = fit_terms(path, start, 1, 0)
    low, high = bounds(path.span)
    edge = np.isclose(estimate.theta, low, atol=5e-3) | np.isclose(estimate.theta, high, atol=5e-3)
    errors = standard_errors(path, estimate, "bouc_wen")
    assert edge[:3].any()
    for name, close in zip(("rate", "shape", "exponent"), edge[:3], strict=True):
        assert np.isinf(errors[name]) == close


def test_line_with_a_residual_that_is_not_white() -> None:
    found, blind = [], []
    for seed in range(SEEDS):
        random = np.random.default_rng(seed)
        wander = np.convolve(random.standard_normal(len(TIME) + 400), np.ones(401) / 401, "valid")
        motor = motion(seed)
        path = build_path(TIME, motor, 0.9 * motor + 0.1 + 0.01 * wander, find_turns(motor, 0.0), 1500)
        estimate = fit_line(path)
        found.append(scores(estimate, path, "line", {"slope": 0.9, "offset": 0.1}))
        residual = path.joint - estimate.fitted
        white = np.sqrt(path.weight @ residual**2 / path.weight.sum() / path.weight.sum())
        blind.append((estimate.parameters["offset"] - 0.1) / white)
    assert_coverage(found, least=0.8)
    assert np.mean(np.abs(blind) < 2.0) < 0.4  # what taking the samples for independent would promise


def test_what_the_log_does_not_show_is_infinite_and_a_setting_is_nan() -> None:
    ramp = 0.05 * TIME
    path = build_path(TIME, ramp, 0.9 * ramp + 0.1, find_turns(ramp, 1e-6), 500)
    estimate = fit_play(path)
    errors = standard_errors(path, estimate, "play")
    assert errors["half_width"] == np.inf
    plain = Estimate({"slope": 0.9, "set": 1.0}, {"slope": path.motor}, 0.9 * path.motor, np.empty(0))
    assert np.isnan(standard_errors(path, plain, "line")["set"])


def wandering(seed: int, size: float) -> Array:
    """A joint that lies a little beside itself from second to second [rad]."""
    knots = np.random.default_rng(seed).standard_normal(14)
    return np.asarray(size * np.interp(TIME, np.arange(14.0), knots))


def test_where_the_strokes_wander_the_offset_of_a_play_still_covers() -> None:
    found = []
    for seed in range(SEEDS):
        motor = motion(seed)
        z = plays(np.concatenate([[motor[0]], motor]), np.array([0.05]))[1:, 0]
        path = path_of(motor, 0.9 * z + 0.2 + wandering(seed, 0.03 * RADIANS), seed, (DITHERED, DITHERED))
        found.append(scores(fit_play(path), path, "play", {"slope": 0.9, "offset": 0.2}))
    assert_coverage(found, least=0.85)


def test_the_loop_of_free_branches_covers_that_of_a_bent_cable() -> None:
    """Its slope, offset and height, and its curve, though no model here has the cable's form."""
    found, curves = [], []
    for seed in range(SEEDS):
        motor = motion(seed)
        z = plays(np.concatenate([[motor[0]], motor]), np.array([0.03 + 0.001 * seed]))[1:, 0]
        clean = 0.9 * z + 0.2 + 0.02 * np.sin(4.0 * motor + seed)
        path = path_of(motor, clean + wandering(seed, 0.02 * RADIANS), seed, (DITHERED, DITHERED))
        loop = loop_of(path, fit_branches(path).fitted)
        true = loop_of(path, np.interp(path.time, TIME, clean))
        assert loop is not None
        assert true is not None
        names = ("slope", "offset", "height")
        found.append([(getattr(loop, one) - getattr(true, one)) / getattr(loop, f"{one}_error") for one in names])
        curves.append(np.subtract(loop.rising, true.rising) / loop.rising_error)
    assert_coverage(found, least=0.85, most_mean=1.2)
    assert np.mean(np.abs(curves) < 2.0) >= 0.9


def test_a_loop_says_nothing_of_what_it_cannot_know() -> None:
    motor = motion(0)
    turns = find_turns(motor, 0.0)
    one_way = slice(turns.at[0], turns.at[1])
    path = build_path(TIME[one_way], motor[one_way], motor[one_way], find_turns(motor[one_way], 0.0), 500)
    assert loop_of(path, path.joint) is None
    both = slice(turns.at[0], turns.at[2])
    path = build_path(TIME[both], motor[both], motor[both], find_turns(motor[both], 0.0), 500)
    loop = loop_of(path, path.joint)
    assert loop is not None
    assert np.isinf(loop.height_error)


def test_what_is_not_shown_is_known_without_its_deviation() -> None:
    for motor, shown in ((motion(0), True), (0.05 * TIME, False)):
        path = path_of(motor, 0.9 * plays(motor, np.array([0.05]))[:, 0], 0, (DITHERED, DITHERED))
        estimate = fit_play(path)
        errors = standard_errors(path, estimate, "play")
        assert all_shown(path, estimate) == shown == (np.inf not in errors.values())


def test_a_loop_is_as_high_as_its_play_whatever_strokes_there_are() -> None:
    """Short strokes turn in the middle, where they are still on their way from one side to the other."""
    motor = (
        RADIANS
        * 50.0
        * np.interp(TIME, np.linspace(0.0, 12.0, 13), [0, 1, 0, 0.6, 0.35, 0.7, 0.3, 0.65, 0, 1, 0.4, 1, 0])
    )
    joint, gap, at = np.empty_like(motor), 6.0 * RADIANS, 0.0
    for k, angle in enumerate(motor):
        at = min(max(at, angle - gap / 2.0), angle + gap / 2.0)
        joint[k] = 0.6 * at
    path = build_path(TIME, motor, joint, find_turns(motor, motor_noise(motor)), 1500)
    loop = loop_of(path, path.joint)
    assert loop is not None
    assert (loop.slope, loop.height) == pytest.approx((0.6, 0.6 * gap), rel=2e-3)
