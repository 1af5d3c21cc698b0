"""How a fit is drawn: joint over motor, whole and without its straight line."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bowden.core.style import COLOURS, legend, thin
from bowden.core.units import DEGREES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bowden.identify.cable.fit import Fit

_POINTS = 1500
"""Of a curve: more are not told apart."""


def draw_loop(axes: "Sequence[Axes]", fit: "Fit") -> None:
    """Joint over motor as recorded and as the recommended model has it, and on second axes without the line."""
    log = fit.log
    line = fit.models["line"].model.joint_angle(log.motor)
    motor = log.motor * DEGREES
    for panel, base in zip(axes, (np.zeros_like(line), line), strict=False):
        for part, label in ((slice(0, fit.split), "first half"), (slice(fit.split, None), "second half")):
            colour = COLOURS["data"] if part.start == 0 else COLOURS["joint"]
            shown = thin(motor[part], (log.joint - base)[part] * DEGREES, _POINTS)
            panel.plot(*shown, color=colour, lw=1.0, label=label)
        late = slice(fit.split, None)
        drawn = thin(motor[late], (fit.predicted - base)[late] * DEGREES, _POINTS)
        panel.plot(*drawn, color=COLOURS["model"], lw=1.2, label="model")
        panel.set_xlabel("motor [°]")
    axes[0].set_ylabel("joint [°]")
    if len(axes) > 1:
        axes[1].set_ylabel("joint − straight line [°]")
    legend(axes[-1], 3)
