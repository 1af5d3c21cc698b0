"""Figs 9 and 12 and Table 1: the bench at constant bend, without compensation and with the backlash observer."""

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS
from bowden.paper.bench import bench_run
from bowden.paper.experiment import Finding
from bowden.paper.plots import dead_zone_deg, time_and_loop
from bowden.records.metrics import rmse


def fig09() -> Finding:
    """The motor follows the reference; the joint shows the cable's hysteresis."""
    trace = bench_run("uncompensated")
    figures = trace.metrics()
    assert figures.rmse_deg is not None
    assert figures.hysteresis_width_deg is not None
    return Finding(
        title="The bench without compensation (Dinh 2017, Fig. 9)",
        values={"fig9.deadzone": dead_zone_deg(trace)},
        details={"uncompensated_rmse": figures.rmse_deg},
        figures=[
            (
                time_and_loop(trace, COLOURS["uncompensated"], "measured"),
                "Minimum jerk 0–70° sent to the motor as it is. A: over time; B: joint over reference.",
            )
        ],
        text=f"RMSE {figures.rmse_deg:.2f}°. Over the <em>reference</em> the loop is "
        f"{figures.hysteresis_width_deg:.1f}° high at mid-stroke, because the servo's lag adds to the cable's own; "
        "the dead zone in the table is the cable's alone, joint over motor.",
    )


def fig12() -> Finding:
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
