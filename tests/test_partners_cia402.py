"""CiA 402 against stacks that we did not write: one as the master of our twin, one as a node under our drive."""

import gc
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import canopen
import pytest
from canopen.objectdictionary import ODRecord, ODVariable
from canopen.objectdictionary.datatypes import INTEGER8, INTEGER16, INTEGER32, UNSIGNED8, UNSIGNED16, UNSIGNED32
from canopen.profiles.p402 import BaseNode402

from bowden.core.signals import DriveState
from bowden.hardware.buses.unix_bus import UnixBus
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power, TorqueLeft
from bowden.live.twin_process import RunningTwin, running_twin
from support.drive_cycles import cycles

pytestmark = pytest.mark.live


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningTwin]:
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    path.write_text("[scenario]\nduration_s = 5.0\n")
    with running_twin(path, tmp_path_factory.mktemp("bus") / "b") as running:
        yield running


# a master: canopen's BaseNode402


def variable(name: str, index: int, sub: int, kind: int) -> ODVariable:
    made = ODVariable(name, index, sub)
    made.data_type = kind
    return made


def dictionary() -> canopen.ObjectDictionary:
    """What the master is told of the drive: objects of CiA 301 and CiA 402, as its maker's EDS would have them."""
    found = canopen.ObjectDictionary()
    for name, index, kind in (
        ("error register", 0x1001, UNSIGNED8),
        ("heartbeat of the drive", 0x1017, UNSIGNED16),
        ("controlword", 0x6040, UNSIGNED16),
        ("statusword", 0x6041, UNSIGNED16),
        ("mode", 0x6060, INTEGER8),
        ("mode display", 0x6061, INTEGER8),
        ("position", 0x6064, INTEGER32),
        ("torque", 0x6077, INTEGER16),
        ("target", 0x607A, INTEGER32),
        ("error code", 0x603F, UNSIGNED16),
        ("modes that there are", 0x6502, UNSIGNED32),
    ):
        found.add_object(variable(name, index, 0, kind))
    for communication, mapping in ((0x1400, 0x1600), (0x1800, 0x1A00)):
        record, mapped = ODRecord("PDO", communication), ODRecord("mapping", mapping)
        for sub, kind in enumerate((UNSIGNED8, UNSIGNED32, UNSIGNED8)):
            record.add_member(variable(f"communication {sub}", communication, sub, kind))
        mapped.add_member(variable("entries", mapping, 0, UNSIGNED8))
        for sub in range(1, 9):
            mapped.add_member(variable(f"entry {sub}", mapping, sub, UNSIGNED32))
        found.add_object(record)
        found.add_object(mapped)
    return found


@pytest.fixture
def master(twin: RunningTwin) -> Iterator[BaseNode402]:
    logging.getLogger("canopen").setLevel(logging.ERROR)
    network = canopen.Network(UnixBus(twin.channel))
    network.connect()
    node = BaseNode402(1, dictionary())
    network.add_node(node)
    node.sdo.RESPONSE_TIMEOUT = 2.0
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    node.rpdo.read()
    for pdo, objects in ((node.rpdo[1], (0x6040, 0x607A)), (node.tpdo[1], (0x6041, 0x6064, 0x6077))):
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.trans_type, pdo.enabled = 1, True
    node.tpdo.save()
    node.rpdo.save()
    node.setup_402_state_machine()
    try:
        yield node
    finally:
        network.sync.stop()
        network.disconnect()


def within(seconds: float, there: Callable[[], bool]) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if there():
            return True
        time.sleep(0.01)
    return False


def test_a_master_that_is_not_ours_enables_moves_and_disables_our_twin(twin: RunningTwin, master: BaseNode402) -> None:
    node = master
    assert node.is_op_mode_supported("CYCLIC SYNCHRONOUS POSITION")
    rpdo, tpdo = node.rpdo[1], node.tpdo[1]
    assert [entry.index for entry in rpdo] == [0x6040, 0x607A]
    assert [entry.index for entry in tpdo][:2] == [0x6041, 0x6064]
    node.sdo[0x6060].raw = 8
    assert within(1.0, lambda: node.sdo[0x6061].raw == 8)
    node.nmt.state = "OPERATIONAL"
    node.network.sync.start(0.002)
    assert within(2.0, lambda: node.state == "SWITCH ON DISABLED")
    rpdo["target"].raw = here = node.sdo[0x6064].raw

    for control, wanted in ((0x06, "READY TO SWITCH ON"), (0x07, "SWITCHED ON"), (0x0F, "OPERATION ENABLED")):
        rpdo["controlword"].raw = control
        rpdo.transmit()
        assert within(2.0, lambda wanted=wanted: node.state == wanted), node.state  # type: ignore[misc]
    assert twin.control.status()["torque"]
    assert abs(node.sdo[0x6064].raw - here) < 50, "enabling moves nothing"

    turn = 16384 * 5
    for step in range(1, 101):
        rpdo["target"].raw = here + round(turn * 0.1 * step / 100)
        rpdo.transmit()
        time.sleep(0.005)
    assert within(2.0, lambda: abs(tpdo["position"].raw - rpdo["target"].raw) < 200)
    assert twin.control.status()["motor"] == pytest.approx(2.0 * 3.14159 * 0.1, abs=0.02)

    rpdo["controlword"].raw = 0x00
    rpdo.transmit()
    assert within(2.0, lambda: node.state == "SWITCH ON DISABLED")
    assert not twin.control.status()["torque"]


def test_a_fault_is_reported_and_reset_by_it(twin: RunningTwin, master: BaseNode402) -> None:
    node = master
    codes: list[int] = []
    node.emcy.add_callback(lambda error: codes.append(error.code))
    node.nmt.state = "OPERATIONAL"
    node.network.sync.start(0.002)
    twin.control.inject("drive_fault 0x4210")
    assert within(2.0, lambda: node.is_faulted())
    assert within(2.0, lambda: 0x4210 in codes)
    assert node.sdo[0x603F].raw == 0x4210
    for control in (0x00, 0x80):
        node.rpdo[1]["controlword"].raw = control
        node.rpdo[1].transmit()
        time.sleep(0.05)
    assert within(2.0, lambda: node.state == "SWITCH ON DISABLED")
    assert within(2.0, lambda: codes[-1] == 0), "the end of the error is sent"


# a node: a drive on durand's stack


@pytest.fixture
def foreign_drive(tmp_path: Path) -> Iterator[tuple[str, list[str]]]:
    """Its bus, and what it has said."""
    pytest.importorskip("durand", reason="the package durand is not installed: pip install 'bowden[partners]'")
    channel, said = str(tmp_path / "bus"), list[str]()
    words = [sys.executable, "-m", "support.durand_drive", channel]
    places = os.pathsep.join(str(place) for place in (Path(__file__).parent, *map(Path, sys.path)) if str(place) != ".")
    pipe = subprocess.PIPE
    process = subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True, env={**os.environ, "PYTHONPATH": places})
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    lines = process.stdout
    listener = threading.Thread(target=lambda: said.extend(iter(lines.readline, "")))
    listener.start()
    try:
        yield channel, said
    finally:
        process.stdin.close()
        process.wait(10.0)
        listener.join()
        process.stdout.close()


def test_our_master_brings_up_enables_moves_and_switches_off_a_drive_of_another_stack(
    foreign_drive: tuple[str, list[str]],
) -> None:
    channel, said = foreign_drive
    drive = CanopenDrive(DriveParameters(channel=channel, answer_timeout=2.0))
    gc.collect()
    gc.disable()
    try:
        assert drive.bring_up()
        readings = cycles(drive, 200, Power.ON)
        for _ in range(20):
            if readings[-1].drive_state == DriveState.OPERATION_ENABLED:
                break
            readings = cycles(drive, 100, Power.ON)
        assert readings[-1].drive_state == DriveState.OPERATION_ENABLED, said
        begun = readings[-1].motor
        readings = cycles(drive, 1000, Power.ON, swing=0.2)
        moved = [reading.motor - begun for reading in readings]
        assert max(moved) == pytest.approx(0.4, abs=0.05)
        assert max(reading.joint for reading in readings) == pytest.approx(
            0.9 * max(r.motor for r in readings), abs=0.02
        )
        assert cycles(drive, 100, Power.OFF)[-1].drive_state == DriveState.SWITCH_ON_DISABLED
        assert drive.close() is TorqueLeft.OFF
    finally:
        gc.enable()
        drive.close()


def test_a_drive_of_another_stack_switches_off_when_our_host_falls_silent(foreign_drive: tuple[str, list[str]]) -> None:
    channel, said = foreign_drive
    drive = CanopenDrive(DriveParameters(channel=channel, answer_timeout=2.0))
    try:
        drive.bring_up()
        for _ in range(30):
            if cycles(drive, 100, Power.ON)[-1].drive_state == DriveState.OPERATION_ENABLED:
                break
        silent = time.monotonic()
        time.sleep(0.3)
        fell = [float(line.split()[2]) for line in said if line.startswith("state fault")]
        assert fell, said
        assert fell[-1] - silent < 0.15
        reading = cycles(drive, 50, Power.ON)[-1]
        assert reading.drive_state == DriveState.FAULT
    finally:
        drive.close()
