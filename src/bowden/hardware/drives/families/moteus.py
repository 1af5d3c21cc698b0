"""mjbots moteus boards over CAN-FD: what has to be known of one, its joint encoder and the bus to it."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

from bowden.core.quantity import Quantity
from bowden.hardware.drives import joint_encoder as joints
from bowden.hardware.drives import on_can
from bowden.hardware.drives.moteus_frames import HIGHEST_PREFIX, MoteusCommand, fault_text
from bowden.hardware.drives.scale import MotorLimits, Scale, bounded_torque, feed_velocity
from bowden.rig.families import LOST, DriveNeeds

LOOK = 1e-3
"""Time in which a board has taken its torque off once its watchdog has run out; it looks 15 000 times a second or
more (mjbots/moteus, fw/bldc_servo_control.h: the control interrupt counts the time down) [s]."""


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
        Quantity(
            "turns of the board's output per turn of the rotor (motor_position.rotor_to_output_ratio)", gt=0.0, lt=1e4
        ),
    ] = 1.0
    motor_direction: on_can.MotorDirection = 1
    joint_source: Annotated[
        Literal[1, 2], Quantity("slot of the joint's encoder on the board's auxiliary port 2 (motor_position.sources)")
    ] = 1
    joint_direction: joints.JointDirection = 1
    home: on_can.Home = "counts"
    motor_home: on_can.MotorHome = 0.0
    joint_home: joints.JointHome = 0.0
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
    answer_timeout: on_can.AnswerTimeout = 0.3
    needs: DriveNeeds = DriveNeeds()

    @property
    def motor_step(self) -> float:
        """See `scale.motor_scale`."""
        return self.motor_direction * 2.0 * math.pi / (self.output_ratio * self.needs.gear)

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`: of an identifier the sender's part, since each receiver knows senders by it."""
        common = self.can_prefix << 16
        return {common | self.host_id << 8: "host_id", common | self.node_id << 8: "node_id"}

    def rules(self) -> Iterator[on_can.Rule]:
        """See `on_can.require`."""
        yield "bitrate", self.bitrate <= 1_000_000, "1 to 1000000, 1000000 for a moteus board"
        yield "data_bitrate", self.bitrate <= self.data_bitrate <= 8_000_000, "bitrate or more, 5000000 for a board"
        yield "host_id", self.host_id != self.node_id, "0 to 126, not the drive's node_id"
        yield on_can.rule_of_watchdog(self)
        yield from on_can.rules_of_rig(self, (5e-4, 0.02))


def following(drive: MoteusParameters) -> MoteusParameters:
    """The parameters with a watchdog long enough for the cycle: it is sent with each command, and follows."""
    if drive.watchdog != MoteusParameters().watchdog:
        return drive
    return drive._replace(watchdog=max(drive.watchdog, LOST * drive.needs.sample_time))


def joint_scale(drive: MoteusParameters, turns_at_home: float = 0.0) -> Scale:
    """The joint encoder's turns to the joint's angle."""
    step = drive.joint_direction * 2.0 * math.pi
    return Scale(step, drive.joint_home - step * turns_at_home)


def command_of(
    drive: MoteusParameters, limits: MotorLimits, turns: float, before: float, torque: float
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
    velocity = feed_velocity(turns, before, drive.needs.sample_time, limits.speed)
    room = (limits.high if velocity > 0.0 else limits.low) - turns
    if math.isfinite(turns) and abs(velocity) * drive.watchdog > max(0.0, math.copysign(1.0, velocity) * room):
        velocity = max(0.0, math.copysign(1.0, velocity) * room) / drive.watchdog * math.copysign(1.0, velocity)
    return MoteusCommand(
        turns,
        velocity,
        drive.motor_direction * bounded_torque(torque, drive) / (drive.needs.gear * drive.output_ratio),
        drive.kp_scale,
        drive.kd_scale,
        limits.current * drive.needs.torque_constant / drive.output_ratio if limits.current < math.inf else math.nan,
        drive.watchdog,
    )


FAMILY = on_can.family(
    MoteusParameters(),
    "A mjbots moteus board on CAN-FD, with the joint's encoder at its auxiliary port; `bowden twin` plays it.",
    driver="drives.moteus_drive.MoteusDrive",
    node="twin.moteus_node.MoteusNode",
    probe="drives.moteus_drive.probe",
    options=("register", "setting"),
    follows=following,
    watchdog=lambda drive: drive.watchdog + LOOK,
    scales=("output_ratio", "motor_direction", "joint_source", "joint_direction"),
    explain=fault_text,
    zero_hint="A moteus board knows its place after a loss of its supply only by an encoder at its output (off-board "
    "source); otherwise tell it where it is with tview, d exact TURNS, after each start, or set "
    'home = "here".',
)
