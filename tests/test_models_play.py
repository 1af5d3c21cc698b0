"""The play operator and stacks of it: what Krasnosel'skii and Pokrovskii prove of them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.models.cable.backlash import Play, joint_angle, push
from bowden.models.cable.prandtl_ishlinskii import joint_angle as stack_joint
from bowden.models.cable.prandtl_ishlinskii import plays

angles = st.floats(-2.0, 2.0)
paths = st.lists(angles, min_size=2, max_size=12)
widths = st.floats(0.0, 0.5)


def walk(path: list[float], half_width: float, z: float = 0.0) -> list[float]:
    slots = []
    for motor in path:
        z = float(push(z, motor, half_width))
        slots.append(z)
    return slots


def finer(path: list[float], pieces: int) -> list[float]:
    """The same straight moves, each in several pieces of unequal length."""
    shares = np.linspace(0.0, 1.0, pieces + 1)[1:] ** 2
    return [path[0], *(a + (b - a) * share for a, b in pairwise(path) for share in shares)]


@given(paths, widths, st.integers(1, 7))
def test_rate_independence(path: list[float], half_width: float, pieces: int) -> None:
    assert walk(finer(path, pieces), half_width)[::pieces] == pytest.approx(walk(path, half_width), abs=1e-12)


@given(paths, widths)
def test_slot_stays_around_the_motor_and_moves_no_more_than_it(path: list[float], half_width: float) -> None:
    slots = walk(path, half_width, path[0])
    for motor, z in zip(path, slots, strict=True):
        assert abs(motor - z) <= half_width + 1e-15
    for (a, b), (x, y) in zip(pairwise(path), pairwise(slots), strict=True):
        assert (y - x) * (b - a) >= 0.0
        assert abs(y - x) <= abs(b - a) + 1e-15


@given(angles, angles, paths, widths)
def test_two_histories_come_together(one: float, other: float, path: list[float], half_width: float) -> None:
    """The operator is a contraction: a common motion never takes two slots further apart."""
    gaps = [abs(a - b) for a, b in zip(walk(path, half_width, one), walk(path, half_width, other), strict=True)]
    assert all(after <= before + 1e-15 for before, after in pairwise([abs(one - other), *gaps]))


def test_dead_zone_and_contact() -> None:
    """Eqs 4–5: after a reversal the motor loses 2r, then moves the joint with its slope."""
    play = Play(slope=-0.9, half_width=0.05, offset=0.3)
    path = [1.0, 0.95, 0.901, 0.899, 0.7]
    joints = [float(joint_angle(z, play)) for z in walk(path, play.half_width)]
    assert joints[0] == pytest.approx(-0.9 * 0.95 + 0.3)
    assert joints[:3] == [joints[0]] * 3
    assert joints[4] - joints[3] == pytest.approx(-0.9 * (0.7 - 0.899))


def stack(path: list[float], half_widths: list[float], weights: list[float], offset: float = 0.0) -> np.ndarray:
    motor = np.array(path)
    return stack_joint(motor, plays(motor, np.array(half_widths)), np.array(weights), offset)


@given(paths, widths, st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_a_stack_of_one_is_the_play(path: list[float], half_width: float, slope: float, offset: float) -> None:
    play = Play(slope, half_width, offset)
    expected = [float(joint_angle(z, play)) for z in walk(path, half_width, path[0])]
    assert stack(path, [half_width], [0.0, slope], offset).tolist() == expected


HALF_WIDTHS, WEIGHTS = [0.05, 0.1, 0.3, 0.6], [0.4, 0.1, 0.2, 0.15, 0.1]


@given(paths)
def test_a_stack_with_positive_weights_is_monotone(path: list[float]) -> None:
    fine = finer(path, 5)
    steps = np.diff(stack(fine, HALF_WIDTHS, WEIGHTS))
    assert (steps * np.diff(fine) >= -1e-15).all()


@given(paths)
def test_mirrored_motion_gives_the_mirrored_joint(path: list[float]) -> None:
    mirrored = [-motor for motor in path]
    np.testing.assert_allclose(stack(mirrored, HALF_WIDTHS, WEIGHTS), -stack(path, HALF_WIDTHS, WEIGHTS), atol=1e-14)


@given(paths, st.sampled_from([-1.0, 1.0]), st.floats(0.0, 2.0))
def test_wiping_out(path: list[float], direction: float, depth: float) -> None:
    """A smaller excursion, once closed, is forgotten."""
    reached, far = path[-1] + 2.0 * direction, path[-1] + 3.0 * direction
    with_loop = stack([*path, reached, reached - depth * direction, reached, far], HALF_WIDTHS, WEIGHTS)
    assert with_loop[-1] == pytest.approx(stack([*path, far], HALF_WIDTHS, WEIGHTS)[-1], abs=1e-13)


@given(st.lists(angles, max_size=8), st.lists(angles, max_size=8), angles, st.floats(0.05, 1.0))
def test_congruency(one: list[float], other: list[float], low: float, span: float) -> None:
    """Minor loops between the same two motor angles have one shape, whatever went before; only their height differs."""
    loop = [low, low + span, low, low + 0.3 * span, low + span, low + 0.6 * span, low]
    shapes = [stack([*history, *loop], HALF_WIDTHS, WEIGHTS)[len(history) + 2 :] for history in (one, other)]
    np.testing.assert_allclose(shapes[0] - shapes[0][0], shapes[1] - shapes[1][0], atol=1e-13)
