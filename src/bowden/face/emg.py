"""`emg_calibrate` and `emg_score`: a wearer's levels, and the contractions in a recording of EMG."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bowden.core import arguments
from bowden.core.errors import LogError, ParameterError
from bowden.drawing import shown
from bowden.face import given
from bowden.identify.emg.levels import EnvelopeLevels, check_contraction, envelope_levels
from bowden.identify.emg.log import EmgLog, channel_unit, checked_emg, read_emg, read_labels
from bowden.identify.emg.score import Findings, Score, Spans, find, spans
from bowden.rig import wearer_file
from bowden.rig.wearer_file import MuscleCalibration
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import detector_named
from bowden.sensing.stream import OnsetDetector

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Recording = str | Path | EmgLog | ArrayLike
"""The path of a recording, or the samples of one channel (n,)."""
LONGEST = 5.0
"""Contractions up to this long can be left out [s]."""
_MOST_SPANS = 5
"""Contractions that a warning lists."""
_MUCH = 1.0
"""What is left out of a recording is a warning from here on; the end of a strong contraction has less of it [s]."""


@dataclass(frozen=True, repr=False)
class Contractions:
    """The contractions that were found in one channel of a recording."""

    log: EmgLog = field(compare=False)
    """The channel."""
    labels: Spans | None
    """Onset and end of the contractions as they are known, in the recording's time [s]; None without labels."""
    findings: Findings = field(compare=False)
    """What the detector and the plain threshold found, in time from the first sample."""
    shortest: float
    """Contractions that are shorter are left out [s]."""
    mvc_from: str
    """Where the maximum contraction of the plain threshold comes from."""
    units_differ: str = ""
    """What is wrong where the wearer was measured in another unit; empty where not."""

    @property
    def spans(self) -> Spans:
        """Onset and end of each contraction that the detector found, in the recording's time [s]."""
        return [(self.log.start + onset, self.log.start + end) for onset, end in self.findings.found]

    @property
    def score(self) -> Score:
        """The detector against the labels."""
        return self.findings.score

    @property
    def plain_score(self) -> Score:
        """The plain threshold of 20 % MVC against the labels."""
        return self.findings.plain_score

    @property
    def trouble(self) -> float:
        """Time of movement, mains or a dead electrode, in which nothing can be detected [s]."""
        return float((self.findings.detected.trouble > 0.5).sum()) / self.log.rate

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw the signal, its envelope, and what was found over time.

        Args:
            axes: matplotlib's, three; a new figure is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than three axes.
        """
        from bowden.report.emg_page import draw_signal

        found = shown.axes_for(axes, 3, 1, 7.0, 5.2)
        if len(found) != 3:
            raise ParameterError(f"plot: axes are {len(found)}", expected="three", do="leave them out for new ones")
        draw_signal(found, self.log, self.labels, self.findings)
        return found

    def __repr__(self) -> str:
        """One screen: how many contractions, misses, false activations and latency."""
        return shown.screen(self._title(), self._rows())

    def _repr_html_(self) -> str:
        from bowden.report.emg_page import signal_figure

        figure = signal_figure(self.log, self.labels, self.findings)
        return shown.fragment(self._title(), self._rows(), figure)

    def _title(self) -> str:
        return f"{len(self.spans)} contractions in {self.log.channel}"

    def _rows(self) -> list[tuple[str, str]]:
        lasting = f"{len(self.log.values) / self.log.rate:.4g} s at {self.log.rate:.4g} Hz"
        trouble = f"{self.trouble:.1f} s of movement, mains or a dead electrode" if self.trouble >= 0.05 else ""
        return [
            ("recording", lasting),
            ("detector", _in_words(self.score)),
            ("plain threshold", f"{_in_words(self.plain_score)}; 20 % of the maximum of {self.mvc_from}"),
            ("no detection in", trouble),
            *(("note", warning) for warning in self.log.warnings),
        ]


def _in_words(score: Score) -> str:
    def milliseconds(seconds: float | None) -> str:
        return "" if seconds is None else f"{1e3 * seconds:.0f} ms"

    latency = milliseconds(score.latency_median_s)
    return shown.listed(
        (
            f"{score.detections} found",
            "" if score.misses is None else f"{score.misses} missed",
            f"{score.rejected} left out as too short" if score.rejected else "",
            "" if score.false_activations is None else f"{score.false_activations} false",
            f"latency {latency} in the median, {milliseconds(score.latency_max_s)} at worst" if latency else "",
        )
    )


def emg_score(
    recording: Recording,
    *,
    labels: "str | Path | Sequence[tuple[float, float]] | None" = None,
    wearer: str | Path | MuscleCalibration | None = None,
    channel: str | None = None,
    rate: float | None = None,
    detector: str = "onset",
    shortest: float = 0.0,
) -> Contractions:
    """Find the contractions in a recording, as a live run finds them, and compare them with labels.

    Args:
        recording: path of a CSV (.gz), NPZ or Parquet file, or the samples of one channel (n,), with their rate.
        labels: the contractions as they are known: the path of a CSV (``onset_s,offset_s``), or pairs of onset and end
            in the recording's time [s].
        wearer: what `emg_calibrate` returned, or the path of its file.
        channel: name of the channel; of a file the first one where it is not given.
        rate: samples a second [Hz].
        detector: which one finds the contractions.
        shortest: leave out contractions that are shorter; all others are then reported this much later [s].

    Returns:
        ``spans``, onset and end of each contraction; ``score`` against the labels; ``plot()``.

    Raises:
        LogError: a recording or labels that cannot be used.
        ParameterError: arguments of the wrong kind.

    >>> import numpy as np
    >>> random = np.random.default_rng(0)
    >>> time = np.arange(8000) / 1000.0
    >>> size = np.where((time > 3.0) & (time < 5.0), 0.1, 0.005)
    >>> found = emg_score(size * random.normal(size=8000), rate=1000.0, labels=[(3.0, 5.0)])
    >>> len(found.spans), found.score.misses, found.score.false_activations
    (1, 0, 0)
    """
    with given.in_words_of_python():
        found = scored(
            _recording(recording, channel, rate, "emg_score"),
            labels=labels,
            wearer=wearer,
            kind=detector_named(arguments.text(detector, "emg_score: detector", "the name of a detector")),
            shortest=arguments.number(shortest, "emg_score: shortest", f"seconds, from 0 to {LONGEST:g}"),
        )
    given.tell(found.log.warnings)
    return found


def scored(
    log: EmgLog,
    *,
    labels: "str | Path | Sequence[tuple[float, float]] | None",
    wearer: str | Path | MuscleCalibration | None,
    kind: Detector,
    shortest: float,
) -> Contractions:
    """The contractions in a channel that was read; see `emg_score`.

    Raises:
        LogError: labels that do not belong to the recording.
        ParameterError: a wearer's file or labels that cannot be used.
    """
    if not 0.0 <= shortest <= LONGEST:
        raise ParameterError(
            f"shortest is {shortest:g} s", expected=f"a number from 0 to {LONGEST:g}", do="leave it out for all"
        )
    known = read_labels(Path(labels)) if isinstance(labels, str | Path) else _spans(labels)
    _check_labels(known, log, f"{labels}: labels" if isinstance(labels, str | Path) else "labels")
    of, where = (wearer_file.read(Path(wearer)), str(wearer)) if isinstance(wearer, str | Path) else (wearer, "wearer")
    if of is not None and not isinstance(of, MuscleCalibration):
        raise ParameterError(
            f"wearer is {arguments.said(of)}",
            expected="what emg_calibrate returns, or its file",
            do="call emg_calibrate first, or leave it out",
        )
    other = of is not None and of.channel != log.channel
    here, there = channel_unit(log.channel), "" if of is None else channel_unit(of.channel)
    differ = ""
    if here and there and here != there:
        differ = (
            f"UNITS DIFFER: {where} was measured in {there}, and {log.channel!r} is in {here}: its MVC and the plain "
            f"threshold are wrong here; calibrate on a recording in {here}"
        )
        log = replace(log, warnings=(*log.warnings, differ))
    elif of is not None and other:
        note = (
            f"{where} was measured on {of.channel!r}, and this is {log.channel!r}: is its MVC of this muscle and unit?"
        )
        log = replace(log, warnings=(*log.warnings, note))
    if of is not None and not of.sigma:
        log = replace(log, warnings=(*log.warnings, f"{where} was {wearer_file.EARLIER}"))
    moved = None if known is None else [(onset - log.start, end - log.start) for onset, end in known]
    settings = kind.settings if of is None or other else kind.of_wearer(of.sigma)
    mvc, mains = (None, 0.0) if of is None else (of.mvc, of.mains)
    findings = find(log.values, log.rate, moved, mvc, settings._replace(shortest=shortest), mains, kind)
    source = "this recording" if of is None else where
    return Contractions(log, known, findings, shortest, source, differ)


def emg_calibrate(
    recording: Recording,
    rest: Recording | None = None,
    *,
    channel: str | None = None,
    rate: float | None = None,
    mains: float = 50.0,
    detector: str = "onset",
) -> MuscleCalibration:
    """Measure a wearer's rest and maximum voluntary contraction (MVC) in recordings.

    Args:
        recording: path of a CSV (.gz), NPZ or Parquet file, or the samples of one channel (n,), with their rate:
            rest, and a contraction as hard as possible.
        rest: a recording of rest alone; the calmest tenth of `recording` where it is not given.
        channel: name of the channel; of a file the first one where it is not given.
        rate: samples a second [Hz].
        mains: hum to take out of the envelope: 50 or 60 Hz; 0 for none.
        detector: which one says what is movement, mains or a dead electrode.

    Returns:
        ``rest`` and ``mvc``, envelopes in the recording's unit; ``write("wearer.toml")`` keeps them, and
        ``rig.with_emg(source, wearer)`` uses them.

    Raises:
        LogError: a recording that cannot be used, or has no contraction in it.
        ParameterError: arguments of the wrong kind.

    >>> import numpy as np
    >>> random = np.random.default_rng(0)
    >>> time = np.arange(8000) / 1000.0
    >>> size = np.where((time > 3.0) & (time < 6.0), 0.2, 0.005)
    >>> wearer = emg_calibrate(size * random.normal(size=8000), rate=1000.0)
    >>> wearer.mvc > 20.0 * wearer.rest
    True
    """
    with given.in_words_of_python():
        kind = detector_named(arguments.text(detector, "emg_calibrate: detector", "the name of a detector"))
        hum = arguments.number(mains, "emg_calibrate: mains", "50, 60, or 0 for none")
        wearer_file.check_mains(hum, "mains")
        log = _recording(recording, channel, rate, "emg_calibrate")
        calm = None if rest is None else _recording(rest, None if channel is None else log.channel, rate, "rest")
        wearer, left_out, odd = calibrated(log, calm, hum, kind)
    notes = [*log.warnings, *(() if calm is None else calm.warnings)]
    given.tell([*notes, *odd, *(note for note, seconds in left_out.items() if seconds >= _MUCH)])
    return wearer


def calibrated(
    log: EmgLog, rest: EmgLog | None, mains: float, kind: Detector
) -> tuple[MuscleCalibration, dict[str, float], list[str]]:
    """A wearer's levels from channels that were read, the note on what was left out → how much [s], and warnings.

    Raises:
        LogError: too little is left of a recording, or there is no contraction in it.
    """
    read: list[tuple[EmgLog, EnvelopeLevels]] = []
    for one in (log, rest):
        if one is not None:
            read.append((one, envelope_levels(one.values, one.rate, one.name, mains, kind)))
    levels, calm = read[0][1], read[-1][1]
    low = levels.low if rest is None else calm.middle
    check_contraction(levels, low, log.name)
    source = " and ".join(Path(one.name).name for one, _ in read)
    wearer = MuscleCalibration(low, levels.high, log.channel, source, calm.sigma, mains)
    notes = {note_left_out(found.left_out, one.name): found.left_out for one, found in read if found.left_out >= 0.05}
    return wearer_file.check(wearer, source), notes, [] if rest is None else _rest_warnings(rest, log, kind)


def _rest_warnings(rest: EmgLog, log: EmgLog, kind: Detector) -> list[str]:
    """What is odd about a recording of rest: contractions in it, or another unit than the other recording's."""
    found = [(rest.start + on, rest.start + off) for on, off in _contractions(rest, kind)]
    warnings = []
    if found:
        listed = ", ".join(f"{on:.1f} to {off:.1f} s" for on, off in found[:_MOST_SPANS])
        more = f" and {len(found) - _MOST_SPANS} more" if len(found) > _MOST_SPANS else ""
        warnings.append(
            f"REST HAS CONTRACTIONS: {rest.name} from {listed}{more}; its rest is too high for what the detector "
            "compares with it: record rest again, or leave --rest (rest=) out"
        )
    here, there = channel_unit(log.channel), channel_unit(rest.channel)
    if here and there and here != there:
        warnings.append(f"UNITS DIFFER: {rest.name} is in {there}, and {log.name} in {here}")
    return warnings


def _contractions(log: EmgLog, kind: Detector) -> Spans:
    """Contractions that the detector finds, from the first sample on [s]."""
    return spans(OnsetDetector(log.rate, None, kind).feed(log.values).active, log.rate)


def note_left_out(seconds: float, where: str) -> str:
    """What is said of the parts of a recording that were not used."""
    return f"{where}: {seconds:.1f} s of dead electrode, movement, mains or clicks are left out"


def _recording(recording: Any, channel: str | None, rate: float | None, function: str) -> EmgLog:
    """One channel of what was given as a recording.

    Raises:
        LogError: a file, or signals, that cannot be used.
        ParameterError: something else, or samples without their rate.
    """
    if channel is not None:
        arguments.text(channel, f"{function}: channel", "the name of a channel")
    if rate is not None:
        rate = arguments.number(rate, f"{function}: rate", "samples a second, such as 1000")
        if not 0.0 < rate < 1e6:
            raise ParameterError(f"rate is {rate:g}", expected="samples a second, such as 1000", do="correct it")
    if isinstance(recording, EmgLog):
        return recording
    if isinstance(recording, str | Path):
        return read_emg(Path(recording), channel, rate)
    values = arguments.signal(recording, f"{function}: recording")
    if rate is None:
        raise ParameterError(
            f"{function}: the samples have no rate", expected="samples a second", do="give it: for example rate=1000.0"
        )
    return checked_emg(values, rate, channel or "emg")


def _spans(labels: Any) -> Spans | None:
    if labels is None:
        return None
    try:
        pairs = [(float(onset), float(end)) for onset, end in labels]
    except (TypeError, ValueError):
        raise ParameterError(
            f"labels is {arguments.said(labels)}",
            expected="a file, or pairs of onset and end in seconds",
            do="write [(3.0, 5.0)], for example",
        ) from None
    ends = np.ravel(pairs)
    if not (np.isfinite(ends).all() and (np.diff(ends) > 0.0).all()):
        raise ParameterError(
            "labels are not in order", expected="onset < end < next onset, in seconds", do="sort or correct them"
        )
    return pairs


def _check_labels(labels: Spans | None, log: EmgLog, where: str) -> None:
    end = log.start + len(log.values) / log.rate
    if labels and (labels[0][0] < log.start or labels[-1][1] > end):
        raise LogError(
            f"{where} from {labels[0][0]:g} to {labels[-1][1]:g} s, and the recording lasts from {log.start:g} to "
            f"{end:g} s",
            expected="contractions within it",
            do="give the labels of this recording, in its own time",
        )
