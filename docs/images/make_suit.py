"""Draw the pictures of docs/day_one_suit.md from runs of the paper's suit: ``python docs/images/make_suit.py``.

The same source gives the same bytes; run it again when the suit, a law or the calibration changes.
"""

from pathlib import Path

from matplotlib.figure import Figure

from bowden.control import LAWS
from bowden.core.units import DEGREES
from bowden.drawing import style
from bowden.drawing.style import COLOURS, legend, thin
from bowden.sim.suit_runs import DRIVE_INTEGRAL, run_suit, suit_adaptive, suit_ours


def elbow() -> Figure:
    """Elbow, tensions and current in two flexions: without compensation, adaptive, ours on a drive with an integral."""
    runs = {
        "uncompensated": run_suit(LAWS["uncompensated"], count=2),
        "adaptive": run_suit(suit_adaptive(), count=2),
        "bowden": run_suit(suit_ours(), count=2, drive_integral=DRIVE_INTEGRAL),
    }
    figure, (top, middle, bottom) = style.new_figure(rows=3, width=8.6, height=6.4, share_x=True)
    for name, trace in runs.items():
        top.plot(*thin(trace.time, trace["joint"] * DEGREES, most=900), color=COLOURS[name], label=name)
        bottom.plot(*thin(trace.time, trace["current"], most=900), color=COLOURS[name], lw=0.9)
    plain = runs["uncompensated"]
    top.plot(
        *thin(plain.time, plain["reference"] * DEGREES, most=900), "--", color=COLOURS["reference"], label="desired"
    )
    for side, colour in (("flexor", COLOURS["joint"]), ("extensor", COLOURS["motor"])):
        middle.plot(*thin(plain.time, plain[f"{side}_tension"], most=900), color=colour, label=f"{side}, arm")
        middle.plot(
            *thin(plain.time, plain[f"{side}_motor_tension"], most=900), ":", color=colour, label=f"{side}, spool"
        )
    top.set(ylabel="elbow [°]")
    top.set_title("Elbow")
    middle.set(ylabel="tension [N]")
    middle.set_title("Tension, uncompensated")
    bottom.set_title("Motor current")
    bottom.set(ylabel="current [A]", xlabel="time [s]")
    legend(top, columns=4)
    legend(middle, columns=4)
    style.finish(figure)
    return figure


if __name__ == "__main__":
    drawn = elbow()
    with style.drawing():
        drawn.savefig(Path(__file__).with_name("suit.svg"), metadata={"Date": None, "Creator": None})
