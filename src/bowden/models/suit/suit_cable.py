"""One cable of the suit: from the spool, through its sheath and the fabric, to the arm; tension only.

What the spool has pulled in is x, what the arm's anchor gives way is s, and where the cable leaves its sheath is u, all
lengths [m], positive towards the motor. Two springs and the friction between them:

    T_m = k·(x − u) ≥ 0                      sheath and cable, on the motor's side
    T_j = f(u − s),  f(δ) = K·δ + q·δ², δ > 0     fabric and flesh, on the arm's side; none while slack
    u moves only as far as the friction in the sheath lets T_m and T_j differ

    play       |T_m − T_j| ≤ k·r·width          Eqs 4–5: with these springs u is the play operator of x, half-width r
    capstan    e^(−M) ≤ T_m/T_j ≤ e^(M)         M = μ·bend, Euler–Eytelwein; the play grows with the tension
    bouc_wen   T_m − T_j = −k·width·αh·R·h      Eqs 6–7: u follows αφ·x + αh·R·h, h driven by x/(R·width)

So the same friction loses motion (x turns, u waits) and force (the motor pulls more than the arm gets, and gets back
less than the arm pulls). Play and capstan never make energy, since their T_m − T_j is always against u's motion; nor do
they know time. `width` is the sheath's (`bowden.models.cable.sheath`): 1 at the bend of its identification. A slope
factor g takes motion and tension alike: x = g·pulled, and the spool feels g·T_m.

Before the spool each cable passes the feeder's rollers, whose one-way clutch locks while the spool coils it and turns
freely while the cable is paid out (Dinh 2017, Section 2.2, Fig. 3). Its drag D on a cable that is pulled in loads the
spool alone, as a friction of D times the spool's radius in that direction.

Left out: the cable's mass, friction that is spread along the sheath (one place of sliding stands for all of it;
`bowden.models.cable.sliding_cable` has n), and the path's change of length with the bend.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.kernel import exp, kernel, sqrt
from bowden.models.cable.bouc_wen import BoucWen, PreparedCable, advance_prepared, prepare_cable


class Friction(IntEnum):
    """Kinds of friction in the sheath."""

    PLAY = 0
    CAPSTAN = 1
    BOUC_WEN = 2


KINDS = {kind.name.lower(): kind for kind in Friction}
"""Name → kind of friction."""
TAUT = 1.0
"""Tension at which half of the flesh's damping acts [N]."""


class SuitCable(NamedTuple):
    """A cable in its sheath; the defaults are stated choices."""

    kind: str = "play"
    """``play``, ``capstan`` or ``bouc_wen``."""
    stiffness: float = 8000.0
    """k, of cable and sheath [N/m]."""
    half_width: float = 0.002
    """r, of the play at width 1; half the spool's travel that a reversal loses [m]."""
    friction: float = 0.12
    """μ·θ₀ of the capstan is this times the sheath's bend at width 1 [–]."""
    bouc_wen: BoucWen = BoucWen()
    """Eqs 6–7; its angles are lengths over `radius`."""
    radius: float = 0.0632
    """R, that turns the angles of `bouc_wen` into lengths: the flexor's mean lever over 0–90° [m]."""
    feeder_drag: float = 0.0
    """D, of the feeder's locked clutch on the cable while the spool pulls it in; none while it is paid out [N]."""


class Fabric(NamedTuple):
    """Compliance that holds a cable to the arm: sleeve, brace and flesh; the defaults are stated choices."""

    stiffness: float = 8000.0
    """K [N/m]."""
    stiffening: float = 0.0
    """q [N/m²]."""
    damping: float = 190.0
    """Of the flesh under a taut cable: a loss factor of 0.3 at 2 Hz [N·s/m]."""


class PreparedSuitCable(NamedTuple):
    """Constants of a cable and its fabric for the kernels."""

    kind: Friction
    stiffness: float
    half_width: float
    capstan: float
    """M at width 1 [–]."""
    slope: float
    """αφ of `bouc_wen`, else 1 [–]."""
    hysteresis_length: float
    """−αh·R [m]."""
    radius: float
    hysteresis: PreparedCable
    fabric: Fabric
    start: float
    """x where nothing has been pulled: what makes the pretension [m]."""
    feeder_drag: float
    """D [N]."""


class SuitCableMemory(NamedTuple):
    """State of a cable."""

    node: float
    """u [m]."""
    h: float
    """Of Eq. 7 [–]."""


class Pull(NamedTuple):
    """A cable's tensions."""

    motor: float
    """T_m, at the spool [N]."""
    joint: float
    """T_j, at the arm [N]."""


def prepare_suit_cable(cable: SuitCable, fabric: Fabric, bend: float, pretension: float) -> PreparedSuitCable:
    """The constants of a cable.

    Args:
        cable: with its kind.
        fabric: that it pulls at.
        bend: total bend of its sheath at width 1 [rad].
        pretension: of both sides of the sheath at the straight arm, before anything has moved [N].

    Raises:
        ParameterError: an unknown kind, or a number out of its range.
    """
    if cable.kind not in KINDS:
        raise ParameterError(f"suit: a cable of the kind {cable.kind!r}", expected=f"one of {', '.join(KINDS)}")
    for name, value, positive in (
        ("cable stiffness", cable.stiffness, True),
        ("cable radius", cable.radius, True),
        ("cable half_width", cable.half_width, False),
        ("cable friction", cable.friction, False),
        ("cable feeder_drag", cable.feeder_drag, False),
        ("fabric stiffness", fabric.stiffness, True),
        ("fabric stiffening", fabric.stiffening, False),
        ("fabric damping", fabric.damping, False),
        ("pretension", pretension, False),
    ):
        if not (value > 0.0 or (value == 0.0 and not positive)) or not math.isfinite(value):
            expected = "a number above 0" if positive else "a number not below 0"
            raise ParameterError(f"suit: {name} is {value:g}", expected=expected)
    kind, turns = KINDS[cable.kind], cable.bouc_wen
    return PreparedSuitCable(
        kind=kind,
        stiffness=cable.stiffness,
        half_width=cable.half_width,
        capstan=cable.friction * bend,
        slope=turns.slope if kind == Friction.BOUC_WEN else 1.0,
        hysteresis_length=-turns.hysteresis_gain * cable.radius,
        radius=cable.radius,
        hysteresis=prepare_cable(turns),
        fabric=fabric,
        start=pretension / cable.stiffness + give(pretension, fabric),
        feeder_drag=cable.feeder_drag,
    )


@kernel
def fabric_tension(stretch: float, fabric: Fabric) -> float:
    """f(δ) [N]."""
    taut = max(0.0, stretch)
    return taut * (fabric.stiffness + fabric.stiffening * taut)


@kernel
def give(tension: float, fabric: Fabric) -> float:
    """The stretch δ at which the fabric has a `tension` not below 0 [N] [m]."""
    k, q = fabric.stiffness, fabric.stiffening
    return 2.0 * tension / (k + sqrt(k * k + 4.0 * q * tension))


@kernel
def taken_up(length: float, ratio: float, cable: PreparedSuitCable) -> float:
    """The stretch δ of the fabric where T_m = ratio·T_j and both springs share a `length` [m]; slack below zero [m]."""
    if length <= 0.0:
        return length
    k, soft, q = cable.stiffness, ratio * cable.fabric.stiffness, ratio * cable.fabric.stiffening
    return 2.0 * k * length / (k + soft + sqrt((k + soft) * (k + soft) + 4.0 * q * k * length))


@kernel
def start_suit_cable(cable: PreparedSuitCable, pulled: float, given: float, slope_factor: float) -> SuitCableMemory:
    """At rest with one tension on both sides of the sheath.

    Args:
        cable: prepared.
        pulled: by the spool [m].
        given: s, by the arm [m].
        slope_factor: g of the sheath [–].
    """
    x = slope_factor * cable.slope * pulled + cable.start
    return SuitCableMemory(given + taken_up(x - given, 1.0, cable), 0.0)


@kernel
def pull_suit_cable(
    cable: PreparedSuitCable,
    memory: SuitCableMemory,
    before: float,
    pulled: float,
    given: float,
    width: float,
    slope_factor: float,
) -> tuple[SuitCableMemory, Pull]:
    """The cable after the spool has pulled and the arm has given way.

    Args:
        cable: prepared.
        memory: before.
        before: what the spool had pulled then [m].
        pulled: what it has pulled now [m].
        given: s now [m].
        width: of the sheath's hysteresis [–].
        slope_factor: of the sheath [–].
    """
    k, factor, h = cable.stiffness, slope_factor * cable.slope, memory.h
    length = factor * pulled + cable.start - given
    if cable.kind == Friction.BOUC_WEN:
        h = advance_prepared(h, (pulled - before) / (cable.radius * width), cable.hysteresis)
        stretch = taken_up(length - width * cable.hysteresis_length * h, 1.0, cable)
    else:
        if cable.kind == Friction.CAPSTAN:
            ratio = exp(width * cable.capstan)
            low, high = taken_up(length, ratio, cable), max(0.0, taken_up(length, 1.0 / ratio, cable))
        else:
            r = width * cable.half_width
            low = taken_up(length - r, 1.0, cable)
            high = max(taken_up(length + r, 1.0, cable), give(k * r, cable.fabric))
        stretch = max(low, min(high, memory.node - given))
    motor = max(0.0, k * (length - stretch))
    return SuitCableMemory(given + stretch, h), Pull(factor * motor, fabric_tension(stretch, cable.fabric))
