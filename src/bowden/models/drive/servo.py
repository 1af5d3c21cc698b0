"""The servo: the motor under its linear PD position loop, as seen from its command.

    d²motor/dt² = ω²·(command − motor) − 2·ζ·ω·d(motor)/dt,   |d(motor)/dt| ≤ speed,   |d²motor/dt²| ≤ acceleration

Between two sub-steps the command is constant, so the linear part is solved exactly (matrix exponential); a limit
replaces the sub-step by one of constant acceleration. The acceleration limit stands for the current limit.
"""

import math
from typing import Annotated, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.kernel import exp, kernel, sqrt
from bowden.core.part import part
from bowden.core.quantity import Quantity


@part
class Servo(NamedTuple):
    """A position-controlled motor: how quickly it follows its target.

    >>> Servo(natural_frequency=20.0).damping
    1.0
    """

    natural_frequency: Annotated[
        float, Quantity("natural frequency", "rad/s", shown="Hz", symbol="ω/2π", gt=0.0, le=1000.0)
    ] = 54.4
    """54.4 puts the −3 dB point of the critically damped servo at 35 rad/s."""
    damping: Annotated[float, Quantity("damping ratio; 1 is critical", symbol="ζ", gt=0.0, le=20.0)] = 1.0
    speed_limit: Annotated[float, Quantity("largest speed at the spool", "rad/s", gt=0.0, endless=True)] = math.inf
    acceleration_limit: float = math.inf
    """Largest acceleration at the spool, from the current limit [rad/s²]."""


class ServoState(NamedTuple):
    """The motor's motion at the spool."""

    position: float
    """[rad]"""
    velocity: float
    """[rad/s]"""
    acceleration: float
    """Now, or its mean over the last sub-step [rad/s²]."""


class ServoStep(NamedTuple):
    """A servo prepared for one length of step: (x, v) relative to the command after `dt`."""

    xx: float
    xv: float
    vx: float
    vv: float
    dt: float
    speed_limit: float
    acceleration_limit: float
    stiffness: float
    """ω² [1/s²]."""
    drag: float
    """2ζω [1/s]."""
    reach: float
    """|acceleration| + ω·|velocity| below which no limit is met within `dt` [rad/s²]; see `servo_is_free`."""


def prepare(servo: Servo, dt: float) -> ServoStep:
    """The exact transition matrix of the linear servo over `dt` [s].

    Raises:
        ParameterError: a frequency, damping, limit or time step that is not above zero.
    """
    for name, value in (*servo._asdict().items(), ("dt", dt)):
        if not value > 0.0:
            raise ParameterError(f"servo: {name} is {value}", expected="a number above 0")
    omega, zeta = servo.natural_frequency, servo.damping
    sigma, disc = zeta * omega, (zeta * zeta - 1.0) * omega * omega
    root = math.sqrt(abs(disc))
    if root * dt < 1e-6:  # critically damped: sin(x)/x and sinh(x)/x are 1 to within 2e-13
        cosine, sine = 1.0, dt
    elif disc < 0:
        cosine, sine = math.cos(root * dt), math.sin(root * dt) / root
    else:
        cosine, sine = math.cosh(root * dt), math.sinh(root * dt) / root
    decay = math.exp(-sigma * dt)
    return ServoStep(
        xx=decay * (cosine + sigma * sine),
        xv=decay * sine,
        vx=-decay * omega * omega * sine,
        vv=decay * (cosine - sigma * sine),
        dt=dt,
        speed_limit=servo.speed_limit,
        acceleration_limit=servo.acceleration_limit,
        stiffness=omega * omega,
        drag=2.0 * sigma,
        reach=min(servo.acceleration_limit, omega * servo.speed_limit) * math.exp(-(omega + 2.0 * sigma) * dt),
    )


LONGEST_CYCLE = 0.25
"""ω·Ts up to which a cycle is one exact step: far less than half a swing, in which the motor could turn twice [rad]."""
_HALF_SWING = 3.0
"""ω·Ts up to which the motor turns once at most in a cycle without a limit: a little below π [rad]."""


class ServoSteps(NamedTuple):
    """A servo prepared for one cycle of a loop."""

    substep: ServoStep
    """For a servo at its limits, or one that is quick beside the cycle; its `reach` is that of a whole cycle, and below
    zero where the motor could turn twice in one."""
    cycle: ServoStep
    """Over a whole cycle; its `reach` is below zero where the cycle is longer than `LONGEST_CYCLE`."""


def prepare_steps(servo: Servo, sample_time: float, substeps: int) -> ServoSteps:
    """The servo for cycles of `sample_time` [s] and for its parts; what is raised is `prepare`'s."""
    cycle, angle = prepare(servo, sample_time), servo.natural_frequency * sample_time
    substep = prepare(servo, sample_time / substeps)._replace(reach=cycle.reach if angle <= _HALF_SWING else -1.0)
    return ServoSteps(substep, cycle if angle <= LONGEST_CYCLE else cycle._replace(reach=-1.0))


@kernel
def servo_approach(offset: float, velocity: float, servo: ServoStep) -> tuple[float, float]:
    """The motor relative to a command that is constant over one sub-step: its offset [rad] and velocity after it."""
    dt, change = servo.dt, servo.acceleration_limit * servo.dt
    free = servo.vx * offset + servo.vv * velocity
    if abs(free - velocity) <= change and abs(free) <= servo.speed_limit:
        return servo.xx * offset + servo.xv * velocity, free
    limited = max(velocity - change, min(velocity + change, free))
    limited = max(-servo.speed_limit, min(servo.speed_limit, limited))
    return offset + 0.5 * dt * (velocity + limited), limited


@kernel
def servo_acceleration(offset: float, velocity: float, servo: ServoStep) -> float:
    """Acceleration of the unlimited servo [rad/s²] at an offset from its command [rad] and a velocity."""
    return -servo.stiffness * offset - servo.drag * velocity


@kernel
def servo_is_free(offset: float, velocity: float, servo: ServoStep) -> bool:
    """True if the servo surely meets neither of its limits within `dt`.

    Of the unlimited servo |a| + ω·|v| grows at most by the factor exp((1 + 2ζ)·ω·t), since its derivative is at most
    2ζω·|a| + ω²·|v| + ω·|a|.
    """
    return abs(servo_acceleration(offset, velocity, servo)) + sqrt(servo.stiffness) * abs(velocity) <= servo.reach


@kernel
def servo_turn(offset: float, velocity: float, servo: ServoStep) -> tuple[float, float]:
    """Offset [rad] at which the unlimited servo next comes to a stop, before half a swing has passed, and when [s].

    v = 0 where sin(rt)/(r·cos(rt)) = q = v/(ω²x + ζωv) with r² = (1 − ζ²)·ω²; sinh and cosh where r² < 0:

        offset = e^(−ζωt)·((1 + ζωq)·x + q·v)/√(1 + r²q²),   t = atan(rq)/r, atanh(|r|q)/|r|, or q where r = 0
    """
    sigma = 0.5 * servo.drag
    q = velocity / (servo.stiffness * offset + sigma * velocity)
    square = servo.stiffness - sigma * sigma
    z = sqrt(abs(square)) * q
    if z == 0.0:
        time = q
    elif square > 0.0:
        time = q * math.atan(z) / z
    else:
        time = q * math.atanh(z) / z
    still = exp(-sigma * time) * ((1.0 + sigma * q) * offset + q * velocity) / sqrt(1.0 + square * q * q)
    return still, time


@kernel
def servo_step(state: ServoState, command: float, servo: ServoStep) -> ServoState:
    """The motor one sub-step later, for a command [rad] that is constant over it."""
    offset, velocity = servo_approach(state.position - command, state.velocity, servo)
    return ServoState(offset + command, velocity, (velocity - state.velocity) / servo.dt)


@kernel
def servo_predict(
    position: float, velocity: float, command: float, omega: float, zeta: float, time: float
) -> tuple[float, float]:
    """Position [rad] and velocity [rad/s] of the unlimited servo after any `time` [s], for a live watch on a drive.

    One step of the implicit Euler method, which is stable for every time; in 1 ms it is as exact as a servo is known.
    """
    velocity = velocity + time * omega * omega * (command - position)
    velocity = velocity / (1.0 + omega * time * (2.0 * zeta + omega * time))
    return position + time * velocity, velocity
