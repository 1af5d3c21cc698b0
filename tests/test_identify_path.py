"""The path of a log: reversals, their extremes, and nodes that encoder noise does not move."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bowden.identify.cable.path import Path, build_path, remembered
from bowden.identify.cable.turns import find_turns, motor_noise, resolution, reversals
from bowden.identify.cable.validation import from_rest
from bowden.models.cable.prandtl_ishlinskii import plays

Array = NDArray[np.float64]

TIME = np.arange(12_000) / 1000.0
SINE = 0.5 * np.sin(2.0 * np.pi * 0.3 * TIME + 0.3)


def quantised(angle: Array, count: float) -> Array:
    return np.asarray(np.round(angle / count) * count)


def noisy(seed: int, size: float, count: float) -> Array:
    return quantised(SINE + size * np.random.default_rng(seed).standard_normal(len(SINE)), count)


def path_of(motor: Array, joint: Array | None = None, nodes: int = 2500) -> Path:
    return build_path(TIME, motor, motor if joint is None else joint, find_turns(motor, motor_noise(motor)), nodes)


def test_noise_and_resolution_are_read_off_the_signal() -> None:
    white = SINE + 1e-3 * np.random.default_rng(0).standard_normal(len(SINE))
    assert motor_noise(white) == pytest.approx(1e-3, rel=0.05)
    assert resolution(white) == 0.0
    assert resolution(quantised(SINE, 1e-3)) == pytest.approx(1e-3)
    assert motor_noise(quantised(SINE, 1e-3)) == pytest.approx(1e-3 / np.sqrt(12.0))
    assert motor_noise(SINE) < 1e-6


@pytest.mark.parametrize(("size", "count"), [(0.0, 1e-9), (2e-4, 4e-4), (5e-4, 1e-9), (0.0, 8e-4)])
def test_the_reversals_of_a_sine_are_found_whatever_the_encoder(size: float, count: float) -> None:
    path = path_of(noisy(1, size, count))
    assert path.strokes == 8
    assert np.abs(path.turning[1:-1]) == pytest.approx(np.full(7, 0.5), abs=0.5 * size + 0.5 * count + 1e-6)
    assert np.sign(path.turning[1:-1]).tolist() == [1, -1, 1, -1, 1, -1, 1]


def test_extremes_are_not_pushed_outwards_by_noise() -> None:
    size = 2e-4
    errors = [np.mean(np.abs(path_of(noisy(seed, size, 1e-9)).turning[1:-1])) - 0.5 for seed in range(12)]
    assert abs(float(np.mean(errors))) < 0.1 * size  # the largest reading itself lies three sizes too far out


def test_a_noisy_ramp_has_no_reversal() -> None:
    ramp = 0.05 * TIME + 1e-4 * np.random.default_rng(2).standard_normal(len(TIME))
    assert path_of(ramp).strokes == 1


@pytest.mark.parametrize("size", [0.0, 1e-4, 1e-3])
def test_nodes_never_step_back_nor_beyond_a_reversal(size: float) -> None:
    path = path_of(noisy(3, size, 1e-4))
    for stroke in range(path.strokes):
        steps = np.diff(path.motor[path.stroke == stroke])
        assert np.all(steps * np.sign(path.turning[stroke + 1] - path.turning[stroke]) >= 0.0)
    assert path.motor.max() <= path.turning[1:-1].max() + 1e-12


@given(st.integers(0, 10_000), st.integers(20, 4000))
@settings(max_examples=20)
def test_every_sample_is_counted_once(seed: int, nodes: int) -> None:
    random = np.random.default_rng(seed)
    motor = np.cumsum(random.standard_normal(2000)) * 1e-2
    joint = random.standard_normal(2000)
    path = build_path(TIME[:2000], motor, joint, find_turns(motor, motor_noise(motor)), nodes)
    assert path.weight.sum() == 2000
    assert path.weight @ path.joint == pytest.approx(joint.sum())
    assert path.weight @ path.time == pytest.approx(TIME[:2000].sum())


def test_a_rest_is_one_node() -> None:
    motor = np.where(TIME < 6.0, SINE, SINE[6000])
    motor = motor + 1e-4 * np.random.default_rng(4).standard_normal(len(motor))
    path = path_of(motor)
    assert path.weight.max() > 2000
    assert path.strokes == len(reversals(SINE[:6001], 1e-2)) + 1


def test_thinning_keeps_the_loop() -> None:
    joint = 0.9 * SINE + 0.05 * np.sign(np.cos(2.0 * np.pi * 0.3 * TIME + 0.3))
    coarse, fine = path_of(SINE, joint, 200), path_of(SINE, joint, 5000)
    assert len(coarse.motor) < 600 < len(fine.motor)
    assert coarse.turning == pytest.approx(fine.turning)
    for path in (coarse, fine):
        middle = (np.abs(path.motor) < 0.1) & (path.weight > 0)
        assert np.abs(path.joint - 0.9 * path.motor)[middle] == pytest.approx(0.05, abs=1e-3)


def test_a_long_log_needs_few_nodes_a_stroke() -> None:
    time = np.arange(400_000) / 100.0
    motor = np.sin(3.0 * time)
    path = build_path(time, motor, motor, find_turns(motor, motor_noise(motor)), 2500)
    assert path.strokes > 3000
    assert len(path.motor) < 16 * path.strokes
    assert path.weight.sum() == len(time)


def test_a_start_from_rest_counts_by_the_square_of_the_way_and_any_other_start_in_full() -> None:
    def share(motor: Array) -> Array:
        path = path_of(motor)
        kept = path.weight > 0.0
        return np.asarray(from_rest(path).weight[kept] / path.weight[kept])

    speed = 2.0 * np.pi * 0.3
    from_a_turn = share(1.0 - np.cos(speed * TIME))
    assert from_a_turn[0] == pytest.approx(0.03**2, rel=1e-6)
    assert (np.diff(from_a_turn) >= 0.0).all()
    assert from_a_turn[-1] == 1.0
    assert float(np.mean(from_a_turn < 1.0)) == pytest.approx(np.pi / speed / TIME[-1], rel=0.1)
    assert (share(np.sin(speed * TIME)) == 1.0).all()
    assert (share(1.0 - np.cos(0.2 * TIME)) == 1.0).all()  # one stroke: nothing says what it should be like


@given(st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=60), st.integers(0, 2**16), st.floats(0.01, 0.6))
def test_reversals_that_are_left_out_leave_no_trace_in_a_play(angles: list[float], mask: int, width: float) -> None:
    turning = np.where(np.arange(len(angles)) % 2, np.abs(angles), -np.abs(angles))
    read = np.array([bool(mask >> (k % 16) & 1) for k in range(len(angles) - 1)])
    kept = remembered(turning, read)
    assert np.isin(np.concatenate([np.flatnonzero(read), np.flatnonzero(read) + 1]), kept).all()
    whole, thinned = (plays(one, np.array([width]))[:, 0] for one in (turning, turning[kept]))
    assert thinned == pytest.approx(whole[kept])
