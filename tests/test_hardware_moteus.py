"""A moteus board: frames, the driver against the twin in memory, what bring-up refuses, what frames cannot do."""

import math
import struct

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives.families.moteus import MoteusParameters, command_of
from bowden.hardware.drives.moteus_drive import MoteusDrive
from bowden.hardware.drives.moteus_frames import NumberKind, Register
from bowden.hardware.drives.scale import motor_limits, motor_scale
from bowden.hardware.ports import Power
from bowden.rig.rig import Rig
from support.memory_bus import DriverLoop

RIG = Rig(drive=MoteusParameters())
DRIVE = RIG.drive_parameters._replace(answer_timeout=0.02)
ENABLED = DriveState.OPERATION_ENABLED


class Bench(DriverLoop):
    """A board and its driver, on a bus of CAN-FD."""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        assert msg.is_fd
        assert msg.bitrate_switch
        assert len(msg.data) in (*range(9), 12, 16, 20, 24, 32, 48, 64)
        super().send(msg, timeout)


def test_frames_are_those_of_the_public_examples() -> None:
    """The two frames that mjbots/moteus, docs/protocol/can.md, takes apart byte by byte."""
    command = bytes.fromhex("01000a07206000200150ff140400130d")
    built = frames.values(frames.WRITE, NumberKind.INT8, Register.MODE, 10)
    built += frames.values(frames.WRITE, NumberKind.INT16, Register.COMMAND_POSITION, 0.0096, 0.072, -1.76)
    built += frames.subframe(frames.READ, NumberKind.INT16, Register.MODE, 4)
    built += frames.subframe(frames.READ, NumberKind.INT8, Register.VOLTAGE, 3)
    assert built == command
    found, failed, text = frames.replied(bytes.fromhex("2404000a005000000170ff230d181400"))
    assert (failed, text) == ([], b"")
    assert found[Register.MODE] == 10
    assert found[Register.POSITION] == pytest.approx(0.008)
    assert found[Register.VELOCITY] == pytest.approx(0.064)
    assert found[Register.TORQUE] == pytest.approx(-1.44)
    assert (found[Register.VOLTAGE], found[Register.TEMPERATURE], found[Register.FAULT]) == (12.0, 20.0, 0.0)


def test_a_reply_of_any_other_length_is_whole_or_says_nothing() -> None:
    cycle, heads = frames.CommandFrames(1), ((0, 0, (10,)), (3, 1, (0.5, 0.1, 0.2, 1.0)), (0, 14, (35, 0)))
    tail = (
        (3, frames.SOURCES[1], (0.25,)),
        (0, Register.ENCODER_VALIDITY, (5,)),
        (3, Register.COMMAND_TIMEOUT, (0.03,)),
    )
    reply = b"".join(frames.values(frames.REPLY, NumberKind(kind), at, *said) for kind, at, said in (*heads, *tail))
    whole = cycle.reply(reply)
    assert whole is not None
    assert (whole.position, whole.joint) == (0.5, 0.25)
    for length in range(65):
        assert cycle.reply(reply.ljust(64, b"P")[:length]) == (whole if length >= len(reply) else None)


@given(st.floats(-1e9, 1e9, width=32), st.sampled_from(sorted(frames.SCALES)), st.sampled_from(list(NumberKind)[:3]))
def test_an_integer_stands_at_its_end_for_what_is_beyond_and_never_for_none(
    value: float, register: int, kind: NumberKind
) -> None:
    most, step = (127, 32767, 2147483647)[kind], frames.SCALES[register][kind]
    wire = frames.wire_value(register, kind, value)
    assert -most <= wire <= most
    assert abs(frames.physical_value(register, kind, wire) - max(-most * step, min(most * step, value))) <= 1.01 * step
    assert frames.wire_value(register, kind, math.nan) == -most - 1
    assert math.isnan(frames.physical_value(register, kind, -most - 1))


def test_fields_at_their_ends_are_no_small_currents() -> None:
    bus = Bench(DRIVE).up()
    bus.inject("saturated")
    assert abs(bus.run(5, Power.ON)[-1].current) > 3000.0


def test_boards_with_a_prefix_are_heard_by_hosts_with_the_same_one_alone() -> None:
    drive = DRIVE._replace(can_prefix=0x123)
    bus = Bench(drive).up()
    assert {identifier >> 16 & 0x1FFF for _, identifier, _ in bus.sent} == {0x123}
    assert abs(bus.run(100, Power.ON, speed=0.3)[-1].joint - bus.node.bench.joint) < 0.01
    bus.put(0x8001 | EXTENDED, b"\x01\x00\x0a")  # of another prefix: not our board's
    assert bus.drive.read(bus.time).foreign == 0.0
    bus.put(0x0123_8001 | EXTENDED, b"\x01\x00\x0a")
    assert bus.drive.read(bus.time).foreign == 1.0
    other = Bench(drive)
    with pytest.raises(DriveError, match="no moteus board answers as node 1"):
        MoteusDrive(DRIVE, Links(other, other)).bring_up()


def test_a_command_never_leads_out_of_the_rigs_range_should_it_be_the_last() -> None:
    limits = motor_limits(DRIVE, motor_scale(DRIVE))
    for turns in (limits.low, 0.5 * (limits.low + limits.high), limits.high - 1e-4, limits.high):
        for step in (-0.02, -1e-4, 0.0, 1e-4, 0.02):
            command = command_of(DRIVE, limits, turns, turns - step, 0.0)
            ends = command.position + command.velocity * command.timeout
            assert limits.low - 1e-9 <= ends <= limits.high + 1e-9
            assert abs(command.velocity) <= limits.speed + 1e-9
    assert command_of(DRIVE, limits, math.nan, 1.0, math.nan)[1:3] == (0.0, 0.0)


def test_errors_and_types_are_those_of_the_public_server() -> None:
    bus = Bench(DRIVE)
    said: list[bytes] = []
    for data in (
        frames.subframe(frames.READ, NumberKind.INT16, Register.POSITION, 2),
        frames.subframe(frames.READ, NumberKind.FLOAT, 0x200, 1) + frames.subframe(frames.READ, NumberKind.INT8, 0, 1),
        frames.subframe(frames.READ, NumberKind.INT8, Register.FIRMWARE, 1),
        frames.values(frames.WRITE, NumberKind.FLOAT, Register.POSITION, 1.0),
        frames.values(frames.WRITE, NumberKind.FLOAT, 0x200, 1.0),
        frames.subframe(frames.READ, NumberKind.INT16, Register.MOTOR_TEMPERATURE, 1),
        frames.subframe(frames.READ, NumberKind.FLOAT, Register.MODE, 40),
    ):
        bus.node.receive(0x8001 | EXTENDED, data, bus.time)
        said += [bytes(message.data).rstrip(b"\x50") for message in bus.drain()]
    assert said[0][:2] == b"\x26\x01"
    assert said[1] == b"\x31\x80\x04\x01", "what follows such an error is not looked at"
    assert said[2] == b"\x31\x81\x02\x01"
    assert said[3] == b"\x30\x01\x02"
    assert said[4] == b"\x30\x80\x04\x01"
    assert struct.unpack("<h", said[5][2:]) == (-32768,), "no value"
    assert said[6] == b"\x31\x00\x02"
