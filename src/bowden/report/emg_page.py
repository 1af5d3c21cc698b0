"""The page of ``bowden emg score``: the signal, what was found in it, and by which threshold."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.style import COLOURS, CYCLE, legend, new_figure
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
        f"Channel {log.channel}, {len(log.values) / log.rate:.4g} s at {log.rate:.4g} Hz. Both detectors are causal.",
    )
    for warning in log.warnings:
        page.notice(warning[0].upper() + warning[1:] + ".")
    page.heading("What was found")
    page.table(
        [
            "",
            "detections",
            "misses",
            "rejected as too short",
            "false activations",
            "latency, median [ms]",
            "latency, worst [ms]",
            "false a minute",
        ],
        [_row("our detector", found.score), _row("plain threshold, 20 % MVC", found.plain_score)],
        "A detection counts for a label if its contraction begins up to 0.3 s before it or within it; each further one "
        "is false. A labelled contraction that is not told and is shorter than --shortest-ms is rejected, not missed.",
    )
    page.figure(
        signal_figure(log, labels, found),
        "Above: the signal. Middle: its envelope at 8 Hz, and the plain threshold. Below: labels, our detector, the "
        "plain threshold; trouble is movement, mains or a dead electrode, in which nothing is detected.",
    )
    page.text(
        "The plain threshold stands at {share} % of an envelope of {mvc}, which counts as maximum contraction (MVC).",
        share=f"{100 * PLAIN_THRESHOLD:g}",
        mvc=f"{found.mvc:.4g}",
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
        ("trouble", spans(found.detected.trouble, log.rate), COLOURS["limit"]),
    ]
    if labels is not None:
        rows.append(("labels", [(on - log.start, off - log.start) for on, off in labels], CYCLE[5]))
    for i, (_, stretches, colour) in enumerate(rows):
        _bars(below, i, [(on + log.start, off + log.start) for on, off in stretches], colour)
    below.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    below.set(xlabel="time [s]", ylim=(-0.6, len(rows) - 0.4))
    below.grid(False, axis="y")
    above.set_ylabel(log.channel)
    middle.set_ylabel("envelope")
    legend(middle)


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
        milliseconds(score.latency_median_s),
        milliseconds(score.latency_max_s),
        "–" if score.false_per_minute is None else f"{score.false_per_minute:.2f}",
    ]
