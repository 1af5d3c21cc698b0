"""The suit's motor: a PD position loop that sets a current, within what drive and supply can give, behind two gears.

    τ* = J·ω²·(e + y) − 2·ζ·ω·J·d(spool)/dt,    e = target − spool,    I = τ*/(N·kτ), bounded by
    |I| ≤ I_max   and   |R·I + kτ·N·d(spool)/dt| ≤ V               the supply against the back-EMF
    J·d²spool/dt² = N·kτ·I − load − friction,    |friction| ≤ F + (1 − η)·max(|N·kτ·I|, |load|)

    push' = (direction of the target − push)/T, and τ* + F_ff·push in place of τ*

The paper's loop is PD (Section 3.1): y = 0, and friction and load leave the spool behind its target. Drives that one
buys add an integral, dy/dt = k_i·e, here held inside ± `BAND` of the target, or it hunts about the friction, and while
the current is at a limit. F_ff, 0 unless it is asked for, makes up for friction ahead of any error, as the torque
offset that drives take beside a position (CiA 402, object 60B2h). Its direction is that of the target's last motion
beyond `DEAD`, so that noise turns nothing, and fades where the target rests. A drive on a bus gets its offset by the
loop, which makes it with the same kernel, `turn_push`.

The current loop is taken as immediate. Friction is Coulomb's, solved implicitly: what it cannot stop it slows, and it
never turns the spool back. The gears' loss is a friction in proportion to the torque that they carry.
"""

import math
from typing import NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.models.drive.servo import Servo


class GearedMotor(NamedTuple):
    """Motor, gears and spool; kτ, R and both gears are the paper's (Sections 2.2 and 5.4), the rest stated choices."""

    torque_constant: float = 16.7e-3
    """kτ [N·m/A]."""
    resistance: float = 0.199
    """R, terminal resistance [Ω]."""
    gear: float = 25.0
    """N, motor turns per spool turn: 5:1 and 5:1 [–]."""
    inertia: float = 1.6e-3
    """J, of rotor (25 g·cm²), gears and spool, at the spool [kg·m²]."""
    efficiency: float = 0.8
    """η, of both gears [–]."""
    friction: float = 2.3
    """F, of bearings, seals and the feeder's rollers, at the spool [N·m]."""
    current_limit: float = 20.0
    """Largest current of the drive [A]."""
    supply: float = 24.0
    """V [V]."""
    integral: float = 0.0
    """k_i of the position loop; 0 is the paper's PD loop [1/s]."""
    friction_feedforward: float = 0.0
    """F_ff, torque in the direction in which the target moves, at the spool [N·m]."""
    servo: Servo = Servo()
    """ω and ζ of the unloaded PD loop; its limits are not looked at, the current's and the supply's stand for them."""


class SpoolState(NamedTuple):
    """The spool's motion."""

    position: float
    """[rad]"""
    velocity: float
    """[rad/s]"""
    current: float
    """[A]"""
    offset: float
    """y, what the integral adds to the target [rad]."""
    settled_target: float
    """The target without its motions of less than `DEAD` [rad]."""
    push: float
    """Direction of the feed-forward, −1…1 [–]."""
    torque_offset: float
    """Torque offset that the drive gets from outside, at the spool [N·m]."""


class FrictionPush(NamedTuple):
    """State of a push against friction."""

    settled_target: float
    """The target without its motions of less than `DEAD` [rad]."""
    direction: float
    """Of the push, −1…1 [–]."""


BAND = 0.002
"""Error of the spool that the integral leaves alone [rad]."""
DEAD = 0.003
"""Motion of the target that turns no feed-forward; about 0.07° of the elbow [rad]."""
TURNING, FADING = 0.01, 1.0
"""Time constants of the feed-forward's direction: where the target moves, and where it rests [s]."""


def no_load_speed(motor: GearedMotor) -> float:
    """Speed of the spool at which the back-EMF is the supply, V/(kτ·N) [rad/s]."""
    return motor.supply / (motor.torque_constant * motor.gear)


def check_geared_motor(motor: GearedMotor) -> None:
    """Refuse a motor that cannot be.

    Raises:
        ParameterError: a number out of its range.
    """
    for name in ("torque_constant", "resistance", "gear", "inertia", "current_limit", "supply"):
        value = getattr(motor, name)
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"suit motor: {name} is {value:g}", expected="a number above 0")
    if not 0.0 < motor.efficiency <= 1.0:
        raise ParameterError(f"suit motor: efficiency is {motor.efficiency:g}", expected="above 0 and at most 1")
    for name in ("friction", "integral", "friction_feedforward"):
        value = getattr(motor, name)
        if not 0.0 <= value < math.inf:
            raise ParameterError(f"suit motor: {name} is {value:g}", expected="a number not below 0")
    for name in ("natural_frequency", "damping"):
        value = getattr(motor.servo, name)
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"suit motor: servo {name} is {value:g}", expected="a number above 0")


@kernel
def turn_push(push: FrictionPush, target: float, dt: float) -> FrictionPush:
    """The push `dt` [s] later, for a `target` of the spool [rad]; portable."""
    settled = push.settled_target
    if not math.isnan(target):
        settled = max(target - DEAD, min(target + DEAD, settled))
    goal, lag = 0.0, FADING
    if settled > push.settled_target:
        goal, lag = 1.0, TURNING
    elif settled < push.settled_target:
        goal, lag = -1.0, TURNING
    return FrictionPush(settled, push.direction + (goal - push.direction) * dt / (lag + dt))


@kernel
def drive_motor(motor: GearedMotor, state: SpoolState, target: float, dt: float) -> SpoolState:
    """The drive's current for a `target` of the spool [rad], and its integral a step of `dt` [s] later."""
    omega, error, velocity = motor.servo.natural_frequency, target - state.position, state.velocity
    push = turn_push(FrictionPush(state.settled_target, state.push), target, dt)
    wanted = motor.inertia * omega * (omega * (error + state.offset) - 2.0 * motor.servo.damping * velocity)
    wanted = wanted + motor.friction_feedforward * push.direction + state.torque_offset
    constant = motor.gear * motor.torque_constant
    lowest = max(-motor.current_limit, (-motor.supply - constant * velocity) / motor.resistance)
    highest = min(motor.current_limit, (motor.supply - constant * velocity) / motor.resistance)
    current = max(lowest, min(highest, wanted / constant))
    offset = state.offset
    if abs(error) > BAND and lowest < wanted / constant < highest:
        offset = offset + dt * motor.integral * error
    return SpoolState(
        state.position, velocity, current, offset, push.settled_target, push.direction, state.torque_offset
    )


@kernel
def turn_spool(
    motor: GearedMotor,
    state: SpoolState,
    load: float,
    stiffness: float,
    dt: float,
    flexing_drag: float = 0.0,
    extending_drag: float = 0.0,
) -> SpoolState:
    """The spool one sub-step later, under the current that it has.

    Args:
        motor: its constants.
        state: before.
        load: torque of the cables against a turning that flexes [N·m].
        stiffness: how fast the load grows with the spool's angle, for a step that no stiff cable upsets [N·m/rad].
        dt: [s].
        flexing_drag: further friction, of the feeder, while the spool turns so as to flex [N·m].
        extending_drag: the same while it extends [N·m].
    """
    torque = motor.gear * motor.torque_constant * state.current
    effort = dt / (motor.inertia + dt * dt * stiffness)
    free = state.velocity + effort * (torque - load - dt * stiffness * state.velocity)
    carried = max(abs(torque), abs(load))
    drag = flexing_drag if free > 0.0 else extending_drag
    held = effort * (motor.friction + drag + (1.0 - motor.efficiency) * carried)
    slowed = abs(free) - held
    velocity = 0.0 if slowed <= 0.0 else math.copysign(slowed, free)
    turned = state.position + dt * velocity
    return SpoolState(
        turned, velocity, state.current, state.offset, state.settled_target, state.push, state.torque_offset
    )
