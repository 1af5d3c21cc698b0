"""The torque without a load cell: against a suit that the test computes itself, and what is not known is said so."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.control.admittance.interaction import Chain, Doubt, InteractionState, interaction_start, interaction_step
from bowden.models.cable.sheath import Sheath, slope_factor, width
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


ROUGH = CHAIN._replace(friction=2.3, loss=0.2, cable=7000.0, flesh=190.0, half_width=0.002, posture=0.3)
ROUGH = ROUGH._replace(sheath=Sheath(bend=3.0, gap=1.3, loss=0.16))
angles, lengths = st.floats(0.0, 2.0), st.floats(-0.01, 0.02)


@given(angles, angles, lengths, lengths, st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-20.0, 20.0))
def test_a_step_is_the_balance_of_springs_play_and_drive_and_each_estimate_counts_by_its_doubt(
    spool: float, joint: float, flexor: float, extensor: float, turned: float, rate: float, current: float
) -> None:
    """In a sheath that the elbow bends, from any state: the equations of the module's text."""
    k, fabric, dt, doubt = ROUGH.cable, ROUGH.fabric, 1e-3, Doubt()
    begun = interaction_start(ROUGH, spool - 0.02 * turned, joint - 1e-3 * rate)
    begun = begun._replace(spool_rate=turned, joint_rate=0.5, current=3.0, flexor_node=flexor, extensor_node=extensor)
    after = interaction_step(ROUGH, doubt, begun, spool, joint, current, dt)
    for name, now in (("spool_rate", 20.0 * turned), ("joint_rate", rate), ("current", current)):
        went, smooth = getattr(after, name) - getattr(begun, name), getattr(after, name)
        assert went / dt == pytest.approx((now - smooth) / doubt.smoothing, abs=1e-6)

    bend = ROUGH.sheath.bend + ROUGH.posture * joint
    slope, rubs = slope_factor(bend, ROUGH.sheath), k * ROUGH.half_width * width(bend, ROUGH.sheath)
    levers, radii = (float(flexor_arm(joint, MAP)), -0.05), (slope * 0.025, -slope * RADIUS)
    ends, motors, arms = (float(flexor_travel(joint, MAP)), -0.05 * joint), [], []
    for node, before, end, radius in zip(after[5:7], (flexor, extensor), ends, radii, strict=True):
        motors.append(k * max(0.0, radius * spool + ROUGH.start - node))
        arms.append(fabric * max(0.0, node - end))
        assert abs(motors[-1] - arms[-1]) <= rubs * (1.0 + 1e-9)
        if abs(node - before) > 1e-12:  # it goes no further than it must
            assert (motors[-1] - arms[-1]) * np.sign(node - before) == pytest.approx(rubs)

    taut = [arm / (arm + 1.0) for arm in arms]
    square, alone = np.dot(taut, np.square(levers)), np.dot(taut, np.abs(levers))
    damping = ROUGH.flesh * square * after.joint_rate
    assert after.from_stretch == pytest.approx(np.dot(levers, arms) - damping)
    driven, direction = ROUGH.torque_constant * after.current, np.tanh(after.spool_rate / doubt.turning)
    load = driven - direction * (ROUGH.friction + ROUGH.loss * abs(driven))
    flexor_pull = (load - radii[1] * motors[1]) / radii[0] - (motors[0] - arms[0])
    assert after.from_current == pytest.approx(levers[0] * max(0.0, flexor_pull) + levers[1] * arms[1] - damping)
    soft = k * fabric / (k + fabric)
    doubts = [soft * square * doubt.angle + doubt.stiffness * abs(after.from_stretch + damping)]
    doubts[0] += doubt.play * soft * rubs / k * alone
    doubts.append(levers[0] / radii[0] * ROUGH.friction * np.hypot(doubt.friction, np.sqrt((1 - direction**2) / 3.0)))
    weights = 1.0 / (np.array(doubts) + 1e-6) ** 2
    assert after.torque == pytest.approx(np.average([after.from_stretch, after.from_current], weights=weights))
    assert after.doubt == pytest.approx(weights.sum() ** -0.5)


def test_it_begins_in_the_middle_of_the_play_where_both_springs_pull_alike() -> None:
    begun = interaction_start(ROUGH, 1.5, 0.7)
    slope = slope_factor(ROUGH.sheath.bend + ROUGH.posture * 0.7, ROUGH.sheath)
    for node, radius, end in zip(begun[5:7], (0.025, -RADIUS), (flexor_travel(0.7, MAP), -0.05 * 0.7), strict=True):
        pull = ROUGH.fabric * (node - end)
        assert pull == pytest.approx(ROUGH.cable * (slope * radius * 1.5 + ROUGH.start - node))


def test_a_reading_that_is_no_number_is_no_torque_and_is_forgotten() -> None:
    state = settled(CHAIN, 1.5, 0.7, 1.0)
    for bad in ((np.nan, 0.7, 1.0), (1.5, np.nan, 1.0), (1.5, 0.7, np.inf)):
        lost = interaction_step(CHAIN, Doubt(), state, *bad, 1e-3)
        assert np.isnan(lost.torque)
        again = interaction_step(CHAIN, Doubt(), lost, 1.5, 0.7, 1.0, 1e-3)
        assert again.torque == pytest.approx(state.torque, abs=1e-6)
