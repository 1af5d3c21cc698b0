"""Fig. 16: closed-loop bandwidth from a 90° chirp, 0.1 to 20 Hz, of a motor that saturates."""

import math

import numpy as np

from bowden.drawing.style import COLOURS, legend, new_figure
from bowden.models.drive.motor import acceleration_limit
from bowden.paper.bench import adaptive, chirp_run, run_chirp
from bowden.paper.calibration import bench_fit, gains
from bowden.paper.experiment import Finding
from bowden.paper.plots import CHIRP_FREQUENCIES, chirp_gain, closed_loop_bandwidth
from bowden.plants.presets import paper

PUBLISHED = {"observer": 35.0, "adaptive": 31.0}
"""Closed-loop bandwidths of Section 5.3 [rad/s]."""


def run() -> Finding:
    """|joint/reference| of the observer and of the adaptive law."""
    chirp, fit = paper.chirp(), bench_fit()
    figure, (axes,) = new_figure(width=8.6, height=4.2)
    found: dict[str, float | None] = {}
    for name, trace in (("observer", chirp_run("observer")), ("adaptive", chirp_run("adaptive"))):
        decibels = 20.0 * np.log10(chirp_gain(trace, chirp))
        axes.semilogx(2.0 * math.pi * CHIRP_FREQUENCIES, decibels, label=name, color=COLOURS[name])
        axes.axvline(PUBLISHED[name], color=COLOURS[name], linestyle="--", linewidth=0.8)
        found[name] = closed_loop_bandwidth(trace, chirp)
    axes.axhline(-3.0, color=COLOURS["reference"], linestyle=":", linewidth=1.0)
    axes.set(xlabel="frequency [rad/s]", ylabel="|joint / desired| [dB]", ylim=(-14, 4))
    legend(axes)
    softer = run_chirp(adaptive(**(gains("bench") | {"feedback_gain": 20.0})), duration=60.0)
    asked = PUBLISHED["adaptive"]
    above = CHIRP_FREQUENCIES[chirp_gain(chirp_run("adaptive"), chirp) >= math.sqrt(0.5)]
    return Finding(
        title="Bandwidth (Dinh 2017, Fig. 16)",
        values={
            "fig16.observer.bandwidth": found["observer"],
            "fig16.adaptive.bandwidth": found["adaptive"],
            "erratum.bandwidth": asked / (2.0 * math.pi),
        },
        details={
            "asked_speed": chirp.amplitude * asked,
            "asked_acceleration": chirp.amplitude * asked**2,
            "for_good": 2.0 * math.pi * float(above[-1]),
            "kappa_20": closed_loop_bandwidth(softer, chirp) or math.nan,
        },
        figures=[
            (figure, "Closed-loop gain from the chirp. Dashed: the published bandwidths. Dotted, horizontal: −3 dB.")
        ],
        text=f"The bench’s motor turns its spool by at most {fit.speed_limit:.1f} rad/s and "
        f"{acceleration_limit(fit.motor):.0f} rad/s²; its loop by itself has "
        f"ω = {fit.natural_frequency:g} rad/s. So the published bandwidths are those of a saturated motor, and "
        "say little of its loop: a servo of 60 to 140 rad/s meets them.",
    )
