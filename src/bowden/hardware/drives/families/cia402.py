"""CiA 402 over CANopen: what has to be known of such a drive, its encoders and the bus to it."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

from bowden.core.quantity import Quantity
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives import joint_encoder as joints
from bowden.hardware.drives import on_can
from bowden.hardware.drives.emergencies import emergency_text
from bowden.hardware.drives.scale import Scale
from bowden.rig.families import LOST, DriveNeeds

LONGEST_TIMEOUT = 40e-3
"""So that torque is zero `family.longest_silence` after our last heartbeat, with the drive's own delay; of a slow loop,
`family.LOST` cycles [s]."""
LOOK = 1e-3
"""How often a drive looks at its heartbeat consumer [s]."""


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
    motor_direction: on_can.MotorDirection = 1
    joint_counts_per_turn: joints.JointCounts = 16384.0
    joint_direction: joints.JointDirection = 1
    home: on_can.Home = "counts"
    motor_home: on_can.MotorHome = 0.0
    joint_home: joints.JointHome = 0.0
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
            "holding brake at bit 0 of the drive's digital outputs (60FEh); set: a 1 engages it (CiA 402); release: a "
            "1 releases it"
        ),
    ] = "none"
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
        Quantity("between the drive's heartbeats", "s", shown="ms", key="drive_heartbeat_ms", ge=1.0, le=1000.0),
    ] = 10e-3
    answer_timeout: on_can.AnswerTimeout = 0.3
    needs: DriveNeeds = DriveNeeds()

    @property
    def motor_step(self) -> float:
        """See `scale.motor_scale`."""
        return self.motor_direction * 2.0 * math.pi / (self.motor_counts_per_turn * self.needs.gear)

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`; all drives on a bus may have one host."""
        node, host = self.node_id, frames.HEARTBEAT + self.host_id
        to_it = frames.of_the_host(node, self.host_id) - {frames.NMT, frames.SYNC, host}
        functions = (frames.EMERGENCY, frames.TPDO1, frames.TPDO2, frames.TPDO3, frames.SDO_ANSWER, frames.HEARTBEAT)
        own = dict.fromkeys((*to_it, *(function + node for function in functions)), "node_id")
        return {**own, host: "host_id", **dict.fromkeys((frames.NMT, frames.SYNC), on_can.OF_ALL)}

    def rules(self) -> Iterator[on_can.Rule]:
        """See `on_can.require`."""
        cycle, timeout = round(1e3 * self.needs.sample_time, 9), self.heartbeat_timeout
        least = LOST * self.needs.sample_time
        longest = max(LONGEST_TIMEOUT, least)
        lost = "so that one lost frame does no harm"
        yield "host_id", self.host_id != self.node_id, "1 to 127, not the drive's node_id"
        yield "tension_zero", abs(self.tension_zero) < self.analog_range, "a voltage within analog_range_mv"
        yield "torque_scale", not (self.torque_scale and self.tension_scale), "0 where tension_n_per_mv is not"
        yield "sample_time", cycle % 1.0 == 0.0, "whole milliseconds, 1 or more, as the drive's interpolation time"
        yield "heartbeat_timeout", 0.0 < timeout <= longest, f"above 0, at most {1e3 * longest:g} ms"
        told = f"three cycles at least, {1e3 * least:g} ms, {lost}; left out, it follows"
        yield "heartbeat_timeout", least <= timeout, told
        fine = LOST * self.heartbeat_time <= timeout
        yield "heartbeat_time", fine, f"at most a third of heartbeat_timeout, {lost}"
        yield from on_can.rules_of_rig(self, (1e-3, 0.255))


def following(drive: DriveParameters) -> DriveParameters:
    """The parameters with a timeout long enough for the cycle, where they say none."""
    if not math.isnan(drive.heartbeat_timeout):
        return drive
    return drive._replace(heartbeat_timeout=max(LONGEST_TIMEOUT, LOST * drive.needs.sample_time))


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


def joint_scale(drive: DriveParameters, counts_at_home: int = 0) -> Scale:
    """The joint encoder's counts to the joint's angle."""
    step = drive.joint_direction * 2.0 * math.pi / drive.joint_counts_per_turn
    return Scale(step, drive.joint_home - step * counts_at_home)


FAMILY = on_can.family(
    DriveParameters(),
    "The CiA 402 drive on its CANopen bus; `bowden twin` plays it.",
    driver="drives.canopen_drive.CanopenDrive",
    node="twin.canopen_node.CanopenNode",
    probe="drives.canopen_drive.probe",
    options=("object",),
    follows=following,
    beats="drive_heartbeat_time",
    watchdog=lambda drive: drive.heartbeat_timeout + LOOK,
    scales=("motor_counts_per_turn", "motor_direction", "joint_counts_per_turn", "joint_direction"),
    explain=emergency_text,
    measures_tension=lambda drive: drive.tension_scale != 0.0,
    measures_torque=lambda drive: drive.torque_scale != 0.0,
    load_range=load_range,
    tared=tared,
    brakes=lambda drive: bool(drive.brake_output != "none"),
    brake_hint='drive.brake_output "set" or "release", as its manual has bit 0 of object 60FEh',
)
