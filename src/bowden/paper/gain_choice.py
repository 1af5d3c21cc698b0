"""How λ and κ of the adaptive law are chosen: for margin on the constant bench, before Table 1 is computed.

The rule, stated beforehand: on a grid of λ and κ, keep the pairs whose sampled loop has a gain margin of at least 12 dB
and a phase margin of at least 60° for β̂ from 0 (where it starts) to a tenth above 1/αφ, D̂m from 0 to 0.4 rad (where it
drifts to in minutes) and the cable's slope within ± 10 %; of these take the largest κ, which is the integral gain and
so sets the tracking error, and with it the λ of the largest phase margin. No simulation enters, and no moved sheath.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from bowden.control.laws.adaptive import PRINTED, AdaptiveGains
from bowden.control.stability import Margins, adaptive_model, closed_loop_poles, margins, servo_model
from bowden.drawing.style import COLOURS, new_figure
from bowden.paper.calibration import bench_fit
from bowden.paper.calibration import gains as chosen_gains
from bowden.paper.experiment import Finding
from bowden.plants.bench import Bench
from bowden.plants.presets.bench import bench

ERROR_GAINS = tuple(round(0.01 + 0.005 * i, 3) for i in range(19))
"""Grid of λ, 0.01–0.1 [s]."""
FEEDBACK_GAINS = tuple(5.0 * i for i in range(1, 21))
"""Grid of κ, 5–100 [1/s]."""


@dataclass(frozen=True)
class Choice:
    """The chosen gains and their worst margins."""

    gains: AdaptiveGains
    gain_margin_db: float
    phase_margin_deg: float


def corners(bench: Bench) -> list[tuple[float, float, float]]:
    """(slope, β̂, D̂m) at which the margins must hold."""
    slope = bench.cable.slope
    return list(itertools.product((0.9 * slope, 1.1 * slope), (0.0, 0.5 / slope, 1.1 / slope), (0.0, 0.4)))


def worst_margins(bench: Bench, gains: AdaptiveGains) -> Margins | None:
    """The smallest gain and phase margin over the corners; None where one of them is unstable."""
    found: list[Margins] = []
    for slope, slope_inverse, bound in corners(bench):
        plant = servo_model(bench.servo, bench.sample_time, bench.delay, slope)
        law = adaptive_model(gains, bench.sample_time, slope_inverse, bound)
        found.append(margins(plant, law, bench.sample_time))
        if not found[-1].stable:
            return None
    return Margins(
        stable=True,
        gain_margin_db=min((m.gain_margin_db for m in found if m.gain_margin_db is not None), default=None),
        phase_margin_deg=min((m.phase_margin_deg for m in found if m.phase_margin_deg is not None), default=None),
        delay_margin_s=min((m.delay_margin_s for m in found if m.delay_margin_s is not None), default=None),
        largest_pole=max(m.largest_pole for m in found),
    )


def choose_gains(bench: Bench, gain_margin_db: float = 12.0, phase_margin_deg: float = 60.0) -> Choice:
    """Apply the rule.

    Raises:
        ValueError: no pair on the grid has the margins.
    """
    for feedback in reversed(FEEDBACK_GAINS):
        best: Choice | None = None
        for error in ERROR_GAINS:
            gains = AdaptiveGains(error_gain=error, feedback_gain=feedback)
            worst = worst_margins(bench, gains)
            if worst is None or worst.gain_margin_db is None or worst.phase_margin_deg is None:
                continue
            if worst.gain_margin_db < gain_margin_db or worst.phase_margin_deg < phase_margin_deg:
                continue
            if best is None or worst.phase_margin_deg > best.phase_margin_deg:
                best = Choice(gains, worst.gain_margin_db, worst.phase_margin_deg)
        if best is not None:
            return best
    raise ValueError("no λ and κ on the grid have the margins asked for")


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
