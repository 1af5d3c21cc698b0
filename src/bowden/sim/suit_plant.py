"""The suit on an arm as one plant: motor, gears, two spools, two cables, fabric, elbow, wearer.

    J·d²θ/dt² = N·kτ·I − r_f·T_f + r_e·T_e − friction                     spool, angle θ
    I_e·d²φ/dt² = T_f·E'(φ) − T_e·R − damping + gravity + passive + wearer     elbow, angle φ

The flexor has pulled in r_f·θ and the arm gives E(φ) of it back; the extensor's are −r_e·θ and −R·φ. Each cable pulls
as `bowden.models.suit_cable` says, in a sheath whose bend is that of the scenario and `posture`·φ more. A sub-step is
semi-implicit: cables from the angles, then speeds with the stiffness and damping of the sub-step's end, then angles.

The kernels run in a compiled loop (`bowden.sim.suit`), and one cycle a call in a live twin.
"""

import math
from typing import NamedTuple

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.units import RADIANS
from bowden.models.arm import Arm, Wearer, check_wearer, gravity_torque, passive_torque, wearer_torque
from bowden.models.encoder import Encoder
from bowden.models.flex_sensor import PAPER_FLEX, FlexSensor
from bowden.models.geared_motor import GearedMotor, SpoolState, check_geared_motor, motor_current, turn_spool
from bowden.models.geometry import SuitGeometry, size_spools
from bowden.models.sheath import Sheath, slope_factor, width
from bowden.models.suit_angle import SpoolMap, flexor_arm, flexor_travel, motor_of, spool_map, spool_of
from bowden.models.suit_cable import (
    Fabric,
    PreparedSuitCable,
    Pull,
    SuitCable,
    SuitCableMemory,
    prepare_suit_cable,
    pull_suit_cable,
    start_suit_cable,
)
from bowden.models.thermal import Thermal, ThermalState, warm


class Suit(NamedTuple):
    """All that a suit on an arm is made of."""

    geometry: SuitGeometry = SuitGeometry()
    spool_radius: float = 0.025
    """r_f, of the flexor's spool; the extensor's is this over the best ratio of Eqs 1–3 [m]."""
    motor: GearedMotor = GearedMotor()
    thermal: Thermal = Thermal()
    flexor: SuitCable = SuitCable()
    extensor: SuitCable = SuitCable()
    pretension: float = 10.0
    """Of both cables at the straight arm [N]."""
    fabric: Fabric = Fabric()
    sheath: Sheath = Sheath()
    posture: float = 0.3
    """How much more the sheaths are bent per angle of the elbow [rad/rad]."""
    arm: Arm = Arm()
    wearer: Wearer = Wearer()
    stops: tuple[float, float] = (-5.0 * RADIANS, 145.0 * RADIANS)
    """Where the elbow's bones and ligaments stop it [rad]."""
    joint_sensor: FlexSensor = PAPER_FLEX
    motor_encoder: Encoder = Encoder()
    """On the spool."""
    sample_time: float = 1e-3
    """Ts, one control cycle [s]."""
    delay: int = 1
    """Cycles between a sample and the moment its command reaches the drive [–]."""
    substeps: int = 10
    """Plant sub-steps in one cycle [–]."""


class PreparedSuit(NamedTuple):
    """A suit as the kernels need it."""

    map: SpoolMap
    extensor_radius: float
    """r_e [m]."""
    joint_radius: float
    """R [m]."""
    motor: GearedMotor
    thermal: Thermal
    flexor: PreparedSuitCable
    extensor: PreparedSuitCable
    sheath: Sheath
    posture: float
    arm: Arm
    low_stop: float
    high_stop: float
    substeps: int


class SuitState(NamedTuple):
    """Where everything is, and what pulls."""

    time: float
    """[s]"""
    spool: SpoolState
    joint: float
    """φ, the elbow [rad]."""
    joint_velocity: float
    """[rad/s]"""
    flexor: SuitCableMemory
    extensor: SuitCableMemory
    flexor_pull: Pull
    extensor_pull: Pull
    interaction: float
    """Torque of the suit on the elbow, flexing positive [N·m]."""
    wearer: float
    """Torque of the wearer's muscles, flexing positive [N·m]."""
    motor_heat: ThermalState


class Bends(NamedTuple):
    """Total bend of the sheaths over one cycle, but for what the elbow's posture adds [rad]."""

    before: float
    after: float


STOP_STIFFNESS, STOP_DAMPING = 300.0, 5.0
"""Of the elbow's end stops [N·m/rad], [N·m·s/rad]; stated choices."""
TAUT = 1.0
"""Tension at which half of the flesh's damping acts [N]."""


def prepare_suit(suit: Suit) -> PreparedSuit:
    """The suit ready for its kernels.

    Raises:
        ParameterError: a part that cannot be.
    """
    check_geared_motor(suit.motor)
    check_wearer(suit.wearer)
    for name, value in (("spool_radius", suit.spool_radius), ("sample_time", suit.sample_time)):
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"suit: {name} is {value:g}", expected="a number above 0")
    if not (abs(suit.posture) <= 10.0 and suit.substeps >= 1 and suit.stops[0] < suit.stops[1]):
        raise ParameterError(
            f"suit: posture {suit.posture:g}, substeps {suit.substeps}, stops {suit.stops}",
            expected="at most 10 rad/rad, 1 or more, the low one first",
        )
    if not (suit.arm.inertia > 0.0 and math.isfinite(suit.arm.inertia)):
        raise ParameterError(f"suit: the arm's inertia is {suit.arm.inertia:g}", expected="an arm of models.arm.arm_of")
    for cable in (suit.flexor, suit.extensor):
        if cable.kind == "capstan" and suit.sheath.loss != 0.0:
            raise ParameterError(
                f"suit: the sheath's loss is {suit.sheath.loss:g} with a capstan cable",
                expected="0, since that cable computes what its sheath loses",
            )
    cables = [
        prepare_suit_cable(cable, suit.fabric, suit.sheath.bend, suit.pretension)
        for cable in (suit.flexor, suit.extensor)
    ]
    return PreparedSuit(
        map=spool_map(suit.geometry, suit.spool_radius),
        extensor_radius=suit.spool_radius / size_spools(suit.geometry).ratio,
        joint_radius=suit.geometry.joint_radius,
        motor=suit.motor,
        thermal=suit.thermal,
        flexor=cables[0],
        extensor=cables[1],
        sheath=suit.sheath,
        posture=suit.posture,
        arm=suit.arm,
        low_stop=suit.stops[0],
        high_stop=suit.stops[1],
        substeps=suit.substeps,
    )


@kernel
def suit_start(suit: PreparedSuit, motor: float, joint: float, bend: float) -> SuitState:
    """At rest, with one tension all along each cable; not in balance yet, so let it settle.

    Args:
        suit: prepared.
        motor: angle of the motor in the joint's coordinate [rad].
        joint: the elbow [rad].
        bend: of the sheaths, but for the posture [rad].
    """
    spool = spool_of(motor, suit.map)
    factor = slope_factor(bend + suit.posture * joint, suit.sheath)
    flexor = start_suit_cable(suit.flexor, suit.map.radius * spool, flexor_travel(joint, suit.map), factor)
    extensor = start_suit_cable(suit.extensor, -suit.extensor_radius * spool, -suit.joint_radius * joint, factor)
    heat = ThermalState(suit.thermal.ambient, suit.thermal.ambient, 0.0)
    slack = Pull(0.0, 0.0)
    return SuitState(0.0, SpoolState(spool, 0.0, 0.0), joint, 0.0, flexor, extensor, slack, slack, 0.0, 0.0, heat)


@kernel
def suit_step(
    suit: PreparedSuit, state: SuitState, command: float, powered: bool, bends: Bends, wearer: Wearer, dt: float
) -> SuitState:
    """The suit one cycle later.

    Args:
        suit: prepared.
        state: before.
        command: where the motor is to go, in the joint's coordinate [rad]; not looked at without power.
        powered: whether the drive gives current.
        bends: of the sheaths over the cycle.
        wearer: what their muscles do.
        dt: length of the cycle [s].
    """
    target, step = spool_of(command, suit.map), dt / suit.substeps
    for i in range(suit.substeps):
        bend = bends.before + (bends.after - bends.before) * (i + 1.0) / suit.substeps
        current = motor_current(suit.motor, target, state.spool.position, state.spool.velocity) if powered else 0.0
        state = _substep(suit, state, current, bend, wearer, step)
    heat = warm(suit.thermal, state.motor_heat, state.spool.current, dt)
    return SuitState(
        state.time,
        state.spool,
        state.joint,
        state.joint_velocity,
        state.flexor,
        state.extensor,
        state.flexor_pull,
        state.extensor_pull,
        state.interaction,
        state.wearer,
        heat,
    )


@kernel
def suit_motor(suit: PreparedSuit, state: SuitState) -> float:
    """The motor's angle in the joint's coordinate, which a law sees as `Sample.motor` [rad]."""
    return motor_of(state.spool.position, suit.map)


@kernel
def _substep(suit: PreparedSuit, state: SuitState, current: float, bend: float, wearer: Wearer, dt: float) -> SuitState:
    """Spool and elbow under the cables' pull where they are, then where they go."""
    joint, velocity, arm = state.joint, state.joint_velocity, suit.arm
    whole = bend + suit.posture * joint
    wide, factor = width(whole, suit.sheath), slope_factor(whole, suit.sheath)
    r_f, r_e = suit.map.radius, suit.extensor_radius
    spool = turn_spool(
        suit.motor,
        state.spool,
        current,
        r_f * state.flexor_pull.motor - r_e * state.extensor_pull.motor,
        r_f * r_f * suit.flexor.stiffness + r_e * r_e * suit.extensor.stiffness,
        dt,
    )
    before, after = state.spool.position, spool.position
    lever_f, lever_e = flexor_arm(joint, suit.map), suit.joint_radius

    damp_f = _flesh(suit.flexor, state.flexor_pull.joint) * lever_f * lever_f
    damp_e = _flesh(suit.extensor, state.extensor_pull.joint) * lever_e * lever_e
    suit_damping = damp_f + damp_e
    interaction = state.flexor_pull.joint * lever_f - state.extensor_pull.joint * lever_e - suit_damping * velocity
    own = wearer_torque(wearer, arm, joint, velocity, state.time)
    over, under = np.fmax(0.0, joint - suit.high_stop), np.fmax(0.0, suit.low_stop - joint)
    stopped = 1.0 if over + under > 0.0 else 0.0
    stops = STOP_STIFFNESS * (under - over) - stopped * STOP_DAMPING * velocity
    torque = interaction + gravity_torque(arm, joint) + passive_torque(arm, joint, velocity) + own + stops
    damping = suit_damping + arm.damping + wearer.damping + stopped * STOP_DAMPING
    stiffness = _stretching(suit.flexor, state.flexor_pull.joint) * lever_f * lever_f + stopped * STOP_STIFFNESS
    stiffness += _stretching(suit.extensor, state.extensor_pull.joint) * lever_e * lever_e
    stiffness += arm.stiffness + wearer.stiffness
    change = dt * (torque - dt * stiffness * velocity) / (arm.inertia + dt * (damping + dt * stiffness))
    velocity = velocity + change
    joint = joint + dt * velocity

    flexor, flexor_pull = pull_suit_cable(
        suit.flexor, state.flexor, r_f * before, r_f * after, flexor_travel(joint, suit.map), wide, factor
    )
    extensor, extensor_pull = pull_suit_cable(
        suit.extensor, state.extensor, -r_e * before, -r_e * after, -suit.joint_radius * joint, wide, factor
    )
    return SuitState(
        state.time + dt,
        spool,
        joint,
        velocity,
        flexor,
        extensor,
        flexor_pull,
        extensor_pull,
        interaction,
        own,
        state.motor_heat,
    )


@kernel
def _flesh(cable: PreparedSuitCable, tension: float) -> float:
    """Damping of the flesh under a cable, none where the cable is slack [N·s/m]."""
    return cable.fabric.damping * tension / (tension + TAUT)


@kernel
def _stretching(cable: PreparedSuitCable, tension: float) -> float:
    """dT/dδ of the fabric at a tension; that of the taut fabric where it is slack, which is the safe side [N/m]."""
    k, q = cable.fabric.stiffness, cable.fabric.stiffening
    return np.sqrt(k * k + 4.0 * q * tension)
