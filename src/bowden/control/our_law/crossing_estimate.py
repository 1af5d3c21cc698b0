"""Learning the dead zone of a cable while it runs: how far the motor goes after it turned until the joint moves on.

At each reversal of the measured motor, the joint is watched until it is on the new side of where it was:

    found = motor travel since the turn − joint motion since the turn / slope

This is the width of the dead zone, whatever happens in it: rest (pure play), a motion the wrong way (the paper's
Bouc–Wen cable) or a slow start (a rounded loop). A Kalman filter takes

    width(motor, share) = w + wedge·motor − shortfall·(1 − share)

where the wedge is friction that grows with tension (a capstan), and `share` says how far the joint had gone before the
turn, in a full stroke (share 1) or in a small one. How far the joint first runs the wrong way, the `dip`, says whether
the feedback may act inside the dead zone. Portable subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity

WIDEST = 0.5
"""Largest dead zone that is believed, in motor angle [rad]."""

STEEPEST = 0.3
"""Largest wedge that is believed [rad/rad]."""

TOUCH = 0.003
"""Joint motion that ends a crossing [rad]; more where the noise asks for it."""

EDGE = 0.004
"""Motor motion that is a turn [rad]; more where the noise asks for it."""

SURE = 6.0
"""Standard deviations of the noise that are no motion [–]."""

STROKE = 0.3
"""Motor travel beyond the dead zone after which a stroke counts as full [rad]."""

_SPREAD = 2e-5
"""Variance of one measurement [rad²]."""

_DOUBT = (0.02, 0.0015, 0.0004)
"""Variances of w, wedge and shortfall where nothing is known; beyond them they do not grow."""

_WANDER = (1e-5, 2e-5, 1e-4)
"""By how much the variances of w, wedge and shortfall grow at each reversal, since a sheath is moved."""

_FIRST = (2.0, 3e-4)
"""Variance of w after the first touch, which is but a lower bound: its square times this, and this [–, rad²]."""

_DIP = (0.07, 0.001)
"""Dip up to which a dead zone counts as harmless: this share of its width, and this [–, rad]."""

_FADE = 0.8
"""What is left of a dip at the next crossing that shows none: a crossing by a jump too far shows none [–]."""


class CrossingEstimate(NamedTuple):
    """What is believed of the dead zone, and what is needed to learn more."""

    width: Annotated[float, Quantity("width of the dead zone", "rad", symbol="w")]
    wedge: Annotated[float, Quantity("what the width grows by with the motor angle", "rad/rad")]
    shortfall: Annotated[float, Quantity("what it lacks after a stroke of no length", "rad")]
    w11: Annotated[float, Quantity("covariance of (w, wedge, shortfall), upper triangle")]
    w12: float
    w13: float
    w22: float
    w23: float
    w33: float
    touches: Annotated[float, Quantity("full crossings that were seen, up to 9")]
    heading: Annotated[float, Quantity("direction of the motor; 0 before it has moved")]
    far_motor: Annotated[float, Quantity("furthest motor angle in that direction", "rad")]
    far_joint: Annotated[float, Quantity("joint angle there", "rad")]
    turn_motor: Annotated[float, Quantity("motor angle at the last turn", "rad")]
    turn_joint: Annotated[float, Quantity("joint angle there", "rad")]
    turn_open: Annotated[
        float,
        Quantity("1 until the joint moves on after a turn, ½ if the last crossing had not ended before it, else 0"),
    ]
    free: Annotated[float, Quantity("motor travel since the joint moves on", "rad")]
    share: Annotated[float, Quantity("share of a full stroke before the last turn")]
    low: Annotated[float, Quantity("furthest that the joint went the wrong way since the turn, negative", "rad")]
    dip: Annotated[float, Quantity("how far it goes the wrong way in a dead zone; 1 until one was seen", "rad")]


class CycleEvents(NamedTuple):
    """What happened in this cycle."""

    turned: float
    """1 where the motor turned."""
    touched: float
    """1 where the joint moved on."""


@kernel
def first_crossing(width: float, doubt: float, motor: float, joint: float) -> CrossingEstimate:
    """What is believed at the start; a width above 0 comes from a model, and the first touch is like any other then."""
    doubt2 = doubt * doubt
    return CrossingEstimate(
        width=width,
        wedge=0.0,
        shortfall=0.0,
        w11=_DOUBT[0] * doubt2,
        w12=0.0,
        w13=0.0,
        w22=_DOUBT[1] * doubt2,
        w23=0.0,
        w33=_DOUBT[2] * doubt2,
        touches=sel(width > 0.0, 2.0, 0.0),
        heading=0.0,
        far_motor=motor,
        far_joint=joint,
        turn_motor=motor,
        turn_joint=joint,
        turn_open=sel(width > 0.0, 0.5, 1.0),
        free=0.0,
        share=1.0,
        low=0.0,
        dip=1.0,
    )


@kernel
def crossing_from(crossing: CrossingEstimate, turned: float, motor: float) -> tuple[float, float]:
    """The dead zone and its standard deviation [rad], from the last turn if `turned`, else if the motor turned here."""
    where = sel(turned, crossing.turn_motor, motor)
    lacking = 1.0 - sel(turned, crossing.share, np.fmin(1.0, crossing.free * (1.0 / STROKE)))
    width = crossing.width + crossing.wedge * where - crossing.shortfall * lacking
    h1 = crossing.w11 + crossing.w12 * where - crossing.w13 * lacking
    h2 = crossing.w12 + crossing.w22 * where - crossing.w23 * lacking
    h3 = crossing.w13 + crossing.w23 * where - crossing.w33 * lacking
    variance = np.fmax(0.0, h1 + h2 * where - h3 * lacking)
    return np.fmax(0.0, np.fmin(WIDEST, width)), np.sqrt(variance)


@kernel
def harmless(crossing: CrossingEstimate) -> float:
    """1 where the joint is known not to run the wrong way in the dead zone, but for a little, else 0."""
    most = _DIP[0] * np.fmax(0.0, crossing.width + np.fmax(0.0, crossing.wedge)) + _DIP[1]
    return sel(crossing.dip < most, 1.0, 0.0)


@kernel
def watch(
    crossing: CrossingEstimate, motor: float, joint: float, slope: float, noise: float, settled: float
) -> tuple[CrossingEstimate, CycleEvents]:
    """What is believed after one more sample.

    Args:
        crossing: what was believed.
        motor: measured motor angle, counted so that the slope is positive [rad].
        joint: measured joint angle [rad].
        slope: joint motion per motor motion [rad/rad].
        noise: standard deviation of the encoders' noise [rad].
        settled: 0 during a jump and shortly after it, when the joint may still lag, else 1.
    """
    edge, touch = np.fmax(EDGE, SURE * noise), np.fmax(TOUCH, SURE * noise)
    away = motor - crossing.far_motor
    still = crossing.heading == 0.0
    onward = away * crossing.heading
    turned = (onward < -edge) + still * (np.abs(away) > edge) > 0.0
    heading = sel(turned, np.sign(away), crossing.heading)
    turn_motor = sel(turned, crossing.far_motor, crossing.turn_motor)
    turn_joint = sel(turned, crossing.far_joint, crossing.turn_joint)
    whole = sel((crossing.turn_open < 0.25) + still > 0.0, 1.0, 0.5)
    turn_open = sel(turned, sel(still, crossing.turn_open, whole), crossing.turn_open)
    share = sel(turned * (1.0 - still), np.fmin(1.0, crossing.free * (1.0 / STROKE)), crossing.share)
    further = turned + (onward > 0.0) > 0.0

    # at a turn what is judged is the crossing before it, up to there
    begun, began = crossing.turn_motor, crossing.turn_joint
    gone = (sel(turned, crossing.far_motor, motor) - begun) * crossing.heading
    moved = (sel(turned, crossing.far_joint, joint) - began) * crossing.heading
    ended = (crossing.turn_open > 0.0) * (moved > touch) * (gone > EDGE) > 0.0
    touched = ended * settled * (1.0 - turned) > 0.0
    found = np.fmax(0.0, np.fmin(WIDEST, gone - moved * (1.0 / slope)))
    first = crossing.touches < 0.5  # where in the dead zone the cable was at the start is not known
    lacking = (1.0 - crossing.share) * (1.0 - first)
    miss = found - (crossing.width + crossing.wedge * begun - crossing.shortfall * lacking)
    full = crossing.turn_open > 0.75
    told = touched * (full + (miss > 0.01) > 0.0) + ended * turned * full * (miss < 0.0) > 0.0
    use = sel(told, 1.0, 0.0)

    w11 = crossing.w11 + use * sel(crossing.w11 < _DOUBT[0], _WANDER[0], 0.0)
    w22 = crossing.w22 + use * sel(crossing.w22 < _DOUBT[1], _WANDER[1], 0.0)
    w33 = crossing.w33 + use * sel(crossing.w33 < _DOUBT[2], _WANDER[2], 0.0)
    h1 = w11 + crossing.w12 * begun - crossing.w13 * lacking
    h2 = crossing.w12 + w22 * begun - crossing.w23 * lacking
    h3 = crossing.w13 + crossing.w23 * begun - w33 * lacking
    spread = h1 + h2 * begun - h3 * lacking + _SPREAD
    kept = _FIRST[0] * found * found + _FIRST[1]  # the first touch is a bound: it moves w, but leaves it in doubt
    mean = use / (spread + sel(first, found * found, 0.0))
    pull = use * sel(first, np.fmax(0.0, h1 - kept), 1.0) / sel(first, np.fmax(h1 * h1, 1e-20), spread)
    more = mean * (1.0 - first) * miss
    dipped = sel(first, 2.0, 1.0) * (0.0 - crossing.low - 3.0 * noise)  # the first touch begins somewhere inside
    after = CrossingEstimate(
        width=np.fmax(-WIDEST, np.fmin(WIDEST, crossing.width + mean * h1 * miss)),
        wedge=np.fmax(-STEEPEST, np.fmin(STEEPEST, crossing.wedge + more * h2)),
        shortfall=np.fmax(0.0, np.fmin(WIDEST, crossing.shortfall + more * h3)),
        w11=w11 - pull * h1 * h1,
        w12=crossing.w12 - pull * h1 * h2,
        w13=crossing.w13 - pull * h1 * h3,
        w22=w22 - pull * h2 * h2,
        w23=crossing.w23 - pull * h2 * h3,
        w33=w33 - pull * h3 * h3,
        touches=np.fmin(9.0, crossing.touches + sel(touched * full, 1.0, 0.0)),
        heading=heading,
        far_motor=sel(further, motor, crossing.far_motor),
        far_joint=sel(further, joint, crossing.far_joint),
        turn_motor=turn_motor,
        turn_joint=turn_joint,
        turn_open=sel(touched, 0.0, turn_open),
        free=sel((turned + touched > 0.0) + (turn_open > 0.0) > 0.0, 0.0, crossing.free + np.fmax(onward, 0.0)),
        share=share,
        low=sel(turned, 0.0, np.fmin(crossing.low, moved)),
        dip=sel(touched, np.fmax(sel(first, 0.0, _FADE * crossing.dip), dipped), crossing.dip),
    )
    return after, CycleEvents(sel(turned, 1.0, 0.0), sel(touched, 1.0, 0.0))
