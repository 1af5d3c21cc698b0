"""A CubeMars AK drive in MIT mode against its twin at a time of our own: frames, bring-up, power, faults, bad input."""

import math
from typing import Any

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError, ParameterError, SafetyError
from bowden.core.signals import DriveReading, DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.drives import ak_drive
from bowden.hardware.drives.ak_drive import AkDrive
from bowden.hardware.drives.ak_frames import (
    ENTER,
    EXIT,
    HIGHEST_POSITION,
    MODELS,
    ZERO,
    AkCommand,
    AkReply,
    pack_command,
    pack_reply,
    unpack_command,
    unpack_reply,
)
from bowden.hardware.drives.families.ak_mit import FAMILY, ROOM, AkParameters, check_parameters
from bowden.hardware.drives.findings import INERT, LOST_RANGE
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.ak_node import AkNode
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.injection import parse
from bowden.hardware.twin.plant import FOLLOW, OFF
from bowden.live.by_hand import require_watch, unseen_watch
from bowden.live.live_run import require_joint
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import bench
from bowden.rig.rig import Rig
from support.memory_bus import MemoryBus

CYCLE = 1e-3
DRIVE = AkParameters(answer_timeout=0.2)
MODEL = MODELS["AK80-9"]
ON_RIG = '[motor]\ngear = 9.0\ntorque_constant_nm_per_a = 0.091\n[drive]\nfamily = "ak_mit"\n'


class Loop:
    """A drive, its twin, and a loop."""

    def __init__(self, drive: AkParameters = DRIVE, start: float = 0.1) -> None:
        rig = bench()
        self.bus = MemoryBus()
        plant = TwinBench(rig, constant_bend(rig.sheath.bend), 1.0, 0, start, self.bus.time)
        self.node = AkNode(drive, plant, self.bus.put, self.bus.note)
        self.bus.attach(self.node)
        self.drive = AkDrive(drive, Links(self.bus))
        self.readings: list[DriveReading] = []

    def up(self) -> "Loop":
        self.said = self.drive.bring_up()
        self.bus.sent.clear()
        return self

    def run(self, cycles: int, power: Power, target: float | None = None, speed: float = 0.0) -> DriveReading:
        """So many cycles; without a target the motor is to stay where it was seen."""
        for k in range(cycles):
            reading = self.drive.read(self.bus.time)
            self.readings.append(reading)
            seen = reading.motor if math.isfinite(reading.motor) else 0.0
            aim = seen if target is None else target + speed * k * CYCLE
            self.drive.write(aim, power, self.bus.time)
            self.bus.advance(CYCLE)
        return self.readings[-1]

    def on(self) -> "Loop":
        self.run(20, Power.ON)
        assert self.readings[-1].drive_state == DriveState.OPERATION_ENABLED
        return self

    def inject(self, text: str) -> None:
        self.node.faults.inject(parse(text)._replace(start=self.bus.time))

    def found(self) -> set[float]:
        return {reading.emergency for reading in self.readings if reading.emergency}

    @property
    def powered(self) -> bool:
        return bool(self.node.bench.doing != OFF)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ak_drive, "LISTENING", 0.02)


COMMANDS = st.builds(
    AkCommand,
    st.floats(-HIGHEST_POSITION, HIGHEST_POSITION),
    st.floats(-MODEL.velocity, MODEL.velocity),
    st.floats(0.0, 500.0),
    st.floats(0.0, 5.0),
    st.floats(-MODEL.torque, MODEL.torque),
)


@given(COMMANDS)
@settings(max_examples=300, deadline=None)
def test_a_command_comes_back_within_half_a_step(command: AkCommand) -> None:
    back = unpack_command(pack_command(command, MODEL), MODEL)
    assert back is not None
    spans = (25.0 / 65535, 100.0 / 4095, 500.0 / 4095, 5.0 / 4095, 36.0 / 4095)
    for told, meant, step in zip(back, command, spans, strict=True):
        assert abs(told - meant) <= 0.5001 * step


def test_no_command_is_taken_for_a_code() -> None:
    highest = AkCommand(12.5, 50.0, 500.0, 5.0, 18.0)
    for torque in range(4096):
        data = pack_command(highest._replace(torque=-18.0 + 36.0 * torque / 4095), MODEL)
        assert data not in (ENTER, EXIT, ZERO)


def test_a_reply_has_the_manuals_layout_and_begins_again_at_its_other_end() -> None:
    # by hand: number 3, position 8000h, speed 7FFh, torque 800h, 25 °C, no error
    reply = unpack_reply(bytes((3, 0x80, 0x00, 0x7F, 0xF8, 0x00, 25, 0)), MODEL)
    assert reply is not None
    assert (reply.number, reply.temperature, reply.error, reply.at_end) == (3, 25, 0, False)
    assert reply.position == pytest.approx(0.0, abs=2e-4)
    assert reply.velocity == pytest.approx(-0.0122, abs=1e-4)
    assert reply.torque == pytest.approx(0.0044, abs=1e-4)
    beyond = unpack_reply(pack_reply(reply._replace(position=13.0), MODEL), MODEL)
    assert beyond is not None
    assert beyond.position == pytest.approx(-12.0, abs=4e-4)
    assert unpack_reply(bytes(6), MODEL) is None


def test_bring_up_asks_without_power_and_says_what_cannot_be_seen() -> None:
    loop = Loop()
    said = loop.drive.bring_up()
    assert "AK80-9 in MIT mode at node 1" in said
    assert "no frame shows" in said
    assert "16384 counts a turn" in said
    assert all(data == EXIT for _, identifier, data in loop.bus.sent if identifier == 1)


def test_enabling_moves_nothing_and_the_motor_then_follows() -> None:
    loop = Loop().up().on()
    begun = [data for _, identifier, data in loop.bus.sent if identifier == 1 and data not in (EXIT, ENTER)]
    first = unpack_command(begun[0], MODEL)
    assert first is not None
    assert (first.kp, first.kd) == (pytest.approx(500.0 / 4095), 0.0)
    assert abs(loop.readings[-1].motor - 0.1) < 0.01
    reading = loop.run(400, Power.ON, 0.5)
    assert reading.motor == pytest.approx(0.5, abs=0.03)  # less by the load over the stiffness
    assert math.isfinite(reading.joint)
    assert loop.found() == set()
    reading = loop.run(5, Power.OFF)
    assert reading.drive_state == DriveState.SWITCH_ON_DISABLED
    assert not loop.powered
    assert loop.drive.close() is TorqueLeft.OFF
    assert loop.drive.close() is TorqueLeft.OFF


@pytest.mark.parametrize("target", [math.nan, math.inf, HIGHEST_POSITION - ROOM + 0.01, -40.0])
def test_a_target_that_is_none_or_beyond_the_range_takes_the_torque_off(target: float) -> None:
    loop = Loop().up().on()
    loop.run(3, Power.ON, target)
    assert not loop.powered


def test_an_inert_motor_is_seen_within_fifty_milliseconds_of_a_motion_and_gets_no_power_again() -> None:
    loop = Loop().up().on()
    loop.run(100, Power.ON, 0.1)
    loop.inject("inert")
    began = len(loop.readings)
    loop.run(50, Power.ON, loop.readings[-1].motor, speed=1.0)
    at = next(k for k, reading in enumerate(loop.readings[began:]) if reading.emergency == INERT)
    assert at <= 50
    assert "inert" in FAMILY.explain(INERT)
    loop.node.faults.clear()
    loop.run(50, Power.ON)
    assert not loop.powered


def test_a_drive_that_leaves_its_mode_and_answers_on_is_seen_within_fifty_milliseconds_of_a_motion() -> None:
    loop = Loop().up().on()
    loop.run(300, Power.ON, 0.1, speed=1.0)
    loop.inject("mode_left")
    began, at = len(loop.readings), loop.readings[-1].motor
    loop.run(50, Power.ON, at + 0.04, speed=1.0)
    assert INERT in {reading.emergency for reading in loop.readings[began:]}
    loop.run(200, Power.ON)
    assert not loop.powered


def test_a_torque_that_is_always_told_the_same_is_none() -> None:
    loop = Loop().up().on()
    loop.node._asked = lambda: 3.0  # type: ignore[method-assign]
    loop.node.bench.advance = lambda now: None  # type: ignore[method-assign]
    loop.run(200, Power.ON, 0.15, speed=0.3)
    assert INERT in loop.found()


class GivingWay(TwinBench):
    """A motor whose own position loop gives way under a load, a tenth as stiff as the drive says it is."""

    def __init__(self, now: float) -> None:
        rig = bench()
        super().__init__(rig, constant_bend(rig.sheath.bend), 1.0, 0, 0.1, now)
        self.servo_gains = (4.6, 0.17)
        self.torque_offset, self.turned, self.speed, self.given, self.load, self.clock = 0.0, 0.1, 0.0, 0.0, 2.0, now

    def advance(self, now: float) -> None:
        if not hasattr(self, "clock"):
            return
        for _ in range(10):
            span = 0.1 * (now - self.clock)
            wanted = 4.6 * (self.command - self.turned) - 0.17 * self.speed + self.torque_offset
            self.given = max(-16.0, min(16.0, wanted)) if self.doing == FOLLOW else 0.0
            self.speed += (self.given - self.load * (self.doing == FOLLOW) - 0.5 * self.speed) / 1.6e-3 * span
            self.turned += self.speed * span
        self.clock = now

    motor = property(lambda self: self.turned)  # type: ignore[assignment]
    velocity = property(lambda self: self.speed)  # type: ignore[assignment]
    current = property(lambda self: self.given / (9.0 * 0.091))  # type: ignore[assignment]


def test_a_plant_whose_motor_gives_way_is_given_the_drives_torque_and_is_not_inert() -> None:
    loop = Loop()
    plant = GivingWay(loop.bus.time)
    loop.node.bench = plant
    loop.up().on()
    for k in range(600):
        aim = 0.1 + 0.2 * math.sin(6.0 * k * CYCLE)
        loop.run(1, Power.ON, aim)
    assert loop.found() == set()
    assert plant.given == pytest.approx(50.0 * (aim - plant.turned) - 1.9 * plant.speed, abs=0.5)
    assert abs(aim - plant.turned) < 0.1, "as stiff as the rig says, and not a tenth of it"


def test_a_drive_at_its_largest_current_is_not_inert() -> None:
    loop = Loop(DRIVE._replace(current_limit=8.0))
    plant = GivingWay(loop.bus.time)
    loop.node.bench = plant
    loop.up().on()
    plant.load, most = 40.0, 9.0 * 0.091 * 8.0
    plant.advance = lambda now: setattr(plant, "given", most)  # type: ignore[method-assign]
    for k in range(100):
        loop.run(1, Power.ON, 0.5 + 0.002 * k)
    assert loop.found() == set()


def test_saturated_fields_show_as_a_current_beyond_any_that_a_rig_may_ask_for() -> None:
    loop = Loop().up().on()
    loop.inject("saturated")
    reading = loop.run(5, Power.ON)
    assert abs(reading.current) > 0.98 * MODEL.torque / (9.0 * 0.091)


def test_a_silence_of_ours_is_a_torque_let_go_and_no_restart() -> None:
    loop = Loop().up().on()
    loop.bus.advance(0.03)
    assert not loop.powered
    loop.run(100, Power.ON)
    assert not loop.powered
    loop.run(3, Power.OFF)
    loop.on()


def test_a_position_that_has_gone_round_its_range_is_found_before_the_stiffness() -> None:
    loop = Loop()
    loop.up()
    loop.node._shift += 25.0
    loop.run(20, Power.ON)
    assert LOST_RANGE in loop.found()
    assert not loop.powered


def test_a_hint_tells_in_which_turn_the_rotor_is() -> None:
    turn = 2.0 * math.pi / 9.0
    loop = Loop(DRIVE._replace(home="hint", motor_hint=0.15), start=0.1)
    loop.node._shift -= 3.0 * turn
    loop.up()
    assert loop.run(5, Power.READY).motor == pytest.approx(0.1, abs=0.01)


def test_another_master_is_seen_before_and_in_a_run() -> None:
    loop = Loop()
    loop.bus.put(1, pack_command(AkCommand(0.0, 0.0, 5.0, 1.0, 0.0), MODEL))
    with pytest.raises(DriveError, match="another master"):
        loop.drive.bring_up()
    loop = Loop().up()
    loop.bus.put(1, pack_command(AkCommand(0.0, 0.0, 5.0, 1.0, 0.0), MODEL))
    assert loop.run(1, Power.READY).foreign == 1.0
    loop.run(5, Power.READY)
    for _ in range(20):
        loop.bus.put(1, pack_reply(AkReply(1, 0.0, 0.0, 0.0, 30, 0, False), MODEL))
    assert loop.run(1, Power.READY).foreign > 1.0


@pytest.mark.parametrize(
    ("fault", "said"), [("silence", "no drive replies as node 1"), ("joint_silence", "no joint's encoder answers")]
)
def test_who_does_not_answer_is_named(fault: str, said: str) -> None:
    loop = Loop()
    loop.inject(fault)
    with pytest.raises(DriveError, match=said):
        loop.drive.bring_up()


def test_a_drive_of_six_bytes_tells_no_error_and_is_refused() -> None:
    loop = Loop()
    loop.node.receive = lambda identifier, data, now: loop.bus.put(1, bytes(6))  # type: ignore[method-assign]
    with pytest.raises(DriveError, match="replies with 6 bytes"):
        loop.drive.bring_up()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"stiffness": 501.0}, "stiffness"),
        ({"damping": 5.1}, "damping"),
        ({"gear": 6.0}, "has 9"),
        ({"speed_limit": 50.0}, "speed limit"),
        ({"current_limit": 22.0}, "at most 17.64 N"),
        ({"watchdog": 0.002}, "three cycles"),
        ({"model": "AK99"}, "AK80-9"),
        ({"temperature_zero": 41}, "0 or 40"),
        ({"joint_counts_per_turn": 0.5}, "whole number"),
        ({"reply_id": 0}, "CANopen"),
        ({"reply_id": 0x1A0}, "CANopen"),
    ],
)
def test_what_is_beyond_the_model_or_makes_no_sense_is_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        check_parameters(DRIVE._replace(**changed))


def given_rig(tmp_path: Any, more: str = "") -> Rig:
    (tmp_path / "rig.toml").write_text(ON_RIG + more)
    return Rig.read(tmp_path / "rig.toml")


def test_a_rig_beyond_the_range_of_the_position_is_refused(tmp_path: Any) -> None:
    with pytest.raises(ParameterError, match=r"within ±12\.3 rad"):
        _ = given_rig(tmp_path, "[limits]\nmotor_high_deg = 800.0\n").drive_parameters


def test_a_rig_without_a_joints_angle_is_not_run(tmp_path: Any) -> None:
    rig = given_rig(tmp_path, 'joint = "none"\n')
    with pytest.raises(ParameterError, match="not measured"):
        require_joint(rig)
    require_joint(given_rig(tmp_path))


def test_a_drive_without_a_timeout_is_not_run(tmp_path: Any) -> None:
    with pytest.raises(ParameterError, match="never"):
        _ = given_rig(tmp_path, "watchdog_ms = 0\n").drive_parameters


def test_a_limb_is_refused_where_nobody_can_see_the_timeout(tmp_path: Any) -> None:
    bus = 'interface = "socketcan"\nchannel = "can0"\n'
    assert "bare bench" in unseen_watch(given_rig(tmp_path))
    require_watch(given_rig(tmp_path))  # on the twin's bus there is no limb
    with pytest.raises(SafetyError, match="no_limb = true"):
        require_watch(given_rig(tmp_path, bus))
    require_watch(given_rig(tmp_path, f"{bus}no_limb = true\n"))
    with pytest.raises(SafetyError, match="EMG means a limb"):
        require_watch(given_rig(tmp_path, f'{bus}no_limb = true\n[emg]\nsource = "lsl:EMG"\n'))
    suit = Rig(suit={"worn": True})
    with pytest.raises(SafetyError, match="a suit means a limb"):  # of another axis
        require_watch(given_rig(tmp_path, f"{bus}no_limb = true\n"), [suit])
    assert unseen_watch(Rig()) == ""


def malformed(frames: list[tuple[int, bytes]]) -> None:
    """Whatever comes, nothing is raised, and no command leaves the range or has more than the rig's gains."""
    loop = Loop().up().on()
    loop.bus.sent.clear()
    for start in range(0, len(frames), 4):
        for identifier, data in frames[start : start + 4]:
            loop.bus.put(identifier, data)
        loop.run(1, Power.ON)
    for _, identifier, data in loop.bus.sent:
        command = unpack_command(data, MODEL) if identifier == 1 else None
        if command is not None:
            assert abs(command.position) <= HIGHEST_POSITION - ROOM + 1e-3
            assert command.kp <= DRIVE.stiffness + 0.1
            assert command.kd <= DRIVE.damping + 0.01
            assert abs(command.torque) <= 0.01


IDENTIFIERS = st.sampled_from((1, 2, 0, 0x80, 0x1A0, 0x0A0, 0x720, 0x2000_0001, 0x4000_0001, 0x8000_0001))
FRAMES = st.lists(
    st.tuples(
        IDENTIFIERS | st.integers(0, 0x7FF),
        st.binary(max_size=8) | st.binary(min_size=7, max_size=7).map(lambda rest: b"\x01" + rest),
    ),
    min_size=1,
    max_size=60,
)


@given(FRAMES)
@settings(max_examples=25, deadline=None)
def test_no_frame_breaks_the_driver(frames: list[tuple[int, bytes]]) -> None:
    malformed(frames)


@pytest.mark.long
@given(st.lists(st.tuples(IDENTIFIERS, st.binary(max_size=8)), min_size=500, max_size=500))
@settings(max_examples=200, deadline=None)
def test_no_frame_of_a_hundred_thousand_breaks_the_driver(frames: list[tuple[int, bytes]]) -> None:
    malformed(frames)


@given(FRAMES)
@settings(max_examples=25, deadline=None)
def test_no_frame_breaks_the_twin(frames: list[tuple[int, bytes]]) -> None:
    loop = Loop()
    for identifier, data in frames:
        loop.bus.send(can.Message(arbitration_id=identifier & 0x7FF, data=data, is_extended_id=False))
    loop.bus.advance(0.01)
    assert math.isfinite(loop.node.bench.motor)
