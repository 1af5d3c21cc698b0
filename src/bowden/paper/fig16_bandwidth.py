"""Fig. 16: closed-loop bandwidth from a 90° chirp, 0.1 to 20 Hz."""

import math

import numpy as np

from bowden.control import LAWS
from bowden.paper import bench as paper
from bowden.paper.experiment import Finding, Runs
from bowden.paper.figures_of_merit import CHIRP_FREQUENCIES, chirp_gain, closed_loop_bandwidth
from bowden.report.style import COLOURS, new_figure


def run(runs: Runs) -> Finding:
    """|joint/reference| of the observer, of the adaptive law, and of the adaptive law without its D̂m."""
    without_bound = paper.run_chirp(LAWS["adaptive"].with_gains(bound_adaptation=0.0))
    omega = 2.0 * math.pi * CHIRP_FREQUENCIES
    figure, (axes,) = new_figure(width=6.5, height=3.6)
    for trace, label, style in (
        (runs.observer_chirp, "observer", "-"),
        (runs.adaptive_chirp, "adaptive", "-"),
        (without_bound, "adaptive, D̂m held at 0", ":"),
    ):
        axes.semilogx(omega, 20.0 * np.log10(chirp_gain(trace)), style, label=label, color=COLOURS[label.split(",")[0]])
    axes.axhline(-3.0, color=COLOURS["reference"], linestyle=":", linewidth=1.0)
    for published, name in ((35.0, "observer"), (31.0, "adaptive")):
        axes.axvline(published, color=COLOURS[name], linestyle="--", linewidth=0.8)
    axes.set(xlabel="frequency [rad/s]", ylabel="|joint / desired| [dB]", ylim=(-14, 4))
    axes.legend(loc="lower left")
    chirp = paper.chirp()
    lasted = float(np.isfinite(runs.adaptive_chirp["joint"]).sum()) * paper.bench().sample_time
    alone = closed_loop_bandwidth(without_bound)
    return Finding(
        title="Fig. 16 – bandwidth",
        values={
            "fig16.observer.bandwidth": closed_loop_bandwidth(runs.observer_chirp),
            "fig16.adaptive.bandwidth": closed_loop_bandwidth(runs.adaptive_chirp),
            "erratum.bandwidth": 31.0 / (2.0 * math.pi),
        },
        details={
            "runaway_hz": chirp.f0 + (chirp.f1 - chirp.f0) * lasted / chirp.duration,
            "without_bound": alone if alone is not None else math.nan,
            "beta_at_5hz": float(runs.adaptive_chirp["law.slope_inverse"][37000]),
            "bound_at_5hz": float(runs.adaptive_chirp["law.bound"][37000]),
        },
        figures=[(figure, "Closed-loop gain from the chirp. Dashed: the published bandwidths; dotted: −3 dB.")],
    )
