"""Fig. 6: the suit without compensation, and how far it lags behind."""

from bowden.control import LAWS
from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, new_figure, thin
from bowden.paper.calibration import suit_fit
from bowden.paper.experiment import Finding
from bowden.paper.plots import over_time
from bowden.paper.suit_rows import suit_uncompensated
from bowden.records.metrics import delay
from bowden.sim.suit_runs import run_suit


def run() -> Finding:
    """Periodic minimum jerk 0–90° without compensation, at the period that the delay asks for."""
    fit = suit_fit()
    period = fit.period
    trace, other = run_suit(LAWS["uncompensated"], count=2, period=period, fit=fit), suit_uncompensated().trace
    late, usual = (delay(t.time, t["reference"], t["joint"]) for t in (trace, other))
    figure, (top, bottom) = new_figure(rows=2, width=8.6, height=4.4, share_x=True)
    over_time(top, trace, COLOURS["uncompensated"], "elbow", 2.0 * period)
    top.set(xlabel="")
    legend(top)
    bottom.plot(*thin(trace.time, trace.error * DEGREES, most=1500), color=COLOURS["uncompensated"])
    bottom.set(xlabel="time [s]", ylabel="error [°]")
    return Finding(
        title="The suit without compensation (Dinh 2017, Fig. 6)",
        values={"fig6.delay": late},
        details={"period": period, "usual": usual or float("nan")},
        figures=[(figure, "Desired and true angle of the elbow, and the error, without compensation.")],
        text="Delay is the shift that makes both agree best. The paper’s Fig. 6 names no period: at the 25 s of its "
        f"Fig. 17 the same suit has {usual:.2f} s, and 3 s at {period:.1f} s, which is taken for it. At 25 s a delay "
        "of 3 s would be an error of up to 1.875·90°/12.5 s · 3 s = 40.5°, more than the published 30°.",
    )
