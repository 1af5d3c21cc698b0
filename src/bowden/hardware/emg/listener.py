"""From a stream of EMG to what it says: each sample through envelope and detector, as it comes."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND
from bowden.hardware.emg.intent_block import StreamReading
from bowden.hardware.ports import EmgChunk
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import DEFAULTS as CLEANED
from bowden.sensing.envelope import EnvelopeSettings
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector
from bowden.sensing.wearer_file import MuscleCalibration

Array = NDArray[np.float64]


_SAME = 0.1
"""So much of a signal does not come twice by chance [s]."""


def filters_of(wearer: MuscleCalibration | None, detector: Detector = DEFAULT) -> tuple[Any, EnvelopeSettings]:
    """How a wearer's flexor is detected: settings of detector and envelope; the defaults without wearer."""
    if wearer is None:
        return detector.settings, CLEANED
    return detector.of_wearer(wearer.sigma, wearer.mvc), CLEANED._replace(mains_hz=wearer.mains)


def share_of(envelope: Array, wearer: MuscleCalibration | None) -> Array:
    """Envelopes as shares of MVC, 0 at rest (n,) [–]; NaN where the wearer is not known."""
    if wearer is None:
        return np.full(len(envelope), np.nan)
    return (envelope - wearer.rest) / (wearer.mvc - wearer.rest)


class _Repetition:
    """Whether a signal says what it has said within the last second, number for number: a sender whose buffer is stuck.

    No electrode does: even a converter whose count is larger than rest has as much chance in every other sample.
    """

    def __init__(self, rate: float) -> None:
        self._length, self._past = round(_SAME * rate), np.empty(0)
        self._kept = self._length + round(rate)
        self._new, self._found = 0, False

    def feed(self, signal: Array) -> bool:
        """Take samples in (n,); whether the newest `_SAME` of time have come before. What is flat is not meant."""
        past = self._past = np.concatenate([self._past, signal])[-self._kept :]
        self._new += len(signal)
        if self._new >= 0.1 * self._length:  # it is not looked at each sample
            self._new, self._found = 0, self._look(past)
        return self._found

    def _look(self, past: Array) -> bool:
        newest = past[-self._length :]
        if len(past) <= self._length or not newest.min() < newest.max():
            return False
        ends = np.arange(self._length - 1, len(past) - 1)
        for back in (0, 1, 2, self._length // 2, self._length - 1):
            ends = ends[past[ends - back] == past[len(past) - 1 - back]]
        return any(np.array_equal(past[end + 1 - self._length : end + 1], newest) for end in ends)


class _Muscle:
    """One channel through its filters."""

    def __init__(self, column: int, rate: float, settings: Any, chain: EnvelopeSettings, detector: Detector) -> None:
        self.column, self._envelope = column, EnvelopeFilter(rate, chain)
        self._onset = OnsetDetector(rate, settings, detector)
        self._last, self._repetition = math.nan, _Repetition(rate)
        self.active = self.level = self.trouble = 0.0

    def feed(self, values: Array) -> NDArray[np.bool_]:
        """Take samples in; where a contraction begins among them (n,)."""
        signal = values[:, self.column]
        before, detected = self.active, self._onset.feed(signal)
        known = np.isfinite(signal)
        held = np.maximum.accumulate(np.where(known, np.arange(1, len(signal) + 1), 0))
        filled = np.concatenate([[self._last], signal])[held]  # a missing sample: the one before
        self._last = float(filled[-1])
        begun = filled[np.isfinite(filled)]  # the envelope begins at the first sample that came
        if len(begun):
            self.level = float(self._envelope.feed(begun).envelope[-1])
        self.active, self.trouble = float(detected.active[-1]), float(detected.trouble[-1])
        if self._repetition.feed(signal):
            self.trouble = 1.0
        begins: NDArray[np.bool_] = np.diff(detected.active, prepend=before) > 0.5
        return begins


class Listener:
    """All that has come of a stream.

    Args:
        rate: of the stream [Hz].
        flexor: column of the muscle that flexes.
        extensor: column of the one that extends, where there is one.
        wearer: calibration of the flexor; the envelope's share of MVC is unknown without.
        detector: of contractions.
    """

    def __init__(
        self,
        rate: float,
        flexor: int,
        extensor: int | None = None,
        wearer: MuscleCalibration | None = None,
        detector: Detector = DEFAULT,
    ) -> None:
        settings, chain = filters_of(wearer, detector)
        self._flexor = _Muscle(flexor, rate, settings, chain, detector)
        self._extensor = None if extensor is None else _Muscle(extensor, rate, None, chain, detector)
        self._wearer = wearer
        self.reading = StreamReading()

    def take(self, chunk: EmgChunk, now: float) -> StreamReading:
        """Take in what has come by `now` [s]; what the stream says now."""
        count, reading = len(chunk.times), self.reading
        if not count:
            return reading
        begins = self._flexor.feed(chunk.values)
        extends = self._extensor
        if extends is not None:
            begins = begins | extends.feed(chunk.values)
        at = np.flatnonzero(begins)
        onset = reading.onset if not len(at) else round(min(float(chunk.times[at[-1]]), now) * SECOND)
        columns = [muscle.column for muscle in self._muscles()]
        missing = ~np.isfinite(chunk.values[:, columns]).all(axis=1)
        came = np.flatnonzero(~missing)
        newest = round(min(float(chunk.times[came[-1]]), now) * SECOND) if len(came) else reading.newest
        self.reading = StreamReading(
            max(newest, reading.newest),
            onset,
            reading.samples + count,
            reading.lost + int(missing.sum()),
            reading.ends,
            reading.looked,
            self._flexor.active,
            0.0 if extends is None else extends.active,
            float(share_of(np.array([self._flexor.level]), self._wearer)[0]),
            self._flexor.level,
            max(muscle.trouble for muscle in self._muscles()),
        )
        return self.reading

    def _muscles(self) -> list[_Muscle]:
        return [self._flexor, *([] if self._extensor is None else [self._extensor])]
