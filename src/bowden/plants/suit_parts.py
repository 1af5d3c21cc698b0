"""Parts of a suit on an arm, and their constants for the kernels of `bowden.plants.suit_plant`."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.geared_motor import GearedMotor, check_geared_motor, no_load_speed
from bowden.models.drive.holding_brake import HoldingBrake
from bowden.models.drive.servo import Servo
from bowden.models.drive.thermal import Thermal
from bowden.models.suit.arm import Arm, Wearer, check_wearer
from bowden.models.suit.flex_sensor import PAPER_FLEX, FlexSensor
from bowden.models.suit.geometry import SuitGeometry, size_spools
from bowden.models.suit.load_cell import LoadCell
from bowden.models.suit.suit_angle import spool_map
from bowden.models.suit.suit_cable import Fabric, SuitCable, prepare_suit_cable
from bowden.plants.plant import Dynamics, SheathPath, check_numbers, plain, sheath_path
from bowden.plants.suit_plant import (
    BRAKED_COLUMNS,
    SETTLING,
    WORN_COLUMNS,
    PreparedSuit,
    WornSuit,
    braked_look,
    worn_advance,
    worn_effort,
    worn_look,
    worn_observe,
    worn_rest,
)

Array = NDArray[np.float64]


class Suit(NamedTuple):
    """All that a suit on an arm is made of."""

    geometry: SuitGeometry = SuitGeometry()
    spool_radius: float = 0.025
    """r_f, of the flexor's spool; the extensor's is this over the best ratio of Eqs 1–3 [m]."""
    motor: GearedMotor = GearedMotor()
    thermal: Thermal = Thermal()
    flexor: SuitCable = SuitCable()
    extensor: SuitCable = SuitCable()
    pretension: float = 25.0
    """Of both cables at the straight arm; what keeps both taut over 0–90° on spools of the best ratio [N]."""
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
    load_cell: LoadCell = LoadCell()
    """That a source of references gets."""
    brake: HoldingBrake = HoldingBrake()
    """Of the drive; none where it has no torque."""
    powered: bool = True
    """False: the drive is switched off when a run begins, and the wearer drives the suit back."""

    @property
    def servo(self) -> Servo:
        """See `Plant.servo`."""
        return self.motor.servo

    @property
    def joint_encoder(self) -> FlexSensor:
        """See `Plant.joint_encoder`."""
        return self.joint_sensor

    def dynamics(self) -> Dynamics:
        """See `Plant.dynamics`.

        Raises:
            ParameterError: a part that cannot be.
        """
        made = prepare_suit(self)
        speed = no_load_speed(self.motor) * self.spool_radius / self.geometry.half_width  # where the lever is least
        return Dynamics(
            "braked_suit" if self.brake.enabled else "suit",
            WornSuit(
                suit=made,
                wearer=self.wearer,
                joint_sensor=self.joint_sensor,
                motor_encoder=self.motor_encoder,
                load_cell=self.load_cell,
                powered=self.powered,
                dt=float(self.sample_time),
                settling=round(SETTLING / self.sample_time),
                brake=self.brake,
                held=gripped(made, self.brake),
                speed=speed,
            ),
            worn_rest,
            worn_advance,
            worn_observe,
            worn_effort,
            BRAKED_COLUMNS if self.brake.enabled else WORN_COLUMNS,
            braked_look if self.brake.enabled else worn_look,
            normals=5,
            begins_at_reference=True,
        )

    def draw(self, seed: int, out: Array) -> None:
        """See `Plant.draw`: current and load cell have numbers of their own, which leaves the angles' as they are."""
        out[:, :3] = np.random.default_rng(seed).standard_normal((len(out), 3))
        out[:, 3:] = np.random.default_rng((seed, 1)).standard_normal((len(out), 2))

    def sheath_columns(self, joint: Array, path: SheathPath) -> dict[str, Array]:
        """See `Plant.sheath_columns`: with the elbow's posture."""
        worn = sheath_path(self.sheath, path.bends[:-1] + self.posture * joint)
        return {"bend": worn.bends, "width": worn.widths, "slope": worn.slope_factors}

    def resting_motor(self, joint: float, bend: float | None = None) -> float:
        """See `Plant.resting_motor`: the motor is counted in the joint's coordinate."""
        return joint

    def describe(self) -> dict[str, Any]:
        """See `Plant.describe`."""
        return plain(self) | {"extensor_spool_radius": prepare_suit(self).extensor_radius}


def gripped(suit: PreparedSuit, brake: HoldingBrake) -> PreparedSuit:
    """The suit while its brake grips."""
    held = suit.motor.friction + suit.motor.gear * brake.holding_torque
    return suit._replace(motor=suit.motor._replace(friction=held))


def spool_friction(suit: Suit) -> float:
    """F, with the feeder's drag as the mean of both ways: what holds the spool back but for gears and sheaths [N·m]."""
    flexor, extensor = suit.spool_radius, suit.spool_radius / size_spools(suit.geometry).ratio
    return suit.motor.friction + 0.5 * (flexor * suit.flexor.feeder_drag + extensor * suit.extensor.feeder_drag)


def prepare_suit(suit: Suit) -> PreparedSuit:
    """The suit ready for its kernels.

    Raises:
        ParameterError: a part that cannot be.
    """
    for name, part in suit._asdict().items():
        check_numbers(part, f"suit.{name}")
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
