"""mjbots moteus boards over CAN-FD: `hardware.drives.moteus_drive`, played by `hardware.twin.moteus_node`."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.core.errors import ParameterError
from bowden.hardware.drives.family import DriveFamily, DriveNeeds, TwinProcess
from bowden.hardware.drives.moteus_faults import fault_text
from bowden.hardware.drives.moteus_parameters import LOOK, MoteusParameters, check_parameters, completed, most_push
from bowden.hardware.ports import Drive

if TYPE_CHECKING:
    from bowden.hardware.buses.link import Links
    from bowden.hardware.twin.plant import TwinPlant


def open_drive(parameters: MoteusParameters, links: "Links") -> Drive:
    """The drive on its bus."""
    from bowden.hardware.drives.moteus_drive import MoteusDrive  # with python-can

    return MoteusDrive(parameters, links)


def twin(
    parameters: MoteusParameters, plant: "TwinPlant", clock: Callable[[], float], options: Sequence[str]
) -> TwinProcess:
    """The digital twin; an option is a register or a setting that is otherwise, as ``0x102=4``.

    Raises:
        ParameterError: an option that is none.
        DriveError: the bus cannot be used, or has a twin already.
    """
    from bowden.hardware.twin.moteus_node import MoteusNode
    from bowden.hardware.twin.twin import NodePlace, Twin

    check_parameters(parameters)
    overrides = dict(_override(text) for text in options)
    place = NodePlace(
        parameters.interface,
        parameters.channel,
        parameters.bitrate,
        parameters.node_id,
        fd=True,
        data_bitrate=parameters.data_bitrate,
    )
    return Twin(place, clock, lambda send, journal: MoteusNode(parameters, plant, send, journal, overrides))


def _override(text: str) -> tuple[int | str, float | None]:
    """``0x102=4``, ``servo.timeout_mode=12``; ``none`` takes it away."""
    name, equals, said = text.partition("=")
    try:
        value = None if said == "none" else float(said)
        key: int | str = int(name, 16) if name.startswith("0x") else name
    except ValueError:
        equals = ""
    if not equals or not name:
        raise ParameterError(f"--object is {text!r}", expected="like 0x102=4, or servo.timeout_mode=12")
    return key, value


def moved(parameters: MoteusParameters, channel: str | None, interface: str | None) -> MoteusParameters:
    """The same drive on another bus."""
    return parameters._replace(
        channel=parameters.channel if channel is None else channel,
        interface=parameters.interface if interface is None else interface,
    )


def address(parameters: MoteusParameters) -> Mapping[str, str]:
    """Bus and number."""
    return {"interface": parameters.interface, "channel": parameters.channel, "node": str(parameters.node_id)}


def control(parameters: MoteusParameters) -> Path:
    """Socket of the twin of this node."""
    from bowden.hardware.twin.control import control_path  # with python-can

    return control_path(parameters.interface, parameters.channel, parameters.node_id)


def claim_host(parameters: MoteusParameters) -> Callable[[], None]:
    """Be the bus' one master.

    Raises:
        DriveError: there is one.
    """
    from bowden.hardware.buses.opening import claim

    return claim(parameters.interface, parameters.channel, "host").release


def largest_push(parameters: MoteusParameters, needs: DriveNeeds) -> float:
    """Half of what the largest current gives [N·m]."""
    return most_push(
        parameters._replace(gear=needs.gear, torque_constant=needs.torque_constant, current_limit=needs.current_limit)
    )


def scales(parameters: MoteusParameters) -> tuple[float, ...]:
    """What makes angles of both positions."""
    return (
        *(parameters.output_ratio, parameters.motor_direction),
        *(float(parameters.joint_source), parameters.joint_direction),
    )


def simulated(parameters: MoteusParameters) -> bool:
    """Whether its bus is one between processes, which no wire leads to."""
    from bowden.hardware.buses.opening import UNIX  # with python-can

    return parameters.interface == UNIX


FAMILY = DriveFamily(
    name="moteus",
    title="A mjbots moteus board on CAN-FD, with the joint's encoder at its auxiliary port; `bowden twin` plays it.",
    parameters=MoteusParameters(),
    completed=completed,
    open=open_drive,
    twin=twin,
    moved=moved,
    address=address,
    control=control,
    claim=claim_host,
    watchdog=lambda parameters: parameters.watchdog + LOOK,
    most_push=largest_push,
    measures_tension=lambda _: False,
    scales=scales,
    homed=lambda parameters: parameters.home == "counts",
    simulated=simulated,
    explain=fault_text,
)
