"""The figures that the paper quotes, measured on a trace."""

import numpy as np
from numpy.typing import NDArray

from bowden.core import metrics
from bowden.core.trace import Trace
from bowden.core.units import DEGREES

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


def chirp_gain(trace: Trace) -> NDArray[np.float64]:
    """|joint/reference| at `CHIRP_FREQUENCIES`, averaged over ± 0.15 Hz, from the part of the run that is finite."""
    length = int(np.argmin(np.isfinite(trace["joint"]))) or len(trace)
    response = metrics.frequency_response(
        trace.time[:length], trace["reference"][:length], trace["joint"][:length], CHIRP_FREQUENCIES, 0.15
    )
    return np.abs(response)


def closed_loop_bandwidth(trace: Trace) -> float | None:
    """−3 dB bandwidth of the closed loop from a chirp [rad/s]; None where the gain stays above."""
    return metrics.bandwidth(CHIRP_FREQUENCIES, chirp_gain(trace))
