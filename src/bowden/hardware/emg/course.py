"""Where the joint should be in a run by EMG: what the stream says, turned into a reference within the cycle."""

import math

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND
from bowden.core.kernel import compiled, kernel
from bowden.core.nested import flat, unflatten
from bowden.core.signals import Reference
from bowden.hardware.emg.intent_block import EmgLoss, IntentReader, StreamReading
from bowden.sensing.course import CourseSettings, course_start, course_step

Array = NDArray[np.float64]

COLUMNS = {
    "emg.age": "s",
    "emg.flexor": "1",
    "emg.extensor": "1",
    "emg.share": "1",
    "emg.level": "1",
    "emg.trouble": "1",
    "emg.onset": "s",
    "emg.samples": "1",
    "emg.lost": "1",
    "emg.intent": "1",
    "emg.loss": "1",
}
"""Column → unit of what a run by EMG records beside the rest; `level` is in the stream's unit."""


_BEFORE = SECOND // 2
"""A run by a recording ends this long before it, so that the end of a recording is no lost stream [ns]."""


TROUBLED = SECOND
"""A signal in trouble away from rest for longer than this is lost: nobody could ask for the way back [ns]."""
_AT_REST = 1e-3
"""So near to the extended joint a reference is at rest [rad]."""


_DEFAULTS = CourseSettings()


@kernel
def _in_place(settings: Array, memory: Array, flexes: bool, extends: bool, share: float, dt: float) -> None:
    """`course_step` on a state that is kept flat, and the reference behind it.

    Settings and states as tuples would cost 30 µs a cycle to hand over.
    """
    given, before = unflatten(_DEFAULTS, settings), unflatten(course_start(0.0), memory)
    state, reference = course_step(given, before, flexes, extends, share, dt)
    numbers = flat((state, reference))
    for i in range(len(numbers)):
        memory[i] = numbers[i]


class EmgCourse:
    """The reference of a run by EMG.

    Args:
        settings: of the motions.
        reader: of what the stream says.
        start: the monotonic clock where the run's column ``time`` is zero [ns].
        cycles: of the run.
        patience: how long the process that reads the stream may not have looked for samples [s].
    """

    def __init__(
        self, settings: CourseSettings, reader: IntentReader, start: int, cycles: int, patience: float
    ) -> None:
        self.cycles, self._patience = cycles, round(patience * SECOND)
        self._low, self._reader, self._start = settings.intent.low, reader, start
        self._settings, numbers = np.array(flat(settings)), len(flat(course_start(0.0)))
        self._memory = np.zeros(numbers + len(Reference._fields))
        self._mode = self._memory[:1].data
        self._reference = self._memory[numbers:].data
        self._step = compiled(_in_place)
        self._latest, self._age, self._good = StreamReading(), math.inf, 0
        self._loss = EmgLoss.NONE
        self.over = False
        """True if a recording is about to end, and the run with it."""
        self.begin()
        self.step(0.001)  # compiles
        self.begin()

    def look(self, now: int) -> float:
        """Take in what the stream says at `now` [ns]; how long ago its newest sample was taken [s].

        Where nobody looks for samples any more the newest is infinitely old: a reader that is gone is known sooner than
        a stream that pauses.
        Samples of dead electrodes come as fresh as any. Where the reference is away from rest and a signal has been in
        trouble for longer than `TROUBLED`, what counts is the newest sample without.
        """
        latest = self._latest = self._reader.read()
        looked = now - latest.looked <= self._patience
        self._age = (now - latest.newest) * 1e-9 if looked and latest.newest else math.inf
        if latest.trouble == 0.0 or self._reference[0] <= self._low + _AT_REST:
            self._good = now
        if now - self._good > TROUBLED:
            self._age = max(self._age, (now - self._good) * 1e-9)
        if not looked:
            self._loss = EmgLoss.READER
        elif now - latest.newest > self._patience:
            self._loss = EmgLoss.STREAM
        elif now - self._good > TROUBLED:
            self._loss = EmgLoss.DEAD if latest.trouble == 1.0 else EmgLoss.NOISY
        self.over = 0 < latest.ends < now + _BEFORE
        if self.over:
            self._age = 0.0  # nothing follows the stream any more: the way home takes longer than what is left of it
        return self._age

    def begin(self) -> None:
        """Be at rest where the joint is extended; a contraction that is on is none that begins."""
        start, latest = course_start(self._low), self._latest
        start = start._replace(intent=start.intent._replace(flexor=latest.flexor, extensor=latest.extensor))
        self._memory[:] = flat((start, start.followed))

    def step(self, dt: float) -> Reference:
        """The reference of this cycle, `dt` [s] after the one before."""
        latest = self._latest
        share = math.nan if latest.trouble > 0.0 else latest.share
        self._step(self._settings, self._memory, latest.flexor > 0.5, latest.extensor > 0.5, share, dt)
        return Reference(*self._reference)

    def row(self) -> tuple[float, ...]:
        """The values of `COLUMNS` in this cycle."""
        latest = self._latest
        onset = (latest.onset - self._start) * 1e-9 if latest.onset else math.nan
        return (
            *(self._age, latest.flexor, latest.extensor, latest.share, latest.level, latest.trouble, onset),
            *(latest.samples, latest.lost, self._mode[0], self._loss),
        )
