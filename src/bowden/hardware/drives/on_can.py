"""What families of drives on a CAN bus have in common, whatever they speak: where they are, and who is their host.

Their parameters have the fields `interface`, `channel`, `bitrate` and `node_id`.
"""

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity

if TYPE_CHECKING:
    from bowden.hardware.buses.link import BusPlace, Links
    from bowden.hardware.drives.family import DriveNeeds
    from bowden.hardware.ports import Drive
    from bowden.hardware.twin.twin import NodePlace

BusInterface = Annotated[
    str, Quantity("python-can's name of the bus: bowden_unix for the twin, socketcan on a rig; others are untried")
]
BusChannel = Annotated[str, Quantity("its channel: can0; of bowden_unix a folder, or a bare name")]
"""A bare name is a folder in the user's temporary one."""
BusBitrate = Annotated[int, Quantity("of the bus; SocketCAN takes its interface's own", "bit/s", gt=0)]
AnswerTimeout = Annotated[float, Quantity("longest wait for an answer at bring-up", "s", shown="ms", gt=0.0, le=1e4)]


def opening(driver: str) -> "Callable[[Any, Links], Drive]":
    """What opens a drive by a class of this package, as ``ak_drive.AkDrive``, which is imported with python-can."""
    module, _, name = driver.partition(".")

    def open_drive(parameters: Any, links: "Links") -> "Drive":
        drive: Drive = getattr(importlib.import_module(f"{__package__}.{module}"), name)(parameters, links)
        return drive

    return open_drive


def pushing(most_push: Callable[[Any], float]) -> "Callable[[Any, DriveNeeds], float]":
    """The largest torque offset of a rig's drive, of that of the parameters which it makes complete [N·m]."""

    def largest(parameters: Any, needs: "DriveNeeds") -> float:
        asked = {"gear": needs.gear, "torque_constant": needs.torque_constant, "current_limit": needs.current_limit}
        return most_push(parameters._replace(**asked))

    return largest


def moved(parameters: Any, channel: str | None, interface: str | None) -> Any:
    """The same drive on another bus."""
    return parameters._replace(
        channel=parameters.channel if channel is None else channel,
        interface=parameters.interface if interface is None else interface,
    )


def address(parameters: Any) -> Mapping[str, str]:
    """Bus and number."""
    return {"interface": parameters.interface, "channel": parameters.channel, "node": str(parameters.node_id)}


def place(parameters: Any) -> "BusPlace":
    """Which bus."""
    from bowden.hardware.buses.link import BusPlace  # with python-can

    return BusPlace(parameters.interface, parameters.channel, parameters.bitrate)


def node_place(parameters: Any) -> "NodePlace":
    """Where the twin of this node is."""
    from bowden.hardware.twin.twin import NodePlace  # with python-can

    return NodePlace(parameters.interface, parameters.channel, parameters.bitrate, parameters.node_id)


def control(parameters: Any) -> Path:
    """Socket of the twin of this node."""
    from bowden.hardware.twin.control import control_path  # with python-can

    return control_path(parameters.interface, parameters.channel, parameters.node_id)


def claim_host(parameters: Any) -> Callable[[], None]:
    """Be the bus' one master.

    Raises:
        DriveError: there is one.
    """
    from bowden.hardware.buses.opening import claim

    return claim(parameters.interface, parameters.channel, "host").release


def simulated(parameters: Any) -> bool:
    """Whether its bus is one between processes, which no wire leads to."""
    from bowden.hardware.buses.opening import UNIX  # with python-can

    return bool(parameters.interface == UNIX)


def object_option(text: str) -> tuple[tuple[int, int], int | None]:
    """What ``bowden twin --object`` says of a CANopen twin, ``INDEX:SUB=VALUE`` with a hexadecimal index.

    Raises:
        ParameterError: it is none.
    """
    try:
        key, value = text.split("=")
        index, sub = key.split(":")
        return (int(index, 16), int(sub)), None if value == "none" else int(value, 0)
    except ValueError as error:
        raise ParameterError(f"--object is {text!r}", expected="like 6502:0=0x25, or 6502:0=none") from error
