"""Fig. 12 and Table 1: the backlash observer at constant bend."""

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS
from bowden.paper.bench import bench_run
from bowden.paper.experiment import Finding
from bowden.paper.plots import time_and_loop
from bowden.records.metrics import rmse


def run() -> Finding:
    """The observer, whose α̂h is fitted so that its RMSE is the published one."""
    trace = bench_run("observer")
    return Finding(
        title="Backlash observer, constant bend (Dinh 2017, Fig. 12)",
        values={"table1.observer.constant": rmse(trace.error) * DEGREES},
        figures=[
            (
                time_and_loop(trace, COLOURS["observer"], "observer"),
                "Backlash observer. The dead zone is narrower than without compensation and still there, as in the "
                "paper.",
            )
        ],
        text="With exact parameters the observer would be far better than published at this period: the "
        "mismatch is fitted.",
    )
