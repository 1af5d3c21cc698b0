"""The driver and the loop against a drive that does harm: a table of attacks, and what must come of each."""

import itertools
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.clock import SECOND
from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.cia402 import WITH_TORQUE, encode
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
from support.memory_bus import DriverLoop

DRIVE = DriveParameters(answer_timeout=0.05, needs=DriveNeeds(current_limit=20.0))
STOPPABLE = DRIVE._replace(emergency_stop_input=5)
LIMITS = Limits(tracking=9.0, target_reach=99.0, play=9.0)
"""The motor is not what is tested here."""
SILENCE = 0.05
"""Within it the torque is off after the host's last word [s]."""
Harm = Callable[["Harmed"], object]


class Harmed(DriverLoop):
    """A bus with a drive that may be harmed.

    Args:
        drive: its parameters.
        overrides: objects that are otherwise.
        loses: number of its answer over SDO that is lost.
        restarts: number of that after which it starts again.
    """

    def __init__(self, drive: Any = DRIVE, overrides: Any = None, loses: int = 0, restarts: int = 0) -> None:
        self.foreign: tuple[int, bytes] | None = None
        self.said, self.answers, self._loses, self._restarts = 0, 0, loses, restarts
        self.modes: list[Mode] = []
        super().__init__(drive, overrides)

    def put(self, identifier: int, data: bytes) -> None:
        self.answers += identifier == frames.SDO_ANSWER + 1
        if identifier != frames.SDO_ANSWER + 1 or self.answers != self._loses:
            super().put(identifier, data)
        if identifier == frames.SDO_ANSWER + 1 and self.answers == self._restarts:
            self.node._restart(self.time, "")

    def advance(self, span: float) -> None:
        super().advance(span)
        if self.foreign is not None:  # another master says it in every millisecond
            super().put(*self.foreign)
            self.node.receive(*self.foreign, self.time)


def run(
    harm: Harm, at: float, folder: Path, drive: DriveParameters = DRIVE, stall: float = 0.0, cycles: int = 500
) -> tuple[Harmed, Ended]:
    """A run of the loop on such a drive, which is harmed a time after its bring-up [s].

    While the law leads, the loop stalls once [s].
    """
    bus = Harmed(drive)
    bus.drive.bring_up()
    table = PeriodicMinimumJerk(0.0, 0.3, 2.0).sample(np.arange(cycles) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
    begun, harms = bus.time, [harm]

    def between(rig: LoopRig) -> None:
        bus.advance(1e-3)
        if harms and bus.time - begun >= at:
            harms.pop()(bus)
        if rig.led == 200 and stall > 0.0:
            rig.led += 1
            bus.advance(stall)
            rig.time += round(stall * SECOND)

    rig = LoopRig(folder, LAWS["adaptive"], LIMITS, bus.drive, script, between, quits=1500)
    ended, rows = rig.run()
    bus.modes = list(dict.fromkeys(Mode(int(mode)) for mode in rows["mode"]))
    bus.advance(0.2)
    return bus, ended


def well(bus: Harmed) -> None:
    """No harm."""


def keeps_torque(bus: Harmed, lies: bool = False) -> None:
    """Once it has torque it keeps it, whatever it is told, NMT too; where it `lies` it says otherwise."""
    node, enter = bus.node, bus.node._enter

    def entered(state: DriveState, now: float) -> None:
        bus.said = encode(state)
        if state in WITH_TORQUE or node.state not in WITH_TORQUE:
            enter(state, now)

    node._enter = entered
    if lies:
        node._statusword = lambda: bus.said or encode(node.state)


def enables_itself(bus: Harmed) -> None:
    bus.node._enter(DriveState.OPERATION_ENABLED, bus.time)
    bus.node._target += 3000
    keeps_torque(bus)


def vanishes(bus: Harmed) -> None:
    bus.inject("silence")
    bus.inject("deaf")


def sticks(name: str, dithers: bool = False) -> Harm:
    """What is measured stays as it is, or goes to and fro by a count."""

    def stuck(bus: Harmed) -> None:
        measured, step = getattr(bus.node, name), {"_current": 4e-3, "_encoders": 1}[name]
        held, turns = measured(*([bus.node._joint] if name == "_encoders" else []), bus.time), itertools.count()

        def told(*_: Any) -> Any:
            flip = step * (next(turns) % 2) * dithers
            return (held or 2.0) + flip if name == "_current" else (measured(*_)[0], held[1] + flip)

        setattr(bus.node, name, told)

    return stuck


def hides_inputs(bus: Harmed) -> None:
    bus.node.objects.change((0x1802, 1), 1 << 31)


def pulls_the_other_way(bus: Harmed) -> None:
    measured = bus.node._current
    bus.node._current = lambda now: -measured(now)


def says(identifier: int, data: bytes) -> Harm:
    """Another master does."""
    return lambda bus: setattr(bus, "foreign", (identifier, data))


def injects(text: str) -> Harm:
    return lambda bus: bus.inject(text)


def test_a_run_without_harm_is_one(tmp_path: Path) -> None:
    bus, ended = run(well, 0.0, tmp_path)
    assert (Mode(ended.mode), ended.faults, ended.torque) == (Mode.STOPPED, 0, TorqueLeft.OFF)
    assert not bus.powered


@pytest.mark.parametrize("stall_ms", [4, 19])
def test_a_run_rides_through_a_short_stall_of_the_computer(stall_ms: int, tmp_path: Path) -> None:
    _, ended = run(well, 0.0, tmp_path, stall=1e-3 * stall_ms)
    assert (Mode(ended.mode), ended.faults, ended.stalled) == (Mode.STOPPED, 0, 0.0)


@pytest.mark.parametrize("stall_ms", [21, 34])
def test_a_longer_stall_of_the_computer_ends_in_a_release_and_is_said(stall_ms: int, tmp_path: Path) -> None:
    bus, ended = run(well, 0.0, tmp_path, stall=1e-3 * stall_ms)
    assert of(ended.faults) == [Fault.LATE]
    assert Mode.RELEASING in bus.modes
    assert ended.stalled == pytest.approx(1e-3 * stall_ms, abs=1e-3)


@pytest.mark.parametrize("stall_ms", [60, 900])
def test_a_stall_longer_than_the_drives_watch_is_said_as_what_it_was(stall_ms: int, tmp_path: Path) -> None:
    bus, ended = run(well, 0.0, tmp_path, stall=1e-3 * stall_ms)
    assert {Fault.LATE, Fault.CLOCK} & set(of(ended.faults))
    assert ended.stalled == pytest.approx(1e-3 * stall_ms, abs=1e-3)
    assert not bus.powered


class Row(NamedTuple):
    """An attack on a run and what it must come to."""

    harm: Harm
    at: float
    """After the bring-up [s]."""
    faults: tuple[Fault, ...]
    """Any of these is among the run's."""
    torque: tuple[TorqueLeft, ...] = (TorqueLeft.OFF,)
    drive: DriveParameters = DRIVE
    cycles: int = 500
    """Of the law."""


ON, OFF, EITHER = (TorqueLeft.ON,), (TorqueLeft.OFF,), tuple(TorqueLeft)
STOP, OTHER, STUCK = (Fault.EMERGENCY_STOP,), (Fault.SECOND_MASTER,), (Fault.CURRENT_STUCK,)
RUNS: dict[str, Row] = {
    "keeps its torque": Row(keeps_torque, 0.0, (Fault.NOT_DISABLED,), ON),
    "keeps its torque and denies it": Row(lambda bus: keeps_torque(bus, lies=True), 0.0, (Fault.NOT_DISABLED,), ON),
    "enables itself": Row(enables_itself, 0.005, (Fault.NOT_DISABLED,), ON),
    "vanishes at rest": Row(vanishes, 0.005, (Fault.HEARTBEAT_LOST,), (TorqueLeft.UNKNOWN,)),
    "vanishes under power": Row(vanishes, 0.5, (Fault.HEARTBEAT_LOST, Fault.MOTOR_STALE), (TorqueLeft.UNKNOWN,)),
    "another SYNC": Row(says(0x080, b""), 0.5, OTHER),
    "another master's targets": Row(says(0x201, b"\x0f\0\0\0\0\0"), 0.5, OTHER, EITHER),
    "another's questions": Row(says(0x601, b"\x40\0\x10\0\0\0\0\0"), 0.5, OTHER),
    "another's NMT": Row(says(0x000, b"\x01\x01"), 0.5, OTHER),
    "another's heartbeat": Row(says(0x77F, b"\x05"), 0.5, OTHER),
    "its emergency stop": Row(injects("emergency_stop"), 0.5, STOP, drive=STOPPABLE),
    "its emergency stop before arming": Row(injects("emergency_stop"), 0.001, STOP, drive=STOPPABLE),
    "inputs that are told no more": Row(hides_inputs, 0.5, STOP, drive=STOPPABLE),
    "safe torque off": Row(injects("drive_fault 0x8A88"), 0.5, STOP),
    "a current stuck from the first": Row(sticks("_current"), 0.0, STUCK, ON),  # in the preflight
    "a current that gets stuck": Row(sticks("_current"), 1.5, STUCK, ON, cycles=3000),  # it is seen without power, too
    "a current that gets stuck but for a count": Row(sticks("_current", dithers=True), 1.5, STUCK, ON, cycles=3000),
    "a cable on the other side": Row(pulls_the_other_way, 0.0, (Fault.PREFLIGHT_FAILED,)),
    "a joint encoder that freezes but for a count": Row(sticks("_encoders", dithers=True), 1.5, (Fault.JOINT_FROZEN,)),
}


@pytest.mark.parametrize("name", RUNS)
def test_an_attack_on_a_run_ends_it_and_is_said(name: str, tmp_path: Path) -> None:
    row = RUNS[name]
    bus, ended = run(row.harm, row.at, tmp_path, row.drive, cycles=row.cycles)
    unarmed = name == "its emergency stop before arming"
    assert Mode(ended.mode) is Mode.LATCHED or ended.torque != TorqueLeft.OFF or unarmed, "the exit code is 1"
    assert set(row.faults) & set(of(ended.faults)), of(ended.faults)
    assert TorqueLeft(ended.torque) in row.torque
    if ended.torque == TorqueLeft.OFF:
        assert not bus.powered


def forgets(index: int, value: int) -> Harm:
    """An object has another value once NMT has started the drive."""

    def forgetting(bus: Harmed) -> None:
        obey, sub = bus.node._obey, int(index == 0x1016)

        def obeyed(order: int, now: float) -> None:
            obey(order, now)
            if order == frames.NMT_START:
                bus.node.objects.change((index, sub), value)

        bus.node._obey = obeyed

    return forgetting


def watches_nobody(bus: Harmed) -> None:
    bus.node._watch_host = lambda now: None


REFUSED: dict[str, tuple[Harm, str]] = {
    "watches nobody": (watches_nobody, "does not notice that its host is silent"),
    "forgets what silence is": (forgets(0x6007, 0), "keeps 6007h:0 at 0; expected 1"),
    "forgets whom to watch": (forgets(0x1016, 0), "keeps 1016h:1 at 0"),
    "forgets what a fault is": (forgets(0x605E, 2), "keeps 605Eh:0 at 2"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_node_without_what_safety_rests_on_gets_no_power(name: str) -> None:
    harm, said = REFUSED[name]
    bus = Harmed()
    harm(bus)
    with pytest.raises(DriveError, match=said):
        bus.drive.bring_up()
    assert "torque_on" not in bus.events


@pytest.mark.parametrize("part", range(4))
def test_a_node_that_restarts_in_its_bring_up_is_refused_or_is_set_up_whole(part: int) -> None:
    """Whenever it is brought up, the loop's death takes its torque off."""
    refused = 0
    for question in range(1 + 5 * part, 150, 20):
        bus = Harmed(restarts=question)
        try:
            bus.drive.bring_up()
        except DriveError:
            refused += 1
            continue
        bus.run(20, Power.ON, target=0.0)
        died = bus.time
        bus.advance(0.2)
        assert not bus.powered
        assert max((time for time, event, _ in bus.journal if event == "torque_off"), default=0.0) <= died + SILENCE
    assert refused >= 5


def test_on_a_real_bus_a_drive_has_limits_of_its_own() -> None:
    for low, high in ((0, 0), (1000, -1000)):
        overrides = {(0x607D, 1): low, (0x607D, 2): high}
        assert Harmed(DRIVE, overrides).drive.bring_up(), "the twin's bus"
        with pytest.raises(DriveError, match="has no limits of its position"):
            Harmed(DRIVE._replace(interface="socketcan"), overrides).drive.bring_up()


def test_the_supply_is_said_with_who_the_drive_is() -> None:
    assert Harmed(DRIVE, {(0x6079, 0): 23_900}).drive.bring_up().endswith("supply 23.9 V")
    assert "supply" not in Harmed().drive.bring_up()


def test_a_lost_answer_is_asked_for_again_and_a_text_without_end_is_cut() -> None:
    endless = Harmed()
    answer = endless.node._sdo.answer

    def answered(request: bytes) -> bytes | None:
        if request[0] >> 5 == 3:  # the next segment of what never ends
            return bytes((request[0] & 0x10,)) + b"endless"
        name = request[:3] == struct.pack("<BH", 0x40, 0x1008)
        said: bytes | None = struct.pack("<BHB4x", 0x40, 0x1008, 0) if name else answer(request)
        return said

    endless.node._sdo.answer = answered
    for bus in (endless, *(Harmed(loses=n) for n in (1, 2, 30))):
        assert "at node 1" in bus.drive.bring_up()
        assert bus.node.state is DriveState.SWITCH_ON_DISABLED, "as before the trial of its watch"
        assert math.isfinite(bus.run(5, Power.OFF)[-1].motor)
