"""How far the motor falls short of its command: a drive that sticks or is at its limits is not the servo inverted.

    p'' = ω²·(command − p) − 2ζω·p'                      the servo as known; the motor is expected at p − τ·p'
    u = motor − (p − τ·p'), as far as it is beyond b,   b = 0.01 rad + 0.5·(2ζ/ω + τ)·|p'|

The shortfall u did not reach the joint either, so that the observer counts it with the correction that has arrived.
Without it the correction winds up while a gear sticks, and overshoots when it lets go: the arm of a heavy wearer then
swings by 10 to 20°. b is what a servo that is known to half its time constants may do, and 0.6° for encoders: within it
the motor is as expected, and its noise does not enter the loop.

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


class ExpectedMotor(NamedTuple):
    """The motor as the servo should move it, a delay ahead."""

    position: Annotated[float, Quantity("p, the motor a delay later", "rad")]
    velocity: Annotated[float, Quantity("its rate", "rad/s")]


@kernel
def predict_motor(before: ExpectedMotor, command: float, omega: float, damping: float, dt: float) -> ExpectedMotor:
    """One cycle of the servo as known.

    Args:
        before: one cycle ago.
        command: as sent, in the direction in which the motor moves the joint on [rad].
        omega: ω of the servo [rad/s].
        damping: ζ of the servo [–].
        dt: cycle [s].
    """
    stiff = omega * omega * dt
    slower = 1.0 + dt * (2.0 * damping * omega + stiff)
    velocity = (before.velocity + stiff * (command - before.position)) / slower
    return ExpectedMotor(before.position + dt * velocity, velocity)


@kernel
def tracking_shortfall(drive: ExpectedMotor, motor: float, gains: BowdenGains) -> float:
    """u, motor tracking shortfall (stiction or saturation) [rad].

    Args:
        drive: as expected.
        motor: as measured, in the direction in which it moves the joint on [rad].
        gains: ω, ζ and τ of it are used.
    """
    delay = gains.delay
    off = motor - drive.position + delay * drive.velocity
    slow = 2.0 * gains.servo_damping / gains.servo_frequency + delay
    tolerance = EXPECTED + SERVO_DOUBT * slow * abs(drive.velocity)
    return math.copysign(max(0.0, abs(off) - tolerance), off)
