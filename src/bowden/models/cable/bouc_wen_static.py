"""The Bouc–Wen cable with a smooth static nonlinearity of the motor angle.

    joint = slope·motor + offset + Σ cₖ·Tₖ(u) + (αh + Σ dₖ·Tₖ(u))·h,    u = (motor − centre)/half_range

The Chebyshev polynomials Tₖ bend the mean line (k = 2 …) and let the height of the loop vary over the stroke (k = 1 …).
Outside |u| = 1 a static term goes on along its tangent and the loop keeps its height.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel
from bowden.models.cable.bouc_wen import BoucWen


class StaticTerms(NamedTuple):
    """Terms added to the plain cable."""

    static: NDArray[np.float64]
    """cₖ for k = 2 … (m,) [rad]."""
    heights: NDArray[np.float64]
    """dₖ for k = 1 … (l,) [rad]."""
    centre: float
    """Motor angle at which u = 0 [rad]."""
    half_range: float
    """Motor travel from u = 0 to u = 1 [rad]."""


@kernel
def joint_angle(motor: float, h: float, width: float, slope_factor: float, cable: BoucWen, terms: StaticTerms) -> float:
    """Joint angle in a sheath of that width and slope factor [rad]; without terms it is `joint_in_sheath`."""
    u = (motor - terms.centre) / terms.half_range
    inside = max(-1.0, min(1.0, u))
    static, height = 0.0, cable.hysteresis_gain
    before, now = 1.0, inside  # Tₖ₋₁ and Tₖ, from k = 1 on
    for k in range(1, max(terms.static.size + 1, terms.heights.size) + 1):
        if k <= terms.heights.size:
            height += terms.heights[k - 1] * now
        if 2 <= k <= terms.static.size + 1:
            tangent = k * k * (1.0 if inside > 0.0 or k % 2 == 1 else -1.0)  # Tₖ'(±1)
            static += terms.static[k - 2] * (now + tangent * (u - inside))
        before, now = now, 2.0 * inside * now - before
    return slope_factor * (cable.slope * motor + static) + width * height * h + cable.offset
