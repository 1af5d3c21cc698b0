"""How the paper shows each bench run: angles over time, joint over reference, and the figures that it quotes."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import Chirp
from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, new_figure, thin
from bowden.records import metrics
from bowden.records.metrics import rmse
from bowden.records.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def time_and_loop(trace: Trace, colour: str, name: str, seconds: float = 30.0) -> "Figure":
    """Desired and measured motion over time (A) and against one another (B), as the paper does."""
    figure, (left, right) = new_figure(columns=2, width=8.6, height=3.9)
    over_time(left, trace, colour, name, seconds)
    left.set_title("A")
    legend(left, columns=2)
    loop(right, trace, colour)
    right.set_title("B")
    return figure


def loops(traces: Mapping[str, Trace]) -> "Figure":
    """Joint over desired angle of several runs side by side, all axes of one scale."""
    figure, panels = new_figure(columns=len(traces), width=8.6, height=0.9 + 7.6 / len(traces))
    for axes, (name, trace) in zip(panels, traces.items(), strict=True):
        loop(axes, trace, COLOURS[name])
        axes.set_title(f"{name}, {rmse(trace.error) * DEGREES:.2f}° RMS")
    return figure


def over_time(axes: "Axes", trace: Trace, colour: str, name: str, seconds: float) -> None:
    """φd and φout over the first `seconds` of a run."""
    part = trace.time <= seconds
    for column, label, shade in (("reference", "desired", COLOURS["reference"]), ("joint", name, colour)):
        x, y = thin(trace.time[part], trace[column][part] * DEGREES, most=1200)
        axes.plot(x, y, label=label, color=shade, linestyle="--" if column == "reference" else "-")
    axes.set(xlabel="time [s]", ylabel="joint angle [°]")


def loop(axes: "Axes", trace: Trace, colour: str, start: float = 0.0, end: float = 1e9, label: str = "") -> None:
    """φout over φd within a stretch of a run, with the straight line that it should be."""
    part = (trace.time >= start) & (trace.time < end)
    step = max(1, int(part.sum() / 3000))
    axes.plot(
        trace["reference"][part][::step] * DEGREES,
        trace["joint"][part][::step] * DEGREES,
        color=colour,
        label=label or None,
        linewidth=1.0,
    )
    span = [float(trace["reference"].min() * DEGREES), float(trace["reference"].max() * DEGREES)]
    axes.plot(span, span, color=COLOURS["reference"], linestyle=":", linewidth=1.0)
    axes.set(xlabel="desired angle [°]", ylabel="joint angle [°]", aspect="equal")


CHIRP_FREQUENCIES = np.linspace(0.3, 19.5, 769)
"""Where the closed loop's response is read off a chirp [Hz]."""


def dead_zone_deg(trace: Trace, start: float = 0.0, end: float = np.inf) -> float:
    """Height of the cable's own loop, joint over motor, at mid-stroke within a stretch of the run [deg at the joint].

    Raises:
        ValueError: the stretch does not pass mid-stroke both ways.
    """
    part = (trace.time >= start) & (trace.time < end)
    width = metrics.hysteresis_width(trace["motor"][part], trace["joint"][part])
    if width is None:
        raise ValueError(f"no full stroke between {start} and {end} s")
    return width * DEGREES


def chirp_reached(trace: Trace, chirp: Chirp) -> float:
    """Frequency that the chirp had reached when the run ended or ran away [Hz]."""
    lasted = float(trace.time[_finite(trace) - 1])
    return chirp.f0 + (chirp.f1 - chirp.f0) * lasted / chirp.duration


def chirp_gain(trace: Trace, chirp: Chirp) -> NDArray[np.float64]:
    """|joint/reference| at `CHIRP_FREQUENCIES`, averaged over ± 0.15 Hz; NaN where a run that ran away did not come."""
    length = _finite(trace)
    response = metrics.frequency_response(
        trace.time[:length], trace["reference"][:length], trace["joint"][:length], CHIRP_FREQUENCIES, 0.15
    )
    return np.where(chirp_reached(trace, chirp) - 0.4 >= CHIRP_FREQUENCIES, np.abs(response), np.nan)


def _finite(trace: Trace) -> int:
    """Number of samples before a run ran away."""
    return int(np.argmin(np.isfinite(trace["joint"]))) or len(trace)


def closed_loop_bandwidth(trace: Trace, chirp: Chirp) -> float | None:
    """−3 dB bandwidth of the closed loop from a chirp [rad/s]; None where the gain stays above."""
    return metrics.bandwidth(CHIRP_FREQUENCIES, chirp_gain(trace, chirp))
