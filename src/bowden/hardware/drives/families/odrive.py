"""ODrive boards on classic CAN (CANSimple): what has to be known of one, the joint's encoder, and the bus to both."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity
from bowden.hardware.drives import joint_encoder as joints
from bowden.hardware.drives import on_can
from bowden.hardware.drives.joint_encoder import check_beside, has_encoder, identifiers_of
from bowden.hardware.drives.odrive_endpoints import TWIN
from bowden.hardware.drives.odrive_frames import INT16, MOST_TURNS, Cmd, Target, fault_text, identifier_of
from bowden.hardware.drives.scale import MotorLimits, bounded_torque, feed_velocity, motor_limits, motor_scale
from bowden.rig.families import DriveNeeds

LOOK = 1e-3
"""Time in which a board has taken its torque off once its watchdog has run out: its control loop, which looks, runs
8000 times a second (ODrive 0.5's public firmware, `Axis::watchdog_check`) [s]."""
ASKED_BY_CANOPEN = range(48, 52)
"""Numbers whose frames are 600h to 67Fh, by which CANopen looks for its devices: one of them is an emergency stop."""
HIGHEST_NODE = 62
"""Number 63 is the broadcast."""


_SPEED = "motor_speed_deg_per_s of [limits]"


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
    motor_direction: on_can.MotorDirection = 1
    home: on_can.HintedHome = "counts"
    motor_home: on_can.MotorHome = 0.0
    motor_hint: on_can.MotorHint = 0.0
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
        int,
        Quantity("steps of its velocity's feed-forward in 1 turn/s (axis0.config.can.input_vel_scale)", ge=1, le=INT16),
    ] = 1000
    torque_scale: Annotated[
        int,
        Quantity("steps of its torque's feed-forward in 1 N·m (axis0.config.can.input_torque_scale)", ge=1, le=INT16),
    ] = 1000
    joint: joints.JointSource = "cia406"
    joint_node_id: joints.JointNode = 32
    joint_counts_per_turn: joints.JointCounts = 16384.0
    joint_direction: joints.JointDirection = 1
    joint_home: joints.JointHome = 0.0
    joint_sends: joints.JointSending = "sync"
    answer_timeout: on_can.AnswerTimeout = 0.1
    needs: DriveNeeds = DriveNeeds()

    @property
    def motor_step(self) -> float:
        """See `scale.motor_scale`."""
        return self.motor_direction * 2.0 * math.pi / self.needs.gear

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`."""
        return {**identifiers_of(self), **own_identifiers(self)}

    def rules(self) -> Iterator[on_can.Rule]:
        """See `on_can.require`."""
        limits = motor_limits(self, motor_scale(self))
        reach = max((abs(end) for end in (limits.low, limits.high) if math.isfinite(end)), default=0.0)
        yield "endpoints", bool(self.endpoints) and "\0" not in self.endpoints, "the path of a file, or twin"
        yield on_can.rule_of_watchdog(self)
        yield from on_can.rules_of_rig(self, (5e-4, 0.02))
        yield "lowest_motor", reach <= MOST_TURNS, f"at most {MOST_TURNS:g} turns of the motor from its home"
        for name, most, unit, key in (
            ("velocity_scale", limits.speed if math.isfinite(limits.speed) else 0.0, "turns/s", _SPEED),
            ("torque_scale", self.needs.torque_offset / self.needs.gear, "N·m", "friction_feedforward_nm of [suit]"),
        ):
            scale = getattr(self, name)
            if most * scale > INT16:
                raise ParameterError(
                    f"the rig asks for {most:.4g} {unit} at the motor, and drive.{name} is {scale}",
                    expected=f"at most {INT16 / scale:.4g} {unit}, which is all that a target's field can tell",
                    do=f"set it to {math.floor(INT16 / most)} or less in the board and in [drive], or reduce {key}",
                )
        if has_encoder(self) and self.node_id in ASKED_BY_CANOPEN:
            raise ParameterError(
                f"drive.node_id is {self.node_id}, whose frames are those that ask CANopen devices who they are",
                expected="a number below 48 or above 51, since the joint's encoder is a CANopen device",
                do="change axis0.config.can.node_id in the board, and drive.node_id",
            )
        check_beside(self, own_identifiers(self))


def own_identifiers(drive: OdriveParameters) -> dict[int, str]:
    """Identifier of each frame of the board and to it → key of [drive] that it follows from."""
    return dict.fromkeys((identifier_of(drive.node_id, cmd) for cmd in Cmd), "node_id")


def target_of(drive: OdriveParameters, limits: MotorLimits, turns: float, before: float, torque: float) -> Target:
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
    velocity = feed_velocity(turns, before, drive.needs.sample_time, limits.speed)
    return Target(turns, velocity, drive.motor_direction * bounded_torque(torque, drive) / drive.needs.gear)


def found_from(given: OdriveParameters, folder: Path) -> OdriveParameters:
    """The parameters with the board's list of endpoints found from a folder."""
    return given if given.endpoints == TWIN else given._replace(endpoints=str(folder / given.endpoints))


FAMILY = on_can.family(
    OdriveParameters(),
    "An ODrive board on classic CAN, and the joint's encoder beside it; `bowden twin` plays both.",
    driver="drives.odrive_drive.OdriveDrive",
    node="twin.odrive_node.OdriveNode",
    probe="drives.odrive_drive.probe",
    options=("setting", "object"),
    beats="heartbeat",
    watchdog=lambda drive: drive.watchdog + LOOK,
    scales=("motor_direction", "joint", "joint_counts_per_turn", "joint_direction"),
    explain=fault_text,
    found_from=found_from,
    zero_hint="An ODrive board knows its place within a turn of its rotor after a loss of its supply, if its "
    'encoder is absolute; which turn is told by home = "hint". Until then it is told where it is by '
    "Set_Absolute_Position, or axis0.set_abs_pos(TURNS) in odrivetool.",
)
