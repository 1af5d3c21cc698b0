"""Our drive against the twin at a time of our own: bring-up, enabling, following, faults, and every bad input."""

import itertools
import math
import threading
from typing import Any

import pytest

from bowden.core.errors import DriveError
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.drives.findings import UNWATCHED
from bowden.hardware.drives.on_can import zeroed
from bowden.hardware.ports import Power
from bowden.hardware.twin.canopen_node import CanopenNode
from bowden.hardware.twin.injection import KINDS
from support.memory_bus import DriverLoop

DRIVE = DriveParameters(answer_timeout=0.05, tension_scale=0.01, tension_zero=200.0)


def brought_up(drive: DriveParameters = DRIVE, overrides: Any = None) -> DriverLoop:
    loop = DriverLoop(drive, overrides)
    loop.drive.bring_up()
    return loop


def torque_off_after(loop: DriverLoop) -> float:
    """From the host's last heartbeat on [s]."""
    return float(next(time for time, event, _ in loop.journal if event == "torque_off") - loop.node.host)


def test_bring_up_says_who_it_is_and_leaves_no_thread() -> None:
    loop, before = DriverLoop(DRIVE), threading.active_count()
    assert "bowden digital twin at node 1" in loop.drive.bring_up()
    assert threading.active_count() == before
    node = loop.node
    assert node.nmt == frames.OPERATIONAL
    assert node.state is DriveState.SWITCH_ON_DISABLED
    assert node.objects[0x1016, 1] == 127 << 16 | 40
    assert node.objects[0x6007, 0] == 1
    assert node.objects[0x605E, 0] == 0
    assert node.objects[0x6060, 0] == 8
    assert (node.objects[0x60C2, 1], node.objects[0x60C2, 2]) == (1, -3)
    for index, mapping in (
        (0x1600, frames.ORDER.mapping[:2]),
        (0x1A00, frames.MOTION.mapping),
        (0x1A01, frames.SENSORS.mapping),
    ):
        assert node.objects[index, 0] == len(mapping)
        assert tuple(node.objects[index, sub] for sub in range(1, 1 + len(mapping))) == mapping
        assert node.objects[index - 0x200, 2] == 1
        assert node.objects[index - 0x200, 1] & 0x8000_0000 == 0


def test_it_goes_up_and_down_one_state_a_cycle_and_enabling_moves_nothing() -> None:
    loop = brought_up()
    readings = loop.run(10, Power.ON, target=2.0)
    states = [int(reading.drive_state) for reading in readings]
    assert states[:5] == [1, 2, 3, 4, 4]
    first = states.index(DriveState.OPERATION_ENABLED)
    assert abs(readings[first].motor - 0.1) < 1e-3
    assert loop.node.bench.motor > 0.1
    loop.run(10, Power.READY)
    assert loop.node.state is DriveState.SWITCHED_ON
    loop.run(10, Power.OFF)
    assert loop.node.state is DriveState.SWITCH_ON_DISABLED


def test_it_follows_and_measures_in_si() -> None:
    loop = DriverLoop(DRIVE).up()
    readings, node = loop.run(1000, Power.ON, target=0.5), loop.node
    reading = readings[-1]
    assert abs(reading.motor - 0.5) < 2e-3
    assert abs(reading.joint - node.bench.joint) < 2e-3
    assert math.isclose(reading.current, node.bench.current, abs_tol=0.01)
    assert math.isclose(reading.tension, node.bench.tension, abs_tol=0.01)
    assert math.isclose(reading.temperature, node.bench.temperature, abs_tol=0.1)
    assert reading.motor_age == reading.joint_age == 0.0
    assert reading.heartbeat_age <= 0.011
    assert reading.bus_errors == 0.0
    assert {one.emergency for one in readings} == {0.0}


class TwiceAnswered(DriverLoop):
    """A bus with an answer to the question before ahead of each."""

    before = b""

    def put(self, cob_id: int, data: bytes) -> None:
        if cob_id == 0x581:
            if self.before:
                super().put(cob_id, self.before)
            self.before = data
        super().put(cob_id, data)


def test_a_late_answer_to_a_question_before_is_not_taken_for_the_next_one() -> None:
    """On a busy computer a question is asked again, and then both answers come."""
    assert "bowden digital twin at node 1" in TwiceAnswered(DRIVE).drive.bring_up()


def test_directions_and_homes_turn_the_counts_and_not_the_angles() -> None:
    turned = DRIVE._replace(motor_direction=-1, joint_direction=-1, motor_home=0.7, joint_home=-0.3)
    reading = brought_up(turned).run(5, Power.OFF)[-1]
    assert abs(reading.motor - 0.1) < 1e-3
    here = DRIVE._replace(home="here", motor_home=1.0, joint_home=2.0)
    reading = brought_up(here).run(5, Power.OFF)[-1]
    assert abs(reading.motor - 1.0) < 1e-3
    assert abs(reading.joint - 2.0) < 2e-3
    with pytest.raises(DriveError, match="not reported a position yet"):
        zeroed(DRIVE, DriverLoop(DRIVE).drive.read(100.0))


def test_a_quick_stop_brakes_and_then_is_off() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.run(60, Power.ON, target=1.0)
    assert loop.node.bench.velocity > 1.0
    assert DriveState.QUICK_STOP_ACTIVE in [int(one.drive_state) for one in loop.run(51, Power.QUICK_STOP)]
    assert loop.node.state is DriveState.SWITCH_ON_DISABLED
    assert loop.node.bench.velocity == 0.0


@pytest.mark.parametrize("option", [2, 3])
def test_a_drive_that_only_switches_off_is_not_switched_on_again_by_itself(option: int) -> None:
    loop = DriverLoop(DRIVE).up()
    loop.node.objects.set_data(0x6007, 0, option.to_bytes(2, "little"))
    loop.run(60, Power.ON, target=0.5)
    loop.advance(0.2)
    assert loop.node.state is DriveState.SWITCH_ON_DISABLED
    assert torque_off_after(loop) <= 0.050
    loop.run(100, Power.ON, target=0.5)
    assert loop.node.state is DriveState.SWITCH_ON_DISABLED
    loop.run(2, Power.OFF)
    loop.run(10, Power.ON)
    assert loop.node.state is DriveState.OPERATION_ENABLED


def test_a_drive_that_cannot_map_its_temperature_is_used_without() -> None:
    reading = DriverLoop(DRIVE, {(0x1A01, 3): None}).up().run(20, Power.ON)[-1]
    assert math.isnan(reading.temperature)
    assert reading.joint_age == 0.0
    assert math.isfinite(reading.tension)


def test_one_lost_heartbeat_is_none() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.inject("deaf", lasting=0.012)
    loop.run(100, Power.ON)
    assert loop.node.state is DriveState.OPERATION_ENABLED


def test_an_emergency_stop_takes_the_torque_and_is_told_for_as_long_as_it_is_pressed() -> None:
    loop = DriverLoop(DRIVE._replace(emergency_stop_input=7)).up()
    assert {reading.emergency for reading in loop.run(10, Power.ON)} == {0.0}
    loop.inject("emergency_stop", lasting=0.05)
    pressed = loop.run(40, Power.OFF)
    assert loop.node.state is DriveState.FAULT
    assert {reading.emergency for reading in pressed[-30:]} == {EMERGENCY_STOP}
    loop.run(30, Power.OFF)
    loop.drive.reset_fault()
    assert loop.run(10, Power.OFF)[-1].emergency == 0.0
    assert loop.node.state is DriveState.SWITCH_ON_DISABLED


def test_inputs_that_are_not_told_are_an_emergency_stop_of_a_node_that_lives_only() -> None:
    loop = DriverLoop(DRIVE._replace(emergency_stop_input=7)).up()
    loop.node.objects.change((0x1802, 1), 1 << 31)
    assert loop.run(9, Power.ON)[-1].emergency == 0.0
    assert loop.run(5, Power.ON)[-1].emergency == EMERGENCY_STOP
    loop = DriverLoop(DRIVE._replace(emergency_stop_input=7)).up()
    loop.inject("short_frames 0")
    reading = loop.run(30, Power.ON)[-1]
    assert reading.emergency == 0.0
    assert reading.motor_age >= 29.0


def changed(name: str) -> bool:
    """Whether a fault does what it is called, seen from the host or on the bench."""
    loop = DriverLoop(DRIVE).up()
    node, before = loop.node, loop.run(300, Power.ON, target=0.6)[-1]
    bench_before = node.bench.joint
    loop.inject(name + (" joint" if KINDS[name].side else ""))
    readings = loop.run(400, Power.ON, target=0.9)
    seen, last = readings[2:], readings[-1]
    return {
        "silence": lambda: last.motor_age > 250 and last.heartbeat_age > 0.25,
        "deaf": lambda: node.error == 0x8130,
        "late_pdos": lambda: any(r.motor_age >= 4 for r in seen) and last.motor_age < 2,
        "dropped_pdos": lambda: 0.1 < sum(r.motor_age > 0 for r in seen) / len(seen) < 0.6,
        "doubled_pdos": lambda: all(r.foreign == 1.0 for r in seen[12:]),
        "watch_off": lambda: node.objects[0x1016, 1] == 0 and last.emergency == UNWATCHED,
        "emergency_stop": lambda: node.error == 0x8A88 and last.drive_state == DriveState.FAULT,
        "bus_off": lambda: last.bus_errors > 100,
        "queue_full": lambda: last.bus_errors > 100 and all(r.motor_age for r in seen),
        "commands_ignored": lambda: abs(last.motor - before.motor) < 0.05 and last.motor_age < 2,
        "delayed_readings": lambda: abs(seen[3].motor - before.motor) < 1e-3 < abs(seen[60].motor - before.motor),
        "drive_fault": lambda: 0x2310 in [r.emergency for r in readings],
        "reboot": lambda: last.drive_state == 0.0,
        "encoder_frozen": lambda: len({r.joint for r in seen}) == 1 and node.bench.joint - bench_before > 0.1,
        "encoder_spike": lambda: sum(abs(b.joint - a.joint) > 0.1 for a, b in itertools.pairwise(seen)) > 30,
        "encoder_offset": lambda: last.joint - node.bench.joint > 6.0,
        "encoder_flipped": lambda: last.joint - before.joint < -0.1,
        "encoder_zero": lambda: {r.joint for r in seen} == {0.0} and node.bench.joint > 0.1,
        "encoder_nan": lambda: last.joint < -1e5,
        "broken_cable": lambda: last.tension < 0.1 and node.bench.joint < -0.4,
        "slack_cable": lambda: node.bench.motor - node.bench._motion.end > 0.25,
        "over_temperature": lambda: last.temperature > 90.0,
        "over_current": lambda: math.isclose(last.current, 30.0, abs_tol=0.1),
        "inert": lambda: last.motor_age < 2 and abs(last.motor - before.motor) < 0.1 and last.joint_age < 2,
        "load_stuck": lambda: last.tension == seen[0].tension < node.bench.tension - 0.3,
        "load_saturated": lambda: last.tension > 90.0,
        "load_sign": lambda: last.tension < -3.0,
        "load_slow": lambda: len({r.tension for r in seen}) < 8,
        "position_saturated": lambda: abs(last.motor) > 1e4 and last.motor_age < 2,
        "short_frames": lambda: last.motor_age > 250 and last.heartbeat_age < 0.1,
        "load_drift": lambda: 2.0 < last.tension - node.bench.tension < 5.0,
        "bit_errors": lambda: 0 < sum(r.motor_age > 0 for r in seen) < 0.1 * len(seen),
    }[name]()


@pytest.mark.parametrize("name", [name for name in KINDS if name not in CanopenNode.lacks])
def test_every_fault_does_what_it_is_called(name: str) -> None:
    assert changed(name)


def test_a_slack_cable_has_no_tension_until_it_is_taken_up() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.run(300, Power.ON, target=0.6)
    loop.inject("slack_cable 20")
    assert loop.run(20, Power.ON, target=0.55)[-1].tension < 0.1
    assert loop.run(600, Power.ON, target=1.2)[-1].tension > 1.0


def test_the_drives_own_limits_are_faults() -> None:
    for overrides, heat, error in (
        ({(0x607D, 1): -5000, (0x607D, 2): 5000}, "", 0x8A82),
        ({(0x6065, 0): 100}, "", 0x8611),
        ({}, "over_temperature 115", 0x4210),
    ):
        loop = DriverLoop(DRIVE, overrides).up()
        if heat:
            loop.inject(heat)
        loop.run(5, Power.ON, target=math.nan if heat else 1.0)
        assert loop.node.error == error
