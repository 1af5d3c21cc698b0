"""A run by EMG on a clock of the tests', whose stream comes through the client of LSL from an inlet in memory."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.core.clock import SECOND
from bowden.hardware.emg import intent_block
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.emg.intent_block import IntentReader, IntentWriter
from bowden.hardware.emg.listener import Listener
from bowden.hardware.emg.lsl import LslStream, _Block
from bowden.hardware.emg.sample_times import SampleTimes
from bowden.hardware.twin.plant import OFF
from bowden.live.preflight import Preflight
from bowden.live.script import Script
from bowden.safety.faults import of
from bowden.safety.limits import Limits
from bowden.sensing.course import CourseSettings
from bowden.sensing.intent import IntentSettings
from loop_rig import LoopRig, twin_bench
from support.simulated_drive import SimulatedDrive

RATE = 1000.0
"""Of the stream [Hz]."""
CONTRACTS = 3.0
"""When the muscle contracts, from the signal's beginning on; the law has the motor by then [s]."""
BREAKS = 3.3
"""When stamps jump, or nothing more comes [s]."""
_LOOK = 10
"""Cycles from one look at the stream to the next."""


def contraction(ends: bool) -> NDArray[np.float64]:
    """Rest, and a contraction that lasts to the signal's end, or for a second [mV] (n,)."""
    time = np.arange(round(RATE * (BREAKS if ends else 8.0))) / RATE
    active = (time >= CONTRACTS) & (ends | (time < CONTRACTS + 1.0))
    signal: NDArray[np.float64] = np.random.default_rng(1).normal(0.0, np.where(active, 0.3, 0.005))
    return signal


class Inlet:
    """What pylsl's inlet does, of a signal that begins at `began`; from `BREAKS` on stamps are off by `jumps` [s]."""

    def __init__(self, signal: NDArray[np.float64], began: float, jumps: float) -> None:
        self._signal, self._began, self._jumps, self._given = signal, began, jumps, 0
        self.now = began

    def pull_chunk(self, timeout: float, *, max_samples: int, as_numpy: bool) -> tuple[Any, Any]:
        due = min(len(self._signal), round(RATE * (self.now - self._began)))
        at = np.arange(self._given, due) / RATE
        values, self._given = self._signal[self._given : due, None], due
        return values, self._began + at + np.where(at >= BREAKS, self._jumps, 0.0)

    def time_correction(self, timeout: float) -> float:
        return 0.0


def react_by_emg(folder: Path, *, jumps: float = 0.0, ends: bool = False) -> tuple[tuple[str, ...], float, float]:
    """Faults that stop the run, when, and when there is no torque any more [ms] after `BREAKS`."""
    intent_block.create(folder / "intent")
    writer, listener, plant = IntentWriter(folder / "intent"), Listener(RATE, 0), twin_bench()
    inlet, last = Inlet(contraction(ends), 1.0, jumps), [0.0]
    stream = LslStream("emg")
    stream.rate, stream.channels, stream._inlet, stream._most = RATE, ("flexor",), inlet, 100.0
    stream._times, stream._block = SampleTimes(RATE), _Block(rate=RATE)

    def between(rig: LoopRig) -> None:
        inlet.now = rig.time / SECOND
        if rig.sleeps % _LOOK == 0:
            listener.take(stream.read(inlet.now), inlet.now)
        writer.write(listener.reading._replace(looked=rig.time))
        if plant.doing != OFF:
            last[0] = inlet.now
        if inlet.now > 1.0 + BREAKS + 0.6:
            rig.block.quit()

    course = EmgCourse(CourseSettings(IntentSettings(0.0, 1.0, 1.0)), IntentReader(folder / "intent"), 0, 10_000, 0.04)
    script = Script(np.zeros((1, 3)), 0.0, 0.5, Preflight(), 1e-3, course)
    drive = SimulatedDrive(plant)
    run = LoopRig(
        folder, LAWS["adaptive"], Limits(uses_emg=True), drive, script, between, arms=(500,), quits=1e9, course=course
    )
    _, rows = run.run()
    broke = 1.0 + BREAKS
    first = int(np.flatnonzero(rows["reaction"] > 1.5)[0])
    assert rows["emg.flexor"][first - 250 : first].max() == 1.0, "in a contraction"
    stops = 1e3 * (float(rows["time"][first]) - broke)
    return tuple(fault.name for fault in of(rows["faults"][first])), stops, 1e3 * (last[0] - broke)
