"""The sliding tendon against the closed form of capstan friction, and what any tendon in a sheath obeys."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.models.cable import capstan, sliding_cable
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.sliding_cable import PreparedTendon, TendonMemory, prepare_tendon

START, ADVANCE = compiled(sliding_cable.start_tendon), compiled(sliding_cable.advance_tendon)
TENSION, MOTOR_TENSION = compiled(sliding_cable.tension), compiled(sliding_cable.motor_tension)
JOINT = compiled(sliding_cable.tendon_joint)
EVEN = Tendon()
UNEVEN = Tendon(profile=(0.0, 3.0, 1.0, 0.5), elements=40)
PREPARED = prepare_tendon(Tendon(elements=12))
paths = st.lists(st.floats(-0.6, 2.0), min_size=1, max_size=8)
widths = st.floats(0.2, 2.0)


def walk(tendon: PreparedTendon, path: list[float], width: float = 1.0, start: float = 0.0) -> TendonMemory:
    memory = START(tendon, start, width)
    for motor in path:
        ADVANCE(tendon, memory, motor, width)
    return memory


def copy(memory: TendonMemory) -> TendonMemory:
    return TendonMemory(*(array.copy() for array in memory))


def tensions(tendon: PreparedTendon, memory: TendonMemory) -> np.ndarray:
    """Of every element and the spring (n + 1,) [N]."""
    return np.array([TENSION(tendon, memory, i) for i in range(memory.moved.size)])


@pytest.mark.parametrize("tendon", [EVEN, UNEVEN, Tendon(friction=0.0)], ids=["even", "uneven", "smooth"])
@pytest.mark.parametrize("pulling", [True, False])
def test_compliance_is_the_integral_of_the_capstan_equation(tendon: Tendon, pulling: bool) -> None:
    shares = capstan.pieces(tendon)

    def stretch(s: float) -> float:
        """T(s)/(EA·T_out): the friction between s and the joint, integrated anew."""
        at = s / tendon.length * len(shares)
        ahead = float(np.interp(len(shares), range(len(shares) + 1), np.cumsum([0.0, *shares])))
        ahead -= float(np.interp(at, range(len(shares) + 1), np.cumsum([0.0, *shares])))
        return math.exp(ahead if pulling else -ahead) / tendon.stiffness

    expected, _ = quad(stretch, 0.0, tendon.length, points=np.linspace(0.0, 1.0, len(shares) + 1)[1:-1])
    assert capstan.compliance(tendon, pulling=pulling) == pytest.approx(expected, rel=1e-9)


def test_dead_zone_of_one_piece() -> None:
    """2·T·L/EA·(cosh M − 1)/M; 5.6° in the middle of the stroke, as the defaults promise."""
    total, tension = 0.15 * math.pi, (0.1 + 0.2 * math.radians(35.0)) / 0.01
    expected = 2.0 * tension / 1.1e4 * (math.cosh(total) - 1.0) / total / 0.01
    assert capstan.dead_zone(EVEN, math.radians(35.0)) == pytest.approx(expected, rel=1e-12)
    assert math.degrees(expected) == pytest.approx(5.555, abs=1e-3)


@pytest.mark.parametrize("tendon", [EVEN, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("pulling", [True, False])
def test_capstan_ratio(tendon: Tendon, pulling: bool) -> None:
    prepared = prepare_tendon(tendon)
    memory = walk(prepared, [1.5] if pulling else [1.5, 0.6])
    ratio = tensions(prepared, memory)[-1] / MOTOR_TENSION(prepared, memory)
    assert ratio == pytest.approx(capstan.tension_ratio(tendon, pulling=pulling), rel=1e-12)
    assert ratio == pytest.approx(math.exp((-1.0 if pulling else 1.0) * 0.15 * math.pi), rel=1e-12)


def slope_found(tendon: Tendon, pulling: bool) -> float:
    prepared = prepare_tendon(tendon)
    memory = walk(prepared, [1.5] if pulling else [1.8, 1.0])
    before = JOINT(prepared, memory)
    ADVANCE(prepared, memory, 1.7 if pulling else 0.8, 1.0)
    return (JOINT(prepared, memory) - before) / (0.2 if pulling else -0.2)


def dead_zone_found(tendon: Tendon) -> float:
    """Motor travel from the turn to where the releasing branch, a straight line, leaves the joint's resting angle."""
    prepared = prepare_tendon(tendon)
    memory = walk(prepared, [1.5])
    joint = JOINT(prepared, memory)
    ADVANCE(prepared, memory, 0.9, 1.0)
    return 0.6 - (joint - JOINT(prepared, memory)) / slope_found(tendon, pulling=False)


CUTS = (8, 16, 32, 64)


@pytest.mark.parametrize("tendon", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_branches_and_dead_zone_converge_with_the_square_of_the_grid(tendon: Tendon) -> None:
    for pulling in (True, False):
        exact = capstan.slope(tendon, pulling=pulling)
        errors = [abs(slope_found(tendon._replace(elements=n), pulling) - exact) for n in CUTS]
        assert errors[-1] < 1e-5 * exact
        assert [a / b for a, b in pairwise(errors)] == pytest.approx([4.0] * 3, rel=0.05)
    zones = [tendon._replace(elements=n) for n in CUTS]
    errors = []
    for cut in zones:
        prepared = prepare_tendon(cut)
        errors.append(
            abs(dead_zone_found(cut) / capstan.dead_zone(tendon, JOINT(prepared, walk(prepared, [1.5]))) - 1.0)
        )
    assert errors[-1] < 2e-4
    assert [a / b for a, b in pairwise(errors)] == pytest.approx([4.0] * 3, rel=0.1)


@pytest.mark.parametrize("length", [1.0, 2.5])
def test_right_after_a_turn_the_release_has_reached_as_far_as_the_closed_form_says(length: float) -> None:
    tendon = Tendon(elements=600, length=length)
    prepared = prepare_tendon(tendon)
    memory = walk(prepared, [1.5])
    joint, before = JOINT(prepared, memory), MOTOR_TENSION(prepared, memory)
    for share in (0.1, 0.4, 0.9):
        back = share * capstan.dead_zone(tendon, joint)
        ADVANCE(prepared, memory, 1.5 - back, 1.0)
        expected = capstan.tension_after_reversal(tendon, before, back * tendon.motor_radius)
        assert MOTOR_TENSION(prepared, memory) == pytest.approx(expected, rel=2e-3)


def finer(path: list[float], pieces: int, start: float = 0.0) -> list[float]:
    shares = np.linspace(0.0, 1.0, pieces + 1)[1:] ** 2
    return [a + (b - a) * share for a, b in pairwise([start, *path]) for share in shares]


@given(paths, st.integers(2, 9))
def test_rate_independence(path: list[float], pieces: int) -> None:
    whole, cut = walk(PREPARED, path), walk(PREPARED, finer(path, pieces))
    np.testing.assert_allclose(cut.moved, whole.moved, atol=1e-15)


def held(tendon: PreparedTendon, memory: TendonMemory, width: float) -> bool:
    """No tension below zero, and no node beyond the capstan's ratio."""
    pulls = tensions(tendon, memory)
    near, far, most = pulls[:-1], pulls[1:], np.exp(width * tendon.angles[1:])
    loose = 2e-9  # twice what a node is allowed
    return bool((pulls >= 0.0).all() and (far <= most * near + loose).all() and (near <= most * far + loose).all())


@given(st.lists(st.tuples(st.floats(-0.6, 2.0), widths), min_size=1, max_size=8))
def test_tension_stays_above_zero_and_inside_the_capstan_ratio(path: list[tuple[float, float]]) -> None:
    """Also when the sheath is bent and straightened on the way."""
    memory = START(PREPARED, 0.0, 1.0)
    for motor, width in path:
        ADVANCE(PREPARED, memory, motor, width)
        assert held(PREPARED, memory, width)


def test_bending_the_sheath_holds_the_tendon_and_straightening_it_lets_go() -> None:
    memory = walk(PREPARED, [1.5, 1.2])
    before = memory.moved.copy()
    ADVANCE(PREPARED, memory, 1.2, 2.0)
    assert memory.moved.tolist() == before.tolist()
    ADVANCE(PREPARED, memory, 1.2, 1e-9)
    free = START(PREPARED, 1.2, 1.0)  # one tension all along
    np.testing.assert_allclose(memory.moved, free.moved, atol=1e-10)


@given(paths)
def test_a_smaller_excursion_once_closed_is_forgotten(path: list[float]) -> None:
    far = walk(PREPARED, [*path, 2.1, 2.6])
    through = walk(PREPARED, [*path, 2.1, 2.6, 2.3, 2.5, 2.4, 2.6])
    np.testing.assert_allclose(through.moved, far.moved, atol=1e-14)


def stored(tendon: PreparedTendon, memory: TendonMemory) -> float:
    """Elastic energy of the elements and of the joint's spring, over its rest [J]."""
    *elements, spring = tensions(tendon, memory)
    return sum(force**2 for force in elements) / (2.0 * tendon.element) + spring**2 / (2.0 * tendon.end)


@given(paths)
def test_every_move_costs_energy(path: list[float]) -> None:
    """Work of the motor's end less what is stored: friction never gives any back."""
    memory = START(PREPARED, 0.0, 1.0)
    now, pull, lost = stored(PREPARED, memory), TENSION(PREPARED, memory, 0), 0.0
    last = 0.0
    for motor in finer(path, 60):
        ADVANCE(PREPARED, memory, motor, 1.0)
        after, force = stored(PREPARED, memory), TENSION(PREPARED, memory, 0)
        # straight inside a step but for where a node begins to slide, which the mean of the forces then overestimates
        step = 0.5 * (pull + force) * (motor - last) * PREPARED.motor_radius - (after - now)
        kink = abs(force - pull) * abs(motor - last) * PREPARED.motor_radius
        assert step >= -kink - 1e-12
        lost, now, pull, last = lost + step, after, force, motor
    assert lost >= -1e-4


def test_a_slack_tendon_moves_nothing_until_it_is_taken_up() -> None:
    tendon = prepare_tendon(Tendon(pretension=0.0, slack=1e-3))
    memory = START(tendon, 0.0, 1.0)
    for motor in (0.02, 0.07, 0.03, 0.0999):  # 1 mm is 0.1 rad of the spool
        ADVANCE(tendon, memory, motor, 1.0)
        assert JOINT(tendon, memory) == pytest.approx(0.0, abs=1e-15)
        assert tensions(tendon, memory) == pytest.approx(0.0, abs=1e-9)
    ADVANCE(tendon, memory, 0.2, 1.0)
    assert JOINT(tendon, memory) == pytest.approx(0.1 * capstan.slope(Tendon(), pulling=True), rel=1e-3)
    ADVANCE(tendon, memory, 0.05, 1.0)
    assert JOINT(tendon, memory) == pytest.approx(0.0, abs=1e-15)
    assert MOTOR_TENSION(tendon, memory) == 0.0


def test_a_released_spring_rests_where_it_does() -> None:
    """The joint cannot be pushed: below −pretension/spring the tendon only goes slack."""
    memory = walk(PREPARED, [1.0, -2.0])
    assert JOINT(PREPARED, memory) == pytest.approx(-0.1 / 0.2)
    assert tensions(PREPARED, memory) == pytest.approx(0.0, abs=1e-9)


def test_without_friction_it_is_a_spring() -> None:
    smooth = Tendon(friction=0.0)
    prepared = prepare_tendon(smooth)
    loose = capstan.slope(smooth, pulling=True)
    for path in ([1.0], [1.0, 0.3], [1.5, -0.2, 0.7]):
        assert JOINT(prepared, walk(prepared, path)) == pytest.approx(loose * path[-1], rel=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"length": 0.0},
        {"stiffness": -1.0},
        {"friction": -0.1},
        {"friction": math.nan},
        {"bend": math.inf},
        {"slack": -1e-3},
        {"elements": 0},
        {"profile": ()},
        {"profile": (0.0, 0.0)},
        {"profile": (1.0, -1.0)},
        {"profile": (1.0, math.nan)},
        {"profile": (3.0, -1.0)},
    ],
)
def test_absurd_tendons_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match="expected"):
        prepare_tendon(Tendon()._replace(**change))
