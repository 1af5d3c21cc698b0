"""`emg score`: how well contractions are found in a recording."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bowden.identify.emg.detector_score import DetectorScore
from bowden.operations.support.operation import Operation, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.design.contractions import Contractions, Recording
    from bowden.sensing.wearer_file import MuscleCalibration

LONGEST = 5.0
"""Contractions up to this long can be left out [s]."""


@dataclass(frozen=True)
class EmgScore(DetectorScore, Result["Contractions"]):
    """The contractions in a recording, against labels."""

    plain_threshold: DetectorScore
    """The same for the paper's threshold at 20 % of MVC."""
    contractions_s: tuple[tuple[float, ...], ...]
    """Onset and end of each, in the recording's time."""
    duration_s: float
    """Duration of the recording."""
    rate_hz: float
    """Samples a second."""
    channel: str
    """Column of the signal."""
    mvc: float
    """Envelope that counts as maximum voluntary contraction, in the channel's unit."""
    mvc_from: str
    """Where it is from."""
    shortest_ms: float
    """Contractions shorter than this are left out; all others are reported this much later."""
    trouble_s: float
    """Time with movement, mains or a dead electrode."""
    warnings: tuple[str, ...]
    """What was mended or guessed."""
    _: KW_ONLY
    made: "Contractions"


def emg_score(
    recording: Annotated["Recording", Switch(Path)],
    *,
    labels: Annotated["str | Path | Sequence[tuple[float, float]] | None", Switch(Path)] = None,
    wearer: Annotated["str | Path | MuscleCalibration | None", Switch(Path)] = None,
    channel: str | None = None,
    rate: float | None = None,
    detector: str = "onset",
    shortest_ms: float = 0.0,
) -> EmgScore:
    """Measure how well contractions are found in a recording: misses, false ones, latency.

    Beside our detector stands the paper's plain threshold: the envelope above 20 % of MVC, which is the largest
    envelope of the recording where no `wearer` is given.

    Args:
        recording: CSV, csv.gz, NPZ or Parquet with time_s and one or more channels; in Python also the samples of one
            channel (n,), with their rate.
        labels: CSV of contractions: onset_s, offset_s, or start, end; also in ms. In Python also pairs of onset and end
            in the recording's time [s].
        wearer: of ``bowden emg calibrate``: rest and MVC; in Python also what `emg_calibrate` returned.
        channel: column of the signal; the first one by default.
        rate: samples a second, where the recording has no times, or to check those it has.
        detector: what finds contractions in the signal.
        shortest_ms: leave out contractions shorter than this; all others are reported this much later.

    Returns:
        ``spans``, onset and end of each contraction; ``score`` against the labels; ``plot()``.

    Raises:
        LogError: a recording or labels that cannot be used.
        ParameterError: arguments of the wrong kind.

    Examples:
        bowden emg score biceps.csv
        bowden emg score biceps.csv --labels biceps.labels.csv --json

    >>> import bowden
    >>> import numpy as np
    >>> random = np.random.default_rng(0)
    >>> time = np.arange(8000) / 1000.0
    >>> size = np.where((time > 3.0) & (time < 5.0), 0.1, 0.005)
    >>> found = bowden.emg_score(size * random.normal(size=8000), rate=1000.0, labels=[(3.0, 5.0)])
    >>> len(found.spans), found.score.misses, found.score.false_activations
    (1, 0, 0)
    """
    from bowden.design.contractions import recording_of, scored
    from bowden.operations.support.given import check_number
    from bowden.sensing.detectors import detector_named

    shortest = 1e-3 * check_number("shortest_ms", shortest_ms, 0.0, 1e3 * LONGEST)
    kind = detector_named(detector)
    log = recording_of(recording, channel, rate, "emg_score")
    whole = scored(log, labels=labels, wearer=wearer, kind=kind, shortest=shortest)
    log, known = whole.log, isinstance(wearer, str | Path)
    return EmgScore(
        **vars(whole.score),
        plain_threshold=whole.plain_score,
        contractions_s=tuple((float(onset), float(end)) for onset, end in whole.spans),
        duration_s=len(log.values) / log.rate,
        rate_hz=log.rate,
        channel=log.channel,
        mvc=whole.findings.mvc,
        mvc_from=str(wearer) if known else "what emg_calibrate returned" if wearer else _LARGEST,
        shortest_ms=shortest_ms,
        trouble_s=whole.trouble,
        warnings=tuple(log.warnings),
        notes=tuple(log.warnings),
        needless=tuple(log.warnings),
        made=whole,
    )


_LARGEST = "the largest contraction of this recording"

GROUP = "Detect contractions in EMG, calibrate a wearer, play recordings as streams."
OPERATIONS = (Operation("emg score", emg_score, 20),)
