"""The fault matrix' rows of drive and load cell, through the live loop, against the twin of each family in memory.

The loop is `bowden.live.loop.Loop` with the rig's own supervisor, driver and twin are the family's own; bus and clock
are the tests'. Each fault begins while the law leads, with the motor on its way.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.clock import SECOND
from bowden.core.units import RADIANS
from bowden.hardware.buses.link import Links
from bowden.hardware.drives.families.ak_mit import AkParameters
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.drives.families.dynamixel import DynamixelParameters
from bowden.hardware.drives.families.feetech import FeetechParameters
from bowden.hardware.drives.families.moteus import MoteusParameters
from bowden.hardware.drives.families.odrive import OdriveParameters
from bowden.hardware.drives.of_rig import open_drive
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.injection import parse
from bowden.hardware.twin.plant import OFF
from bowden.hardware.twin.sensor_node import LoadCellNode
from bowden.live.preflight import Preflight, Reason
from bowden.live.script import Script
from bowden.rig.families import family_named, family_of
from bowden.rig.load_cell import LoadCellParameters
from bowden.rig.rig import Rig
from bowden.safety.faults import of
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release
from bowden.safety.state import Mode
from loop_rig import LoopRig
from support.memory_bus import MemoryBus

FAMILIES: Mapping[str, Callable[[], Rig]] = {
    "cia402": Rig,
    "ak_mit": lambda: _geared(Rig(drive=AkParameters())),
    "ak_mit V3": lambda: _geared(Rig(drive=AkParameters(board="v3"))),
    "moteus": lambda: Rig(drive=MoteusParameters()),
    "odrive": lambda: Rig(drive=OdriveParameters()),
    "dynamixel": lambda: _on_a_line(DynamixelParameters(motor_home=-math.pi / 2.0)),
    "feetech": lambda: _on_a_line(FeetechParameters(motor_home=-math.pi / 2.0)),
}
"""Family → a rig with it."""


def _geared(rig: Rig) -> Rig:
    cycle = 2e-3 if rig.drive.board == "v3" else 1e-3
    return rig.replace(sample_time=cycle, motor=rig.motor._replace(gear=9.0, torque_constant=0.091))


def _on_a_line(drive: Any) -> Rig:
    """A rig with a serial servo, whose gear makes its rotor heavy, and whose cycle is as long as any other's here."""
    rig = Rig().replace(
        sample_time=2e-3, delay=1, motor=Rig().motor._replace(gear=1.0, torque_constant=1.0, inertia=1e-3)
    )
    return rig.replace(drive=drive)


class DriveRow(NamedTuple):
    """A fault of a drive, and what must become of it."""

    text: str
    """As it is injected."""
    within: int
    """From its beginning to R2 or R3, at most [ms]."""


ROWS = (
    DriveRow("silence", 60),
    DriveRow("deaf", 60),
    DriveRow("late_pdos 40", 60),
    DriveRow("doubled_pdos", 60),
    DriveRow("watch_off", 260),
    DriveRow("drive_fault 3", 20),
    DriveRow("emergency_stop", 20),
    DriveRow("reboot", 60),
    DriveRow("mode_left", 50),
    DriveRow("inert", 50),
    DriveRow("encoder_nan motor", 20),
    DriveRow("over_current 30", 60),
    DriveRow("position_saturated 1", 20),
    DriveRow("position_saturated -1", 20),
    DriveRow("turns_lost 1", 3),
    DriveRow("turns_lost -1", 3),
    DriveRow("turns_lost 100", 3),
    DriveRow("short_frames 7", 60),
    DriveRow("short_frames 1", 60),
)
"""What a drive may do; that which a family cannot have is left out for it."""
RELEASE = 50 + round(1000.0 * longest_release(Limits()))
"""From R2 or R3 to a motor without torque, at most [ms]."""
PERIOD = 1.6
"""Of the reference, quick enough for every fault to show [s]."""


class Found(NamedTuple):
    """What came of a fault."""

    reaction: int
    """The worst until and with the first R2 or R3."""
    after: float
    """From the fault's beginning, or from arming where it was there before, to it; infinite where there is none
    [ms]."""
    off: float
    """From the fault's beginning to a motor without torque; infinite where it has some at the end [ms]."""
    faults: tuple[str, ...]
    mode: Mode
    """At the end."""
    preflight: Reason = Reason.NONE
    """Why the preflight refused."""
    pulled: float = 0.0
    """Time with torque since the fault's beginning [ms]."""
    moved: float = 0.0
    """How far the motor was from where it stood then [rad]."""
    last: tuple[str, ...] = ()
    """Faults at the end."""
    silenced: float = 0.0
    """Time with torque after the run's end, when nobody speaks to the drive any more; infinite for all of it [ms]."""


EXCEPT = {("dynamixel", "deaf"), ("feetech", "deaf"), ("ak_mit V3", "mode_left")}
"""Family and fault with which a motor keeps its torque, as its drive's watchdog holds, or as it has none: for a bare
bench alone. And a fault of a board that is in no mode: its next command gives torque again."""


def cases() -> Iterator[tuple[str, DriveRow]]:
    """Each family with each fault that its drive can have."""
    for name in FAMILIES:
        node = family_named(name.split()[0]).node()
        for row in ROWS:
            kind = row.text.split()[0]
            if {kind, f"{kind} motor"} & node.lacks.keys() or (name, kind) in EXCEPT:
                continue
            yield name, row


_CELL = LoadCellParameters(source="cia404", scale=0.01, full_scale=300.0)
_AT_INPUT = DriveParameters(tension_scale=0.05, analog_range=10_000.0)
CELLS: Mapping[str, tuple[str, Callable[[Rig], Rig]]] = {
    "at the drive's input": ("cia402", lambda rig: rig.replace(drive=_AT_INPUT)),
    "cia404": ("ak_mit", lambda rig: rig.replace(load_cell=_CELL)),
    "plain frames": ("odrive", lambda rig: rig.replace(load_cell=_CELL._replace(source="can", bytes=3, first_byte=5))),
    "cia404, torque": (
        "cia402",
        lambda rig: rig.replace(load_cell=_CELL._replace(measures="torque", scale=0.001, full_scale=30.0)),
    ),
}
"""Load cell → family of the drive that it is tried beside, and how it comes into its rig."""


class LoadRow(NamedTuple):
    """A fault of a load cell, and what must become of it."""

    text: str
    reaction: int
    faults: tuple[str, ...]
    """Any of these is what stops the run."""
    within: int
    """From its beginning to that, at most [ms]."""


_LOST = ("TENSION_LOST", "TORQUE_LOST")
LOAD_ROWS = (
    LoadRow("load_silence", 2, _LOST, 20),
    LoadRow("load_stuck", 2, ("LOAD_STUCK",), 500),
    LoadRow("load_saturated 1", 3, ("OVER_TENSION", "OVER_TORQUE"), 8),
    LoadRow("load_saturated -1", 2, ("TENSION_LOST",), 12),
    LoadRow("load_sign", 2, ("SLACK",), 60),
    LoadRow("load_drift 2000", 3, ("OVER_TENSION", "OVER_TORQUE"), 90),
    LoadRow("load_slow 12", 2, _LOST, 20),
    LoadRow("load_half", 2, _LOST, 20),
)
"""What a load cell may do. Stuck, it shows once the motor has gone `frozen_travel` behind the dead zone; drifting, once
it is beyond its limit."""
UNSEEN = {
    ("cia404, torque", "load_sign"),
    *(("at the drive's input", text) for text in ("load_silence", "load_slow 12", "load_half")),
}
"""A torque that turns its sign may be right: a limb pushes either way. An input of the drive is not silent alone, and
what is slow before it is told in every cycle."""


def load_cases() -> Iterator[tuple[str, LoadRow]]:
    """Each kind of load cell with each of its faults that can be seen."""
    for cell in CELLS:
        for row in LOAD_ROWS:
            if (cell, row.text) in UNSEEN:
                continue
            both = cell.endswith("torque") and row.text == "load_saturated -1"
            yield cell, row._replace(reaction=3, faults=("OVER_TORQUE",), within=8) if both else row


def played(name: str, fitted: Callable[[Rig], Rig] = lambda rig: rig) -> tuple[Rig, MemoryBus, Any]:
    """A rig with a family, a bus in memory with its twin on it, and that.

    Args:
        name: of the family.
        fitted: the rig with what else it has.
    """
    rig, bus = fitted(FAMILIES[name]()), MemoryBus()
    plant = TwinBench(rig.bench, rig.bend_path, 20.0, rig.seed, rig.start_motor, bus.time)
    node = family_of(rig.drive).node()(rig.drive_parameters, plant, bus.put, bus.note)
    bus.faults = node.faults
    bus.attach(node)
    if rig.load_cell.enabled:
        bus.attach(LoadCellNode(rig.load_cell, plant, node.faults, bus.put))
    return rig, bus, node


def react_load(folder: Path, cell: str, row: LoadRow, onset: float = 0.35) -> Found:
    """`react` of a load cell."""
    name, fitted = CELLS[cell]
    return react(folder, name, row, onset, fitted)


def react(
    folder: Path,
    name: str,
    row: DriveRow | LoadRow,
    onset: float | None = 0.35,
    fitted: Callable[[Rig], Rig] = lambda rig: rig,
    lasting: float = math.inf,
    each: Callable[[MemoryBus], None] = lambda bus: None,
    late: Callable[[], float] | None = None,
    watched: float = 1.0,
) -> Found:
    """Let a fault begin so long after the law has, and see what comes of it.

    Args:
        folder: for ring and control block.
        name: of the family.
        row: the fault; several are parted by semicolons.
        onset: after the law has the motor; None for a fault that is there before the bring-up [s].
        fitted: the rig with what else it has.
        lasting: of the fault [s].
        each: what else happens in a cycle, from the fault's beginning on.
        late: how late the loop wakes, from then on [s].
        watched: for how long it is looked at [s].
    """
    rig, bus, node = played(name, fitted)
    plant, limits, faults = node.bench, rig.supervisor_limits, node.faults

    def begin() -> None:
        began[0], before[0], at[0] = bus.time, bus.time, plant.motor
        for text in filter(None, row.text.split(";")):
            faults.inject(parse(text.strip())._replace(start=bus.time, end=bus.time + lasting))
        node.tick(bus.time)

    began, before, torque_off, at, pulled, moved = [np.nan], [np.nan], [np.nan], [np.nan], [0.0], [0.0]
    if onset is None:
        begin()
    drive = open_drive(rig.drive_parameters, rig.load_cell, Links(bus, bus))
    drive.bring_up()
    table = PeriodicMinimumJerk(0.0, 60.0 * RADIANS, PERIOD).sample(np.arange(4000 + 1000 * int(onset or 0)) * 1e-3)
    checks = Preflight(tension=limits.measures_tension, torque=limits.measures_torque)
    script = Script(table, 0.0, 0.5, checks, 1e-3)

    def between(run: LoopRig) -> None:
        if late is None or np.isnan(began[0]):
            bus.advance(1e-3)
        else:
            span = max(0.0, run.time / SECOND - bus.time) + late()
            bus.advance(span % 1e-3)
            for _ in range(int(span / 1e-3)):
                bus.advance(1e-3)
        run.time = round(bus.time * SECOND)
        if np.isnan(began[0]) and run.led == round(1000.0 * (onset or 0.0)):
            begin()
        if not np.isnan(began[0]):
            each(bus)
            moved[0] = max(moved[0], abs(plant.motor - at[0]))
            if plant.doing != OFF:
                pulled[0], torque_off[0] = pulled[0] + bus.time - before[0], bus.time
            before[0] = bus.time
            if bus.time > began[0] + watched:
                run.block.quit()

    loop = LoopRig(folder, LAWS["adaptive"], limits, drive, script, between, quits=float("inf"))
    loop.time = round(bus.time * SECOND)
    _, rows = loop.run()
    times, reaction, armed = rows["time"], rows["reaction"], np.flatnonzero(rows["mode"] != Mode.STOPPED)
    if onset is None:
        began[0] = float(times[armed[0]]) if len(armed) else np.inf
    stops = np.flatnonzero((reaction > 1.5) & (times >= began[0]))
    first = int(stops[0]) if len(stops) else len(times) - 1
    held, ended = plant.doing != OFF, bus.time
    while plant.doing != OFF and bus.time < ended + 0.1:
        bus.advance(1e-3)
    silenced = float("inf") if plant.doing != OFF else 1e3 * (bus.time - ended)
    return Found(
        int(reaction[: first + 1].max()),
        1e3 * (float(times[first]) - began[0]) if len(stops) else float("inf"),
        float("inf") if held else 1e3 * max(0.0, np.nan_to_num(torque_off[0] - began[0])),
        tuple(fault.name for fault in of(rows["faults"][first])),
        Mode(int(rows["mode"][-1])),
        Reason(int(np.nanmax(rows["preflight_reason"]))),
        1e3 * pulled[0],
        moved[0],
        tuple(fault.name for fault in of(rows["faults"][-1])),
        silenced,
    )


def complaints(row: DriveRow | LoadRow, found: Found) -> Iterator[str]:
    """What is wrong with it."""
    if isinstance(row, LoadRow) and (found.reaction != row.reaction or not {*row.faults} & {*found.faults}):
        yield f"R{found.reaction} by {', '.join(found.faults)}, not R{row.reaction} by {' or '.join(row.faults)}"
    if not found.after <= row.within:
        yield f"R2 or R3 after {found.after:.0f} ms, not {row.within}"
    if not found.off <= found.after + RELEASE:
        yield f"torque until {found.off:.0f} ms"
    if found.mode != Mode.LATCHED:
        yield f"ended {found.mode.name}"
