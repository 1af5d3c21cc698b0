"""The suit behind the twin: counts of the spool, angles of the joint's coordinate, gravity, torn and slack cables."""

import math
from typing import Any

import numpy as np
import pytest

from bowden.core.errors import DriveError, ParameterError
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import NOTHING_OBSERVED
from bowden.cycle.torque_offset import TorqueOffset
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters, joint_scale
from bowden.hardware.drives.on_can import zeroed
from bowden.hardware.drives.scale import Scale, SuitScale, motor_scale
from bowden.hardware.ports import Drive, Power
from bowden.hardware.twin.canopen_node import RATED_CURRENT
from bowden.hardware.twin.plant import BRAKE, FOLLOW, OFF
from bowden.hardware.twin.suit import TwinSuit
from bowden.models.cable.sheath_path import constant_bend, scripted_bend
from bowden.models.drive.geared_motor import GearedMotor, SpoolState, drive_motor
from bowden.models.suit.arm import Wearer
from bowden.models.suit.suit_angle import spool_map, spool_of
from bowden.plants.suit_parts import Suit
from bowden.safety.faults import Reaction
from bowden.safety.state import Mode, Verdict
from support.memory_bus import DriverLoop, asking

SUIT = Suit(motor=GearedMotor(integral=40.0))
DRIVE = asking(DriveParameters(), gear=SUIT.motor.gear, spool=spool_map(SUIT.geometry, SUIT.spool_radius))


def twin(suit: Suit = SUIT, motor: float = 0.0) -> TwinSuit:
    return TwinSuit(suit, constant_bend(suit.sheath.bend), 1.0, 1, motor, 0.0)


def run(suit: TwinSuit, begin: float, seconds: float, doing: int, command: float = 0.0) -> float:
    """On from `begin`, five milliseconds a call; the time after it [s]."""
    suit.doing, suit.command = doing, command
    for k in range(1, round(200.0 * seconds) + 1):
        suit.advance(begin + 5e-3 * k)
    return begin + seconds


@pytest.mark.parametrize("direction", [1, -1])
def test_counts_are_the_spools_and_angles_the_joints(direction: int) -> None:
    scale = motor_scale(DRIVE._replace(motor_direction=direction))
    assert isinstance(scale, SuitScale)
    for degrees in (-25.0, 0.0, 1.0, 45.0, 90.0, 115.0, 130.0):
        angle = degrees * RADIANS
        counts = scale.counts(angle)
        assert scale.angle(counts) == pytest.approx(angle, abs=1e-12)
        turns = direction * counts / (DRIVE.motor_counts_per_turn * DRIVE.needs.gear)
        assert turns * 2.0 * math.pi == pytest.approx(spool_of(angle, scale.map), abs=1e-12)


def test_home_is_an_angle_of_the_joint() -> None:
    scale = motor_scale(DRIVE._replace(motor_home=0.5), 12_345)
    assert scale.angle(12_345) == pytest.approx(0.5, abs=1e-12)


def test_a_position_is_given_its_angles_in_the_joints_coordinate() -> None:
    was = motor_scale(DRIVE).angle(20_000)
    wanted = zeroed(DRIVE, NOTHING_OBSERVED.reading._replace(motor=was, joint=0.1), motor=0.3, joint=0.2)
    assert motor_scale(wanted).angle(20_000) == pytest.approx(0.3, abs=1e-9)
    assert joint_scale(wanted).angle(1000) - joint_scale(DRIVE).angle(1000) == pytest.approx(0.1, abs=1e-12)


def test_the_steepest_place_bounds_what_an_angle_asks_of_the_spool() -> None:
    scale = motor_scale(DRIVE)
    low, high = -0.2, 1.5
    angles = np.linspace(low, high, 500)
    slopes = np.diff([scale.counts(angle) * scale.step for angle in angles]) / np.diff(angles)
    assert scale.steepest(low, high) >= slopes.max()
    assert scale.steepest(low, high) == pytest.approx(slopes.max(), rel=0.01)
    assert scale.steepest(-math.inf, math.inf) > scale.steepest(low, high)
    assert Scale(1.0, 0.0).steepest(low, high) == 1.0


def test_the_arm_hangs_follows_and_sinks_without_torque_no_quicker_than_the_gears_let_it() -> None:
    suit = twin()
    assert abs(suit.joint) < 3.0 * RADIANS
    assert suit.current == 0.0
    now = run(suit, 0.0, 2.0, FOLLOW, 60.0 * RADIANS)
    assert suit.motor == pytest.approx(60.0 * RADIANS, abs=2.0 * RADIANS)
    assert 45.0 * RADIANS < suit.joint < suit.motor
    assert suit.tension > 30.0
    assert suit.current > 1.0
    before = suit.motor
    run(suit, now, 1.0, OFF)
    assert suit.current == 0.0
    assert suit.motor <= before + 0.01
    assert suit.velocity == 0.0, "gears with this friction hold what is left"


def test_gears_without_friction_let_the_arm_sink() -> None:
    loose = SUIT.motor._replace(friction=0.0, efficiency=1.0)
    suit = twin(SUIT._replace(motor=loose, wearer=Wearer(constant=-4.0)))  # beyond what the cables' friction holds
    now = run(suit, 0.0, 2.0, FOLLOW, 60.0 * RADIANS)
    held = suit.joint
    run(suit, now, 2.0, OFF)
    assert suit.joint < held - 10.0 * RADIANS


def test_a_torn_flexor_lets_the_arm_fall_and_a_slack_one_gives_way_until_it_is_taken_up() -> None:
    for torn, slack in ((True, 0.0), (False, 0.6)):
        suit = twin()
        now = run(suit, 0.0, 2.0, FOLLOW, 60.0 * RADIANS)
        held, pulled = suit.joint, suit.tension
        suit.torn, suit.slack = torn, slack
        now = run(suit, now, 0.02, FOLLOW, 60.0 * RADIANS)
        assert suit.tension < 0.2 * pulled
        now = run(suit, now, 2.0, FOLLOW, 60.0 * RADIANS)
        assert suit.joint < held - 5.0 * RADIANS
        suit.torn, suit.slack = False, 0.0
        run(suit, now, 2.0, FOLLOW, 60.0 * RADIANS)
        assert suit.joint == pytest.approx(held, abs=3.0 * RADIANS)


def test_a_quick_stop_holds_the_motor_where_it_began() -> None:
    suit = twin()
    now = run(suit, 0.0, 0.05, FOLLOW, 60.0 * RADIANS)
    assert suit.velocity > 1.0
    where = suit.motor
    run(suit, now, 2.0, BRAKE)
    assert suit.velocity == 0.0
    assert suit.motor == pytest.approx(where, abs=3.0 * RADIANS)


def test_the_wearer_and_a_shrug_of_the_sheath_are_felt() -> None:
    flexed = twin(SUIT._replace(wearer=Wearer(constant=4.0)))
    assert flexed.joint > twin().joint + 2.0 * RADIANS
    lossy = SUIT._replace(sheath=SUIT.sheath._replace(loss=0.1))
    shrug = scripted_bend([0.0, 1.0], [SUIT.sheath.bend, 2.0 * SUIT.sheath.bend])
    suit = TwinSuit(lossy, shrug, 1.0, 1, 0.0, 0.0)
    now = run(suit, 0.0, 2.0, FOLLOW, 60.0 * RADIANS)
    before = suit.tension
    now = run(suit, now, 1.0, FOLLOW, 60.0 * RADIANS)
    assert suit.tension == pytest.approx(before, rel=0.02), "the scenario has not begun"
    suit.start_scenario(now)
    run(suit, now, 1.0, FOLLOW, 60.0 * RADIANS)
    assert suit.tension != pytest.approx(before, rel=0.02)


def test_a_wearer_swings_with_the_scenario_and_keeps_still_before_it_and_without_power() -> None:
    moving = SUIT._replace(wearer=Wearer(1.0, stiffness=100.0, damping=3.0, centre=0.8, swing=0.4, swing_frequency=0.5))
    suit = twin(moving, 0.8)

    def span(begin: float, doing: int) -> tuple[float, float]:
        """Where the elbow was in the 2 s from then on, and the time after them [s]."""
        seen, suit.doing, suit.command = [], doing, 0.8
        for k in range(1, 401):
            suit.advance(begin + 5e-3 * k)
            seen.append(suit.joint)
        return max(seen) - min(seen), begin + 2.0

    still, now = span(0.0, FOLLOW)
    assert still < 0.02
    suit.start_scenario(now)
    growing, now = span(now, FOLLOW)
    assert growing > 0.2
    swings, now = span(now, FOLLOW)
    assert 0.6 < swings < 0.85, "of 0.8 rad, as the cables let them"
    assert suit.interaction is not None
    _, now = span(now, OFF)
    rests, now = span(now, FOLLOW)
    assert rests < 0.02, "until there is a scenario again"
    suit.start_scenario(now)
    _, now = span(now, FOLLOW)
    assert span(now, FOLLOW)[0] == pytest.approx(swings, abs=0.02)


def test_the_sensors_show_where_it_is_with_their_noise() -> None:
    suit = twin()
    now = run(suit, 0.0, 2.0, FOLLOW, 40.0 * RADIANS)
    shown = []
    for k in range(200):
        suit.advance(now + 1e-3 * k)
        shown.append(suit.read_encoders())
    joint, motor = np.mean(shown, axis=0)
    assert joint == pytest.approx(suit.joint, abs=1.0 * RADIANS)
    assert motor == pytest.approx(suit.motor, abs=0.1 * RADIANS)
    assert np.std([one for one, _ in shown]) > 0.01 * RADIANS
    assert suit.speed_limit == pytest.approx(24.0 / (16.7e-3 * 25.0))
    assert suit.current_limit == 20.0


def over_the_bus(drive: DriveParameters, overrides: Any = None) -> tuple[DriverLoop, Drive]:
    bus = DriverLoop(drive, overrides, lambda now: TwinSuit(SUIT, constant_bend(SUIT.sheath.bend), 1.0, 1, 0.0, now))
    return bus, bus.drive


def test_over_the_bus_the_drive_speaks_of_the_joints_coordinate() -> None:
    limited = asking(
        DRIVE,
        **{"lowest_motor": -0.2, "highest_motor": 2.0, "speed_limit": 15.0, "following_error": 0.9},
        **{"current_limit": 20.0, "tension_scale": 0.05, "answer_timeout": 1.0},
    )
    bus, drive = over_the_bus(limited)
    drive.bring_up()
    aim = 0.0
    for k in range(1500):
        reading = drive.read(bus.time)
        aim = 0.8 * min(1.0, k / 1000.0)
        drive.write(reading.motor if k < 20 else aim, Power.ON, bus.time)
        bus.advance(1e-3)
    plant = bus.node.bench
    assert reading.drive_state == 4.0
    assert reading.motor == pytest.approx(0.8, abs=0.05)
    assert reading.motor == pytest.approx(plant.motor, abs=0.01)
    assert reading.joint == pytest.approx(plant.joint, abs=2.0 * RADIANS)
    assert reading.tension == pytest.approx(plant.tension, rel=0.05)
    assert abs(reading.current) > 0.5
    drive.close()


LAG = {"following_error": 0.9}


def test_the_drives_own_limits_are_held_against_the_spool() -> None:
    for asked, set_to, said in (
        ({"speed_limit": 40.0}, {}, "speed limit"),
        (LAG, {(0x6065, 0): 10}, "following error"),
    ):
        bus, drive = over_the_bus(asking(DRIVE, lowest_motor=-0.2, highest_motor=2.0, answer_timeout=1.0, **asked))
        for key, value in set_to.items():
            bus.node.objects.change(key, value)
        with pytest.raises(DriveError, match=said):
            drive.bring_up()
        drive.close()


@pytest.mark.parametrize("direction", [1, -1])
def test_a_torque_offset_arrives_at_the_spool_within_its_bound_and_only_under_torque(direction: int) -> None:
    pushed = asking(DRIVE, torque_offset=2.0, current_limit=20.0, motor_direction=direction, answer_timeout=1.0)
    bus, drive = over_the_bus(pushed)
    drive.bring_up()
    plant = bus.node.bench

    def told(torque: float, power: Power) -> float | None:
        for _ in range(8):
            reading = drive.read(bus.time)
            drive.write(reading.motor, power, bus.time, torque)
            bus.advance(1e-3)
        return plant.torque_offset

    step = pushed.needs.gear * RATED_CURRENT * pushed.needs.torque_constant * 1e-3
    assert told(1.0, Power.READY) == 0.0
    assert told(1.0, Power.ON) == pytest.approx(1.0, abs=0.5 * step)
    assert told(-9.0, Power.ON) == pytest.approx(-2.0, abs=0.5 * step)
    assert told(math.nan, Power.ON) == 0.0
    assert told(1.0, Power.OFF) == 0.0
    drive.close()


def test_an_offset_that_is_told_pushes_as_one_that_the_drive_makes() -> None:
    """A small motion of the target: friction holds the spool, unless the offset makes up for it."""
    told, plain = twin(), twin()
    now = run(told, 0.0, 0.5, FOLLOW)
    run(plain, 0.0, 0.5, FOLLOW)
    told.torque_offset = 2.3
    run(told, now, 0.05, FOLLOW, 3.0 * RADIANS)
    run(plain, now, 0.05, FOLLOW, 3.0 * RADIANS)
    assert told.motor > plain.motor + 0.2 * RADIANS
    assert told.motor < 3.5 * RADIANS


def test_a_drive_that_maps_no_torque_offset_is_refused_in_one_line_and_one_without_is_asked_for_none() -> None:
    pushed = asking(DRIVE, torque_offset=2.0, current_limit=20.0, answer_timeout=1.0)
    _, drive = over_the_bus(pushed, {(0x60B2, 0): None})
    with pytest.raises(DriveError, match="takes no torque offset beside its target") as refused:
        drive.bring_up()
    assert "suit.friction_feedforward_nm" in str(refused.value)
    assert "\n" not in str(refused.value)
    drive.close()
    bus, drive = over_the_bus(DRIVE._replace(answer_timeout=1.0), {(0x60B2, 0): 300})
    drive.bring_up()
    assert bus.node.objects[0x60B2, 0] == 0, "what another tool has left there"
    drive.close()


def test_an_offset_that_the_position_loop_could_not_beat_is_refused() -> None:
    with pytest.raises(ParameterError, match="half of what the largest current gives"):
        CanopenDrive(asking(DRIVE, torque_offset=5.0, current_limit=20.0))


def test_the_loops_offset_is_that_of_the_simulated_drive() -> None:
    """One kernel, stepped by the same time: targets that rise, shake and fall."""
    motor, map_ = GearedMotor(friction_feedforward=2.0), spool_map(SUIT.geometry, SUIT.spool_radius)
    offset, running = TorqueOffset(2.0, 10, map_), Verdict(0.0, Power.ON, Mode.RUNNING, Reaction.NONE, 0)
    state = SpoolState(spool_of(0.0, map_), 0.0, 0.0, 0.0, spool_of(0.0, map_), 0.0, 0.0)
    still = state._replace(settled_target=spool_of(0.0, map_))
    free = motor._replace(friction_feedforward=0.0)
    for k in range(3000):
        target = 0.3 * math.sin(2.0 * k * 1e-3) + (1e-3 * math.sin(k) if k > 2000 else 0.0)
        for _ in range(10):
            state = drive_motor(
                motor,
                still._replace(settled_target=state.settled_target, push=state.push),
                spool_of(target, map_),
                1e-4,
            )
        without = drive_motor(free, still, spool_of(target, map_), 1e-4)
        torque = (state.current - without.current) * motor.gear * motor.torque_constant
        if abs(state.current) < motor.current_limit and abs(without.current) < motor.current_limit:
            assert offset.step(target, running, 1e-3) == pytest.approx(torque, abs=1e-9)
        else:
            offset.step(target, running, 1e-3)
    assert abs(offset.row()[2]) > 0.5
    assert offset.step(0.3, running._replace(mode=float(Mode.RELEASING)), 1e-3) == 0.0
    assert offset.step(0.3, running._replace(reaction=1.0), 1e-3) == 0.0
    assert offset.step(0.3, running._replace(power=0.0), 1e-3) == 0.0


def test_a_second_that_was_lost_is_not_made_up_for() -> None:
    suit, other = twin(), twin()
    run(suit, 0.0, 1.0, FOLLOW, 0.5)
    other.doing, other.command = FOLLOW, 0.5
    other.advance(9.0)
    other.advance(9.0005)
    assert other.joint == pytest.approx(suit.joint, abs=0.05)
