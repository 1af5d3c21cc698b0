"""Draw the figure of docs/background/suit.md: ``PYTHONPATH=tests python docs/images/make_admittance.py``, some seconds.

The same source gives the same bytes; run it again when the suit or its admittance changes.
"""

from pathlib import Path

from matplotlib.figure import Figure

from bowden.control import LAWS
from bowden.core.units import RADIANS
from bowden.drawing import style
from bowden.drawing.style import COLOURS, thin
from bowden.plants.presets.suit import suit
from support.pushed_suit import QUIET, PushedReference, back_driven, misjudged, pushed, sweep, swinging

_LAW = LAWS["uncompensated"]
_SOURCES = {"load cell": (False, COLOURS["joint"]), "estimate": (True, COLOURS["motor"])}
"""Source of the torque → whether it is estimated, and its colour."""
_STIFFNESSES = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
"""Of the wearer [N·m/rad]."""
_LEAST = 1e-5
"""Drawn of an elbow that stands still [rad/s]."""
_DAMPINGS = (0.0, 0.5, 10.0)
"""Of the wearer, of which the worst is drawn [N·m·s/rad]."""


def felt_and_settled() -> Figure:
    """Torque of the suit on an elbow that its wearer swings, and how fast an elbow still is that should rest."""
    figure, (left, right) = style.new_figure(columns=2, width=10.0, height=3.6)
    made, firm = suit(), swinging(25.0 * RADIANS)
    off = back_driven(made, _LAW, firm)
    runs = {name: pushed(made, PushedReference(_LAW, estimated=one), firm) for name, (one, _) in _SOURCES.items()}
    for name, trace in {"switched off": off, **runs}.items():
        part = (trace.time >= 8.0) & (trace.time < 12.0)
        colour = _SOURCES[name][1] if name in _SOURCES else COLOURS["uncompensated"]
        shown = thin(trace.time[part] - 8.0, trace["interaction_torque"][part], most=900)
        left.plot(*shown, color=colour, label=name)
    for name, (estimated, colour) in _SOURCES.items():
        how = PushedReference(_LAW, estimated=estimated)
        speeds = [
            max(_LEAST, *(one.speed for one in sweep(misjudged(made), how, (stiffness,), _DAMPINGS, believed=made)))
            for stiffness in _STIFFNESSES
        ]
        right.semilogy(range(len(speeds)), speeds, "o-", color=colour, label=name)
    right.axhline(QUIET, color=COLOURS["limit"], linestyle="--", label="counts as at rest")
    left.set(xlabel="time [s]", ylabel="torque on the elbow [N·m]")
    left.set_title("A wearer who swings")
    right.set(xlabel="wearer's stiffness [N·m/rad]", ylabel="speed left [rad/s]", ylim=(0.5 * _LEAST, 1.0))
    right.set_xticks(range(len(_STIFFNESSES)), [f"{one:g}" for one in _STIFFNESSES])
    right.set_title("A wearer who rests")
    left.legend(loc="lower right")
    right.legend(loc="upper right")
    style.finish(figure)
    return figure


if __name__ == "__main__":
    drawn = felt_and_settled()
    with style.drawing():
        drawn.savefig(Path(__file__).with_name("admittance.svg"), metadata={"Date": None, "Creator": None})
