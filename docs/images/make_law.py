"""Draw the figure of docs/background/our_law.md: ``python docs/images/make_law.py``.

Our law, the paper's adaptive law and active disturbance rejection on the bench of Fig. 15, whose sheath is bent to
twice its angle from 10 to 20 s. The same source gives the same bytes.
"""

from pathlib import Path

from matplotlib.figure import Figure

from bowden.control import LAWS
from bowden.core.units import DEGREES
from bowden.drawing import style
from bowden.plants.presets import paper
from bowden.plants.presets.bench import bench
from bowden.sim.run import simulate

_SHOWN = {
    "adaptive": "adaptive, the paper's",
    "active_disturbance_rejection": "disturbance rejection",
    "bowden": "ours",
}
_FROM, _TO = 35.02, 35.42
"""One reversal, seen closely [s]."""
_SEED = 1
"""Of the encoders' noise."""


def comparison() -> Figure:
    """Errors over a minute, one reversal, and our law's estimate of the dead zone."""
    figure, (errors, near, widths, motors) = style.new_figure(2, 2, 10.0, 5.0)
    colours = style.colours_for(list(_SHOWN))
    for name, label in _SHOWN.items():
        trace = simulate(
            bench(), LAWS[name], paper.minimum_jerk(), duration=60.0, bend=paper.moved_sheath(), seed=_SEED
        )
        near_it = (trace.time >= _FROM) & (trace.time <= _TO)
        time, error, colour = trace.time, trace.error * DEGREES, colours[name]
        errors.plot(*style.thin(time, error), color=colour, label=label)
        near.plot(time[near_it], error[near_it], color=colour)
        motors.plot(time[near_it], trace["motor"][near_it] * DEGREES, color=colour)
        if name == "bowden":
            widths.plot(*style.thin(time, trace["law.deadzone.width"] * DEGREES), color=colour)
    for axes in (errors, widths):
        axes.axvspan(10.0, 20.0, color="0.93", label="sheath moves", zorder=0)
    errors.set(ylabel="joint − reference [°]", ylim=(-6.0, 4.0))
    errors.legend(loc="lower right", ncols=2)
    errors.set_title("Error over a minute, from rest")
    near.set(ylabel="joint − reference [°]")
    near.set_title("Error at one reversal")
    motors.set(ylabel="motor [°]", xlabel="time [s]")
    motors.set_title("Motor at that reversal")
    widths.set(ylabel="dead zone [° of motor]", xlabel="time [s]")
    widths.set_title("Our law's estimate of the dead zone")
    style.finish(figure)
    return figure


if __name__ == "__main__":
    drawn = comparison()
    with style.drawing():
        drawn.savefig(Path(__file__).with_name("our_law.svg"), metadata={"Date": None, "Creator": None})
