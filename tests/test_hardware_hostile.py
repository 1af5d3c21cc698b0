"""The driver and the loop against a node that does harm: a table of attacks, and what must come of each."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.clock import SECOND
from bowden.core.errors import DriveError
from bowden.hardware.buses.link import Links
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power, TorqueLeft
from bowden.live.ended import Ended
from bowden.live.preflight import Preflight
from bowden.live.script import Script
from bowden.rig.families import DriveNeeds
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.safety.state import Mode
from loop_rig import LoopRig
from support.hostile_node import DISABLED, Attack, HostileBus

DRIVE = DriveParameters(answer_timeout=0.05, needs=DriveNeeds(current_limit=20.0))
STOPPABLE = DRIVE._replace(emergency_stop_input=5)
LIMITS = Limits(tracking=9.0, target_reach=99.0, play=9.0)
"""The node's motor is a simple one, and is not what is tested here."""
SILENCE = 0.05
"""Within it the torque is off after the host's last word [s]."""


def test_the_node_is_a_sound_one_where_it_does_no_harm(tmp_path: Path) -> None:
    bus, ended = run(Attack(), tmp_path)
    assert (Mode(ended.mode), ended.faults, ended.torque) == (Mode.STOPPED, 0, TorqueLeft.OFF)
    assert not bus.node.torque
    assert bus.node.motor != 1000.0, "it has turned"


def run(
    attack: Attack, folder: Path, parameters: DriveParameters = DRIVE, stall: float = 0.0, cycles: int = 500
) -> tuple[HostileBus, Ended]:
    """A run of the loop on such a node, from its bring-up to its end; while the law leads, the loop stalls once [s]."""
    bus = HostileBus(attack)
    drive = CanopenDrive(parameters, Links(bus))
    drive.bring_up()
    table = PeriodicMinimumJerk(0.0, 0.3, 2.0).sample(np.arange(cycles) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)

    def between(rig: LoopRig) -> None:
        bus.pass_time()
        if rig.led == 200 and stall > 0.0:
            rig.led += 1
            bus.pass_time(stall)
            rig.time += round(stall * SECOND)

    rig = LoopRig(folder, LAWS["adaptive"], LIMITS, drive, script, between, quits=1500)
    ended, rows = rig.run()
    bus.modes = list(dict.fromkeys(Mode(int(mode)) for mode in rows["mode"]))
    bus.pass_time(0.2)
    return bus, ended


@pytest.mark.parametrize("stall_ms", [4, 19])
def test_a_run_rides_through_a_short_stall_of_the_computer(stall_ms: int, tmp_path: Path) -> None:
    _, ended = run(Attack(), tmp_path, stall=1e-3 * stall_ms)
    assert (Mode(ended.mode), ended.faults, ended.stalled) == (Mode.STOPPED, 0, 0.0)


@pytest.mark.parametrize("stall_ms", [21, 34])
def test_a_longer_stall_of_the_computer_ends_in_a_release_and_is_said(stall_ms: int, tmp_path: Path) -> None:
    bus, ended = run(Attack(), tmp_path, stall=1e-3 * stall_ms)
    assert of(ended.faults) == [Fault.LATE]
    assert Mode.RELEASING in bus.modes
    assert ended.stalled == pytest.approx(1e-3 * stall_ms, abs=1e-3)


@pytest.mark.parametrize("stall_ms", [60, 900])
def test_a_stall_longer_than_the_drives_watch_is_said_as_what_it_was(stall_ms: int, tmp_path: Path) -> None:
    bus, ended = run(Attack(), tmp_path, stall=1e-3 * stall_ms)
    assert {Fault.LATE, Fault.CLOCK} & set(of(ended.faults))
    assert ended.stalled == pytest.approx(1e-3 * stall_ms, abs=1e-3)
    assert not bus.node.torque


@dataclass(frozen=True)
class Row:
    """An attack on a run and what it must come to."""

    attack: Attack
    faults: tuple[Fault, ...]
    """Any of these is among the run's."""
    torque: tuple[TorqueLeft, ...] = (TorqueLeft.OFF,)
    drive: DriveParameters = DRIVE
    cycles: int = 500
    """Of the law."""


SYNC, TARGET, START, HEARTBEAT = (0x080, b""), (0x201, b"\x0f\0\0\0\0\0"), (0x000, b"\x01\x01"), (0x77F, b"\x05")
QUESTION = (0x601, b"\x40\0\x10\0\0\0\0\0")
RUNS: dict[str, Row] = {
    "keeps its torque": Row(Attack(keeps_torque=True), (Fault.NOT_DISABLED,), (TorqueLeft.ON,)),
    "keeps its torque and denies it": Row(
        Attack(keeps_torque=True, lies=True), (Fault.NOT_DISABLED,), (TorqueLeft.ON,)
    ),
    "enables itself": Row(Attack(enables_itself=0.005), (Fault.NOT_DISABLED,), (TorqueLeft.ON,)),
    "vanishes at rest": Row(Attack(vanishes=0.005), (Fault.HEARTBEAT_LOST,), (TorqueLeft.UNKNOWN,)),
    "vanishes under power": Row(Attack(vanishes=0.5), (Fault.HEARTBEAT_LOST, Fault.MOTOR_STALE), (TorqueLeft.UNKNOWN,)),
    "another SYNC": Row(Attack(foreign=(SYNC,), foreign_from=0.5), (Fault.SECOND_MASTER,)),
    "another master's targets": Row(
        Attack(foreign=(TARGET,), foreign_from=0.5), (Fault.SECOND_MASTER,), tuple(TorqueLeft)
    ),
    "another's questions": Row(Attack(foreign=(QUESTION,), foreign_from=0.5), (Fault.SECOND_MASTER,)),
    "another's NMT": Row(Attack(foreign=(START,), foreign_from=0.5), (Fault.SECOND_MASTER,)),
    "another's heartbeat": Row(Attack(foreign=(HEARTBEAT,), foreign_from=0.5), (Fault.SECOND_MASTER,)),
    "a second device of its number": Row(Attack(doubles=0.5), (Fault.SECOND_MASTER,)),
    "a watch over us that is switched off": Row(Attack(unwatched=0.5), (Fault.EMERGENCY,)),
    "its emergency stop": Row(Attack(stops=0.5), (Fault.EMERGENCY_STOP,), drive=STOPPABLE),
    "its emergency stop before arming": Row(Attack(stops=0.001), (Fault.EMERGENCY_STOP,), drive=STOPPABLE),
    "inputs that are told no more": Row(Attack(hides_inputs=0.5), (Fault.EMERGENCY_STOP,), drive=STOPPABLE),
    "safe torque off": Row(Attack(stops_itself=0.5), (Fault.EMERGENCY_STOP,)),
    "a current stuck at nothing": Row(Attack(current_stuck=0.0), (Fault.CURRENT_STUCK,)),  # in the preflight
    "a current that gets stuck": Row(
        Attack(current_stuck=1.5), (Fault.CURRENT_STUCK,), (TorqueLeft.ON,), cycles=3000
    ),  # it is seen without power, too
    "a current that gets stuck but for a count": Row(
        Attack(current_stuck=1.5, dithers=True), (Fault.CURRENT_STUCK,), (TorqueLeft.ON,), cycles=3000
    ),
    "a cable on the other side": Row(Attack(load=-600), (Fault.PREFLIGHT_FAILED,)),
    "a joint encoder that freezes": Row(Attack(joint_stuck=1.5), (Fault.JOINT_FROZEN,)),
    "a joint encoder that freezes but for a count": Row(Attack(joint_stuck=1.5, dithers=True), (Fault.JOINT_FROZEN,)),
}


@pytest.mark.parametrize("name", RUNS)
def test_an_attack_on_a_run_ends_it_and_is_said(name: str, tmp_path: Path) -> None:
    row = RUNS[name]
    bus, ended = run(row.attack, tmp_path, row.drive, cycles=row.cycles)
    unarmed = name == "its emergency stop before arming"
    assert Mode(ended.mode) is Mode.LATCHED or ended.torque != TorqueLeft.OFF or unarmed, "the exit code is 1"
    assert set(row.faults) & set(of(ended.faults)), of(ended.faults)
    assert TorqueLeft(ended.torque) in row.torque
    if ended.torque == TorqueLeft.OFF:
        assert not bus.node.torque


REFUSED: dict[str, tuple[Attack, str]] = {
    "watches nobody": (Attack(watches=False), "does not notice that its host is silent"),
    "forgets what silence is": (Attack(forgets=((0x6007, 0),)), "keeps 6007h:0 at 0; expected 1"),
    "forgets whom to watch": (Attack(forgets=((0x1016, 1),)), "keeps 1016h:1 at 0"),
    "forgets what a fault is": (Attack(forgets=((0x605E, 0),)), "keeps 605Eh:0 at 2"),
    "lines for counts": (
        Attack(objects=(((0x608F, 1), 4096),)),
        "counts_per_turn is 16384; expected 4096, as node",
    ),
    "a rated torque of 1 µN·m": (Attack(objects=(((0x6076, 0), 1),)), "the rig's largest is 20 A"),
    "counts behind a gear": (Attack(objects=(((0x6091, 1), 5),)), "behind a gear of 5:1"),
    "another SYNC": (Attack(foreign=(SYNC,)), "another master is on the bus .* 080h"),
    "another's targets": (Attack(foreign=(TARGET,)), "another master is on the bus"),
    "another's questions": (Attack(foreign=(QUESTION,)), "another master is on the bus"),
    "another's heartbeat": (
        Attack(foreign=(HEARTBEAT,)),
        "a node 127, which is the number of this computer, is on the bus",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_node_without_what_safety_rests_on_gets_no_power(name: str) -> None:
    attack, said = REFUSED[name]
    bus = HostileBus(attack)
    with pytest.raises(DriveError, match=said):
        CanopenDrive(DRIVE, Links(bus)).bring_up()
    assert not bus.node.torque


@pytest.mark.parametrize("part", range(4))
def test_a_node_that_restarts_in_its_bring_up_is_refused_or_is_set_up_whole(part: int) -> None:
    """Whenever it is brought up, the loop's death takes its torque off."""
    refused = 0
    for question in range(1 + 5 * part, 150, 20):
        bus = HostileBus(Attack(reboots_at_question=question))
        drive = CanopenDrive(DRIVE, Links(bus))
        try:
            drive.bring_up()
        except DriveError:
            refused += 1
            continue
        for _ in range(20):
            drive.read(bus.time)
            drive.write(0.0, Power.ON, bus.time)
            bus.pass_time()
        died = bus.time
        bus.pass_time(0.2)
        assert not bus.node.torque
        assert bus.node.off_since <= died + SILENCE
    assert refused >= 5


def test_on_a_real_bus_a_drive_has_limits_of_its_own() -> None:
    for objects in ((((0x607D, 1), 0), ((0x607D, 2), 0)), (((0x607D, 1), 1000), ((0x607D, 2), -1000))):
        attack = Attack(objects=objects)
        assert CanopenDrive(DRIVE, Links(HostileBus(attack))).bring_up(), "the twin's bus"
        with pytest.raises(DriveError, match="has no limits of its position"):
            CanopenDrive(DRIVE._replace(interface="socketcan"), Links(HostileBus(attack))).bring_up()


def test_the_supply_is_said_with_who_the_drive_is() -> None:
    assert CanopenDrive(DRIVE, Links(HostileBus())).bring_up().endswith("supply 23.9 V")
    silent = HostileBus(Attack(objects=(((0x6079, 0), 0),)))
    assert "supply" not in CanopenDrive(DRIVE, Links(silent)).bring_up()


def test_a_lost_answer_is_asked_for_again_and_a_text_without_end_is_cut() -> None:
    for attack in (Attack(endless_text=True), *(Attack(loses_answer=n) for n in (1, 2, 30))):
        bus = HostileBus(attack)
        assert "at node 1" in CanopenDrive(DRIVE, Links(bus)).bring_up()
        assert bus.node.state == DISABLED, "as before the trial of its watch"
