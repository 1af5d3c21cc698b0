"""From [suit] and [wearer] of a rig.toml to a suit on an arm."""

from bowden.core.units import RADIANS
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.geared_motor import GearedMotor
from bowden.models.suit.arm import Wearer, arm_of
from bowden.models.suit.flex_sensor import FlexSensor
from bowden.models.suit.suit_cable import Fabric, SuitCable
from bowden.plants.bench import Bench
from bowden.plants.suit_parts import Suit, prepare_suit
from bowden.rig import schema as schema
from bowden.rig.suit_schema import SuitSection, WearerSection


def suit_of(rig: schema.Rig, bench: Bench) -> Suit | None:
    """The suit of a rig; None where none is worn.

    Args:
        rig: the file's contents.
        bench: made of its other sections.

    Raises:
        ParameterError: a wearer or a part that cannot be.
    """
    given = rig.suit
    if not given.worn:
        return None
    cable = SuitCable(
        kind=given.cable,
        stiffness=given.cable_stiffness_n_per_m,
        half_width=1e-3 * given.play_mm,
        friction=given.capstan_friction,
        bouc_wen=bench.cable,
    )
    physical = given.cable == "capstan"  # it computes what its sheath loses
    suit = Suit(
        spool_radius=1e-3 * given.spool_radius_mm,
        motor=_motor(given, bench),
        flexor=cable,
        extensor=cable,
        pretension=given.pretension_n,
        fabric=Fabric(given.fabric_stiffness_n_per_m, given.fabric_stiffening_n_per_m2, given.fabric_damping_ns_per_m),
        sheath=Sheath(bench.sheath.bend, rig.sheath.gap, 0.0 if physical else bench.sheath.loss),
        posture=given.posture,
        arm=arm_of(
            rig.wearer.mass_kg,
            rig.wearer.height_m,
            elevation=rig.wearer.upper_arm_deg * RADIANS,
            load=rig.wearer.load_kg,
        ),
        wearer=_wearer(rig.wearer),
        joint_sensor=_sensor(given),
        motor_encoder=bench.motor_encoder,
        sample_time=bench.sample_time,
        delay=bench.delay,
        substeps=bench.substeps,
    )
    prepare_suit(suit)
    return suit


def _motor(given: SuitSection, bench: Bench) -> GearedMotor:
    return GearedMotor(
        torque_constant=bench.motor.torque_constant,
        resistance=bench.motor.resistance,
        gear=bench.motor.gear * given.second_gear,
        inertia=given.rotor_inertia_kg_m2,
        efficiency=given.efficiency,
        friction=given.friction_nm,
        current_limit=bench.motor.current_limit,
        supply=given.supply_v,
        integral=given.drive_integral_per_s,
        friction_feedforward=given.friction_feedforward_nm,
        servo=bench.servo,
    )


def _sensor(given: SuitSection) -> FlexSensor:
    return FlexSensor(
        gain=given.sensor_gain,
        offset=given.sensor_offset_deg * RADIANS,
        hysteresis=given.sensor_hysteresis_deg * RADIANS,
        drift=given.sensor_drift_deg * RADIANS,
        noise=given.sensor_noise_deg * RADIANS,
        resolution=given.sensor_step_deg * RADIANS,
    )


def _wearer(given: WearerSection) -> Wearer:
    return Wearer(
        share=given.share,
        tremor=given.tremor_nm,
        tremor_frequency=given.tremor_hz,
        stiffness=given.resisting_nm_per_rad,
        damping=given.resisting_nms_per_rad,
        centre=given.resisting_at_deg * RADIANS,
        constant=given.constant_nm,
        swing=given.swing_deg * RADIANS,
        swing_frequency=given.swing_hz,
    )
