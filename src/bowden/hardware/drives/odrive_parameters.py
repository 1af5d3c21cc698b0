"""What has to be known of an ODrive board, of the joint's encoder, and of the bus to both."""

import math
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity
from bowden.hardware.drives import joint_encoder as joints
from bowden.hardware.drives import on_can
from bowden.hardware.drives.joint_encoder import check_beside, identifiers_of, joint_encoder_of
from bowden.hardware.drives.odrive_endpoints import TWIN
from bowden.hardware.drives.odrive_frames import INT16, MOST_TURNS, Cmd, Scales, Target, identifier_of
from bowden.hardware.drives.scale import Scale, SuitScale, spool_scale
from bowden.models.suit.suit_angle import SpoolMap
from bowden.rig.families import LOST, DriveNeeds

LOOK = 1e-3
"""Time in which a board has taken its torque off once its watchdog has run out: its control loop, which looks, runs
8000 times a second (ODrive 0.5's public firmware, `Axis::watchdog_check`) [s]."""
LONGEST_WATCHDOG = 39e-3
"""So that the torque is off 40 ms after our last word; of a slow loop, `family.LOST` cycles [s]."""
ASKED_BY_CANOPEN = range(48, 52)
"""Numbers whose frames are 600h to 67Fh, by which CANopen looks for its devices: one of them is an emergency stop."""
HIGHEST_NODE = 62
"""Number 63 is the broadcast."""


class OdriveParameters(NamedTuple):
    """An ODrive board on a CAN bus, in SI and radians at the spool.

    angle of the spool = home + direction · 2π · (turns − turns at home) / gear

    where turns are those of the motor's shaft, on which the board's load encoder sits too.
    """

    family: Annotated[Literal["odrive"], Quantity("family of the drive")] = "odrive"
    interface: on_can.BusInterface = "bowden_unix"
    channel: on_can.BusChannel = "bowden"
    bitrate: on_can.BusBitrate = 1_000_000
    node_id: Annotated[int, Quantity("the board's number (axis0.config.can.node_id)", ge=0, le=HIGHEST_NODE)] = 1
    endpoints: Annotated[
        str,
        Quantity(
            "the maker's flat_endpoints.json for the board's firmware and hardware, found from this file; twin for the "
            "twin's own"
        ),
    ] = TWIN
    gear: float = 5.0
    """Motor turns per spool turn [–]."""
    motor_direction: Annotated[
        Literal[1, -1], Quantity("1 where the board's position rises as the spool pulls, otherwise -1")
    ] = 1
    home: Annotated[
        Literal["counts", "here", "hint"],
        Quantity(
            "home is where the board's position is zero; where motor and joint are found when a command begins (here); "
            "or where its rotor is at zero, in the turn in which the motor is near motor_hint_deg when a command begins"
        ),
    ] = "counts"
    motor_home: Annotated[float, Quantity("angle of the spool at home", "rad", ge=-720.0, le=720.0)] = 0.0
    motor_hint: Annotated[
        float,
        Quantity(
            "where the spool is when a command begins, within half a turn of the rotor; for home = hint",
            "rad",
            ge=-720.0,
            le=720.0,
        ),
    ] = 0.0
    watchdog: Annotated[
        float,
        Quantity("the board's watchdog as it is set (axis0.config.watchdog_timeout)", "s", shown="ms", gt=0.0, le=60.0),
    ] = 35e-3
    heartbeat: Annotated[
        float,
        Quantity(
            "between two heartbeats of the board as it is set (axis0.config.can.heartbeat_msg_rate_ms)",
            "s",
            shown="ms",
            ge=1.0,
            le=10.0,
        ),
    ] = 5e-3
    velocity_scale: Annotated[
        int, Quantity("steps of its velocity's feed-forward in 1 turn/s (axis0.config.can.input_vel_scale)", ge=1)
    ] = 1000
    torque_scale: Annotated[
        int, Quantity("steps of its torque's feed-forward in 1 N·m (axis0.config.can.input_torque_scale)", ge=1)
    ] = 1000
    joint: joints.JointSource = "cia406"
    joint_node_id: joints.JointNode = 32
    joint_counts_per_turn: joints.JointCounts = 16384.0
    joint_direction: joints.JointDirection = 1
    joint_home: joints.JointHome = 0.0
    joint_sends: joints.JointSending = "sync"
    torque_constant: float = 16.7e-3
    """Torque per ampere at the motor's shaft [N·m/A]."""
    sample_time: float = 1e-3
    """One cycle [s]."""
    lowest_motor: float = -math.inf
    """Spool angle below which the rig never goes [rad]."""
    highest_motor: float = math.inf
    """Spool angle above which the rig never goes [rad]."""
    speed_limit: float = 0.0
    """Largest speed of the spool that the rig asks for; 0 for none [rad/s]."""
    current_limit: float = 0.0
    """Largest current that the rig asks for; 0 for none [A]."""
    lag_current: float = math.inf
    """Current that the rig's servo draws per lag behind its target, at rest [A/rad]."""
    lag_time: float = 0.0
    """Lag per speed at which it draws none [s]."""
    torque_offset: float = 0.0
    """Largest torque offset beside the target, at the spool; 0 where none is sent [N·m]."""
    answer_timeout: on_can.AnswerTimeout = 0.1
    spool: SpoolMap | None = None
    """Of a suit: motor angles are the joint's, and the spool turns as this says (`models.suit.suit_angle`)."""

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`."""
        return {**identifiers_of(joint_encoder_of(self)), **own_identifiers(self)}


def own_identifiers(drive: OdriveParameters) -> dict[int, str]:
    """Identifier of each frame of the board and to it → key of [drive] that it follows from."""
    return dict.fromkeys((identifier_of(drive.node_id, cmd) for cmd in Cmd), "node_id")


def scales_of(drive: OdriveParameters) -> Scales:
    """Of the feed-forward fields."""
    return Scales(float(drive.velocity_scale), float(drive.torque_scale))


def motor_scale(drive: OdriveParameters, turns_at_home: float = 0.0) -> Scale | SuitScale:
    """The motor's turns to the spool's angle, or, on a suit, to the motor's in the joint's coordinate.

    >>> round(motor_scale(OdriveParameters()).counts(2.0 * math.pi), 9)
    5.0
    """
    step = drive.motor_direction * 2.0 * math.pi / drive.gear
    return spool_scale(step, drive.motor_home, turns_at_home, drive.spool)


class OdriveLimits(NamedTuple):
    """The rig's limits as the board counts."""

    low: float
    """[turns]"""
    high: float
    """[turns]"""
    speed: float
    """Largest; infinite for none [turns/s]."""
    current: float
    """Largest; infinite for none [A]."""


def limits_of(drive: OdriveParameters, motor: Scale | SuitScale) -> OdriveLimits:
    """The rig's limits as the board counts."""
    low, high = sorted(
        motor.counts(angle) if math.isfinite(angle) else math.copysign(math.inf, angle * motor.step)
        for angle in (drive.lowest_motor, drive.highest_motor)
    )
    steepest = motor.steepest(drive.lowest_motor, drive.highest_motor)
    return OdriveLimits(
        low,
        high,
        drive.speed_limit * steepest / abs(motor.step) if drive.speed_limit > 0.0 else math.inf,
        drive.current_limit if drive.current_limit > 0.0 else math.inf,
    )


def target_of(drive: OdriveParameters, limits: OdriveLimits, turns: float, before: float, torque: float) -> Target:
    """A target with its feed-forward.

    The velocity is that from the target before, so that the board need not lag to move. Should no further target come,
    the board stays at this one, off by its velocity over its gain, until its watchdog runs out.

    Args:
        drive: of the rig.
        limits: of the rig, as the board counts.
        turns: the target [turns].
        before: the target of the cycle before; NaN for none [turns].
        torque: offset at the spool [N·m].
    """
    velocity = (turns - before) / drive.sample_time
    bounded = max(-drive.torque_offset, min(drive.torque_offset, torque)) if math.isfinite(torque) else 0.0
    return Target(
        turns,
        max(-limits.speed, min(limits.speed, velocity)) if math.isfinite(velocity) else 0.0,
        drive.motor_direction * bounded / drive.gear,
    )


def check_parameters(drive: OdriveParameters) -> None:
    """Refuse parameters that make no sense, before a bus is opened.

    Raises:
        ParameterError: a value out of its range, with its name and what was expected.
    """
    named = bool(drive.channel.strip(".")) and "\0" not in drive.channel
    least = LOST * drive.sample_time
    longest = max(LONGEST_WATCHDOG, least)
    limits = limits_of(drive, motor_scale(drive))
    reach = max((abs(end) for end in (limits.low, limits.high) if math.isfinite(end)), default=0.0)
    fastest = limits.speed if math.isfinite(limits.speed) else 0.0
    rules = (
        ("channel", named, "the name of a bus"),
        ("node_id", 0 <= drive.node_id <= HIGHEST_NODE, "a number from 0 to 62"),
        ("endpoints", bool(drive.endpoints) and "\0" not in drive.endpoints, "the path of a file, or twin"),
        ("gear", 0.0 < drive.gear < 1e4, "a number above 0"),
        ("motor_direction", drive.motor_direction in (1, -1), "1 or -1"),
        ("motor_home", math.isfinite(drive.motor_home), "a finite angle"),
        ("motor_hint", math.isfinite(drive.motor_hint), "a finite angle"),
        ("torque_constant", 0.0 < drive.torque_constant < math.inf, "a number above 0"),
        ("sample_time", 5e-4 <= drive.sample_time <= 0.02, "0.0005 to 0.02 s"),
        (
            "watchdog",
            least - 1e-9 <= drive.watchdog <= longest + 1e-9,
            f"three cycles, {least:g} s, to {longest:g} s",
        ),
        ("heartbeat", 1e-3 <= drive.heartbeat <= 10e-3, "from 0.001 to 0.01 s, so that its state is known in time"),
        ("velocity_scale", 1 <= drive.velocity_scale <= INT16, f"from 1 to {INT16}"),
        ("torque_scale", 1 <= drive.torque_scale <= INT16, f"from 1 to {INT16}"),
        *on_can.rules_of_limits(drive),
        ("lowest_motor", reach <= MOST_TURNS, f"at most {MOST_TURNS:g} turns of the motor from its home"),
    )
    on_can.require(drive, rules)
    for name, most, unit in (
        ("velocity_scale", fastest, "turns/s"),
        ("torque_scale", drive.torque_offset / drive.gear, "N·m"),
    ):
        scale = getattr(drive, name)
        if most * scale > INT16:
            raise ParameterError(
                f"the rig asks for {most:.4g} {unit} at the motor, and drive.{name} is {scale}",
                expected=f"at most {INT16 / scale:.4g} {unit}, which is all that a target's field can tell",
                do="reduce the scale in the board and in [drive], or the limit in [limits]",
            )
    encoder = joint_encoder_of(drive)
    if encoder is not None and drive.node_id in ASKED_BY_CANOPEN:
        raise ParameterError(
            f"drive.node_id is {drive.node_id}, whose frames are those that ask CANopen devices who they are",
            expected="a number below 48 or above 51, since the joint's encoder is a CANopen device",
            do="change axis0.config.can.node_id in the board, and drive.node_id",
        )
    check_beside(encoder, own_identifiers(drive))


def found_from(given: OdriveParameters, folder: Path) -> OdriveParameters:
    """The parameters with the board's list of endpoints found from a folder."""
    return given if given.endpoints == TWIN else given._replace(endpoints=str(folder / given.endpoints))


def completed(given: OdriveParameters, needs: DriveNeeds) -> OdriveParameters:
    """The parameters with what the rig asks for.

    Raises:
        ParameterError: values that make no sense together.
    """
    asked = {name: value for name, value in needs._asdict().items() if name in OdriveParameters._fields}
    drive = given._replace(**asked)
    check_parameters(drive)
    if 2.0 * drive.heartbeat > needs.heartbeat_age:
        raise ParameterError(
            f"drive.heartbeat_ms is {1e3 * drive.heartbeat:g}, and limits.heartbeat_age_s is {needs.heartbeat_age:g}",
            expected="two heartbeats of the board within that age, so that one lost frame does no harm",
            do="correct one of them",
        )
    return drive
