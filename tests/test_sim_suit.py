"""The suit on an arm: statics by hand, energy that only friction takes, geometry alone without it, convergence."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, kernel
from bowden.core.units import DEGREES, RADIANS
from bowden.identify.suit_friction import spool_friction
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import scripted_bend
from bowden.models.suit.arm import GRAVITY, Arm, Wearer, gravity_torque, passive_torque
from bowden.models.suit.flex_sensor import FlexSensor
from bowden.models.suit.geometry import extensor_extension, flexor_extension, flexor_moment_arm
from bowden.models.suit.suit_cable import Fabric, fabric_tension
from bowden.plants.suit_parts import Suit, prepare_suit
from bowden.plants.suit_plant import Bends, SuitState, suit_motor, suit_start, suit_step
from bowden.plants.suit_settings import SuitSettings
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from bowden.sim.run import simulate
from support.wearers import WEARERS, resting_angle

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


@pytest.mark.parametrize("motor_deg", [10.0, 45.0, 80.0])
def test_at_rest_the_torques_on_the_elbow_cancel(motor_deg: float) -> None:
    """By hand: tension times lever, weight times lever, and the relaxed elbow's own spring."""
    state = settled(SUIT, motor_deg * RADIANS)
    lever = flexor_moment_arm(state.joint, SUIT.geometry)
    by_cables = state.flexor_pull.joint * lever - state.extensor_pull.joint * SUIT.geometry.joint_radius
    weight = -SUIT.arm.mass * GRAVITY * SUIT.arm.centre * math.sin(state.joint)
    own = -SUIT.arm.stiffness * (state.joint - SUIT.arm.neutral)
    assert by_cables + weight + own == pytest.approx(0.0, abs=0.01)
    assert state.interaction == pytest.approx(by_cables, abs=0.01)
    assert abs(state.joint_velocity) < 1e-3


def test_the_motor_carries_at_rest_what_the_cables_pull_but_for_friction() -> None:
    state, made = settled(SUIT, 60.0 * RADIANS), prepare_suit(SUIT)
    load = made.map.radius * state.flexor_pull.motor - made.extensor_radius * state.extensor_pull.motor
    torque = SUIT.motor.gear * SUIT.motor.torque_constant * state.spool.current
    held = SUIT.motor.friction + (1.0 - SUIT.motor.efficiency) * max(abs(torque), abs(load))
    assert abs(torque - load) <= held + 1e-9


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


def test_a_suit_that_is_let_go_lets_the_arm_hang() -> None:
    """Unpowered and without friction the arm ends where its own weight and elbow put it, but for the cables."""
    cable = SUIT.flexor._replace(half_width=0.0)
    motor = SUIT.motor._replace(friction=0.0, efficiency=1.0)
    suit = SUIT._replace(motor=motor, flexor=cable, extensor=cable, pretension=0.0)
    state = after(prepare_suit(suit), settled(suit, 60.0 * RADIANS), 0.0, False, suit.wearer, 8.0)
    assert state.joint == pytest.approx(resting_angle(suit.arm), abs=0.2)
    assert state.spool.current == 0.0


def test_with_friction_an_unpowered_suit_holds_or_sinks_but_never_rises() -> None:
    state = settled(SUIT, 60.0 * RADIANS)
    spool = state.spool.position
    state = after(prepare_suit(SUIT), state, 0.0, False, SUIT.wearer, 2.0)
    assert state.spool.position <= spool + 1e-9


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


@pytest.mark.parametrize("kind", ["play", "capstan", "bouc_wen"])
def test_uncompensated_the_elbow_lags_and_the_cables_only_pull(kind: str) -> None:
    trace = run(kind)
    for column in ("flexor_tension", "flexor_motor_tension", "extensor_tension", "extensor_motor_tension"):
        assert trace[column].min() >= 0.0
    half = (trace.time > 10.0) & (trace.time < 15.0)  # flexing: the elbow is below; then above
    back = (trace.time > 16.0) & (trace.time < 20.0)
    assert np.mean(trace.error[half]) < -5.0 * RADIANS
    assert np.mean(trace.error[back]) > 3.0 * RADIANS
    assert np.max(np.abs(trace["current"])) <= SUIT.motor.current_limit


def test_electrical_is_mechanical_power_and_heat_and_the_winding_warms() -> None:
    trace = run()
    mechanical, electrical = trace.power()
    np.testing.assert_allclose(electrical - mechanical, 0.199 * trace["current"] ** 2, atol=1e-9)
    warmed = trace["winding_temperature"][-1] - trace["winding_temperature"][0]
    heat = np.trapezoid(0.199 * trace["current"] ** 2, trace.time)
    assert 0.2 * heat / 15.0 < warmed < 1.1 * heat / 15.0  # 15 J/K, less what has gone to the housing


def test_the_friction_that_a_run_shows_is_that_of_drive_gears_and_sheaths() -> None:
    """(F + k·r·(r_f + r_e))/η and the gears' loss on what the cables carry, of which the spool's F is the most."""
    shown, made = spool_friction(run(), 10.0), prepare_suit(SUIT)
    held = SUIT.flexor.stiffness * SUIT.flexor.half_width * (SUIT.spool_radius + made.extensor_radius)
    least = (SUIT.motor.friction + held) / SUIT.motor.efficiency
    assert 0.9 * least < shown < 1.2 * least


def test_the_feeder_drags_on_the_cable_that_is_pulled_in_and_on_no_other() -> None:
    """D·r of each cable at the spool, over η, while that cable is coiled; none on the one that is paid out."""
    drag = 30.0
    at = run().time
    flexing, extending = (at > 12.5) & (at < 14.0), (at > 17.5) & (at < 19.0)  # it has turned by then
    for name, pulled, paid, radius, way in (
        ("flexor", flexing, extending, SUIT.spool_radius, 1.0),
        ("extensor", extending, flexing, prepare_suit(SUIT).extensor_radius, -1.0),
    ):
        dragged = SUIT._replace(**{name: getattr(SUIT, name)._replace(feeder_drag=drag)})
        more = simulate(dragged, LAWS["uncompensated"], MOTION, duration=20.0)["current"] - run()["current"]
        torque = way * more * SUIT.motor.gear * SUIT.motor.torque_constant
        assert np.median(torque[pulled]) > 0.5 * drag * radius
        assert abs(np.median(torque[paid])) < 0.3 * drag * radius


def test_the_feed_forward_of_friction_takes_away_most_of_what_the_pd_drive_leaves() -> None:
    told = SUIT._replace(motor=SUIT.motor._replace(friction_feedforward=spool_friction(run(), 10.0)))
    helped = simulate(told, LAWS["uncompensated"], MOTION, duration=20.0)
    left, before = (float(np.max(np.abs(trace.error[trace.time > 10.0]))) for trace in (helped, run()))
    assert left < 0.5 * before


def test_a_bent_sheath_loses_more() -> None:
    bent = scripted_bend((0.0, 0.5), (math.pi, 3.0 * math.pi))
    suit = SUIT._replace(sheath=Sheath(bend=math.pi, loss=0.15))
    straight, moved = (simulate(suit, LAWS["uncompensated"], MOTION, duration=20.0, bend=path) for path in (None, bent))
    late = straight.time > 5.0
    assert np.sqrt(np.mean(moved.error[late] ** 2)) > 1.2 * np.sqrt(np.mean(straight.error[late] ** 2))
    assert moved["width"].max() > 2.9


@pytest.mark.parametrize("kind", [kind for kind in WEARERS if kind != "none"])
def test_each_wearer_moves_the_elbow_as_they_would(kind: str) -> None:
    free, own = (
        simulate(SUIT._replace(wearer=WEARERS[name]), LAWS["uncompensated"], MOTION, duration=10.0)
        for name in ("none", kind)
    )
    top = (free.time > 4.5) & (free.time < 5.5)
    change = np.mean(own["joint"][top] - free["joint"][top]) * DEGREES
    if kind == "weak":
        assert change > 0.5
        assert np.mean(own["interaction_torque"][top]) < np.mean(free["interaction_torque"][top])
    elif kind == "tremor":
        assert np.std(own["joint_velocity"][top]) > 2.0 * np.std(free["joint_velocity"][top])
    else:
        assert change < -0.3


def test_the_interaction_torque_moves_the_arm() -> None:
    """I·φ'' = suit + weight + elbow + wearer, from the columns of the trace alone."""
    trace = simulate(SUIT._replace(wearer=WEARERS["weak"]), LAWS["uncompensated"], MOTION, duration=5.0)
    arm, joint, speed = SUIT.arm, trace["joint"], trace["joint_velocity"]
    torque = trace["interaction_torque"] + trace["wearer_torque"]
    torque = torque + np.array([gravity_torque(arm, a) for a in joint])
    torque = torque + np.array([passive_torque(arm, a, v) for a, v in zip(joint, speed, strict=True)])
    wanted, done = torque[1:] / arm.inertia * 1e-3, np.diff(speed)
    assert np.median(np.abs(wanted - done)) < 0.02 * np.max(np.abs(done))
    assert np.corrcoef(wanted, done)[0, 1] > 0.98


@pytest.mark.parametrize(
    "suit",
    [
        SUIT._replace(spool_radius=math.nan),
        SUIT._replace(substeps=0),
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
