"""Draw the figure of docs/emg.md: ``python docs/images/make_emg.py FILE.json [BEFORE.json]``.

The files are of ``benchmarks/emg_cases.py --peers --json``; of the second one the first detector is shown, as the one
before. The same files give the same bytes.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from bowden.core import style

_LABELS = {"onset": "ours"}
"""Names of detectors as the figure has them; others are shown as they are."""
_FEW = 5
"""A median of fewer latencies is not shown."""


def over_ratio(detectors: dict[str, dict[str, Any]]) -> Figure:
    """Share missed, and the median latency of quick onsets, over the contraction's ratio to rest."""
    figure, (missed, latency) = style.new_figure(1, 2, 10.0, 3.6)
    for (name, found), colour in zip(detectors.items(), style.CYCLE, strict=False):
        shares, times = [], []
        for row in found["curve"]:
            if row["count"]:
                shares.append((_middle(row["kind"]), 100.0 * row["missed"] / row["count"]))
        for row in found["quick"]:
            if row["count"] - row["missed"] >= _FEW:
                times.append((_middle(row["kind"]), 1e3 * row["latency"]))
        missed.plot(*zip(*shares, strict=True), "o-", ms=3.5, color=colour, label=_LABELS.get(name, name))
        latency.plot(*zip(*times, strict=True), "o-", ms=3.5, color=colour)
    for axes in (missed, latency):
        axes.set_xscale("log")
        axes.set(xticks=[2, 3, 5, 10, 30, 100, 300], xlabel="RMS in the contraction over RMS at rest [–]")
        axes.set_xticklabels(["2", "3", "5", "10", "30", "100", "300"])
        axes.minorticks_off()
    missed.set(ylabel="missed [%]", ylim=(-3.0, 103.0))
    missed.set_title("Missed")
    missed.legend(loc="upper right")
    latency.set(ylabel="latency [ms]", ylim=(0.0, 400.0))
    latency.set_title("Latency of quick onsets, median")
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
    shown = _read(sys.argv[1])
    if len(sys.argv) > 2:
        before = next(iter(_read(sys.argv[2]).values()))
        first, *others = shown
        shown = {first: shown[first], "ours, before": before} | {name: shown[name] for name in others}
    drawn = over_ratio(shown)
    with style.drawing():
        drawn.savefig(Path(__file__).with_name("emg.svg"), metadata={"Date": None, "Creator": None})
