"""How the Bouc–Wen cable's h depends on its parameters, integrated together with h itself.

With h' = f(h, d, θ) per unit of motor travel (Eq. 7 divided by |u|), the sensitivity s = ∂h/∂θ obeys

    s' = ∂f/∂h·s + ∂f/∂θ,    s(0) = ∂h(0)/∂θ

f is continuous at h = 0 and at a reversal, so s carries on through both without a jump. The value of f is taken from
`bowden.models.cable.bouc_wen`; only its partial derivatives are written here.

Source: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, 1993, Section I.14.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel, log, power
from bowden.models.cable.bouc_wen import BoucWen, advance_prepared, prepare_cable, saturation, slope_of_h


class Sensitive(NamedTuple):
    """h and its derivatives."""

    h: float
    """[–]"""
    by_rate: float
    """∂h/∂ρ [rad]."""
    by_shape: float
    """∂h/∂σ [–]."""
    by_exponent: float
    """∂h/∂n [–]."""
    by_initial: float
    """∂h/∂h(0) [–]."""


@kernel
def sensitivity_slope(at: Sensitive, direction: float, cable: BoucWen) -> Sensitive:
    """d/d|x| of h and of its derivatives, for motor travel in `direction` (+1 or −1)."""
    f = slope_of_h(at.h, direction, cable)
    size, by_h, by_shape, by_exponent = abs(at.h), 0.0, 0.0, 0.0
    if size > 0.0:
        side, raised = math.copysign(1.0, at.h), power(size, cable.exponent)
        weight = -cable.rate * (cable.shape * side + (cable.shape - 1.0) * direction)  # f = ρ·d + weight·|h|ⁿ
        by_h = weight * cable.exponent * raised / size * side
        by_shape = -cable.rate * (side + direction) * raised
        by_exponent = weight * raised * log(size)
    return Sensitive(
        f,
        by_h * at.by_rate + f / cable.rate,
        by_h * at.by_shape + by_shape,
        by_h * at.by_exponent + by_exponent,
        by_h * at.by_initial,
    )


@kernel
def moved(at: Sensitive, slope: Sensitive, length: float) -> Sensitive:
    """`at` + `length`·`slope`, field by field."""
    return Sensitive(
        at.h + length * slope.h,
        at.by_rate + length * slope.by_rate,
        at.by_shape + length * slope.by_shape,
        at.by_exponent + length * slope.by_exponent,
        at.by_initial + length * slope.by_initial,
    )


@kernel
def sensitivity_step(at: Sensitive, direction: float, length: float, cable: BoucWen) -> Sensitive:
    """One Runge–Kutta step of fourth order over a `length` of travel [rad]."""
    k1 = sensitivity_slope(at, direction, cable)
    k2 = sensitivity_slope(moved(at, k1, 0.5 * length), direction, cable)
    k3 = sensitivity_slope(moved(at, k2, 0.5 * length), direction, cable)
    k4 = sensitivity_slope(moved(at, k3, length), direction, cable)
    return moved(moved(moved(at, k1, length / 6.0), moved(k2, k3, 1.0), length / 3.0), k4, length / 6.0)


@kernel
def sensitivity_advance(at: Sensitive, travel: float, bound: float, cable: BoucWen) -> Sensitive:
    """h and its derivatives after a signed motor `travel` [rad]; |h| at most `bound`, the cable's saturation.

    Steps are as long as a fit allows (h is exact to about 1e-8, to 1e-6 where n is below 2 and |h|ⁿ bends sharply); the
    travel is cut where h passes zero, where f has a kink. Where h has come to rest at its bound, the derivatives
    are the bound's own.
    """
    direction, left = math.copysign(1.0, travel), abs(travel)
    letting_go = max(1.0, 1.0 / (2.0 * cable.shape - 1.0))  # h falls faster than it rose where σ < 1
    piece = 0.1 / (cable.rate * (1.0 + cable.exponent * letting_go / bound))
    while left > 0.0:
        if abs(direction * bound - at.h) < 1e-9 * bound:
            margin = 2.0 * cable.shape - 1.0
            by_shape = -2.0 * bound / (cable.exponent * margin)
            by_exponent = bound * log(margin) / (cable.exponent * cable.exponent)
            return Sensitive(direction * bound, 0.0, direction * by_shape, direction * by_exponent, 0.0)
        length = min(left, piece)
        after = sensitivity_step(at, direction, length, cable)
        if at.h * after.h < 0.0:
            for _ in range(3):  # Newton on the travel at which h is zero; the slope there is ρ
                length -= after.h / slope_of_h(after.h, direction, cable)
                after = sensitivity_step(at, direction, length, cable)
            after = Sensitive(0.0, after.by_rate, after.by_shape, after.by_exponent, after.by_initial)
        at, left = after, left - length
    return at


def sensitivities(motor: NDArray[np.float64], initial_h: float, cable: BoucWen) -> NDArray[np.float64]:
    """h and its derivatives along a recorded motion.

    Args:
        motor: motor angle (n,) [rad].
        initial_h: h at the first sample, |initial_h| at most the cable's saturation [–].
        cable: its parameters; σ above 1/2.

    Returns:
        h, ∂h/∂ρ, ∂h/∂σ, ∂h/∂n, ∂h/∂h(0) (n, 5).
    """
    found = np.empty((motor.size, 5))
    compiled(fill_sensitivities)(np.ascontiguousarray(motor), initial_h, cable, found)
    return found


@kernel
def fill_sensitivities(
    motor: NDArray[np.float64], initial_h: float, cable: BoucWen, found: NDArray[np.float64]
) -> None:
    """`sensitivities`, into `found` (n, 5)."""
    bound = saturation(cable)
    at = Sensitive(initial_h, 0.0, 0.0, 0.0, 1.0)
    for k in range(motor.size):
        if k > 0:
            at = sensitivity_advance(at, motor[k] - motor[k - 1], bound, cable)
        found[k, 0], found[k, 1], found[k, 2] = at.h, at.by_rate, at.by_shape
        found[k, 3], found[k, 4] = at.by_exponent, at.by_initial


def hysteresis(motor: NDArray[np.float64], initial_h: float, cable: BoucWen) -> NDArray[np.float64]:
    """h along a recorded motion (n,) [–], from `motor` (n,) [rad] and h at its first sample."""
    found = np.empty(motor.size)
    compiled(fill_hysteresis)(np.ascontiguousarray(motor), initial_h, cable, found)
    return found


@kernel
def fill_hysteresis(motor: NDArray[np.float64], initial_h: float, cable: BoucWen, found: NDArray[np.float64]) -> None:
    """`hysteresis`, into `found` (n,)."""
    h = initial_h
    found[0] = h
    prepared = prepare_cable(cable)
    for k in range(1, motor.size):
        travel = motor[k] - motor[k - 1]
        if abs(math.copysign(prepared.bound, travel) - h) > 1e-12 * prepared.bound:  # rounding may stop h short of it
            h = advance_prepared(h, travel, prepared)
        found[k] = h
