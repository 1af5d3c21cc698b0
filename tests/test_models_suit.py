"""The suit's parts: the maps undo one another, a cable only pulls and only loses, the motor keeps its limits."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.core.units import RADIANS
from bowden.models.cable.backlash import push
from bowden.models.cable.bouc_wen import BoucWen, advance
from bowden.models.drive.geared_motor import (
    BAND,
    DEAD,
    FADING,
    TURNING,
    FrictionPush,
    GearedMotor,
    SpoolState,
    check_geared_motor,
    drive_motor,
    turn_push,
    turn_spool,
)
from bowden.models.drive.servo import Servo
from bowden.models.suit.flex_sensor import PAPER_FLEX, FlexSensor, FlexState, flex_start, flex_step
from bowden.models.suit.geometry import SuitGeometry, flexor_extension, flexor_moment_arm
from bowden.models.suit.suit_angle import HIGH, LOW, flexor_arm, flexor_travel, motor_of, spool_map, spool_of
from bowden.models.suit.suit_cable import (
    KINDS,
    Fabric,
    PreparedSuitCable,
    SuitCable,
    fabric_tension,
    give,
    prepare_suit_cable,
    pull_suit_cable,
    start_suit_cable,
)

GEOMETRY = SuitGeometry()
MAP = spool_map(GEOMETRY, 0.025)
FABRIC = Fabric(5000.0, 2e5, 0.0)


@given(st.floats(-6.0, 6.0))
def test_the_maps_undo_one_another_beyond_the_range_too(angle: float) -> None:
    assert motor_of(spool_of(angle, MAP), MAP) == pytest.approx(angle, abs=1e-13)
    assert spool_of(motor_of(angle, MAP), MAP) == pytest.approx(angle, abs=1e-13)


@given(st.floats(LOW, HIGH))
def test_the_travel_is_eq_1s(angle: float) -> None:
    assert flexor_travel(angle, MAP) == pytest.approx(
        flexor_extension(0.0, GEOMETRY) - flexor_extension(angle, GEOMETRY), abs=1e-15
    )
    assert flexor_arm(angle, MAP) == pytest.approx(flexor_moment_arm(angle, GEOMETRY), abs=1e-15)


@pytest.mark.parametrize("end", [LOW, HIGH])
def test_the_map_goes_on_without_a_kink(end: float) -> None:
    step = 1e-6
    before, after = (spool_of(end + side * step, MAP) - spool_of(end, MAP) for side in (-1.0, 1.0))
    assert after == pytest.approx(-before, rel=1e-5)


def made(kind: str, **changes: float) -> PreparedSuitCable:
    return prepare_suit_cable(SuitCable(kind=kind)._replace(**changes), FABRIC, math.pi, 20.0)


def ridden(
    cable: PreparedSuitCable, pulls: np.ndarray, given: np.ndarray, width: float = 1.0, slope_factor: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Tensions at motor and joint along a course."""
    memory, before = start_suit_cable(cable, pulls[0], given[0], slope_factor), pulls[0]
    tensions = []
    for pull, end in zip(pulls, given, strict=True):
        memory, tension = pull_suit_cable(cable, memory, before, pull, end, width, slope_factor)
        before = pull
        tensions.append(tension)
    motor, joint = np.array(tensions).T
    return motor, joint


@pytest.mark.parametrize("kind", KINDS)
def test_a_cable_only_pulls(kind: str) -> None:
    random = np.random.default_rng(1)
    pulls = np.cumsum(random.normal(0.0, 4e-4, 4000))
    motor, joint = ridden(made(kind), pulls, np.cumsum(random.normal(0.0, 4e-4, 4000)))
    assert motor.min() == 0.0
    assert joint.min() == 0.0
    assert motor.max() > 20.0


@pytest.mark.parametrize("kind", KINDS)
def test_at_rest_the_cable_has_its_pretension(kind: str) -> None:
    cable = made(kind)
    motor, joint = ridden(cable, np.zeros(2), np.zeros(2))
    assert motor == pytest.approx(20.0 * cable.slope)  # virtual work
    assert joint == pytest.approx(20.0)


@pytest.mark.parametrize("kind", ["play", "capstan"])
def test_a_free_cable_has_one_tension(kind: str) -> None:
    """No friction: two springs in series, exactly."""
    cable = made(kind, half_width=0.0, friction=0.0)
    motor, joint = ridden(cable, np.array([0.0, 0.004, 0.001, -0.002]), np.zeros(4))
    assert motor == pytest.approx(joint)
    for pull, tension in zip((0.0, 0.004, 0.001, -0.002), joint, strict=True):
        assert tension / cable.stiffness + give(tension, FABRIC) == pytest.approx(pull + cable.start)


def test_the_capstan_loses_its_share_of_force_by_direction() -> None:
    """Tension at the motor over that at the arm: e^(μθ) pulling, e^(−μθ) releasing."""
    share = math.exp(0.12 * math.pi)
    motor, joint = ridden(made("capstan"), np.array([0.0, 0.006, 0.012, 0.011, 0.006]), np.zeros(5))
    assert motor[2] / joint[2] == pytest.approx(share)
    assert motor[3] < motor[2]
    assert joint[3] == joint[2]  # the reversal is lost
    assert motor[4] / joint[4] == pytest.approx(1.0 / share)


def test_the_play_is_the_play_operator() -> None:
    """Against a stiff arm the node is pushed as Eqs 4–5 have it: a reversal loses 2r before the tension follows."""
    cable = made("play", half_width=0.002)
    pulls = np.concatenate([np.linspace(0.0, 0.012, 121), np.linspace(0.012, 0.0, 121)])
    _, joint = ridden(cable, pulls, np.zeros_like(pulls))
    turned = joint[120]
    still = np.flatnonzero(np.abs(joint[121:] - turned) < 1e-9)
    assert pulls[120] - pulls[121:][still[-1]] == pytest.approx(0.004, abs=2e-4)
    assert joint[-1] < turned - 1.0


def test_the_bouc_wen_cable_is_eq_6_before_its_springs() -> None:
    given = BoucWen(exponent=2.0, shape=1.5, rate=5.0)
    cable = made("bouc_wen")
    cable = prepare_suit_cable(SuitCable(kind="bouc_wen", bouc_wen=given), FABRIC, math.pi, 20.0)
    motor, joint = ridden(cable, np.array([0.0, 0.01]), np.zeros(2))
    h = advance(0.0, 0.01 / cable.radius, given)
    free = given.slope * 0.01 + given.hysteresis_gain * h * cable.radius + cable.start
    assert joint[1] / cable.stiffness + give(joint[1], FABRIC) == pytest.approx(free)
    assert motor[1] > given.slope * joint[1]


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(["play", "capstan"]), st.integers(0, 10_000), st.floats(0.2, 3.0))
def test_a_closed_course_never_gives_energy(kind: str, seed: int, width: float) -> None:
    """∮ T_m dx − ∮ T_j ds ≥ 0 however spool and arm move, by the rule that a convex spring's own work cannot beat."""
    random = np.random.default_rng(seed)
    corners = random.uniform(-0.01, 0.02, (7, 2))
    corners[0] = 0.0
    lap = np.concatenate([np.linspace(a, b, 400) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    course = np.concatenate([lap, lap])  # in the second lap it begins and ends in one state
    motor, joint = ridden(made(kind, half_width=0.0015), course[:, 0], course[:, 1], width)
    second = slice(len(lap), None)
    mean_m, mean_j = (0.5 * (t[second][1:] + t[second][:-1]) for t in (motor, joint))
    moved = np.diff(course[second], axis=0)
    assert float(np.sum(mean_m * moved[:, 0]) - np.sum(mean_j * moved[:, 1])) > -2e-4


@pytest.mark.parametrize("kind", KINDS)
def test_a_wider_sheath_is_another_cable_and_a_loss_takes_motion_and_tension_alike(kind: str) -> None:
    """By the play's half-width, the capstan's friction, or the lengths of Bouc–Wen's angles; and virtual work."""
    random = np.random.default_rng(3)
    pulls, given = np.cumsum(random.normal(0.0, 1e-3, (2, 300)), axis=1)
    wide = made(kind, half_width=0.003, friction=0.18, radius=1.5 * SuitCable().radius)
    assert wide == made(kind)._replace(
        half_width=0.003, capstan=0.18 * math.pi, radius=wide.radius, hysteresis_length=wide.hysteresis_length
    )
    np.testing.assert_allclose(ridden(made(kind), pulls, given, 1.5), ridden(wide, pulls, given), atol=1e-9)
    if kind != "bouc_wen":  # its h is driven by the motor's own way
        (motor, joint), (all_of, there) = ridden(wide, pulls, given, 1.0, 0.9), ridden(wide, 0.9 * pulls, given)
        np.testing.assert_allclose((motor, joint), (0.9 * all_of, there), atol=1e-9)


def test_how_a_course_is_cut_changes_nothing() -> None:
    coarse = np.array([0.0, 0.011, 0.003, 0.009])
    for kind in ("play", "capstan"):
        fine = np.concatenate([np.linspace(a, b, 500) for a, b in itertools.pairwise(coarse)])
        assert ridden(made(kind), coarse, np.zeros(4))[1][-1] == pytest.approx(
            ridden(made(kind), fine, np.zeros(1500))[1][-1], rel=1e-12
        )


@given(st.floats(0.0, 500.0))
def test_give_is_the_inverse_of_the_fabrics_tension(tension: float) -> None:
    assert fabric_tension(give(tension, FABRIC), FABRIC) == pytest.approx(tension, abs=1e-9)


@pytest.mark.parametrize(
    ("cable", "fabric", "pretension"),
    [
        (SuitCable(kind="rope"), FABRIC, 1.0),
        (SuitCable(stiffness=math.nan), FABRIC, 1.0),
        (SuitCable(half_width=-1.0), FABRIC, 1.0),
        (SuitCable(), Fabric(stiffness=0.0), 1.0),
        (SuitCable(), FABRIC, -1.0),
    ],
)
def test_cables_that_cannot_be_are_refused(cable: SuitCable, fabric: Fabric, pretension: float) -> None:
    with pytest.raises(ParameterError, match="suit"):
        prepare_suit_cable(cable, fabric, math.pi, pretension)


MOTOR = GearedMotor(servo=Servo(50.0, 0.7))
REST = SpoolState(0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.4)


@given(st.floats(-9.0, 9.0), st.floats(-20.0, 20.0), st.floats(-40.0, 40.0), st.floats(0.0, 50.0), st.floats(0.0, 9.0))
def test_the_spools_friction_holds_or_slows_it_and_never_turns_it_back(
    speed: float, current: float, load: float, stiffness: float, drag: float
) -> None:
    """Newton's law at the end of the step: what inertia, current, load and its stiffness leave is friction's."""
    dt, extending = 1e-3, 0.5
    torque = MOTOR.gear * MOTOR.torque_constant * current
    after = turn_spool(MOTOR, SpoolState(0.2, speed, current, *REST[3:]), load, stiffness, dt, drag, extending)
    taken = torque - load - dt * stiffness * after.velocity - MOTOR.inertia * (after.velocity - speed) / dt
    most = (
        MOTOR.friction + (1.0 - MOTOR.efficiency) * max(abs(torque), abs(load)) + (drag if taken > 0.0 else extending)
    )
    if after.velocity == 0.0:
        assert abs(taken) <= most * (1.0 + 1e-9)
    else:
        assert taken * math.copysign(1.0, after.velocity) == pytest.approx(most)
    assert after == (pytest.approx(0.2 + dt * after.velocity), after.velocity, current, *REST[3:])


@given(
    *(st.floats(-most, most) for most in (0.2, 50.0, 0.1, 1.0, 9.0)), st.floats(1.0, 50.0), st.sampled_from([0.2, 3.0])
)
def test_the_drive_is_a_pd_loop_within_what_current_and_supply_allow(
    error: float, speed: float, y: float, push: float, more: float, supply: float, resistance: float
) -> None:
    motor, dt = MOTOR._replace(integral=20.0, friction_feedforward=2.0, supply=supply, resistance=resistance), 1e-3
    after = drive_motor(motor, SpoolState(0.5, speed, 9.0, y, 0.5 + error, push, more), 0.5 + error, dt)
    omega, zeta = motor.servo.natural_frequency, motor.servo.damping
    constant, free = motor.gear * motor.torque_constant, push - push * dt / (FADING + dt)
    wanted = motor.inertia * (omega**2 * (error + y) - 2.0 * zeta * omega * speed) + 2.0 * free + more
    ends = [(sign * motor.supply - constant * speed) / motor.resistance for sign in (-1.0, 1.0)]
    low, high = max(-motor.current_limit, ends[0]), min(motor.current_limit, ends[1])
    assert after.current == pytest.approx(max(low, min(high, wanted / constant)))
    acts = abs(error) > BAND and low < wanted / constant < high
    assert after.offset == pytest.approx(y + (dt * 20.0 * error if acts else 0.0))
    assert after[:2] + after[4:] == (0.5, speed, 0.5 + error, pytest.approx(free), more)


@given(st.floats(-0.02, 0.02), st.floats(-1.0, 1.0), st.floats(1e-4, 0.1))
def test_the_push_turns_with_the_target_beyond_its_noise_and_fades_where_that_rests(
    way: float, direction: float, dt: float
) -> None:
    """The target behind a play of `DEAD`, and a lag of the first order, by backward Euler."""
    after = turn_push(FrictionPush(0.3, direction), 0.3 + way, dt)
    assert after.settled_target == push(0.3, 0.3 + way, DEAD)
    turns = after.settled_target - 0.3
    lag, goal = (TURNING, math.copysign(1.0, turns)) if turns else (FADING, 0.0)
    assert (after.direction - direction) / dt == pytest.approx((goal - after.direction) / lag, abs=1e-9)
    assert turn_push(after, math.nan, dt).settled_target == after.settled_target


def test_the_feed_forward_of_friction_takes_away_what_the_pd_loop_leaves_both_ways() -> None:
    """Told what friction takes of the torque, F/η, the spool follows a ramp as a servo without friction does."""
    motor = MOTOR._replace(friction_feedforward=MOTOR.friction / MOTOR.efficiency)
    state, lag, speed = SpoolState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 2.0 * 0.7 / 50.0, 0.5
    for way in (1.0, -1.0):
        target = state.settled_target
        for _ in range(20_000):
            target += way * speed * 1e-4
            state = turn_spool(motor, drive_motor(motor, state, target, 1e-4), 0.0, 0.0, 1e-4)
        assert target - state.position == pytest.approx(lag * way * speed, abs=0.002)


@pytest.mark.parametrize(
    "field", ["gear", "efficiency", "friction", "supply", "inertia", "integral", "friction_feedforward"]
)
def test_motors_that_cannot_be_are_refused(field: str) -> None:
    for value in (math.nan, -1.0):
        with pytest.raises(ParameterError, match=field):
            check_geared_motor(MOTOR._replace(**{field: value}))


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.01, 9.0))
def test_a_flex_sensor_is_a_play_with_a_drift_that_forgets_behind_its_scale(
    angle: float, normal: float, wander: float, dt: float
) -> None:
    sensor, state = FlexSensor(0.1, 0.2, 0.3, 0.4, 5.0, 0.6, 0.0), FlexState(0.5, 0.7)
    after, seen = flex_step(sensor, state, angle, normal, wander, dt)
    assert after.slot == push(0.5, angle, 0.15)
    kept = math.exp(-dt / 5.0)
    assert after.drift == pytest.approx(0.7 * kept + 0.4 * wander * math.sqrt(1.0 - kept**2))
    assert seen == pytest.approx(1.1 * after.slot + 0.2 + after.drift + 0.6 * normal)
    steps = flex_step(sensor._replace(resolution=0.01), state, angle, normal, wander, dt)[1] / 0.01
    assert steps == pytest.approx(round(steps), abs=1e-6)
    assert abs(0.01 * steps - seen) <= 0.005 * (1.0 + 1e-9)
    assert flex_start(angle) == (angle, 0.0)


def test_the_papers_flex_sensor_is_within_its_degree() -> None:
    """Loop, drift, noise and steps, with the largest zero and scale of a wearer, over ten minutes."""
    random, sensor = np.random.default_rng(3), PAPER_FLEX._replace(offset=0.2 * RADIANS, gain=0.002)
    state, errors = flex_start(0.0), []
    step = compiled(flex_step)
    for k in range(60_000):
        angle = 45.0 * RADIANS * (1.0 - math.cos(0.25 * k * 0.01))
        state, seen = step(sensor, FlexState(*state), angle, *random.normal(size=2), 0.01)
        errors.append(seen - angle)
    assert (np.abs(np.array(errors)) < 1.0 * RADIANS).mean() > 0.97
