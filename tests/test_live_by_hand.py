"""One angle confirmed by hand: wrong scales and directions are found, and no motor gets power before."""

import contextlib
import math
import socket
import threading
from pathlib import Path
from typing import Any

import pytest

from bowden.core.clock import SECOND
from bowden.core.errors import DriveError, SafetyError
from bowden.core.signals import DriveReading
from bowden.core.units import RADIANS
from bowden.hardware.buses.link import Links
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power, serial_of
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.plant import Look
from bowden.live.by_hand import SETTLED, confirm, confirmed, contradictions, require_confirmed, require_same, turned
from bowden.live.joint_estimate import RestingSensor
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import bench
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from support.command import Command
from support.memory_bus import DriverLoop

pytestmark = pytest.mark.usefixtures("state")

REAL = DriveParameters(interface="socketcan", answer_timeout=0.05)
TRUE, SLOPE = 16384.0, 0.9
"""Counts a turn, and joint over spool."""
WRONG: dict[str, dict[str, float]] = {
    "both counts a quarter": {"joint_counts_per_turn": 4 * TRUE, "motor_counts_per_turn": 4 * TRUE},
    "both counts a half": {"joint_counts_per_turn": 2 * TRUE, "motor_counts_per_turn": 2 * TRUE},
    "both counts twice": {"joint_counts_per_turn": TRUE / 2, "motor_counts_per_turn": TRUE / 2},
    "both signs": {"joint_direction": -1, "motor_direction": -1},
    "the joint's counts a half": {"joint_counts_per_turn": 2 * TRUE},
    "the motor's counts a half": {"motor_counts_per_turn": 2 * TRUE},
    "the motor's sign": {"motor_direction": -1},
}


class InHand(TwinBench):
    """A bench without power, whose joint somebody turns."""

    turned = 0.1

    def look(self) -> Look:
        return super().look()._replace(joint=self.turned, motor=self.turned / SLOPE)


def in_hand(now: float) -> InHand:
    return InHand(bench(), constant_bend(0.0), 1.0, 0, 0.0, now)


class ByHand:
    """Somebody at the joint, and the clock; `degrees` is what the joint is turned by."""

    def __init__(self, bus: DriverLoop, degrees: float, said: str) -> None:
        self.bus, self.degrees, self.said, self.looks = bus, degrees, said, 0
        self.heard: list[str] = []

    def now(self) -> int:
        return round(self.bus.time * SECOND)

    def sleep_until(self, deadline: int) -> None:
        self.bus.advance(1e-3)

    def lines(self) -> str | None:
        self.looks += 1
        if self.looks == 20:
            return "\n"
        if self.looks == 21:
            self.bus.node.bench.turned += self.degrees * RADIANS
        return self.said if self.looks == 60 else None


def by_hand(rig: Rig, degrees: float = 45.0, said: str = "45\n") -> tuple[float, float, float]:
    bus = DriverLoop(REAL, {(0x6065, 0): 1 << 30}, in_hand)
    drive = CanopenDrive(rig.drive_parameters, Links(bus, bus))
    drive.bring_up()
    somebody = ByHand(bus, degrees, said)
    told, before, after = turned(drive, somebody.lines, somebody.heard.append, somebody, 1e-3)
    assert not bus.powered
    assert len(somebody.heard) == 2
    drive.close()
    return told, after.joint - before.joint, after.motor - before.motor


def test_what_was_confirmed_by_hand_is_asked_once_and_anew_for_other_scales() -> None:
    rig = Rig(drive=REAL)
    assert not confirmed(rig)
    with pytest.raises(SafetyError, match=r"no angle has been confirmed by hand .* bowden confirm Rig"):
        require_confirmed(rig)
    with pytest.raises(SafetyError, match=r"bowden confirm 'my rig\.toml'"):
        require_confirmed(rig.replace(origin="my rig.toml"))
    confirm(rig, *by_hand(rig))
    require_confirmed(rig)
    require_confirmed(rig.replace(duration=3.0))
    assert not confirmed(rig.replace(drive=REAL._replace(joint_counts_per_turn=2 * TRUE)))
    assert not confirmed(rig.replace(drive=REAL._replace(node_id=2)))
    assert confirmed(rig.replace(drive=REAL._replace(answer_timeout=0.06))), "it makes no angle of a count"
    assert confirmed(Rig()), "there is a twin"


class Late:
    """A drive whose angles come no more for some cycles, and an operator who types one line meanwhile."""

    def __init__(self, late: int) -> None:
        self.late, self.cycle = late, 0

    def read(self, now: float) -> DriveReading:
        self.cycle += 1
        age = 3.0 if self.cycle <= self.late else 0.0
        values = dict.fromkeys(DriveReading._fields, 0.0)
        return DriveReading(**values | {"motor_age": 0.0, "joint_age": age, "joint": float(self.cycle)})

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        assert power is Power.OFF

    def lines(self) -> str | None:
        return {5: "\n", SETTLED: "45\n"}.get(self.cycle)

    def now(self) -> int:
        return self.cycle

    def sleep_until(self, deadline: int) -> None: ...


def test_an_angle_that_comes_no_more_is_none_and_a_line_typed_meanwhile_is_kept() -> None:
    late = Late(10)
    told, before, _ = turned(late, late.lines, lambda _: None, late, 1e-3)  # type: ignore[arg-type]
    assert told == pytest.approx(45.0 * RADIANS)
    assert before.joint == 11.0
    late = Late(1000)
    with pytest.raises(DriveError, match="no angle of the motor and the joint comes"):
        turned(late, late.lines, lambda _: None, late, 1e-3)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", WRONG)
def test_wrong_scales_and_directions_are_found_by_hand(name: str) -> None:
    rig = Rig(drive=REAL._replace(**WRONG[name]))
    with pytest.raises(SafetyError, match="encoder"):
        confirm(rig, *by_hand(rig))
    assert not confirmed(rig)


class BesideSensor(ByHand):
    """Somebody at a joint whose sensor sends its angle, too: `gain` times what the joint has turned."""

    def __init__(self, bus: DriverLoop, degrees: float, said: str, port: int, gain: float) -> None:
        super().__init__(bus, degrees, said)
        self.to, self.gain = ("127.0.0.1", port), gain
        self.sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, degrees: float) -> None:
        self.sender.sendto(f"{1.0 + self.looks * 1e-3} {self.gain * degrees}".encode(), self.to)

    def lines(self) -> str | None:
        entered = super().lines()
        self.send(self.degrees if self.looks >= 21 else 0.0)
        return self.said if self.looks == 1500 else None if self.looks == 60 else entered


@pytest.mark.parametrize(("gain", "right"), [(1.0, True), (1.1, True), (-1.0, False), (0.5, False), (0.0, False)])
def test_a_sensor_at_the_joint_is_confirmed_by_hand_as_an_encoder_is(gain: float, right: bool) -> None:
    """Mounted upside down, about another axis, or with a wrong curve it is found."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    rig = Rig(drive=REAL, joint_sensor={"source": "imu", "stream": f"udp:{port}"})
    bus = DriverLoop(REAL, {(0x6065, 0): 1 << 30}, in_hand)
    drive = CanopenDrive(rig.drive_parameters, Links(bus, bus))
    somebody = BesideSensor(bus, 45.0, "45\n", port, gain)
    threading.Timer(0.1, somebody.send, [0.0]).start()
    sensor = RestingSensor(rig.joint_sensor, 1e-3)
    drive.bring_up()
    told, before, after = turned(drive, somebody.lines, somebody.heard.append, somebody, 1e-3, rig.joint_sensor, sensor)
    sensor.close()
    somebody.sender.close()
    drive.close()
    with contextlib.nullcontext() if right else pytest.raises(SafetyError, match="its sensor shows"):
        confirm(rig, told, after.joint - before.joint, after.motor - before.motor)
    assert confirmed(rig) is right
    assert not confirmed(rig.replace(joint_sensor=rig.joint_sensor._replace(axis=(1.0, 0.0, 0.0))))


def test_a_joint_that_nothing_measures_is_confirmed_by_the_motor() -> None:
    rig = Rig(drive=REAL, joint_sensor={"source": "motor"})
    told, _, motor = by_hand(rig)
    with pytest.raises(SafetyError, match="the motor should have pulled"):
        confirm(rig, told, math.nan, -motor)
    confirm(rig, told, math.nan, motor)
    assert confirmed(rig)


def test_a_wrong_slack_sign_is_found_by_hand() -> None:
    rig = Rig(drive=REAL, limits=Limits(slack_sign=1.0))
    with pytest.raises(SafetyError, match="slack_sign"):
        confirm(rig, *by_hand(rig))


@pytest.mark.parametrize(("degrees", "said"), [(45.0, "much\n"), (45.0, ""), (20.0, "20"), (45.0, "nan"), (0.0, "45")])
def test_no_turn_no_number_and_too_small_a_turn_confirm_nothing(degrees: float, said: str) -> None:
    rig = Rig(drive=REAL)
    with pytest.raises(SafetyError):
        confirm(rig, *by_hand(rig, degrees, said))
    assert not confirmed(rig)


@pytest.mark.parametrize("misread", [-0.05, 0.05])
def test_a_goniometer_may_be_misread_and_a_cable_may_have_play(misread: float) -> None:
    limits = Limits()
    for told in (30.0 * RADIANS, 80.0 * RADIANS):
        for play in (0.0, limits.play):
            joint = told + misread
            assert not contradictions(told, joint, (joint + play) / 0.9, limits)
            assert contradictions(told, joint, -joint, limits)
    assert contradictions(math.nan, 0.5, 0.5, limits)


@pytest.mark.parametrize("word", ["run", "measure"])
def test_no_run_powers_a_motor_that_nobody_has_confirmed(word: str, tmp_path: Path, command: Command) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('[drive]\ninterface = "socketcan"\n')
    said = command(word, rig, "--auto", "--out", tmp_path / "out", code=2).err
    assert f"bowden confirm {rig}" in said
    assert "no terminal" in command.refused("confirm", rig)


def found_serial(number: int) -> str:
    bus = DriverLoop(REAL, {(0x1018, 4): number})
    drive = CanopenDrive(REAL, Links(bus, bus))
    drive.bring_up()
    drive.close()
    return serial_of(drive)


@pytest.mark.parametrize("apart", [{"node_id": 2}, {"channel": "can1"}], ids=["numbers", "buses"])
def test_swapped_drives_of_two_motors_and_a_replaced_one_get_no_power(apart: dict[str, Any]) -> None:
    hip, knee = Rig(drive=REAL), Rig(drive=REAL._replace(**apart))
    first, second = found_serial(7), found_serial(8)
    for rig, serial in ((hip, first), (knee, second)):
        confirm(rig, math.radians(45.0), math.radians(45.0), math.radians(50.0), serial)
    require_same([("hip", hip, first), ("knee", knee, second)])
    with pytest.raises(SafetyError, match=r"motor 'hip' .*confirmed as motor 'knee': .* are swapped.*; swap them back"):
        require_same([("hip", hip, second), ("knee", knee, first)])
    for other in (found_serial(9), ""):
        with pytest.raises(SafetyError, match=r"if it was replaced: bowden confirm Rig"):
            require_same([("", hip, other)])
    require_same([("", Rig(), first)])  # a twin
    nobody = Rig(drive=REAL._replace(node_id=9))
    confirm(nobody, math.radians(45.0), math.radians(45.0), math.radians(50.0))
    require_same([("", nobody, found_serial(0))])  # a drive that tells none
