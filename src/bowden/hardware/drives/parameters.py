"""What has to be known of a CANopen drive, its encoders and the bus to it."""

import math
from typing import Annotated, Literal, NamedTuple

from bowden.core.quantity import Quantity
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives import on_can
from bowden.hardware.drives.scale import Scale, SuitScale, spool_scale
from bowden.models.suit.suit_angle import SpoolMap
from bowden.rig.families import LOST


class DriveParameters(NamedTuple):
    """A CiA 402 drive on a CAN bus, in SI and radians at the spool and the joint.

    angle = home + direction · 2π · (counts − counts at home) / counts per turn of the spool or the joint

    On a suit that is the spool's angle, and the motor's is what `models.suit.suit_angle.motor_of` makes of it: all that
    stands above the drive knows the joint's coordinate alone.
    """

    family: Annotated[Literal["cia402"], Quantity("family of the drive")] = "cia402"
    interface: on_can.BusInterface = "bowden_unix"
    channel: on_can.BusChannel = "bowden"
    bitrate: on_can.BusBitrate = 1_000_000
    node_id: Annotated[int, Quantity("the drive's number on the bus", ge=1, le=126)] = 1
    host_id: Annotated[int, Quantity("number of this computer on the bus; its heartbeat has it", ge=1, le=127)] = 127
    motor_counts_per_turn: Annotated[
        float, Quantity("of the motor's encoder, at the motor's shaft", gt=0.0, lt=1e9)
    ] = 16384.0
    gear: float = 5.0
    """Motor turns per spool turn [–]."""
    motor_direction: Annotated[
        Literal[1, -1], Quantity("1 where the motor's counts rise as the spool pulls, otherwise -1")
    ] = 1
    joint_counts_per_turn: Annotated[float, Quantity("of the joint's encoder", gt=0.0, lt=1e9)] = 16384.0
    joint_direction: Annotated[
        Literal[1, -1], Quantity("1 where the joint's counts rise with its angle, otherwise -1")
    ] = 1
    home: Annotated[
        Literal["counts", "here"],
        Quantity("home is where the counts are zero, or where motor and joint are found when a command begins"),
    ] = "counts"
    motor_home: Annotated[float, Quantity("angle of the spool at home", "rad", ge=-720.0, le=720.0)] = 0.0
    joint_home: Annotated[float, Quantity("angle of the joint at home", "rad", ge=-720.0, le=720.0)] = 0.0
    torque_constant: float = 16.7e-3
    """Torque per ampere at the motor's shaft, which turns the drive's torque into a current [N·m/A]."""
    tension_scale: Annotated[
        float,
        Quantity("cable tension per millivolt at the drive's analog input; 0 for none", "N/mV", key="tension_n_per_mv"),
    ] = 0.0
    tension_zero: Annotated[float, Quantity("voltage of that input without load", "mV")] = 0.0
    torque_scale: Annotated[
        float,
        Quantity(
            "torque on the joint per millivolt at that input, in place of a tension; 0 for none",
            "N·m/mV",
            key="torque_nm_per_mv",
        ),
    ] = 0.0
    analog_range: Annotated[
        float, Quantity("voltage at which that input, or the cell's amplifier, saturates", "mV", gt=0.0, le=32767.0)
    ] = 10_000.0
    emergency_stop_input: Annotated[
        int,
        Quantity(
            "bit of the drive's digital inputs (60FDh) that is 1 unless the emergency stop is pressed, as an opening "
            "contact has it; -1 for none",
            ge=-1,
            le=31,
        ),
    ] = -1
    brake_output: Annotated[
        Literal["none", "set", "release"],
        Quantity(
            "what a 1 in bit 0 of the drive's digital outputs (60FEh) does to its holding brake: set, as CiA 402 has "
            "it, engages it; release puts voltage on it, which releases it; none: there is none"
        ),
    ] = "none"
    sample_time: float = 1e-3
    """One cycle, which is the drive's interpolation time too; whole milliseconds [s]."""
    heartbeat_time: Annotated[
        float, Quantity("between two heartbeats of this computer", "s", shown="ms", key="heartbeat_ms", gt=0.0, le=13.0)
    ] = 5e-3
    heartbeat_timeout: Annotated[
        float,
        Quantity(
            "the drive switches its torque off when it has not received our heartbeat for this long",
            "s",
            shown="ms",
            gt=0.0,
            le=60.0,
            follows=True,
        ),
    ] = 40e-3
    drive_heartbeat_time: Annotated[
        float,
        Quantity("between the drive's heartbeats", "s", shown="ms", key="drive_heartbeat_ms", gt=0.0, le=1000.0),
    ] = 10e-3
    lowest_motor: float = -math.inf
    """Spool angle below which the rig never goes; the drive's own limit must reach as far [rad]."""
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
        """See `on_can.collision`; all drives on a bus may have one host."""
        node, host = self.node_id, frames.HEARTBEAT + self.host_id
        to_it = frames.of_the_host(node, self.host_id) - {frames.NMT, frames.SYNC, host}
        functions = (frames.EMERGENCY, frames.TPDO1, frames.TPDO2, frames.TPDO3, frames.SDO_ANSWER, frames.HEARTBEAT)
        own = dict.fromkeys((*to_it, *(function + node for function in functions)), "node_id")
        return {**own, host: "host_id", **dict.fromkeys((frames.NMT, frames.SYNC), on_can.OF_ALL)}


LONGEST_TIMEOUT = 40e-3
"""So that torque is zero `family.longest_silence` after our last heartbeat, with the drive's own delay; of a slow loop,
`family.LOST` cycles [s]."""


def check_parameters(drive: DriveParameters) -> None:
    """Refuse parameters that make no sense, before a bus is opened.

    Raises:
        ParameterError: a value out of its range, with its name and what was expected.
    """
    named = bool(drive.channel.strip(".")) and "\0" not in drive.channel
    whole_ms = 1.0 <= round(1e3 * drive.sample_time, 9) <= 255.0 and round(1e3 * drive.sample_time, 9) % 1.0 == 0.0
    longest = max(LONGEST_TIMEOUT, LOST * drive.sample_time)
    rules = (
        ("channel", named, "the name of a bus"),
        ("node_id", 1 <= drive.node_id <= 126, "a number from 1 to 126"),
        ("host_id", 1 <= drive.host_id <= 127 and drive.host_id != drive.node_id, "1 to 127, not the drive's node_id"),
        ("motor_counts_per_turn", 0.0 < drive.motor_counts_per_turn < 1e9, "a number above 0"),
        ("joint_counts_per_turn", 0.0 < drive.joint_counts_per_turn < 1e9, "a number above 0"),
        ("gear", 0.0 < drive.gear < 1e4, "a number above 0"),
        ("motor_direction", drive.motor_direction in (1, -1), "1 or -1"),
        ("joint_direction", drive.joint_direction in (1, -1), "1 or -1"),
        ("motor_home", math.isfinite(drive.motor_home), "a finite angle"),
        ("joint_home", math.isfinite(drive.joint_home), "a finite angle"),
        ("torque_constant", 0.0 < drive.torque_constant < math.inf, "a number above 0"),
        ("tension_scale", math.isfinite(drive.tension_scale), "a finite number"),
        ("tension_zero", abs(drive.tension_zero) < drive.analog_range, "a voltage within analog_range_mv"),
        ("torque_scale", math.isfinite(drive.torque_scale), "a finite number"),
        ("torque_scale", not (drive.torque_scale and drive.tension_scale), "0 where tension_n_per_mv is not"),
        ("analog_range", 0.0 < drive.analog_range <= 32767.0, "above 0, at most 32767 mV"),
        ("sample_time", whole_ms, "whole milliseconds, 1 or more, as the drive's interpolation time"),
        ("heartbeat_timeout", 0.0 < drive.heartbeat_timeout <= longest, f"above 0, at most {1e3 * longest:g} ms"),
        (
            "heartbeat_timeout",
            LOST * drive.sample_time <= drive.heartbeat_timeout,
            f"three cycles at least, {1e3 * LOST * drive.sample_time:g} ms, so that one lost frame does no harm; left "
            "out, it follows",
        ),
        (
            "heartbeat_time",
            drive.heartbeat_time > 0.0 and LOST * drive.heartbeat_time <= drive.heartbeat_timeout,
            "at most a third of heartbeat_timeout, so that one lost frame does no harm",
        ),
        ("drive_heartbeat_time", 1e-3 <= drive.drive_heartbeat_time <= 1.0, "from 0.001 to 1 s"),
        *on_can.rules_of_limits(drive),
    )
    on_can.require(drive, rules)


def load_of(drive: DriveParameters, millivolts: float) -> float:
    """What the load cell at the drive's input says [N or N·m]; NaN where it cannot be, see `load_cell.usable`."""
    scale, tension = (drive.tension_scale, True) if drive.tension_scale else (drive.torque_scale, False)
    value = scale * (millivolts - drive.tension_zero)
    return math.nan if tension and value < 0.0 and abs(millivolts) >= drive.analog_range else value


def load_range(drive: DriveParameters) -> float:
    """Largest load that the drive's input can tell, either way where it is a torque [N or N·m]."""
    scale, zero, span = drive.tension_scale or drive.torque_scale, drive.tension_zero, drive.analog_range
    ends = scale * (span - zero), scale * (-span - zero)
    return max(ends) if drive.tension_scale else min(max(ends), -min(ends))


def tared(drive: DriveParameters, read: float, load: float) -> DriveParameters:
    """The parameters with which what was read is this load [N or N·m]."""
    scale = drive.tension_scale or drive.torque_scale
    return drive._replace(tension_zero=drive.tension_zero + (read - load) / scale)


def motor_scale(drive: DriveParameters, counts_at_home: int = 0) -> Scale | SuitScale:
    """The motor's counts to the spool's angle, or, on a suit, to the motor's in the joint's coordinate.

    >>> round(motor_scale(DriveParameters()).counts(2.0 * math.pi))
    81920
    """
    step = drive.motor_direction * 2.0 * math.pi / (drive.motor_counts_per_turn * drive.gear)
    return spool_scale(step, drive.motor_home, counts_at_home, drive.spool)


def joint_scale(drive: DriveParameters, counts_at_home: int = 0) -> Scale:
    """The joint encoder's counts to the joint's angle."""
    step = drive.joint_direction * 2.0 * math.pi / drive.joint_counts_per_turn
    return Scale(step, drive.joint_home - step * counts_at_home)
