"""An ODrive board: frames, the driver against the twin in memory, what bring-up refuses, what frames cannot do."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.drives import odrive_endpoints, odrive_setup
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.families.odrive import FAMILY, OdriveParameters, check_parameters, target_of
from bowden.hardware.drives.odrive_drive import OdriveDrive
from bowden.hardware.drives.odrive_frames import ERRORS, UNTOLD, AxisState, Cmd, Scales, Target, code_of, identifier_of
from bowden.hardware.drives.scale import motor_limits
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.odrive_node import OdriveNode
from bowden.hardware.twin.plant import OFF
from bowden.rig.rig import Rig
from live_runs import SHARED, assert_replays, finished_well
from support.memory_bus import DrivenBus

RIG = Rig(drive=OdriveParameters())
WITH_JOINT = RIG.drive_parameters._replace(answer_timeout=0.1)
DRIVE = WITH_JOINT._replace(joint="none")
ENABLED, IDLE = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED
SCALES = Scales(1000.0, 1000.0)


class Bench(DrivenBus):
    """The memory bus with a board on it, and a drive that is its host."""

    def __init__(self, overrides: Mapping[str, float | None] | None = None, drive: OdriveParameters = DRIVE) -> None:
        super().__init__()
        plant = TwinBench(RIG.bench, RIG.bend_path, 5.0, RIG.seed, RIG.start_motor, self.time)
        self.node = OdriveNode(drive, plant, self.put, self.note, overrides)
        self.attach(self.node)
        self.drive = OdriveDrive(drive, Links(self))

    def up(self) -> "Bench":
        """Brought up, and in closed loop."""
        self.drive.bring_up()
        assert self.run(20, Power.OFF)[-1].drive_state == IDLE
        assert self.run(30, Power.ON)[-1].drive_state == ENABLED
        return self

    @property
    def powered(self) -> bool:
        return bool(self.node.bench.doing != OFF)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(odrive_setup, "LISTENING", 0.02)


@given(st.floats(-1000, 1000, width=32), st.floats(-32.7, 32.7), st.floats(-32.7, 32.7))
def test_a_target_comes_back_within_half_a_step(position: float, velocity: float, torque: float) -> None:
    back = frames.unpack_target(frames.pack_target(Target(position, velocity, torque), SCALES), SCALES)
    assert back is not None
    assert back.position == position
    assert abs(back.velocity - velocity) <= 0.5001e-3
    assert abs(back.torque - torque) <= 0.5001e-3


def test_feed_forward_beyond_its_field_stands_at_its_end_and_none_is_zero() -> None:
    data = frames.pack_target(Target(1.0, 1e9, math.nan), SCALES)
    assert frames.unpack_target(data, SCALES) == Target(1.0, 32.767, 0.0)


def test_a_board_is_brought_up_led_and_let_go_of_with_its_joint() -> None:
    bus = Bench(drive=WITH_JOINT)
    said = bus.drive.bring_up()
    assert "firmware 0.6.10" in said
    assert "watchdog of 35 ms, tried" in said
    assert "16384 counts a turn" in said
    assert not any(event == "torque_on" for _, event, _ in bus.journal)
    bus.run(20, Power.OFF)
    assert bus.run(30, Power.ON)[-1].drive_state == ENABLED
    readings = bus.run(300, Power.ON, speed=0.5)
    assert readings[-1].motor - readings[0].motor == pytest.approx(0.15, abs=0.03)
    assert abs(readings[-1].joint - bus.node.bench.joint) < 0.01
    assert readings[-1].sample_age == pytest.approx(1e-3)
    assert {reading.emergency for reading in readings} == {0.0}
    assert bus.drive.close() is TorqueLeft.OFF
    assert not bus.powered
    assert bus.drive.close() is TorqueLeft.OFF


def test_closed_loop_is_asked_for_once() -> None:
    bus = Bench()
    bus.drive.bring_up()
    bus.run(20, Power.OFF)
    bus.sent.clear()
    bus.run(60, Power.ON)
    asked = [data for _, identifier, data in bus.sent if identifier == identifier_of(1, Cmd.SET_AXIS_STATE)]
    assert len(asked) == 1


@pytest.mark.parametrize("idle", [1.0, 0.0], ids=["a watchdog that always runs", "one that runs in closed loop alone"])
def test_the_torque_is_off_40_ms_after_our_last_word_and_comes_back_by_an_operator_alone(idle: float) -> None:
    bus = Bench({"watchdog_idle": idle}).up()
    last = bus.time
    while bus.powered:
        bus.advance(1e-3)
    assert bus.time - last <= 0.040
    seen = bus.run(50, Power.ON)
    code = code_of(0x0100_0000)
    assert code in {reading.emergency for reading in seen}
    assert "watchdog" in FAMILY.explain(code)
    bus.run(50, Power.OFF)
    bus.run(50, Power.ON)
    assert not bus.powered
    bus.run(5, Power.OFF)
    bus.drive.reset_fault()
    assert bus.run(20, Power.OFF)[-1].drive_state == IDLE
    assert bus.run(30, Power.ON)[-1].drive_state == ENABLED


def test_a_watchdog_that_does_not_run_while_idle_is_read_and_said_to_be_untried() -> None:
    assert "read back and not tried" in Bench({"watchdog_idle": 0.0}).drive.bring_up()


def test_every_error_of_the_protocol_has_a_text_of_its_own() -> None:
    texts = {FAMILY.explain(code_of(flag)) for flag in ERRORS}
    assert len(texts) == len(ERRORS)
    assert "not known" in FAMILY.explain(8)


def test_an_emergency_stop_is_one_and_our_own_is_none() -> None:
    bus = Bench().up()
    bus.inject("emergency_stop")
    assert EMERGENCY_STOP in {reading.emergency for reading in bus.run(20, Power.ON)}
    bus = Bench().up()
    readings = bus.run(20, Power.QUICK_STOP)
    assert not bus.powered
    assert EMERGENCY_STOP not in {reading.emergency for reading in readings}
    assert readings[-1].drive_state == DriveState.FAULT


def test_a_board_that_does_not_go_to_idle_is_stopped() -> None:
    bus = Bench().up()
    bus.node._request = lambda state, now: None  # type: ignore[method-assign]
    bus.run(50, Power.OFF)
    assert not bus.powered


def test_a_board_that_refuses_closed_loop_is_told() -> None:
    bus = Bench()
    bus.drive.bring_up()
    bus.run(20, Power.OFF)
    bus.node._request = lambda state, now: None  # type: ignore[method-assign]
    assert UNTOLD in {reading.emergency for reading in bus.run(700, Power.ON)}


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"axis0.config.enable_watchdog": 0.0}, "keeps its torque when its host falls silent"),
        ({"axis0.config.watchdog_timeout": 0.1}, "watchdog_timeout is 0.1"),
        ({"axis0.config.enable_watchdog": None}, "does not tell its setting axis0.config.enable_watchdog"),
        ({"axis0.config.can.heartbeat_msg_rate_ms": 10.0}, r"heartbeat_msg_rate_ms is 10\); expected 5"),
        ({"axis0.config.can.input_torque_scale": 100.0}, "input_torque_scale is 100"),
        ({"axis0.controller.config.circular_setpoints": 1.0}, "circular_setpoints is 1"),
        ({"axis0.controller.config.absolute_setpoints": 0.0}, 'set home = "here"'),
        ({"axis0.controller.config.input_mode": 3.0}, "input_mode 3 after 1 was written"),
        ({"axis0.controller.config.vel_limit": 0.5}, "speed limit"),
        ({"axis0.config.motor.current_soft_max": 1.0}, "current limit"),
        ({"axis0.config.motor.torque_constant": 0.04}, "torque_constant is 0.04"),
        ({"axis0.config.load_encoder": 5.0}, "from encoder 5 and commutates by encoder 13"),
        ({"axis_state": 8.0, "axis0.config.enable_watchdog": 0.0}, r"state 8 \(CLOSED_LOOP_CONTROL\)"),
        ({"firmware_minor": 5.0}, "firmware 0.5.10"),
        ({"firmware_revision": 11.0}, "which drive.endpoints is for"),
        ({"protocol": 1.0}, "version 1 of its protocol"),
    ],
)
def test_a_board_that_does_not_fit_is_refused_without_power(overrides: Mapping[str, float | None], said: str) -> None:
    bus = Bench(overrides, DRIVE._replace(answer_timeout=0.02))
    with pytest.raises(DriveError, match=said):
        bus.drive.bring_up()
    assert not any(event == "torque_on" for _, event, _ in bus.journal)
    closed = frames.pack(Cmd.SET_AXIS_STATE, AxisState.CLOSED_LOOP_CONTROL)
    assert not any(data == closed for _, _, data in bus.sent)


def test_nobody_and_another_master_are_told_before_anything_is_said() -> None:
    bus = Bench()
    with pytest.raises(DriveError, match="no ODrive board is heard as node 9"):
        OdriveDrive(DRIVE._replace(node_id=9), Links(bus)).bring_up()
    bus.put(identifier_of(1, Cmd.SET_INPUT_POS), bytes(8))
    with pytest.raises(DriveError, match="another master speaks to node 1"):
        bus.drive.bring_up()
    assert bus.sent == []


def test_a_hint_tells_in_which_turn_the_rotor_is_and_here_is_where_it_is_found() -> None:
    for home, expected in (("hint", 0.0), ("here", 0.3)):
        drive = DRIVE._replace(home=home, motor_hint=0.2, motor_home=0.3 if home == "here" else 0.0)
        bus = Bench(drive=drive)
        bus.node._shift = -3.0
        bus.drive.bring_up()
        assert bus.run(5, Power.OFF)[-1].motor == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"watchdog": 0.045}, "watchdog_ms is 45"),
        ({"node_id": 63}, "node_id"),
        ({"heartbeat": 0.1}, "heartbeat"),
        ({"highest_motor": 2000.0}, "1024 turns"),
        ({"velocity_scale": 10_000}, "all that a target's field can tell"),
        ({"joint": "cia406", "node_id": 0}, "CANopen's for the joint's encoder"),
        ({"joint": "cia406", "node_id": 13}, "CANopen's for the joint's encoder"),
        ({"joint": "cia406", "node_id": 48}, "ask CANopen devices who they are"),
    ],
)
def test_what_makes_no_sense_is_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        check_parameters(DRIVE._replace(**changed))
    assert FAMILY.watchdog(DRIVE._replace(watchdog=0.039)) <= 0.040


def test_the_makers_list_says_where_settings_are_and_a_bad_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flat_endpoints.json"
    where = {name: {"id": 200 + k, "type": kind} for k, (name, kind) in enumerate(odrive_endpoints.USED.items())}
    tree = {"fw_version": "0.6.11-1", "hw_version": "4.4.58", "endpoints": where}
    path.write_text(json.dumps(tree))
    drive = DRIVE._replace(endpoints=str(path))
    assert "hardware 4.4.58, firmware 0.6.11" in Bench(drive=drive).drive.bring_up()
    for bad in ("[]", "{", json.dumps(tree | {"fw_version": "?"}), json.dumps(tree | {"endpoints": {}})):
        path.write_text(bad)
        with pytest.raises(ParameterError, match="not the maker's"):
            OdriveDrive(drive)
    with pytest.raises(ParameterError, match="cannot read"):
        OdriveDrive(DRIVE._replace(endpoints=str(tmp_path / "none")))


def test_the_makers_list_is_found_from_the_rigs_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "board"
    folder.mkdir()
    rig, drive = folder / "rig.toml", '[drive]\nfamily = "odrive"\n'
    rig.write_text(drive + 'endpoints = "flat_endpoints.json"\n')
    monkeypatch.chdir(tmp_path)
    assert Rig.read("board/rig.toml").drive_parameters.endpoints == str(Path("board/flat_endpoints.json"))
    rig.write_text(drive + f'endpoints = "{folder / "other.json"}"\n')
    assert Rig.read("board/rig.toml").drive_parameters.endpoints == str(folder / "other.json")
    rig.write_text(drive)
    assert Rig.read("board/rig.toml").drive_parameters.endpoints == "twin"


def test_a_target_never_asks_for_more_speed_or_torque_than_the_rig() -> None:
    limits = motor_limits(DRIVE, odrive_setup.motor_scale(DRIVE))
    drive = DRIVE._replace(torque_offset=0.1)
    for before in (-5.0, 0.0, 0.0999, 5.0, math.nan):
        target = target_of(drive, limits, 0.1, before, 1e6)
        assert abs(target.velocity) <= limits.speed
        assert abs(target.torque) <= 0.1 / drive.gear + 1e-12
    assert target_of(drive, limits, 0.1, math.nan, math.nan)[1:] == (0.0, 0.0)


_SHARED: list[Bench] = []


def attacked(identifier: int, data: bytes) -> None:
    """A frame in the middle of a run: nothing is raised, and what goes out is a target of the rig's or no power."""
    if not _SHARED:
        _SHARED.append(Bench().up())
    bus = _SHARED[0]
    bus.put(identifier, data)
    bus.sent.clear()
    reading = bus.drive.read(bus.time)
    bus.drive.write(0.0, Power.ON, bus.time)
    for _, sent_to, sent in bus.sent:
        assert sent_to >> 5 == 1
        if sent_to == identifier_of(1, Cmd.SET_INPUT_POS):
            target = frames.unpack_target(sent, SCALES)
            assert target is not None
            assert abs(target.position) <= 2.0 * frames.MOST_TURNS
            assert abs(target.velocity) <= 1e-3 + 15.0 * 5.0
            assert target.torque == 0.0
    assert reading.heartbeat_age >= 0.0
    bus.node.receive(identifier, data, bus.time)
    bus.drain()
    bus.time += 1e-3


FROM_BOARD = st.builds(identifier_of, st.just(1), st.sampled_from(sorted(frames.TOLD)))
IDENTIFIERS = FROM_BOARD | st.integers(0, 0x7FF) | st.integers(0, 0xFFFF_FFFF)
BEATS = st.builds(frames.pack, st.just(Cmd.HEARTBEAT), st.integers(0, 2**32 - 1), st.integers(0, 255))
NUMBERS = st.builds(frames.pack, st.just(Cmd.GET_IQ), st.floats(width=32), st.floats(width=32))
DATA = st.binary(max_size=8) | BEATS | NUMBERS


@given(IDENTIFIERS, DATA)
@settings(max_examples=500, deadline=None)
def test_no_frame_raises_or_leads_to_an_unsafe_target(identifier: int, data: bytes) -> None:
    attacked(identifier, data)


@pytest.mark.long
@given(IDENTIFIERS, DATA)
@settings(max_examples=100_000, deadline=None)
def test_no_frame_of_100_000_raises_or_leads_to_an_unsafe_target(identifier: int, data: bytes) -> None:
    attacked(identifier, data)


@pytest.mark.live
def test_a_run_against_its_twin_ends_as_asked_and_replays(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(f'[scenario]\nduration_s = 3.0\n[limits]\n{SHARED}[drive]\nfamily = "odrive"\n')
    found = finished_well(path, tmp_path, "--twin")
    assert found["cycles"] > 2000
    assert_replays(found["log"])
