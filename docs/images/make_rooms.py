"""Draw the figure of docs/background/architecture.md: ``python docs/images/make_rooms.py``.

The rooms from the ground up, and the ways of a sample, a log and a rig through them. The same source gives the same
bytes.
"""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from bowden.drawing import style

FLOORS: list[list[tuple[str, str]]] = [
    [("core", "kernels, nested states, signals, quantities, errors, files")],
    [("drawing", "how figures and screens look"), ("records", "traces, tables, figures of merit")],
    [("models", "equations: cable/ drive/ suit/")],
    [("sensing", "filters, EMG envelope, onset, intent"), ("safety", "limits, faults, supervisor")],
    [("control", "Law, Knowledge, references, laws/, our_law/, admittance/")],
    [("cycle", "sense → reference → law → supervisor: one kernel")],
    [("plants", "Plant; bench, any cable, suit, your own file")],
    [("rig", "rig.toml ↔ the frozen Rig; presets")],
    [("sim", "run one, run many, inject faults"), ("identify", "log → cable/ servo/ emg/")],
    [("hardware", "drives/ buses/ emg/ twin/")],
    [("design", "check, tune"), ("export", "C99"), ("study", "campaigns")],
    [("live", "session, processes, recorder, logs, replay")],
    [("report", "figures, pages"), ("console", "the browser console")],
    [("operations", "each once: function, result"), ("views", "tables, files, next steps")],
    [("paper", "figures and claims"), ("app", "command line, jobs")],
]
"""From the ground up; tests/test_layers.py has the exact order."""

_WAYS = {
    "sample": ("#0072b2", ["plants", "cycle", "control", "safety", "hardware", "live"]),
    "log": ("#d55e00", ["identify", "plants", "rig", "design"]),
    "rig": ("#009e73", ["rig", "control", "cycle", "live", "report"]),
}
_LEFT, _WIDTH, _HEIGHT, _STEP = 0.0, 10.0, 0.62, 0.86


def rooms() -> Figure:
    """Boxes on floors; a mark in each room that a way goes through, with its turn."""
    figure = Figure(figsize=(10.0, 7.6), layout="constrained")
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.set(xlim=(-0.1, 11.9), ylim=(-0.9, len(FLOORS) * _STEP))
    for level, floor in enumerate(FLOORS):
        width = (_WIDTH - 0.15 * (len(floor) - 1)) / len(floor)
        for i, (name, holds) in enumerate(floor):
            x, y = _LEFT + i * (width + 0.15), level * _STEP
            axes.add_patch(
                FancyBboxPatch(
                    (x, y), width, _HEIGHT, boxstyle="round,pad=0.02", facecolor="#f2f4f6", edgecolor="#8a949d"
                )
            )
            axes.text(x + 0.12, y + 0.4, name, fontsize=10.5, fontweight="bold", va="center")
            axes.text(x + 0.12, y + 0.16, holds, fontsize=8.0, va="center", color="#444444")
            marks = [(colour, way.index(name) + 1) for colour, way in _WAYS.values() if name in way]
            for j, (colour, turn) in enumerate(reversed(marks)):
                axes.text(
                    x + width - 0.2 - 0.34 * j,
                    y + 0.4,
                    str(turn),
                    fontsize=9.0,
                    color="white",
                    ha="center",
                    va="center",
                    bbox={"boxstyle": "circle,pad=0.22", "facecolor": colour, "edgecolor": "none"},
                )
    arrow = {"arrowstyle": "->", "color": "#444444"}
    axes.annotate("", xy=(10.45, 0.1), xytext=(10.45, len(FLOORS) * _STEP - 0.3), arrowprops=arrow)
    axes.text(10.6, len(FLOORS) * _STEP / 2, "imports\npoint down", fontsize=9.5, va="center", color="#444444")
    for i, (name, (colour, _)) in enumerate(_WAYS.items()):
        axes.text(
            0.2 + 2.9 * i,
            -0.55,
            f"the way of a {name}",
            fontsize=9.5,
            color="white",
            va="center",
            bbox={"boxstyle": "round,pad=0.35", "facecolor": colour, "edgecolor": "none"},
        )
    return figure


if __name__ == "__main__":
    with style.drawing():
        rooms().savefig(Path(__file__).with_name("rooms.svg"), metadata={"Date": None, "Creator": None})
