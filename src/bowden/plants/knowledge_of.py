"""Knowledge of a plant, for `bowden.control.knowledge`."""

import math

from bowden.control.knowledge import Knowledge, with_cable
from bowden.core.errors import ParameterError
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.bench import Bench
from bowden.plants.estimated import measured_plant
from bowden.plants.plant import Plant
from bowden.plants.suit_parts import Suit
from bowden.plants.user_plant import UserPlant


def knowledge_of(plant: Plant, *, identified: bool = False) -> Knowledge:
    """Knowledge of a plant that a law may have.

    - Of any plant: servo, clock and encoders. What its cable is made of is not what anyone has measured; whoever has
      identified it adds that by `bowden.control.knowledge.with_cable`.
    - Of a bench: also where the motor is zeroed, and the cable as it stands there.
    - Of a user's own plant: also the slope, where its parameters have one, and where its motor is zeroed.
    - Of a suit: also the drive's integral and the cables' Bouc–Wen form; its motor is counted in the joint's
      coordinate, from the straight arm.

    Args:
        plant: the model of it.
        identified: whether a bench's cable is from a log, and not written by hand.
    """
    plant = measured_plant(plant)
    joint, motor = plant.joint_encoder, getattr(plant, "motor_encoder", None)
    known = Knowledge(
        servo_frequency=plant.servo.natural_frequency,
        servo_damping=plant.servo.damping,
        delay=(plant.delay + 0.5) * plant.sample_time,
        sample_time=plant.sample_time,
        joint_step=joint.resolution,
        joint_noise=getattr(joint, "noise", math.nan),
        motor_step=getattr(motor, "resolution", math.nan),
        motor_noise=getattr(motor, "noise", math.nan),
    )
    if isinstance(plant, Bench) and isinstance(plant.cable, BoucWen):
        return with_cable(known, plant.cable, plant.sheath.gap, identified=identified)
    if isinstance(plant, UserPlant):
        return known._replace(slope=plant.slope if plant.slope > 0.0 else math.nan, motor_zero=_zero(plant))
    if isinstance(plant, Suit):
        return known._replace(
            cable=plant.flexor.bouc_wen, motor_zero=0.0, suit=True, servo_integral=plant.motor.integral
        )
    return known


def with_loop(known: Knowledge, plant: Plant) -> Knowledge:
    """The same with servo and clock of a plant: what is known of the cable stays known where only these change."""
    own = knowledge_of(plant)
    return known._replace(
        servo_frequency=own.servo_frequency,
        servo_damping=own.servo_damping,
        servo_integral=own.servo_integral,
        delay=own.delay,
        sample_time=own.sample_time,
    )


def _zero(plant: UserPlant) -> float:
    """The motor angle at which its joint rests at zero; NaN where it does so at none [rad]."""
    try:
        return plant.resting_motor(0.0)
    except ParameterError:
        return math.nan
