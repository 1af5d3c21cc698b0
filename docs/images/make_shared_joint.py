"""Draw the figure of docs/several_motors.md: ``python docs/images/make_shared_joint.py``, some seconds.

Two motors on one joint, each under the law `bowden`, while somebody pushes the joint to and fro. The same source gives
the same bytes.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import DEGREES, RADIANS
from bowden.drawing import style
from bowden.drawing.style import COLOURS, thin
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import default_bench
from bowden.sim.joint import CabledJoint, JointMotor, simulate_joint

_STEP, _SECONDS = 1e-3, 16.0
_PUSH, _HERTZ = 0.5, 0.4
"""Amplitude [N·m] and frequency [Hz] of who pushes the joint."""
_STIFFNESS = 10.0
"""Of each cable at the joint [N·m/rad]."""
_CONTRACTIONS = ((-4.0, "#cc79a7"), (0.0, "#d55e00"), (4.0, "#0072b2"))
"""Co-contraction [°], and its colour."""


class Course(NamedTuple):
    """What came of a run (n,)."""

    time: NDArray[np.float64]
    error: NDArray[np.float64]
    """Joint less reference [rad]."""
    pulls: NDArray[np.float64]
    """Torque of each cable on the joint (n, 2) [N·m]."""


def followed(contraction: float) -> Course:
    """A run with a co-contraction [rad]."""
    bench, law = default_bench(), LAWS["bowden"]
    bend = constant_bend(bench.sheath.bend)
    each = enumerate((("flexor", 1.0), ("extensor", -1.0)))
    motors = tuple(JointMotor(name, bench, bend, k, sign) for k, (name, sign) in each)
    push = _PUSH * np.sin(2.0 * np.pi * _HERTZ * np.arange(0.0, _SECONDS, _STEP))
    traces = simulate_joint(
        CabledJoint(motors, _STIFFNESS, contraction),
        (law, law),
        PeriodicMinimumJerk(0.0, 60.0 * RADIANS, 8.0),
        duration=_SECONDS,
        push=push,
    )
    first = traces[0]
    return Course(first.time, first.error, np.column_stack([trace["pull"] for trace in traces]))


def drawn(courses: dict[float, Course]) -> Figure:
    """Errors over time, and the torque of both cables without and with co-contraction."""
    figure, (error, pulls) = style.new_figure(2, 1, 8.0, 5.0, share_x=True)
    colours = dict(_CONTRACTIONS)
    for degrees, course in courses.items():
        rms = DEGREES * float(np.sqrt(np.mean(course.error**2)))
        label = f"{_signed(degrees)}: {rms:.2f}° RMS"
        error.plot(*thin(course.time, course.error * DEGREES, most=1500), color=colours[degrees], label=label)
    for degrees in (0.0, 4.0):
        for i, line in enumerate(("-", "--")):
            shown = thin(courses[degrees].time, courses[degrees].pulls[:, i], most=1500)
            who = ("flexor", "extensor")[i]
            pulls.plot(*shown, line, color=colours[degrees], label=f"{_signed(degrees)}, {who}")
    error.set(ylabel="joint − reference [°]")
    error.set_title("Error by co-contraction")
    pulls.set(ylabel="torque on the joint [N·m]", xlabel="time [s]")
    pulls.axhline(0.0, color=COLOURS["limit"], linewidth=0.8)
    pulls.set_title("What each cable pulls")
    for axes in (error, pulls):
        style.legend(axes)
    style.finish(figure)
    return figure


def _signed(degrees: float) -> str:
    return f"{degrees:+g}°".replace("-", "−") if degrees else "0°"


def main() -> None:
    """Draw it, and say what came of each run."""
    courses = {degrees: followed(degrees * RADIANS) for degrees, _ in _CONTRACTIONS}
    for degrees, course in courses.items():
        rms, peak = float(np.sqrt(np.mean(course.error**2))), float(np.abs(course.error).max())
        slack = 100.0 * (course.pulls <= 0.0).mean(axis=0)
        print(
            f"{degrees:+g}°: {rms * DEGREES:.3f}° RMS, {peak * DEGREES:.2f}° at most; slack {slack[0]:.0f} % and "
            f"{slack[1]:.0f} % of the time; {course.pulls.max():.2f} N·m at most"
        )
    figure = drawn(courses)
    with style.drawing():
        figure.savefig(Path(__file__).with_name("shared_joint.svg"), metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()
