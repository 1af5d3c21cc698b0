"""Fig. 16: closed-loop bandwidth from a 90° chirp, 0.1 to 20 Hz."""

import math

import numpy as np

from bowden.core.style import COLOURS, legend, new_figure
from bowden.paper.bench import adaptive, run_chirp
from bowden.paper.experiment import Finding, Runs
from bowden.paper.figures_of_merit import CHIRP_FREQUENCIES, chirp_gain, chirp_reached, closed_loop_bandwidth
from bowden.rig.presets import bench as paper


def run(runs: Runs) -> Finding:
    """|joint/reference| of the observer, of the adaptive law, and of the adaptive law without its D̂m."""
    without_bound = run_chirp(adaptive().with_gains(bound_adaptation=0.0))
    chirp = paper.chirp()
    omega = 2.0 * math.pi * CHIRP_FREQUENCIES
    figure, (axes,) = new_figure(width=8.6, height=4.2)
    for trace, label, style in (
        (runs.observer_chirp, "observer", "-"),
        (runs.adaptive_chirp, "adaptive", "-"),
        (without_bound, "adaptive, D̂m held at 0", ":"),
    ):
        axes.semilogx(
            omega, 20.0 * np.log10(chirp_gain(trace, chirp)), style, label=label, color=COLOURS[label.split(",")[0]]
        )
    axes.axhline(-3.0, color=COLOURS["reference"], linestyle=":", linewidth=1.0)
    for published, name in ((35.0, "observer"), (31.0, "adaptive")):
        axes.axvline(published, color=COLOURS[name], linestyle="--", linewidth=0.8)
    axes.set(xlabel="frequency [rad/s]", ylabel="|joint / desired| [dB]", ylim=(-14, 4))
    legend(axes)
    alone = closed_loop_bandwidth(without_bound, chirp)
    reached = chirp_reached(runs.adaptive_chirp, chirp)
    found = closed_loop_bandwidth(runs.adaptive_chirp, chirp)
    gain = chirp_gain(runs.adaptive_chirp, chirp)
    at_5hz = int(np.searchsorted(runs.adaptive_chirp.time, (5.0 - chirp.f0) / (chirp.f1 - chirp.f0) * chirp.duration))
    return Finding(
        title="Bandwidth (Dinh 2017, Fig. 16)",
        values={
            "fig16.observer.bandwidth": closed_loop_bandwidth(runs.observer_chirp, chirp),
            "fig16.adaptive.bandwidth": 2.0 * math.pi * reached if found is None else found,
            "erratum.bandwidth": 31.0 / (2.0 * math.pi),
        },
        details={
            "reached_hz": reached,
            "last_db": 20.0 * math.log10(float(gain[np.isfinite(gain)][-1])),
            "without_bound": math.nan if alone is None else alone,
            "beta_at_5hz": float(runs.adaptive_chirp["law.slope_inverse"][at_5hz]),
            "bound_at_5hz": float(runs.adaptive_chirp["law.bound"][at_5hz]),
        },
        figures=[
            (
                figure,
                "Closed-loop gain from the chirp. Dashed: the published bandwidths. Dotted, horizontal: −3 dB.",
            )
        ],
    )
