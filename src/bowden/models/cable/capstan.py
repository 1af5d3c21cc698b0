"""A tendon in a bent sheath against a spring: its parameters, and what its quasi-static motion is in closed form.

Where the tendon slides, the sheath's pressure on it makes the tension fall along the way of the motion,

    dT/ds = −μ·κ(s)·T  pulling,    +μ·κ(s)·T  releasing                                  (capstan, Euler–Eytelwein)

and where it sticks |dT/ds| is at most μκT. With M = μ·∫κ ds from end to end, the joint's tension is T_in·e^(−M)
pulling and T_in·e^(+M) releasing; the elastic tendon stretches by ∫T/EA ds, and the difference of that stretch between
the two, at one joint tension, is the motor's travel that a reversal loses.

Source: the capstan equation of Euler and Eytelwein, and the elastic tendon of Kaneko et al. 1991 (the paper's [9]),
Tian et al. ([14]) and Agrawal et al. 2010 ([13]); the integrals are worked out here.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError


class Tendon(NamedTuple):
    """A tendon in a sheath, from the motor's spool to the joint's pulley.

    The defaults are a stated choice: the load is that of `bowden.models.drive.motor.Motor`, and with friction and
    stiffness as here a reversal in the middle of a 0–70° stroke loses 5.6° of the motor, about as much as on the
    paper's bench.
    """

    length: float = 1.0
    """L, of the sheath [m]."""
    stiffness: float = 1.1e4
    """EA, of tendon and sheath in series: force per strain [N]."""
    friction: float = 0.15
    """μ, between tendon and sheath [–]."""
    bend: float = math.pi
    """θ₀, total bend of the sheath when its relative width is 1 [rad]."""
    profile: tuple[float, ...] = (1.0,)
    """Relative curvature of the sheath's pieces, all of one length, from motor to joint [–]."""
    motor_radius: float = 0.01
    """r_m, of the spool [m]."""
    joint_radius: float = 0.01
    """r_j, of the pulley [m]."""
    spring: float = 0.2
    """Stiffness of the spring that pulls the joint back [N·m/rad]."""
    pretension: float = 0.1
    """Torque of that spring at joint angle zero [N·m]; it rests at −pretension/spring."""
    slack: float = 0.0
    """Tendon to be taken up before it is taut, at motor angle zero [m]."""
    elements: int = 20
    """n, into how many the sheath is cut [–]."""


def check_tendon(tendon: Tendon) -> None:
    """Refuse a tendon that cannot be.

    Raises:
        ParameterError: a number out of its range, or a profile without curvature.
    """
    positive = ("length", "stiffness", "motor_radius", "joint_radius", "spring", "bend")
    for name in (*positive, "friction", "pretension", "slack"):
        value = getattr(tendon, name)
        if not (value > 0.0 if name in positive else value >= 0.0) or not math.isfinite(value):
            expected = "a number above 0" if name in positive else "a number not below 0"
            raise ParameterError(f"tendon: {name} is {value}", expected=expected)
    if not tendon.elements >= 1:
        raise ParameterError(f"tendon: elements is {tendon.elements}", expected="1 or more")
    shares = np.asarray(tendon.profile, dtype=np.float64)
    if shares.ndim != 1 or not shares.size or not (np.isfinite(shares) & (shares >= 0.0)).all() or not shares.sum() > 0:
        raise ParameterError(
            f"tendon: the curvature profile is {tendon.profile}", expected="numbers not below 0, one of them above"
        )


def pieces(tendon: Tendon) -> NDArray[np.float64]:
    """μ times the bend of each piece of the profile (k,) [–]."""
    shares = np.asarray(tendon.profile, dtype=np.float64)
    return np.asarray(tendon.friction * tendon.bend * shares / shares.sum())


def node_angles(tendon: Tendon) -> NDArray[np.float64]:
    """μ times the bend that is lumped at each of the n + 1 nodes [–].

    A node has half the bend of the element on either side, so that between the middles of two elements lies their own
    share and the sum over all nodes is M.
    """
    shares = pieces(tendon)
    edges = np.linspace(0.0, len(shares), tendon.elements + 1)
    cells = np.diff(np.interp(edges, np.arange(len(shares) + 1), np.concatenate([[0.0], np.cumsum(shares)])))
    return np.asarray(0.5 * (np.concatenate([[0.0], cells]) + np.concatenate([cells, [0.0]])))


def tension_ratio(tendon: Tendon, *, pulling: bool) -> float:
    """T_out/T_in of the sliding tendon: e^(−M) pulling, e^(+M) releasing.

    >>> round(tension_ratio(Tendon(friction=0.1, bend=3.0), pulling=True), 4)
    0.7408
    """
    total = float(pieces(tendon).sum())
    return math.exp(-total if pulling else total)


def compliance(tendon: Tendon, *, pulling: bool) -> float:
    """Stretch of the sliding tendon per joint tension, ∫T/(EA·T_out) ds [m/N].

    Over a piece of constant curvature with μκΔs = m the integral of e^(±μκs) is Δs·(e^m − 1)/m pulling and
    Δs·(1 − e^(−m))/m releasing; for one piece that is L/EA·(e^M − 1)/M and L/EA·(1 − e^(−M))/M.
    """
    sign, ahead, total = 1.0 if pulling else -1.0, 0.0, 0.0
    shares = pieces(tendon)
    for share in shares[::-1]:
        grown = math.expm1(sign * share) / (sign * share) if share > 0.0 else 1.0
        total += math.exp(sign * ahead) * grown
        ahead += float(share)
    return total * tendon.length / (len(shares) * tendon.stiffness)


def dead_zone(tendon: Tendon, joint: float) -> float:
    """Motor travel that is lost when the sliding tendon turns from pulling to releasing at a `joint` angle [rad].

    T_out·(compliance pulling − compliance releasing)/r_m; with one piece 2·T_out·L/EA·(cosh M − 1)/M.
    """
    lost = compliance(tendon, pulling=True) - compliance(tendon, pulling=False)
    return (tendon.pretension + tendon.spring * joint) / tendon.joint_radius * lost / tendon.motor_radius


def slope(tendon: Tendon, *, pulling: bool) -> float:
    """Joint motion per motor motion of the sliding tendon, (r_m/r_j)/(1 + K·compliance), K = spring/r_j² [rad/rad]."""
    end = tendon.spring / tendon.joint_radius**2
    return tendon.motor_radius / tendon.joint_radius / (1.0 + end * compliance(tendon, pulling=pulling))


def tension_after_reversal(tendon: Tendon, before: float, travel: float) -> float:
    """Tension at the motor once it has given back `travel` after pulling, while the joint still rests [N].

    The release has reached x = μκs along a sheath of even curvature, T_in = T₀·e^(−2x) and the motor's travel is
    (T₀·L/(EA·M))·(1 − e^(−x))². Beyond x = M the joint moves, and this formula ends.

    Args:
        tendon: with a profile of one piece.
        before: T₀, the motor's tension when it turned [N].
        travel: how far it has gone back, not below 0 [m].
    """
    total = float(pieces(tendon).sum())
    return before * (1.0 - math.sqrt(travel * tendon.stiffness * total / (tendon.length * before))) ** 2
