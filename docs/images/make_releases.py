"""Draw the figure of releases: ``python docs/images/make_releases.py``, from what ``make soak PARTS=releases`` has
kept, or anew in some minutes.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

from bowden.drawing import style

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from releases import Release, kept

_GROUPS = (
    ("bench", False, "bench", "#0072b2"),
    ("suit", False, "suit", "#d55e00"),
    ("suit", True, "suit, saturated", "#009e73"),
)


def drawn(found: list[Release]) -> Figure:
    """Peak speeds, ends and times of releases."""
    figure, (speed, end, time) = style.new_figure(1, 3, 10.0, 3.6)
    for kind, forced, name, colour in _GROUPS:
        ones = [one for one in found if one.kind == kind and (one.cause == "saturated" and kind == "suit") == forced]
        start, marker = [one.start for one in ones], {"s": 5, "color": colour, "linewidth": 0, "label": name}
        speed.scatter(start, [one.speed / one.allowed for one in ones], **marker)
        end.scatter(start, [one.end for one in ones], **marker)
        time.scatter(start, [one.seconds for one in ones], **marker)
    speed.axhline(1.0, color=style.COLOURS["limit"], linewidth=0.8)
    speed.set(ylabel="peak speed over the allowed [–]", ylim=(0.0, 1.6), title="Speed of the joint")
    end.axhline(0.0, color=style.COLOURS["limit"], linewidth=0.8)
    end.set(ylabel="joint from its rest [°]", title="Where the power goes off")
    time.set(ylabel="time to power off [s]", ylim=(0.0, None), title="How long it takes")
    for axes in (speed, end, time):
        axes.set(xlabel="joint at the stop, from its rest [°]")
    style.legend_of_all([speed, end, time])
    style.finish(figure)
    return figure


def main() -> None:
    """Draw it."""
    with style.drawing():
        figure = drawn(kept())
        figure.savefig(Path(__file__).with_name("releases.png"), metadata={"Software": None}, dpi=110)


if __name__ == "__main__":
    main()
