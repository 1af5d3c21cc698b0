"""Feetech: bring-up, a run, and what must not go wrong; its packets are in `test_hardware_dynamixel`."""

import math
from typing import Any

import pytest

from bowden.core.errors import DriveError, ParameterError, SafetyError
from bowden.core.signals import DriveState
from bowden.core.units import RADIANS
from bowden.hardware.buses.packets import FEETECH
from bowden.hardware.buses.serial_bus import SerialBus, port_of
from bowden.hardware.drives.families.feetech import FAMILY, FeetechParameters
from bowden.hardware.drives.on_can import require
from bowden.hardware.ports import Power, TorqueLeft
from bowden.live.by_hand import require_watch
from bowden.rig.rig import Rig
from support.lines import Line
from support.memory_bus import DriverLoop, asking

DRIVE = asking(FeetechParameters(motor_home=-90.0 * RADIANS), lowest_motor=-0.3, highest_motor=2.0, current_limit=1.5)


def test_a_packet_is_the_one_of_the_manual() -> None:
    assert FEETECH.pack(1, FEETECH.read(0x38, 2)).hex(" ") == "ff ff 01 04 02 38 02 be"


def test_it_follows_tells_both_angles_and_is_without_torque_at_the_end() -> None:
    loop = DriverLoop(DRIVE).up()
    last = loop.run(300, Power.ON, speed=1.0)[-1]
    assert math.isclose(last.motor, loop.node.bench.motor, abs_tol=0.01)
    assert math.isclose(last.joint, loop.node.bench.joint, abs_tol=0.01)
    assert last.foreign == last.bus_errors == last.emergency == 0.0
    assert loop.drive.close() == TorqueLeft.OFF


def test_an_overload_ends_by_itself_and_is_named() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.inject("drive_fault 0x20")
    code = next(one.emergency for one in loop.run(9, Power.ON) if one.emergency)
    assert "overload" in FAMILY.explain(int(code))
    assert loop.run(9, Power.ON)[-1].drive_state == DriveState.FAULT
    assert loop.run(600, Power.OFF)[-1].drive_state == DriveState.SWITCH_ON_DISABLED


REFUSED: dict[str, tuple[dict[int, int], str]] = {
    "torque": ({40: 1}, "runs already"),
    "another model": ({3: 4}, "model number 772"),
    "return delay": ({7: 250}, "Return Delay Time is 250"),
    "another mode": ({33: 1}, "Operating Mode is 1"),
    "a narrower range": ({9: 0, 10: 8}, "finds itself between 2048 and 4095"),
    "a torque that it does not keep": ({48: 7, 49: 0}, "Torque Limit 7 after 500"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_before_power(case: str) -> None:
    registers, said = REFUSED[case]
    loop = DriverLoop(DRIVE, registers)
    with pytest.raises(DriveError, match=said):
        loop.drive.bring_up()
    assert "torque_on" not in loop.events


def test_it_stays_within_a_turn_and_is_for_no_limb() -> None:
    with pytest.raises(ParameterError, match="forgets at power-off"):
        require(asking(DRIVE, highest_motor=6.5))
    rig = Rig().replace(sample_time=5e-3, drive=DRIVE._replace(interface="serial", channel="/dev/ttyUSB0"))
    with pytest.raises(SafetyError, match="no watchdog"):
        require_watch(rig)
    require_watch(rig.replace(drive=rig.drive._replace(no_limb=True)))


def test_a_raw_sync_read_on_the_line_is_answered_in_its_order(tmp_path: Any) -> None:
    with Line(DRIVE, str(tmp_path)):
        bus = SerialBus(port_of(str(tmp_path)), 1_000_000, "feetech")
        bus.put(254, FEETECH.sync_read(56, 2) + bytes((2, 1)))
        answers = [bus.recv(1.0) for _ in range(2)]
        assert [one.arbitration_id for one in answers if one is not None] == [2, 1]
        bus.shutdown()
