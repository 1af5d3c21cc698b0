"""Learning a cable while it runs: slope, height, offset and steepness of its hysteresis (see `bowden.control.bowden`).

    joint = a·motor + b·η + o,    dη/d(motor) = −k/b inside the slot, |η| ≤ 1

A Kalman filter on (a, b, o) takes one step each 0.002 rad of motor travel, and measures only where η is surely at ±1.
Its uncertainty grows with travel, because a sheath is moved; rest teaches nothing and forgets nothing. k follows from
the chord of each full reversal, over the first half of the slot. Portable subset.
"""

from typing import NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel

TRAVEL_STEP = 0.002
"""Motor travel between two steps of learning, well above an encoder's count [rad]."""

HIGHEST = 0.2
"""Largest height b that is believed [rad]: a dead zone of 23° in all."""


class CableEstimate(NamedTuple):
    """What is believed of the cable, and what is needed to learn more."""

    slope: float
    """a [rad/rad]."""
    height: float
    """b [rad]."""
    offset: float
    """o [rad]."""
    steepness: float
    """k [rad/rad]."""
    p11: float
    """Covariance of (a, b, o), upper triangle."""
    p12: float
    p13: float
    p22: float
    p23: float
    p33: float
    hysteresis: float
    """η [–]."""
    motor: float
    """Motor angle at the last step of travel [rad]."""
    joint: float
    """Joint angle there [rad]."""
    heading: float
    """Direction of the last step of travel [–]."""
    travel: float
    """Travel since the motor turned [rad]."""
    turn_motor: float
    """Motor angle where it turned [rad]."""
    turn_joint: float
    """Joint angle there [rad]."""
    turn_open: float
    """1 while that reversal can still tell k [–]."""


@kernel
def first_guess(
    slope: float, height: float, steepness: float, doubt: float, joint: float, motor: float
) -> CableEstimate:
    """What is believed at the start: the offset is the one that fits the first sample, correlated with the slope."""
    doubt2 = doubt * doubt
    p11, p22 = 0.01 * doubt2, 0.0025 * doubt2
    return CableEstimate(
        slope=slope,
        height=height,
        offset=joint - slope * motor,
        steepness=steepness * slope,
        p11=p11,
        p12=0.0,
        p13=0.0 - p11 * motor,
        p22=p22,
        p23=0.0,
        p33=p11 * motor * motor + 1e-6,
        hysteresis=0.0,
        motor=motor,
        joint=joint,
        heading=0.0,
        travel=0.0,
        turn_motor=motor,
        turn_joint=joint,
        turn_open=0.0,
    )


@kernel
def learn(
    cable: CableEstimate, motor: float, joint: float, wander: float, noise: float, guess: float, settled: float
) -> CableEstimate:
    """What is believed after one more sample.

    Args:
        cable: what was believed.
        motor: measured motor angle, counted so that the slope is positive [rad].
        joint: measured joint angle [rad].
        wander: how much a and b may change in one radian of travel [1 and rad per √rad].
        noise: standard deviation of what the model does not explain [rad].
        guess: the first guess of the slope; a stays between 0.4 and 2 times it.
        settled: 0 during a jump through the slot, of which nothing is learned, else 1.
    """
    a, b, k = cable.slope, cable.height, cable.steepness
    moved = motor - cable.motor
    stepped = np.abs(moved) > TRAVEL_STEP
    moved = sel(stepped, moved, 0.0)
    length = np.abs(moved)

    # k: chord from the turn over the first half of the slot, if the slot had been taken up before the turn
    heading = sel(stepped, np.sign(moved), cable.heading)
    turned = stepped * (heading * cable.heading < 0.0)
    taken_up = (cable.travel > 3.0 * b / a) * (b > 0.006)
    turn_open = sel(turned, sel(taken_up, 1.0, 0.0), cable.turn_open)
    turn_motor = sel(turned, cable.motor, cable.turn_motor)
    turn_joint = sel(turned, cable.joint, cable.turn_joint)
    travel = sel(turned, length, cable.travel + length)
    ready = stepped * (turn_open > 0.5) * (travel >= b / a)
    span = motor - turn_motor
    chord = (joint - turn_joint) / sel(np.abs(span) > 1e-3, span, 1.0)
    steepness = np.fmax(0.2 * a, np.fmin(2.0 * a, k + 0.5 * (a - chord - k)))
    steepness = sel(ready, steepness, k)
    turn_open = sel(ready, 0.0, turn_open)

    # a, b, o: where η is surely at one end, which is asked for a quarter more travel than k says
    slow = 0.8 * np.fmax(k, 0.7 * a) / np.fmax(b, 0.002)
    eta = np.fmax(-1.0, np.fmin(1.0, cable.hysteresis - slow * moved))
    use = sel(stepped * (np.abs(eta) >= 1.0) * (settled > 0.5), 1.0, 0.0)
    growth = wander * wander * length
    p11 = np.fmin(cable.p11 + growth, 0.04)
    p22 = np.fmin(cable.p22 + growth, 0.01)
    p33 = np.fmin(cable.p33 + 1e-4 * growth, 0.1)
    miss = joint - (a * motor + b * eta + cable.offset)
    h1 = p11 * motor + cable.p12 * eta + cable.p13
    h2 = cable.p12 * motor + p22 * eta + cable.p23
    h3 = cable.p13 * motor + cable.p23 * eta + p33
    spread = motor * h1 + eta * h2 + h3 + noise * noise
    g1, g2, g3 = use * h1 / spread, use * h2 / spread, use * h3 / spread
    return CableEstimate(
        slope=np.fmax(0.4 * guess, np.fmin(2.0 * guess, a + g1 * miss)),
        height=np.fmax(0.0, np.fmin(HIGHEST, b + g2 * miss)),
        offset=cable.offset + g3 * miss,
        steepness=steepness,
        p11=p11 - g1 * h1,
        p12=cable.p12 - g1 * h2,
        p13=cable.p13 - g1 * h3,
        p22=p22 - g2 * h2,
        p23=cable.p23 - g2 * h3,
        p33=p33 - g3 * h3,
        hysteresis=eta,
        motor=sel(stepped, motor, cable.motor),
        joint=sel(stepped, joint, cable.joint),
        heading=heading,
        travel=travel,
        turn_motor=turn_motor,
        turn_joint=turn_joint,
        turn_open=turn_open,
    )
