"""A run of several motors on a clock of the tests': benches that are read and written in the loop's own process."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.clock import SECOND
from bowden.core.signals import DriveReading
from bowden.cycle.one_cycle import Cycle, Filters
from bowden.hardware.ports import Power, TorqueLeft
from bowden.live import row, together
from bowden.live.loop import LoopMotor
from bowden.live.preflight import Preflight
from bowden.live.row import NOTHING_READ
from bowden.live.run_settings import run_settings
from bowden.live.script import Script
from bowden.live.together import of_all
from bowden.models.drive.thermal import cold
from bowden.safety.limits import Limits
from loop_rig import PERIOD, Around, twin_bench
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


class MotorsRig(Around):
    """A loop of several motors.

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
        self.names, self.independent = names, independent
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
        about = row.description(columns, self.settings, 0, 0)
        how = {"independent": independent, "encoders": encoders, "neighbours": neighbours}
        super().__init__(folder, about, parts, between, quits=quits, **how)

    def seen(self, row: Any) -> Mapping[str, float]:
        return of_all(self.rows_of(row), independent=self.independent)

    def rows_of(self, values: Any) -> list[dict[str, float]]:
        found = []
        for name in self.names:
            seen = together.view(self._about.columns, self.names, name)
            found.append(dict(zip(seen.columns, values[list(seen.places)].tolist(), strict=True)))
        return found
