"""Laws that hold of the drivers of all families, each against its twin on a bus in memory."""

import copy
import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.buses.packets import STATUS, Instruction
from bowden.hardware.buses.place import EXTENDED, REMOTE
from bowden.hardware.drives import canopen_frames as canopen
from bowden.hardware.drives import moteus_frames as moteus
from bowden.hardware.drives import odrive_frames as odrive
from bowden.hardware.drives.ak_frames import ENTER, EXIT, MODELS, AkReply, pack_reply, unpack_command
from bowden.hardware.drives.cia402 import Controlword
from bowden.hardware.drives.families.ak_mit import AkParameters
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.drives.families.dynamixel import DynamixelParameters
from bowden.hardware.drives.families.feetech import FeetechParameters
from bowden.hardware.drives.families.moteus import MoteusParameters
from bowden.hardware.drives.families.odrive import OdriveParameters
from bowden.hardware.drives.findings import INERT, LEFT
from bowden.hardware.drives.odrive_frames import BROADCAST, AxisState, Cmd, identifier_of
from bowden.hardware.ports import Power, TorqueLeft
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from support.memory_bus import DriverLoop, asking

ENABLED, FAULT, DISABLED = DriveState.OPERATION_ENABLED, DriveState.FAULT, DriveState.SWITCH_ON_DISABLED


def complete(drive: Any, **changed: Any) -> Any:
    return asking(Rig(drive=drive).drive_parameters, **changed)


class Case(NamedTuple):
    """One family."""

    drive: Any
    fault: tuple[str, float, str]
    """As it is injected, the code that is told, and what its text says."""
    foreign: tuple[tuple[int, bytes], ...]
    """Frames that nobody but this host may send."""
    nobody: str
    """Of a number that no drive has."""
    silence: tuple[float, float] | None
    """Longest time from our last word to no torque [s], and the code that tells it, 0 for none; None of one that keeps
    it."""
    ends: str = "by an acknowledgement"
    """How a fault does."""


def on_a_line(drive: Any, current: float) -> Any:
    drive = drive._replace(motor_home=-0.5 * math.pi, answer_timeout=0.05)
    return asking(drive, lowest_motor=-0.3, highest_motor=2.0, current_limit=current)


CASES: Mapping[str, Case] = {
    "cia402": Case(
        complete(DriveParameters(), answer_timeout=0.1),
        ("0x3220", 0x3220, "undervoltage"),
        (
            *((canopen.RPDO1 + 1, bytes(6)), (canopen.NMT, b"\x01\x01"), (canopen.SYNC, b"")),
            *((canopen.SDO_REQUEST + 1, b"\x40\0\x10\0\0\0\0\0"), (canopen.HEARTBEAT + 127, b"\x05")),
        ),
        "no drive answers as node 9; there is node 1",
        (0.050, 0x8130),
    ),
    "ak_mit": Case(
        AkParameters(joint="none", answer_timeout=0.1),
        ("4", 4.0, "under-voltage"),
        ((1, ENTER),),
        "no drive replies as node 9",
        (0.030, 0.0),
        "by itself",
    ),
    "moteus": Case(
        complete(MoteusParameters(), answer_timeout=0.02),
        ("0x22", 34.0, "over-voltage"),
        ((0x8001 | EXTENDED, b"\x01\x00\x00"), (0x0100, b"\x21\x00\x0a")),
        "no moteus board answers as node 9",
        (0.040, moteus.TIMED_OUT),
    ),
    "odrive": Case(
        complete(OdriveParameters(), answer_timeout=0.1, joint="none"),
        ("10", 10.0, "DC_BUS_UNDER_VOLTAGE"),
        (
            (identifier_of(1, Cmd.SET_INPUT_POS), bytes(8)),
            (identifier_of(1, Cmd.GET_IQ) | REMOTE, b""),
            (identifier_of(BROADCAST, Cmd.ESTOP), b""),
        ),
        "no ODrive board is heard as node 9",
        (0.040, odrive.code_of(odrive.WATCHDOG)),
    ),
    "dynamixel": Case(
        on_a_line(DynamixelParameters(), 2.0),
        ("4", 4.0, "overheating"),
        ((1, b"\x03\x40\0\x01"), (0xFE, b"\x83\x40\0\x01\0\x01\x01")),
        "nobody answers as servo 9 at 1000000",
        None,
        "by a restart and a bring-up",
    ),
    "feetech": Case(
        on_a_line(FeetechParameters(), 1.5),
        ("0x20", 32.0, "overload"),
        ((1, b"\x03\x28\x01"),),
        "nobody answers as servo 9 at 1000000",
        None,
        "by itself",
    ),
}
EVERY = pytest.mark.parametrize("name", CASES)
ANSWERING = pytest.mark.parametrize("name", ["ak_mit", "moteus", "odrive"])
"""Families that answer each order, and have no heartbeat of their own that a bus would carry."""


def loop_of(name: str, overrides: Any = None, **changed: Any) -> DriverLoop:
    return DriverLoop(asking(CASES[name].drive, **changed), overrides)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("cia402", ("bowden digital twin at node 1",)),
        ("ak_mit", ("AK80-9 in MIT mode at node 1", "no frame shows", "16384 counts a turn")),
        ("moteus", ("firmware 1.1.1",)),
        ("odrive", ("firmware 0.6.10", "watchdog of 35 ms, tried", "16384 counts a turn")),
        ("dynamixel", ("XM430-W350 at servo 1, firmware 48",)),
        ("feetech", ("STS3215 at servo 1, firmware 3",)),
    ],
)
def test_it_is_brought_up_without_power_led_and_let_go_of(name: str, said: tuple[str, ...]) -> None:
    joint = {"joint": "cia406"} if getattr(CASES[name].drive, "joint", "") == "none" else {}
    loop = loop_of(name, **joint)
    loop.drive.write(0.0, Power.ON, loop.time)
    assert math.isnan(loop.drive.read(loop.time).motor)
    assert not loop.sent
    assert all(part in told for told in [loop.drive.bring_up()] for part in said)
    assert "torque_on" not in loop.events
    loop.run(20, Power.OFF)
    loop.run(40, Power.ON)
    readings = loop.run(400, Power.ON, speed=0.5)
    assert readings[-1].motor - readings[0].motor == pytest.approx(0.2, abs=0.03)
    assert abs(readings[-1].joint - loop.node.bench.joint) < 0.01
    assert readings[-1].sample_age == pytest.approx(1e-3)
    assert {(one.emergency, one.foreign, one.bus_errors) for one in readings} == {(0.0, 0.0, 0.0)}
    assert loop.drive.close() is TorqueLeft.OFF
    assert not loop.powered
    assert loop.drive.close() is TorqueLeft.OFF


@EVERY
def test_enabling_moves_nothing_and_a_target_that_is_none_takes_the_torque_off(name: str) -> None:
    loop = loop_of(name).up()
    before = loop.node.bench.motor
    for target in (math.nan, math.inf, -math.inf, 1e9):
        loop.run(40, Power.ON)
        for _ in range(2):
            loop.drive.read(loop.time)
            loop.drive.write(target, Power.ON, loop.time)
            loop.advance(1e-3)
        assert not loop.powered
        loop.run(10, Power.OFF)
    assert loop.node.bench.motor == pytest.approx(before, abs=0.02)


@EVERY
def test_a_fault_is_told_once_kept_and_ends_as_its_family_has_it(name: str) -> None:
    loop = loop_of(name).up()
    text, code, said = CASES[name].fault
    loop.inject(f"drive_fault {text}")
    told = loop.run(20, Power.ON)
    assert [reading.emergency for reading in told if reading.emergency] == [code]
    assert said in family_of(CASES[name].drive).explain(int(code))
    loop.run(20, Power.ON)
    assert not loop.powered
    if CASES[name].ends != "by itself":
        assert loop.run(20, Power.OFF)[-1].drive_state == FAULT
        loop.drive.reset_fault()
    if CASES[name].ends == "by a restart and a bring-up":
        assert all(math.isnan(one.motor) for one in loop.run(600, Power.OFF)[5:])  # its turn may be another
        loop.drive.bring_up()
    assert loop.run(600, Power.OFF)[-1].drive_state == DISABLED


@pytest.mark.parametrize(
    ("name", "overrides"),
    [*((name, None) for name in CASES if CASES[name].silence), ("odrive", {"watchdog_idle": 0.0})],
    ids=str,
)
def test_the_torque_is_off_in_time_after_our_last_word_and_comes_back_by_an_order_alone(
    name: str, overrides: Any
) -> None:
    loop, last_word = loop_of(name, overrides).up(), CASES[name].silence
    assert last_word is not None
    (longest, code), last = last_word, loop.time
    while loop.powered:
        loop.advance(1e-3)
    assert loop.time - last <= longest
    seen = loop.run(50, Power.ON)
    assert not code or code in {reading.emergency for reading in seen}
    assert not loop.powered
    loop.drive.reset_fault()
    loop.run(20, Power.ON)
    assert not loop.powered, "before it was wanted off"
    loop.drive.reset_fault()
    assert loop.run(20, Power.OFF)[-1].drive_state == DISABLED
    assert loop.run(40, Power.ON)[-1].drive_state == ENABLED


@pytest.mark.parametrize("fault", [("inert", INERT), ("mode_left", LEFT)], ids=str)
@pytest.mark.parametrize("name", ["ak_mit", "moteus", "odrive"])
def test_what_a_drive_does_not_say_is_seen_within_50_ms_of_a_motion(name: str, fault: tuple[str, int]) -> None:
    loop = loop_of(name).up()
    assert {reading.emergency for reading in loop.run(400, Power.ON, speed=0.35)} == {0.0}
    loop.inject(fault[0])
    code = INERT if name == "ak_mit" else fault[1]  # whose mode shows nowhere
    assert code in {reading.emergency for reading in loop.run(50, Power.ON, speed=1.0)}
    loop.node.faults.clear()
    loop.run(200, Power.ON)
    assert name != "ak_mit" or not loop.powered


@EVERY
def test_a_drive_that_has_restarted_is_not_believed_before_it_is_brought_up_again(name: str) -> None:
    loop = loop_of(name).up()
    loop.inject("reboot")
    reading = loop.run(600, Power.OFF)[-1]
    assert math.isnan(reading.motor) or (name == "cia402" and reading.motor_age > 500)
    assert reading.drive_state == DriveState.NOT_READY_TO_SWITCH_ON
    loop.run(50, Power.ON)
    assert not loop.powered
    loop.up()


@EVERY
def test_frames_of_another_drive_are_no_readings_and_those_of_another_master_are_foreign(name: str) -> None:
    loop = loop_of(name).up()
    if "foreign_replies" not in loop.node.lacks:
        loop.inject("foreign_replies")
        readings = loop.run(50, Power.ON)
        assert {(reading.foreign, reading.emergency) for reading in readings} == {(0.0, 0.0)}
    loop.drain()
    for identifier, data in CASES[name].foreign:
        loop.put(identifier, data)
    assert loop.drive.read(loop.time).foreign == len(CASES[name].foreign)


@EVERY
def test_nobody_and_another_master_are_told_before_anything_is_said(name: str) -> None:
    with pytest.raises(DriveError, match=CASES[name].nobody):
        family_of(CASES[name].drive).open(CASES[name].drive._replace(node_id=9), _links(loop_of(name))).bring_up()
    for frame in CASES[name].foreign:
        loop = loop_of(name)
        loop.put(*frame)
        with pytest.raises(DriveError, match=r"another master|the number of this computer"):
            loop.drive.bring_up()
        assert loop.sent == []


def _links(bus: can.BusABC) -> Any:
    from bowden.hardware.buses.link import Links

    return Links(bus, bus)


@ANSWERING
def test_bit_errors_of_a_loosened_ground_are_counted_and_lead_to_no_wrong_reading(name: str) -> None:
    loop = loop_of(name).up()
    loop.inject("bit_errors 0.01")
    readings = loop.run(1000, Power.ON, speed=0.1)
    assert 2 <= readings[-1].bus_errors <= 140
    assert {reading.emergency for reading in readings} == {0.0}
    assert max(abs(b.motor - a.motor) for a, b in itertools.pairwise(readings)) < 0.02


@pytest.mark.parametrize("name", ["ak_mit", "odrive", "dynamixel"])
def test_a_hint_tells_in_which_turn_the_rotor_is_and_here_is_where_it_is_found(name: str) -> None:
    for home, expected in (("hint", 0.1), ("here", 0.3)):
        loop = loop_of(name, home=home, motor_hint=0.15, motor_home=0.3 if home == "here" else 0.0)
        loop.node._shift = -3.0 * loop.node.turn
        loop.drive.bring_up()
        assert loop.run(5, Power.OFF)[-1].motor == pytest.approx(expected, abs=0.01)


UNFIT: Mapping[str, list[tuple[dict[Any, Any], dict[str, Any], str]]] = {
    "cia402": [
        ({(0x1000, 0): 0x0003_0191}, {}, "device profile 401"),
        ({(0x1000, 0): 0x0001_0192}, {}, "type 1 .*expected type 2, a servo drive"),
        ({(0x6502, 0): 0x25}, {}, "does not know cyclic synchronous position"),
        ({(0x6502, 0): None}, {}, "has no object 6502h"),
        ({(0x6060, 0): None}, {}, "refuses 6060h"),
        ({(0x6061, 0): 1}, {}, "stays in mode 1 .6061h.; expected 8"),
        ({(0x6061, 0): None}, {}, "has no object 6061h"),
        ({(0x1A01, 2): None}, {}, "refuses 1A01h:2"),
        ({(0x1016, 1): None}, {}, "refuses 1016h:1"),
        ({(0x6007, 0): None}, {}, "refuses 6007h"),
        ({(0x6076, 0): 0}, {}, "rated torque"),
        ({(0x6076, 0): 1}, {"current_limit": 20.0}, "the rig's largest is 20 A"),
        ({(0x608F, 1): 4096, (0x608F, 2): 1}, {}, "counts_per_turn is 16384; expected 4096, as node"),
        ({(0x6091, 1): 5, (0x6091, 2): 1}, {}, "behind a gear of 5:1"),
        ({(0x607D, 1): -1000, (0x607D, 2): 100_000}, {"lowest_motor": -1.0}, "lowest motor angle is -57.2958°, beyond"),
        ({(0x607D, 1): -1000, (0x607D, 2): 10_000}, {"highest_motor": 3.0}, "highest motor angle is 171.887°, beyond"),
        (
            {(0x6064, 0): 2**31 - 1000},
            {"home": "here", "highest_motor": 0.2},
            "highest motor angle is 11.4592°, beyond",
        ),
        ({}, {"motor_counts_per_turn": 9e8, "lowest_motor": -3.5}, "lowest motor angle is -200.535°, beyond"),
        ({(0x6080, 0): 100}, {"speed_limit": 30.0}, "speed limit is 1718.87°/s, beyond .*6080h"),
        ({(0x60A9, 0): 0xFDB4_4700, (0x6080, 0): 100_000}, {"speed_limit": 30.0}, "beyond .* 120°/s"),
        ({(0x60A9, 0): 0x00B4_0300}, {"speed_limit": 1.0}, "unit that is not known here .60A9h is 0x00B40300."),
        ({(0x6065, 0): 1000}, {"following_error": 1.0}, "following error is 57.2958°, beyond"),
        ({(0x1802, 1): None}, {"emergency_stop_input": 3}, "does not send its digital inputs in every cycle"),
        ({(0x3001, 2): 5000}, {"current_limit": 20.0}, "current limit is 20 A, beyond the drive's own 5 A"),
    ],
    "ak_mit": [
        ({}, {"highest_motor": 13.0}, r"within ±12\.3 rad"),
    ],
    "moteus": [
        ({0x102: 4.0}, {}, "version 4 of the register map"),
        ({0x000: 10.0}, {}, r"runs already: it is in mode 10 \(position\)"),
        ({"servo.timeout_mode": 12.0}, {}, "keeps its torque when its host falls silent"),
        ({"servo.timeout_mode": None}, {}, "ERR"),
        ({"servo.fixed_voltage_mode": 1.0}, {}, "fixed_voltage_mode is 1"),
        ({"servo.default_accel_limit": 5.0}, {}, "plans a motion of its own"),
        ({"servo.pid_position.kp": 0.0}, {}, "no gain"),
        ({"motor_position.rotor_to_output_ratio": 0.2}, {}, "rotor_to_output_ratio is 0.2"),
        ({"motor_position.sources.1.aux_number": 1.0}, {}, "no encoder in slot 1"),
        ({0x058: 1.0}, {}, "no valid reading"),
        ({0x052: 8192.0}, {}, "in counts"),
        ({0x052: None}, {}, "no register 052h"),
        ({0x00C: 1.0}, {}, "within a turn of the rotor alone"),
        ({"servopos.position_max": 0.1}, {}, "highest motor angle"),
        ({"servo.max_velocity": 0.5}, {}, "speed limit"),
        ({"servo.max_current_A": 1.0}, {}, "current limit"),
        ({"servo.fault_position_error": 0.001}, {}, "following error"),
        ({0x027: 0.1}, {}, "watchdog of 0.1 s"),
    ],
    "odrive": [
        ({"axis0.config.enable_watchdog": 0.0}, {}, "keeps its torque when its host falls silent"),
        ({"axis0.config.watchdog_timeout": 0.1}, {}, "watchdog_timeout is 0.1"),
        ({"axis0.config.enable_watchdog": None}, {}, "does not tell its setting axis0.config.enable_watchdog"),
        ({"axis0.config.can.heartbeat_msg_rate_ms": 10.0}, {}, r"heartbeat_msg_rate_ms is 10\); expected 5"),
        ({"axis0.config.can.input_torque_scale": 100.0}, {}, "input_torque_scale is 100"),
        ({"axis0.controller.config.circular_setpoints": 1.0}, {}, "circular_setpoints is 1"),
        ({"axis0.controller.config.absolute_setpoints": 0.0}, {}, 'set home = "here"'),
        ({"axis0.controller.config.input_mode": 3.0}, {}, "input_mode 3 after 1 was written"),
        ({"axis0.controller.config.vel_limit": 0.5}, {}, "speed limit"),
        ({"axis0.config.motor.current_soft_max": 1.0}, {}, "current limit"),
        ({"axis0.config.motor.torque_constant": 0.04}, {}, "torque_constant is 0.04"),
        ({"axis0.config.load_encoder": 5.0}, {}, "from encoder 5 and commutates by encoder 13"),
        ({"axis_state": 8.0, "axis0.config.enable_watchdog": 0.0}, {}, r"state 8 \(CLOSED_LOOP_CONTROL\)"),
        ({"firmware_minor": 5.0}, {}, "firmware 0.5.10"),
        ({"firmware_revision": 11.0}, {}, "which drive.endpoints is for"),
        ({"protocol": 1.0}, {}, "version 1 of its protocol"),
    ],
    "dynamixel": [
        ({64: 1}, {}, "runs already"),
        ({0: 6, 1: 4}, {}, "correct drive.model"),
        ({9: 250}, {}, "Return Delay Time is 250"),
        ({11: 3}, {}, "Operating Mode is 3"),
        ({98: 0}, {}, "Bus Watchdog 0 after 2"),
        ({10: 1}, {}, "Drive Mode is 1"),
        ({38: 10, 39: 0}, {}, "beyond the drive's own"),
        ({38: 255, 39: 15}, {"model": "PH54-200-S500"}, "may draw more"),
        ({6: 52}, {"model": "XL330-M288"}, "firmware with different addresses"),
        ({}, {"motor_home": 0.0}, "after power-off"),
    ],
    "feetech": [
        ({40: 1}, {}, "runs already"),
        ({3: 4}, {}, "model number 772"),
        ({7: 250}, {}, "Return Delay Time is 250"),
        ({33: 1}, {}, "Operating Mode is 1"),
        ({9: 0, 10: 8}, {}, "finds itself between 2048 and 4095"),
        ({48: 7, 49: 0}, {}, "Torque Limit 7 after 500"),
    ],
}
"""Family → what of the twin is otherwise, what of the rig, and what is said of it."""


def gives_torque(name: str, identifier: int, data: bytes) -> bool:
    """Whether a frame of ours might give a drive torque."""
    if name == "cia402":
        return identifier == canopen.RPDO1 + 1 and data[:1] == b"\x0f"
    if name == "ak_mit":
        return data != EXIT
    if name == "moteus":
        return data[:2] == b"\x01\x00" and data[2] != moteus.BoardMode.STOPPED
    if name in ("dynamixel", "feetech"):
        register = CASES[name].drive.table.registers["Torque Enable"].address
        return data[:2] == bytes((Instruction.SYNC_WRITE, register)) and data[-1] != 0
    closed = odrive.pack(Cmd.SET_AXIS_STATE, AxisState.CLOSED_LOOP_CONTROL)
    return identifier == identifier_of(1, Cmd.SET_AXIS_STATE) and data == closed


@pytest.mark.parametrize(("name", "row"), [(name, row) for name in UNFIT for row in UNFIT[name]], ids=str)
def test_a_drive_that_does_not_fit_is_refused_in_a_line_and_without_power(
    name: str, row: tuple[dict[Any, Any], dict[str, Any], str]
) -> None:
    overrides, changed, said = row
    drive = DriveParameters() if name == "cia402" else CASES[name].drive  # without limits of a rig
    timeout = 0.05 if name == "cia402" else 0.02
    loop = DriverLoop(asking(drive, **{"answer_timeout": timeout, **changed}), overrides)
    with pytest.raises(DriveError, match=said) as refused:
        loop.drive.bring_up()
    assert "\n" not in str(refused.value)
    loop.run(20, Power.ON)
    assert "torque_on" not in loop.events
    assert not any(gives_torque(name, identifier, data) for _, identifier, data in loop.sent)


NONSENSE: Mapping[str, list[tuple[dict[str, Any], str]]] = {
    "cia402": [
        *(({"node_id": one}, "node_id") for one in (0, 127)),
        ({"host_id": 1}, "host_id"),
        *(({"gear": one}, "gear") for one in (0.0, math.nan)),
        ({"motor_direction": 0}, "motor_direction"),
        ({"joint_direction": 2}, "joint_direction"),
        ({"motor_counts_per_turn": math.inf}, "motor_counts_per_turn"),
        ({"joint_counts_per_turn": -1.0}, "joint_counts_per_turn"),
        ({"motor_home": math.nan}, "motor_home"),
        *(({"sample_time": one}, "sample_time") for one in (0.0005, 0.0015)),
        ({"heartbeat_timeout": 0.05}, "heartbeat_timeout"),
        ({"heartbeat_time": 0.02}, "heartbeat_ms"),
        ({"lowest_motor": 1.0, "highest_motor": 0.0}, "motor_high_deg"),
        ({"torque_constant": 0.0}, "torque_constant"),
        ({"tension_scale": math.inf}, "tension_n_per_mv"),
        ({"current_limit": -1.0}, "current_limit"),
    ],
    "ak_mit": [
        ({"stiffness": 501.0}, "stiffness"),
        ({"damping": 5.1}, "damping"),
        ({"gear": 6.0}, "has 9"),
        ({"speed_limit": 50.0}, "speed limit"),
        ({"current_limit": 22.0}, "at most 17.64 N"),
        ({"watchdog": 0.002}, "three cycles"),
        ({"model": "AK99"}, "AK80-9"),
        ({"temperature_zero": 41}, "0 or 40"),
        ({"joint_counts_per_turn": 0.5}, "whole number"),
        ({"joint": "cia406", "reply_id": 0}, "CANopen"),
        ({"joint": "cia406", "reply_id": 0x1A0}, "CANopen"),
    ],
    "moteus": [
        ({"watchdog": 0.045}, "watchdog_ms is 45"),
        ({"host_id": 1}, "host_id"),
        ({"can_prefix": 0x2000}, "can_prefix is 8192; expected at least 0 and at most 8191"),
    ],
    "odrive": [
        ({"watchdog": 0.045}, "watchdog_ms is 45"),
        ({"node_id": 63}, "node_id"),
        ({"heartbeat": 0.1}, "heartbeat"),
        ({"highest_motor": 2000.0}, "1024 turns"),
        ({"velocity_scale": 10_000}, "all that a target's field can tell"),
        ({"joint": "cia406", "node_id": 0}, "CANopen's for the joint's encoder"),
        ({"joint": "cia406", "node_id": 13}, "CANopen's for the joint's encoder"),
        ({"joint": "cia406", "node_id": 48}, "ask CANopen devices who they are"),
    ],
    "dynamixel": [({"highest_motor": 6.5}, "forgets at power-off"), ({"sample_time": 1e-3}, "too short")],
    "feetech": [({"highest_motor": 6.5}, "forgets at power-off")],
}
"""Family → keys, and what is said of them."""


@pytest.mark.parametrize(("name", "row"), [(name, row) for name in NONSENSE for row in NONSENSE[name]], ids=str)
def test_what_makes_no_sense_is_refused_before_a_bus_is_opened(name: str, row: tuple[dict[str, Any], str]) -> None:
    drive = CASES[name].drive
    with pytest.raises(ParameterError, match=row[1]):
        family_of(drive).open(asking(drive, **row[0]), None)
    if name in ("moteus", "odrive"):
        assert family_of(drive).watchdog(drive._replace(watchdog=0.039)) <= 0.040


_SHARED: dict[str, DriverLoop] = {}
MODEL = MODELS["v2"]["AK80-9"]


def check_sent(name: str, identifier: int, data: bytes) -> None:
    """What goes out to a drive in a run is a target of the rig's or no power, whatever has come."""
    drive = CASES[name].drive
    if name == "ak_mit":
        command = unpack_command(data, MODEL) if identifier == 1 else None
        if command is not None:
            assert abs(command.position) <= 12.3 + 1e-3
            assert command.kp <= drive.stiffness + 0.1
            assert command.kd <= drive.damping + 0.01
            assert abs(command.torque) <= 0.01
    elif name == "moteus":
        assert identifier == 0x2001 | moteus.REPLY_WANTED
        for one in moteus.subframes(data):
            if one.head == moteus.WRITE:
                target = one.value if one.at == moteus.Register.COMMAND_POSITION else 0.0
                assert math.isnan(target) or abs(target) < 1e-6
    elif name == "odrive":
        assert identifier >> 5 == 1
        if identifier == identifier_of(1, Cmd.SET_INPUT_POS):
            sent = odrive.unpack_target(data, (1000.0, 1000.0))
            assert sent is not None
            assert abs(sent.position) <= 2.0 * odrive.MOST_TURNS
            assert abs(sent.velocity) <= 1e-3 + 15.0 * 5.0
            assert sent.torque == 0.0


def check_order(sent: list[tuple[float, int, bytes]], state: float, target: float, power: Power) -> None:
    """The controlword of a CiA 402 drive is whole, first, and no more than was wanted of a drive in that state."""
    assert [cob_id for _, cob_id, _ in sent][:2] == [canopen.RPDO1 + 1, canopen.SYNC]
    control, _ = canopen.ORDER.unpack(sent[0][2], 2) or (None, None)
    assert control in set(Controlword)
    if control == Controlword.ENABLE_OPERATION:
        assert power is Power.ON
        assert math.isfinite(target)
        assert state in (DriveState.SWITCHED_ON, ENABLED)
    if control == Controlword.FAULT_RESET:
        assert state == FAULT


def attack(name: str, frames: list[tuple[int, bytes]], target: float, power: Power, reset: bool) -> None:
    """Frames in the middle of a run, to the driver and to the twin: nothing is raised by either."""
    target = target if name == "cia402" else 0.0
    if name not in _SHARED:
        _SHARED[name] = loop_of(name).up()
    loop = _SHARED[name]
    for identifier, data in frames:
        loop.put(identifier, data)
        loop.sent.clear()
        reading = loop.drive.read(loop.time)
        if reset:
            loop.drive.reset_fault()
        loop.drive.write(target, power, loop.time)
        for _, sent_to, sent in loop.sent:
            check_sent(name, sent_to, sent)
        if name == "cia402":
            check_order(loop.sent, reading.drive_state, target, power)
        assert reading.heartbeat_age >= 0.0
        assert 0.0 <= reading.emergency <= EMERGENCY_STOP
        assert reading.drive_state in set(DriveState)
        assert not math.isinf(reading.motor)
        loop.node.receive(identifier & 0x1FFF_FFFF if name == "ak_mit" else identifier, data, loop.time)
        loop.drain()
        loop.time += 1e-3
    loop.advance(1e-3)
    assert math.isfinite(loop.node.bench.motor)


FROM_BOARD = st.builds(identifier_of, st.just(1), st.sampled_from(sorted(odrive.TOLD)))
BEATS = st.builds(odrive.pack, st.just(Cmd.HEARTBEAT), st.integers(0, 2**32 - 1), st.integers(0, 255))
NUMBERS = st.builds(odrive.pack, st.just(Cmd.GET_IQ), st.floats(width=32), st.floats(width=32))
SOME = st.floats(width=32)
BYTE = st.integers(-128, 127)
REPLIES = st.builds(
    lambda mode, four, hot, joint, timeout: b"".join(
        moteus.values(moteus.REPLY, kind, register, *said)
        for kind, register, said in (
            (moteus.NumberKind.INT8, moteus.Register.MODE, (mode,)),
            (moteus.NumberKind.FLOAT, moteus.Register.POSITION, four),
            (moteus.NumberKind.INT8, moteus.Register.TEMPERATURE, (hot, mode)),
            (moteus.NumberKind.FLOAT, moteus.SOURCES[1], (joint,)),
            (moteus.NumberKind.INT8, moteus.Register.ENCODER_VALIDITY, (mode,)),
            (moteus.NumberKind.FLOAT, moteus.Register.COMMAND_TIMEOUT, (timeout,)),
        )
    ),
    BYTE,
    st.lists(SOME, min_size=4, max_size=4),
    BYTE,
    SOME,
    SOME,
)
ANGLES = st.floats(-10.0, 10.0) | st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e300, 1e5, 5e-324])
WANTED = st.tuples(ANGLES, st.sampled_from([Power.ON, *Power]), st.booleans())
HEADS = st.sampled_from([b"\x21\x00", b"\x2c\x04\x01", b"\x01\x00", b"\x40\x01", b"\x42\x01"])
ON_A_LINE = st.tuples(
    st.sampled_from((1, 2, 3, 0xFE)),
    st.binary(max_size=16) | st.binary(min_size=1, max_size=14).map(lambda rest: bytes((STATUS,)) + rest),
)
FRAMES = {
    "cia402": st.tuples(
        st.sampled_from([0x000, 0x080, 0x201, 0x601, 0x77F, 0x181, 0x281, 0x381, 0x581, 0x701]) | st.integers(0, 0x7FF),
        st.binary(max_size=8),
    ),
    "ak_mit": st.tuples(
        st.sampled_from((1, 2, 0, 0x80, 0x1A0, 0x0A0, 0x720, 0x2000_0001, 0x4000_0001, 0x8000_0001))
        | st.integers(0, 0x7FF),
        st.binary(max_size=8) | st.binary(min_size=7, max_size=7).map(lambda rest: b"\x01" + rest),
    ),
    "moteus": st.tuples(
        st.sampled_from([0x0120, 0x0120 | EXTENDED, 0x8001 | EXTENDED, 0x0100, 0x2001]) | st.integers(0, 0xFFFF_FFFF),
        st.binary(max_size=64) | st.tuples(HEADS, st.binary(max_size=60)).map(b"".join) | REPLIES,
    ),
    "odrive": st.tuples(
        FROM_BOARD | st.integers(0, 0x7FF) | st.integers(0, 0xFFFF_FFFF), st.binary(max_size=8) | BEATS | NUMBERS
    ),
    "dynamixel": ON_A_LINE,
    "feetech": ON_A_LINE,
}
"""Family → frames of the drive's, of its host's and of others, whole and malformed."""


@EVERY
@given(st.data())
@settings(max_examples=60, deadline=None)
def test_no_frame_raises_or_leads_to_an_unsafe_target(name: str, data: st.DataObject) -> None:
    attack(name, data.draw(st.lists(FRAMES[name], min_size=1, max_size=20)), *data.draw(WANTED))


@pytest.mark.long
@EVERY
@given(st.data())
@settings(max_examples=1_000, deadline=None)
def test_no_frame_of_100_000_raises_or_leads_to_an_unsafe_target(name: str, data: st.DataObject) -> None:
    attack(name, data.draw(st.lists(FRAMES[name], min_size=100, max_size=100)), *data.draw(WANTED))


class Stalling(DriverLoop):
    """A drive that does nothing for a while, and then answers all at once."""

    stalls = False

    def __init__(self, drive: Any) -> None:
        self._kept: list[can.Message] = []
        super().__init__(drive)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.stalls:
            self._kept.append(copy.deepcopy(msg))  # which is filled anew for the next frame
        else:
            super().send(msg, timeout)

    def wake(self) -> None:
        self.stalls = False
        for msg in self._kept:
            super().send(msg)


@EVERY
@pytest.mark.parametrize("stall", [10, 40, 60])
def test_a_drive_that_answers_late_and_all_at_once_is_not_another_masters(name: str, stall: int) -> None:
    loop = Stalling(CASES[name].drive)
    loop.drive.bring_up()
    loop.run(20, Power.OFF)
    loop.stalls = True
    loop.run(stall, Power.OFF)
    loop.wake()
    assert sum(reading.foreign for reading in loop.run(100, Power.OFF)) == 0.0


def test_replies_to_orders_that_were_not_ours_are_another_masters() -> None:
    loop = loop_of("ak_mit")
    loop.drive.bring_up()
    loop.run(5, Power.READY)
    for _ in range(20):
        loop.put(1, pack_reply(AkReply(1, 0.0, 0.0, 0.0, 30, 0, False), MODEL))
    assert loop.run(1, Power.READY)[-1].foreign > 1.0
