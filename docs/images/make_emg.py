"""Draw the figure of docs/background/emg.md: ``python docs/images/make_emg.py FILE.json``.

The file is what the last look at the judging cases gave (``benchmarks/emg_cases.py --set judging --peers --json``): the
look is counted there, so that the figure needs no other. The same file gives the same bytes.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bowden.drawing import style

_LABELS = {"onset": "ours"}
"""Names of detectors as the figure has them; others are shown as they are."""
_LINES = (("#009e73", "o-"), ("#d55e00", "s--"), ("#0072b2", "^-."))
"""Colour, mark and line of each detector."""
_FEW = 5
"""A median of fewer latencies is not shown."""


def over_ratio(detectors: dict[str, dict[str, Any]]) -> Figure:
    """Share missed, and the median latency of quick onsets, over the contraction's ratio to rest."""
    figure, (missed, latency) = style.new_figure(1, 2, 10.0, 3.6)
    for (name, found), (colour, line) in zip(detectors.items(), _LINES, strict=False):
        shares, times = [], []
        for row in found["curve"]:
            if row["count"]:
                shares.append((_middle(row["kind"]), 100.0 * row["missed"] / row["count"]))
        for row in found["quick"]:
            if row["count"] - row["missed"] >= _FEW:
                times.append((_middle(row["kind"]), 1e3 * row["latency"]))
        missed.plot(*zip(*shares, strict=True), line, ms=3.5, color=colour, label=_LABELS.get(name, name))
        latency.plot(*zip(*times, strict=True), line, ms=3.5, color=colour)
    for axes in (missed, latency):
        axes.set_xscale("log")
        axes.set(xticks=[2, 3, 5, 10, 30, 100, 300], xlabel="RMS in the contraction over RMS at rest [–]")
        axes.set_xticklabels(["2", "3", "5", "10", "30", "100", "300"])
        axes.minorticks_off()
    missed.set(ylabel="missed [%]", ylim=(-3.0, 103.0))
    missed.set_title("Missed")
    missed.legend(loc="upper right")
    latency.set(ylabel="latency [ms]", ylim=(0.0, 420.0))
    latency.set_title("Latency of quick onsets, median")
    style.note_cut(latency, [np.asarray(line.get_ydata()) for line in latency.get_lines()])
    style.finish(figure)
    return figure


def _middle(kind: str) -> float:
    """Of a range such as ``2.5–3`` [–]."""
    low, high = (float(edge) for edge in kind.split("–"))
    return math.sqrt(low * high)


def _read(path: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))["detectors"]
    return found


if __name__ == "__main__":
    drawn = over_ratio(_read(sys.argv[1]))
    with style.drawing():
        drawn.savefig(Path(__file__).with_name("emg.svg"), metadata={"Date": None, "Creator": None})
