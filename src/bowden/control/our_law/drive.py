"""How far the motor falls short of its command: one that sticks, yields or is at its limits is not the servo inverted.

    p'' = ω²·(c − p) − 2ζω·p'                            c the plan's command; the motor is expected at p − τ·p'
    u = motor − (p − τ·p'), as far as it is beyond b,    b = 0.01 rad + 0.5·T_s·|p'|,    T_s = 2ζ/ω + τ
    command = c − r·u + f,    f' = −r·u/(2T_s),    r = max(0, 1 − 2T_s·k)

k is the integral of the drive's own loop [1/s].

The shortfall u did not reach the joint either, so that the observer counts it with the correction that has arrived.
Without it the correction winds up while a gear sticks, and overshoots when it lets go: the arm of a heavy wearer then
swings by 10 to 20°. b is what a servo that is known to half its time constants may do, and 0.6° for encoders: within it
the motor is as expected, and its noise does not enter the loop.

What the motor lacks is asked for on top of the plan: at once, and by an integral whose time is twice the servo's, as
far as the drive does not do so itself. A PD drive, k = 0, yields to friction and load for as long as they last. f and
f − r·u are at most 2 rad.

Backward Euler.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.our_law.gains import BowdenGains
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity

EXPECTED = 0.01
"""Deviation of the motor that says nothing: counts, friction, a step of the plan [rad]."""

SERVO_DOUBT = 0.5
"""How wrong the servo's time constants may be, as a share of them [–]."""


INTEGRAL_TIME = 2.0
"""Time of the shortfall's integral over that of the servo: with a servo twice as slow it does not ring [–]."""

MOST_FORWARD = 2.0
"""Largest feedforward: a motor that lacks more is held, or its drive is at its limit [rad]."""


class ExpectedMotor(NamedTuple):
    """The motor as the servo should move it, a delay ahead, and what it has lacked."""

    position: Annotated[float, Quantity("p, the motor a delay later", "rad")]
    velocity: Annotated[float, Quantity("its rate", "rad/s")]
    shortfall: Annotated[float, Quantity("u, by which the motor falls short", "rad")]
    fed_forward: Annotated[float, Quantity("f, what a lasting shortfall adds to the command", "rad")]


@kernel
def servo_time(gains: BowdenGains) -> float:
    """T_s, by which the motor follows a steady motion late [s]."""
    return 2.0 * gains.servo_damping / gains.servo_frequency + gains.delay


@kernel
def share_of_shortfall(gains: BowdenGains) -> float:
    """r: what of the shortfall the drive does not make up for by itself [–]."""
    return max(0.0, 1.0 - INTEGRAL_TIME * servo_time(gains) * gains.servo_integral)


@kernel
def predict_motor(
    before: ExpectedMotor, command: float, shortfall: float, gains: BowdenGains, dt: float
) -> ExpectedMotor:
    """One cycle of the servo as known, and of f.

    Args:
        before: one cycle ago.
        command: c, in the direction in which the motor moves the joint on [rad].
        shortfall: u [rad].
        gains: ω, ζ, τ and k of it are used.
        dt: cycle [s].
    """
    omega, damping = gains.servo_frequency, gains.servo_damping
    stiff = omega * omega * dt
    slower = 1.0 + dt * (2.0 * damping * omega + stiff)
    velocity = (before.velocity + stiff * (command - before.position)) / slower
    lacks = share_of_shortfall(gains) * shortfall
    fed_forward = before.fed_forward - dt / (INTEGRAL_TIME * servo_time(gains)) * lacks
    bounded = max(-MOST_FORWARD, min(MOST_FORWARD, fed_forward))
    return ExpectedMotor(before.position + dt * velocity, velocity, shortfall, bounded)


@kernel
def tracking_shortfall(drive: ExpectedMotor, motor: float, most: float, gains: BowdenGains) -> float:
    """u, motor tracking shortfall (stiction or saturation) [rad].

    Args:
        drive: as expected, one cycle ago.
        motor: as measured, in the direction in which it moves the joint on [rad].
        most: by which u may change in this cycle, so that a reading that jumps is hardly counted [rad].
        gains: ω, ζ and τ of it are used.
    """
    off = motor - drive.position + gains.delay * drive.velocity
    tolerance = EXPECTED + SERVO_DOUBT * servo_time(gains) * abs(drive.velocity)
    shortfall = math.copysign(max(0.0, abs(off) - tolerance), off)
    return drive.shortfall + max(-most, min(most, shortfall - drive.shortfall))
