"""The fault matrix' rows of the drive, through the live loop, against the twin of each family in memory.

The loop is `bowden.live.loop.Loop` with the rig's own supervisor, driver and twin are the family's own; bus and clock
are the tests'. Each fault begins while the law leads, with the motor on its way.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.clock import SECOND
from bowden.core.units import RADIANS
from bowden.hardware.buses.link import Links
from bowden.hardware.drives.ak_parameters import AkParameters
from bowden.hardware.drives.family import family_of
from bowden.hardware.drives.moteus_parameters import MoteusParameters
from bowden.hardware.drives.odrive_parameters import OdriveParameters
from bowden.hardware.twin.ak_node import AkNode
from bowden.hardware.twin.bench import OFF, TwinBench
from bowden.hardware.twin.canopen_node import CanopenNode
from bowden.hardware.twin.injection import parse
from bowden.hardware.twin.moteus_node import MoteusNode
from bowden.hardware.twin.odrive_node import OdriveNode
from bowden.live.preflight import Preflight
from bowden.live.script import Script
from bowden.rig.rig import Rig
from bowden.safety.faults import of
from bowden.safety.supervisor import Mode
from loop_rig import LoopRig
from support.memory_bus import MemoryBus

FAMILIES: Mapping[str, tuple[Callable[[], Rig], Any]] = {
    "cia402": (Rig, CanopenNode),
    "ak_mit": (lambda: _geared(Rig(drive=AkParameters())), AkNode),
    "moteus": (lambda: Rig(drive=MoteusParameters()), MoteusNode),
    "odrive": (lambda: Rig(drive=OdriveParameters()), OdriveNode),
}
"""Family → a rig with it, and what plays it."""


def _geared(rig: Rig) -> Rig:
    return rig.replace(motor=rig.motor._replace(gear=9.0, torque_constant=0.091))


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
    DriveRow("drive_fault 3", 20),
    DriveRow("emergency_stop", 20),
    DriveRow("reboot", 60),
    DriveRow("mode_left", 50),
    DriveRow("inert", 50),
    DriveRow("encoder_nan motor", 20),
    DriveRow("over_current 30", 60),
)
"""What a drive may do; that which a family cannot have is left out for it."""
SEEN_BY_ITS_MODEL = 80
"""In place of 50 ms, of an inert motor of a `cia402` drive: its gains are its own, so that nobody but the supervisor's
model of it can say that it should have turned [ms]."""
RELEASE = 250
"""From R2 or R3 to a motor without torque, at most [ms]."""
PERIOD = 1.6
"""Of the reference, quick enough for every fault to show [s]."""


class Found(NamedTuple):
    """What came of a fault."""

    reaction: int
    """The worst until and with the first R2 or R3."""
    after: float
    """From the fault's beginning to it; infinite where there is none [ms]."""
    off: float
    """From the fault's beginning to a motor without torque; infinite where it has some at the end [ms]."""
    faults: tuple[str, ...]
    mode: Mode
    """At the end."""


def cases() -> Iterator[tuple[str, DriveRow]]:
    """Each family with each fault that its drive can have."""
    for name, (_, node) in FAMILIES.items():
        for row in ROWS:
            kind = row.text.split()[0]
            if {kind, f"{kind} motor"} & getattr(node, "lacks", {}).keys():
                continue
            yield name, row._replace(within=SEEN_BY_ITS_MODEL) if (name, kind) == ("cia402", "inert") else row


def played(name: str) -> tuple[Rig, MemoryBus, Any]:
    """A rig with a family, a bus in memory with its twin on it, and that."""
    make, node_of = FAMILIES[name]
    rig, bus = make(), MemoryBus()
    plant = TwinBench(rig.bench, rig.bend_path, 20.0, rig.seed, rig.start_motor, bus.time)
    node = node_of(rig.drive_parameters, plant, bus.put, bus.note)
    bus.attach(node)
    return rig, bus, node


def react(folder: Path, name: str, row: DriveRow, onset: float = 0.35) -> Found:
    """Let a fault begin so long after the law has, and see what comes of it."""
    rig, bus, node = played(name)
    parameters, plant = rig.drive_parameters, node.bench
    drive = family_of(parameters).open(parameters, Links(bus))
    drive.bring_up()
    table = PeriodicMinimumJerk(0.0, 60.0 * RADIANS, PERIOD).sample(np.arange(4000) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
    began, torque_off = [np.nan], [np.nan]

    def between(run: LoopRig) -> None:
        bus.advance(1e-3)
        run.time = round(bus.time * SECOND)
        if run.led == round(1000.0 * onset) and np.isnan(began[0]):
            began[0] = bus.time
            node.faults.inject(parse(row.text)._replace(start=bus.time))
        if not np.isnan(began[0]):
            torque_off[0] = bus.time if plant.doing != OFF else torque_off[0]
            if bus.time > began[0] + 1.0:
                run.block.quit()

    loop = LoopRig(folder, LAWS["adaptive"], rig.supervisor_limits, drive, script, between, quits=float("inf"))
    loop.time = round(bus.time * SECOND)
    _, rows = loop.run()
    times, reaction = rows["time"], rows["reaction"]
    stops = np.flatnonzero((reaction > 1.5) & (times >= began[0]))
    first = int(stops[0]) if len(stops) else len(times) - 1
    return Found(
        int(reaction[: first + 1].max()),
        1e3 * (float(times[first]) - began[0]) if len(stops) else float("inf"),
        float("inf") if plant.doing != OFF else 1e3 * (np.nan_to_num(torque_off[0], nan=began[0]) - began[0]),
        tuple(fault.name for fault in of(rows["faults"][first])),
        Mode(int(rows["mode"][-1])),
    )


def complaints(row: DriveRow, found: Found) -> Iterator[str]:
    """What is wrong with it."""
    if not found.after <= row.within:
        yield f"R2 or R3 after {found.after:.0f} ms, not {row.within}"
    if not found.off <= found.after + RELEASE:
        yield f"torque until {found.off:.0f} ms"
    if found.mode != Mode.LATCHED:
        yield f"ended {found.mode.name}"
