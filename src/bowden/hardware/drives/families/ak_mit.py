"""CubeMars AK series in MIT mode: what has to be known of such a drive, the joint's encoder, and the bus to both."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS
from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.drives import joint_encoder as joints
from bowden.hardware.drives import on_can
from bowden.hardware.drives.ak_frames import HIGHEST_KD, HIGHEST_KP, HIGHEST_POSITION, MODELS, AkModel, error_text
from bowden.hardware.drives.findings import FINDINGS
from bowden.hardware.drives.joint_encoder import check_beside, identifiers_of
from bowden.hardware.drives.scale import Scale, SuitScale, motor_scale
from bowden.rig.families import LOST, DriveNeeds

UPLOAD, UPLOADS = 0x29, 500.0
"""Packet number with which a board in servo mode, and one of V3, tells its state by itself (CubeMars, manuals V1.0.8,
5.2, and V3.0.0, 4.3.1); and how often at most [Hz]."""
ROOM = 0.2
"""Of the drive's position, to both ends of its range: a target never comes nearer [rad]."""
FINEST = 0.02
"""Of a field's range: a limit nearer to its end could not be distinguished from the end [–]."""


class AkParameters(NamedTuple):
    """A drive of the AK series on a CAN bus, in SI and radians at the spool, which sits on its output shaft.

    angle = home + direction · (position − position at home)

    The drive makes its torque itself: stiffness · (target − position) − damping · speed. Of that the servo of [servo]
    is made: ω² = stiffness/inertia and 2·ζ/ω = damping/stiffness.
    """

    family: Annotated[Literal["ak_mit"], Quantity("family of the drive")] = "ak_mit"
    interface: on_can.BusInterface = "bowden_unix"
    channel: on_can.BusChannel = "bowden"
    bitrate: on_can.BusBitrate = 1_000_000
    model: Annotated[
        Literal["AK10-9", "AK60-6", "AK70-10", "AK80-6", "AK80-9", "AK80-64"],
        Quantity("which drive; its ranges depend on it, and no frame has them"),
    ] = "AK80-9"
    board: Annotated[
        Literal["v2", "v3"], Quantity("generation of its driver board: V1 and V2 alike, or V3, whose frames are others")
    ] = "v2"
    node_id: Annotated[int, Quantity("the drive's number, its CAN ID", ge=1, le=127)] = 1
    reply_id: Annotated[
        int,
        Quantity("identifier of the drive's replies, its CAN Master ID; -1 where they have its own", ge=-1, le=2047),
    ] = -1
    motor_direction: on_can.MotorDirection = 1
    stiffness: Annotated[float, Quantity("kp of the drive, at its output shaft", "N·m/rad", gt=0.0, le=HIGHEST_KP)] = (
        50.0
    )
    damping: Annotated[float, Quantity("kd of the drive, at its output shaft", "N·m·s/rad", ge=0.0, le=HIGHEST_KD)] = (
        1.9
    )
    home: on_can.HintedHome = "counts"
    motor_home: on_can.MotorHome = 0.0
    motor_hint: on_can.MotorHint = 0.0
    watchdog: Annotated[
        float,
        Quantity(
            "CAN timeout as it is set in the drive with its maker's tool; 0 for none, with which no run begins",
            "s",
            shown="ms",
            ge=0.0,
            le=1000.0,
        ),
    ] = 20e-3
    no_limb: on_can.NoLimb = False
    temperature_zero: Annotated[
        Literal[0, 40], Quantity("what the drive's temperature byte says at 0 °C: 40 by later editions of its manual")
    ] = 0
    joint: joints.JointSource = "cia406"
    joint_node_id: joints.JointNode = 32
    joint_counts_per_turn: joints.JointCounts = 16384.0
    joint_direction: joints.JointDirection = 1
    joint_home: joints.JointHome = 0.0
    joint_sends: joints.JointSending = "sync"
    answer_timeout: on_can.AnswerTimeout = 0.1
    needs: DriveNeeds = DriveNeeds(gear=9.0, torque_constant=0.091)

    @property
    def motor_step(self) -> float:
        """See `scale.motor_scale`."""
        return float(self.motor_direction)

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`; replies have the drive's number in them, so that several drives may share theirs."""
        replies = {reply_id(self): "reply_id"}
        return {**identifiers_of(self), **replies, command_id(self): "node_id"}

    def rules(self) -> Iterator[on_can.Rule]:
        """See `on_can.require`."""
        table = MODELS[self.board]
        yield "model", self.model in table, f"of a board {self.board.upper()}: {', '.join(table)}"
        model, needs, least = model_of(self), self.needs, LOST * self.needs.sample_time
        if self.board == "v3":
            yield (
                "sample_time",
                needs.sample_time >= 1.0 / UPLOADS,
                "2 ms or more: a board V3 tells 500 states a second",
            )
            yield "torque_offset", needs.torque_offset == 0.0, "0: whether a V3's torque is in N·m or A is not known"
        yield "joint_counts_per_turn", float(self.joint_counts_per_turn).is_integer(), "a whole number from 1 on"
        told = f"at least {1e3 * least:g} ms, three cycles, so that one lost frame does no harm; or 0"
        yield "watchdog", self.watchdog == 0.0 or self.watchdog >= least, told
        yield from on_can.rules_of_rig(self, (1e-3, 0.05), most_push)
        if abs(needs.gear / model.gear - 1.0) > 1e-3:
            raise ParameterError(
                f"the rig's gear is {needs.gear:g}, and an {self.model} has {model.gear:g}",
                expected="the drive's own, with the spool on its output shaft",
                do="correct gear in [motor] and, on a suit, set second_gear = 1 in [suit]; or correct drive.model",
            )
        speed = needs.speed_limit * motor_scale(self).steepest(needs.lowest_motor, needs.highest_motor)
        if speed > (1.0 - FINEST) * model.velocity:
            raise ParameterError(
                f"the rig's speed limit is {speed:.4g} rad/s at the spool",
                expected=f"at most {(1.0 - FINEST) * model.velocity:.4g}, as far as an {self.model} can report it",
                do="reduce motor_speed_deg_per_s in [limits]",
            )
        torque, most = needs.gear * needs.torque_constant * needs.current_limit, (1.0 - FINEST) * model.torque
        if torque > most:
            raise ParameterError(
                f"the rig's largest current, {needs.current_limit:g} A, is {torque:.4g} N·m at the output shaft",
                expected=f"at most {most:.4g} N·m, as far as an {self.model} can report it",
                do="reduce current_limit_a in [motor], or correct torque_constant_nm_per_a there",
            )
        if self.home == "counts" and self.interface != "bowden_unix":
            turn, do = 2.0 * math.pi / model.gear, f"{on_can.TELL_TURN}make the range in [limits] smaller"
            expected = 'less than a turn with home = "counts"'
            on_can.check_turn(self, motor_scale(self), turn, "the rotor; the drive forgets", expected, do)
        if self.home == "hint" and needs.spool is None:
            period = 2.0 * math.pi / needs.gear
            if needs.highest_motor < self.motor_hint - period or needs.lowest_motor > self.motor_hint + period:
                raise ParameterError(
                    f"drive.motor_hint_deg is {self.motor_hint / RADIANS:g}",
                    expected="an angle within the motor's range in [limits]",
                )
        check_beside(self, {command_id(self): "node_id", reply_id(self): "reply_id"})


def reply_id(drive: AkParameters) -> int:
    """Identifier of its replies, or of the states that it tells by itself."""
    if drive.board == "v3":
        return EXTENDED | UPLOAD << 8 | drive.node_id
    return drive.node_id if drive.reply_id < 0 else drive.reply_id


def model_of(drive: AkParameters) -> AkModel:
    """Its ranges."""
    return MODELS[drive.board].get(drive.model) or MODELS["v2"][drive.model]


def command_id(drive: AkParameters) -> int:
    """Identifier of commands to it."""
    return EXTENDED | 0x800 | drive.node_id if drive.board == "v3" else drive.node_id


def torque_per_ampere(drive: AkParameters) -> float:
    """At the output shaft [N·m/A]."""
    return drive.needs.gear * drive.needs.torque_constant


def largest_torque(drive: AkParameters) -> float:
    """What the largest current gives, at the output shaft; infinite where no current is asked for [N·m]."""
    return drive.needs.gear * drive.needs.torque_constant * (drive.needs.current_limit or math.inf)


def most_push(drive: AkParameters) -> float:
    """Largest torque offset that is allowed, at the spool [N·m]."""
    return on_can.MOST_PUSH * min(largest_torque(drive), model_of(drive).torque)


def check_range(drive: AkParameters, scale: Scale | SuitScale, expected: str) -> None:
    """Refuse a rig whose motor goes to where the drive's position cannot be known, or nearly.

    Raises:
        ParameterError: with both.
    """
    for end in (drive.needs.lowest_motor, drive.needs.highest_motor):
        position = scale.counts(end) if math.isfinite(end) else 0.0
        if not abs(position) <= HIGHEST_POSITION - ROOM:
            raise ParameterError(
                f"the motor goes to {end / RADIANS:g}°, where the position of an {drive.model} is {position:.4g} rad",
                expected=f"within ±{HIGHEST_POSITION - ROOM:g} rad, {expected}",
                do="make the range in [limits] smaller, or set the drive's zero anew with its maker's tool",
            )


def following(drive: AkParameters) -> AkParameters:
    """The parameters as they are, of a motor that stays in the drive's range."""
    check_range(drive, motor_scale(drive), "as it counts them from home")
    return drive


FAMILY = on_can.family(
    AkParameters(),
    "A drive of the CubeMars AK series in MIT mode, and the joint's encoder beside it; `bowden twin` plays both.",
    driver="drives.ak_drive.AkDrive",
    node="twin.ak_node.AkNode",
    probe="drives.ak_drive.probe",
    options=("object",),
    follows=following,
    watchdog=lambda drive: drive.watchdog or math.inf,
    scales=("model", "board", "motor_direction", "joint", "joint_counts_per_turn", "joint_direction"),
    explain=lambda code: FINDINGS.get(code) or error_text(code),
    most=most_push,
    unseen_watch=lambda parameters: (
        f"the CAN timeout of an {parameters.model} is set with its maker's tool, and no frame shows whether it is: if "
        "it is not, the motor keeps its last command when this computer dies, until its supply is cut"
    ),
    integrates=False,
    no_limb=lambda parameters: parameters.no_limb,
    example={"motor": {"gear": 9.0, "torque_constant_nm_per_a": 0.091}, "drive": {"home": "hint"}},
    zero_hint="An AK drive takes the present place for its own zero by its set-origin frame, or with its maker's tool; "
    "bowden does not send it. Zero the rig anew after that. Which turn of its rotor it is in after a restart is told "
    'by home = "hint".',
)
