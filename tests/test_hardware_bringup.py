"""Bring-up: it looks before it touches, reads what the drive made of the settings, and knows its units and counts."""

import re
from pathlib import Path
from typing import Any

import can
import pytest
import tomlkit
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power
from bowden.hardware.twin.of_rig import twin_plant_of
from bowden.rig.families import family_named, names
from bowden.rig.rig import Rig
from live_runs import SHARED, assert_replays, finished_well
from support.memory_bus import DriverLoop, asking

DRIVE = DriveParameters(answer_timeout=0.05)


class Shared(DriverLoop):
    """A bus on which another host goes on with its heartbeat while time passes; `heard` by us as well, or not."""

    beating, heard = False, False

    def advance(self, span: float) -> None:
        super().advance(span)
        if self.beating:
            self.node.receive(frames.HEARTBEAT + 127, bytes((frames.OPERATIONAL,)), self.time)
            if self.heard:
                self.put(frames.HEARTBEAT + 127, bytes((frames.OPERATIONAL,)))


def shared(heard: bool) -> Shared:
    """With a drive that the other host has enabled."""
    bus = Shared(DRIVE)
    bus.up()
    bus.beating, bus.heard = True, heard
    return bus


@pytest.mark.parametrize("heard", [True, False])
def test_a_drive_that_another_host_holds_is_not_touched(heard: bool) -> None:
    bus = shared(heard)
    said = (
        "node 127, which is the number of this computer, is on the bus"
        if heard
        else "operation enabled; expected a drive without"
    )
    with pytest.raises(DriveError, match=said):
        CanopenDrive(DRIVE, Links(bus, bus)).bring_up()
    assert bus.node.state is DriveState.OPERATION_ENABLED
    assert bus.node.nmt == frames.OPERATIONAL
    assert "torque_off" not in [event for _, event, _ in bus.journal]


def test_a_node_that_an_end_has_stopped_is_woken() -> None:
    bus = DriverLoop(DRIVE)
    for _ in range(2):
        drive = CanopenDrive(DRIVE, Links(bus, bus))
        drive.bring_up()
        assert bus.node.nmt == frames.OPERATIONAL
        drive.close()
        assert bus.node.nmt == frames.STOPPED


def test_speeds_in_thousandths_of_a_turn_a_minute_are_understood() -> None:
    in_thousandths = {(0x60A9, 0): 0xFDB4_4700, (0x6080, 0): 10_000_000, (0x607F, 0): 10_000_000}
    DriverLoop(asking(DRIVE, speed_limit=30.0), in_thousandths).drive.bring_up()


def test_a_drive_that_goes_pre_operational_when_we_are_lost_is_not_ready() -> None:
    bus = DriverLoop(DRIVE, {(0x1029, 1): None}).up()
    bus.advance(0.1)
    assert bus.run(20, Power.ON)[-1].drive_state == DriveState.NOT_READY_TO_SWITCH_ON
    assert bus.node.nmt == frames.PRE_OPERATIONAL


class Noisy(DriverLoop):
    """A bus with foreign frames among the drive's."""

    noise: tuple[tuple[int, bytes], ...] = ()

    def advance(self, span: float) -> None:
        super().advance(span)
        for cob_id, data in self.noise:
            self._frames.append(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))


OURS = (0x081, 0x581, 0x701, 0x181, 0x281)


@settings(max_examples=25, deadline=None)
@example([(0x581, b"")])
@given(st.lists(st.tuples(st.sampled_from([*OURS, 0x080, 0x7E5, 0x5FF, 0x702]), st.binary(max_size=8)), max_size=4))
def test_bring_up_among_foreign_frames_succeeds_or_says_why(noise: list[tuple[int, bytes]]) -> None:
    bus = Noisy(DRIVE)
    bus.noise = tuple(noise)
    left = {DriveState.SWITCH_ON_DISABLED}
    try:
        bus.drive.bring_up()
    except DriveError:
        left.add(DriveState.FAULT)  # where it was given up while the drive was to notice that its host is silent
    assert bus.node.state in left


NARROW: dict[str, list[dict[Any, float]]] = {
    "cia402": [
        {(0x6080, 0): 500},
        {(0x607F, 0): 500},
        {(0x6065, 0): 9000},
        {(0x3001, 2): 9000},
        {(0x607D, 1): -20_000, (0x607D, 2): 22_000},
        {(0x607D, 1): -2000, (0x607D, 2): 50_000},
    ],
    "moteus": [
        {"servo.max_velocity": 8.0},
        {"servo.max_current_A": 9.0},
        {"servo.fault_position_error": 0.5},
        {"servopos.position_max": 1.3},
        {"servopos.position_min": -0.2},
    ],
    "odrive": [{"axis0.controller.config.vel_limit": 8.0}, {"axis0.config.motor.current_soft_max": 9.0}],
    "dynamixel": [{38: 100, 39: 0}],
    "ak_mit": [],
    "feetech": [],
}
"""Family → limits of its drive that are narrower than the rig's."""
assert set(NARROW) == set(names())


def example_of(family: str) -> dict[str, Any]:
    """A rig with a drive of a family, as ``bowden init --drive`` has it."""
    tree = dict[str, Any]()
    for title, keys in family_named(family).example.items():
        first, _, second = title.partition(".")
        tree.setdefault(first, {}).update({second: dict(keys)} if second else keys)
    tree.setdefault("drive", {}).update(family=family, answer_timeout_ms=50.0)
    return tree


@pytest.mark.parametrize("family", names())
def test_the_rig_that_init_writes_for_a_family_is_brought_up(family: str, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(tomlkit.dumps(example_of(family)), encoding="utf-8")
    assert DriverLoop(Rig.read(rig).drive_parameters).drive.bring_up()


@pytest.mark.live
@pytest.mark.parametrize("family", sorted({*names()} - {"cia402"}))
def test_a_run_against_the_twin_of_each_family_ends_as_asked_and_replays(family: str, tmp_path: Path) -> None:
    rig, tree = tmp_path / "rig.toml", example_of(family)
    tree["scenario"] = {"duration_s": 3.0}
    slow = "bench" in tree  # in whose cycles an age is short
    shared = {key: value for key, value in tomlkit.parse(SHARED).items() if not (slow and key == "reading_age")}
    tree.setdefault("limits", {}).update(shared)
    rig.write_text(tomlkit.dumps(tree), encoding="utf-8")
    found = finished_well(rig, tmp_path, "--twin")
    assert found["cycles"] > 300
    assert_replays(found["log"])


@pytest.mark.parametrize(("family", "own"), [(name, own) for name in NARROW for own in NARROW[name]], ids=str)
def test_a_rig_beyond_the_drives_limits_is_told_a_value_that_is_within(
    family: str, own: dict[Any, float], tmp_path: Path
) -> None:
    rig, tree = tmp_path / "rig.toml", example_of(family)
    rig.write_text(tomlkit.dumps(tree), encoding="utf-8")
    with pytest.raises(DriveError, match="beyond the drive's own") as refused:
        DriverLoop(Rig.read(rig).drive_parameters, own).drive.bring_up()
    told = re.search(r"write (\w+) = (\S+) into \[(\w+)\]", str(refused.value))
    assert told
    tree.setdefault(told[3], {})[told[1]] = float(told[2])
    rig.write_text(tomlkit.dumps(tree), encoding="utf-8")
    DriverLoop(Rig.read(rig).drive_parameters, own).drive.bring_up()


@pytest.mark.parametrize("family", ["cia402", "moteus"])
def test_a_suit_asks_its_drive_for_no_more_speed_than_its_supply_gives(family: str, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    keys = f'[drive]\nfamily = "{family}"\n[suit]\nworn = true\n[limits]\nplay_deg = 20.0\nmotor_speed_deg_per_s = '
    for limit, bounded in ((600.0, False), (3000.0, True)):
        rig.write_text(f"{keys}{limit}\n", encoding="utf-8")
        read = Rig.read(rig)
        DriverLoop(read.drive_parameters, plant=lambda now, own=read: twin_plant_of(own, now)).drive.bring_up()
        assert (read.drive_parameters.needs.speed_limit < read.supervisor_limits.motor_speed) is bounded
