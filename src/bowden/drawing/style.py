"""One look for every figure, without pyplot and without a trace in matplotlib's global settings."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLOURS = {
    "reference": "#222222",
    "joint": "#0072b2",
    "motor": "#e69f00",
    "command": "#cc79a7",
    "error": "#d55e00",
    "uncompensated": "#8c8c8c",
    "observer": "#d55e00",
    "adaptive": "#0072b2",
    "bowden": "#009e73",
    "active_disturbance_rejection": "#882255",
    "adaptive_sliding_mode": "#6a51a3",
    "backlash_inverse": "#cc79a7",
    "cascaded_pid": "#56b4e9",
    "disturbance_observer": "#999933",
    "hysteresis_model": "#e69f00",
    "offset_inverse": "#8a5a2b",
    "repetitive": "#44aa99",
    "data": "#5f6b76",
    "model": "#d55e00",
    "limit": "#b3b3b3",
}
"""What is drawn → its colour. The hues are Okabe and Ito's (jfly.uni-koeln.de/color, 2008), distinct for colour-blind
readers and, by their lightness, mostly in grey print too; those of more laws than there are of these are Paul Tol's
(personal.sron.nl/~pault, 2021). A law has one colour on all pages."""

DASHES = {
    "active_disturbance_rejection": "--",
    "adaptive_sliding_mode": "--",
    "backlash_inverse": "-.",
    "cascaded_pid": "--",
    "disturbance_observer": "--",
    "hysteresis_model": "-.",
    "offset_inverse": "--",
    "repetitive": ":",
}
"""Law → how its line is broken, where several laws share a panel: colours alone do not separate so many."""

CYCLE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c8c8c", "#222222")
"""For what has no name of its own, in this order."""

_STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#666666",
    "axes.grid": True,
    "axes.labelsize": 10.0,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.xmargin": 0.02,
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.4,
    "svg.fonttype": "path",  # shapes, not fonts: the same on every machine
    "svg.hashsalt": "bowden",  # the same run gives the same bytes
    "xtick.color": "#666666",
    "xtick.labelcolor": "#222222",
    "xtick.labelsize": 9.0,
    "ytick.color": "#666666",
    "ytick.labelcolor": "#222222",
    "ytick.labelsize": 9.0,
}


@contextmanager
def drawing() -> Iterator[None]:
    """Matplotlib's defaults and our style while figures are made; what the user has set comes back afterwards."""
    import matplotlib.style as styles
    from cycler import cycler

    with styles.context(["default", _STYLE | {"axes.prop_cycle": cycler(color=CYCLE)}]):
        yield


def new_figure(
    rows: int = 1, columns: int = 1, width: float = 7.0, height: float = 3.0, *, share_x: bool = False, ticks: int = 0
) -> tuple[Figure, list[Axes]]:
    """An empty figure of `rows` × `columns` axes.

    Args:
        rows: rows of axes.
        columns: columns of axes.
        width: of the whole figure [inch].
        height: of the whole figure [inch].
        share_x: one horizontal axis for each column; only the lowest carries numbers.
        ticks: this many of each axis are made now, and not when the figure is drawn.

    Returns:
        The figure, and its axes as a flat list, row by row.
    """
    from matplotlib.figure import Figure

    with drawing():
        figure = Figure(figsize=(width, height), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False, sharex="col" if share_x else False)
        for one in axes.flat:
            one.xaxis.get_major_ticks(ticks)
            one.yaxis.get_major_ticks(ticks)
    return figure, list(axes.flat)


def legend(axes: Axes, columns: int = 4) -> None:
    """A legend above the axes, where it covers nothing: in `columns`, or in as many as the figure has room for."""
    names = axes.get_legend_handles_labels()[1]
    if not names:
        return
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=min(columns, legend_columns(names, axes.figure.bbox.width / axes.figure.dpi)),
        borderaxespad=0.2,
        handlelength=1.6,
        fontsize=9.0,
    )


def legend_of_all(axes: Sequence[Axes]) -> None:
    """One legend above all axes of a figure, each name of theirs once."""
    lines = {name: line for one in axes for line, name in zip(*one.get_legend_handles_labels(), strict=True)}
    if not lines:
        return
    figure = axes[0].figure
    figure.legend(
        list(lines.values()),
        list(lines),
        loc="outside upper right",
        ncols=min(4, legend_columns(list(lines), figure.bbox.width / figure.dpi)),
        handlelength=1.6,
        fontsize=9.0,
        frameon=False,
    )


def legend_columns(names: Sequence[str], width: float) -> int:
    """How many names stand side by side in a legend of this width [inch].

    >>> legend_columns(["adaptive", "observer"], 7.0), legend_columns(["active_disturbance_rejection"], 7.0)
    (5, 2)
    """
    return max(1, int((width - 0.8) / (0.5 + 0.079 * max(map(len, names), default=0))))


def legend_height(names: Sequence[str], width: float = 7.0, columns: int = 4) -> float:
    """What a `legend` above the axes adds to the height of a figure beyond one row of names [inch]."""
    return 0.2 * (-(-len(names) // min(columns, legend_columns(names, width))) - 1)


def finish(figure: Figure) -> None:
    """The last touches, which matplotlib takes from its global settings by default.

    Quiet legends, titles to the left, vertical labels of a column in one line.
    """
    for axes in figure.axes:
        box = axes.get_legend()
        if box is not None:
            box.get_frame().set(facecolor="white", edgecolor="none", alpha=0.85, linewidth=0.0)
            for text in box.get_texts():
                text.set_fontsize(9.0)
        title = axes.get_title("left") or axes.get_title()
        if title:
            axes.set_title("")
            axes.set_title(title, loc="left", fontsize=10.0, fontweight="bold")
    figure.align_ylabels()


def svg(figure: Figure, prefix: str) -> str:
    """The figure as an SVG element whose ids begin with `prefix`, so that several share one page."""
    finish(figure)
    buffer = io.StringIO()
    with drawing():
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r'\bid="', f'id="{prefix}', text)
    text = re.sub(r'(href="|url\()#', rf"\1#{prefix}", text)
    text = re.sub(r'\bd="[^"]*"', lambda match: re.sub(r"(\.\d\d)\d+", r"\1", match.group()), text)  # 0.01 pt is enough
    return re.sub(r"\n\s*", "\n", text).strip()


def widened(low: float, high: float, share: float) -> tuple[float, float]:
    """Limits a `share` of their range further apart."""
    room = share * (high - low) or 1.0
    return low - room, high + room


def stay_near(axes: Axes, wanted: list[Array], drawn: list[Array]) -> None:
    """Vertical limits that show `wanted`, and of `drawn` as much as lies within three times its range.

    A run that ran away would otherwise flatten all the others. Where a curve goes on outside, the axes say how far.
    """
    finite = [values[np.isfinite(values)] for values in wanted]
    low = min((float(values.min()) for values in finite if len(values)), default=0.0)
    high = max((float(values.max()) for values in finite if len(values)), default=1.0)
    bottom, top = widened(low, high, 1.0)
    seen = [values[(values >= bottom) & (values <= top)] for values in drawn]
    low = min([low, *(float(values.min()) for values in seen if len(values))])
    high = max([high, *(float(values.max()) for values in seen if len(values))])
    axes.set_ylim(*widened(low, high, 0.06))
    note_cut(axes, drawn)


def note_cut(axes: Axes, drawn: list[Array]) -> None:
    """Say in the axes how far `drawn` goes on below and above their vertical limits, where it does."""
    bottom, top = axes.get_ylim()
    finite = [values[np.isfinite(values)] for values in drawn]
    lowest = min((float(values.min()) for values in finite if len(values)), default=bottom)
    highest = max((float(values.max()) for values in finite if len(values)), default=top)
    ends = [f"{lowest:.3g}"] if lowest < bottom else []
    ends += [f"{highest:.3g}"] if highest > top else []
    if ends:
        said = "cut: goes on to " + " and ".join(ends).replace("-", "−")
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5}
        axes.text(0.01, 0.97, said, transform=axes.transAxes, va="top", fontsize=8.0, bbox=box, zorder=5.0)


def logarithmic(axes: Axes, which: Literal["x", "y"]) -> None:
    """A logarithmic axis with plain numbers at 1, 2 and 5, at powers of ten where it is long, or evenly if short."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    axis = axes.xaxis if which == "x" else axes.yaxis
    low, high = axis.get_data_interval()
    if high < 4.0 * low:
        axis.set_major_locator(MaxNLocator(4))
        axis.set_minor_locator(NullLocator())
    else:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50.0 * low else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def colours_for(names: Sequence[str]) -> dict[str, str]:
    """A colour for each name: its own where `COLOURS` has one, else the next of `CYCLE` that is still free.

    >>> colours_for(["adaptive", "mine"])
    {'adaptive': '#0072b2', 'mine': '#d55e00'}
    """
    chosen = {name: COLOURS[name] for name in names if name in COLOURS}
    others = [name for name in names if name not in COLOURS]
    free = [colour for colour in CYCLE if colour not in chosen.values()] or list(CYCLE)
    chosen |= {name: free[i % len(free)] for i, name in enumerate(others)}
    return {name: chosen[name] for name in names}


def dashes_for(names: Sequence[str]) -> dict[str, str]:
    """How each name's line is broken: as `DASHES` has it, whole where it has nothing and its colour is not yet taken.

    >>> dashes_for(["adaptive", "repetitive"])
    {'adaptive': '-', 'repetitive': ':'}
    """
    used: list[str] = []
    chosen = {}
    for name, colour in colours_for(names).items():
        chosen[name] = DASHES.get(name, ("-", "--", "-.", ":")[used.count(colour) % 4])
        used.append(colour)
    return chosen


def thin(x: Array, y: Array, most: int = 4000) -> tuple[Array, Array]:
    """At most `most` points that look like all of them: the lowest and the highest of each stretch of samples.

    Args:
        x: (n,), any unit.
        y: (n,); a stretch without a finite value leaves one NaN, which breaks the line.
        most: largest number of points to keep, 5 or more.

    Returns:
        Those x and y, in their old order, with the first and the last sample.

    >>> x = np.arange(1000.0)
    >>> [len(a) for a in thin(x, np.sin(x), most=100)], [len(a) for a in thin(x, x)]
    ([100, 100], [1000, 1000])
    """
    n = len(x)
    if n <= most:
        return x, y
    finite = np.isfinite(y)
    stretches = (most - 2) // (2 if finite.all() else 3)
    edges = np.linspace(0, n, stretches + 1).astype(np.intp)
    first, end = edges[:-1], edges[1:]
    inside = np.minimum(first[:, None] + np.arange(int((end - first).max())), end[:, None] - 1)  # the last one again
    good, values = finite[inside], y[inside]
    rows = np.arange(stretches)
    lowest = inside[rows, np.where(good, values, np.inf).argmin(axis=1)][good.any(axis=1)]
    highest = inside[rows, np.where(good, values, -np.inf).argmax(axis=1)][good.any(axis=1)]
    breaks = inside[rows, good.argmin(axis=1)][~good.all(axis=1)]
    index = np.unique(np.concatenate([[0, n - 1], lowest, highest, breaks]))
    return x[index], y[index]


def draw_motion(axes: Axes, time: Array, reference: Array, joint: Array, colour: str = COLOURS["joint"]) -> None:
    """Reference and joint over time: (n,) [s], (n,) and (n,) [rad]."""
    axes.plot(*thin(time, joint * DEGREES), color=colour, label="joint")
    axes.plot(*thin(time, reference * DEGREES), color=COLOURS["reference"], lw=1.0, ls="--", label="reference")
    axes.set_ylabel("angle [°]")
    stay_near(axes, [reference * DEGREES], [joint * DEGREES])
    legend(axes)


def draw_error(axes: Axes, time: Array, reference: Array, joint: Array, colour: str = COLOURS["error"]) -> None:
    """Joint − reference over time; of a run that ran away, what lies within a tenth of its motion."""
    error = (joint - reference) * DEGREES
    axes.plot(*thin(time, error), color=colour, lw=1.1)
    wanted = error if np.isfinite(error).all() else 0.1 * (reference - np.nanmean(reference)) * DEGREES
    stay_near(axes, [wanted], [error])
    axes.set(xlabel="time [s]", ylabel="error [°]")
