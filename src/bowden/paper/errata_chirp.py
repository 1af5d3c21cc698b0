"""The chirp of Eq. 17 as printed is a tone."""

import numpy as np

from bowden.drawing.style import COLOURS, legend, new_figure, thin
from bowden.paper.experiment import Finding
from bowden.plants.presets import paper


def run() -> Finding:
    """sin(2π·f(t)) beside the chirp with the integrated phase."""
    chirp = paper.chirp()
    time = np.arange(0.0, chirp.duration, 1e-3)
    f = chirp.f0 + (chirp.f1 - chirp.f0) / chirp.duration * time
    printed = np.sin(2.0 * np.pi * f)
    crossings = np.flatnonzero(np.signbit(printed[:-1]) != np.signbit(printed[1:]))
    tone = 0.5 * (len(crossings) - 1) / float(time[crossings[-1]] - time[crossings[0]])
    figure, (axes,) = new_figure(width=8.6, height=2.8)
    part = time <= 20.0
    meant = chirp.sample(time[part])[:, 0] / chirp.amplitude
    axes.plot(*thin(time[part], meant, most=1500), color=COLOURS["data"], linewidth=0.7, label="integrated phase")
    axes.plot(time[part][::20], printed[part][::20], color=COLOURS["error"], label="as printed")
    axes.set(xlabel="time [s]", ylabel="φd / S₀ [–]")
    legend(axes)
    return Finding(
        title="The chirp of Eq. 17",
        values={"erratum.chirp": tone},
        figures=[(figure, "Eq. 17 as printed, and with the integral of the frequency as phase.")],
    )
