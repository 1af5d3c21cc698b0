"""Where the printed gains stand: stability of the sampled loop over λ and κ."""

import numpy as np

from bowden.control.laws.adaptive import PRINTED, AdaptiveGains
from bowden.control.stability import adaptive_model, closed_loop_poles, servo_model
from bowden.drawing.style import COLOURS, new_figure
from bowden.paper.calibration import bench_fit
from bowden.paper.calibration import gains as chosen_gains
from bowden.paper.experiment import Finding
from bowden.paper.gain_choice import corners, worst_margins
from bowden.plants.presets.bench import bench


def run() -> Finding:
    """Largest closed-loop pole over (λ, κ), worst of β̂ from 0 to 1.1/αφ and of the slope within ± 10 %."""
    plant = bench(bench_fit())
    lambdas, kappas = np.geomspace(0.005, 4.0, 61), np.geomspace(1.0, 400.0, 53)
    loops = {a: servo_model(plant.servo, plant.sample_time, plant.delay, a) for a, _, _ in corners(plant)}
    base = AdaptiveGains(**chosen_gains("bench"))

    def largest(error_gain: float, feedback_gain: float) -> float:
        gains = AdaptiveGains(error_gain, feedback_gain, derivative_time=base.derivative_time)
        return max(
            float(np.max(np.abs(closed_loop_poles(loops[a], adaptive_model(gains, plant.sample_time, beta, bound)))))
            for a, beta, bound in corners(plant)
        )

    poles = np.array([[largest(x, y) for x in lambdas] for y in kappas])
    chosen = worst_margins(plant, base)
    assert chosen is not None
    figure, (axes,) = new_figure(width=8.6, height=4.8)
    axes.contourf(lambdas, kappas, poles, levels=[0.0, 1.0, 99.0], colors=["#d9ebf7", "#fde3c8"])
    axes.contour(lambdas, kappas, poles, levels=[1.0], colors=COLOURS["reference"], linewidths=1.0)
    axes.plot(PRINTED.error_gain, PRINTED.feedback_gain, "X", color=COLOURS["error"], markersize=10)
    axes.plot(base.error_gain, base.feedback_gain, "o", color=COLOURS["adaptive"], markersize=9)
    for gains, name, side in ((PRINTED, "printed", "right"), (base, "by margin", "left")):
        axes.annotate(
            name,
            (gains.error_gain, gains.feedback_gain),
            textcoords="offset points",
            xytext=(-12, 0) if side == "right" else (12, 0),
            ha=side,
            va="center",
        )
    axes.text(0.006, 1.3, "stable", fontsize=10)
    axes.text(3.6, 250.0, "unstable", fontsize=10, ha="right")
    axes.set(xscale="log", yscale="log", xlabel="λ [s]", ylabel="κ [1/s]")
    axes.grid(False)
    return Finding(
        title="Stability over λ and κ",
        values={},
        figures=[
            (
                figure,
                "Linearised sampled loop at 1 kHz with one sample of delay: stable for every β̂ from 0 to 1.1/αφ, D̂m "
                "from 0 to 0.4 rad and slope within ± 10 % (blue), or not (orange).",
            )
        ],
        text=f"The gains λ = {base.error_gain:g}, κ = {base.feedback_gain:g} are the ones with the largest κ "
        f"that keep 12 dB and 60° over that range; their worst margins are {chosen.gain_margin_db:.1f} dB and "
        f"{chosen.phase_margin_deg:.0f}°. No run of Table 1 was used for the choice.",
    )
