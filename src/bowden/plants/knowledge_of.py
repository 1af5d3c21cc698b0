"""What there is to be known of a plant, for `bowden.control.knowledge`."""

from bowden.control.knowledge import Knowledge, with_cable
from bowden.models.drive.servo import Servo
from bowden.plants.bench import Bench
from bowden.plants.cable_plant import CablePlant
from bowden.plants.suit_parts import Suit


def knowledge_of(plant: Bench | CablePlant | Suit, *, identified: bool = False) -> Knowledge:
    """What a law may be told of a plant.

    - Of a bench: servo, clock, encoders, where the motor is zeroed, and the cable as it stands there.
    - Of a plant round any other cable: the same without the cable. What it is made of is not what anyone has measured;
      whoever has identified it adds that by `bowden.control.knowledge.with_cable`.
    - Of a suit: servo, clock and encoders, and the cables' Bouc–Wen form; its motor is counted in the joint's
      coordinate, from the straight arm.

    Args:
        plant: as it is believed to be.
        identified: whether a bench's cable is from a log, and not written by hand.
    """
    if isinstance(plant, Suit):
        sensor, encoder = plant.joint_sensor, plant.motor_encoder
        known = _clocked(plant.motor.servo, plant.sample_time, plant.delay)
        return known._replace(
            cable=plant.flexor.bouc_wen,
            motor_zero=0.0,
            joint_step=sensor.resolution,
            joint_noise=sensor.noise,
            motor_step=encoder.resolution,
            motor_noise=encoder.noise,
            suit=True,
        )
    joint, motor = plant.joint_encoder, plant.motor_encoder
    known = _clocked(plant.servo, plant.sample_time, plant.delay)._replace(
        joint_step=joint.resolution,
        joint_noise=joint.noise,
        motor_step=motor.resolution,
        motor_noise=motor.noise,
    )
    if isinstance(plant, CablePlant):
        return known
    return with_cable(known, plant.cable, plant.sheath.gap, identified=identified)


def _clocked(servo: Servo, sample_time: float, delay: int) -> Knowledge:
    return Knowledge(
        servo_frequency=servo.natural_frequency,
        servo_damping=servo.damping,
        delay=(delay + 0.5) * sample_time,
        sample_time=sample_time,
    )
