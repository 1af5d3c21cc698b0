"""A moteus board: frames, the driver against the twin in memory, what bring-up refuses, what frames cannot do."""

import math
import struct
from collections.abc import Mapping

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.unix_bus import EXTENDED
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives import moteus_setup
from bowden.hardware.drives.families.moteus import FAMILY, MoteusParameters, command_of, motor_scale
from bowden.hardware.drives.moteus_drive import MoteusDrive
from bowden.hardware.drives.moteus_frames import TIMED_OUT, BoardMode, NumberKind, Register
from bowden.hardware.drives.scale import motor_limits
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.injection import parse
from bowden.hardware.twin.moteus_node import MoteusNode, Overrides
from bowden.hardware.twin.plant import OFF
from bowden.rig.rig import Rig
from support.memory_bus import DrivenBus

RIG = Rig(drive=MoteusParameters())
DRIVE = RIG.drive_parameters._replace(answer_timeout=0.02)
ENABLED = DriveState.OPERATION_ENABLED


class Bench(DrivenBus):
    """The memory bus with a board on it, and a drive that is its host."""

    def __init__(self, overrides: Overrides | None = None, drive: MoteusParameters = DRIVE) -> None:
        super().__init__()
        rig = RIG
        plant = TwinBench(rig.bench, rig.bend_path, 5.0, rig.seed, rig.start_motor, self.time)
        self.node = MoteusNode(drive, plant, self.put, self.note, overrides)
        self.attach(self.node)
        self.drive = MoteusDrive(drive, Links(self))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        assert msg.is_fd
        assert msg.bitrate_switch
        assert len(msg.data) in (*range(9), 12, 16, 20, 24, 32, 48, 64)
        super().send(msg, timeout)

    def up(self) -> "Bench":
        """Brought up, and in position mode."""
        self.drive.bring_up()
        self.run(5, Power.OFF)
        assert self.run(30, Power.ON)[-1].drive_state == ENABLED
        return self


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moteus_setup, "LISTENING", 0.02)


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


def test_a_board_is_brought_up_led_and_let_go_of() -> None:
    bus = Bench()
    assert "firmware 1.1.1" in bus.drive.bring_up()
    bus.run(5, Power.OFF)
    assert bus.run(30, Power.ON)[-1].drive_state == ENABLED
    readings = bus.run(500, Power.ON, speed=0.5)
    assert readings[-1].motor - readings[0].motor == pytest.approx(0.25, abs=0.03)
    assert abs(readings[-1].joint - bus.node.bench.joint) < 0.01
    assert readings[-1].sample_age == pytest.approx(1e-3)
    assert {reading.emergency for reading in readings} == {0.0}
    assert bus.drive.close() is TorqueLeft.OFF
    assert bus.node.bench.doing == OFF


def test_the_torque_is_off_40_ms_after_our_last_word_and_comes_back_by_an_order_alone() -> None:
    bus = Bench().up()
    last = bus.time
    while bus.node.bench.doing != OFF:
        bus.advance(1e-3)
    assert bus.time - last <= 0.040
    assert bus.node.mode is BoardMode.TIMEOUT
    seen = bus.run(50, Power.ON)
    assert TIMED_OUT in {reading.emergency for reading in seen}
    assert bus.node.bench.doing == OFF
    bus.run(5, Power.OFF)
    assert bus.run(30, Power.ON)[-1].drive_state == ENABLED


def test_fields_at_their_ends_are_no_small_currents() -> None:
    bus = Bench().up()
    bus.node.faults.inject(parse("saturated"))
    assert abs(bus.run(5, Power.ON)[-1].current) > 3000.0


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({0x102: 4.0}, "version 4 of the register map"),
        ({0x000: 10.0}, r"runs already: it is in mode 10 \(position\)"),
        ({"servo.timeout_mode": 12.0}, "keeps its torque when its host falls silent"),
        ({"servo.timeout_mode": None}, "ERR"),
        ({"servo.fixed_voltage_mode": 1.0}, "fixed_voltage_mode is 1"),
        ({"servo.default_accel_limit": 5.0}, "plans a motion of its own"),
        ({"servo.pid_position.kp": 0.0}, "no gain"),
        ({"motor_position.rotor_to_output_ratio": 0.2}, "rotor_to_output_ratio is 0.2"),
        ({"motor_position.sources.1.aux_number": 1.0}, "no encoder in slot 1"),
        ({0x058: 1.0}, "no valid reading"),
        ({0x052: 8192.0}, "in counts"),
        ({0x052: None}, "no register 052h"),
        ({0x00C: 1.0}, "within a turn of the rotor alone"),
        ({"servopos.position_max": 0.1}, "highest position"),
        ({"servo.max_velocity": 0.5}, "speed limit"),
        ({"servo.max_current_A": 1.0}, "current limit"),
        ({"servo.fault_position_error": 0.001}, "following error"),
        ({0x027: 0.1}, "watchdog of 0.1 s"),
    ],
)
def test_a_board_that_does_not_fit_is_refused_without_power(overrides: Mapping[int | str, float], said: str) -> None:
    bus = Bench(overrides)
    with pytest.raises(DriveError, match=said):
        bus.drive.bring_up()
    assert not any(event == "torque_on" for _, event, _ in bus.journal)
    assert not any(data[:2] == b"\x01\x00" for _, _, data in bus.sent), "no mode was written"


def test_nobody_and_another_master_are_told_before_anything_is_said() -> None:
    bus = Bench()
    with pytest.raises(DriveError, match="no moteus board answers as node 9"):
        MoteusDrive(DRIVE._replace(node_id=9), Links(bus)).bring_up()
    bus.sent.clear()
    bus.put(0x8001 | EXTENDED, b"\x01\x00\x0a")
    with pytest.raises(DriveError, match="another master speaks to node 1"):
        bus.drive.bring_up()
    assert bus.sent == []


def test_boards_with_a_prefix_are_heard_by_hosts_with_the_same_one_alone() -> None:
    drive = DRIVE._replace(can_prefix=0x123)
    bus = Bench(drive=drive).up()
    assert {identifier >> 16 & 0x1FFF for _, identifier, _ in bus.sent} == {0x123}
    assert abs(bus.run(100, Power.ON, speed=0.3)[-1].joint - bus.node.bench.joint) < 0.01
    bus.put(0x8001 | EXTENDED, b"\x01\x00\x0a")  # of another prefix: not our board's
    assert bus.drive.read(bus.time).foreign == 0.0
    bus.put(0x0123_8001 | EXTENDED, b"\x01\x00\x0a")
    assert bus.drive.read(bus.time).foreign == 1.0
    with pytest.raises(DriveError, match="no moteus board answers as node 1"):
        MoteusDrive(DRIVE, Links(Bench(drive=drive))).bring_up()
    with pytest.raises(ParameterError, match="can_prefix is 8192; expected at least 0 and at most 8191"):
        MoteusDrive(DRIVE._replace(can_prefix=0x2000))


def test_a_command_never_leads_out_of_the_rigs_range_should_it_be_the_last() -> None:
    limits = motor_limits(DRIVE, motor_scale(DRIVE))
    for turns in (limits.low, 0.5 * (limits.low + limits.high), limits.high - 1e-4, limits.high):
        for step in (-0.02, -1e-4, 0.0, 1e-4, 0.02):
            command = command_of(DRIVE, limits, turns, turns - step, 0.0)
            ends = command.position + command.velocity * command.timeout
            assert limits.low - 1e-9 <= ends <= limits.high + 1e-9
            assert abs(command.velocity) <= limits.speed + 1e-9
    assert command_of(DRIVE, limits, math.nan, 1.0, math.nan)[1:3] == (0.0, 0.0)


def test_parameters_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"watchdog_ms is 45"):
        MoteusDrive(DRIVE._replace(watchdog=0.045))
    with pytest.raises(ParameterError, match="host_id"):
        MoteusDrive(DRIVE._replace(host_id=1))
    assert FAMILY.watchdog(DRIVE._replace(watchdog=0.039)) <= 0.040


def test_errors_and_types_are_those_of_the_public_server() -> None:
    bus = Bench()
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


_SHARED: list[Bench] = []


def attacked(identifier: int, data: bytes) -> None:
    """A frame in the middle of a run: nothing is raised, and what goes out is a target or no power."""
    if not _SHARED:
        _SHARED.append(Bench().up())
    bus = _SHARED[0]
    bus.put(identifier, data)
    bus.sent.clear()
    reading = bus.drive.read(bus.time)
    bus.drive.write(0.0, Power.ON, bus.time)
    for _, sent_to, sent in bus.sent:
        assert sent_to == 0x2001 | frames.REPLY_WANTED
        for base, one in frames.subframes(sent):
            if base == frames.WRITE and isinstance(one, frames.RegisterWritten):
                target = one.value if one.register == Register.COMMAND_POSITION else 0.0
                assert math.isnan(target) or abs(target) < 1e-6
    assert reading.heartbeat_age >= 0.0
    bus.node.receive(identifier, data, bus.time)
    bus.drain()


frame_data = st.one_of(
    st.binary(max_size=64),
    st.tuples(
        st.sampled_from([b"\x21\x00", b"\x2c\x04\x01", b"\x01\x00", b"\x40\x01", b"\x42\x01"]), st.binary(max_size=60)
    ).map(b"".join),
    st.tuples(st.integers(-128, 127), st.lists(st.floats(width=32), min_size=6, max_size=6), st.binary(max_size=4)).map(
        lambda given_: struct.pack("<2sb3sffff2sbb2sf2sb2sf", b"\x21\x00", given_[0], b"\x2c\x04\x01", *given_[1][:4],
                                   b"\x22\x0e", given_[0], given_[0], b"\x2d\x52", given_[1][4], b"\x21\x58", given_[0],
                                   b"\x2d\x27", given_[1][5]) + given_[2]
    ),
)  # fmt: skip
identifiers = st.one_of(
    st.sampled_from([0x0120, 0x0120 | EXTENDED, 0x8001 | EXTENDED, 0x0100, 0x2001]), st.integers(0, 0xFFFF_FFFF)
)


@given(identifiers, frame_data)
@settings(max_examples=500, deadline=None)
def test_no_frame_raises_or_leads_to_an_unsafe_target(identifier: int, data: bytes) -> None:
    attacked(identifier, data)


@pytest.mark.long
@given(identifiers, frame_data)
@settings(max_examples=100_000, deadline=None)
def test_no_frame_of_100_000_raises_or_leads_to_an_unsafe_target(identifier: int, data: bytes) -> None:
    attacked(identifier, data)
