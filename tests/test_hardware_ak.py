"""A CubeMars AK drive in MIT mode against its twin at a time of our own: frames, bring-up, power, faults, bad input."""

import math
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError, ParameterError, SafetyError
from bowden.core.signals import DriveReading
from bowden.design.objections import objections
from bowden.design.power import require_power, unseen_watch
from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.buses.unix_bus import UnixBus
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
from bowden.hardware.drives.families.ak_mit import AkParameters
from bowden.hardware.drives.findings import INERT, LOST_RANGE
from bowden.hardware.drives.on_can import require
from bowden.hardware.ports import Power
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.plant import FOLLOW, Look
from bowden.live.live_run import require_joint
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import bench
from bowden.rig.rig import Rig
from support.memory_bus import DriverLoop, asking
from support.played import Played

CYCLE = 1e-3
DRIVE = AkParameters(answer_timeout=0.2)
MODEL = MODELS["v2"]["AK80-9"]
ON_RIG = '[motor]\ngear = 9.0\ntorque_constant_nm_per_a = 0.091\n[drive]\nfamily = "ak_mit"\n'


def found(readings: list[DriveReading]) -> set[float]:
    return {reading.emergency for reading in readings if reading.emergency}


V3 = asking(DRIVE._replace(board="v3"), sample_time=2e-3)


@pytest.mark.parametrize(
    ("speed", "frame"), [(0.0, "0003338000800800"), (2.0, "0003338000892800"), (5.0, "000333800096d800")]
)
def test_a_command_to_a_board_v3_is_as_public_code_has_it(speed: float, frame: str) -> None:
    """Frames with which others have moved a motor whose speeds are those of an AK10-9."""
    assert pack_command(AkCommand(0.0, speed, 0.0, 1.0, 0.0), MODELS["v3"]["AK10-9"]).hex() == frame


@given(st.floats(-12.0, 12.0), st.floats(-50.0, 50.0), st.floats(-15.0, 15.0), st.integers(-20, 120))
def test_a_state_of_a_board_v3_says_what_went_in(position: float, speed: float, torque: float, heat: int) -> None:
    model = MODELS["v3"]["AK80-9"]
    told = AkReply(3, position, speed, torque, heat, 0, at_end=False)
    said = unpack_reply(pack_reply(told, model, 0.8), model, 3, 0.8)
    assert said is not None
    assert math.isclose(said.position, position, abs_tol=math.radians(0.051))
    assert math.isclose(said.torque, torque, abs_tol=0.0041)
    assert math.isclose(said.velocity, speed, abs_tol=0.003)


def test_a_board_v3_follows_without_an_order_to_enter_a_mode() -> None:
    loop = DriverLoop(V3).up()
    assert math.isclose(loop.run(300, Power.ON, speed=1.0)[-1].motor, loop.node.bench.motor, abs_tol=0.01)
    assert {identifier for _, identifier, _ in loop.sent} <= {0x801, 0x80}  # commands to it, and SYNC for the joint's
    assert all(data not in (ENTER, EXIT, ZERO) for _, _, data in loop.sent)
    loop.advance(0.03)
    assert not loop.powered  # its CAN timeout
    loop.drive.close()


def test_an_order_of_servo_mode_to_a_board_v3_is_another_masters() -> None:
    loop = DriverLoop(V3).up()
    loop.put(EXTENDED | 0x401, bytes(4))
    assert sum(reading.foreign for reading in loop.run(2, Power.ON)) == 1.0


class Uploading:
    """A drive that says where it is by itself, and answers nothing in MIT mode."""

    def __init__(self, loop: DriverLoop, number: int) -> None:
        self._loop, self._number = loop, number

    def receive(self, identifier: int, data: bytes, now: float) -> None: ...

    def tick(self, now: float) -> None:
        self._loop.put(EXTENDED | 0x2900 | self._number, bytes(8))


def test_servo_mode_and_a_board_v3_are_refused_by_name() -> None:
    loop = DriverLoop(DRIVE)
    loop.inject("silence")
    loop.attach(Uploading(loop, DRIVE.node_id))
    with pytest.raises(DriveError, match="in servo mode, or is a board V3"):
        loop.drive.bring_up()


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


def test_the_drive_is_entered_with_gains_of_one_step_and_its_own_place() -> None:
    loop = DriverLoop(DRIVE).up()
    begun = [data for _, identifier, data in loop.sent if identifier == 1 and data not in (EXIT, ENTER)]
    first = unpack_command(begun[0], MODEL)
    assert first is not None
    assert (first.kp, first.kd) == (pytest.approx(500.0 / 4095), 0.0)


def test_a_torque_that_is_always_told_the_same_is_none() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.node._asked = lambda: 3.0  # type: ignore[method-assign]
    loop.node.bench.advance = lambda now: None  # type: ignore[method-assign]
    assert INERT in found(loop.run(200, Power.ON, target=0.15, speed=0.3))


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

    def look(self) -> Look:
        if not hasattr(self, "clock"):
            return super().look()
        return super().look()._replace(motor=self.turned, velocity=self.speed, current=self.given / (9.0 * 0.091))


def test_a_plant_whose_motor_gives_way_is_given_the_drives_torque_and_is_not_inert() -> None:
    loop = DriverLoop(DRIVE)
    plant = GivingWay(loop.time)
    loop.node.bench = plant
    loop.up()
    for k in range(600):
        aim = 0.1 + 0.2 * math.sin(6.0 * k * CYCLE)
        assert found(loop.run(1, Power.ON, target=aim)) == set()
    assert plant.given == pytest.approx(50.0 * (aim - plant.turned) - 1.9 * plant.speed, abs=0.5)
    assert abs(aim - plant.turned) < 0.1, "as stiff as the rig says, and not a tenth of it"


def test_a_drive_at_its_largest_current_is_not_inert() -> None:
    loop = DriverLoop(asking(DRIVE, current_limit=8.0))
    plant = GivingWay(loop.time)
    loop.node.bench = plant
    loop.up()
    plant.load, most = 40.0, 9.0 * 0.091 * 8.0
    plant.advance = lambda now: setattr(plant, "given", most)  # type: ignore[method-assign]
    for k in range(100):
        assert found(loop.run(1, Power.ON, target=0.5 + 0.002 * k)) == set()


def test_saturated_fields_show_as_a_current_beyond_any_that_a_rig_may_ask_for() -> None:
    loop = DriverLoop(DRIVE).up()
    loop.inject("saturated")
    assert abs(loop.run(5, Power.ON)[-1].current) > 0.98 * MODEL.torque / (9.0 * 0.091)


def test_a_position_that_has_gone_round_its_range_is_found_before_the_stiffness() -> None:
    loop = DriverLoop(DRIVE)
    loop.drive.bring_up()
    loop.node._shift += 25.0
    assert LOST_RANGE in found(loop.run(20, Power.ON))
    assert not loop.powered


@pytest.mark.parametrize(
    ("drive", "fault", "said"),
    [(V3, "silence", "no board V3 tells its state"), (DRIVE, "joint_silence", "no joint's encoder answers")],
)
def test_who_does_not_answer_is_named(drive: AkParameters, fault: str, said: str) -> None:
    loop = DriverLoop(drive)
    loop.inject(fault)
    with pytest.raises(DriveError, match=said):
        loop.drive.bring_up()


def test_a_drive_of_six_bytes_tells_no_error_and_is_refused() -> None:
    loop = DriverLoop(DRIVE)
    loop.node.receive = lambda identifier, data, now: loop.put(1, bytes(6))  # type: ignore[method-assign]
    with pytest.raises(DriveError, match="replies with 6 bytes"):
        loop.drive.bring_up()


def given_rig(tmp_path: Any, more: str = "") -> Rig:
    (tmp_path / "rig.toml").write_text(ON_RIG + more)
    return Rig.read(tmp_path / "rig.toml")


def test_a_zero_that_a_restart_would_move_is_refused_on_a_real_bus(tmp_path: Any) -> None:
    """A turn of the rotor is 40° of the spool, which the drive forgets with its supply."""
    real = 'interface = "socketcan"\nchannel = "can0"\n'
    with pytest.raises(ParameterError, match=r"turns of the rotor; the drive forgets.*home = .hint. with motor_hint"):
        _ = given_rig(tmp_path, real).drive_parameters
    for home in ('home = "hint"\n', 'home = "here"\n'):
        assert given_rig(tmp_path, real + home).drive_parameters.interface == "socketcan"
    asked = asking(DRIVE._replace(interface="socketcan"), lowest_motor=0.0, highest_motor=0.6)
    require(asked)


def test_a_rig_without_a_joints_angle_is_not_run(tmp_path: Any) -> None:
    rig = given_rig(tmp_path, 'joint = "none"\n')
    with pytest.raises(ParameterError, match="not measured"):
        require_joint(rig)
    require_joint(given_rig(tmp_path))


def test_a_drive_without_a_timeout_is_not_run(tmp_path: Any) -> None:
    with pytest.raises(ParameterError, match="never"):
        _ = given_rig(tmp_path, "watchdog_ms = 0\n").drive_parameters


def test_a_limb_is_refused_where_nobody_can_see_the_timeout(tmp_path: Any) -> None:
    bus = 'interface = "socketcan"\nchannel = "can0"\nhome = "hint"\n'
    assert "bare bench" in unseen_watch(given_rig(tmp_path))
    require_power(given_rig(tmp_path))  # on the twin's bus there is no limb
    with pytest.raises(SafetyError, match="no_limb = true"):
        require_power(given_rig(tmp_path, bus))
    require_power(given_rig(tmp_path, f"{bus}no_limb = true\n"))
    with pytest.raises(SafetyError, match="EMG means a limb"):
        require_power(given_rig(tmp_path, f'{bus}no_limb = true\n[emg]\nsource = "lsl:EMG"\n'))
    suit = Rig(suit={"worn": True})
    with pytest.raises(SafetyError, match="a suit means a limb"):  # of another axis
        require_power(given_rig(tmp_path, f"{bus}no_limb = true\n"), [suit])
    assert unseen_watch(Rig()) == ""


def test_an_integral_that_the_drive_cannot_have_is_named(tmp_path: Any) -> None:
    """By the check, which run follows; and nobody is told to set one."""
    rig = given_rig(tmp_path)
    suit = rig.replace(suit=Rig(suit={"worn": True, "second_gear": 1.0, "drive_integral": 40.0}).suit)
    assert any("has no integral: write 0" in one for one in objections(suit))
    without = suit.replace(suit=suit.suit._replace(drive_integral=0.0))
    assert not any("integral" in one for one in objections(without))


def test_a_master_of_another_lab_moves_an_ak(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reason = "motor-python, an AK master of another lab, is not installed (pip install motor-python)"
    motors = pytest.importorskip("motor_python.cube_mars_motor_can", reason=reason)
    ak80_6 = asking(DRIVE._replace(model="AK80-6", node_id=3, stiffness=20.0, damping=1.0, watchdog=0.1), gear=6.0)
    with Played(ak80_6, tmp_path / "bus") as twin:
        monkeypatch.setattr(motors.can.interface, "Bus", lambda **_: UnixBus(twin.channel))  # unmodified but for this
        monkeypatch.setattr(motors, "get_can_state", lambda _: {"state": "ERROR-ACTIVE", "tx_err": 0, "rx_err": 0})
        motor = motors.CubeMarsAK806v2CAN(motor_can_id=3)
        try:
            motor.enable_mit_mode()
            motor.set_position(20.0)
            time.sleep(1.0)
            moved, feedback = twin.plant.motor, motor.get_status()
            motor.stop()
        finally:
            motor.close()
    assert moved == pytest.approx(0.35, abs=0.06)
    assert feedback is not None
