"""The Bouc–Wen cable (Eqs 6–7), integrated over motor travel so that it does not know what time is.

    joint = αφ·motor + αh·h + offset
    dh/d|x| = ρ·( d − σ·|h|ⁿ⁻¹·h − (σ−1)·d·|h|ⁿ )

the second being Eq. 7 divided by |u|: per unit of travel |x| of the motor in the direction d = ±1.

Source: Dinh et al. 2017, Eqs 6–7, after Ismail, Ikhouane and Rodellar's normalised form.
"""

from typing import NamedTuple

import numpy as np

from bowden.core.kernel import kernel, power


class BoucWen(NamedTuple):
    """Parameters of the cable; the defaults are the ones the paper fitted to its bench (Section 5.1.1).

    They make sense in radians only (erratum 5).
    """

    slope: float = 0.938
    """αφ, joint motion per motor motion once the play is taken up [rad/rad]."""
    hysteresis_gain: float = -0.129
    """αh, joint motion per unit of h [rad]."""
    rate: float = 9.256
    """ρ, how fast h follows the motor [1/rad]."""
    shape: float = 9.427
    """σ, above 1/2 for a bounded loop [–]."""
    exponent: float = 3.0
    """n, how sharply h saturates, at least 1 [–]."""
    offset: float = 0.0
    """Joint angle at motor angle zero with h = 0 [rad]; not in the paper."""


@kernel
def saturation(cable: BoucWen) -> float:
    """The value (2σ−1)^(−1/n) that |h| cannot exceed once it is inside [–].

    >>> float(round(saturation(BoucWen()), 3))
    0.383
    """
    return power(2.0 * cable.shape - 1.0, -1.0 / cable.exponent)


@kernel
def slope_of_h(h: float, direction: float, cable: BoucWen) -> float:
    """dh per unit of motor travel in `direction` (+1 or −1), Eq. 7 divided by |u| [1/rad]."""
    size = power(np.abs(h), cable.exponent)
    return cable.rate * (direction - cable.shape * size * np.sign(h) - (cable.shape - 1.0) * direction * size)


@kernel
def travel_step(h: float, travel: float, cable: BoucWen) -> float:
    """One Runge–Kutta step of fourth order of h over a signed motor `travel` [rad], kept inside its bound.

    Portable; for ρ·|travel| below about 0.05 its error is below 1e-10. For longer travels call it repeatedly, or
    use `advance`.
    """
    direction, length = np.sign(travel), np.abs(travel)
    k1 = slope_of_h(h, direction, cable)
    k2 = slope_of_h(h + 0.5 * length * k1, direction, cable)
    k3 = slope_of_h(h + 0.5 * length * k2, direction, cable)
    k4 = slope_of_h(h + length * k3, direction, cable)
    bound = np.fmax(saturation(cable), np.abs(h))
    stepped = h + length * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    return np.fmax(-bound, np.fmin(bound, stepped))


@kernel
def advance(h: float, travel: float, cable: BoucWen) -> float:
    """h after a signed motor `travel` of any length [rad].

    Rate-independent, and splitting the travel changes nothing beyond 1e-9: the travel is cut where h passes zero
    (its right-hand side has a kink there), and into pieces on which a Runge–Kutta step is exact to about 1e-11. Where
    n is not an integer |h|ⁿ is singular at zero, and the pieces shrink in proportion to h on both sides of it.
    """
    bound = saturation(cable)
    direction, left = np.sign(travel), np.abs(travel)
    stiffness = cable.rate * (1.0 + cable.exponent / bound)  # above the steepest d(dh/d|x|)/dh inside the bound
    piece = 0.04 / stiffness
    singular = cable.exponent < 4.0 and cable.exponent != np.floor(cable.exponent)
    while left > 0.0:
        length = min(left, piece)
        if singular:
            length = min(length, (0.1 * np.abs(h) + 1e-5) / cable.rate)
        stepped = travel_step(h, direction * length, cable)
        if h * stepped < 0.0:
            for _ in range(4):  # Newton on the travel at which h is zero; the slope there is ρ, never small
                length -= stepped / slope_of_h(stepped, direction, cable)
                stepped = travel_step(h, direction * length, cable)
            stepped = 0.0
        h, left = stepped, left - length
        if np.abs(direction * bound - h) < 1e-13:
            break
    return h


@kernel
def joint_angle(motor: float, h: float, cable: BoucWen) -> float:
    """Eq. 6 with an offset: joint = αφ·motor + αh·h + offset [rad]."""
    return cable.slope * motor + cable.hysteresis_gain * h + cable.offset
