"""CiA 402 over CANopen: the drive of `bowden.hardware.drives.canopen_drive`, played by `bowden.hardware.twin`."""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bowden.core.errors import ParameterError
from bowden.hardware.drives import on_can
from bowden.hardware.drives.emergencies import emergency_text
from bowden.hardware.drives.homing import zeroed
from bowden.hardware.drives.parameters import (
    LONGEST_TIMEOUT,
    DriveParameters,
    check_parameters,
    load_range,
    tared,
)
from bowden.rig.families import LOST, DriveFamily, DriveNeeds, FoundDevice, TwinProcess

LOOK = 1e-3
"""How often a drive looks at its heartbeat consumer [s]."""

if TYPE_CHECKING:
    from bowden.hardware.buses.link import Links
    from bowden.hardware.twin.plant import TwinPlant


def completed(given: DriveParameters, needs: DriveNeeds) -> DriveParameters:
    """The parameters with what the rig asks for.

    Raises:
        ParameterError: values that make no sense together.
    """
    asked = {name: value for name, value in needs._asdict().items() if name in DriveParameters._fields}
    parameters = given._replace(**asked)
    if math.isnan(parameters.heartbeat_timeout):
        parameters = parameters._replace(heartbeat_timeout=max(LONGEST_TIMEOUT, LOST * parameters.sample_time))
    check_parameters(parameters)
    if 2.0 * parameters.drive_heartbeat_time > needs.heartbeat_age:
        raise ParameterError(
            f"drive.drive_heartbeat_ms is {1e3 * given.drive_heartbeat_time:g}, and limits.heartbeat_age_s is "
            f"{needs.heartbeat_age:g}",
            expected="two heartbeats of the drive within that age, so that one lost frame does no harm",
            do="correct one of them",
        )
    return parameters


def twin(
    parameters: DriveParameters, plant: "TwinPlant", clock: Callable[[], float], options: Sequence[str]
) -> TwinProcess:
    """The digital twin; an option is an object of its dictionary that is otherwise, as ``6502:0=0x25``.

    Raises:
        ParameterError: an option that is none.
        DriveError: the bus cannot be used, or has a twin already.
    """
    from bowden.hardware.twin.canopen_node import CanopenNode
    from bowden.hardware.twin.twin import Twin

    check_parameters(parameters)
    overrides = dict(on_can.object_option(text) for text in options)
    place = on_can.node_place(parameters)
    return Twin(place, clock, lambda send, journal: CanopenNode(parameters, plant, send, journal, overrides))


def measures_tension(parameters: DriveParameters) -> bool:
    """Whether a sensor hangs on the drive's analog input."""
    return parameters.tension_scale != 0.0


def measures_torque(parameters: DriveParameters) -> bool:
    """Whether what hangs there measures the joint's torque."""
    return parameters.torque_scale != 0.0


def scales(parameters: DriveParameters) -> tuple[float, ...]:
    """Counts a turn and directions of both encoders."""
    return (
        *(parameters.motor_counts_per_turn, parameters.motor_direction),
        *(parameters.joint_counts_per_turn, parameters.joint_direction),
    )


def homed(parameters: DriveParameters) -> bool:
    """Whether home is where the counts are zero."""
    return parameters.home == "counts"


def probe(parameters: DriveParameters, links: "Links") -> list[FoundDevice]:
    """All CANopen devices that answer SDO."""
    from bowden.hardware.drives import canopen_probe  # with python-can and canopen

    return canopen_probe.probe(parameters, links)


def watchdog(parameters: DriveParameters) -> float:
    """The heartbeat consumer's time, and the millisecond in which the drive looks at it [s]."""
    return parameters.heartbeat_timeout + LOOK


FAMILY = DriveFamily(
    name="cia402",
    title="The CiA 402 drive on its CANopen bus; `bowden twin` plays it.",
    parameters=DriveParameters(),
    completed=completed,
    open=on_can.opening("canopen_drive.CanopenDrive"),
    twin=twin,
    moved=on_can.moved,
    address=on_can.address,
    control=on_can.control,
    claim=on_can.claim_host,
    watchdog=watchdog,
    most_push=on_can.pushing(),
    measures_tension=measures_tension,
    measures_torque=measures_torque,
    load_range=load_range,
    tared=tared,
    scales=scales,
    homed=homed,
    simulated=on_can.simulated,
    explain=emergency_text,
    probe=probe,
    zeroed=zeroed,
    brakes=lambda parameters: bool(parameters.brake_output != "none"),
    brake_hint='drive.brake_output "set" or "release", as its manual has bit 0 of object 60FEh',
)
