"""The figures that the paper quotes, measured on a trace."""

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import Chirp
from bowden.core.units import DEGREES
from bowden.records import metrics
from bowden.records.trace import Trace

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
