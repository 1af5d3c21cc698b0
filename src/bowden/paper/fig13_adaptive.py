"""Figs 13 and 14 and Table 1: the adaptive law at constant bend, and what its estimates do."""

import numpy as np

from bowden.core.metrics import convergence_time, rmse
from bowden.core.style import COLOURS, new_figure, thin
from bowden.core.units import DEGREES
from bowden.paper.bench import adaptive, run_bench, true_bound
from bowden.paper.experiment import Finding, Runs
from bowden.paper.plots import time_and_loop
from bowden.rig.presets import bench as paper

_LONG = 600.0  # s; in the minute of Table 1 the estimates are still on their way


def run(runs: Runs) -> Finding:
    """The adaptive law from rest, its gains chosen for margin only."""
    trace = runs.adaptive
    period = paper.calibration().period
    beta, bound = trace["law.slope_inverse"], trace["law.bound"]
    long = run_bench(adaptive(), duration=_LONG)
    times = [convergence_time(long.time, long[f"law.{name}"], period=period) for name in ("slope_inverse", "bound")]
    early = int(np.searchsorted(trace.time, 2.5))
    late = trace.time >= 10.0
    figure, (top, bottom) = new_figure(rows=2, width=8.6, height=4.4, share_x=True)
    cable = paper.bench().cable
    for axes, estimate, true, label in (
        (top, beta, 1.0 / cable.slope, r"$\hatβ$ [–]"),
        (bottom, bound, true_bound(), r"$\hat{D}_m$ [rad]"),
    ):
        axes.plot(*thin(trace.time, estimate, most=1500), color=COLOURS["adaptive"])
        axes.axhline(true, color=COLOURS["reference"], linestyle=":", linewidth=1.0)
        axes.axvline(2.5, color=COLOURS["limit"], linestyle="--", linewidth=1.0)
        axes.set(ylabel=label)
    bottom.set(xlabel="time [s]")
    converged = [t for t in times if t is not None]
    return Finding(
        title="Adaptive law, constant bend (Dinh 2017, Figs 13 and 14)",
        values={
            "table1.adaptive.constant": rmse(trace.error) * DEGREES,
            "fig14.convergence": max(converged) if len(converged) == 2 else None,
            "fig14.convergence.slope_inverse": times[0],
            "fig14.convergence.bound": times[1],
            "erratum.convergence.slope_inverse": float(beta[-1]),
            "erratum.convergence.slope_inverse_at_2_5s": float(beta[early]),
            "erratum.convergence.bound": float(bound[-1]),
        },
        details={
            "after_10s": rmse(trace.error[late]) * DEGREES,
            "true_bound": true_bound(),
            "long": _LONG,
            "beta_end": float(long["law.slope_inverse"][-1]),
            "bound_end": float(long["law.bound"][-1]),
        },
        figures=[
            (time_and_loop(trace, COLOURS["adaptive"], "adaptive"), "Adaptive law from rest, estimates starting at 0."),
            (
                figure,
                "Estimates of the adaptive law. Dotted: 1/αφ, and the true height of the hysteresis; "
                "dashed: 2.5 s, by when the paper has them converged.",
            ),
        ],
        text=f"RMSE after 10 s: {rmse(trace.error[late]) * DEGREES:.3f}°. Convergence is the time after which the "
        "moving mean over one period stays within 5 % of where it ends, in a run long enough for it to end anywhere.",
    )
