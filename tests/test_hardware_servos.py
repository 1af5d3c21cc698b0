"""Serial servos: Dynamixel's packets against ROBOTIS' own library, Feetech's against its manual, and their lines."""

import math
import os
import random
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bowden.core.errors import BowdenError, DriveError, SafetyError
from bowden.core.signals import DriveState
from bowden.core.units import RADIANS
from bowden.design.power import require_power
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.packets import DYNAMIXEL, FEETECH, STATUS, PacketReader, Packets, fast_answer
from bowden.hardware.buses.place import ERROR
from bowden.hardware.buses.serial_bus import SerialBus, port_of
from bowden.hardware.drives.families.dynamixel import FAMILY, MODELS, DynamixelParameters
from bowden.hardware.drives.families.feetech import FeetechParameters
from bowden.hardware.drives.findings import JOINT_SERVO
from bowden.hardware.drives.on_can import collision, require
from bowden.hardware.drives.servo_table import ADAPTER, ServoRegister, cycle_time
from bowden.hardware.ports import Power
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from support.memory_bus import DriverLoop, MemoryBus, asking, bench_at
from support.played import Played

FEETECH_DRIVE = FeetechParameters(motor_home=-90.0 * RADIANS)
DRIVE = asking(DynamixelParameters(motor_home=-90.0 * RADIANS), lowest_motor=-0.3, highest_motor=2.0, current_limit=2.0)


@pytest.fixture
def sdk() -> Any:
    return pytest.importorskip("dynamixel_sdk", reason="pip install 'bowden[partners]'")


def frames(count: int, seed: int) -> Iterator[tuple[int, bytes]]:
    """Frames of any data, many with what looks like a header."""
    draw = random.Random(seed)
    for _ in range(count):
        data = b"".join(draw.choice((b"\xff\xff\xfd", b"\xff", draw.randbytes(3))) for _ in range(draw.randint(0, 12)))
        yield draw.randint(0, 252), bytes((draw.choice((STATUS, 2, 3)), 0)) + data


@pytest.mark.parametrize("packets", [DYNAMIXEL, FEETECH])
def test_a_frame_is_the_same_after_it_was_packed(packets: Packets) -> None:
    for number, data in frames(500, 1):
        reader = PacketReader(packets, replies=data[0] == STATUS)
        assert reader.feed(packets.pack(number, data)) == [(number, data)]


def test_packets_are_those_of_robotis(sdk: Any) -> None:
    theirs = sdk.PacketHandler(2.0)
    for number, data in frames(500, 2):
        packet = [0xFF, 0xFF, 0xFD, 0, number, *(len(data) + 2).to_bytes(2, "little"), *data, 0, 0]
        packet = theirs.addStuffing(packet)
        end = 7 + packet[5] + 256 * packet[6] - 2
        crc = theirs.updateCRC(0, packet, end)
        assert bytes(packet[:end]) + crc.to_bytes(2, "little") == DYNAMIXEL.pack(number, data)


def test_models_and_addresses_are_those_of_robotis(sdk: Any) -> None:
    from dynamixel_easy_sdk.control_table import CONTROL_TABLE_PATH, ControlTable

    for name, table in MODELS.items():
        assert ControlTable.getModelName(table.model).removesuffix(".model") == name.lower().replace("-", "_")
        theirs = ControlTable.getControlTable(table.model)
        for register, own in table.registers.items():
            assert (theirs[register].address, theirs[register].size) == own[:2], f"{name}: {register}"
        assert table.indirect == (theirs["Indirect Address 1"].address, theirs["Indirect Data 1"].address)
        later = Path(CONTROL_TABLE_PATH) / f"{name.lower().replace('-', '_')}_fw52.model"
        moved = table.of(52).indirect
        assert moved
        assert later.is_file() == (moved != table.indirect)
        assert not later.is_file() or f"\n{moved[1]}\t1\tIndirect Data 1\n" in later.read_text(encoding="utf-8")


def test_a_servo_whose_firmware_shows_its_values_elsewhere_is_read_there() -> None:
    drive = DRIVE._replace(model="XL330-M288", joint="none")
    for firmware, address in ((48, 224), (52, 208)):
        loop = DriverLoop(drive, {6: firmware}).up()
        assert {loop.node._own.table.packets.asked(data)[0] for _, _, data in loop.sent if data[0] == 0x8A} == {address}
        assert abs(loop.run(5, Power.ON)[-1].motor - loop.node.bench.motor) < 0.01


@pytest.mark.parametrize("packets", [DYNAMIXEL, FEETECH])
def test_of_ten_thousand_malformed_packets_no_more_make_a_frame_than_their_sums_let_through(packets: Packets) -> None:
    draw, reader, after = random.Random(3), PacketReader(packets, replies=False), (7, packets.read(64, 1))
    sums = 0
    for _ in range(10_000):
        whole = bytearray(packets.pack(draw.randint(0, 252), bytes((draw.randint(0, 84),)) + draw.randbytes(9)))
        whole[draw.randrange(len(whole))] ^= 1 << draw.randrange(8)
        sums += len(reader.feed(bytes(whole[: draw.randint(1, len(whole))])))
    reader.forget()
    assert reader.feed(packets.pack(*after))[-1] == after
    assert sums <= (100 if packets is FEETECH else 3)  # a sum of 8 bits lets one of 256 through, a CRC one of 65 536


def test_a_fast_answer_is_one_of_each_servo() -> None:
    said = [(1, b"\x55\x00" + bytes(range(10))), (9, b"\x55\x80\xff\xff\xfd\x00" + bytes(6))]
    assert PacketReader(DYNAMIXEL, replies=True).feed(fast_answer(said), 10) == said


@pytest.mark.parametrize("sign", [0, 15])
def test_a_signed_register_keeps_its_value(sign: int) -> None:
    register = ServoRegister(0, 2, signed=True, sign=sign)
    for value in (-32767, -1, 0, 1, 32767):
        assert register.decode(register.encode(value)) == value


def test_a_silent_host_stops_it_and_it_is_not_led_on_before_an_acknowledgement() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.advance(0.06)
    assert "watchdog" in loop.events
    assert loop.powered  # it holds
    assert loop.run(9, Power.ON)[-1].drive_state == DriveState.FAULT
    assert not loop.powered
    assert loop.run(9, Power.OFF)[-1].drive_state == DriveState.FAULT
    loop.drive.reset_fault()
    assert loop.run(20, Power.OFF)[-1].drive_state == DriveState.SWITCH_ON_DISABLED
    assert loop.run(20, Power.ON)[-1].drive_state == DriveState.OPERATION_ENABLED


@pytest.mark.parametrize("drive", [DRIVE, FEETECH_DRIVE])
@pytest.mark.parametrize("register", ["Torque Enable", "Hardware Error Status"])
def test_a_servo_on_the_joint_that_does_more_than_measure_ends_the_run(drive: Any, register: str) -> None:
    loop = DriverLoop(drive).up()
    loop.node._joint[register] = 1
    assert JOINT_SERVO in {reading.emergency for reading in loop.run(3, Power.ON)}
    assert "servo on the joint" in FAMILY.explain(JOINT_SERVO)


@pytest.mark.parametrize("drive", [DRIVE, FEETECH_DRIVE])
def test_a_servo_on_the_joint_that_is_silent_leaves_an_angle_that_ages(drive: Any) -> None:
    loop = DriverLoop(drive).up()
    loop.run(3, Power.ON)
    loop.inject("joint_silence")
    last = loop.run(9, Power.ON)[-1]
    assert (last.joint_age > 5.0, last.motor_age < 2.0) == (True, True)


def test_two_servos_of_one_number_are_refused() -> None:
    loop = DriverLoop(DRIVE)
    loop.attach(FAMILY.node()(DRIVE, bench_at(loop.time), loop.put, loop.note))
    with pytest.raises(DriveError, match="2 servos answer as 1"):
        loop.drive.bring_up()


@pytest.mark.parametrize("home", ["counts", "hint"])
def test_the_angle_after_power_off_is_the_one_before(home: str) -> None:
    far = DRIVE if home == "counts" else DRIVE._replace(home="hint", motor_hint=0.1, motor_home=720.0 * RADIANS)
    loop = DriverLoop(far).up()
    before = loop.run(5, Power.ON)[-1].motor
    loop.drive.close()
    loop.inject("reboot")
    loop.advance(0.5)
    loop.drive.bring_up()
    assert math.isclose(loop.run(9, Power.OFF)[-1].motor, before, abs_tol=0.02)


def on_one_line(drives: list[Any]) -> tuple[MemoryBus, list[Any]]:
    """Servos and their drivers after cycles without power and with it; the frames of the last one still wait."""
    bus, family = MemoryBus(), family_of(drives[0])
    for drive in drives:
        bus.attach(family.node()(drive, bench_at(bus.time), bus.put, bus.note))
    links = Links(bus, bus)
    opened = [family.open(drive, links) for drive in drives]
    for one in opened:
        one.bring_up()
    for power in [Power.OFF] * 9 + [Power.ON] * 20:
        bus.advance(5e-3)
        bus.sent.clear()
        angles = [one.read(bus.time).motor for one in opened]
        for one, angle in zip(opened, angles, strict=True):
            one.write(angle, power, bus.time)
    return bus, opened


@pytest.mark.parametrize(
    ("drive", "bitrate"),
    [(DRIVE, 1_000_000), (DRIVE, 3_000_000), (FEETECH_DRIVE, 1_000_000)],
    ids=["1 Mbit/s", "3 Mbit/s", "Feetech"],
)
def test_six_servos_take_the_time_that_is_said(drive: Any, bitrate: int) -> None:
    """The bytes that go over the line in a cycle, ten bits each."""
    packets = drive.table.packets
    chain = [drive._replace(node_id=n, joint="none", bitrate=bitrate) for n in range(1, 7)]
    bus, _ = on_one_line(chain)
    said = [(one.arbitration_id, bytes(one.data)) for one in bus.drain()]
    assert len(said) == len(chain)
    told = [fast_answer(said)] if packets.fast else [packets.pack(*one) for one in said]
    count = sum(map(len, (*told, *(packets.pack(number, data) for _, number, data in bus.sent))))
    assert cycle_time(chain) == pytest.approx(10.0 * count / bitrate + ADAPTER, rel=0.01)


def test_a_range_of_more_than_a_turn_needs_a_hint() -> None:
    require(asking(DRIVE, highest_motor=6.5)._replace(home="hint"))


def test_two_motors_on_a_line_share_one_write_and_one_question() -> None:
    bus, both = on_one_line([DRIVE, DRIVE._replace(node_id=3, joint="none")])
    goals, question = (data for _, _, data in bus.sent)
    assert goals == DYNAMIXEL.sync_write(116, 4) + goals[5:]
    assert (goals[5], goals[10]) == (1, 3)
    assert question == DYNAMIXEL.sync_read(224, 10, fast=True) + bytes((1, 2, 3))
    assert all(one.read(bus.time).foreign == 0.0 for one in both)


def test_servos_that_one_question_cannot_ask_need_lines_of_their_own() -> None:
    other = DRIVE._replace(node_id=3, joint_node_id=4)
    assert collision(DRIVE, other) == ""
    assert "have what a cycle reads elsewhere" in collision(DRIVE, other._replace(model="PH54-200-S500"))


def test_a_servo_that_hears_nothing_holds_with_torque() -> None:
    """So it is for a bare bench alone."""
    loop = DriverLoop(DRIVE).up()
    loop.inject("deaf")
    loop.run(200, Power.OFF)
    assert loop.powered
    assert "its supply is cut" in FAMILY.unseen_watch(DRIVE)


COMM_SUCCESS = 0
"""Of ROBOTIS' library."""


def insisted(call: Any, *arguments: Any) -> Any:
    """What ROBOTIS' library says once an answer came: it waits in a busy loop, and the twin is in this process."""
    for _ in range(50):
        said = call(*arguments)
        if COMM_SUCCESS in (said, *(said[-2:-1] if isinstance(said, tuple) else ())):
            return said
        time.sleep(0.02)
    pytest.fail(f"{call.__name__}{arguments} came to nothing")


def test_robotis_library_moves_the_twin_over_a_line(sdk: Any, tmp_path: Any) -> None:
    with Played(DRIVE, tmp_path):
        port, packets = sdk.PortHandler(port_of(str(tmp_path))), sdk.PacketHandler(2.0)
        assert port.setBaudRate(DRIVE.bitrate)
        assert insisted(packets.ping, port, 1)[0] == 1020
        here = insisted(packets.read4ByteTxRx, port, 1, 132)[0]
        insisted(packets.write4ByteTxRx, port, 1, 116, here + 200)
        insisted(packets.write1ByteTxRx, port, 1, 64, 1)
        time.sleep(0.5)
        assert abs(insisted(packets.read4ByteTxRx, port, 1, 132)[0] - here - 200) < 20
        group = sdk.GroupSyncRead(port, packets, 132, 4)
        for number in (1, 2):
            assert group.addParam(number)
        insisted(group.txRxPacket)
        insisted(group.fastSyncRead)
        port.closePort()


def test_a_host_at_another_bit_rate_hears_nothing(tmp_path: Any) -> None:
    with Played(DRIVE, tmp_path):
        bus = SerialBus(port_of(str(tmp_path)), 115200, "dynamixel")
        bus.put(1, b"\x01")
        assert bus.recv(0.1) is None
        bus.shutdown()
        slow = asking(DRIVE._replace(channel=str(tmp_path), bitrate=115200), sample_time=0.01)
        drive = FAMILY.open(slow, None)
        with pytest.raises(BowdenError, match="nobody answers as servo 1 at 115200"):
            drive.bring_up()


def test_noise_on_the_line_is_an_error_frame(tmp_path: Any) -> None:
    host, line = os.openpty()
    bus = SerialBus(os.ttyname(line), 1_000_000, "dynamixel")
    os.write(host, b"\xff\xff\xfd\x00\x01\x04\x00\x55\x00\x01\x02" + DYNAMIXEL.pack(3, b"\x55\x00"))
    assert bus.recv(1.0) is not None
    assert bus.take() == (ERROR, b"")
    bus.shutdown()
    for end in (host, line):
        os.close(end)


def test_a_packet_is_the_one_of_feetechs_manual() -> None:
    assert FEETECH.pack(1, FEETECH.read(0x38, 2)).hex(" ") == "ff ff 01 04 02 38 02 be"


def test_a_feetech_servo_is_for_no_limb() -> None:
    rig = Rig().replace(sample_time=5e-3, drive=FEETECH_DRIVE._replace(interface="serial", channel="/dev/ttyUSB0"))
    with pytest.raises(SafetyError, match="no watchdog"):
        require_power(rig)
    require_power(rig.replace(drive=rig.drive._replace(no_limb=True)))


def test_a_raw_sync_read_on_the_line_is_answered_in_its_order(tmp_path: Any) -> None:
    with Played(FEETECH_DRIVE, tmp_path):
        bus = SerialBus(port_of(str(tmp_path)), 1_000_000, "feetech")
        bus.put(254, FEETECH.sync_read(56, 2) + bytes((2, 1)))
        answers = [bus.recv(1.0) for _ in range(2)]
        assert [one.arbitration_id for one in answers if one is not None] == [2, 1]
        bus.shutdown()
