"""Laws that hold of the drivers of all families, each against its twin on a bus in memory."""

import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

from bowden.core.signals import DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.unix_bus import EXTENDED, REMOTE
from bowden.hardware.drives import ak_drive, canopen_setup, moteus_setup, odrive_setup
from bowden.hardware.drives import canopen_frames as canopen
from bowden.hardware.drives.families.ak_mit import AkParameters
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.drives.families.moteus import MoteusParameters
from bowden.hardware.drives.families.odrive import OdriveParameters
from bowden.hardware.drives.findings import INERT, LEFT
from bowden.hardware.drives.odrive_frames import BROADCAST, Cmd, identifier_of
from bowden.hardware.ports import Power
from bowden.hardware.twin.ak_node import AkNode
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.canopen_node import CanopenNode
from bowden.hardware.twin.moteus_node import MoteusNode
from bowden.hardware.twin.odrive_node import OdriveNode
from bowden.hardware.twin.plant import OFF
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import bench
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from support.memory_bus import DrivenBus

ENABLED, FAULT = DriveState.OPERATION_ENABLED, DriveState.FAULT


class Case(NamedTuple):
    """One family."""

    drive: Any
    node: Any
    fault: tuple[str, float, str]
    """As it is injected, the code that is told, and what its text says."""
    foreign: tuple[tuple[int, bytes], ...]
    """Frames that nobody but this host may send."""


CASES: Mapping[str, Case] = {
    "cia402": Case(
        Rig(drive=DriveParameters()).drive_parameters._replace(answer_timeout=0.1),
        CanopenNode,
        ("0x3220", 0x3220, "undervoltage"),
        ((canopen.RPDO1 + 1, bytes(6)), (canopen.NMT, b"\x01\x01")),
    ),
    "ak_mit": Case(AkParameters(joint="none"), AkNode, ("4", 4.0, "under-voltage"), ((1, b"\xff" * 7 + b"\xfc"),)),
    "moteus": Case(
        Rig(drive=MoteusParameters()).drive_parameters._replace(answer_timeout=0.02),
        MoteusNode,
        ("0x22", 34.0, "over-voltage"),
        ((0x8001 | EXTENDED, b"\x01\x00\x00"), (0x0100, b"\x21\x00\x0a")),
    ),
    "odrive": Case(
        Rig(drive=OdriveParameters()).drive_parameters._replace(answer_timeout=0.1, joint="none"),
        OdriveNode,
        ("10", 10.0, "DC_BUS_UNDER_VOLTAGE"),
        (
            (identifier_of(1, Cmd.SET_INPUT_POS), bytes(8)),
            (identifier_of(1, Cmd.GET_IQ) | REMOTE, b""),
            (identifier_of(BROADCAST, Cmd.ESTOP), b""),
        ),
    ),
}
EVERY = pytest.mark.parametrize("name", CASES)
ANSWERING = pytest.mark.parametrize("name", ["ak_mit", "moteus", "odrive"])
"""Families that answer each order, and have no heartbeat of their own that a bus would carry."""


class Loop(DrivenBus):
    """The memory bus with a drive's twin on it, and a driver that is its host."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.case, rig = CASES[name], bench()
        plant = TwinBench(rig, constant_bend(rig.sheath.bend), 1.0, 0, 0.1, self.time)
        self.node = self.case.node(self.case.drive, plant, self.put, self.note)
        self.attach(self.node)
        self.drive = family_of(self.case.drive).open(self.case.drive, Links(self))

    def up(self) -> "Loop":
        """Brought up, and following."""
        self.drive.bring_up()
        self.run(20, Power.OFF)
        assert self.run(40, Power.ON)[-1].drive_state == ENABLED
        return self

    @property
    def powered(self) -> bool:
        return bool(self.node.bench.doing != OFF)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (ak_drive, canopen_setup, moteus_setup, odrive_setup):
        monkeypatch.setattr(module, "LISTENING", 0.02)


@EVERY
def test_enabling_moves_nothing_and_a_target_that_is_none_takes_the_torque_off(name: str) -> None:
    loop = Loop(name).up()
    before = loop.node.bench.motor
    for target in (math.nan, math.inf, 1e9):
        loop.run(40, Power.ON)
        for _ in range(2):
            loop.drive.read(loop.time)
            loop.drive.write(target, Power.ON, loop.time)
            loop.advance(1e-3)
        assert not loop.powered
        loop.run(10, Power.OFF)
    assert loop.node.bench.motor == pytest.approx(before, abs=0.02)


@EVERY
def test_a_fault_is_told_once_kept_and_cleared_by_an_operator_alone(name: str) -> None:
    loop = Loop(name).up()
    text, code, said = loop.case.fault
    loop.inject(f"drive_fault {text}")
    told = loop.run(20, Power.ON)
    assert [reading.emergency for reading in told if reading.emergency] == [code]
    assert said in family_of(loop.case.drive).explain(int(code))
    loop.run(20, Power.ON)
    assert not loop.powered
    if name != "ak_mit":  # which nothing resets
        assert loop.run(20, Power.OFF)[-1].drive_state == FAULT
        loop.drive.reset_fault()
    assert loop.run(300, Power.OFF)[-1].drive_state == DriveState.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("name", "fault", "code"),
    [
        *(
            (name, fault, code)
            for name in ("moteus", "odrive")
            for fault, code in (("inert", INERT), ("mode_left", LEFT))
        ),
    ],
)
def test_what_a_drive_does_not_say_is_seen_within_50_ms(name: str, fault: str, code: int) -> None:
    loop = Loop(name).up()
    assert {reading.emergency for reading in loop.run(400, Power.ON, speed=0.35)} == {0.0}
    loop.inject(fault)
    assert code in {reading.emergency for reading in loop.run(50, Power.ON, speed=0.35)}


@ANSWERING
def test_a_drive_that_has_restarted_is_not_believed_before_it_is_brought_up_again(name: str) -> None:
    loop = Loop(name).up()
    loop.inject("reboot")
    reading = loop.run(600, Power.OFF)[-1]
    assert math.isnan(reading.motor)
    assert reading.drive_state == DriveState.NOT_READY_TO_SWITCH_ON
    loop.run(50, Power.ON)
    assert not loop.powered
    loop.up()


@EVERY
def test_frames_of_another_drive_are_no_readings_and_those_of_another_master_are_foreign(name: str) -> None:
    loop = Loop(name).up()
    if "foreign_replies" not in loop.node.lacks:
        loop.inject("foreign_replies")
        readings = loop.run(50, Power.ON)
        assert {(reading.foreign, reading.emergency) for reading in readings} == {(0.0, 0.0)}
    loop.drain()
    for identifier, data in loop.case.foreign:
        loop.put(identifier, data)
    assert loop.drive.read(loop.time).foreign == len(loop.case.foreign)


@ANSWERING
def test_bit_errors_of_a_loosened_ground_are_counted_and_lead_to_no_wrong_reading(name: str) -> None:
    loop = Loop(name).up()
    loop.inject("bit_errors 0.01")
    readings = loop.run(1000, Power.ON, speed=0.1)
    assert 2 <= readings[-1].bus_errors <= 140
    assert {reading.emergency for reading in readings} == {0.0}
    assert max(abs(b.motor - a.motor) for a, b in itertools.pairwise(readings)) < 0.02
