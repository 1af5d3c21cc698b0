"""A run of the loop on a clock of the tests': the loop, and all that is around it in a live run."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from bowden.control.law import Law
from bowden.control.source import TABLE, Source
from bowden.core.clock import SECOND
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import LAW_BEGINS, Cycle, Filters
from bowden.cycle.torque_offset import TorqueOffset
from bowden.hardware import shared_memory
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.twin.bench import TwinBench
from bowden.live import control_block, ring
from bowden.live.brake_hold import BrakeHold
from bowden.live.control_block import ControlBlock
from bowden.live.figures import Damage
from bowden.live.loop import Ended, Loop, LoopMotor
from bowden.live.mcap_read import Recording
from bowden.live.ring import RecorderState, Report, RingReader, RingWriter
from bowden.live.row import AT, NOTHING_READ, columns, description
from bowden.live.script import Script
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.thermal import cold
from bowden.plants.presets.bench import default_bench
from bowden.safety.limits import ARM_LOWERING, Limits
from bowden.safety.state import Mode, Request

PERIOD = SECOND // 1000
SUIT_LIMITS = Limits(
    motor_low=-12.0 * RADIANS,
    motor_margin=8.0 * RADIANS,
    joint_high=105.0 * RADIANS,
    play=20.0 * RADIANS,
    tracking=35.0 * RADIANS,
    lowering=ARM_LOWERING,
    thermal=Limits().thermal._replace(continuous_current=12.0),
)
"""For an arm of 105° on the suit's cables."""

ROWS = 20_000
"""No run of these tests is as long; the ring holds so many."""


def twin_bench() -> TwinBench:
    """The bench, ready to be driven."""
    bench = default_bench()
    return TwinBench(bench, constant_bend(bench.sheath.bend), 1.0, 1, 0.0, 1.0)


class LoopRig:
    """A loop, its ring and control block, a recorder that is well, and an operator; it is the loop's clock too.

    Time passes only while the loop sleeps. In each sleep `between` does what the test wants: it lets `time` go on, or
    ends the operator's signs of life with `operator`. What is asked: ARM in the sleeps of the numbers `arms`, RUN when
    the preflight is passed, and the end where the run rests in the sleep `quits` or later.
    """

    def __init__(
        self,
        folder: Path,
        law: Law,
        limits: Limits,
        drive: Any,
        script: Script,
        between: Callable[["LoopRig"], None] = lambda rig: None,
        *,
        arms: tuple[int, ...] = (10,),
        quits: float = 200,
        source: Source = TABLE,
        course: EmgCourse | None = None,
        push: TorqueOffset | None = None,
        brake: BrakeHold | None = None,
        latched: float | None = None,
    ) -> None:
        self.time, self.operator, self.drive = SECOND, True, drive
        self.sleeps = 0
        """Before this one: the number of the row that comes next."""
        self.led = 0
        """Cycles in which the law had the motor."""
        self._between, self._arms, self._quits = between, arms, quits
        parts = {"emg": course is not None, "pushed": push is not None, "braked": brake is not None}
        about = description(columns(law, **parts, source=source), {}, 0, 0)
        self._columns, self._units = about.columns, about.units
        ring.create(folder / "ring", about, ROWS)
        shared_memory.create(folder / "block", control_block.WORDS)
        self.reader, self.block = RingReader(folder / "ring"), ControlBlock(folder / "block")
        cycle = Cycle(law, limits, Filters(), PERIOD / SECOND, source)
        cycle.begin(NOTHING_READ, cold(limits.thermal), latched)
        writer, words = RingWriter(folder / "ring"), ControlBlock(folder / "block")
        self.loop = Loop((LoopMotor(drive, cycle, script, course, push, brake),), writer, words, self, 0)

    def now(self) -> int:
        return self.time

    def sleep_until(self, deadline: int) -> None:
        self.time = max(self.time, deadline)
        self.reader.recorder.write(Report(int(RecorderState.OK), self.time, 0, 0, 0, 0))
        if self.operator:
            self.block.beat(self.time)
        row = self.reader.last()
        self.led += row is not None and row[AT["source"]] >= LAW_BEGINS
        self._between(self)
        if row is not None:
            self._ask(Mode(int(row[AT["mode"]])), row[AT["preflight"]] == 1.0)
        self.sleeps += 1
        assert self.sleeps < ROWS, "the run does not end"

    def _ask(self, mode: Mode, passed: bool) -> None:
        if self.sleeps in self._arms:
            self.block.ask(Request.ARM)
        elif mode == Mode.PREFLIGHT and passed:
            self.block.ask(Request.RUN)
        elif mode in (Mode.STOPPED, Mode.LATCHED) and self.sleeps >= self._quits:
            self.block.quit()

    def run(self) -> tuple[Ended, Recording]:
        """The whole run, and its rows as the log would have them."""
        ended = self.loop.run()
        numbers, rows = self.reader.read()[:2]
        return ended, Recording({}, None, self._columns, self._units, numbers, rows, [], Damage(0, 0, 0))
