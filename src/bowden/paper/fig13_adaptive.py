"""Figs 13 and 14 and Table 1: the adaptive law at constant bend, and what its estimates do."""

import math
from typing import Any

import numpy as np

from bowden.control.laws.adaptive import PRINTED, AdaptiveGains
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import DEGREES, RADIANS
from bowden.drawing.style import COLOURS, legend, new_figure
from bowden.models.cable.backlash import Play
from bowden.paper.bench import adaptive, bench_run, run_bench, true_bound
from bowden.paper.calibration import bench_fit, gains
from bowden.paper.experiment import Finding
from bowden.paper.plots import time_and_loop
from bowden.paper.static_plant import StaticRun, static_plant_run
from bowden.plants.presets import paper
from bowden.plants.presets.bench import bench
from bowden.records.metrics import convergence_time, rmse

IN_DEGREES = PRINTED._replace(
    smoothing=PRINTED.smoothing * RADIANS,
    slope_adaptation=PRINTED.slope_adaptation * DEGREES**2,
    slope_leakage=PRINTED.slope_leakage * RADIANS**2,
)
"""The printed gains where the law counts angles in degrees, converted to radians: δ1·φ̄·s has two angles in it, "
"ε one."""
PERIODS = (4.0, 10.0)
"""Of the reference on the static plant; the paper prints none [s]."""
_LONG = 300.0  # s; long enough for D̂m to come to its end


def static_run(gains: AdaptiveGains, period: float, duration: float = _LONG) -> StaticRun:
    """The law solved together with the paper's static plant, a play of 5° at the joint."""
    slope = bench().cable.slope
    reference = PeriodicMinimumJerk(0.0, paper.document()["chosen"]["stroke_deg"] * RADIANS, period)
    return static_plant_run(gains, Play(half_width=true_bound() / slope), reference, duration, 1e-3)


def run() -> Finding:
    """The adaptive law from rest, its λ and κ by margin; and the printed gains on the static plant."""
    trace = bench_run("adaptive")
    late = trace.time >= 10.0
    slower = {kappa: run_bench(adaptive(**(gains("bench") | {"feedback_gain": kappa}))) for kappa in (10.0, 20.0)}
    static = {
        (unit, period): static_run(gains, period)
        for unit, gains in (("radians", PRINTED), ("degrees", IN_DEGREES))
        for period in PERIODS
    }
    shown, other = static["radians", PERIODS[0]], static["degrees", PERIODS[0]]
    beta = {key: _settled(key, one) for key, one in static.items()}
    times = {
        name: {
            key: convergence_time(one.time, getattr(one, name), period=key[1]) or _LONG for key, one in static.items()
        }
        for name in ("slope_inverse", "bound")
    }
    true_beta = 1.0 / bench().cable.slope
    reaches = [_reaches(one.slope_inverse, true_beta) for (unit, _), one in static.items() if unit == "degrees"]
    bound_reaches = _reaches(shown.bound, true_bound())
    both = {key: max(times["slope_inverse"][key], times["bound"][key]) for key in static}
    early = {key: float(one.slope_inverse[2500]) for key, one in static.items()}
    slow = static["radians", PERIODS[1]]
    return Finding(
        title="Adaptive law, constant bend (Dinh 2017, Figs 13 and 14)",
        values={
            "table1.adaptive.constant": rmse(trace.error) * DEGREES,
            "fig14.convergence": both["radians", PERIODS[0]],
            "fig14.convergence.slope_inverse": times["slope_inverse"]["radians", PERIODS[0]],
            "fig14.convergence.bound": times["bound"]["radians", PERIODS[0]],
            "erratum.gains.static": _rmse_deg(shown, 60.0),
            "erratum.gains.static_after_10s": _rmse_deg(slow, 60.0, 10.0),
            "erratum.convergence.slope_inverse": beta["radians", PERIODS[0]],
            "erratum.convergence.slope_inverse_at_2_5s": early["radians", PERIODS[0]],
            "erratum.convergence.bound": float(shown.bound[60000]),
        },
        intervals={
            "fig14.convergence": _range(both.values()),
            "fig14.convergence.slope_inverse": _range([*times["slope_inverse"].values(), *reaches]),
            "fig14.convergence.bound": _range([*times["bound"].values(), bound_reaches]),
            "erratum.gains.static": _range([_rmse_deg(shown, 60.0), _rmse_deg(slow, 60.0)]),
            "erratum.convergence.slope_inverse": _range(beta.values()),
            "erratum.convergence.slope_inverse_at_2_5s": _range(early.values()),
        },
        details={
            "kappa_10": rmse(slower[10.0].error) * DEGREES,
            "kappa_20": rmse(slower[20.0].error) * DEGREES,
            "true_bound": true_bound(),
            "beta_radians": times["slope_inverse"]["radians", PERIODS[0]],
            "beta_degrees": beta["degrees", PERIODS[0]],
            "beta_reaches": reaches[0],
            "bound_reaches": bound_reaches,
            "early_degrees": early["degrees", PERIODS[0]],
            "static_10s": _rmse_deg(slow, 60.0),
            "static_30s": _rmse_deg(shown, 30.0),
            "static_degrees": _rmse_deg(other, 60.0),
        },
        figures=[
            (time_and_loop(trace, COLOURS["adaptive"], "adaptive"), "Adaptive law from rest, estimates starting at 0."),
            (
                _estimates(static, true_beta),
                "Estimates under the printed gains on the static plant, period of 4 s, the law counting in radians "
                "and in degrees. Dotted: 1/αφ, and the true height of the hysteresis; dashed: 2.5 s, by when the "
                "paper has them converged.",
            ),
        ],
        text=f"λ = {gains('bench')['error_gain']:g} s and κ = {gains('bench')['feedback_gain']:g} 1/s by margin, at a "
        f"period of {bench_fit().period:g} s: RMSE {rmse(trace.error) * DEGREES:.3f}°, "
        f"{rmse(trace.error[late]) * DEGREES:.3f}° after 10 s. Our law on the same bench: "
        f"{rmse(bench_run('ours').error) * DEGREES:.3f}°. Convergence is the time after which "
        "the moving mean over one period stays within 5 % of where it ends.",
    )


def _estimates(static: dict[tuple[str, float], StaticRun], true_beta: float) -> Any:
    figure, (top, bottom) = new_figure(rows=2, width=8.6, height=4.4, share_x=True)
    for unit, style in (("radians", "-"), ("degrees", ":")):
        one = static[unit, PERIODS[0]]
        part = slice(0, 60000, 50)
        top.plot(one.time[part], one.slope_inverse[part], style, color=COLOURS["adaptive"], lw=1.0, label=unit)
        bottom.plot(one.time[part], one.bound[part], style, color=COLOURS["adaptive"], lw=1.0)
    for axes, true, label in ((top, true_beta, r"$\hatβ$ [–]"), (bottom, true_bound(), r"$\hat{D}_m$ [rad]")):
        axes.axhline(true, color=COLOURS["reference"], linestyle=":", linewidth=1.0)
        axes.axvline(2.5, color=COLOURS["limit"], linestyle="--", linewidth=1.0)
        axes.set(ylabel=label)
    bottom.set(xlabel="time [s]")
    legend(top)
    return figure


def _settled(key: tuple[str, float], one: StaticRun) -> float:
    """β̂ at 60 s, mean over a period."""
    return float(one.slope_inverse[60000 - round(1000 * key[1]) : 60000].mean())


def _rmse_deg(one: StaticRun, end: float, start: float = 0.0) -> float:
    part = (one.time >= start) & (one.time < end)
    return rmse((one.joint - one.reference)[part]) * DEGREES


def _reaches(values: Any, true: float) -> float:
    """When an estimate is first within 5 % of the true value [s]; infinite where it never is."""
    near = np.abs(values - true) < 0.05 * true
    return float(np.argmax(near)) * 1e-3 if near.any() else math.inf


def _range(values: Any) -> tuple[float, float]:
    return min(values), max(values)
