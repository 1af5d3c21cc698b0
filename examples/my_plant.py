"""A plant of one's own: a stiff spool, a cable that stretches under Coulomb friction at the joint, and a damped link.

Try it from Python:

    import bowden

    trace = bowden.simulate(bowden.Rig(plant="examples/my_plant.py", duration=20.0), "adaptive")
"""

from typing import Any, NamedTuple

from bowden import kernel


class Parameters(NamedTuple):
    """What the plant is made of; every field needs a default."""

    bandwidth: float = 40.0
    """Of the motor under its position loop [rad/s]."""
    slope: float = 0.95
    """Joint motion per motor motion [rad/rad]."""
    friction: float = 0.05
    """Motor travel that friction takes up before the joint moves [rad]."""


class Body(NamedTuple):
    """Where it is; joint, motor and motor_velocity come first."""

    joint: float
    motor: float
    motor_velocity: float


@kernel
def rest(plant: Any, motor: float, sheath: Any) -> Body:
    """At rest at a motor angle [rad], in the middle of what friction holds."""
    return Body(plant.parameters.slope * motor, motor, 0.0)


@kernel
def advance(plant: Any, body: Body, applied: float, sheath: Any, next_sheath: Any) -> Body:
    """One cycle later: a critically damped motor by semi-implicit Euler, then Coulomb friction, wider as it bends."""
    given, dt = plant.parameters, plant.dt
    pull = given.bandwidth * given.bandwidth * (applied - body.motor)
    speed = (body.motor_velocity + dt * pull) / (1.0 + 2.0 * given.bandwidth * dt)
    motor = body.motor + dt * speed
    play = given.friction * next_sheath.width
    end = max(motor - play, min(motor + play, body.joint / given.slope))
    return Body(given.slope * end, motor, speed)
