"""The suit on an arm: statics by hand, energy that only friction takes, geometry alone without it, convergence."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, kernel
from bowden.core.nested import flat
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.sheath import Sheath, slope_factor
from bowden.models.drive.encoder import Encoder, reading
from bowden.models.drive.geared_motor import SpoolState, drive_motor, turn_spool
from bowden.models.drive.holding_brake import HoldingBrake
from bowden.models.drive.thermal import warm
from bowden.models.suit.arm import GRAVITY, Arm, Wearer, gravity_torque, passive_torque, wearer_torque
from bowden.models.suit.flex_sensor import PAPER_FLEX, FlexSensor, flex_step
from bowden.models.suit.geometry import extensor_extension, flexor_extension
from bowden.models.suit.load_cell import CURRENT_NOISE, cell_reading
from bowden.models.suit.suit_angle import flexor_arm, flexor_travel, spool_of
from bowden.models.suit.suit_cable import TAUT, Fabric, Pull, fabric_tension, give, pull_suit_cable, start_suit_cable
from bowden.plants.plant import sheath_path, sheath_state
from bowden.plants.pushing import friction_of
from bowden.plants.suit_parts import Suit, prepare_suit
from bowden.plants.suit_plant import STOP_DAMPING, STOP_STIFFNESS, Bends, SuitState, suit_motor, suit_start, suit_step
from bowden.plants.suit_settings import SuitSettings
from bowden.plants.worn_suit import elbow_dead_zone
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from bowden.sim.run import simulate

SUIT = Suit()
MOTION = PeriodicMinimumJerk(0.0, 90.0 * RADIANS, 10.0)


def frictionless(suit: Suit = SUIT) -> Suit:
    """No friction anywhere, and nothing that stretches much."""
    cable = suit.flexor._replace(half_width=0.0, stiffness=1e6)
    return suit._replace(
        motor=suit.motor._replace(
            friction=0.0, efficiency=1.0, servo=suit.motor.servo._replace(natural_frequency=400.0)
        ),
        flexor=cable,
        extensor=cable,
        fabric=Fabric(1e6, 0.0, 500.0),
        posture=0.0,
        joint_sensor=FlexSensor(),
    )


def settled(suit: Suit, motor: float, seconds: float = 4.0, wearer: Wearer | None = None) -> SuitState:
    made = prepare_suit(suit)
    return after(made, suit_start(made, motor, motor, math.pi), motor, True, wearer or suit.wearer, seconds)


@kernel
def stepped(made: Any, state: SuitState, motor: float, powered: bool, wearer: Wearer, cycles: int) -> SuitState:
    for _ in range(cycles):
        state = suit_step(made, state, motor, powered, Bends(math.pi, math.pi), wearer, 1e-3)
    return state


def after(made: Any, state: SuitState, motor: float, powered: bool, wearer: Wearer, seconds: float) -> SuitState:
    """The suit so much later, its sheaths still."""
    return SuitState(*compiled(stepped)(made, state, motor, powered, wearer, round(1000.0 * seconds)))


@cache
def run(kind: str = "play", law: str = "uncompensated", substeps: int = 10) -> Trace:
    cable = SUIT.flexor._replace(kind=kind)
    suit = SUIT._replace(flexor=cable, extensor=cable, substeps=substeps)
    return simulate(suit, LAWS[law], MOTION, duration=20.0 if substeps == 10 else 7.0)


@pytest.mark.parametrize("motor_deg", [10.0, 30.0, 60.0, 80.0, 90.0])
def test_without_friction_and_give_the_elbow_is_where_the_geometry_says(motor_deg: float) -> None:
    """Where the extensor is slack the flexor decides alone; where both are taut they share the difference."""
    suit = frictionless()._replace(pretension=0.0, arm=SUIT.arm._replace(stiffness=0.0))
    made, state = prepare_suit(suit), settled(suit, motor_deg * RADIANS)
    by_extensor = made.extensor_radius * state.spool.position / made.joint_radius * DEGREES
    assert suit_motor(made, state) * DEGREES == pytest.approx(motor_deg, abs=1.0)  # it yields to what pulls
    if by_extensor > motor_deg:
        assert state.joint * DEGREES == pytest.approx(motor_deg, abs=0.3)
        assert state.extensor_pull.joint == 0.0
    else:
        assert by_extensor < state.joint * DEGREES < motor_deg
        assert state.extensor_pull.joint > 0.0


def energy(suit: Suit, state: SuitState) -> float:
    """Kinetic and stored: spool, forearm, weight, elbow, fabric and cables [J]."""
    made, arm = prepare_suit(suit), suit.arm
    stored = 0.5 * suit.motor.inertia * state.spool.velocity**2 + 0.5 * arm.inertia * state.joint_velocity**2
    stored -= arm.mass * GRAVITY * arm.centre * math.cos(state.joint + arm.elevation)
    stored += 0.5 * arm.stiffness * (state.joint - arm.neutral) ** 2
    geometry = suit.geometry
    ends = (
        flexor_extension(0.0, geometry) - flexor_extension(state.joint, geometry),
        extensor_extension(0.0, geometry) - extensor_extension(state.joint, geometry),
    )
    for cable, memory, pull, end in zip(
        (made.flexor, made.extensor), (state.flexor, state.extensor), (state.flexor_pull, state.extensor_pull), ends,
        strict=True,
    ):  # fmt: skip
        stretch = max(0.0, memory.node - end)
        k, q = cable.fabric.stiffness, cable.fabric.stiffening
        stored += 0.5 * k * stretch**2 + q * stretch**3 / 3.0 + 0.5 * pull.motor**2 / cable.stiffness
        assert pull.joint == pytest.approx(fabric_tension(stretch, cable.fabric), abs=1e-9)
    return stored


@pytest.mark.parametrize("kind", ["play", "capstan"])
@pytest.mark.long
def test_unpowered_the_energy_only_falls(kind: str) -> None:
    """Let go at 70° with a shove: what is stored and moves never grows, with all friction in."""
    cable = SUIT.flexor._replace(kind=kind)
    suit = SUIT._replace(flexor=cable, extensor=cable, motor=SUIT.motor._replace(friction=0.2), posture=0.0)
    made = prepare_suit(suit)
    state = settled(suit, 70.0 * RADIANS)._replace(joint_velocity=3.0)
    left = [energy(suit, state)]
    for _ in range(3000):
        state = after(made, state, 0.0, False, suit.wearer, 1e-3)
        left.append(energy(suit, state))
    assert max(np.diff(left)) < 2e-4
    assert left[-1] < left[0] - 0.3


def test_a_frictionless_undamped_suit_keeps_its_energy() -> None:
    arm = SUIT.arm._replace(damping=0.0)
    cable = SUIT.flexor._replace(half_width=0.0)
    motor = SUIT.motor._replace(friction=0.0, efficiency=1.0)
    suit = SUIT._replace(
        arm=arm, flexor=cable, extensor=cable, motor=motor, fabric=Fabric(8000.0, 0.0, 0.0), posture=0.0, substeps=100
    )
    made = prepare_suit(suit)
    state = after(made, suit_start(made, 45.0 * RADIANS, 45.0 * RADIANS, math.pi), 0.0, False, suit.wearer, 1e-3)
    first = energy(suit, state)
    state = after(made, state, 0.0, False, suit.wearer, 0.3)
    moving = 0.5 * arm.inertia * state.joint_velocity**2 + 0.5 * motor.inertia * state.spool.velocity**2
    assert moving > 0.05
    assert energy(suit, state) == pytest.approx(first, abs=0.05 * moving)


def spool_friction(trace: Trace, after: float) -> float:
    """Half of what the torques going up and down differ by at one angle of the spool, the median over angles [N·m]."""
    torque, speed = trace["current"] * float(trace.settings["torque_constant"]), trace["motor_velocity"]
    angle, counts = trace["spool"], trace.time >= after
    low, high = np.quantile(angle[counts], (0.1, 0.9))
    place = np.floor(20 * (angle - low) / (high - low))
    ways = [[torque[counts & (place == k) & (way * speed > 0.02)].mean() for k in range(20)] for way in (1.0, -1.0)]
    return float(np.median(0.5 * np.subtract(*ways)))


def test_the_friction_that_a_run_shows_is_that_of_drive_gears_and_sheaths() -> None:
    """(F + k·r·(r_f + r_e))/η and the gears' loss on what the cables carry, of which the spool's F is the most."""
    shown, made = spool_friction(run(), 10.0), prepare_suit(SUIT)
    held = SUIT.flexor.stiffness * SUIT.flexor.half_width * (SUIT.spool_radius + made.extensor_radius)
    least = (SUIT.motor.friction + held) / SUIT.motor.efficiency
    assert 0.9 * least < shown < 1.2 * least
    assert friction_of(SUIT) == pytest.approx(least)
    capstan = SUIT._replace(flexor=SUIT.flexor._replace(kind="capstan"))
    assert friction_of(capstan) == pytest.approx(SUIT.motor.friction / SUIT.motor.efficiency)


UNEVEN = SUIT._replace(
    flexor=SUIT.flexor._replace(feeder_drag=30.0, stiffness=7e3),
    extensor=SUIT.extensor._replace(kind="bouc_wen", feeder_drag=20.0),
    fabric=Fabric(8000.0, 2e5, 190.0),
    sheath=Sheath(bend=2.0, loss=0.1),
)
"""No two of its parts are alike."""
PI = sheath_state(UNEVEN.sheath, math.pi)
PUSHING = Wearer(0.3, 0.5, 5.0, 2.0, 0.7, 1.2, 1.5)
tensions = st.floats(0.0, 200.0)


def test_friction_has_of_the_feeders_drag_the_mean_of_both_ways() -> None:
    smooth, made = UNEVEN._replace(flexor=UNEVEN.flexor._replace(half_width=0.0)), prepare_suit(UNEVEN)
    ways = [UNEVEN.motor.friction + drag for drag in (made.map.radius * 30.0, made.extensor_radius * 20.0)]
    assert friction_of(smooth) * UNEVEN.motor.efficiency == pytest.approx(np.mean(ways))


@given(st.floats(-0.3, 2.8), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.tuples(*[tensions] * 4), st.booleans())
def test_a_sub_step_is_newtons_law_at_spool_and_elbow_under_the_cables_pull(
    joint: float, speed: float, spool_speed: float, pulls: tuple[float, float, float, float], powered: bool
) -> None:
    """With the springs and dampers of the elbow as they are at the sub-step's end, its stops among them."""
    made, dt, bend, target = prepare_suit(UNEVEN._replace(substeps=1)), 1e-3, 2.5, 1.0
    begun, flexor, extensor = suit_start(made, 0.9, joint, bend), Pull(*pulls[:2]), Pull(*pulls[2:])
    begun = begun._replace(time=0.3, joint_velocity=speed, flexor_pull=flexor, extensor_pull=extensor)
    begun = begun._replace(spool=begun.spool._replace(velocity=spool_speed, torque_offset=0.7))
    after = suit_step(made, begun, target, powered, Bends(1.0, bend), PUSHING, dt)

    r_f, r_e, k_f, k_e = made.map.radius, made.extensor_radius, made.flexor.stiffness, made.extensor.stiffness
    still = SpoolState(begun.spool.position, spool_speed, 0.0, 0.0, begun.spool.position, 0.0, 0.7)
    driven = drive_motor(made.motor, begun.spool, spool_of(target, made.map), dt) if powered else still
    load, held = r_f * flexor.motor - r_e * extensor.motor, r_f**2 * k_f + r_e**2 * k_e
    assert after.spool == turn_spool(made.motor, driven, load, held, dt, r_f * 30.0, r_e * 20.0)

    levers, arm, fabric = (flexor_arm(joint, made.map), made.joint_radius), UNEVEN.arm, UNEVEN.fabric
    damping, spring, pulled = arm.damping + PUSHING.damping, arm.stiffness + PUSHING.stiffness, 0.0
    flesh = 0.0
    for way, lever, tension in zip((1.0, -1.0), levers, (flexor.joint, extensor.joint), strict=True):
        pulled += way * lever * tension
        flesh += fabric.damping * tension / (tension + TAUT) * lever**2
        spring += (fabric.stiffness + 2.0 * fabric.stiffening * give(tension, fabric)) * lever**2
    beyond = joint - min(max(joint, UNEVEN.stops[0]), UNEVEN.stops[1])
    stopped = (STOP_STIFFNESS, STOP_DAMPING) if beyond else (0.0, 0.0)
    torque = pulled - flesh * speed + wearer_torque(PUSHING, arm, joint, speed, 0.3) - stopped[0] * beyond
    torque += gravity_torque(arm, joint) + passive_torque(arm, joint, speed) - stopped[1] * speed
    given = torque - (damping + flesh + stopped[1]) * (after.joint_velocity - speed)
    given -= (spring + stopped[0]) * dt * after.joint_velocity
    assert arm.inertia * (after.joint_velocity - speed) / dt == pytest.approx(given, abs=1e-7)
    assert after.joint == pytest.approx(joint + dt * after.joint_velocity)
    assert (after.time, after.interaction) == pytest.approx((0.3 + dt, pulled - flesh * speed))
    assert after.wearer == wearer_torque(PUSHING, arm, joint, speed, 0.3)

    sheath = sheath_state(UNEVEN.sheath, bend + UNEVEN.posture * joint)[1:]
    before, now = begun.spool.position, after.spool.position
    ends = flexor_travel(after.joint, made.map), -made.joint_radius * after.joint
    assert (after.flexor, after.flexor_pull) == pull_suit_cable(
        made.flexor, begun.flexor, r_f * before, r_f * now, ends[0], *sheath
    )
    assert (after.extensor, after.extensor_pull) == pull_suit_cable(
        made.extensor, begun.extensor, -r_e * before, -r_e * now, ends[1], *sheath
    )


def test_a_cycle_is_its_sub_steps_along_the_bend_and_begins_with_one_tension_in_each_cable() -> None:
    made = prepare_suit(UNEVEN._replace(substeps=3))
    begun = suit_start(made, 0.4, 0.5, 2.2)
    assert (begun.joint, suit_motor(made, begun)) == pytest.approx((0.5, 0.4), abs=1e-12)
    whole = suit_step(made, begun, 0.6, True, Bends(2.2, 2.5), PUSHING, 3e-3)
    single, state = made._replace(substeps=1), begun
    for bend in (2.3, 2.4, 2.5):
        state = suit_step(single, state, 0.6, True, Bends(0.0, bend), PUSHING, 1e-3)
    assert flat(whole) == pytest.approx(flat(state), rel=1e-9)
    factor, spool = slope_factor(2.2 + UNEVEN.posture * 0.5, UNEVEN.sheath), begun.spool.position
    for cable, memory, pulled, end in (
        (made.flexor, begun.flexor, made.map.radius * spool, flexor_travel(0.5, made.map)),
        (made.extensor, begun.extensor, -made.extensor_radius * spool, -made.joint_radius * 0.5),
    ):
        assert memory == start_suit_cable(cable, pulled, end, factor)


def test_a_suit_s_sheaths_are_bent_by_the_scenario_and_by_the_elbow() -> None:
    path, joint = sheath_path(UNEVEN.sheath, np.array([2.0, 2.5, 3.0])), np.array([0.1, 0.7])
    shown = zip(*UNEVEN.sheath_columns(joint, path).values(), strict=True)
    bends = path.bends[:2] + UNEVEN.posture * joint
    assert [*shown] == [pytest.approx(sheath_state(UNEVEN.sheath, bend)) for bend in bends]


def test_an_elbow_loses_what_its_spool_does_and_a_braked_motor_is_no_faster_than_unloaded() -> None:
    """Both where the flexor's lever is least, with the arm straight."""
    made = prepare_suit(SUIT)
    assert flexor_travel(elbow_dead_zone(1e-7), made.map) == pytest.approx(2e-7, rel=1e-4)
    braked = SUIT._replace(brake=HoldingBrake(0.1), motor=SUIT.motor._replace(supply=36.0)).dynamics().plant
    least = min(flexor_arm(angle, made.map) for angle in np.linspace(0.0, 2.0, 50))
    assert braked.speed * least == pytest.approx(SUIT.spool_radius * 36.0 / (SUIT.motor.gear * 16.7e-3))
    held, free = braked.held.motor.friction, braked.suit.motor.friction
    assert held - free == pytest.approx(SUIT.motor.gear * 0.1)


def test_noise_of_current_and_load_cell_leaves_that_of_the_angles_as_it_is() -> None:
    drawn, other = np.empty((4000, 5)), np.empty((4000, 5))
    SUIT.draw(3, drawn)
    SUIT.draw(4, other)
    np.testing.assert_array_equal(drawn[:, :3], np.random.default_rng(3).standard_normal((4000, 3)))
    assert np.corrcoef(drawn, other, rowvar=False) == pytest.approx(np.eye(10), abs=0.07)


def test_what_a_worn_suit_shows_is_where_it_is_behind_its_sensors() -> None:
    suit = UNEVEN._replace(joint_sensor=PAPER_FLEX, motor_encoder=Encoder(1e-3, 2e-3), wearer=PUSHING)
    plant = suit.dynamics()
    rested = plant.rest(plant.plant._replace(settling=20), 0.4, PI)
    body = plant.advance(plant.plant, rested, 0.6, PI, PI)
    assert body.heat == warm(suit.thermal, rested.heat, body.suit.spool.current, suit.sample_time)
    state, normals = body.suit, np.array([0.3, -0.4, 0.5, -0.6, 0.7])
    after, seen = plant.observe(plant.plant, body, normals)
    flex, joint = flex_step(PAPER_FLEX, body.flex, state.joint, 0.3, -0.4, suit.sample_time)
    motor = suit_motor(plant.plant.suit, state)
    assert after == (state, flex, body.brake, body.heat)
    assert seen[:2] == (joint, reading(motor, 0.5, suit.motor_encoder))
    assert seen.current == state.spool.current - 0.6 * CURRENT_NOISE
    assert seen.load == cell_reading(suit.load_cell, state.interaction, 0.7)
    assert plant.effort(plant.plant, body, PI) == state.spool.current != 0.0
    pulls, spool = (state.flexor_pull, state.extensor_pull), state.spool
    shown = dict(zip(plant.columns, plant.look(plant.plant, body), strict=True))
    expected = (state.joint, motor, spool.velocity, state.joint_velocity, spool.position)
    expected += (pulls[0].joint, pulls[0].motor, pulls[1].joint, pulls[1].motor)
    assert tuple(shown.values()) == (*expected, state.interaction, state.wearer, body.heat.winding)


@pytest.mark.parametrize(
    "suit",
    [
        SUIT._replace(spool_radius=math.nan),
        SUIT._replace(substeps=0),
        SUIT._replace(posture=-11.0),  # no sheath is bent ten times as far as the elbow
        SUIT._replace(arm=Arm(inertia=math.nan)),
        SUIT._replace(wearer=Wearer(share=math.nan)),
        SUIT._replace(flexor=SUIT.flexor._replace(kind="capstan"), sheath=Sheath(loss=0.1)),
    ],
)
def test_a_suit_that_cannot_be_is_refused(suit: Suit) -> None:
    with pytest.raises(ParameterError) as caught:
        simulate(suit, LAWS["uncompensated"], MOTION, duration=1.0)
    assert "\n" not in str(caught.value)


CAUGHT = Wearer(stiffness=300.0, damping=5.0, centre=20.0 * RADIANS)


@pytest.mark.parametrize("friction", [0.7, 1.3])
def test_the_least_tension_that_a_suits_current_means_is_no_more_than_there_is(friction: float) -> None:
    """Whatever the friction within its doubt: a free arm is not taken for a caught one, and a caught one is seen."""
    limits, most = Rig(suit=SuitSettings(worn=True)).supervisor_limits, []
    for wearer in (SUIT.wearer, CAUGHT):
        motor = SUIT.motor._replace(friction=friction * SUIT.motor.friction)
        trace = simulate(SUIT._replace(motor=motor, wearer=wearer), LAWS["uncompensated"], MOTION, duration=6.0)
        spans = (limits.pull_gain * trace["current"] - limits.pull_doubt, trace["flexor_motor_tension"])
        least, there = (np.lib.stride_tricks.sliding_window_view(span, 50) for span in spans)
        assert (least.min(axis=1) <= there.max(axis=1)).all()
        most.append(least.min(axis=1).max())
    assert most[0] < 80.0
    assert most[1] > 120.0
