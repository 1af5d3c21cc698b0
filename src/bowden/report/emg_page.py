"""The page of ``bowden emg score``: the signal, what was found in it, and by which threshold."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.drawing.style import COLOURS, CYCLE, legend, new_figure
from bowden.identify.emg.log import EmgLog
from bowden.identify.emg.score import Findings, Score, Spans, spans
from bowden.report.page import Page
from bowden.sensing.envelope import PLAIN_THRESHOLD

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_MOST = 4000
"""Points of a line: the lowest and highest of each stretch are drawn."""


def emg_page(name: str, log: EmgLog, labels: Spans | None, found: Findings) -> Page:
    """The page.

    Args:
        name: of the recording.
        log: it.
        labels: contractions as they are known; None without labels.
        found: what was found.
    """
    page = Page(
        f"Contractions in {name}",
        f"Channel {log.channel}, {len(log.values) / log.rate:.4g} s at {log.rate:.4g} Hz. Both detectors use only what "
        "came before, as in a live run.",
    )
    for warning in log.warnings:
        page.notice(warning[0].upper() + warning[1:] + ".")
    page.heading("What was found")
    page.table(
        [
            "detector",
            "detections",
            "misses",
            "rejected as too short",
            "false activations",
            "false activations [1/min]",
            "latency, median [ms]",
            "latency, worst [ms]",
        ],
        [_row("ours", found.score), _row("plain threshold", found.plain_score)],
        "Counts, where no unit is given. A detection belongs to a label if its contraction begins within the label "
        "or up "
        "to 0.3 s before it; each further detection is false. A labelled contraction that is shorter than "
        "--shortest-ms "
        "and not detected is rejected, not missed."
        + ("" if labels is not None else " Without labels (--labels) only detections are counted."),
    )
    page.figure(
        signal_figure(log, labels, found),
        "Above: the signal. Middle: its envelope (8 Hz) and the plain threshold. Below: when each detector saw a "
        "contraction"
        + (", and the labels" if labels is not None else "")
        + ". Trouble is movement, mains hum or a dead electrode; nothing is detected in it.",
    )
    page.text(
        "The plain threshold is {share} % of an envelope of {mvc}, which is taken for the maximum voluntary "
        "contraction "
        "(MVC).",
        share=f"{100 * PLAIN_THRESHOLD:g}",
        mvc=f"{found.mvc:.4g} {_with_unit(log.channel)[1].strip(' []')}".strip(),
    )
    return page


def signal_figure(log: EmgLog, labels: Spans | None, found: Findings) -> "Figure":
    """Signal, envelope and spans over time."""
    figure, axes = new_figure(3, 1, height=5.2, share_x=True)
    draw_signal(axes, log, labels, found)
    return figure


def draw_signal(axes: "Sequence[Axes]", log: EmgLog, labels: Spans | None, found: Findings) -> None:
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
    signal, unit = _with_unit(log.channel)
    above.set_ylabel(f"{signal}{unit}")
    middle.set_ylabel(f"envelope{unit}")
    legend(middle)


def _with_unit(channel: str) -> tuple[str, str]:
    """A channel's name and its unit for an axis, where the name ends in one.

    >>> _with_unit("emg_mV"), _with_unit("biceps")
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


def _row(name: str, score: Score) -> list[str]:
    def milliseconds(value: float | None) -> str:
        return "–" if value is None else f"{1e3 * value:.0f}"

    return [
        name,
        str(score.detections),
        "–" if score.misses is None else str(score.misses),
        "–" if score.rejected is None else str(score.rejected),
        "–" if score.false_activations is None else str(score.false_activations),
        "–" if score.false_per_minute is None else f"{score.false_per_minute:.2f}",
        milliseconds(score.latency_median_s),
        milliseconds(score.latency_max_s),
    ]
