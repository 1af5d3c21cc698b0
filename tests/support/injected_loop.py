"""The live loop on the fault matrix's drive, under the fault matrix's faults: every cycle of both can be compared.

The loop is `bowden.live.loop.Loop` with all its parts; what is simulated is outside it: the drive
(`support.injected_drive`), the clock, the operator, the recorder and the EMG. The run is planned as in the matrix:
armed in the first cycle, and to the law as soon as the drive is enabled.
"""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.core.clock import SECOND
from bowden.core.kernel import compiled
from bowden.core.signals import DriveReading, Reference
from bowden.cycle.one_cycle import HOLD, LAW, LAW_BEGINS, NOWHERE, Cycle, Filters, Plan
from bowden.hardware.ports import Power, TorqueLeft
from bowden.live.loop import Loop, LoopMotor
from bowden.live.ring import RecorderState, Report
from bowden.live.row import AT, columns, description
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.thermal import cold
from bowden.plants.bench import Bench
from bowden.plants.plant import sheath_at
from bowden.safety.state import Mode, Request
from bowden.sim.injected import Injected
from bowden.sim.run import inputs_of
from loop_rig import surroundings
from support.fault_matrix import AFTER, LAST, MEASURED, REFERENCE, begins
from support.injected_drive import drive_moved, drive_read, drive_reading, drive_start, of_plant, settings_of
from support.injection import HOUR, asleep, misled_gains, misled_kernels
from support.supervised import EMG_AGE, OPERATOR_AGE, RECORDED

ENDING = 0.5
"""Time for which there are inputs beyond the matrix's run, in which the loop comes to its end [s]."""
ROWS = 8192
"""Of the ring; no run is as long."""
COLUMNS = ("requested_target", "command", "power", "mode", "reaction", "faults")
"""The log's names of `RECORDED`."""
assert len(COLUMNS) == len(RECORDED)


class LiveRun(NamedTuple):
    """What the live loop made of a run."""

    cycles: NDArray[np.int64]  # (m,) numbers of the cycles that the loop did not miss
    record: NDArray[np.float64]  # (6, m) `COLUMNS`


class Straight:
    """A script without preflight and approach: the law, from the cycle after the supervisor's first that runs."""

    def __init__(self, references: NDArray[np.float64]) -> None:
        self.outcome, self.reason, self.play, self.done = 1.0, 0.0, math.nan, False
        self._references, self._at = references, -1

    def plan(self, mode: float, target: float, reading: DriveReading, cycles: int) -> Plan:
        began = self._at >= 0
        if began or mode == Mode.RUNNING:
            self._at += cycles if began else 1
        if (not began and mode != Mode.RUNNING) or mode not in (Mode.RUNNING, Mode.BRIDGING):
            return Plan(HOLD, target, NOWHERE)
        reference = Reference(*map(float, self._references[:, min(self._at, self._references.shape[1] - 1)]))
        return Plan(LAW if began else LAW_BEGINS, target, reference)


class Emg:
    """A stream whose newest sample is so old; nothing else is said of it."""

    def __init__(self) -> None:
        self.newest = 0.0

    def look(self, now: int) -> float:
        return (now - self.newest) * 1e-9

    def row(self) -> tuple[float, ...]:
        return (math.nan,) * 10


class InjectedLoop:
    """A loop with all that is around it: its drive, its clock, its operator.

    Args:
        folder: for ring and control block.
        bench: of the drive.
        law: by its name in `LAWS`.
        kinds: what is injected.
        seed: of the encoders' noise, and with `onset` of when the faults begin.
        onset: see there.
    """

    def __init__(
        self, folder: Path, bench: Bench, law: str, kinds: tuple[Injected, ...], seed: int, onset: int
    ) -> None:
        injected = tuple(zip(kinds, begins(kinds, seed, onset), strict=True))
        duration = LAST + AFTER
        inputs = inputs_of(bench, REFERENCE, duration + ENDING, constant_bend(bench.sheath.bend), seed)
        self._inputs, self._delay, self._last = inputs, bench.delay, round(duration / bench.sample_time) - 1
        gains = misled_gains(LAWS[law], injected, bench.sample_time)
        self._kinds, self._onsets, self._now = gains.kinds, gains.onsets, gains.now
        limits = {f"gains.{name}": ends for name, ends in LAWS[law].limits.items()}
        units = LAWS[law].state_units
        misled_law = Law(law, gains, *misled_kernels(LAWS[law]), "tests", limits=limits, state_units=units)

        # the drive
        dynamics = bench.dynamics()
        self._settings = settings_of(bench, dynamics)
        self._drive = of_plant(drive_start, dynamics)(self._settings, 0.0, sheath_at(inputs.sheath, 0))
        self._read, self._moved = of_plant(drive_read, dynamics), of_plant(drive_moved, dynamics)
        self._asleep = compiled(asleep)
        self._seen = np.empty((2, len(inputs.time)))
        self._sent: list[tuple[float, float]] = []
        """Target and power of each cycle, of those that the loop missed too."""

        # the clock
        self._period = round(bench.sample_time * SECOND)
        self.time, self._glitch, self._beat = SECOND, 0, SECOND
        self._k, self._cycles, self._ran, self._rested = -1, list[int](), False, 0

        # the loop
        thermal, normals = cold(MEASURED.thermal), np.zeros(inputs.normals.shape[1])
        self._drive, first = of_plant(drive_reading, dynamics)(self._settings, self._drive, normals)
        about = description(columns(misled_law, emg=True), {}, 0, 0)
        self._reader, self._block, writer, words = surroundings(folder, about, ROWS)
        self._emg = Emg()
        cycle = Cycle(misled_law, MEASURED, Filters(), bench.sample_time)
        cycle.begin(first, thermal)
        script: Any = Straight(inputs.references)
        emg: Any = self._emg
        self.loop = Loop((LoopMotor(self, cycle, script, emg),), writer, words, self, 0)

    # the clock

    def now(self) -> int:
        now, self._glitch = self.time + self._glitch, 0
        return now

    def sleep_until(self, deadline: int) -> None:
        """Be woken for the next cycle, late where it is injected; all else lives on meanwhile."""
        self.time, k, missed = max(self.time, deadline), self._k, 0
        if k >= 0:
            asleep_for = [self._asleep(kind, k - onset) for kind, onset in self._faults() if k >= onset]
            missed = max(0, min(max(asleep_for, default=0), self._last - k))
            self._onsets[(self._onsets > k) & (self._onsets <= k + missed)] = k + missed + 1
            self._sent += self._sent[-1:] * missed
            self._seen[:, k + 1 : k + 1 + missed] = self._seen[:, k : k + 1]
            for j in range(k, k + missed + 1):
                reached = self._sent[j - self._delay][0] if j >= self._delay else 0.0
                now, then = sheath_at(self._inputs.sheath, j), sheath_at(self._inputs.sheath, j + 1)
                self._drive = self._moved(self._settings, self._drive, reached, now, then)
        self.time += missed * self._period
        self._k = self._now[0] = k + 1 + missed
        self._cycles.append(self._k)
        self._live(self._k)
        self._ask()

    # the drive

    def read(self, now: float) -> DriveReading:
        before = self._k - max(self._delay, 1)
        power = self._sent[before][1] if before >= 0 else 0.0
        faults = self._inputs.normals, self._kinds, self._onsets, *self._seen
        self._drive, told = self._read(self._settings, self._drive, power, self._k, *faults)
        return told

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        self._sent.append((target, float(power)))

    def bring_up(self) -> str:
        return "the fault matrix's drive"

    def reset_fault(self) -> None:
        pass

    def close(self) -> TorqueLeft:
        return TorqueLeft.OFF

    # what else there is

    def run(self) -> LiveRun:
        """The whole run; with the power off it goes on for twenty cycles."""
        self.loop.run()
        rows, at = self._reader.read()[1], [AT[name] for name in COLUMNS]
        return LiveRun(np.array(self._cycles), rows[:, at].T)

    def _ask(self) -> None:
        row = self._reader.last()
        mode = Mode.STOPPED if row is None else Mode(int(row[AT["mode"]]))
        self._ran |= mode == Mode.RUNNING
        self._rested += self._ran and mode in (Mode.STOPPED, Mode.LATCHED)
        if not self._ran:
            self._block.ask(Request.ARM if self._k == 0 else Request.RUN)
        if self._k > self._last or self._rested > 20:
            self.loop.quit()

    def _faults(self) -> list[tuple[int, int]]:
        return list(zip(self._kinds.tolist(), self._onsets.tolist(), strict=True))

    def _live(self, k: int) -> None:
        since = {Injected(kind): k - onset for kind, onset in self._faults() if k >= onset}
        if since.get(Injected.STOP) == 0:
            self._block.ask(Request.STOP)
        if Injected.OPERATOR_LOST not in since or since[Injected.OPERATOR_LOST] == 0:
            self._beat = self.time - round(OPERATOR_AGE * SECOND)
        self._block.beat(self._beat)
        if Injected.EMG_SILENT not in since or since[Injected.EMG_SILENT] == 0:
            self._emg.newest = self.time - round(EMG_AGE * SECOND)
        if Injected.EMG_TIMELESS in since:
            self._emg.newest = math.nan
        state = RecorderState.FULL if Injected.RECORDER_LOST in since else RecorderState.OK
        self._reader.recorder.write(Report(int(state), self.time, 0, 0, 0, 0))
        if since.get(Injected.CLOCK_BACK) == 0:
            self._glitch = -round(HOUR * SECOND)
        if since.get(Injected.CLOCK_FORWARD) == 0:
            self.time += round(HOUR * SECOND)


def differing(live: LiveRun, matrix: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Cycles in which the live loop's power, mode, reaction or set of faults is another one than the matrix's (m,)."""
    both = live.cycles < matrix.shape[1]
    return np.asarray((live.record[2:, both] != matrix[2:, live.cycles[both]]).any(axis=0))
