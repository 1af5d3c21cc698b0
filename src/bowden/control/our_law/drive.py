"""What of its command the motor did not do: a drive that sticks or is at its limits is not the servo that is inverted.

    p'' = ω²·(command − p) − 2ζω·p'                      the servo as known; the motor is expected at p − τ·p'
    missed = motor − (p − τ·p'), as far as it is beyond b,   b = 0.01 rad + 0.5·(2ζ/ω + τ)·|p'|

What was missed did not reach the joint either, so that the observer counts it with the correction that has arrived.
Without it the correction winds up while a gear sticks, and overshoots when it lets go: the arm of a heavy wearer then
swings by 10 to 20°. b is what a servo that is known to half its time constants may do, and 0.6° for encoders: within it
the motor is as expected, and its noise does not enter the loop.

Backward Euler. Portable subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.control.our_law.gains import BowdenGains
from bowden.core.extremes import larger
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
def moves_on(before: ExpectedMotor, command: float, omega: float, damping: float, dt: float) -> ExpectedMotor:
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
def missed(drive: ExpectedMotor, motor: float, gains: BowdenGains) -> float:
    """What of the motion that was asked for the motor did not make [rad].

    Args:
        drive: as expected.
        motor: as measured, in the direction in which it moves the joint on [rad].
        gains: ω, ζ and τ of it are used.
    """
    delay = gains.delay
    off = motor - drive.position + delay * drive.velocity
    slow = 2.0 * gains.servo_damping / gains.servo_frequency + delay
    bound = EXPECTED + SERVO_DOUBT * slow * np.abs(drive.velocity)
    return np.copysign(larger(np.abs(off) - bound, 0.0), off)
