"""The joint's motion that EMG asks for, for commands that do not run live."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import PeriodicMinimumJerk, Trajectory
from bowden.core.errors import StreamError
from bowden.core.kernel import compiled, kernel
from bowden.hardware.emg.course import CourseSettings, CourseState, course_start, course_step
from bowden.hardware.emg.listener import filters_of, share_of
from bowden.rig.emg_setup import EmgRun, check_recording, columns, levels
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector

Array = NDArray[np.float64]


def placeholder(run: EmgRun) -> Trajectory:
    """The largest motions that EMG can ask for, there and back without a rest: what a law is checked with."""
    intent = run.course.intent
    return PeriodicMinimumJerk(intent.low, intent.high, 2.0 * intent.duration)


def recorded(run: EmgRun, dt: float) -> "EmgMotion | None":
    """The motion of a recording, cycle by cycle of `dt` [s] as the live loop would make it; None where it is a stream.

    Raises:
        StreamError: a recording that cannot be used, or without the channels.
    """
    from bowden.hardware.emg.playback import Playback
    from bowden.identify.emg.log import read_channels

    kind, _, path = run.source.partition(":")
    if kind != "file":
        return None
    check_recording(run)
    stream = Playback(Path(path), run.wanted)
    stream.open()
    flexor, extensor = columns(run, stream)
    found = read_channels(Path(path), stream.channels)
    of = levels(run)
    signal = found.values[:, flexor]
    settings, chain = filters_of(of, run.detector)
    found_by = OnsetDetector(found.rate, settings, run.detector).feed(signal)
    share = share_of(EnvelopeFilter(found.rate, chain).feed(signal).envelope, of)
    trouble, extends = found_by.trouble, np.zeros(len(signal))
    if extensor is not None:
        other = OnsetDetector(found.rate, None, run.detector).feed(found.values[:, extensor])
        trouble, extends = np.maximum(trouble, other.trouble), other.active
    share[trouble > 0.0] = np.nan
    at = np.minimum((np.arange(int(len(signal) / found.rate / dt)) * dt * found.rate).astype(int), len(signal) - 1)
    return EmgMotion(run, found_by.active[at], extends[at], share[at], dt)


class EmgMotion:
    """A `Trajectory` of contractions that are known beforehand; after their end the joint stays.

    Args:
        run: the motions.
        flexor: whether the muscle contracts, in each cycle (n,).
        extensor: the same of the other one (n,).
        share: of MVC, NaN where it is unknown (n,).
        dt: length of a cycle [s].
    """

    def __init__(self, run: EmgRun, flexor: Array, extensor: Array, share: Array, dt: float) -> None:
        if not len(flexor):
            raise StreamError(f"{run.source} has no samples")
        self._source, self._dt = run.source, dt
        self.rows = np.empty((len(flexor), 3))
        start = course_start(run.course.intent.low)
        compiled(_follow)(run.course, start, flexor, extensor, share, dt, self.rows)

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`: as it is in the cycle that begins at or before `time`."""
        at = np.floor(np.asarray(time) / self._dt + 1e-6).astype(int)
        rows = self.rows[np.clip(at, 0, len(self.rows) - 1)]
        rows[at >= len(self.rows), 1:] = 0.0
        return rows

    @property
    def duration(self) -> float:
        """Of the recording [s]."""
        return len(self.rows) * self._dt

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "emg", "source": self._source}


@kernel
def _follow(
    settings: CourseSettings, state: CourseState, flexor: Array, extensor: Array, share: Array, dt: float, rows: Array
) -> None:
    for k in range(len(flexor)):
        state, reference = course_step(settings, state, flexor[k] > 0.5, extensor[k] > 0.5, share[k], dt)
        rows[k, 0], rows[k, 1], rows[k, 2] = reference
