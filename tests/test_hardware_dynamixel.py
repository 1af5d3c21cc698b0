"""Dynamixel: its packets against ROBOTIS' own library, bring-up, a run, and what must not go wrong."""

import math
import os
import random
import time
from collections.abc import Iterator
from typing import Any

import pytest

from bowden.core.errors import BowdenError, DriveError, ParameterError
from bowden.core.signals import DriveState
from bowden.core.units import RADIANS
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.packets import DYNAMIXEL, FEETECH, STATUS, PacketReader, Packets, fast_answer
from bowden.hardware.buses.place import ERROR
from bowden.hardware.buses.serial_bus import SerialBus, port_of
from bowden.hardware.drives.families.dynamixel import FAMILY, MODELS, DynamixelParameters
from bowden.hardware.drives.on_can import require
from bowden.hardware.drives.servo_table import ServoRegister, cycle_time
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.servo_node import ServoNode
from support.lines import Line
from support.memory_bus import DriverLoop, MemoryBus, asking, bench_at

sdk = pytest.importorskip("dynamixel_sdk", reason="pip install 'bowden[partners]'")

DRIVE = asking(DynamixelParameters(motor_home=-90.0 * RADIANS), lowest_motor=-0.3, highest_motor=2.0, current_limit=2.0)


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


def test_packets_are_those_of_robotis() -> None:
    theirs = sdk.PacketHandler(2.0)
    for number, data in frames(500, 2):
        packet = [0xFF, 0xFF, 0xFD, 0, number, *(len(data) + 2).to_bytes(2, "little"), *data, 0, 0]
        packet = theirs.addStuffing(packet)
        end = 7 + packet[5] + 256 * packet[6] - 2
        crc = theirs.updateCRC(0, packet, end)
        assert bytes(packet[:end]) + crc.to_bytes(2, "little") == DYNAMIXEL.pack(number, data)


def test_models_and_addresses_are_those_of_robotis() -> None:
    from dynamixel_easy_sdk.control_table import ControlTable

    for name, table in MODELS.items():
        assert ControlTable.getModelName(table.model).removesuffix(".model") == name.lower().replace("-", "_")
        theirs = ControlTable.getControlTable(table.model)
        for register, own in table.registers.items():
            assert (theirs[register].address, theirs[register].size) == own[:2], f"{name}: {register}"
        assert table.indirect == (theirs["Indirect Address 1"].address, theirs["Indirect Data 1"].address)


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


def test_it_follows_and_tells_both_angles() -> None:
    loop = DriverLoop(DRIVE).up()
    last = loop.run(300, Power.ON, speed=1.0)[-1]
    assert math.isclose(last.motor, loop.node.bench.motor, abs_tol=0.01)
    assert math.isclose(last.joint, loop.node.bench.joint, abs_tol=0.01)
    assert last.foreign == last.bus_errors == last.emergency == 0.0
    assert loop.drive.close() == TorqueLeft.OFF
    assert not loop.powered


def test_enabling_moves_nothing() -> None:
    loop = DriverLoop(DRIVE)
    loop.drive.bring_up()
    loop.run(20, Power.OFF)
    before = loop.node.bench.motor
    loop.run(30, Power.ON)
    assert loop.powered
    assert math.isclose(loop.node.bench.motor, before, abs_tol=2e-3)


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


def test_a_hardware_error_ends_with_a_restart_and_a_bring_up() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.inject("drive_fault 4")
    assert "overheating" in FAMILY.explain(int(next(one.emergency for one in loop.run(9, Power.ON) if one.emergency)))
    loop.run(9, Power.OFF)
    loop.drive.reset_fault()
    assert all(math.isnan(one.motor) for one in loop.run(600, Power.OFF)[5:])  # its turn may be another
    loop.drive.bring_up()
    assert loop.run(20, Power.OFF)[-1].drive_state == DriveState.SWITCH_ON_DISABLED


REFUSED: dict[str, tuple[Any, dict[int, int], str]] = {
    "torque": (DRIVE, {64: 1}, "runs already"),
    "another model": (DRIVE, {0: 6, 1: 4}, "correct drive.model"),
    "return delay": (DRIVE, {9: 250}, "Return Delay Time is 250"),
    "another mode": (DRIVE, {11: 3}, "Operating Mode is 3"),
    "no watchdog": (DRIVE, {98: 0}, "Bus Watchdog 0 after 2"),
    "reversed": (DRIVE, {10: 1}, "Drive Mode is 1"),
    "current": (DRIVE, {38: 10, 39: 0}, "beyond the drive's own"),
    "its own limit": (DRIVE._replace(model="PH54-200-S500"), {38: 255, 39: 15}, "may draw more"),
    "firmware": (DRIVE._replace(model="XL330-M288"), {6: 52}, "Firmware Version is 52"),
    "its turn": (DRIVE._replace(motor_home=0.0), {}, "after power-off"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_before_power(case: str) -> None:
    drive, registers, said = REFUSED[case]
    loop = DriverLoop(drive, registers)
    with pytest.raises(DriveError, match=said):
        loop.drive.bring_up()
    assert "torque_on" not in loop.events


def test_two_servos_of_one_number_are_refused() -> None:
    loop = DriverLoop(DRIVE)
    loop.attach(ServoNode(DRIVE, bench_at(loop.time), loop.put, loop.note))
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


def test_a_range_of_more_than_a_turn_needs_a_hint() -> None:
    wide = asking(DRIVE, highest_motor=6.5)
    with pytest.raises(ParameterError, match="forgets at power-off"):
        require(wide)
    require(wide._replace(home="hint"))


def test_a_chain_is_slower_than_one_servo_and_quicker_at_more_bits_a_second() -> None:
    for rate in (1_000_000, 3_000_000):
        assert cycle_time([DRIVE._replace(bitrate=rate)] * 6) > cycle_time([DRIVE._replace(bitrate=rate)])
    assert cycle_time([DRIVE] * 6) > cycle_time([DRIVE._replace(bitrate=3_000_000)] * 6)
    with pytest.raises(ParameterError, match="too short"):
        require(asking(DRIVE, sample_time=1e-3))


def test_two_motors_on_a_line_share_one_write_and_one_question() -> None:
    bus = MemoryBus()
    drives = [DRIVE, DRIVE._replace(node_id=3, joint="none")]
    for drive in drives:
        bus.attach(ServoNode(drive, bench_at(bus.time), bus.put, bus.note))
    links = Links(bus)
    both = [FAMILY.open(drive, links) for drive in drives]
    for one in both:
        one.bring_up()
    for power in [Power.OFF] * 9 + [Power.ON] * 20:
        bus.sent.clear()
        angles = [one.read(bus.time).motor for one in both]
        for one, angle in zip(both, angles, strict=True):
            one.write(angle, power, bus.time)
        bus.advance(5e-3)
    goals, question = (data for _, _, data in bus.sent)
    assert goals == DYNAMIXEL.sync_write(116, 4) + goals[5:]
    assert (goals[5], goals[10]) == (1, 3)
    assert question == DYNAMIXEL.sync_read(224, 10, fast=True) + bytes((1, 2, 3))
    assert all(one.read(bus.time).foreign == 0.0 for one in both)


def test_a_servo_that_hears_nothing_holds_with_torque() -> None:
    """So it is for a bare bench alone."""
    loop = DriverLoop(DRIVE).up()
    loop.inject("deaf")
    loop.run(200, Power.OFF)
    assert loop.powered
    assert "its supply is cut" in FAMILY.unseen_watch(DRIVE)


def insisted(call: Any, *arguments: Any) -> Any:
    """What ROBOTIS' library says once an answer came: it waits in a busy loop, and the twin is in this process."""
    for _ in range(50):
        said = call(*arguments)
        if sdk.COMM_SUCCESS in (said, *(said[-2:-1] if isinstance(said, tuple) else ())):
            return said
        time.sleep(0.02)
    pytest.fail(f"{call.__name__}{arguments} came to nothing")


def test_robotis_library_moves_the_twin_over_a_line(tmp_path: Any) -> None:
    with Line(DRIVE, str(tmp_path)) as line:
        port, packets = sdk.PortHandler(port_of(str(tmp_path))), sdk.PacketHandler(2.0)
        assert port.setBaudRate(DRIVE.bitrate)
        assert insisted(packets.ping, port, 1)[0] == 1020
        here = insisted(packets.read4ByteTxRx, port, 1, 132)[0]
        insisted(packets.write4ByteTxRx, port, 1, 116, here + 200)
        insisted(packets.write1ByteTxRx, port, 1, 64, 1)
        line.wait(0.5)
        assert abs(insisted(packets.read4ByteTxRx, port, 1, 132)[0] - here - 200) < 20
        group = sdk.GroupSyncRead(port, packets, 132, 4)
        for number in (1, 2):
            assert group.addParam(number)
        insisted(group.txRxPacket)
        insisted(group.fastSyncRead)
        port.closePort()


def test_a_host_at_another_bit_rate_hears_nothing(tmp_path: Any) -> None:
    with Line(DRIVE, str(tmp_path)):
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
