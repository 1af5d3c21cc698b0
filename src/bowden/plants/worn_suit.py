"""The suit on an arm that a rig describes."""

from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.geared_motor import GearedMotor
from bowden.models.suit.arm import Wearer, arm_of
from bowden.models.suit.flex_sensor import FlexSensor
from bowden.models.suit.geometry import SuitGeometry, flexor_moment_arm
from bowden.models.suit.suit_cable import Fabric, SuitCable
from bowden.plants.bench import Bench
from bowden.plants.identified import IdentifiedCable
from bowden.plants.suit_parts import Suit, prepare_suit
from bowden.plants.suit_settings import SuitSettings, WearerSettings


def elbow_dead_zone(half_width: float) -> float:
    """Motion that the elbow loses at a reversal with the arm straight, where the cable's lever is shortest [rad].

    Args:
        half_width: half of the spool's travel that its cable loses [m].
    """
    return 2.0 * half_width / flexor_moment_arm(0.0, SuitGeometry())


USUAL_DEAD_ZONE = elbow_dead_zone(SuitSettings().play)
"""Of the suit for which the usual limits are [rad]."""


def suit_of(
    given: SuitSettings, wearer: WearerSettings, bench: Bench, gap: float, identified: IdentifiedCable | None
) -> Suit:
    """The suit of a rig.

    Of an identified cable it has what that loses, as a length at the spool; what its joint does per motion of the motor
    is the suit's own geometry.

    Args:
        given: its settings.
        wearer: who wears it.
        bench: made of the rig's other parts.
        gap: of the sheath over the one at the identification [–].
        identified: the cable, where a log says what it loses.

    Raises:
        ParameterError: a wearer or a part that cannot be.
    """
    cable = SuitCable(
        kind=given.cable,
        stiffness=given.cable_stiffness,
        half_width=given.play if identified is None else identified.lost * given.spool_radius,
        friction=given.capstan_friction,
        feeder_drag=given.feeder_drag,
    )
    assert isinstance(bench.cable, BoucWen)  # as a rig has it
    own = bench.cable if identified is None else _at_the_arm(bench.cable, given.spool_radius / cable.radius)
    cable = cable._replace(bouc_wen=own)
    physical = given.cable == "capstan"  # it computes what its sheath loses
    suit = Suit(
        spool_radius=given.spool_radius,
        motor=_motor(given, bench),
        flexor=cable,
        extensor=cable,
        pretension=given.pretension,
        fabric=Fabric(given.fabric_stiffness, given.fabric_stiffening, given.fabric_damping),
        sheath=Sheath(bench.sheath.bend, gap, 0.0 if physical else bench.sheath.loss),
        posture=given.posture,
        arm=arm_of(wearer.mass, wearer.height, elevation=wearer.upper_arm, load=wearer.load),
        wearer=_wearer(wearer),
        joint_sensor=_sensor(given),
        motor_encoder=bench.motor_encoder,
        sample_time=bench.sample_time,
        delay=bench.delay,
        substeps=bench.substeps,
    )
    prepare_suit(suit)
    return suit


def _at_the_arm(cable: BoucWen, ratio: float) -> BoucWen:
    """Eqs 6–7 over angles of the spool, as over those angles times a ratio; without its slope, which the suit has."""
    gain = ratio * cable.hysteresis_gain / cable.slope
    return cable._replace(slope=1.0, hysteresis_gain=gain, rate=cable.rate / ratio, offset=0.0)


def _motor(given: SuitSettings, bench: Bench) -> GearedMotor:
    return GearedMotor(
        torque_constant=bench.motor.torque_constant,
        resistance=bench.motor.resistance,
        gear=bench.motor.gear * given.second_gear,
        inertia=given.rotor_inertia,
        efficiency=given.efficiency,
        friction=given.friction,
        current_limit=bench.motor.current_limit,
        supply=given.supply,
        integral=given.drive_integral,
        friction_feedforward=given.friction_feedforward,
        servo=bench.servo,
    )


def _sensor(given: SuitSettings) -> FlexSensor:
    return FlexSensor(
        gain=given.sensor_gain,
        offset=given.sensor_offset,
        hysteresis=given.sensor_hysteresis,
        drift=given.sensor_drift,
        noise=given.sensor_noise,
        resolution=given.sensor_step,
    )


def _wearer(given: WearerSettings) -> Wearer:
    return Wearer(
        share=given.share,
        tremor=given.tremor,
        tremor_frequency=given.tremor_frequency,
        stiffness=given.resisting_stiffness,
        damping=given.resisting_damping,
        centre=given.resisting_at,
        constant=given.constant,
        swing=given.swing,
        swing_frequency=given.swing_frequency,
    )
