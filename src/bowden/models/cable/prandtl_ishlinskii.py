"""A Prandtl–Ishlinskii stack: a weighted sum of play operators with fixed, increasing half-widths.

    joint = w₀·motor + Σ wᵢ·zᵢ + offset,    zᵢ the play operator of half-width rᵢ

Linear in its weights, rate-independent, and able to follow any convex loop shape. Source: Krasnosel'skii and
Pokrovskii, *Systems with Hysteresis*, 1989; Kuhnen, European Journal of Control 9(4), 2003.
"""

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel
from bowden.models.cable.backlash import push


def plays(motor: NDArray[np.float64], half_widths: NDArray[np.float64]) -> NDArray[np.float64]:
    """The slots of the stack along a recorded motion.

    Args:
        motor: motor angle (n,) [rad].
        half_widths: half-widths rᵢ (k,) [rad].

    Returns:
        zᵢ (n, k) [rad], each slot starting centred on the first sample.
    """
    slots = np.empty((motor.size, half_widths.size))
    compiled(fill_plays)(np.ascontiguousarray(motor), np.ascontiguousarray(half_widths), slots)
    return slots


@kernel
def fill_plays(motor: NDArray[np.float64], half_widths: NDArray[np.float64], slots: NDArray[np.float64]) -> None:
    """`plays`, into `slots` (n, k)."""
    for i in range(half_widths.size):
        z = motor[0]
        for k in range(motor.size):
            z = push(z, motor[k], half_widths[i])
            slots[k, i] = z


@kernel
def joint_angle(
    motor: NDArray[np.float64], slots: NDArray[np.float64], weights: NDArray[np.float64], offset: float
) -> NDArray[np.float64]:
    """joint = w₀·motor + Σ wᵢ·zᵢ + offset (n,) [rad]; `weights` is (k + 1,)."""
    return weights[0] * motor + slots @ weights[1:] + offset
