"""The contractions in a recording of EMG against labels, and a wearer's levels: what live runs go by."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bowden.core import arguments
from bowden.core.caller import argument
from bowden.core.errors import LogError, ParameterError
from bowden.drawing import shown
from bowden.drawing.style import COLOURS, CYCLE, legend, new_figure
from bowden.identify.emg.detector_score import DetectorScore
from bowden.identify.emg.levels import EnvelopeLevels, check_contraction, envelope_levels
from bowden.identify.emg.log import EmgRecording, channel_unit, checked_emg, read_emg, read_labels
from bowden.identify.emg.score import Findings, Spans, find, spans
from bowden.sensing import wearer_file
from bowden.sensing.detector import Detector
from bowden.sensing.envelope import PLAIN_THRESHOLD
from bowden.sensing.stream import OnsetDetector
from bowden.sensing.wearer_file import MuscleCalibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Array = NDArray[np.float64]

_MOST = 4000
"""Points of a line: the lowest and highest of each stretch are drawn."""


def signal_figure(log: EmgRecording, labels: Spans | None, found: Findings) -> "Figure":
    """Signal, envelope and spans over time."""
    figure, axes = new_figure(3, 1, height=5.2, share_x=True)
    draw_signal(axes, log, labels, found)
    return figure


def draw_signal(axes: "Sequence[Axes]", log: EmgRecording, labels: Spans | None, found: Findings) -> None:
    """The same on three axes."""
    above, middle, below = axes
    time = log.start + np.arange(len(log.values)) / log.rate
    above.plot(*_outline(time, log.values), color=COLOURS["data"], linewidth=0.5)
    middle.plot(*_outline(time, found.envelope), color=COLOURS["joint"], linewidth=1.0, label="envelope")
    threshold = PLAIN_THRESHOLD * found.mvc
    middle.axhline(threshold, color=COLOURS["error"], linewidth=1.0, linestyle="--", label="20 % of MVC")
    rows: list[tuple[str, Sequence[tuple[float, float]], str]] = [
        ("threshold", found.plain, COLOURS["error"]),
        ("detector", found.found, COLOURS["bowden"]),
    ]
    if found.detected.trouble.any():
        rows.append(("trouble", spans(found.detected.trouble, log.rate), COLOURS["data"]))
    if labels is not None:
        rows.append(("labels", [(on - log.start, off - log.start) for on, off in labels], CYCLE[5]))
    for i, (_, stretches, colour) in enumerate(rows):
        _bars(below, i, [(on + log.start, off + log.start) for on, off in stretches], colour)
    below.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    below.set(xlabel="time [s]", ylim=(-0.6, len(rows) - 0.4))
    below.grid(False, axis="y")
    signal, unit = with_unit(log.channel)
    above.set_ylabel(f"{signal}{unit}")
    middle.set_ylabel(f"envelope{unit}")
    legend(middle)


def with_unit(channel: str) -> tuple[str, str]:
    """A channel's name and its unit for an axis, where the name ends in one.

    >>> with_unit("emg_mV"), with_unit("biceps")
    (('emg', ' [mV]'), ('biceps', ''))
    """
    name, _, unit = channel.rpartition("_")
    return (name, f" [{unit.replace('u', 'µ')}]") if name and unit in ("V", "mV", "uV", "µV") else (channel, "")


def _bars(axes: "Axes", row: int, stretches: Sequence[tuple[float, float]], colour: str) -> None:
    axes.broken_barh([(on, off - on) for on, off in stretches], (row - 0.35, 0.7), color=colour, linewidth=0.0)


def _outline(time: Array, values: Array) -> tuple[Array, Array]:
    """The lowest and the highest value of each stretch, so that no spike is lost."""
    stretch = max(1, len(values) // (_MOST // 2))
    count = len(values) // stretch
    parts = values[: count * stretch].reshape(count, stretch)
    both = np.ravel(np.column_stack([parts.min(axis=1), parts.max(axis=1)]))
    return np.repeat(time[: count * stretch : stretch], 2), both


Recording = str | Path | EmgRecording | ArrayLike
"""The path of a recording, or the samples of one channel (n,)."""
_MOST_SPANS = 5
"""Contractions that a warning lists."""


@dataclass(frozen=True, repr=False)
class Contractions(shown.Plotted):
    """The contractions that were found in one channel of a recording; drawn, with the signal and its envelope."""

    _panels = shown.Panels(3, 1, 7.0, 5.2)

    log: EmgRecording = field(compare=False)
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
    def score(self) -> DetectorScore:
        """The detector against the labels."""
        return self.findings.score

    @property
    def plain_score(self) -> DetectorScore:
        """The plain threshold of 20 % MVC against the labels."""
        return self.findings.plain_score

    @property
    def trouble(self) -> float:
        """Time of movement, mains or a dead electrode, in which nothing can be detected [s]."""
        return float((self.findings.detected.trouble > 0.5).sum()) / self.log.rate

    def _draw(self, axes: "Sequence[Axes]") -> None:
        if len(axes) != 3:
            raise ParameterError(f"plot: axes are {len(axes)}", expected="three", do="leave them out for new ones")
        draw_signal(axes, self.log, self.labels, self.findings)

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


def _in_words(score: DetectorScore) -> str:
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


def scored(
    log: EmgRecording,
    *,
    labels: "str | Path | Sequence[tuple[float, float]] | None",
    wearer: str | Path | MuscleCalibration | None,
    kind: Detector,
    shortest: float,
) -> Contractions:
    """The contractions in a channel that was read; see `bowden.emg_score`.

    Raises:
        LogError: labels that do not belong to the recording.
        ParameterError: a wearer's file or labels that cannot be used.
    """
    known = read_labels(Path(labels)) if isinstance(labels, str | Path) else _spans(labels)
    _check_labels(known, log, f"{labels}: labels" if isinstance(labels, str | Path) else "labels")
    of, where = (wearer_file.read(Path(wearer)), str(wearer)) if isinstance(wearer, str | Path) else (wearer, "wearer")
    if of is not None and not isinstance(of, MuscleCalibration):
        raise ParameterError(
            f"wearer is {arguments.format_value(of)}",
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
    settings = kind.settings if of is None or other else kind.of_wearer(of.sigma, of.mvc)
    mvc, mains = (None, 0.0) if of is None else (of.mvc, of.mains)
    findings = find(log.values, log.rate, moved, mvc, settings._replace(shortest=shortest), mains, kind)
    source = "this recording" if of is None else where
    return Contractions(log, known, findings, shortest, source, differ)


def calibrated(
    log: EmgRecording, rest: EmgRecording | None, mains: float, kind: Detector
) -> tuple[MuscleCalibration, dict[str, float], list[str]]:
    """A wearer's levels from channels that were read, the note on what was left out → how much [s], and warnings.

    Raises:
        LogError: too little is left of a recording, or there is no contraction in it.
    """
    read: list[tuple[EmgRecording, EnvelopeLevels]] = []
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


def _rest_warnings(rest: EmgRecording, log: EmgRecording, kind: Detector) -> list[str]:
    """What is odd about a recording of rest: contractions in it, or another unit than the other recording's."""
    found = [(rest.start + on, rest.start + off) for on, off in _contractions(rest, kind)]
    warnings = []
    if found:
        listed = ", ".join(f"{on:.1f} to {off:.1f} s" for on, off in found[:_MOST_SPANS])
        more = f" and {len(found) - _MOST_SPANS} more" if len(found) > _MOST_SPANS else ""
        warnings.append(
            f"REST HAS CONTRACTIONS: {rest.name} from {listed}{more}; its rest is too high for what the detector "
            "compares with it: record rest again, or leave " + argument("rest") + " out"
        )
    here, there = channel_unit(log.channel), channel_unit(rest.channel)
    if here and there and here != there:
        warnings.append(f"UNITS DIFFER: {rest.name} is in {there}, and {log.name} in {here}")
    return warnings


def _contractions(log: EmgRecording, kind: Detector) -> Spans:
    """Contractions that the detector finds, from the first sample on [s]."""
    return spans(OnsetDetector(log.rate, None, kind).feed(log.values).active, log.rate)


def note_left_out(seconds: float, where: str) -> str:
    """What is said of the parts of a recording that were not used."""
    return f"{where}: {seconds:.1f} s of dead electrode, movement, mains or clicks are left out"


def recording_of(recording: Any, channel: str | None, rate: float | None, function: str) -> EmgRecording:
    """One channel of what was given as a recording.

    Raises:
        LogError: a file, or signals, that cannot be used.
        ParameterError: something else, or samples without their rate.
    """
    if rate is not None and not 0.0 < rate < 1e6:
        what = argument("rate").rstrip("=")
        raise ParameterError(f"{what} is {rate:g}", expected="samples a second, such as 1000", do="correct it")
    if isinstance(recording, EmgRecording):
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
            f"labels is {arguments.format_value(labels)}",
            expected="a file, or pairs of onset and end in seconds",
            do="write [(3.0, 5.0)], for example",
        ) from None
    ends = np.ravel(pairs)
    if not (np.isfinite(ends).all() and (np.diff(ends) > 0.0).all()):
        raise ParameterError(
            "labels are not in order", expected="onset < end < next onset, in seconds", do="sort or correct them"
        )
    return pairs


def _check_labels(labels: Spans | None, log: EmgRecording, where: str) -> None:
    end = log.start + len(log.values) / log.rate
    if labels and (labels[0][0] < log.start or labels[-1][1] > end):
        raise LogError(
            f"{where} from {labels[0][0]:g} to {labels[-1][1]:g} s, and the recording lasts from {log.start:g} to "
            f"{end:g} s",
            expected="contractions within it",
            do="give the labels of this recording, in its own time",
        )
