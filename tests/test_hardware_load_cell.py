"""A load cell beside a drive, against its twin in memory: CiA 404 and plain frames, faults, tare, bad input."""

import math
from typing import Any

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import DriveReading, Sample
from bowden.cycle.one_cycle import NOTHING_OBSERVED, CycleSettings, CycleState, Filters, filtered_measurement
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.place import BusPlace
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.ak_drive import AkDrive
from bowden.hardware.drives.families.ak_mit import AkParameters
from bowden.hardware.drives.families.cia402 import DriveParameters, load_of, load_range, tared
from bowden.hardware.drives.families.moteus import MoteusParameters
from bowden.hardware.drives.load_cell import VALUE_32, LoadCellReader
from bowden.hardware.drives.of_rig import DriveWithLoadCell
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.canopen_node import CanopenNode
from bowden.hardware.twin.injection import parse
from bowden.hardware.twin.objects import Key
from bowden.hardware.twin.sensor_node import LoadCellNode
from bowden.live.drive_look import tare
from bowden.live.live_run import live_run
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.thermal import cold
from bowden.plants.presets.bench import bench
from bowden.rig.load_cell import BESIDE, LoadCellParameters
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from bowden.safety.supervisor import begin
from support.memory_bus import DriverLoop, MemoryBus

PLACE = BusPlace("bowden_unix", "bowden", 1_000_000)
NODE = LoadCellParameters(source="cia404", full_scale=300.0, scale=0.01, zero=250.0)
PLAIN = NODE._replace(source="can", scale=-0.02, first_byte=2, bytes=3, byte_order="big")


class Cell(DriverLoop):
    """An AK drive with a load cell beside it, and their twins."""

    def __init__(self, cell: LoadCellParameters = NODE, overrides: dict[Key, int | None] | None = None) -> None:
        super().__init__(AkParameters(answer_timeout=0.05))
        self.plant = self.node.bench
        self.attach(LoadCellNode(cell, self.plant, self.node.faults, self.put, overrides))
        links = Links(self, self)
        self.drive = DriveWithLoadCell(AkDrive(self.node._drive, links), cell, PLACE, links, 0.05, shared=True)

    def last(self, cycles: int, power: Power = Power.OFF, target: float = 0.1) -> DriveReading:
        return self.run(cycles, power, target=target)[-1]


@pytest.mark.parametrize(
    "cell",
    [
        NODE,
        NODE._replace(sends="timer"),
        NODE._replace(measures="torque", full_scale=30.0, input=3),
        PLAIN,
        PLAIN._replace(identifier=0x123456, extended=True, byte_order="little", first_byte=0),
    ],
    ids=lambda cell: f"{cell.source} {cell.measures} {cell.sends} {cell.identifier:X}",
)
def test_what_the_cable_pulls_is_read_whatever_the_device(cell: LoadCellParameters) -> None:
    loop = Cell(cell)
    said = loop.drive.bring_up()
    assert "load cell: " in said
    for target in (0.1, 0.6):
        reading = loop.last(300, Power.ON, target)
        true = loop.plant.tension
        if cell.measures == "tension":
            assert reading.tension == pytest.approx(true, abs=1.5 * abs(cell.scale) + 0.02)
            assert math.isnan(reading.joint_torque)
        else:
            assert reading.joint_torque == pytest.approx(true * loop.plant.physics.spool_radius, abs=0.02)
            assert math.isnan(reading.tension)
        assert reading.foreign == reading.bus_errors == 0.0
    assert loop.drive.close() is TorqueLeft.OFF


def test_a_cell_without_its_status_or_with_16_bits_is_read_too() -> None:
    for overrides in ({(0x6150, 1): None}, {(0x9130, 1): None}, {(0x9130, 1): None, (0x6150, 1): None}):
        loop = Cell(NODE, overrides)
        assert "it says 0.01 N itself" in loop.drive.bring_up()
        assert loop.last(20).tension == pytest.approx(loop.plant.tension, abs=0.02)


@pytest.mark.parametrize("cell", [NODE, NODE._replace(sends="timer"), PLAIN], ids=["sync", "timer", "plain"])
def test_a_silent_cell_is_none_after_its_silence_and_comes_back(cell: LoadCellParameters) -> None:
    loop = Cell(cell)
    loop.drive.bring_up()
    loop.last(20)
    loop.inject("load_silence")
    assert math.isfinite(loop.last(5).tension)
    assert math.isnan(loop.last(8).tension)
    loop.node.faults.clear()
    assert math.isfinite(loop.last(30).tension)


def test_the_ends_of_its_range_are_too_much_or_none() -> None:
    for cell in (NODE, PLAIN):
        loop = Cell(cell)
        loop.drive.bring_up()
        loop.last(20)
        loop.inject("load_saturated 1")
        assert loop.last(5).tension >= 0.99 * cell.full_scale
        loop.node.faults.clear()
        loop.inject("load_saturated -1")
        assert math.isnan(loop.last(5).tension)
    torque = Cell(NODE._replace(measures="torque", full_scale=30.0))
    torque.drive.bring_up()
    torque.inject("load_saturated -1")
    assert torque.last(20).joint_torque <= -29.9


def test_what_a_device_calls_invalid_or_an_emergency_is_none() -> None:
    cell = LoadCellReader(NODE, 0.1)
    cell._began(operational=True)
    data = (2250).to_bytes(4, "little", signed=True)
    cell.take(frames.TPDO1 + 33, data + b"\0", 1.0)
    assert cell.value(1.0) == 20.0
    cell.take(frames.TPDO1 + 33, data + b"\1", 1.001)
    assert math.isnan(cell.value(1.001))
    cell.take(frames.TPDO1 + 33, data + b"\2", 1.002)
    assert cell.value(1.002) == 300.0
    cell.take(frames.TPDO1 + 33, data, 1.003)
    assert cell.value(1.003) == 20.0
    cell.take(frames.EMERGENCY + 33, frames.pack_emergency(0x5000, 1), 1.004)
    assert math.isnan(cell.value(1.004))
    cell.take(frames.EMERGENCY + 33, frames.pack_emergency(0, 0), 1.005)
    assert cell.value(1.005) == 20.0
    cell.take(frames.HEARTBEAT + 33, b"\x04", 1.006)
    assert math.isnan(cell.value(1.006))


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
@settings(max_examples=300, deadline=None)
def test_no_frame_makes_more_than_its_number(identifier: int, data: bytes) -> None:
    for given_ in (NODE, PLAIN, NODE._replace(measures="torque")):
        cell = LoadCellReader(given_, 0.1)
        cell._began(operational=True)
        cell.take(identifier, data, 1.0)
        value = cell.value(1.0)
        assert math.isnan(value) or abs(value) <= max(abs(given_.value(end)) for end in given_.ends)


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({(0x1000, 0): 0x0002_0196}, "device profile 406"),
        ({(0x9130, 1): None, (0x7130, 1): None}, "no input 1 as a whole number"),
        ({(0x1A00, 2): None}, "refuses 1A00h:2"),
    ],
)
def test_what_is_no_measuring_device_is_refused_in_one_line(overrides: dict[Key, int | None], said: str) -> None:
    with pytest.raises(DriveError, match=said):
        Cell(NODE, overrides).drive.bring_up()


def test_nobody_there_and_frames_too_short_are_told() -> None:
    loop = Cell(PLAIN)
    absent = DriveWithLoadCell(
        loop.drive._drive, PLAIN._replace(identifier=0x1F3), PLACE, Links(loop, loop), 0.05, shared=True
    )
    absent._drive = _Nothing()  # type: ignore[assignment]
    with pytest.raises(DriveError, match=r"no frame 1F3h .* there is 1F0h"):
        absent.bring_up()
    port = Links(loop, loop).join(PLACE, "a", lambda _: True)
    for _ in range(5):
        loop.put(0x1F1, b"\1\2")
    with pytest.raises(DriveError, match="have 2 bytes"):
        LoadCellReader(PLAIN._replace(identifier=0x1F1), 0.1).bring_up(port)


class _Nothing:
    def bring_up(self) -> str:
        return "nothing"


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ({"scale": 0.0}, r"load_cell\.scale is 0"),
        ({"full_scale": 0.0}, "the load at which it saturates"),
        ({"full_scale": 150.0}, "above limits.tension_high_n"),
        ({"source": "can", "bytes": 1}, "numbers that reach full_scale"),
        ({"source": "can", "scale": -0.01, "signed": False}, "numbers that reach full_scale"),
        ({"silence": 2e-3}, r"load_cell\.silence_ms is 2"),
        ({"source": "can", "first_byte": 6, "bytes": 3}, "ends within 8 bytes"),
        ({"source": "can", "identifier": 0x800, "bytes": 3}, "or extended = true"),
        ({"channel": "."}, "the name of a bus"),
        ({"measures": "torque", "full_scale": 10.0}, "above limits.torque_high_nm"),
    ],
)
def test_a_cell_that_could_not_show_what_is_to_be_seen_is_refused(cell: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        _ = Rig(load_cell={**NODE._asdict(), **cell}).drive_parameters


def test_a_cell_of_classic_can_on_a_bus_of_can_fd_is_refused() -> None:
    rig = Rig(drive=MoteusParameters(), load_cell=NODE)
    with pytest.raises(ParameterError, match=r"CAN-FD at 5000000 bit/s and 1000000 bit/s: .* write channel in"):
        _ = rig.drive_parameters
    _ = rig.replace(load_cell=NODE._replace(channel="can1")).drive_parameters


def test_two_cells_and_an_input_of_too_small_a_range_are_refused() -> None:
    at_input = DriveParameters(tension_scale=0.1)
    with pytest.raises(ParameterError, match="one load cell"):
        _ = Rig(drive=at_input, load_cell=NODE).drive_parameters
    assert Rig(drive=at_input).drive_parameters.tension_scale == 0.1
    with pytest.raises(ParameterError, match="can tell 100 N"):
        _ = Rig(drive=at_input._replace(tension_scale=0.01)).drive_parameters
    with pytest.raises(ParameterError, match=r"torque_nm_per_mv is 0\.1"):
        _ = Rig(drive=at_input._replace(torque_scale=0.1)).drive_parameters


def test_a_cell_at_the_drives_input_has_a_zero_a_range_and_faults() -> None:
    drive = DriveParameters(tension_scale=-0.1, tension_zero=100.0)
    assert load_of(drive, -900.0) == pytest.approx(100.0)
    assert load_range(drive) == pytest.approx(1010.0)
    assert math.isnan(load_of(drive, 10_000.0))
    assert load_of(drive, -10_000.0) == pytest.approx(1010.0)
    assert load_of(tared(drive, 100.0, 20.0), -900.0) == pytest.approx(20.0)
    torque = DriveParameters(torque_scale=0.002)
    assert load_range(torque) == pytest.approx(20.0)
    assert load_of(torque, -10_000.0) == pytest.approx(-20.0)
    rig = bench()
    for given_ in (drive, torque):
        bus = MemoryBus()
        plant = TwinBench(rig, constant_bend(rig.sheath.bend), 1.0, 0, 0.5, bus.time)
        node = CanopenNode(given_, plant, bus.put, bus.note, {(0x1801, 1): 0x281})
        bus.attach(node)
        bus.send_frame(frames.NMT, bytes((frames.NMT_START, given_.node_id)))
        true = plant.tension * (1.0 if given_.tension_scale else plant.physics.spool_radius)
        for sign, fault in ((1.0, ""), (-1.0, "load_sign")):
            if fault:
                node.faults.inject(parse(fault)._replace(start=bus.time))
            bus.drain()
            bus.send_frame(frames.SYNC, b"")
            said = next(frames.SENSORS.unpack(bytes(one.data), 2) for one in bus.drain() if one.arbitration_id == 0x281)
            assert said is not None
            scale = abs(given_.tension_scale or given_.torque_scale)
            assert load_of(given_, said[1]) == pytest.approx(sign * true, abs=scale)
        bus.close()


def readings(*tensions: float) -> list[DriveReading]:
    return [DriveReading(0.0, 0.0, 0.0, one, 30.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0) for one in tensions]


def test_tare_says_the_line_and_refuses_what_does_not_keep_still() -> None:
    rig = Rig(load_cell=NODE)
    found = tare(rig, readings(21.0, 19.0), 5.0)
    assert (found.section, found.keys, found.unit) == ("load_cell", {"zero": pytest.approx(1750.0)}, "N")
    assert NODE._replace(zero=1750.0).value(2250.0) == pytest.approx(5.0)
    at_input = Rig(drive=DriveParameters(tension_scale=0.1))
    assert tare(at_input, readings(3.0), 0.0).keys == {"tension_zero_mv": pytest.approx(30.0)}
    with pytest.raises(DriveError, match="changes by 10"):
        tare(rig, readings(20.0, 30.0), 0.0)
    with pytest.raises(DriveError, match="says nothing"):
        tare(rig, readings(math.nan), 0.0)
    with pytest.raises(DriveError, match="has no load cell"):
        tare(Rig(), readings(1.0), 0.0)


def test_a_rig_keeps_its_cell_and_one_without_is_as_it_was() -> None:
    rig = Rig(load_cell=NODE)
    assert Rig.unpack(rig.pack()).load_cell == NODE
    assert Rig.unpack(rig.pack()).hash == rig.hash != Rig().hash
    assert "load_cell" not in Rig().document()
    assert rig.supervisor_limits.measures_tension == 1.0
    assert Rig(load_cell=NODE._replace(measures="torque")).supervisor_limits.measures_torque == 1.0
    assert rig.on_bus("other").load_cell.channel is None
    apart = Rig(load_cell=NODE._replace(channel="can1")).on_bus("/tmp/bus", "bowden_unix")
    assert apart.load_cell.channel == f"/tmp/bus/{BESIDE}"
    assert apart.on_bus("/tmp/bus", "bowden_unix") == apart


def test_a_cell_on_a_bus_of_its_own_counts_its_errors_and_other_masters() -> None:
    loop, own = Cell(), MemoryBus()
    own.attach(LoadCellNode(NODE, loop.plant, loop.node.faults, own.put))
    cell = DriveWithLoadCell(_Still(), NODE, PLACE, Links(own, own), 0.05, shared=False)
    cell.bring_up()
    cell.write(0.0, Power.OFF, own.time)
    assert cell.read(own.time).tension == pytest.approx(loop.plant.tension, abs=0.02)
    own.put(frames.NMT, b"\1\0")
    assert cell.read(own.time).foreign == 1.0
    own.send = _broken  # type: ignore[method-assign, assignment]
    cell.write(0.0, Power.OFF, own.time)
    assert cell.read(own.time).bus_errors == 1.0


def _broken(message: can.Message, timeout: float | None = None) -> None:
    raise can.CanOperationError("off")


class _Still(_Nothing):
    def read(self, now: float) -> DriveReading:
        return readings(math.nan)[0]

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        return None


def test_the_object_that_is_mapped_is_the_inputs_own() -> None:
    loop = Cell(NODE._replace(input=2))
    loop.drive.bring_up()
    written = [data for _, identifier, data in loop.sent if identifier == frames.SDO_REQUEST + 33]
    assert any(
        data[1:4] == b"\x00\x1a\x01" and data[4:] == (VALUE_32 << 16 | 2 << 8 | 32).to_bytes(4, "little")
        for data in written
    )


def test_admittance_runs_live_with_a_measured_torque_and_with_nothing_less() -> None:
    suit = {"worn": True, "friction_feedforward": 2.79}
    limits = {"motor_low": -0.21, "motor_margin": 0.14, "joint_high": 1.83, "play": 0.35, "tracking": 0.61}
    rig = Rig(suit=suit, limits=limits, law="uncompensated", admittance={"enabled": True, "torque": "load_cell"})
    with pytest.raises(ParameterError, match=r'admittance.torque is "load_cell"; expected a load cell that measures'):
        live_run(rig)
    with pytest.raises(ParameterError, match="measures the cable's tension alone"):
        live_run(rig.replace(load_cell=NODE))
    run = live_run(rig.replace(load_cell=NODE._replace(measures="torque", full_scale=30.0)))
    assert run.source().settings.estimated == 0.0
    assert run.script()._checks.torque == 1.0


def test_the_source_is_shown_the_torque_as_it_was_measured() -> None:
    limits = Limits()
    reading = readings(math.nan)[0]._replace(joint_torque=3.5)
    state = CycleState(Sample(0.0, 0.0), None, None, None, begin(limits, reading, cold(limits.thermal)))  # type: ignore[arg-type]
    seen = CycleSettings(None, None, None, Filters(), limits)  # type: ignore[arg-type]
    _, measured = filtered_measurement(seen, state, NOTHING_OBSERVED._replace(reading=reading, elapsed=1e-3), 1e-3)
    assert measured.load == 3.5
