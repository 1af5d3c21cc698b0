"""How well contractions were found in a recording: against labels, and beside the paper's plain threshold."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.identify.emg.detector_score import DetectorScore
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import DEFAULTS as CLEANED
from bowden.sensing.envelope import PLAIN_THRESHOLD, EnvelopeSettings
from bowden.sensing.stream import Detected, EnvelopeFilter, OnsetDetector

Array = NDArray[np.float64]
Spans = list[tuple[float, float]]
"""Onset and end of contractions, in order [s]."""

PAPERS = EnvelopeSettings(offset_hz=1.0, mains_hz=0.0)
"""The paper's chain: offset, rectification, 8 Hz; it names no filter for the mains."""
EARLY = 0.3
"""A detection may begin this long before the label of its contraction: labels are made by eye [s]."""


@dataclass(frozen=True)
class Findings:
    """What was found in one recording."""

    found: Spans
    """By our detector."""
    plain: Spans
    """By the plain threshold."""
    detected: Detected
    envelope: Array
    """That the plain threshold looks at, in the signal's unit (n,)."""
    mvc: float
    """Envelope that counts as a maximum voluntary contraction, in the signal's unit."""
    score: DetectorScore
    plain_score: DetectorScore


def spans(active: Array, rate: float) -> Spans:
    """Onset and end of every stretch in which `active` is 1, of samples from time 0 on.

    >>> spans(np.array([0.0, 1.0, 1.0, 0.0, 1.0]), 10.0)
    [(0.1, 0.3), (0.4, 0.5)]
    """
    edges = np.flatnonzero(np.diff(active > 0.5, prepend=False, append=False))
    return [(float(first) / rate, float(end) / rate) for first, end in edges.reshape(-1, 2)]


def score(
    found: Spans, labels: Sequence[tuple[float, float]] | None, duration: float, shortest: float = 0.0
) -> DetectorScore:
    """Set detections against labels.

    A contraction's detection is the first one whose contraction begins between `EARLY` before the label's onset and its
    end; it is reported later by `shortest`, which may be after the end.

    Args:
        found: detections, from when they are reported.
        labels: contractions; None where there are no labels, empty where there are no contractions.
        duration: of the recording [s].
        shortest: contractions that are shorter are left out, and all others are reported this much later [s].
    """
    if labels is None:
        return DetectorScore(len(found), *[None] * 6)
    taken: set[int] = set()
    latencies, rejected = [], 0
    for onset, end in labels:
        begins = (i for i, (on, _) in enumerate(found) if onset - EARLY <= on - shortest < end and i not in taken)
        first = next(begins, None)
        if first is not None:
            taken.add(first)
            latencies.append(found[first][0] - onset)
        elif end - onset < shortest:
            rejected += 1
    false = len(found) - len(taken)
    return DetectorScore(
        len(found),
        len(labels) - len(taken) - rejected,
        rejected,
        false,
        float(np.median(latencies)) if latencies else None,
        max(latencies) if latencies else None,
        60.0 * false / duration,
    )


def find(
    values: Array,
    rate: float,
    labels: Sequence[tuple[float, float]] | None = None,
    mvc: float | None = None,
    settings: Any = None,
    mains: float = CLEANED.mains_hz,
    detector: Detector = DEFAULT,
) -> Findings:
    """Find contractions, causally, with the detector and with the plain threshold.

    Args:
        values: the signal in any unit, finite (n,).
        rate: samples a second [Hz].
        labels: contractions as they are known [s].
        mvc: of `bowden.identify.emg.levels`, with whose envelope the plain threshold then goes; where it is not given,
            with the paper's and its largest.
        settings: the detector's; its own by default.
        mains: taken out of the envelope that is compared with `mvc` [Hz].
        detector: which.
    """
    settings = detector.settings if settings is None else settings
    detected = OnsetDetector(rate, settings, detector).feed(values)
    envelope = EnvelopeFilter(rate, PAPERS if mvc is None else CLEANED._replace(mains_hz=mains)).feed(values).envelope
    most = float(envelope.max()) if mvc is None else mvc
    found, plain = spans(detected.active, rate), spans(np.where(envelope > PLAIN_THRESHOLD * most, 1.0, 0.0), rate)
    duration = len(values) / rate
    ours = score(found, labels, duration, settings.shortest)
    return Findings(found, plain, detected, envelope, most, ours, score(plain, labels, duration))
