"""The Bouc–Wen cable (Eqs 6–7), integrated over motor travel so that it does not know what time is.

    joint = αφ·motor + αh·h + offset
    dh/d|x| = ρ·( d − σ·|h|ⁿ⁻¹·h − (σ−1)·d·|h|ⁿ )

the second being Eq. 7 divided by |u|: per unit of travel |x| of the motor in the direction d = ±1.

Source: Dinh et al. 2017, Eqs 6–7, after Ismail, Ikhouane and Rodellar's normalised form.
"""

import math
from typing import Annotated, NamedTuple

from bowden.core.kernel import kernel, power
from bowden.core.part import part
from bowden.core.quantity import Quantity


@part
class BoucWen(NamedTuple):
    """Parameters of the cable; the defaults are the ones the paper fitted to its bench (Section 5.1.1).

    They are valid in radians only (reading 5).

    >>> BoucWen(slope=0.9).rate
    9.256
    """

    slope: Annotated[
        float, Quantity("joint motion per motor motion; not 0", "rad/rad", symbol="αφ", ge=-100.0, le=100.0)
    ] = 0.938
    """Once the play is taken up."""
    hysteresis_gain: Annotated[
        float, Quantity("joint motion per unit of h", "rad", shown="rad", symbol="αh", ge=-10.0, le=10.0)
    ] = -0.129
    rate: Annotated[float, Quantity("how fast h follows the motor", "1/rad", symbol="ρ", gt=0.0, le=1e4)] = 9.256
    shape: Annotated[float, Quantity("shape of the loop", symbol="σ", gt=0.5, le=1e4)] = 9.427
    """Above 1/2 for a bounded loop."""
    exponent: Annotated[float, Quantity("how sharply h saturates", symbol="n", ge=1.0, le=50.0)] = 3.0
    offset: Annotated[float, Quantity("joint angle at motor angle 0 with h = 0", "rad", ge=-720.0, le=720.0)] = 0.0
    """Not in the paper."""


def upright(cable: BoucWen) -> BoucWen:
    """The cable with its motor counted so that its slope is positive: joint = αφ·x + αh·h(x) + offset for −x as well.

    >>> upright(BoucWen(slope=-0.9, hysteresis_gain=0.1)).hysteresis_gain
    -0.1
    """
    if cable.slope >= 0.0:
        return cable
    return cable._replace(slope=-cable.slope, hysteresis_gain=-cable.hysteresis_gain)


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
    size = power(abs(h), cable.exponent)
    return cable.rate * (direction - cable.shape * math.copysign(size, h) - (cable.shape - 1.0) * direction * size)


@kernel
def travel_step(h: float, travel: float, cable: BoucWen) -> float:
    """One Runge–Kutta step of fourth order of h over a signed motor `travel` [rad], kept inside its bound.

    In y and z as in `advance_prepared`. Portable; for ρ·|travel| below about 0.05 its error is below 1e-10. For longer
    travels call it repeatedly, or use `advance`.
    """
    direction, z = math.copysign(1.0, travel), cable.rate * abs(travel)
    y, growth, n = direction * h, 2.0 * cable.shape - 1.0, cable.exponent
    k1 = _slope_of_y(y, growth, n)
    k2 = _slope_of_y(y + 0.5 * z * k1, growth, n)
    k3 = _slope_of_y(y + 0.5 * z * k2, growth, n)
    k4 = _slope_of_y(y + z * k3, growth, n)
    bound = max(saturation(cable), abs(h))
    stepped = y + z * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    return direction * max(-bound, min(bound, stepped))


@kernel
def _slope_of_y(y: float, growth: float, exponent: float) -> float:
    """dy/dz = 1 − q, with two products in place of a call of libm for the paper's n = 3."""
    return 1.0 - (growth if y > 0.0 else -1.0) * _power(abs(y), exponent)


class PreparedCable(NamedTuple):
    """Constants that `advance` needs of a cable, computed once. Travel is counted in z = ρ·travel here."""

    rate: float
    """ρ [1/rad]."""
    exponent: float
    """n [–]."""
    growth: float
    """2σ−1 [–]."""
    bound: float
    """`saturation` [–]."""
    piece: float
    """Longest z of one step away from zero [–]."""
    near_zero: float
    """|h| below which `_through_zero` is exact, for steps no longer than this [–]."""


@kernel
def prepare_cable(cable: BoucWen) -> PreparedCable:
    """The constants of a cable's travel.

    The right-hand side of Eq. 7, by h, is nowhere inside the bound steeper than n/bound times the larger of 1 and
    1/(2σ−1); pieces and zone are such that what the two series leave out is below about 1e-11 a step.
    """
    growth, bound = 2.0 * cable.shape - 1.0, saturation(cable)
    steepest = cable.exponent / bound * max(1.0, 1.0 / growth)
    near_zero = 0.5 * power(0.01 / max(1.0, growth), 1.0 / cable.exponent)
    piece = (0.045 if cable.exponent == 3.0 else 0.03) / (1.0 + steepest)
    return PreparedCable(cable.rate, cable.exponent, growth, bound, piece, near_zero)


@kernel
def advance(h: float, travel: float, cable: BoucWen) -> float:
    """h after a signed motor `travel` of any length [rad].

    Rate-independent, and splitting the travel changes nothing beyond 1e-9.
    """
    return advance_prepared(h, travel, prepare_cable(cable))


@kernel
def advance_prepared(h: float, travel: float, cable: PreparedCable) -> float:
    """`advance` with the cable's constants at hand: Eq. 7 over the travel in pieces, each by a series.

    In y = h·direction and z = ρ·|travel| Eq. 7 has one form on each side of zero:

        dy/dz = 1 − q,    q = (2σ−1)·yⁿ above zero, −|y|ⁿ below it

    The usual pieces, those that do not cross zero, and a cable that is taken up are not turned round: in a loop h then
    need not wait for the travel.
    """
    left, end = cable.rate * abs(travel), math.copysign(cable.bound, travel)
    while left > 0.0 and not abs(end - h) < 1e-12 * cable.bound:
        size, outward = abs(h), h * end > 0.0
        if cable.exponent == 3.0 and size <= cable.bound and (outward or size > 1.01 * cable.piece):
            z = min(left, cable.piece)
            h = _by_cubes(h, math.copysign(z, travel), math.copysign(cable.growth if outward else 1.0, travel))
        else:
            direction = math.copysign(1.0, travel)
            y = direction * h
            q = (cable.growth if y > 0.0 else -1.0) * _power(size, cable.exponent)
            if size < cable.near_zero:
                z = min(left, cable.near_zero)
                y = _through_zero(y, z, q, cable)
            else:
                z = min(left, cable.piece, 0.05 * size / max(1.0, abs(1.0 - q)))
                y = _away_from_zero(y, z, q, cable.exponent)
            h = direction * y
        left -= z
    return h


@kernel
def _power(size: float, n: float) -> float:
    """sizeⁿ; with the paper's n = 3 it takes two multiplications, and not a logarithm."""
    return size * size * size if n == 3.0 else power(size, n)


@kernel
def _through_zero(y: float, z: float, q: float, cable: PreparedCable) -> float:
    """y after z where |q| stays below 0.01, whatever the power n and on whichever side of zero it begins and ends.

    The travel since zero is t = ∫dy/(1−q) = y·Σ qᵏ/(kn+1); y after t + z is the same series inverted.
    """
    n = cable.exponent
    i1, i2, i3, i4 = 1.0 / (n + 1.0), 1.0 / (2.0 * n + 1.0), 1.0 / (3.0 * n + 1.0), 1.0 / (4.0 * n + 1.0)
    t = z + y * (1.0 + q * (i1 + q * (i2 + q * (i3 + q * i4))))
    q = (cable.growth if t > 0.0 else -1.0) * _power(abs(t), n)
    b1 = -i1
    b2 = -n * b1 * i2
    b3 = -n * (b2 + 0.5 * (n - 1.0) * b1 * b1) * i3
    b4 = -n * (b3 + (n - 1.0) * b1 * (b2 + (n - 2.0) / 6.0 * b1 * b1)) * i4
    return t * (1.0 + q * (b1 + q * (b2 + q * (b3 + q * b4))))


@kernel
def _away_from_zero(y: float, z: float, q: float, n: float) -> float:
    """y after z by its Taylor series of fifth order.

    With y = Σ aₖ·zᵏ the power yⁿ = Σ pₖ·zᵏ has k·y·pₖ = Σ (n·j − (k−j))·aⱼ·pₖ₋ⱼ over j = 1…k, so that one call of
    `power` serves every order; q stands for p scaled by −1 or 2σ−1.
    """
    u = 1.0 / y
    a1 = 1.0 - q
    q1 = n * a1 * q * u
    a2 = -q1 / 2.0
    q2 = (2.0 * n * a2 * q + (n - 1.0) * a1 * q1) * u / 2.0
    a3 = q2 * (-1.0 / 3.0)
    q3 = (3.0 * n * a3 * q + (2.0 * n - 1.0) * a2 * q1 + (n - 2.0) * a1 * q2) * u * (1.0 / 3.0)
    a4 = -q3 / 4.0
    q4 = 4.0 * n * a4 * q + (3.0 * n - 1.0) * a3 * q1 + (2.0 * n - 2.0) * a2 * q2 + (n - 3.0) * a1 * q3
    a5 = q4 * u * (-1.0 / 20.0)
    return y + z * (a1 + z * (a2 + z * (a3 + z * (a4 + z * a5))))


@kernel
def _by_cubes(y: float, z: float, growth: float) -> float:
    """y after z for the paper's n = 3, by its Taylor series of sixth order: dy/dz = 1 − q with q = growth·y³.

    It holds for h itself over a signed z, too, where `growth` has the sign of z.

    The derivatives are polynomials of q, so that nothing is divided and little has to wait for something else; inside
    the bound, where the pieces are short beside 1/steepest, no other limit is needed.
    """
    d = growth * y
    e = d * y
    q = e * y
    square, z_square = q * q, z * z
    c3 = d * (2.5 * q - 1.0)
    c4 = growth * (3.5 * q - 0.25 - 4.375 * square)
    c5 = growth * e * (2.25 - 9.45 * q + 7.875 * square)
    c6 = growth * d * (0.75 - 9.75 * q + square * (23.1 - 14.4375 * q))
    tail = c3 + z * c4 + z_square * (c5 + z * c6)
    return y + z * (1.0 - q) * (1.0 - 1.5 * e * z + z_square * tail)


@kernel
def joint_angle(motor: float, h: float, cable: BoucWen) -> float:
    """Eq. 6 with an offset: joint = αφ·motor + αh·h + offset [rad]."""
    return cable.slope * motor + cable.hysteresis_gain * h + cable.offset
