"""An ODrive board: frames, the driver against the twin in memory, what bring-up refuses, what frames cannot do."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.core.errors import ParameterError
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.drives import odrive_endpoints
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.families.odrive import FAMILY, OdriveParameters, target_of
from bowden.hardware.drives.odrive_drive import OdriveDrive
from bowden.hardware.drives.odrive_frames import ERRORS, UNTOLD, Cmd, Target, code_of, identifier_of
from bowden.hardware.drives.scale import motor_limits, motor_scale
from bowden.hardware.ports import Power
from bowden.rig.rig import Rig
from support.memory_bus import DriverLoop, asking

RIG = Rig(drive=OdriveParameters())
WITH_JOINT = RIG.drive_parameters._replace(answer_timeout=0.1)
DRIVE = WITH_JOINT._replace(joint="none")
ENABLED, IDLE = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED
SCALES = 1000.0, 1000.0


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


def test_closed_loop_is_asked_for_once() -> None:
    bus = DriverLoop(DRIVE)
    bus.drive.bring_up()
    bus.run(20, Power.OFF)
    bus.sent.clear()
    bus.run(60, Power.ON)
    asked = [data for _, identifier, data in bus.sent if identifier == identifier_of(1, Cmd.SET_AXIS_STATE)]
    assert len(asked) == 1


def test_a_watchdog_that_does_not_run_while_idle_is_read_and_said_to_be_untried() -> None:
    assert "read back and not tried" in DriverLoop(DRIVE, {"watchdog_idle": 0.0}).drive.bring_up()


def test_every_error_of_the_protocol_has_a_text_of_its_own() -> None:
    texts = {FAMILY.explain(code_of(flag)) for flag in ERRORS}
    assert len(texts) == len(ERRORS)
    assert "not known" in FAMILY.explain(8)


def test_an_emergency_stop_is_one_and_our_own_is_none() -> None:
    bus = DriverLoop(DRIVE).up()
    bus.inject("emergency_stop")
    assert EMERGENCY_STOP in {reading.emergency for reading in bus.run(20, Power.ON)}
    bus = DriverLoop(DRIVE).up()
    readings = bus.run(20, Power.QUICK_STOP)
    assert not bus.powered
    assert EMERGENCY_STOP not in {reading.emergency for reading in readings}
    assert readings[-1].drive_state == DriveState.FAULT


def test_a_board_that_does_not_go_to_idle_is_stopped() -> None:
    bus = DriverLoop(DRIVE).up()
    bus.node._request = lambda state, now: None  # type: ignore[method-assign]
    bus.run(50, Power.OFF)
    assert not bus.powered


def test_a_board_that_refuses_closed_loop_is_told() -> None:
    bus = DriverLoop(DRIVE)
    bus.drive.bring_up()
    bus.run(20, Power.OFF)
    bus.node._request = lambda state, now: None  # type: ignore[method-assign]
    assert UNTOLD in {reading.emergency for reading in bus.run(700, Power.ON)}


def test_the_makers_list_says_where_settings_are_and_a_bad_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flat_endpoints.json"
    where = {name: {"id": 200 + k, "type": kind} for k, (name, kind) in enumerate(odrive_endpoints.USED.items())}
    tree = {"fw_version": "0.6.11-1", "hw_version": "4.4.58", "endpoints": where}
    path.write_text(json.dumps(tree))
    drive = DRIVE._replace(endpoints=str(path))
    assert "hardware 4.4.58, firmware 0.6.11" in DriverLoop(drive).drive.bring_up()
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
    limits = motor_limits(DRIVE, motor_scale(DRIVE))
    drive = asking(DRIVE, torque_offset=0.1)
    for before in (-5.0, 0.0, 0.0999, 5.0, math.nan):
        target = target_of(drive, limits, 0.1, before, 1e6)
        assert abs(target.velocity) <= limits.speed
        assert abs(target.torque) <= 0.1 / drive.needs.gear + 1e-12
    assert target_of(drive, limits, 0.1, math.nan, math.nan)[1:] == (0.0, 0.0)
