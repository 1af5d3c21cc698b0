"""Friction as a return mapping: the share z of its limit that friction has reached, over travel instead of time.

    Dahl:     dz/d|x| = (d − z)/z₀,  d = ±1 the direction, so that z goes to d exponentially
    Coulomb:  z = z + x/z₀, cut to ±1: an elastic bristle that slips at its limit; z₀ is made so short that it sticks

Both know no time, keep |z| ≤ 1, and never fall over a growing travel, so that a step with them is a convex problem.

Source: Dahl, *A solid friction model*, 1968 (exponent 1, stiffness at rest F/z₀), which Palli and Melchiorri take
along a sheath (the paper's [6]); Simo and Hughes, *Computational Inelasticity*, 1998, for the return mapping.
"""

import math

from bowden.core.kernel import exp, kernel


@kernel
def dahl(z: float, travel: float, presliding: float) -> float:
    """z after a signed `travel` [m], exactly; `presliding` is z₀ [m].

    >>> round(dahl(0.0, 1e-4, 1e-4), 4)
    0.6321
    """
    direction = math.copysign(1.0, travel)
    return direction + (z - direction) * exp(-abs(travel) / presliding)


@kernel
def coulomb(z: float, travel: float, presliding: float) -> float:
    """z after a signed `travel` [m]: elastic as far as it can be, slipping beyond.

    >>> float(coulomb(0.5, 1e-7, 1e-6)), float(coulomb(0.5, 1.0, 1e-6))
    (0.6, 1.0)
    """
    return max(-1.0, min(1.0, z + travel / presliding))


@kernel
def dahl_slope(z: float, travel: float, presliding: float) -> float:
    """dz/dx at the end of a `travel` [1/m]."""
    return (1.0 - math.copysign(1.0, travel) * dahl(z, travel, presliding)) / presliding


@kernel
def coulomb_slope(z: float, travel: float, presliding: float) -> float:
    """dz/dx at the end of a `travel` [1/m]: none where it slips."""
    return 1.0 / presliding if abs(z + travel / presliding) < 1.0 else 0.0
