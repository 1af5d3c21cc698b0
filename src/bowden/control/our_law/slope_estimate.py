"""Learning a cable's slope in each direction, and the joint's lag behind it, while it runs.

Beyond the dead zone, over stretches of motor travel,

    Δjoint = a·Δmotor − τ·Δ(d(joint)/dt)

with a of the direction, and all three behind the same filter, so that the equation holds exactly for a load that lags
by τ. A Kalman filter takes (a rising, a falling, τ). What a sheath that is moved adds meanwhile grows with the time
that a stretch took, and counts as noise. Portable subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.control.our_law.crossing_estimate import CrossingEstimate, CycleEvents
from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity

STRETCH = 0.03
"""Motor travel of a stretch [rad]."""

CLEAR = 0.1
"""Motor travel beyond the dead zone before the first stretch counts, past a loop's rounded corner [rad]."""

LEAST, MOST = 0.55, 1.3
"""Bounds of the slope over its first guess [–]."""

LONGEST = 0.1
"""Largest lag that is believed [s]."""

_FILTER = 0.015
"""[s]"""

_SPREAD = 4e-7
"""Variance of a stretch's joint motion [rad²]."""

_DRIFT = 0.005
"""Speed at which a moving sheath moves the joint [rad/s]."""

_WANDER = (2e-5, 1e-7)
"""By how much the variances of a and τ grow in each stretch [1 and s²]."""


class SlopeEstimate(NamedTuple):
    """What is believed, and what is needed to learn more."""

    up: Annotated[float, Quantity("slope while the motor rises", "rad/rad", symbol="a")]
    down: Annotated[float, Quantity("slope while it falls", "rad/rad", symbol="a")]
    lag: Annotated[float, Quantity("lag of the joint", "s", symbol="τ")]
    s11: Annotated[float, Quantity("covariance of (up, down, lag), upper triangle")]
    s12: float
    s13: float
    s22: float
    s23: float
    s33: float
    filtered_motor: Annotated[float, Quantity("motor behind a filter", "rad")]
    filtered_joint: Annotated[float, Quantity("joint behind the same filter", "rad")]
    from_motor: Annotated[float, Quantity("where the present stretch began", "rad")]
    from_joint: Annotated[float, Quantity("joint angle there", "rad")]
    from_rate: Annotated[float, Quantity("speed of the joint there", "rad/s")]
    elapsed: Annotated[float, Quantity("time since then", "s")]


@kernel
def first_slope(slope: float, lag: float, doubt: float, motor: float, joint: float) -> SlopeEstimate:
    """What is believed at the start."""
    doubt2 = doubt * doubt
    return SlopeEstimate(
        up=slope,
        down=slope,
        lag=lag,
        s11=0.01 * doubt2,
        s12=0.0,
        s13=0.0,
        s22=0.01 * doubt2,
        s23=0.0,
        s33=1e-4,
        filtered_motor=motor,
        filtered_joint=joint,
        from_motor=motor,
        from_joint=joint,
        from_rate=0.0,
        elapsed=0.0,
    )


@kernel
def learn_slope(
    slope: SlopeEstimate,
    crossing: CrossingEstimate,
    seen: CycleEvents,
    motor: float,
    joint: float,
    guess: float,
    stray: float,
    dt: float,
) -> SlopeEstimate:
    """What is believed after one more sample.

    Args:
        slope: what was believed.
        crossing: the dead zone, after this sample.
        seen: what happened there in this cycle.
        motor: measured motor angle, counted so that the slope is positive [rad].
        joint: measured joint angle [rad].
        guess: the slope's first guess, which bounds it [rad/rad].
        stray: standard deviation of what else moves the joint in a stretch, such as an arm that swings [rad].
        dt: the cycle [s].
    """
    span = _FILTER + dt
    rate = (joint - slope.filtered_joint) * (1.0 / span)
    now_motor = slope.filtered_motor + (motor - slope.filtered_motor) * (dt * (1.0 / span))
    now_joint = slope.filtered_joint + (joint - slope.filtered_joint) * (dt * (1.0 / span))
    anew = seen.turned + seen.touched > 0.0
    from_motor = sel(anew, now_motor, slope.from_motor)
    from_joint = sel(anew, now_joint, slope.from_joint)
    from_rate = sel(anew, rate, slope.from_rate)
    elapsed = sel(anew, 0.0, slope.elapsed + dt)

    travel = now_motor - from_motor
    done = (crossing.turn_open < 0.25) * (travel * crossing.heading > STRETCH) > 0.0
    use = sel(done * (crossing.free > CLEAR), 1.0, 0.0)
    x1, x2 = sel(crossing.heading > 0.0, travel, 0.0), sel(crossing.heading > 0.0, 0.0, travel)
    x3 = from_rate - rate
    s11, s22, s33 = slope.s11 + use * _WANDER[0], slope.s22 + use * _WANDER[0], slope.s33 + use * _WANDER[1]
    h1 = s11 * x1 + slope.s12 * x2 + slope.s13 * x3
    h2 = slope.s12 * x1 + s22 * x2 + slope.s23 * x3
    h3 = slope.s13 * x1 + slope.s23 * x2 + s33 * x3
    drift = _DRIFT * elapsed
    pull = use / (x1 * h1 + x2 * h2 + x3 * h3 + _SPREAD + drift * drift + stray * stray)
    miss = now_joint - from_joint - (slope.up * x1 + slope.down * x2 + slope.lag * x3)
    return SlopeEstimate(
        up=np.fmax(LEAST * guess, np.fmin(MOST * guess, slope.up + pull * h1 * miss)),
        down=np.fmax(LEAST * guess, np.fmin(MOST * guess, slope.down + pull * h2 * miss)),
        lag=np.fmax(-0.02, np.fmin(LONGEST, slope.lag + pull * h3 * miss)),
        s11=s11 - pull * h1 * h1,
        s12=slope.s12 - pull * h1 * h2,
        s13=slope.s13 - pull * h1 * h3,
        s22=s22 - pull * h2 * h2,
        s23=slope.s23 - pull * h2 * h3,
        s33=s33 - pull * h3 * h3,
        filtered_motor=now_motor,
        filtered_joint=now_joint,
        from_motor=sel(done, now_motor, from_motor),
        from_joint=sel(done, now_joint, from_joint),
        from_rate=sel(done, rate, from_rate),
        elapsed=sel(done, 0.0, elapsed),
    )
