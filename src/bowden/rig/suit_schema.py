"""The keys of rig.toml that make the bench a suit on an arm: [suit] and [wearer]."""

from typing import Literal

from bowden.core.units import DEGREES
from bowden.rig.presets.suit import default_suit
from bowden.rig.section import Section, key

_SUIT = default_suit()
_MM = 1e3


def _plain(value: float) -> float:
    """A default without the rounding of its unit."""
    return float(f"{value:.10g}")


class SuitSection(Section):
    """The suit on an arm in place of the bench; the spring of [motor] and the joint's encoder then do not count."""

    worn: bool = key(False, "true: the suit on an arm; false: the bench")
    spool_radius_mm: float = key(
        _plain(_SUIT.spool_radius * _MM), "of the flexor's spool; the extensor's by Eqs 1-3", "mm", gt=0.0, le=500.0
    )
    second_gear: float = key(5.0, "planetary stage behind motor.gear", gt=0.0, le=1e3)
    rotor_inertia_kg_m2: float = key(_SUIT.motor.inertia, "rotor and gears, at the spool", "kg·m²", gt=0.0, le=100.0)
    efficiency: float = key(_SUIT.motor.efficiency, "of both gears", "–", "η", gt=0.0, le=1.0)
    friction_nm: float = key(_SUIT.motor.friction, "of bearings and feeder, at the spool", "N·m", "F", ge=0.0, le=100.0)
    supply_v: float = key(_SUIT.motor.supply, "supply of the drive", "V", gt=0.0, le=1e3)
    drive_integral_per_s: float = key(
        _SUIT.motor.integral, "integral of the drive's position loop; the paper's has none", "1/s", ge=0.0, le=1e3
    )
    friction_feedforward_nm: float = key(
        _SUIT.motor.friction_feedforward,
        "torque against friction, in the direction in which the target moves; bowden run sends it to the drive",
        "N·m",
        ge=0.0,
        le=100.0,
    )
    cable: Literal["play", "capstan", "bouc_wen"] = key(
        "play", "friction of both cables; bouc_wen takes the parameters of [cable]"
    )
    cable_stiffness_n_per_m: float = key(_SUIT.flexor.stiffness, "of cable and sheath", "N/m", "k", gt=0.0, le=1e7)
    play_mm: float = key(
        _plain(_SUIT.flexor.half_width * _MM), "half the play of a cable, kind play", "mm", "r", ge=0.0, le=100.0
    )
    capstan_friction: float = key(_SUIT.flexor.friction, "kind capstan", "–", "μ", ge=0.0, le=2.0)
    pretension_n: float = key(_SUIT.pretension, "of both cables at the straight arm", "N", ge=0.0, le=1e4)
    fabric_stiffness_n_per_m: float = key(_SUIT.fabric.stiffness, "sleeve, brace and flesh", "N/m", "K", gt=0.0, le=1e7)
    fabric_stiffening_n_per_m2: float = key(_SUIT.fabric.stiffening, "how it stiffens", "N/m²", "q", ge=0.0, le=1e10)
    fabric_damping_ns_per_m: float = key(_SUIT.fabric.damping, "of the flesh", "N·s/m", ge=0.0, le=1e5)
    posture: float = key(_SUIT.posture, "bend of the sheaths per angle of the elbow", "rad/rad", ge=-10.0, le=10.0)
    sensor_gain: float = key(_SUIT.joint_sensor.gain, "error of the flex sensor's scale", ge=-0.5, le=0.5)
    sensor_offset_deg: float = key(_SUIT.joint_sensor.offset, "error of its zero", "°", ge=-90.0, le=90.0)
    sensor_hysteresis_deg: float = key(
        _plain(_SUIT.joint_sensor.hysteresis * DEGREES), "whole width of its loop", "°", ge=0.0, le=90.0
    )
    sensor_drift_deg: float = key(
        _plain(_SUIT.joint_sensor.drift * DEGREES), "standard deviation of its drift", "°", ge=0.0, le=90.0
    )
    sensor_noise_deg: float = key(
        _plain(_SUIT.joint_sensor.noise * DEGREES), "standard deviation of one reading", "°", ge=0.0, le=90.0
    )
    sensor_step_deg: float = key(
        _plain(_SUIT.joint_sensor.resolution * DEGREES), "one step of its converter", "°", ge=0.0, le=90.0
    )


class WearerSection(Section):
    """Who wears the suit, and what their muscles do."""

    mass_kg: float = key(75.0, "of the body", "kg", gt=0.0, le=1e3)
    height_m: float = key(1.75, "of the body", "m", gt=0.0, le=10.0)
    upper_arm_deg: float = key(0.0, "the upper arm, raised forwards from hanging", "°", ge=-180.0, le=180.0)
    load_kg: float = key(0.0, "held in the hand", "kg", ge=0.0, le=1e3)
    share: float = key(0.0, "share of the arm's weight that the wearer carries; 0.3 is weak", ge=0.0, le=2.0)
    tremor_nm: float = key(0.0, "amplitude of a tremor", "N·m", ge=0.0, le=20.0)
    tremor_hz: float = key(5.0, "its frequency", "Hz", ge=0.1, le=20.0)
    resisting_nm_per_rad: float = key(0.0, "stiffness of a wearer who resists", "N·m/rad", ge=0.0, le=500.0)
    resisting_nms_per_rad: float = key(0.0, "damping of a wearer who resists", "N·m·s/rad", ge=0.0, le=50.0)
    resisting_at_deg: float = key(0.0, "where the resisting wearer wants the elbow", "°", ge=-180.0, le=180.0)
    constant_nm: float = key(0.0, "a constant torque, flexing positive", "N·m", ge=-50.0, le=50.0)
    swing_deg: float = key(0.0, "amplitude of a motion that they make about resisting_at_deg", "°", ge=0.0, le=180.0)
    swing_hz: float = key(0.5, "its frequency", "Hz", ge=0.01, le=10.0)
