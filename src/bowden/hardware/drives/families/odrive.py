"""ODrive boards on classic CAN (CANSimple): `hardware.drives.odrive_drive`, played by `hardware.twin.odrive_node`."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bowden.core.errors import ParameterError
from bowden.hardware.drives import on_can
from bowden.hardware.drives.homing import zeroed
from bowden.hardware.drives.odrive_faults import fault_text
from bowden.hardware.drives.odrive_parameters import (
    LOOK,
    OdriveParameters,
    check_parameters,
    completed,
    found_from,
)
from bowden.rig.families import DriveFamily, FoundDevice, TwinProcess

if TYPE_CHECKING:
    from bowden.hardware.buses.link import Links
    from bowden.hardware.twin.plant import TwinPlant


def twin(
    parameters: OdriveParameters, plant: "TwinPlant", clock: Callable[[], float], options: Sequence[str]
) -> TwinProcess:
    """The digital twin; an option is a setting of the board that is otherwise, as ``axis0.config.enable_watchdog=0``,
    or an object of the joint's encoder, as ``6501:0=8192``.

    Raises:
        ParameterError: an option that is none, or no list of the board's endpoints.
        DriveError: the bus cannot be used, or has a twin already.
    """
    from bowden.hardware.twin.odrive_node import OdriveNode
    from bowden.hardware.twin.twin import Twin

    check_parameters(parameters)
    of_board = dict(_override(text) for text in options if ":" not in text)
    of_joint = dict(on_can.object_option(text) for text in options if ":" in text)
    place = on_can.node_place(parameters)
    return Twin(place, clock, lambda send, journal: OdriveNode(parameters, plant, send, journal, of_board, of_joint))


def _override(text: str) -> tuple[str, float | None]:
    """``axis0.config.watchdog_timeout=0.1``; ``none`` takes it away."""
    name, equals, said = text.partition("=")
    try:
        value = None if said == "none" else float(said)
    except ValueError:
        equals = ""
    if not equals or not name:
        raise ParameterError(f"--object is {text!r}", expected="like axis0.config.enable_watchdog=0, or 6501:0=8192")
    return name, value


def scales(parameters: OdriveParameters) -> tuple[object, ...]:
    """What makes angles of both positions."""
    return (
        *(parameters.motor_direction, parameters.joint),
        *(parameters.joint_counts_per_turn, parameters.joint_direction),
    )


def probe(parameters: OdriveParameters, links: "Links") -> Sequence[FoundDevice]:
    """All drives of this family on the bus."""
    from bowden.hardware.drives import odrive_probe  # with python-can

    return odrive_probe.probe(parameters, links)


FAMILY = DriveFamily(
    name="odrive",
    title="An ODrive board on classic CAN, and the joint's encoder beside it; `bowden twin` plays both.",
    parameters=OdriveParameters(),
    completed=completed,
    open=on_can.opening("odrive_drive.OdriveDrive"),
    twin=twin,
    moved=on_can.moved,
    address=on_can.address,
    control=on_can.control,
    claim=on_can.claim_host,
    watchdog=lambda parameters: parameters.watchdog + LOOK,
    most_push=on_can.pushing(),
    measures_tension=lambda _: False,
    scales=scales,
    homed=lambda parameters: parameters.home != "here",
    simulated=on_can.simulated,
    explain=fault_text,
    measures_joint=lambda parameters: parameters.joint != "none",
    probe=probe,
    zeroed=zeroed,
    found_from=found_from,
    zero_hint="An ODrive board knows its place within a turn of its rotor after a loss of its supply, if its "
    'encoder is absolute; which turn is told by home = "hint". Until then it is told where it is by '
    "Set_Absolute_Position, or axis0.set_abs_pos(TURNS) in odrivetool.",
)
