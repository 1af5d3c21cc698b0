"""The source of a run's reference that the wearer's push makes, and what it needs of a suit, read from that itself."""

import itertools
from dataclasses import dataclass

from bowden.control.admittance.interaction import Chain, Doubt
from bowden.control.admittance.passivity import Limit, limit_of
from bowden.control.admittance.port import Body, Port, bodies
from bowden.control.admittance.push import ROOM, Push, Under, push_source
from bowden.control.admittance.virtual_elbow import FRICTION_SHARE, Admittance, check_admittance
from bowden.control.law import Law
from bowden.control.source import Source
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.models.suit.arm import GRAVITY, Arm, arm_of
from bowden.models.suit.load_cell import LoadCell
from bowden.models.suit.suit_angle import flexor_arm
from bowden.plants.push_settings import AdmittanceSettings
from bowden.plants.suit_parts import Suit, prepare_suit, spool_friction


def chain_of(suit: Suit) -> Chain:
    """Motor and cables as the suit has them."""
    made, motor = prepare_suit(suit), suit.motor
    return Chain(
        map=made.map,
        extensor_radius=made.extensor_radius,
        joint_radius=made.joint_radius,
        torque_constant=motor.gear * motor.torque_constant,
        friction=spool_friction(suit),
        loss=1.0 - motor.efficiency,
        cable=suit.flexor.stiffness,
        fabric=suit.fabric.stiffness,
        flesh=suit.fabric.damping,
        half_width=suit.flexor.half_width if suit.flexor.kind == "play" else 0.0,
        start=made.flexor.start,
        sheath=suit.sheath,
        posture=suit.posture,
    )


def push_of(
    suit: Suit,
    law: Law,
    admittance: Admittance,
    *,
    estimated: bool = False,
    carried: float = 0.0,
    arm: Arm | None = None,
    friction_share: float = FRICTION_SHARE,
    doubt: Doubt | None = None,
    room: float = ROOM,
) -> Push:
    """The source's settings for a suit.

    Args:
        suit: as the source believes it to be.
        law: that it works above.
        admittance: the virtual elbow.
        estimated: whether the torque is estimated; a load cell's otherwise.
        carried: share of the arm's weight that the suit holds up [–].
        arm: whose weight that is; the suit's own where it is not given.
        friction_share: of the friction of drive, gears and sheaths that is made up for; what the drive itself makes
            up for, by its torque offset, is part of it [–].
        doubt: of the estimate; the default one where it is not given.
        room: how far beyond the admittance's range a law that feeds the joint back may be led [rad].

    Raises:
        ParameterError: an admittance or a suit that cannot be.
    """
    motor, arm = suit.motor, arm or suit.arm
    omega, zeta = motor.servo.natural_frequency, motor.servo.damping
    dead_time = (suit.delay + 0.5) * suit.sample_time
    return Push(
        admittance=check_admittance(admittance),
        chain=chain_of(suit),
        doubt=doubt or Doubt(),
        under=Under(
            lead=0.0 if law.compensates_lag else 2.0 * zeta / omega + dead_time,
            lead_square=0.0 if law.compensates_lag else 1.0 / omega**2,
            friction=max(0.0, friction_share * friction_of(suit) - motor.friction_feedforward),
            stiffness=motor.inertia * omega**2,
            compliance=_compliance(suit) if "joint" in law.feeds_back else 0.0,
            room=room,
        ),
        estimated=1.0 if estimated else 0.0,
        carried=carried,
        weight=GRAVITY * arm.mass * arm.centre,
        elevation=arm.elevation,
    )


def behind(suit: Suit, made_up: float = 0.0) -> float:
    """How far the friction of all this leaves the motor behind its target, under a drive without an integral [rad].

    In the joint's coordinate, in the middle of the elbow's range.

    Args:
        suit: the model of it that the estimate uses.
        made_up: for how much of the friction something makes up, at the spool [N·m].
    """
    made, motor = prepare_suit(suit), suit.motor
    left = max(0.0, friction_of(suit) - made_up) / (motor.inertia * motor.servo.natural_frequency**2)
    return left * made.map.radius / float(flexor_arm(ANGLES[len(ANGLES) // 2], made.map))


def friction_of(suit: Suit) -> float:
    """(F + k·r·(r_f + r_e))/η: what drive, feeder, play of the sheaths and gears hold back, at the spool [N·m]."""
    cable = suit.flexor
    held = cable.stiffness * cable.half_width if cable.kind == "play" else 0.0
    radii = suit.spool_radius + prepare_suit(suit).extensor_radius
    return (spool_friction(suit) + held * radii) / suit.motor.efficiency


def _compliance(suit: Suit) -> float:
    """Of both cables and their fabric at the elbow, in the middle of its range [rad/(N·m)]."""
    port = ports_of(suit)[len(ANGLES) // 2 * 2]
    return 1.0 / port.joint_stiffness


BODIES = ((45.0, 1.50), (75.0, 1.75), (120.0, 1.95))
"""Mass [kg] and height [m] of the wearers for whom a virtual elbow must hold."""
ANGLES = (0.0, 45.0 * RADIANS, 90.0 * RADIANS)
"""Of the elbow, likewise [rad]."""


def ports_of(suit: Suit) -> list[Port]:
    """The suit at `ANGLES`, with the extensor taut and slack, as it renders a virtual elbow."""
    made, motor = prepare_suit(suit), suit.motor
    omega, zeta = motor.servo.natural_frequency, motor.servo.damping
    lead, square = 2.0 * zeta / omega + (suit.delay + 0.5) * suit.sample_time, 1.0 / omega**2
    k_f, k_e = (1.0 / (1.0 / c.stiffness + 1.0 / suit.fabric.stiffness) for c in (suit.flexor, suit.extensor))
    r_f, r_e, radius = made.map.radius, made.extensor_radius, made.joint_radius
    found = []
    for angle, taut in itertools.product(ANGLES, (1.0, 0.0)):
        lever = float(flexor_arm(angle, made.map))
        found.append(
            Port(
                inertia=motor.inertia,
                frequency=omega,
                ratio=zeta,
                spool_stiffness=r_f**2 * k_f + taut * r_e**2 * k_e,
                across=r_f * lever * k_f + taut * r_e * radius * k_e,
                joint_stiffness=lever**2 * k_f + taut * radius**2 * k_e,
                gear=lever / r_f,
                lead=lead,
                lead_square=square,
                dt=suit.sample_time,
                delay=suit.delay,
            )
        )
    return found


def wearers_of(suit: Suit) -> list[Body]:
    """From limp to stiff: the suit's own arm and those of `BODIES`, 0–200 N·m/rad and 0–10 N·m·s/rad of muscle."""
    return bodies([suit.arm, *(arm_of(mass, height) for mass, height in BODIES)])


def limit_for(suit: Suit) -> Limit:
    """Which virtual elbows the suit can render for `wearers_of` it."""
    return limit_of(ports_of(suit), wearers_of(suit))


@dataclass(frozen=True)
class Pushing:
    """The wearer's push as a rig describes it."""

    admittance: Admittance
    suit: Suit
    section: AdmittanceSettings
    room: float = ROOM
    """How far beyond its range the reference of a law that feeds the joint back may be led [rad]."""

    @property
    def cell(self) -> LoadCell:
        """The load cell, as far off as the rig says."""
        return LoadCell(self.section.cell_noise, self.section.cell_offset)

    def source(self, law: Law) -> Source:
        """The source above a law."""
        estimated, carried = self.section.torque == "estimate", self.section.carried
        return push_source(
            push_of(
                self.suit,
                law,
                self.admittance,
                estimated=estimated,
                carried=carried,
                friction_share=self.section.friction_share,
                room=self.room,
            )
        )

    def refuse_integral(self) -> None:
        """Refuse a drive with an integral: it is beyond the limit, which knows none, and most wearers swing with it.

        Raises:
            ParameterError: it has one.
        """
        given = self.suit.motor.integral
        if given > 0.0:
            said = (
                f"suit.drive_integral_per_s is {given:g} under [admittance], where the loop of most wearers oscillates"
            )
            raise ParameterError(said, expected="0", do="set it to 0")

    def notes(self, laws: list[Law], *, force: bool) -> list[str]:
        """Notes for the user; a virtual elbow beyond the limit is refused unless forced.

        Raises:
            ParameterError: a virtual elbow that the suit cannot render.
        """
        notes = []
        for refuse, do in (
            (self.refuse_integral, "set it to 0"),
            (lambda: limit_for(self.suit).refuse(self.admittance), "change [admittance]"),
        ):
            try:
                refuse()
            except ParameterError as error:
                if not force:
                    do = f"{do} in rig.toml, or run it anyway with --force"
                    raise ParameterError(error.what, expected=error.expected, do=do) from None
                notes.append(f"{error.what}; it runs because of --force")
        others = [law.name for law in laws if law.feeds_back]
        if others:
            notes.append(
                "the limit of [admittance] holds for a law that feeds nothing back, such as uncompensated; "
                f"{', '.join(others)}: the run itself shows"
            )
        return notes


def pushing_of(given: AdmittanceSettings, suit: Suit | None) -> Pushing | None:
    """The wearer's push; None where the reference is the rig's own.

    Raises:
        ParameterError: a virtual elbow that cannot be, or one without a suit.
    """
    if not given.enabled:
        return None
    if suit is None:
        raise ParameterError(
            "[admittance] is enabled without a suit",
            expected="suit.worn = true",
            do="set suit.worn = true, or disable it",
        )
    settings = Admittance(
        inertia=given.virtual_inertia,
        damping=given.virtual_damping,
        stiffness=given.virtual_stiffness,
        rest=given.rest,
        dead_band=given.dead_band,
        low=given.low,
        high=given.high,
        speed_limit=given.speed_limit,
    )
    return Pushing(check_admittance(settings), suit, given)
