"""How a run is drawn: the joint over time beside its reference, and the error."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, stay_near, thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


def draw_motion(axes: "Axes", time: Array, reference: Array, joint: Array, colour: str = COLOURS["joint"]) -> None:
    """Reference and joint over time: (n,) [s], (n,) and (n,) [rad]."""
    axes.plot(*thin(time, joint * DEGREES), color=colour, label="joint")
    axes.plot(*thin(time, reference * DEGREES), color=COLOURS["reference"], lw=1.0, ls="--", label="reference")
    axes.set_ylabel("angle [°]")
    stay_near(axes, [reference * DEGREES], [joint * DEGREES])
    legend(axes)


def draw_error(axes: "Axes", time: Array, reference: Array, joint: Array, colour: str = COLOURS["error"]) -> None:
    """Joint − reference over time; of a run that ran away, what lies within a tenth of its motion."""
    error = (joint - reference) * DEGREES
    axes.plot(*thin(time, error), color=colour, lw=1.1)
    wanted = error if np.isfinite(error).all() else 0.1 * (reference - np.nanmean(reference)) * DEGREES
    stay_near(axes, [wanted], [error])
    axes.set(xlabel="time [s]", ylabel="error [°]")
