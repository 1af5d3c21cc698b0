"""Feetech STS3215: what has to be known of a servo, of one on the joint, and the line.

Sources: Feetech, memory table of the SMS and STS series, as huggingface/lerobot has it
(`lerobot/motors/feetech/tables.py`: addresses, sizes, sign and magnitude, model numbers, bits of the status).
"""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, NamedTuple

from bowden.core.quantity import Quantity
from bowden.hardware.drives import joint_encoder as joints
from bowden.hardware.drives import on_can
from bowden.hardware.drives import servo_table as servos
from bowden.hardware.drives.checklist import Setting, is_about
from bowden.hardware.drives.findings import finding_text
from bowden.hardware.drives.servo_table import ServoRegister, ServoSetup, ServoTable
from bowden.rig.families import DriveNeeds

ERRORS: Mapping[int, str] = {0: "voltage", 1: "position sensor", 2: "overheating", 3: "over-current", 5: "overload"}
"""Bit of the status → what it means."""

TABLE = ServoTable(
    "feetech",
    {
        "Firmware Version": ServoRegister(0),
        "Model Number": ServoRegister(3, 2),
        "Return Delay Time": ServoRegister(7),
        "Status Return Level": ServoRegister(8),
        "Min Position Limit": ServoRegister(9, 2),
        "Max Position Limit": ServoRegister(11, 2),
        "Max Torque Limit": ServoRegister(16, 2),
        "Operating Mode": ServoRegister(33),
        "Torque Enable": ServoRegister(40),
        "Acceleration": ServoRegister(41),
        "Goal Position": ServoRegister(42, 2, signed=True, sign=15),
        "Goal Time": ServoRegister(44, 2),
        "Goal Velocity": ServoRegister(46, 2, signed=True, sign=15),
        "Torque Limit": ServoRegister(48, 2),
        "Present Position": ServoRegister(56, 2, signed=True, sign=15),
        "Present Temperature": ServoRegister(63),
        "Hardware Error Status": ServoRegister(65),
        "Present Current": ServoRegister(69, 2, signed=True, sign=15),
    },
    model=777,
    turn=4096,
    current_step=6.5e-3,
    furthest=32767,
    multi_turn=False,
)
"""Names are those of Dynamixel where a register is the same; the status is the hardware error status."""


class FeetechParameters(NamedTuple):
    """A Feetech servo on a serial line, in SI and radians at the spool.

    angle of the spool = home + direction · 2π · (counts − counts at home) / (4096 · gear)

    where counts are of the servo's own output shaft: gear is 1 with the spool on it. It stays within a turn.
    """

    family: Annotated[Literal["feetech"], Quantity("family of the drive")] = "feetech"
    interface: on_can.BusInterface = "bowden_unix"
    channel: on_can.BusChannel = "bowden"
    bitrate: Annotated[
        Literal[115200, 250000, 500000, 1000000], Quantity("as it is set in every servo on the line", "bit/s")
    ] = 1_000_000
    model: Annotated[Literal["STS3215"], Quantity("which servo, compared with the number that it tells")] = "STS3215"
    node_id: servos.ServoNumber = 1
    torque_limit: Annotated[
        float, Quantity("share of its largest torque, set at bring-up (Torque Limit)", gt=0.0, le=1.0)
    ] = 0.5
    return_delay: servos.ReturnDelay = 0.0
    motor_direction: on_can.MotorDirection = 1
    home: on_can.Home = "counts"
    motor_home: on_can.MotorHome = 0.0
    no_limb: on_can.NoLimb = False
    joint: servos.JointServo = "servo"
    joint_node_id: joints.JointNode = 2
    joint_direction: joints.JointDirection = 1
    joint_home: joints.JointHome = 0.0
    answer_timeout: on_can.AnswerTimeout = 0.1
    needs: DriveNeeds = DriveNeeds(gear=1.0, torque_constant=1.1, sample_time=5e-3)

    @property
    def table(self) -> ServoTable:
        """Its memory."""
        return TABLE

    @property
    def motor_step(self) -> float:
        """See `scale.motor_scale`."""
        return servos.motor_step(self)

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`."""
        return servos.identifiers(self)

    def rules(self) -> Iterator[on_can.Rule]:
        """See `on_can.require`."""
        yield from servos.rules(self)

    @property
    def setup(self) -> ServoSetup:
        """What it asks of the servos."""
        mode = Setting(
            "Operating Mode", is_about(0.0), "0, position", "is in another mode", "set it with its maker's tool"
        )
        joint = (servos.delay_setting(self),)
        largest = {"Torque Limit": round(1000.0 * self.torque_limit)}
        return ServoSetup(
            motor=(mode, *joint),
            joint=joint,
            preset={"Acceleration": 0, "Goal Time": 0, "Goal Velocity": 0, **largest},
            as_new={
                "Firmware Version": 3,
                "Model Number": self.table.model,
                "Return Delay Time": round(self.return_delay / servos.DELAY_STEP),
                "Status Return Level": 1,
                "Max Position Limit": 4095,
                "Max Torque Limit": 1000,
                "Torque Limit": 1000,
            },
            names={TABLE.model: "STS3215"},
        )


def error_text(code: int) -> str:
    """What a status means."""
    said = ", ".join(text for bit, text in ERRORS.items() if code >> bit & 1) or "unknown"
    return finding_text(code) or f"0x{code:02X}: {said}"


FAMILY = servos.family(
    FeetechParameters(),
    "A Feetech STS3215, and one on the joint; `bowden twin` plays both.",
    node="twin.servo_node.FeetechNode",
    watchdog=lambda drive: math.inf,
    explain=error_text,
    unseen_watch=(
        "a Feetech servo has no watchdog over its host: it keeps its last target, with torque, when this computer "
        "dies, until its supply is cut"
    ),
    example={
        "servo": {"speed_limit_deg_per_s": 300.0},
        "motor": {"gear": 1.0, "torque_constant_nm_per_a": 1.1, "resistance_ohm": 4.5, "current_limit_a": 1.5},
        "limits": {"thermal_continuous_current_a": 0.8},
    },
    zero_hint="An STS3215 takes the present place for its middle, 2048, with its maker's tool; bowden does not send "
    "it. Zero the rig anew after that.",
)
