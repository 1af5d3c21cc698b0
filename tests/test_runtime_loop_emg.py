"""The loop by EMG on a clock of the tests': a contraction moves the joint, a lost stream releases, the log replays."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.hardware.simulated import SimulatedDrive
from bowden.hardware.twin_bench import TwinBench
from bowden.models.thermal import cold
from bowden.paper.bench import default_bench
from bowden.runtime import control_block, intent_block, ring
from bowden.runtime.clock import SECOND
from bowden.runtime.control_block import ControlBlock
from bowden.runtime.cycle import Cycle, Filters, Source
from bowden.runtime.emg_course import CourseSettings, EmgCourse
from bowden.runtime.intent_block import Heard, IntentReader, IntentWriter
from bowden.runtime.loop import Ended, Loop
from bowden.runtime.mcap_read import Recording
from bowden.runtime.mcap_reader import Damage
from bowden.runtime.preflight import Preflight
from bowden.runtime.replay import replay
from bowden.runtime.ring import RingReader, RingWriter
from bowden.runtime.ring_status import RecorderState, Report
from bowden.runtime.row import AT, NOTHING_READ, columns, description
from bowden.runtime.script import Script
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.supervisor import Mode, Request
from bowden.sensing.intent import Intent, IntentSettings
from bowden.sim.scenario import constant_bend

LAW, LIMITS = LAWS["adaptive"], Limits(uses_emg=1.0)
SETTINGS = CourseSettings(IntentSettings(0.0, 1.0, 1.0))
CYCLES = 3000


class Rig:
    """A run by EMG: the muscle contracts `contracts` cycles after the law has the motor, never if that is 0; the stream
    begins after `begins` cycles, and is gone `lasts` cycles after the law has the motor.
    """

    def __init__(self, folder: Path, contracts: int, lasts: int, begins: int = 0) -> None:
        self.contracts, self.lasts, self.begins = contracts, lasts, begins
        self.time, self.sleeps, self.led = SECOND, 0, 0
        for name, make in (("block", control_block.create), ("intent", intent_block.create)):
            make(folder / name)
        ring.create(folder / "ring", description(LAW, {}, 0, 0, emg=True), 20_000)
        self.block, self.reader = ControlBlock(folder / "block"), RingReader(folder / "ring")
        self.writer = IntentWriter(folder / "intent")
        bench = default_bench()
        plant = TwinBench(bench, constant_bend(bench.sheath.bend), 1.0, 1, 0.0, 1.0)
        self.cycle = Cycle(LAW, LIMITS, Filters(), 1e-3)
        self.cycle.begin(NOTHING_READ, cold(LIMITS.thermal))
        course = EmgCourse(SETTINGS, IntentReader(folder / "intent"), 0, CYCLES)
        script = Script(np.zeros((1, 3)), 0.0, 0.5, Preflight(), 1e-3, course)
        loop_block, writer = ControlBlock(folder / "block"), RingWriter(folder / "ring")
        self.loop = Loop(SimulatedDrive(plant), self.cycle, script, writer, loop_block, self, 0, course)

    def now(self) -> int:
        return self.time

    def sleep_until(self, deadline: int) -> None:
        """What happens between two cycles."""
        self.time, self.sleeps = max(self.time, deadline), self.sleeps + 1
        self.reader.recorder.write(Report(int(RecorderState.OK), self.time + SECOND, 0, 0, 0, 0, 0))
        self.block.beat(self.time)
        row = self.reader.last()
        mode = Mode.STOPPED if row is None else Mode(int(row[AT["mode"]]))
        self.led += row is not None and row[AT["source"]] >= Source.LAW_BEGINS
        if self.sleeps > self.begins and self.led < self.lasts:
            active = float(0 < self.contracts <= self.led)
            self.writer.write(Heard(newest=self.time, onset=self.time if active else 0, flexor=active, share=0.5))
        if self.sleeps == 10 or (self.begins and self.sleeps == self.begins + 50):
            self.block.ask(int(Request.ARM))
        elif row is not None and mode == Mode.PREFLIGHT and row[AT["preflight"]] == 1.0:
            self.block.ask(int(Request.RUN))
        elif self.sleeps > self.begins + 200 and mode in (Mode.STOPPED, Mode.LATCHED):
            self.block.quit()

    def run(self) -> tuple[Ended, dict[str, Any], np.ndarray]:
        ended = self.loop.run()
        rows = self.reader.read().rows
        names = list(columns(LAW, emg=True))
        return ended, {name: rows[:, i] for i, name in enumerate(names)}, rows


def test_a_contraction_moves_the_joint_in_the_cycle_in_which_it_comes(tmp_path: Path) -> None:
    ended, log, _ = Rig(tmp_path, 1200, 99_999).run()
    assert (ended.mode, ended.faults) == (Mode.STOPPED, 0), "the run comes to its end, and that is no fault"
    seen = int(np.argmax(log["emg.flexor"]))
    assert log["emg.intent"][seen] == Intent.FLEX
    assert log["reference_velocity"][seen] == 0.0
    assert log["reference_velocity"][seen + 1] > 0.0
    led = log["source"] >= Source.LAW_BEGINS
    assert CYCLES <= led.sum() <= CYCLES + 1
    assert log["reference"][led][-1] == 1.0
    assert abs(log["joint"][led][-1] - 1.0) < 0.03
    assert np.isnan(log["emg.onset"][: seen - 1]).all()
    assert log["emg.onset"][seen] == pytest.approx(log["time"][seen], abs=0.002)


@pytest.mark.parametrize("contracts", [300, 1600])
def test_a_lost_stream_releases_and_no_new_motion_begins(tmp_path: Path, contracts: int) -> None:
    ended, log, rows = Rig(tmp_path, contracts, 1500).run()
    assert ended.mode == Mode.LATCHED
    assert ended.faults == 2**Fault.EMG_LOST
    mode = log["mode"]
    released = int(np.argmax(mode == Mode.RELEASING))
    age = log["emg.age"]
    assert age[released] > 0.2 >= age[released - 1]
    assert (log["power"][released:] == 0.0).sum() > 0
    assert np.flatnonzero(log["power"][released:] == 0.0)[0] <= 202
    late = age[:released] > 0.02
    assert (log["emg.intent"][:released][late & (log["source"][:released] >= 2)] != Intent.FLEX).all()
    moving = log["reference_velocity"][:released][late]
    assert contracts == 300 or not moving[np.isfinite(moving)].any()
    found = Recording({}, None, tuple(columns(LAW, emg=True)), (), np.arange(len(rows)), rows, [], Damage(0, 0, 0))
    same = replay(found, LAW, LIMITS, Filters(), 1e-3, same=True)
    assert (same.verdicts_differing, same.wish_largest, same.command_largest) == (0, 0.0, 0.0)


def test_without_a_stream_it_cannot_be_armed_until_there_is_one(tmp_path: Path) -> None:
    ended, log, _ = Rig(tmp_path, 0, 99_999, begins=400).run()
    before = log["time"] - 1.0 < 0.4
    assert (log["mode"][before] == Mode.STOPPED).all()
    assert (log["power"][before] == 0.0).all()
    assert (log["faults"][10:300] == 2**Fault.EMG_LOST).all()
    assert ended.mode == Mode.STOPPED
    assert (log["source"] >= Source.LAW_BEGINS).sum() >= CYCLES
    assert not log["reference"][log["source"] == Source.LAW][1500:].any(), "nobody contracts, nothing moves"
