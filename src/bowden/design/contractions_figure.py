"""A recording of EMG drawn: the signal, its envelope, and what was found in it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.drawing.style import COLOURS, CYCLE, legend, new_figure
from bowden.identify.emg.log import EmgRecording
from bowden.identify.emg.score import Findings, Spans, spans
from bowden.sensing.envelope import PLAIN_THRESHOLD

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
