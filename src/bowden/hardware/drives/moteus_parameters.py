"""What has to be known of a moteus board, its joint encoder and the bus to it."""

import math
from typing import Annotated, Literal, NamedTuple

from bowden.core.quantity import Quantity
from bowden.hardware.drives import on_can
from bowden.hardware.drives.moteus_frames import HIGHEST_PREFIX, MOST_TURNS, MoteusCommand
from bowden.hardware.drives.scale import Scale, SuitScale, spool_scale
from bowden.models.suit.suit_angle import SpoolMap
from bowden.rig.families import LOST, DriveNeeds

LOOK = 1e-3
"""Time in which a board has taken its torque off once its watchdog has run out; it looks 15 000 times a second or
more (mjbots/moteus, fw/bldc_servo_control.h: the control interrupt counts the time down) [s]."""
LONGEST_WATCHDOG = 39e-3
"""So that the torque is off 40 ms after our last word; of a slow loop, `family.LOST` cycles [s]."""


class MoteusParameters(NamedTuple):
    """A moteus board on a CAN-FD bus, in SI and radians at the spool and the joint.

    angle of the spool = home + direction · 2π · (turns − turns at home) / (output ratio · gear)

    where turns are those of the board's output, which is the motor's shaft unless
    `motor_position.rotor_to_output_ratio` says otherwise.
    """

    family: Annotated[Literal["moteus"], Quantity("family of the drive")] = "moteus"
    interface: on_can.BusInterface = "bowden_unix"
    channel: on_can.BusChannel = "bowden"
    bitrate: on_can.BusBitrate = 1_000_000
    data_bitrate: Annotated[
        int, Quantity("of the data of a CAN-FD frame; SocketCAN takes its interface's own", "bit/s", gt=0)
    ] = 5_000_000
    node_id: Annotated[int, Quantity("the board's number on the bus (id.id)", ge=1, le=126)] = 1
    host_id: Annotated[
        int, Quantity("number of this computer on the bus; moteus_tool and tview have 0", ge=0, le=126)
    ] = 32
    can_prefix: Annotated[
        int, Quantity("the prefix of all identifiers, as on the board (can.prefix)", ge=0, le=HIGHEST_PREFIX)
    ] = 0
    output_ratio: Annotated[
        float,
        Quantity("turns of the board's output per turn of the rotor (motor_position.rotor_to_output_ratio)", gt=0.0),
    ] = 1.0
    gear: float = 5.0
    """Motor turns per spool turn [–]."""
    motor_direction: Annotated[
        Literal[1, -1], Quantity("1 where the board's position rises as the spool pulls, otherwise -1")
    ] = 1
    joint_source: Annotated[
        Literal[1, 2], Quantity("slot of the joint's encoder on the board's auxiliary port 2 (motor_position.sources)")
    ] = 1
    joint_direction: Annotated[
        Literal[1, -1], Quantity("1 where that encoder's position rises with the joint's angle, otherwise -1")
    ] = 1
    home: Annotated[
        Literal["counts", "here"],
        Quantity("home is where both positions are zero, or where motor and joint are found when a command begins"),
    ] = "counts"
    motor_home: Annotated[float, Quantity("angle of the spool at home", "rad", ge=-720.0, le=720.0)] = 0.0
    joint_home: Annotated[float, Quantity("angle of the joint at home", "rad", ge=-720.0, le=720.0)] = 0.0
    torque_constant: float = 16.7e-3
    """Torque per ampere at the motor's shaft [N·m/A]."""
    kp_scale: Annotated[
        float, Quantity("share of the board's own gain kp (servo.pid_position.kp)", ge=0.01, le=1.0)
    ] = 1.0
    kd_scale: Annotated[float, Quantity("share of the board's own gain kd (servo.pid_position.kd)", ge=0.0, le=1.0)] = (
        1.0
    )
    watchdog: Annotated[
        float,
        Quantity(
            "the board switches its torque off when no command has come for this long", "s", shown="ms", gt=0.0, le=60.0
        ),
    ] = 35e-3
    sample_time: float = 1e-3
    """One cycle [s]."""
    lowest_motor: float = -math.inf
    """Spool angle below which the rig never goes [rad]."""
    highest_motor: float = math.inf
    """Spool angle above which the rig never goes [rad]."""
    speed_limit: float = 0.0
    """Largest speed of the spool that the rig asks for; 0 for none [rad/s]."""
    following_error: float = 0.0
    """Largest lag behind the target that the rig allows, at the spool; 0 for none [rad]."""
    current_limit: float = 0.0
    """Largest current that the rig asks for; 0 for none [A]."""
    lag_current: float = math.inf
    """Current that the rig's servo draws per lag behind its target, at rest [A/rad]."""
    lag_time: float = 0.0
    """Lag per speed at which it draws none [s]."""
    torque_offset: float = 0.0
    """Largest torque offset beside the target, at the spool; 0 where none is sent [N·m]."""
    answer_timeout: Annotated[
        float, Quantity("longest wait for an answer at bring-up", "s", shown="ms", gt=0.0, le=1e4)
    ] = 0.3
    spool: SpoolMap | None = None
    """Of a suit: motor angles are the joint's, and the spool turns as this says (`models.suit.suit_angle`)."""

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`: of an identifier the sender's part, since each receiver knows senders by it."""
        common = self.can_prefix << 16
        return {common | self.host_id << 8: "host_id", common | self.node_id << 8: "node_id"}


def check_parameters(drive: MoteusParameters) -> None:
    """Refuse parameters that make no sense, before a bus is opened.

    Raises:
        ParameterError: a value out of its range, with its name and what was expected.
    """
    named = bool(drive.channel.strip(".")) and "\0" not in drive.channel
    least = LOST * drive.sample_time
    longest = max(LONGEST_WATCHDOG, least)
    rules = (
        ("channel", named, "the name of a bus"),
        ("bitrate", 0 < drive.bitrate <= 1_000_000, "1 to 1000000, 1000000 for a moteus board"),
        ("data_bitrate", drive.bitrate <= drive.data_bitrate <= 8_000_000, "bitrate or more, 5000000 for a board"),
        ("node_id", 1 <= drive.node_id <= 126, "a number from 1 to 126"),
        ("host_id", 0 <= drive.host_id <= 126 and drive.host_id != drive.node_id, "0 to 126, not the drive's node_id"),
        ("can_prefix", 0 <= drive.can_prefix <= HIGHEST_PREFIX, f"0 to {HIGHEST_PREFIX}"),
        ("output_ratio", 0.0 < drive.output_ratio < 1e4, "a number above 0"),
        ("gear", 0.0 < drive.gear < 1e4, "a number above 0"),
        ("motor_direction", drive.motor_direction in (1, -1), "1 or -1"),
        ("joint_direction", drive.joint_direction in (1, -1), "1 or -1"),
        ("joint_source", drive.joint_source in (1, 2), "1 or 2"),
        ("motor_home", math.isfinite(drive.motor_home), "a finite angle"),
        ("joint_home", math.isfinite(drive.joint_home), "a finite angle"),
        ("torque_constant", 0.0 < drive.torque_constant < math.inf, "a number above 0"),
        ("kp_scale", 0.01 <= drive.kp_scale <= 1.0, "0.01 to 1"),
        ("kd_scale", 0.0 <= drive.kd_scale <= 1.0, "0 to 1"),
        ("sample_time", 5e-4 <= drive.sample_time <= 0.02, "0.0005 to 0.02 s"),
        (
            "watchdog",
            least - 1e-9 <= drive.watchdog <= longest + 1e-9,
            f"three cycles, {least:g} s, to {longest:g} s",
        ),
        *on_can.rules_of_limits(drive),
    )
    on_can.require(drive, rules)


def completed(given: MoteusParameters, needs: DriveNeeds) -> MoteusParameters:
    """The parameters with what the rig asks for.

    Raises:
        ParameterError: values that make no sense together.
    """
    asked = {name: value for name, value in needs._asdict().items() if name in MoteusParameters._fields}
    parameters = given._replace(**asked)
    if parameters.watchdog == MoteusParameters().watchdog:  # it is sent with each command, and follows
        parameters = parameters._replace(watchdog=max(parameters.watchdog, LOST * parameters.sample_time))
    check_parameters(parameters)
    return parameters


def motor_scale(drive: MoteusParameters, turns_at_home: float = 0.0) -> Scale | SuitScale:
    """The output's turns to the spool's angle, or, on a suit, to the motor's in the joint's coordinate.

    >>> round(motor_scale(MoteusParameters()).counts(2.0 * math.pi), 9)
    5.0
    """
    step = drive.motor_direction * 2.0 * math.pi / (drive.output_ratio * drive.gear)
    return spool_scale(step, drive.motor_home, turns_at_home, drive.spool)


def joint_scale(drive: MoteusParameters, turns_at_home: float = 0.0) -> Scale:
    """The joint encoder's turns to the joint's angle."""
    step = drive.joint_direction * 2.0 * math.pi
    return Scale(step, drive.joint_home - step * turns_at_home)


class MoteusLimits(NamedTuple):
    """The rig's limits in the board's units, of its output."""

    low: float
    """[turns]"""
    high: float
    """[turns]"""
    speed: float
    """Largest; infinite for none [turns/s]."""
    torque: float
    """Largest; NaN for the board's own [N·m]."""


def limits_of(drive: MoteusParameters, motor: Scale | SuitScale) -> MoteusLimits:
    """The rig's limits as the board counts."""
    ends = sorted(
        motor.counts(angle) if math.isfinite(angle) else math.copysign(math.inf, angle * motor.step)
        for angle in (drive.lowest_motor, drive.highest_motor)
    )
    steepest = motor.steepest(drive.lowest_motor, drive.highest_motor)
    return MoteusLimits(
        max(-MOST_TURNS, ends[0]),
        min(MOST_TURNS, ends[1]),
        drive.speed_limit * steepest / abs(motor.step) if drive.speed_limit > 0.0 else math.inf,
        drive.current_limit * drive.torque_constant / drive.output_ratio if drive.current_limit > 0.0 else math.nan,
    )


def command_of(
    drive: MoteusParameters, limits: MoteusLimits, turns: float, before: float, torque: float
) -> MoteusCommand:
    """A command in position mode to a place within what a board counts.

    The velocity is that from the target before, so that the board goes on between two commands. It would go on for the
    watchdog's time if no further command came: what leads out of the rig's range within that is taken away.

    Args:
        drive: of the rig.
        limits: of the rig, as the board counts.
        turns: the target [turns]; NaN for where the motor is.
        before: the target of the cycle before; NaN for none [turns].
        torque: offset at the spool [N·m].
    """
    velocity = (turns - before) / drive.sample_time
    if not math.isfinite(velocity):
        velocity = 0.0
    velocity = max(-limits.speed, min(limits.speed, velocity))
    room = (limits.high if velocity > 0.0 else limits.low) - turns
    if math.isfinite(turns) and abs(velocity) * drive.watchdog > max(0.0, math.copysign(1.0, velocity) * room):
        velocity = max(0.0, math.copysign(1.0, velocity) * room) / drive.watchdog * math.copysign(1.0, velocity)
    bounded = max(-drive.torque_offset, min(drive.torque_offset, torque)) if math.isfinite(torque) else 0.0
    return MoteusCommand(
        turns,
        velocity,
        drive.motor_direction * bounded / (drive.gear * drive.output_ratio),
        drive.kp_scale,
        drive.kd_scale,
        limits.torque,
        drive.watchdog,
    )
