"""Bring-up: it looks before it touches, reads what the drive made of the settings, and knows its units and counts."""

import can
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power
from bowden.hardware.twin.bench import TwinBench
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import bench
from support.memory_bus import TwinBus, asking

DRIVE = DriveParameters(answer_timeout=0.05)
CYCLE = 1e-3


def make_bench(now: float) -> TwinBench:
    rig = bench()
    return TwinBench(rig, constant_bend(rig.sheath.bend), 1.0, 0, 0.1, now)


def cycle(drive: CanopenDrive, bus: TwinBus, count: int, power: Power, target: float = 0.1) -> None:
    for _ in range(count):
        drive.read(bus.time)
        drive.write(target, power, bus.time)
        bus.advance(CYCLE)


class Shared(TwinBus):
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
    bus = Shared(DRIVE, make_bench)
    first = CanopenDrive(DRIVE, Links(bus))
    first.bring_up()
    cycle(first, bus, 10, Power.ON)
    bus.beating, bus.heard = True, heard
    assert bus.node.state is DriveState.OPERATION_ENABLED
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
        CanopenDrive(DRIVE, Links(bus)).bring_up()
    assert bus.node.state is DriveState.OPERATION_ENABLED
    assert bus.node.nmt == frames.OPERATIONAL
    assert "torque_off" not in [event for _, event, _ in bus.journal]


def test_a_node_that_an_end_has_stopped_is_woken() -> None:
    bus = TwinBus(DRIVE, make_bench)
    for _ in range(2):
        drive = CanopenDrive(DRIVE, Links(bus))
        drive.bring_up()
        assert bus.node.nmt == frames.OPERATIONAL
        drive.close()
        assert bus.node.nmt == frames.STOPPED


def test_speeds_in_thousandths_of_a_turn_a_minute_are_understood() -> None:
    bus = TwinBus(DRIVE, make_bench, {(0x60A9, 0): 0xFDB4_4700, (0x6080, 0): 10_000_000, (0x607F, 0): 10_000_000})
    CanopenDrive(asking(DRIVE, speed_limit=30.0), Links(bus)).bring_up()


def test_a_drive_that_goes_pre_operational_when_we_are_lost_is_not_ready() -> None:
    bus = TwinBus(DRIVE, make_bench, {(0x1029, 1): None})
    drive = CanopenDrive(DRIVE, Links(bus))
    drive.bring_up()
    cycle(drive, bus, 10, Power.ON)
    bus.advance(0.1)
    cycle(drive, bus, 20, Power.ON)
    assert bus.node.nmt == frames.PRE_OPERATIONAL
    assert drive.read(bus.time).drive_state == DriveState.NOT_READY_TO_SWITCH_ON


class Noisy(TwinBus):
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
    bus = Noisy(DRIVE, make_bench)
    bus.noise = tuple(noise)
    drive = CanopenDrive(DRIVE, Links(bus))
    left = {DriveState.SWITCH_ON_DISABLED}
    try:
        drive.bring_up()
    except DriveError:
        left.add(DriveState.FAULT)  # where it was given up while the drive was to notice that its host is silent
    assert bus.node.state in left
