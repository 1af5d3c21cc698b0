"""Fig. 4: travel of the two cables of the suit, and the ratio of their spools."""

import math

import numpy as np

from bowden.core.style import COLOURS, legend, new_figure
from bowden.core.units import DEGREES
from bowden.models.suit.geometry import (
    ELBOW_RANGE,
    SuitGeometry,
    extensor_extension,
    flexor_extension,
    joint_radius_for_mismatch,
    joint_radius_for_ratio,
    size_spools,
)
from bowden.paper.experiment import Finding, Runs

_MM = 1e3


def run(runs: Runs) -> Finding:
    """Eqs 1–2 over 0–90°, and the best ratio of the spools."""
    geometry = SuitGeometry()
    sizing = size_spools(geometry)
    angle = np.linspace(*ELBOW_RANGE, 181)
    flexor = np.array([flexor_extension(a, geometry) for a in angle]) * _MM
    extensor = np.array([extensor_extension(a, geometry) for a in angle]) * _MM
    swapped = joint_radius_for_mismatch(0.05, extensor_moves_more=True)
    reach = math.hypot(geometry.half_width, geometry.anchor_distance)
    other = 1.0 / size_spools(geometry._replace(joint_radius=swapped)).ratio
    other_spools = flexor + sizing.ratio * extensor
    figure, (axes,) = new_figure(width=8.6, height=4.2)
    axes.plot(angle * DEGREES, flexor, label="flexor $h_1$")
    axes.plot(angle * DEGREES, extensor, label="extensor $h_2$")
    axes.plot(angle * DEGREES, flexor + extensor, color=COLOURS["reference"], label="difference, equal spools")
    axes.plot(
        angle * DEGREES, other_spools, ":", color=COLOURS["reference"], label=f"difference, ratio {sizing.ratio:.3f}"
    )
    axes.set(xlabel="elbow angle [°]", ylabel="cable travel [mm]", xticks=range(0, 91, 15))
    legend(axes)
    return Finding(
        title="Travel of the suit's cables (Dinh 2017, Fig. 4)",
        values={
            "fig4.ratio": sizing.ratio,
            "fig4.mismatch": sizing.mismatch * _MM,
            "fig4.residual": sizing.residual_extensor * _MM,
            "erratum.spools.flexor_travel": float(flexor[-1]),
            "erratum.spools.extensor_travel": float(extensor[-1]),
            "erratum.spools.residual_flexor": sizing.residual_flexor * _MM,
            "erratum.spools.radius_for_ratio": joint_radius_for_ratio(1.66) * _MM,
            "erratum.spools.radius_for_mismatch": joint_radius_for_mismatch(0.05) * _MM,
        },
        figures=[
            (figure, "Travel of the flexor and extensor cables over the elbow's range, with the printed a, b, R.")
        ],
        text="The paper’s text says that the extensor moves more and that the mismatch is 50 mm; with the printed "
        "dimensions "
        "the flexor moves more, and no joint radius gives both the printed ratio and the printed mismatch. With "
        f"R = {swapped * _MM:.0f} mm the extensor does move more, by 50 mm, but then its spool has to be the larger "
        f"one, {other:.2f} times the flexor's, and the anchors, {reach * _MM:.1f} mm from the joint, stand inside it.",
    )
