"""The suit whose drive has a holding brake: the kernels of `bowden.plants.suit_plant` round the brake's policy.

The brake is Coulomb friction at the motor's shaft while it grips, N·T at the spool, so that a load beyond it turns the
shaft. The drive holds the motor by it, and gives no current meanwhile; its integral begins again at zero.
"""

from typing import NamedTuple

from bowden.control.source import Measurement
from bowden.core.kernel import kernel
from bowden.models.drive.holding_brake import HELD, BrakeState, HoldingBrake, brake_begin, brake_step, grips
from bowden.plants.plant import Array, SheathState
from bowden.plants.suit_plant import (
    WORN_COLUMNS,
    Bends,
    PreparedSuit,
    WornBody,
    WornSuit,
    suit_motor,
    suit_step,
    worn_effort,
    worn_look,
    worn_observe,
    worn_rest,
)


class BrakedSuit(NamedTuple):
    """Argument of the kernels."""

    worn: WornSuit
    held: PreparedSuit
    """The suit while its brake grips."""
    brake: HoldingBrake
    speed: float
    """Of the unloaded motor, in the joint's coordinate at its fastest [rad/s]."""


class BrakedBody(NamedTuple):
    """The suit, its sensor, and the brake."""

    worn: WornBody
    brake: BrakeState


BRAKED_COLUMNS = WORN_COLUMNS | {"brake": "1"}
"""The suit's columns, and the brake's phase."""


@kernel
def braked_rest(plant: BrakedSuit, motor: float, sheath: SheathState) -> BrakedBody:
    """See `bowden.plants.plant`; the brake is free."""
    return BrakedBody(worn_rest(plant.worn, motor, sheath), brake_begin(motor))


@kernel
def braked_advance(
    plant: BrakedSuit, body: BrakedBody, applied: float, sheath: SheathState, next_sheath: SheathState
) -> BrakedBody:
    """See `bowden.plants.plant`."""
    worn, suit = plant.worn, body.worn.suit
    brake = brake_step(plant.brake, body.brake, applied, suit_motor(worn.suit, suit), True, plant.speed, worn.dt)
    on = worn.powered and brake.phase != HELD
    made = plant.held if grips(brake) else worn.suit
    bends = Bends(sheath.bend, next_sheath.bend)
    return BrakedBody(
        WornBody(suit_step(made, suit, brake.sent, on, bends, worn.wearer, worn.dt), body.worn.flex), brake
    )


@kernel
def braked_observe(plant: BrakedSuit, body: BrakedBody, normals: Array) -> tuple[BrakedBody, Measurement]:
    """See `bowden.plants.plant`."""
    worn, measured = worn_observe(plant.worn, body.worn, normals)
    return BrakedBody(worn, body.brake), measured


@kernel
def braked_effort(plant: BrakedSuit, body: BrakedBody, sheath: SheathState) -> float:
    """The motor's current [A]."""
    return worn_effort(plant.worn, body.worn, sheath)


@kernel
def braked_look(plant: BrakedSuit, body: BrakedBody) -> tuple[float, ...]:
    """See `bowden.plants.plant`: `BRAKED_COLUMNS`."""
    w = worn_look(plant.worn, body.worn)
    return (
        *(w.joint, w.motor, w.motor_velocity, w.joint_velocity, w.spool, w.flexor_tension, w.flexor_motor_tension),
        *(w.extensor_tension, w.extensor_motor_tension, w.interaction_torque, w.wearer_torque, w.winding_temperature),
        body.brake.phase,
    )
