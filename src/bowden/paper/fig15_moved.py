"""Fig. 15 and Table 1: the sheath is bent further while the bench runs."""

from dataclasses import replace

import numpy as np

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, new_figure, thin
from bowden.paper.bench import adaptive as adaptive_law
from bowden.paper.bench import bench_run, run_bench
from bowden.paper.calibration import bench_fit, gains
from bowden.paper.experiment import Finding
from bowden.paper.plots import dead_zone_deg, loop
from bowden.plants.presets import paper
from bowden.records.metrics import rmse


def run() -> Finding:
    """Observer and adaptive law under the same moved sheath; no gain is changed for it."""
    fit = bench_fit()
    start, end = fit.moved
    observer, adaptive = bench_run("observer", moved=True), bench_run("adaptive", moved=True)
    soft = adaptive_law(**(gains("bench") | {"feedback_gain": 20.0}))
    loops, (left, right) = new_figure(columns=2, width=8.6, height=4.6)
    for axes, trace, title in ((left, observer, "observer"), (right, adaptive, "adaptive")):
        for first, last, label, colour in (
            (0.0, start, "before", COLOURS["uncompensated"]),
            (start, end, "while moved", COLOURS["motor"]),
            (end, np.inf, "after", COLOURS["observer"] if trace is observer else COLOURS["adaptive"]),
        ):
            loop(axes, trace, colour, first, last, label)
        axes.set_ylabel(f"{title}: joint angle [°]")
        legend(axes, 3)
    errors, (top, bottom) = new_figure(rows=2, width=8.6, height=4.0, share_x=True)
    for trace, name in ((observer, "observer"), (adaptive, "adaptive")):
        top.plot(*thin(trace.time, trace.error * DEGREES, most=1500), color=COLOURS[name], label=name)
    top.set(ylabel="error [°]")
    legend(top)
    bottom.plot(observer.time[::50], paper.moved_sheath(fit)(observer.time[::50]) * DEGREES, color=COLOURS["reference"])
    bottom.set(xlabel="time [s]", ylabel="sheath's bend [°]")
    dead_zones = [dead_zone_deg(observer, *span) for span in ((0.0, start), (end, np.inf))]
    return Finding(
        title="Sheath moved while running (Dinh 2017, Fig. 15)",
        values={
            "table1.observer.varying": rmse(observer.error) * DEGREES,
            "table1.adaptive.varying": rmse(adaptive.error) * DEGREES,
            "fig15.deadzone.start": dead_zones[0],
            "fig15.deadzone.end": dead_zones[1],
        },
        details={"soft_and_quick": rmse(run_bench(soft, moved=True, fit=replace(fit, period=4.0)).error) * DEGREES},
        figures=[
            (loops, "Joint over reference before, while and after the sheath is bent to twice its angle."),
            (errors, "Tracking error of both laws, and the sheath's total bend."),
        ],
        text=f"Our law on the same bench: {rmse(bench_run('ours', moved=True).error) * DEGREES:.3f}° RMS.",
    )
