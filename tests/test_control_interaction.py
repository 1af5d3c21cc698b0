"""The torque without a load cell: against a suit that the test computes itself, and what is not known is said so."""

import numpy as np
import pytest

from bowden.control.admittance.interaction import Chain, Doubt, InteractionState, interaction_start, interaction_step
from bowden.core.kernel import compiled
from bowden.models.cable.sheath import Sheath
from bowden.models.suit.geometry import SuitGeometry
from bowden.models.suit.suit_angle import flexor_arm, flexor_travel, spool_map, spool_of

MAP = spool_map(SuitGeometry(), 0.025)
CHAIN = Chain(
    map=MAP,
    extensor_radius=0.0213,
    joint_radius=0.05,
    torque_constant=0.4175,
    friction=0.0,
    loss=0.0,
    cable=8000.0,
    fabric=8000.0,
    flesh=0.0,
    half_width=0.0,
    start=25.0 / 4000.0,
)
RADIUS = CHAIN.extensor_radius


def springs(spool: float, joint: float) -> tuple[float, float]:
    """Tensions of flexor and extensor where nothing rubs: both springs in series."""
    flexor = 4000.0 * (0.025 * spool + CHAIN.start - flexor_travel(joint, MAP))
    extensor = 4000.0 * (-RADIUS * spool + CHAIN.start + 0.05 * joint)
    return max(0.0, flexor), max(0.0, extensor)


def settled(chain: Chain, spool: float, joint: float, current: float) -> InteractionState:
    state = interaction_start(chain, spool, joint)
    for _ in range(400):
        state = interaction_step(chain, Doubt(), state, spool, joint, current, 1e-3)
    return state


@pytest.mark.parametrize(("motor", "joint"), [(0.8, 0.7), (0.5, 0.7), (1.2, 1.2), (0.1, 0.4)])
def test_without_friction_both_estimates_are_the_springs(motor: float, joint: float) -> None:
    spool = float(spool_of(motor, MAP))
    flexor, extensor = springs(spool, joint)
    truth = flexor * float(flexor_arm(joint, MAP)) - extensor * 0.05
    current = (0.025 * flexor - RADIUS * extensor) / CHAIN.torque_constant
    state = settled(CHAIN, spool, joint, current)
    assert state.from_stretch == pytest.approx(truth, abs=1e-9)
    assert state.from_current == pytest.approx(truth, abs=1e-3 + 1e-3 * abs(truth))
    assert state.torque == pytest.approx(truth, abs=1e-3 + 1e-3 * abs(truth))


def test_flesh_damps_by_the_levers_of_the_taut_cables() -> None:
    """What the padding gives way is no torque on the elbow: flesh·(arm² + radius²)·rate, of a cable that pulls."""
    soft, rate = CHAIN._replace(flesh=300.0), 0.4
    states = [interaction_start(chain, float(spool_of(0.8, MAP)), 0.5) for chain in (CHAIN, soft)]
    joint = 0.5
    for _ in range(500):
        joint += rate * 1e-3
        spool = float(spool_of(joint, MAP))
        pair = zip((CHAIN, soft), states, strict=True)
        states = [interaction_step(chain, Doubt(), state, spool, joint, 1.0, 1e-3) for chain, state in pair]
    flexor, extensor = springs(spool, joint)
    taut = [pull / (pull + 1.0) for pull in (flexor, extensor)]
    damping = 300.0 * (taut[0] * float(flexor_arm(joint, MAP)) ** 2 + taut[1] * 0.05**2) * rate
    assert damping > 0.1
    for name in ("from_stretch", "from_current", "torque"):
        assert getattr(states[0], name) - getattr(states[1], name) == pytest.approx(damping, rel=1e-3)


@pytest.mark.parametrize(("motor", "joint"), [(0.8, 0.7), (0.5, 0.7), (0.1, 0.4)])
def test_the_doubt_of_the_stretch_is_what_the_doubt_of_the_angle_comes_to_at_the_elbow(
    motor: float, joint: float
) -> None:
    """The springs' torque at an angle that is off by the doubt; of the friction so little is known that it is alone."""
    angle, spool = 1e-3, float(spool_of(motor, MAP))
    alone = Doubt(angle=angle, stiffness=0.0, play=0.0, friction=1e6)
    state = interaction_start(CHAIN, spool, joint)
    for _ in range(3):
        state = interaction_step(CHAIN._replace(friction=1.0), alone, state, spool, joint, 0.0, 1e-3)
    (up, over), (down, under) = springs(spool, joint + angle), springs(spool, joint - angle)
    stiffness = (up - down) * float(flexor_arm(joint, MAP)) - (over - under) * 0.05
    assert state.doubt == pytest.approx(0.5 * abs(stiffness), rel=0.1)


def test_play_is_taken_from_the_side_from_which_the_motor_came() -> None:
    rough = CHAIN._replace(half_width=0.002)
    joint, ends = 0.7, []
    for way in (1.0, -1.0):
        state = interaction_start(rough, float(spool_of(joint, MAP)) - 0.6 * way, joint)
        for step in np.linspace(-0.6 * way, 0.0, 500):
            state = interaction_step(rough, Doubt(), state, float(spool_of(joint, MAP)) + step, joint, 0.0, 1e-3)
        ends.append(state.from_stretch)
    # each cable's arm side lags by k·r/2 of its spring: 8 N, at the levers of both
    lost = 0.5 * 8000.0 * 0.002 * (float(flexor_arm(joint, MAP)) + 0.05)
    assert ends[1] - ends[0] == pytest.approx(2.0 * lost, rel=1e-6)


def test_the_sheath_that_the_elbow_bends_takes_motion_away() -> None:
    """With a loss of 16 % and 0.3 rad of bend a radian, the springs are stretched by 0.984 of the travel at 1.0 rad."""
    sheath, joint = Sheath(loss=0.16), 1.0
    bent = CHAIN._replace(sheath=sheath, posture=0.3)
    slope = 1.0 - 0.16 * 0.3 * joint / np.pi
    spool = float(spool_of(1.2, MAP))
    flexor, extensor = springs(slope * spool, joint)
    truth = flexor * float(flexor_arm(joint, MAP)) - extensor * 0.05
    current = slope * (0.025 * flexor - RADIUS * extensor) / CHAIN.torque_constant
    state = settled(bent, spool, joint, current)
    assert state.from_stretch == pytest.approx(truth, abs=1e-9)
    assert state.from_current == pytest.approx(truth, abs=1e-3)


def test_a_motor_that_stands_still_leaves_the_current_in_doubt() -> None:
    rubbing = CHAIN._replace(friction=2.3, loss=0.2)
    still = settled(rubbing, 1.5, 0.7, 3.0)
    moving = still
    for k in range(300):
        moving = interaction_step(rubbing, Doubt(), moving, 1.5 + 1e-3 * k, 0.7, 3.0, 1e-3)
    heard = [(s.torque - s.from_stretch) / (s.from_current - s.from_stretch) for s in (still, moving)]
    assert 0.0 < heard[0] < 0.05  # its weight in the mean
    assert heard[1] > 3.0 * heard[0]


def test_friction_is_taken_off_against_the_motion() -> None:
    rubbing = CHAIN._replace(friction=2.0)
    found = []
    for way in (1.0, -1.0):
        state = interaction_start(rubbing, 1.5, 0.7)
        for k in range(300):
            state = interaction_step(rubbing, Doubt(), state, 1.5 + way * 1e-4 * k, 0.7, 2.0, 1e-3)
        found.append(state)
    lever = float(flexor_arm(0.7, MAP))
    expected = 2.0 * 2.0 * lever / 0.025  # twice the friction, at the elbow
    moved = found[0].from_stretch - found[1].from_stretch  # the extensor that is taken from the model moves too
    assert found[1].from_current - found[0].from_current == pytest.approx(expected, rel=0.1, abs=2.0 * abs(moved))


def test_a_reading_that_is_no_number_is_no_torque_and_is_forgotten() -> None:
    state = settled(CHAIN, 1.5, 0.7, 1.0)
    for bad in ((np.nan, 0.7, 1.0), (1.5, np.nan, 1.0), (1.5, 0.7, np.inf)):
        lost = interaction_step(CHAIN, Doubt(), state, *bad, 1e-3)
        assert np.isnan(lost.torque)
        again = interaction_step(CHAIN, Doubt(), lost, 1.5, 0.7, 1.0, 1e-3)
        assert again.torque == pytest.approx(state.torque, abs=1e-6)


def test_compiled_and_interpreted_are_the_same_bits() -> None:
    random, chain = np.random.default_rng(5), CHAIN._replace(friction=2.3, loss=0.2, half_width=0.002, flesh=190.0)
    state, twin = interaction_start(chain, 1.0, 0.5), compiled(interaction_step)
    fast = state
    for k in range(500):
        given = (1.0 + np.sin(0.02 * k), 0.5 + 0.4 * np.sin(0.02 * k - 0.1), float(random.normal(0.0, 5.0)))
        given = (np.nan, *given[1:]) if k == 250 else given
        state = interaction_step(chain, Doubt(), state, *map(float, given), 1e-3)
        fast = twin(chain, Doubt(), fast, *map(float, given), 1e-3)
        assert np.array_equal(state, fast, equal_nan=True)
