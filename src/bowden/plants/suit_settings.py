"""A suit and its wearer as a rig describes them."""

from typing import Annotated, Literal, NamedTuple

from bowden.core.guesses import answering_fields
from bowden.core.quantity import Quantity
from bowden.models.suit.flex_sensor import PAPER_FLEX
from bowden.models.suit.suit_cable import SuitCable
from bowden.plants.presets.paper import document

_CHOSEN, _FIT = document()["suit"]["chosen"], document()["suit"]["calibration"]["first"]


@answering_fields
class SuitSettings(NamedTuple):
    """The suit on an arm in place of the bench; the spring of the motor and the joint's encoder then do not count."""

    worn: Annotated[bool, Quantity("true: the suit on an arm; false: the bench")] = False
    spool_radius: Annotated[
        float, Quantity("of the flexor's spool; the extensor's by Eqs 1-3", "m", shown="mm", gt=0.0, le=500.0)
    ] = _CHOSEN["spool_radius"]
    second_gear: Annotated[float, Quantity("planetary stage behind motor.gear", gt=0.0, le=1e3)] = 5.0
    rotor_inertia: Annotated[float, Quantity("rotor and gears, at the spool", "kg·m²", gt=0.0, le=100.0)] = _CHOSEN[
        "inertia"
    ]
    efficiency: Annotated[float, Quantity("of both gears", symbol="η", gt=0.0, le=1.0)] = _CHOSEN["efficiency"]
    friction: Annotated[
        float, Quantity("of bearings and feeder alike both ways, at the spool", "N·m", symbol="F", ge=0.0, le=100.0)
    ] = _FIT["friction"]
    supply: Annotated[float, Quantity("supply of the drive", "V", gt=0.0, le=1e3)] = _CHOSEN["supply"]
    drive_integral: Annotated[
        float, Quantity("integral of the drive's position loop; the paper's has none", "1/s", ge=0.0, le=1e3)
    ] = _FIT["drive_integral"]
    friction_feedforward: Annotated[
        float,
        Quantity(
            "torque against friction, in the direction in which the target moves; bowden run sends it to the drive",
            "N·m",
            ge=0.0,
            le=100.0,
        ),
    ] = 0.0
    cable: Annotated[
        Literal["play", "capstan", "bouc_wen"],
        Quantity("friction of both cables; bouc_wen takes the parameters of [cable]"),
    ] = "play"
    cable_stiffness: Annotated[float, Quantity("of cable and sheath", "N/m", symbol="k", gt=0.0, le=1e7)] = _FIT[
        "cable_stiffness"
    ]
    play: Annotated[
        float, Quantity("half the play of a cable, kind play", "m", shown="mm", symbol="r", ge=0.0, le=100.0)
    ] = _FIT["half_width"]
    capstan_friction: Annotated[float, Quantity("kind capstan", symbol="μ", ge=0.0, le=2.0)] = SuitCable().friction
    feeder_drag: Annotated[
        float, Quantity("of the feeder on a cable that is pulled in; none on one that is paid out", "N", ge=0.0, le=1e3)
    ] = 0.0
    pretension: Annotated[float, Quantity("of both cables at the straight arm", "N", ge=0.0, le=1e4)] = _CHOSEN[
        "pretension"
    ]
    fabric_stiffness: Annotated[float, Quantity("sleeve, brace and flesh", "N/m", symbol="K", gt=0.0, le=1e7)] = (
        _CHOSEN["fabric_stiffness"]
    )
    fabric_stiffening: Annotated[float, Quantity("how it stiffens", "N/m²", symbol="q", ge=0.0, le=1e10)] = 0.0
    fabric_damping: Annotated[float, Quantity("of the flesh", "N·s/m", ge=0.0, le=1e5)] = _CHOSEN["fabric_damping"]
    posture: Annotated[float, Quantity("bend of the sheaths per angle of the elbow", "rad/rad", ge=-10.0, le=10.0)] = (
        _CHOSEN["posture"]
    )
    sensor_gain: Annotated[float, Quantity("error of the flex sensor's scale", ge=-0.5, le=0.5)] = PAPER_FLEX.gain
    sensor_offset: Annotated[float, Quantity("error of its zero", "rad", ge=-90.0, le=90.0)] = PAPER_FLEX.offset
    sensor_hysteresis: Annotated[float, Quantity("whole width of its loop", "rad", ge=0.0, le=90.0)] = (
        PAPER_FLEX.hysteresis
    )
    sensor_drift: Annotated[float, Quantity("standard deviation of its drift", "rad", ge=0.0, le=90.0)] = (
        PAPER_FLEX.drift
    )
    sensor_noise: Annotated[float, Quantity("standard deviation of one reading", "rad", ge=0.0, le=90.0)] = (
        PAPER_FLEX.noise
    )
    sensor_step: Annotated[float, Quantity("one step of its converter", "rad", ge=0.0, le=90.0)] = PAPER_FLEX.resolution


@answering_fields
class WearerSettings(NamedTuple):
    """Who wears the suit, and what their muscles do."""

    mass: Annotated[float, Quantity("of the body", "kg", gt=0.0, le=1e3)] = 75.0
    height: Annotated[float, Quantity("of the body", "m", gt=0.0, le=10.0)] = 1.75
    upper_arm: Annotated[float, Quantity("the upper arm, raised forwards from hanging", "rad", ge=-180.0, le=180.0)] = (
        0.0
    )
    load: Annotated[float, Quantity("held in the hand", "kg", ge=0.0, le=1e3)] = 0.0
    share: Annotated[
        float, Quantity("share of the arm's weight that the wearer carries; 0.3 is weak", ge=0.0, le=2.0)
    ] = 0.0
    tremor: Annotated[float, Quantity("amplitude of a tremor", "N·m", ge=0.0, le=20.0)] = 0.0
    tremor_frequency: Annotated[float, Quantity("its frequency", "Hz", key="tremor_hz", ge=0.1, le=20.0)] = 5.0
    resisting_stiffness: Annotated[
        float,
        Quantity("stiffness of a wearer who resists", "N·m/rad", key="resisting_nm_per_rad", ge=0.0, le=500.0),
    ] = 0.0
    resisting_damping: Annotated[
        float,
        Quantity("damping of a wearer who resists", "N·m·s/rad", key="resisting_nms_per_rad", ge=0.0, le=50.0),
    ] = 0.0
    resisting_at: Annotated[
        float, Quantity("where the resisting wearer wants the elbow", "rad", ge=-180.0, le=180.0)
    ] = 0.0
    constant: Annotated[float, Quantity("a constant torque, flexing positive", "N·m", ge=-50.0, le=50.0)] = 0.0
    swing: Annotated[
        float, Quantity("amplitude of a motion that they make about resisting_at_deg", "rad", ge=0.0, le=180.0)
    ] = 0.0
    swing_frequency: Annotated[float, Quantity("its frequency", "Hz", key="swing_hz", ge=0.01, le=10.0)] = 0.5
