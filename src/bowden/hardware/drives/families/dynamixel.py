"""ROBOTIS Dynamixel, X and P series, protocol 2.0: what has to be known of a servo, of one on the joint, and the line.

Sources: ROBOTIS e-Manual, control tables of the X and P series; DynamixelSDK 4.1 (`dynamixel_easy_sdk/control_table`)
for numbers of models, addresses and counts of a turn, against which the tests hold what is here.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, NamedTuple

from bowden.core.quantity import Quantity
from bowden.hardware.drives import joint_encoder as joints
from bowden.hardware.drives import on_can
from bowden.hardware.drives import servo_table as servos
from bowden.hardware.drives.checklist import Setting, is_about
from bowden.hardware.drives.findings import finding_text
from bowden.hardware.drives.servo_table import ServoRegister, ServoSetup, ServoTable
from bowden.rig.families import LOST, DriveNeeds

WATCH_STEP = 20e-3
"""Of a count of the bus watchdog [s]."""
ERRORS: Mapping[int, str] = {
    0: "input voltage",
    1: "motor's Hall sensor",
    2: "overheating",
    3: "motor's encoder",
    4: "electrical shock, or not enough power",
    5: "overload",
    8: "the bus watchdog has run out: the servo stopped and held, as its host was silent",
}
"""Bit of an error → what it means (Hardware Error Status)."""

_REGISTERS: Mapping[str, ServoRegister] = {
    "Model Number": ServoRegister(0, 2),
    "Firmware Version": ServoRegister(6),
    "Return Delay Time": ServoRegister(9),
    "Drive Mode": ServoRegister(10),
    "Operating Mode": ServoRegister(11),
    "Homing Offset": ServoRegister(20, 4, signed=True),
    "Current Limit": ServoRegister(38, 2),
    "Torque Enable": ServoRegister(64),
    "Status Return Level": ServoRegister(68),
    "Hardware Error Status": ServoRegister(70),
    "Bus Watchdog": ServoRegister(98),
    "Goal Current": ServoRegister(102, 2, signed=True),
    "Profile Acceleration": ServoRegister(108, 4),
    "Profile Velocity": ServoRegister(112, 4),
    "Goal Position": ServoRegister(116, 4, signed=True),
    "Present Current": ServoRegister(126, 2, signed=True),
    "Present Position": ServoRegister(132, 4, signed=True),
    "Present Temperature": ServoRegister(146),
}
"""Of the X series; those of RAM stand `P_SERIES` further in the P series."""
MOVED = (52, 208)
"""Firmware of XL330 and XC330 from which on indirect data stand at 208, not at 224 (control tables of the SDK)."""
FIRST_OF_RAM, P_SERIES = 64, 448
_P_REGISTERS = {
    name: one._replace(address=one.address + P_SERIES * (one.address >= FIRST_OF_RAM))
    for name, one in _REGISTERS.items()
}


def _x(model: int, step: float) -> ServoTable:
    return ServoTable("dynamixel", _REGISTERS, model, 4096, step, 256 * 4096, 0, (168, 224), WATCH_STEP)


def _p(model: int, half: int) -> ServoTable:
    return ServoTable("dynamixel", _P_REGISTERS, model, 2 * half, 1e-3, (1 << 31) - 1, -half, (168, 634), WATCH_STEP)


MODELS: Mapping[str, ServoTable] = {
    **{name: _x(model, 2.69e-3) for name, model in (
        ("XM430-W210", 1030), ("XM430-W350", 1020), ("XM540-W150", 1130), ("XM540-W270", 1120),
        ("XH430-W210", 1010), ("XH430-W350", 1000), ("XH540-W150", 1110), ("XH540-W270", 1100),
        ("XD430-T210", 1011), ("XD430-T350", 1001), ("XD540-T150", 1111), ("XD540-T270", 1101),
        ("XW540-T140", 1180), ("XW540-T260", 1170),
    )},
    **{name: _x(model, 1.34e-3) for name, model in (("XH430-V210", 1050), ("XH430-V350", 1040))},
    **{name: _x(model, 1e-3)._replace(moved=MOVED) for name, model in (
        ("XL330-M077", 1190), ("XL330-M288", 1200), ("XC330-M181", 1230), ("XC330-M288", 1240),
        ("XC330-T181", 1210), ("XC330-T288", 1220),
    )},
    **{name: _p(model, half) for name, model, half in (
        ("PH42-020-S300", 2000, 303750), ("PH54-100-S500", 2010, 501923), ("PH54-200-S500", 2020, 501923),
        ("PM42-010-S260", 2100, 263187), ("PM54-040-S250", 2110, 251417), ("PM54-060-S250", 2120, 251417),
    )},
}  # fmt: skip
"""Name → its memory. XL430, XC430 and 2X tell no current and limit none: they are not here."""


class DynamixelParameters(NamedTuple):
    """A Dynamixel on a serial line, in SI and radians at the spool.

    angle of the spool = home + direction · 2π · (counts − counts at home) / (counts of a turn · gear)

    where counts are of the servo's own output shaft: gear is 1 with the spool on it.
    """

    family: Annotated[Literal["dynamixel"], Quantity("family of the drive")] = "dynamixel"
    interface: on_can.BusInterface = "bowden_unix"
    channel: on_can.BusChannel = "bowden"
    bitrate: Annotated[
        Literal[57600, 115200, 1000000, 2000000, 3000000, 4000000],
        Quantity("as it is set in every servo on the line", "bit/s"),
    ] = 1_000_000
    model: Annotated[
        Literal[
            "XM430-W210", "XM430-W350", "XM540-W150", "XM540-W270", "XH430-W210", "XH430-W350", "XH540-W150",
            "XH540-W270", "XD430-T210", "XD430-T350", "XD540-T150", "XD540-T270", "XW540-T140", "XW540-T260",
            "XH430-V210", "XH430-V350", "XL330-M077", "XL330-M288", "XC330-M181", "XC330-M288", "XC330-T181",
            "XC330-T288", "PH42-020-S300", "PH54-100-S500", "PH54-200-S500", "PM42-010-S260", "PM54-040-S250",
            "PM54-060-S250",
        ],
        Quantity("which servo, compared with the number that it tells"),
    ] = "XM430-W350"  # fmt: skip
    node_id: servos.ServoNumber = 1
    return_delay: servos.ReturnDelay = 0.0
    motor_direction: on_can.MotorDirection = 1
    home: on_can.HintedHome = "counts"
    motor_home: on_can.MotorHome = 0.0
    motor_hint: on_can.MotorHint = 0.0
    watchdog: Annotated[
        float,
        Quantity(
            "silence after which the servo stops and holds (Bus Watchdog), 20 or 40 ms",
            "s",
            shown="ms",
            ge=20.0,
            le=40.0,
        ),
    ] = 40e-3
    no_limb: on_can.NoLimb = False
    joint: servos.JointServo = "servo"
    joint_node_id: joints.JointNode = 2
    joint_direction: joints.JointDirection = 1
    joint_home: joints.JointHome = 0.0
    answer_timeout: on_can.AnswerTimeout = 0.1
    needs: DriveNeeds = DriveNeeds(gear=1.0, torque_constant=1.78, sample_time=5e-3)

    @property
    def table(self) -> ServoTable:
        """Its memory."""
        return MODELS[self.model]

    @property
    def motor_step(self) -> float:
        """See `scale.motor_scale`."""
        return servos.motor_step(self)

    def identifiers(self) -> dict[int, str]:
        """See `on_can.collision`."""
        return servos.identifiers(self)

    def rules(self) -> Iterator[on_can.Rule]:
        """See `on_can.require`."""
        steps = self.watchdog / WATCH_STEP
        least = LOST * self.needs.sample_time
        yield (
            "watchdog",
            abs(steps - round(steps)) < 1e-6 and self.watchdog >= least - 1e-9,
            (f"20 or 40 ms, and three cycles, {1e3 * least:g} ms, at least: a cycle of up to 13.3 ms"),
        )
        yield from servos.rules(self)

    @property
    def setup(self) -> ServoSetup:
        """What it asks of the servos; an X series is in current-based position (5), a P series, which has no other, in
        extended position (4)."""
        wizard, table, limit = "set it with Dynamixel Wizard", self.table, self.needs.current_limit
        based = table.lowest == 0
        mode, named = (5, "current-based position") if based else (4, "extended position")
        joint = (
            servos.delay_setting(self),
            Setting(
                "Drive Mode",
                is_about(0.0),
                "0: its own direction, velocity-based profile",
                "turns its direction or its profile",
                "set it with Dynamixel Wizard; motor_direction in [drive] turns the direction",
            ),
        )
        most = limit / table.current_step
        own_limit = Setting(
            "Current Limit",
            lambda found: found <= most + 1.0,
            f"{most:.0f}, the rig's {limit:g} A, or less",
            "may draw more than the rig allows",
            wizard,
        )
        of_mode = Setting("Operating Mode", is_about(mode), f"{mode}, {named}", "is in another mode", wizard)
        watch = round(self.watchdog / WATCH_STEP)
        return ServoSetup(
            motor=(of_mode, *joint, *((own_limit,) if limit and not based else ())),
            joint=joint,
            preset={
                **{"Profile Acceleration": 0, "Profile Velocity": 0},
                **({"Goal Current": round(most)} if limit and based else {}),
                "Bus Watchdog": watch,
            },
            watch=watch,
            as_new={
                "Model Number": table.model,
                "Firmware Version": 48,
                "Return Delay Time": round(self.return_delay / servos.DELAY_STEP),
                "Operating Mode": mode,
                "Current Limit": round((limit or 3.0) / table.current_step) + 1,
                "Status Return Level": 2,
            },
            names={one.model: name for name, one in MODELS.items()},
        )


def error_text(code: int) -> str:
    """What an error means."""
    if said := finding_text(code):
        return said
    said = ", ".join(text for bit, text in ERRORS.items() if code >> bit & 1) or "unknown"
    end = "; it ends with a restart, which an acknowledgement sends and after which the servo is brought up again"
    return f"0x{code:02X}: {said}{end if code & 0xFF else ''}"


FAMILY = servos.family(
    DynamixelParameters(),
    "A ROBOTIS Dynamixel, X or P series, and one on the joint; `bowden twin` plays both.",
    node="twin.servo_node.ServoNode",
    watchdog=lambda drive: drive.watchdog + 1e-3,
    explain=error_text,
    unseen_watch=(
        "a Dynamixel's bus watchdog stops the motor and holds it there: it keeps torque when this computer dies, until "
        "its supply is cut"
    ),
    example={
        "servo": {"speed_limit_deg_per_s": 276.0},
        "motor": {"gear": 1.0, "torque_constant_nm_per_a": 1.78, "resistance_ohm": 5.2, "current_limit_a": 2.0},
        "limits": {"thermal_continuous_current_a": 1.0},
    },
    zero_hint="A Dynamixel knows its place within a turn of its output shaft after a loss of its supply; in which turn "
    'is told by home = "hint".',
)
