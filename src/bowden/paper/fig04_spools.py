"""Fig. 4: travel of the two cables of the suit, and the ratio of their spools."""

import math

import numpy as np

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, new_figure
from bowden.models.suit.geometry import (
    ELBOW_RANGE,
    SuitGeometry,
    extensor_extension,
    flexor_extension,
    size_spools,
)
from bowden.paper.calibration import suit_fit
from bowden.paper.experiment import Finding

_MM = 1e3
RATIO = 1.66
"""Printed, of the flexor's spool to the extensor's (Section 2.2) [–]."""


def run() -> Finding:
    """Eqs 1–2 over 0–90°, and the best ratio of the spools."""
    printed = SuitGeometry()
    b, radius = printed.anchor_distance, printed.joint_radius
    # travels of the flexor 2b(1 − cos 45°) + 2a·sin 45° and of the extensor R·π/2, in the ratio 1.66
    half_width = (RATIO * radius * 0.5 * math.pi - 2.0 * b * (1.0 - math.sqrt(0.5))) / math.sqrt(2.0)
    geometry = suit_fit().geometry
    sizing = size_spools(geometry)
    angle = np.linspace(*ELBOW_RANGE, 181)
    flexor = np.array([flexor_extension(a, geometry) for a in angle]) * _MM
    extensor = np.array([extensor_extension(a, geometry) for a in angle]) * _MM
    as_printed = np.array([flexor_extension(a, printed) for a in angle]) * _MM
    at_ratio = float(np.max(np.abs(flexor + RATIO * extensor)))
    figure, (axes,) = new_figure(width=8.6, height=4.2)
    axes.plot(angle * DEGREES, flexor, label="flexor $h_1$")
    axes.plot(angle * DEGREES, extensor, label="extensor $h_2$")
    axes.plot(angle * DEGREES, flexor + extensor, color=COLOURS["reference"], label="difference, equal spools")
    axes.plot(
        angle * DEGREES,
        flexor + sizing.ratio * extensor,
        ":",
        color=COLOURS["reference"],
        label=f"difference, ratio {sizing.ratio:.2f}",
    )
    axes.plot(angle * DEGREES, as_printed, "--", color=COLOURS["error"], label="flexor with a = 35 mm")
    axes.set(xlabel="elbow angle [°]", ylabel="cable travel [mm]", xticks=range(0, 91, 15))
    legend(axes)
    return Finding(
        title="Travel of the suit's cables (Dinh 2017, Fig. 4)",
        values={
            "fig4.half_width": half_width * _MM,
            "fig4.ratio": float(-flexor[-1] / extensor[-1]),
            "fig4.mismatch": sizing.mismatch * _MM,
            "fig4.residual": sizing.residual_flexor * _MM,
            "erratum.spools.flexor_travel": float(flexor[-1]),
            "erratum.spools.extensor_travel": float(extensor[-1]),
        },
        details={
            "half_width": half_width * _MM,
            "best_ratio": sizing.ratio,
            "residual_extensor": sizing.residual_extensor * _MM,
            "at_166_flexor": at_ratio,
            "at_166_extensor": at_ratio / RATIO,
            "extensor_travel": float(extensor[-1]),
        },
        figures=[
            (
                figure,
                "Travel of both cables over the elbow's range with the printed b and R and with a = 57 mm. "
                "Dashed: with the printed a.",
            )
        ],
        text="The printed b = 85 mm and R = 50 mm with a = 57 mm in place of 35 mm give all three numbers of the "
        "paper’s Fig. 4. So a is the misprint. The flexor moves more than the extensor, as its larger spool asks for.",
    )
