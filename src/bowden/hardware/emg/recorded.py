"""A rig's run by EMG on its stream: which channels, whose levels; and the motion of a recording."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import StreamError
from bowden.core.kernel import compiled, kernel
from bowden.hardware.emg.listener import filters_of, share_of
from bowden.hardware.emg.lsl_info import check_wanted
from bowden.hardware.emg.sources import Playback
from bowden.hardware.ports import EmgStream
from bowden.identify.emg.log import read_channels
from bowden.rig.emg_run import EmgRun, check_recording
from bowden.sensing.course import CourseSettings, CourseState, course_start, course_step
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector

Array = NDArray[np.float64]
_UNIT = re.compile(r"[_\s(\[]+([mµu]?V)[)\]]?$")
"""At the end of a channel's name."""


def recorded(run: EmgRun, dt: float) -> "EmgMotion | None":
    """The motion of a recording, cycle by cycle of `dt` [s] as the live loop would make it; None where it is a stream.

    Raises:
        StreamError: a recording that cannot be used, or without the channels.
    """
    kind, _, path = run.source.partition(":")
    if kind != "file":
        return None
    check_recording(run)
    stream = Playback(Path(path), run.wanted)
    stream.open()
    flexor, extensor = columns(run, stream)
    found = read_channels(Path(path), stream.channels)
    signal = found.values[:, flexor]
    settings, chain = filters_of(run.wearer, run.detector)
    found_by = OnsetDetector(found.rate, settings, run.detector).feed(signal)
    share = share_of(EnvelopeFilter(found.rate, chain).feed(signal).envelope, run.wearer)
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
        self.content = self.rows.tobytes()
        """What distinguishes it from other motions."""

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


def columns(run: EmgRun, stream: EmgStream) -> tuple[int, int | None]:
    """Where flexor and extensor are among an open stream's channels.

    Raises:
        StreamError: a channel is missing, or the flexor is none that the wearer was measured with.
    """
    names = stream.channels
    check_wanted(names, run.wanted, run.source)
    others = [i for i, name in enumerate(names) if name != run.extensor]
    if not others:
        raise StreamError(f"{run.source} has no channel beside the extensor {run.extensor!r}")
    flexor = others[0] if run.flexor is None else names.index(run.flexor)
    if run.wearer is not None:
        _check_wearer(run, names[flexor], stream.unit)
    return flexor, None if run.extensor is None else names.index(run.extensor)


def _check_wearer(run: EmgRun, channel: str, unit: str) -> None:
    assert run.wearer is not None
    measured, ours = _parts(run.wearer.channel), _parts(channel, unit)
    if measured != ours:
        raise StreamError(
            f"{run.where} was measured on {measured[0]!r} in {measured[1] or 'no unit'}, and {run.source} has "
            f"{ours[0]!r} in {ours[1] or 'no unit'}",
            do="run bowden emg calibrate on this channel, or name another one as emg.flexor",
        )


def _parts(channel: str, unit: str = "") -> tuple[str, str]:
    """A channel's plain name and its unit."""
    named = _UNIT.search(channel)
    unit = (named[1] if named else unit).replace("u", "µ")
    return (channel[: named.start()] if named else channel), unit
