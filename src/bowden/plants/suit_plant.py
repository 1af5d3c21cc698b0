"""The suit on an arm as one plant: motor, gears, two spools, two cables, fabric, elbow, wearer.

    J·d²θ/dt² = N·kτ·I − r_f·T_f + r_e·T_e − friction                     spool, angle θ
    I_e·d²φ/dt² = T_f·E'(φ) − T_e·R − damping + gravity + passive + wearer     elbow, angle φ

The flexor has pulled in r_f·θ and the arm gives E(φ) of it back; the extensor's are −r_e·θ and −R·φ. Each cable pulls
as `bowden.models.suit.suit_cable` says, in a sheath whose bend is that of the scenario and `posture`·φ more. A sub-step
is semi-implicit: cables from the angles, then speeds with the stiffness and damping of the sub-step's end, then angles.

A holding brake of the drive is Coulomb friction at the motor's shaft while it grips, N·T at the spool, so that a load
beyond it turns the shaft. The drive holds the motor by it, and gives no current meanwhile; its integral begins again at
zero.

The kernels run in a compiled loop (`bowden.sim.run`), and one cycle a call in a live twin.
"""

from typing import Any, NamedTuple

from bowden.control.source import Measurement
from bowden.core.kernel import kernel, noinline, sqrt
from bowden.core.nested import flat
from bowden.models.cable.sheath import Sheath, slope_factor, width
from bowden.models.drive.encoder import Encoder, reading
from bowden.models.drive.geared_motor import GearedMotor, SpoolState, drive_motor, turn_spool
from bowden.models.drive.holding_brake import HELD, BrakeState, HoldingBrake, brake_begin, brake_step, grips
from bowden.models.drive.thermal import Thermal, ThermalState, cold, warm
from bowden.models.suit.arm import Arm, Wearer, gravity_torque, passive_torque, wearer_torque
from bowden.models.suit.flex_sensor import FlexSensor, FlexState, flex_start, flex_step
from bowden.models.suit.load_cell import CURRENT_NOISE, LoadCell, cell_reading
from bowden.models.suit.suit_angle import SpoolMap, flexor_arm, flexor_travel, motor_of, spool_of
from bowden.models.suit.suit_cable import (
    TAUT,
    PreparedSuitCable,
    Pull,
    SuitCableMemory,
    pull_suit_cable,
    start_suit_cable,
)
from bowden.plants.plant import Array, SheathState


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


class Bends(NamedTuple):
    """Total bend of the sheaths over one cycle, but for what the elbow's posture adds [rad]."""

    before: float
    after: float


STOP_STIFFNESS, STOP_DAMPING = 300.0, 5.0
"""Of the elbow's end stops [N·m/rad], [N·m·s/rad]; stated choices."""


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
    slack = Pull(0.0, 0.0)
    still = SpoolState(spool, 0.0, 0.0, 0.0, spool, 0.0, 0.0)
    return SuitState(0.0, still, joint, 0.0, flexor, extensor, slack, slack, 0.0, 0.0)


@noinline
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
        at = state.spool.position
        spool = SpoolState(at, state.spool.velocity, 0.0, 0.0, at, 0.0, state.spool.torque_offset)
        if powered:
            spool = drive_motor(suit.motor, state.spool, target, step)
        state = _substep(suit, state, spool, bend, wearer, step)
    return state


@kernel
def suit_motor(suit: PreparedSuit, state: SuitState) -> float:
    """The motor's angle in the joint's coordinate, which a law sees as `Sample.motor` [rad]."""
    return motor_of(state.spool.position, suit.map)


@kernel
def _substep(
    suit: PreparedSuit, state: SuitState, driven: SpoolState, bend: float, wearer: Wearer, dt: float
) -> SuitState:
    """Spool and elbow under the cables' pull where they are, then where they go; `driven` has the spool's current."""
    joint, velocity, arm = state.joint, state.joint_velocity, suit.arm
    whole = bend + suit.posture * joint
    wide, factor = width(whole, suit.sheath), slope_factor(whole, suit.sheath)
    r_f, r_e = suit.map.radius, suit.extensor_radius
    spool = turn_spool(
        suit.motor,
        driven,
        r_f * state.flexor_pull.motor - r_e * state.extensor_pull.motor,
        r_f * r_f * suit.flexor.stiffness + r_e * r_e * suit.extensor.stiffness,
        dt,
        r_f * suit.flexor.feeder_drag,
        r_e * suit.extensor.feeder_drag,
    )
    before, after = state.spool.position, spool.position
    lever_f, lever_e = flexor_arm(joint, suit.map), suit.joint_radius

    damp_f = _flesh(suit.flexor, state.flexor_pull.joint) * lever_f * lever_f
    damp_e = _flesh(suit.extensor, state.extensor_pull.joint) * lever_e * lever_e
    suit_damping = damp_f + damp_e
    interaction = state.flexor_pull.joint * lever_f - state.extensor_pull.joint * lever_e - suit_damping * velocity
    own = wearer_torque(wearer, arm, joint, velocity, state.time)
    over, under = max(0.0, joint - suit.high_stop), max(0.0, suit.low_stop - joint)
    stops, stop_damping, stop_stiffness = 0.0, 0.0, 0.0
    if over + under > 0.0:
        stop_damping, stop_stiffness = STOP_DAMPING, STOP_STIFFNESS
        stops = STOP_STIFFNESS * (under - over) - STOP_DAMPING * velocity
    torque = interaction + gravity_torque(arm, joint) + passive_torque(arm, joint, velocity) + own + stops
    damping = suit_damping + arm.damping + wearer.damping + stop_damping
    stiffness = _stretching(suit.flexor, state.flexor_pull.joint) * lever_f * lever_f + stop_stiffness
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
    )


@kernel
def _flesh(cable: PreparedSuitCable, tension: float) -> float:
    """Damping of the flesh under a cable, none where the cable is slack [N·s/m]."""
    return cable.fabric.damping * tension / (tension + TAUT)


@kernel
def _stretching(cable: PreparedSuitCable, tension: float) -> float:
    """dT/dδ of the fabric at a tension; that of the taut fabric where it is slack, which is the safe side [N/m]."""
    k, q = cable.fabric.stiffness, cable.fabric.stiffening
    return sqrt(k * k + 4.0 * q * tension)


SETTLING = 3.0
"""Time for which the suit holds its initial motor angle before a run begins, so that the arm hangs in balance [s]."""


class WornSuit(NamedTuple):
    """Argument of the kernels of a suit with its sensors."""

    suit: PreparedSuit
    wearer: Wearer
    joint_sensor: FlexSensor
    motor_encoder: Encoder
    load_cell: LoadCell
    powered: bool
    """True if the drive has power once the run has begun."""
    dt: float
    """[s]"""
    settling: int
    """Cycles at rest before a run."""
    brake: HoldingBrake
    held: PreparedSuit
    """The suit while its brake grips."""
    speed: float
    """Of the unloaded motor, in the joint's coordinate at its fastest [rad/s]."""


class WornBody(NamedTuple):
    """The suit, what its flex sensor remembers, the brake, and how warm the motor is."""

    suit: SuitState
    flex: FlexState
    brake: BrakeState
    heat: ThermalState


class WornColumns(NamedTuple):
    """Columns of a trace of the suit; `WORN_COLUMNS` has the units.

    ``motor`` is the motor in the joint's coordinate, ``spool`` and ``motor_velocity`` the spool; tensions are those at
    the arm, and with ``motor`` in the name those at the spool.
    """

    joint: float
    motor: float
    motor_velocity: float
    joint_velocity: float
    spool: float
    flexor_tension: float
    flexor_motor_tension: float
    extensor_tension: float
    extensor_motor_tension: float
    interaction_torque: float
    wearer_torque: float
    winding_temperature: float


WORN_COLUMNS = {
    "joint": "rad",
    "motor": "rad",
    "motor_velocity": "rad/s",
    "joint_velocity": "rad/s",
    "spool": "rad",
    "flexor_tension": "N",
    "flexor_motor_tension": "N",
    "extensor_tension": "N",
    "extensor_motor_tension": "N",
    "interaction_torque": "N·m",
    "wearer_torque": "N·m",
    "winding_temperature": "°C",
}
BRAKED_COLUMNS = WORN_COLUMNS | {"brake": "1"}
"""The suit's columns, and the brake's phase."""


@kernel
def worn_rest(plant: WornSuit, motor: float, sheath: SheathState) -> WornBody:
    """See `bowden.plants.plant`: held there until the arm hangs in balance, its brake free."""
    state, bends = suit_start(plant.suit, motor, motor, sheath.bend), Bends(sheath.bend, sheath.bend)
    heat = cold(plant.suit.thermal)
    for _ in range(plant.settling):
        state = suit_step(plant.suit, state, motor, True, bends, plant.wearer, plant.dt)
        heat = warm(plant.suit.thermal, heat, state.spool.current, plant.dt)
    return WornBody(state, flex_start(state.joint), brake_begin(motor), heat)


@kernel
def worn_advance(
    plant: WornSuit, body: WornBody, applied: float, sheath: SheathState, next_sheath: SheathState
) -> WornBody:
    """See `bowden.plants.plant`; the posture adds its own to the sheath's bend."""
    suit, brake, powered, made = body.suit, body.brake, plant.powered, plant.suit
    if plant.brake.holding_torque > 0.0:
        brake = brake_step(plant.brake, brake, applied, suit_motor(made, suit), True, plant.speed, plant.dt)
        applied, powered = brake.sent, powered and brake.phase != HELD
        if grips(brake):
            made = plant.held
    bends = Bends(sheath.bend, next_sheath.bend)
    suit = suit_step(made, suit, applied, powered, bends, plant.wearer, plant.dt)
    return WornBody(suit, body.flex, brake, warm(made.thermal, body.heat, suit.spool.current, plant.dt))


@kernel
def worn_observe(plant: WornSuit, body: WornBody, normals: Array) -> tuple[WornBody, Measurement]:
    """See `bowden.plants.plant`: flex sensor, encoder, the drive's current and a load cell."""
    state = body.suit
    flex, joint = flex_step(plant.joint_sensor, body.flex, state.joint, normals[0], normals[1], plant.dt)
    motor = reading(suit_motor(plant.suit, state), normals[2], plant.motor_encoder)
    current = state.spool.current + CURRENT_NOISE * normals[3]
    load = cell_reading(plant.load_cell, state.interaction, normals[4])
    return WornBody(state, flex, body.brake, body.heat), Measurement(joint, motor, current, load)


@kernel
def worn_effort(plant: WornSuit, body: WornBody, sheath: SheathState) -> float:
    """The motor's current [A]."""
    return body.suit.spool.current


@kernel
def worn_look(plant: WornSuit, body: WornBody) -> WornColumns:
    """See `bowden.plants.plant`."""
    state = body.suit
    return WornColumns(
        state.joint,
        suit_motor(plant.suit, state),
        state.spool.velocity,
        state.joint_velocity,
        state.spool.position,
        state.flexor_pull.joint,
        state.flexor_pull.motor,
        state.extensor_pull.joint,
        state.extensor_pull.motor,
        state.interaction,
        state.wearer,
        body.heat.winding,
    )


@kernel
def braked_look(plant: WornSuit, body: WornBody) -> Any:
    """See `bowden.plants.plant`: `BRAKED_COLUMNS`."""
    return flat((worn_look(plant, body), body.brake.phase))
