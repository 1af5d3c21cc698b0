"""Draw the pictures of the README from runs of the default bench: ``python docs/images/make.py``.

The same source gives the same bytes; run it again when a model, a law or a calibration changes.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.core.units import DEGREES
from bowden.drawing import style
from bowden.drawing.style import COLOURS, thin
from bowden.paper.bench import run_bench
from bowden.plants.presets.paper import calibration
from bowden.records.trace import Trace

_SECONDS = 60.0
_SETTLED = 20.0  # s; the loops show what comes after the second period


def loops_and_error() -> Figure:
    """Joint over reference without compensation and under the adaptive law, and both errors over time."""
    figure, axes = style.new_figure(columns=3, width=10.0, height=3.1)
    runs = {name: run_bench(LAWS[name], fit=calibration(), duration=_SECONDS) for name in ("uncompensated", "adaptive")}
    for panel, title, (name, trace) in zip(axes, ("No compensation", "Adaptive law"), runs.items(), strict=False):
        part = trace.time >= _SETTLED
        panel.plot(*_degrees(trace, "reference", "reference", part), ":", color=COLOURS["reference"], label="desired")
        panel.plot(*_degrees(trace, "reference", "joint", part), color=COLOURS[name], label="joint")
        panel.set(xlabel="desired angle [°]", ylabel="joint angle [°]", xticks=range(0, 71, 10))
        panel.set_title(title)
        panel.set_aspect("equal")
        panel.legend(loc="upper left")
    for name, trace in runs.items():
        label = f"{name}, RMS {trace.metrics().rmse_deg:.2f}°"
        axes[2].plot(*thin(trace.time, trace.error * DEGREES, most=1200), color=COLOURS[name], label=label)
    axes[2].set(xlabel="time from rest [s]", ylabel="joint − desired [°]", ylim=(-8.5, 8.5), xticks=range(0, 61, 10))
    axes[2].set_title("Error")
    axes[2].legend(loc="upper right")
    style.finish(figure)
    return figure


def _degrees(trace: Trace, x: str, y: str, part: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    step = 20  # the joint moves at most half a degree in that many samples
    return trace[x][part][::step] * DEGREES, trace[y][part][::step] * DEGREES


if __name__ == "__main__":
    drawn = loops_and_error()
    with style.drawing():
        drawn.savefig(Path(__file__).with_name("loops.svg"), metadata={"Date": None, "Creator": None})
