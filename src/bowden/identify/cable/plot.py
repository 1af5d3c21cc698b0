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
PARTS = {"first half": "#c9ced3", "second half": "#b5d3e7"}
"""Half of the log → its colour: pale and broad, so that the model's thin line hides nothing of it."""


def draw_loop(axes: "Sequence[Axes]", fit: "Fit") -> None:
    """Joint over motor as recorded and as the recommended model has it, and on second axes without the line."""
    log = fit.log
    line = fit.models["line"].model.joint_angle(log.motor)
    motor = log.motor * DEGREES
    for panel, base in zip(axes, (np.zeros_like(line), line), strict=False):
        for part, (label, colour) in zip((slice(0, fit.split), slice(fit.split, None)), PARTS.items(), strict=True):
            shown = thin(motor[part], (log.joint - base)[part] * DEGREES, _POINTS)
            panel.plot(*shown, color=colour, lw=2.8, label=label)
        late = slice(fit.split, None)
        drawn = thin(motor[late], (fit.predicted - base)[late] * DEGREES, _POINTS)
        panel.plot(*drawn, color=COLOURS["model"], lw=0.8, label="model")
        panel.set_xlabel("motor [°]")
    axes[0].set_ylabel("joint [°]")
    if len(axes) > 1:
        axes[1].set_ylabel("joint − straight line [°]")
    legend(axes[-1], 3)
