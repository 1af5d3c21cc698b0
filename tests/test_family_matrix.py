"""What a drive of each family and a load cell may do, through the live loop: stopped in time."""

import contextlib
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bowden.core.errors import DriveError
from bowden.core.signals import DriveReading
from bowden.hardware.buses.link import Links
from bowden.hardware.drives.findings import LagWatch
from bowden.hardware.drives.load_cell import LoadCellReader
from bowden.hardware.drives.of_rig import open_drive
from bowden.hardware.ports import Power, serial_of
from bowden.hardware.twin.plant import OFF
from bowden.rig.families import family_of
from bowden.rig.load_cell import LoadCellParameters
from bowden.rig.rig import Rig
from bowden.safety.state import Mode
from support.family_matrix import CELLS, DriveRow, LoadRow, cases, complaints, load_cases, played, react, react_load
from support.memory_bus import MemoryBus

CASES = list(cases())
SAMPLE = [(name, row) for name, row in CASES if row.text == "inert" or (name, row.text) == ("moteus", "turns_lost -1")]
"""One for each family, and the quickest to throw a joint; others are `long`, and in `benchmarks/fault_matrix.py`."""
LOAD_CASES = list(load_cases())
LOAD_SAMPLE = [next(case for case in LOAD_CASES[k::5] if case[0] == cell) for k, cell in enumerate(CELLS)]
"""One for each kind of load cell, likewise."""


@pytest.mark.parametrize(("name", "row"), SAMPLE, ids=str)
def test_an_inert_motor_and_one_that_loses_turns_are_let_go_of_in_time(
    tmp_path: Path, name: str, row: DriveRow
) -> None:
    assert list(complaints(row, react(tmp_path, name, row))) == []


@pytest.mark.long
@pytest.mark.parametrize(("name", "row"), CASES, ids=str)
def test_each_fault_of_a_drive_of_each_family_ends_the_run_in_time(tmp_path: Path, name: str, row: DriveRow) -> None:
    assert list(complaints(row, react(tmp_path, name, row))) == []


@pytest.mark.parametrize(
    ("cell", "row"),
    [case if case in LOAD_SAMPLE else pytest.param(*case, marks=pytest.mark.long) for case in LOAD_CASES],
    ids=str,
)
def test_each_fault_of_a_load_cell_ends_the_run_in_time(tmp_path: Path, cell: str, row: LoadRow) -> None:
    assert list(complaints(row, react_load(tmp_path, cell, row))) == []


@pytest.mark.parametrize("text", ["load_doubled", pytest.param("load_drift 0.0044", marks=pytest.mark.long)])
def test_a_load_cell_that_says_all_twice_or_drifts_by_a_hundredth_in_a_quarter_of_an_hour_stops_nothing(
    tmp_path: Path, text: str
) -> None:
    """The drift, 4 % of its range in 45 min, is not seen."""
    found = react_load(tmp_path, "plain frames", LoadRow(text, 0, (), 0))
    assert (found.faults, found.mode) == ((), Mode.STOPPED)


@pytest.mark.parametrize(
    ("missed", "length", "said"), [(4, 8, ""), (5, 8, "come too seldom: 5 of 8"), (0, 4, "have 4 bytes")]
)
def test_a_load_cell_that_is_slow_or_cut_from_the_first_gets_no_run(missed: int, length: int, said: str) -> None:
    cell = LoadCellParameters(source="can", full_scale=300.0, first_byte=5, bytes=3)
    came = iter([(cell.identifier, bytes(length)), *[None] * missed, *[(cell.identifier, bytes(length))] * 8])
    port: Any = SimpleNamespace(wait_for=lambda is_it, span: next(came))
    with pytest.raises(DriveError, match=said) if said else contextlib.nullcontext():
        LoadCellReader(cell, 0.1).bring_up(port)


@pytest.mark.parametrize(
    ("name", "serial"),
    [
        ("cia402", "0-1-1"),
        ("ak_mit", ""),
        ("moteus", "7477696e0000656e626f7764"),
        ("odrive", "626f7764656e"),
        ("dynamixel", ""),
        ("feetech", ""),
    ],
)
def test_a_drive_tells_its_serial_number_where_its_family_has_one(name: str, serial: str) -> None:
    rig, bus, _ = played(name)
    drive = open_drive(rig.drive_parameters, rig.load_cell, Links(bus, bus))
    drive.bring_up()
    assert serial_of(drive) == serial


def read(parameters: Any, bus: MemoryBus) -> DriveReading:
    """What a drive says without power after its bring-up; it is let go of."""
    drive = family_of(parameters).open(parameters, Links(bus, bus))
    drive.bring_up()
    for _ in range(20):
        reading = drive.read(bus.time)
        drive.write(0.0, Power.OFF, bus.time)
        bus.advance(1e-3)
    drive.close()
    bus.drain()  # which on another bus went with its host
    return reading


@pytest.mark.parametrize("name", ["cia402", "ak_mit", "moteus", "odrive"])
@pytest.mark.parametrize("home", ["counts", "here", "hint"])
def test_drives_of_each_family_are_found_and_zeroed_without_power(name: str, home: str) -> None:
    rig, bus, node = played(name)
    parameters = rig.drive_parameters._replace(answer_timeout=0.1)
    if home == "hint" and "motor_hint" in parameters._fields:
        parameters = parameters._replace(home="hint", motor_hint=0.1)
    elif home == "here":
        parameters = parameters._replace(home="here")
    family = family_of(parameters)
    assert family.probe is not None
    assert family.zeroed is not None
    (device,) = family.probe(parameters, Links(bus, bus))
    assert (device.node, device.state) == (1, "SWITCH_ON_DISABLED")
    wanted = family.zeroed(parameters, read(parameters, bus), 0.7, 0.3)
    again = read(wanted, bus)
    assert (again.motor, again.joint) == pytest.approx((0.7, 0.3), abs=5e-3)
    assert family.zero_hint or name == "cia402"
    assert node.bench.doing == OFF
    assert not any(event == "torque_on" for _, event, _ in bus.journal)


def test_a_loop_that_stood_still_has_not_seen_a_motor_stand_still() -> None:
    watch, seen = LagWatch(20.0), []
    for now in (0.0, 0.001, 0.002, 0.05, 0.051):  # between the third and the fourth it was away
        seen.append(watch.inert(0.0, 0.01, 0.0, now, led=True, fresh=True))
    seen += [watch.inert(0.0, 0.01, 0.0, 0.052 + 1e-3 * k, led=True, fresh=False) for k in range(100)]
    assert not any(seen)
    assert any(watch.inert(0.0, 0.01, 0.0, 0.2 + 1e-3 * k, led=True, fresh=True) for k in range(25))


LAG_CURRENT, LAG_TIME = 3.4, 37e-3
"""Of the default bench's servo: J·ω²/(N·kτ) [A/rad], 2ζ/ω [s]."""


@pytest.mark.parametrize("lag", [0.005, 0.05, 0.3])
def test_a_motor_that_friction_holds_is_not_inert_and_one_without_a_current_is(lag: float) -> None:
    """Standing still at a lag, with the current that the rig's servo draws there, and with a twentieth of it."""
    for share, inert in ((1.0, False), (0.2, False), (0.05, True), (-0.05, True)):
        watch = LagWatch(20.0, LAG_CURRENT, LAG_TIME)
        seen = [
            watch.inert(0.1, 0.1 + lag, share * LAG_CURRENT * lag, 1e-3 * k, led=True, fresh=True) for k in range(50)
        ]
        assert any(seen) == inert, share


@pytest.mark.parametrize(("integral", "silent"), [(0.0, False), (2.0, True), (25.0, True), (40.0, False)])
def test_a_current_that_a_slow_integral_turns_says_nothing(integral: float, silent: bool) -> None:
    """While friction holds a motor at a turn, its integral takes its current through zero: it is not inert."""
    needs = Rig(suit={"worn": True, "drive_integral": integral}).drive_needs
    assert (needs.lag_current == 0.0) == silent
    watch = LagWatch(20.0, needs.lag_current, needs.lag_time)
    assert any(watch.inert(0.1, 0.3, 0.0, 1e-3 * k, led=True, fresh=True) for k in range(50)) != silent


@pytest.mark.parametrize("speed", [0.05, 0.35, 2.0])
@pytest.mark.parametrize("frequency", [2.0, 8.7])
def test_a_soft_servo_on_its_way_is_not_inert_and_one_that_has_lost_its_torque_is(
    speed: float, frequency: float
) -> None:
    """A ramp without a load: at its speed the motor draws nothing and lags by 2ζ/ω times that."""
    omega, position, velocity, lost = 2.0 * math.pi * frequency, 0.0, 0.0, 1.0
    watch = LagWatch(20.0, 1e-4 * omega**2 / 0.0835, 2.0 / omega)
    seen = []
    for k in range(1200):
        time, drawn = 1e-3 * k, 0.0
        for _ in range(10):
            pull = omega**2 * (speed * time - position) - 2.0 * omega * velocity if time < lost else -velocity / 0.02
            drawn = 1e-4 * pull / 0.0835 if time < lost else 0.0
            velocity += 1e-4 * pull
            position += 1e-4 * velocity
        seen.append(watch.inert(position, speed * time, drawn, time, led=True, fresh=True))
    assert not any(seen[:1000])
    assert any(seen[1000:1050]) or speed < 0.3


REFERENCES: dict[str, Callable[[float], float]] = {
    "chirp": lambda t: 0.6 * math.sin(2.0 * math.pi * (0.2 + 0.5 * t) * t),
    "triangle": lambda t: 0.7 * abs(1.5 * t % 2.0 - 1.0),
    "ramp": lambda t: 0.35 * t,
}


@pytest.mark.parametrize("frequency", [8.7, 20.0])
@pytest.mark.parametrize("name", REFERENCES)
def test_a_motor_that_is_well_is_not_inert_because_it_draws_no_current(name: str, frequency: float) -> None:
    """A servo of second order, with a current of zero throughout: nothing but its motion speaks for it."""
    watch, omega, position, velocity = LagWatch(20.0), 2.0 * math.pi * frequency, 0.0, 0.0
    watch._watch.inert = lambda *_, **__: False  # type: ignore[method-assign]  # that it stands still is another rule
    for k in range(3000):
        target = REFERENCES[name](1e-3 * k)
        for _ in range(10):
            velocity += 1e-4 * (omega**2 * (target - position) - 1.4 * omega * velocity)
            position += 1e-4 * velocity
        noise = 1e-4 * math.sin(1234.5 * k)
        assert not watch.inert(position + noise, target, 0.0, 1e-3 * k, led=True, fresh=True)
