"""A run of several motors on a clock of the tests': benches that are read and written in the loop's own process."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.clock import SECOND
from bowden.core.signals import DriveReading
from bowden.cycle.one_cycle import Cycle, Filters
from bowden.hardware import shared_memory
from bowden.hardware.ports import Power, TorqueLeft
from bowden.live import control_block, ring, row, together
from bowden.live.control_block import ControlBlock
from bowden.live.ended import Ended
from bowden.live.figures import Damage
from bowden.live.loop import Loop, LoopMotor
from bowden.live.mcap_read import Recording
from bowden.live.preflight import Preflight
from bowden.live.ring import RecorderState, Report, RingReader, RingWriter
from bowden.live.row import NOTHING_READ
from bowden.live.run_settings import run_settings
from bowden.live.script import Script
from bowden.live.together import of_all
from bowden.models.drive.thermal import cold
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Request
from loop_rig import PERIOD, ROWS, twin_bench
from support.simulated_drive import SimulatedDrive

Misread = Callable[[int, DriveReading], DriveReading]


def as_it_is(cycle: int, reading: DriveReading) -> DriveReading:
    return reading


class OneDrive:
    """A simulated drive that remembers what it was told, and whose readings a test may change."""

    def __init__(self, drive: Any = None) -> None:
        self.told: list[tuple[Power, float]] = []
        self.misread: Misread = as_it_is
        self.closed = self.reads = 0
        self._drive = drive or SimulatedDrive(twin_bench())

    def bring_up(self) -> str:
        return self._drive.bring_up()

    def read(self, now: float) -> DriveReading:
        self.reads += 1
        return self.misread(self.reads - 1, self._drive.read(now))

    def reset_fault(self) -> None:
        self.misread = as_it_is

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        self.told.append((power, target))
        self._drive.write(target, power, now, torque)

    def close(self) -> TorqueLeft:
        self.closed += 1
        return self._drive.close()


class MotorsRig:
    """A loop of several motors, with all that is around it; it is the loop's clock too, see `loop_rig.LoopRig`.

    Armed in the sleep 10, run once the preflights of all have passed, and ended where the run rests in the sleep
    `quits` or later.
    """

    def __init__(
        self,
        folder: Path,
        law: Law,
        names: tuple[str, ...] = ("hip", "knee"),
        *,
        seconds: float = 3.0,
        starts: tuple[float, ...] = (),
        limits: Limits | None = None,
        independent: bool = False,
        quits: float = 200,
        between: Callable[["MotorsRig"], None] = lambda rig: None,
        latched: tuple[float | None, ...] = (),
        preflights: tuple[Preflight, ...] = (),
        benches: tuple[Any, ...] = (),
        encoders: tuple[int, ...] = (),
        neighbours: tuple[int, ...] = (),
        each: tuple[Limits, ...] = (),
        laws: tuple[Law, ...] = (),
        scripts: tuple[Script, ...] = (),
    ) -> None:
        self.time, self.sleeps, self.names, self.independent = SECOND, 0, names, independent
        self.asks = (10,)
        self._quits, self._between = quits, between
        whole = limits or Limits()
        table = PeriodicMinimumJerk(0.0, 1.0, 4.0).sample(np.arange(round(1000 * seconds)) * 1e-3)
        laws = laws or (law,) * len(names)
        own_place = neighbours or range(len(names))
        columns = together.columns_of_all(
            {
                name: row.columns(own, together=True, shared=own_place[place] != place)
                for place, (name, own) in enumerate(zip(names, laws, strict=True))
            }
        )
        own = each or (whole,) * len(names)
        kept = {**run_settings(law, own[0], Filters(), PERIOD / SECOND), "seed": 1}
        motors = [
            {**kept, **run_settings(by, one, Filters(), PERIOD / SECOND), "name": name}
            for name, one, by in zip(names, own, laws, strict=True)
        ]
        self.settings = {**kept, "motors": motors, "independent": independent}
        about = row.description(columns, self.settings, 0, 0)
        self._columns, self._units = about.columns, about.units
        ring.create(folder / "ring", about, ROWS)
        shared_memory.create(folder / "block", control_block.WORDS)
        self.reader, self.block = RingReader(folder / "ring"), ControlBlock(folder / "block")
        self.drives = [OneDrive(drive) for drive in benches] or [OneDrive() for _ in names]
        self.scripts = [*scripts] or [
            Script(table, start, 0.5, preflight, 1e-3)
            for start, preflight in zip(
                starts or (0.0,) * len(names), preflights or (Preflight(),) * len(names), strict=True
            )
        ]
        parts = []
        latches = latched or (None,) * len(names)
        for drive, script, latch, allowed, by in zip(self.drives, self.scripts, latches, own, laws, strict=True):
            cycle = Cycle(by, allowed, Filters(), PERIOD / SECOND)
            cycle.begin(NOTHING_READ, cold(allowed.thermal), latch)
            parts.append(LoopMotor(drive, cycle, script))
        writer, words = RingWriter(folder / "ring"), ControlBlock(folder / "block")
        self.loop = Loop(
            parts, writer, words, self, 0, independent=independent, encoders=encoders, neighbours=neighbours
        )

    def now(self) -> int:
        return self.time

    def sleep_until(self, deadline: int) -> None:
        self.time = max(self.time, deadline)
        self.reader.recorder.write(Report(int(RecorderState.OK), self.time, 0, 0, 0, 0))
        self.block.beat(self.time)
        self._between(self)
        newest = self.reader.last()
        if self.sleeps in self.asks:
            self.block.ask(Request.ARM)
        elif newest is not None:
            seen = of_all(self.rows_of(newest), independent=self.independent)
            mode = Mode(int(seen["mode"]))
            if mode == Mode.PREFLIGHT and seen["preflight"] == 1.0:
                self.block.ask(Request.RUN)
            elif mode in (Mode.STOPPED, Mode.LATCHED) and self.sleeps >= self._quits:
                self.block.quit()
        self.sleeps += 1
        assert self.sleeps < ROWS, "the run does not end"

    def rows_of(self, values: Any) -> list[dict[str, float]]:
        found = []
        for name in self.names:
            seen = together.view(self._columns, self.names, name)
            found.append(dict(zip(seen.columns, values[list(seen.places)].tolist(), strict=True)))
        return found

    def run(self) -> tuple[Ended, Recording]:
        """The whole run, and its rows as the log would have them."""
        ended = self.loop.run()
        numbers, rows = self.reader.read()[:2]
        damage = Damage(0, 0, 0)
        return ended, Recording({}, None, self._columns, self._units, numbers, rows, [], damage, self.settings)
