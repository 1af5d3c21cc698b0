"""A run of the loop on a clock of the tests': the loop, and all that is around it in a live run."""

from collections.abc import Callable, Mapping, Sequence
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
from bowden.live.ring import Description, RecorderState, Report, RingReader, RingWriter
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


def surroundings(folder: Path, about: Description, rows: int = ROWS) -> tuple[RingReader, ControlBlock, Any, Any]:
    """A new ring and control block: what the tests hold of them, and what the loop does."""
    ring.create(folder / "ring", about, rows)
    shared_memory.create(folder / "block", control_block.WORDS)
    block, words = (ControlBlock(folder / "block") for _ in "12")
    return RingReader(folder / "ring"), block, RingWriter(folder / "ring"), words


class Around:
    """What is around a loop: its ring and control block, a recorder that is well, and an operator; it is the clock too.

    Time passes only while the loop sleeps. In each sleep `between` does what the test wants: it lets `time` go on, or
    ends the operator's signs of life with `operator`. What is asked: ARM in the sleeps of the numbers `arms`, RUN when
    the preflight is passed, and the end where the run rests in the sleep `quits` or later.
    """

    def __init__(
        self,
        folder: Path,
        about: Description,
        motors: Sequence[LoopMotor],
        between: Callable[[Any], None],
        *,
        arms: tuple[int, ...] = (10,),
        quits: float = 200,
        **loop: Any,
    ) -> None:
        self.time, self.operator, self.arms = SECOND, True, arms
        self.sleeps = 0
        """Before this one: the number of the row that comes next."""
        self._between, self._quits, self._about = between, quits, about
        self.reader, self.block, writer, words = surroundings(folder, about)
        self.loop = Loop(motors, writer, words, self, 0, **loop)

    def now(self) -> int:
        return self.time

    def seen(self, row: Any) -> Mapping[str, float]:
        """What a row says of the whole run."""
        return dict(zip(self._about.columns, row.tolist(), strict=True))

    def sleep_until(self, deadline: int) -> None:
        self.time = max(self.time, deadline)
        self.reader.recorder.write(Report(int(RecorderState.OK), self.time, 0, 0, 0, 0))
        if self.operator:
            self.block.beat(self.time)
        newest = self.reader.last()
        self._between(self)
        if self.sleeps in self.arms:
            self.block.ask(Request.ARM)
        elif newest is not None:
            seen = self.seen(newest)
            if seen["mode"] == Mode.PREFLIGHT and seen["preflight"] == 1.0:
                self.block.ask(Request.RUN)
            elif seen["mode"] in (Mode.STOPPED, Mode.LATCHED) and self.sleeps >= self._quits:
                self.block.quit()
        self.sleeps += 1
        assert self.sleeps < ROWS, "the run does not end"

    def run(self) -> tuple[Ended, Recording]:
        """The whole run, and its rows as the log would have them."""
        ended, about = self.loop.run(), self._about
        numbers, rows = self.reader.read()[:2]
        damage, settings = Damage(0, 0, 0), dict(about.settings)
        return ended, Recording({}, None, about.columns, about.units, numbers, rows, [], damage, settings)


class LoopRig(Around):
    """A loop of one motor."""

    def __init__(
        self,
        folder: Path,
        law: Law,
        limits: Limits,
        drive: Any,
        script: Script,
        between: Callable[["LoopRig"], None] = lambda rig: None,
        *,
        source: Source = TABLE,
        course: EmgCourse | None = None,
        push: TorqueOffset | None = None,
        brake: BrakeHold | None = None,
        latched: float | None = None,
        **asked: Any,
    ) -> None:
        self.drive = drive
        self.led = 0
        """Cycles in which the law had the motor."""
        parts = {"emg": course is not None, "pushed": push is not None, "braked": brake is not None}
        about = description(columns(law, **parts, source=source), {}, 0, 0)
        cycle = Cycle(law, limits, Filters(), PERIOD / SECOND, source)
        cycle.begin(NOTHING_READ, cold(limits.thermal), latched)
        super().__init__(folder, about, [LoopMotor(drive, cycle, script, course, push, brake)], between, **asked)

    def sleep_until(self, deadline: int) -> None:
        row = self.reader.last()
        self.led += row is not None and row[AT["source"]] >= LAW_BEGINS
        super().sleep_until(deadline)
