"""What families of drives on a CAN bus have in common, whatever they speak: where they are, and who is their host.

Their parameters have the fields `interface`, `channel`, `bitrate` and `node_id`, with CAN-FD `data_bitrate` too, and a
method `identifiers`, see `collision`.
"""

import importlib
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity, declared
from bowden.hardware.buses.node_place import NodePlace

if TYPE_CHECKING:
    from bowden.hardware.buses.link import BusPlace, Links
    from bowden.hardware.ports import Drive
    from bowden.rig.families import DriveNeeds

BusInterface = Annotated[
    str, Quantity("python-can's name of the bus: bowden_unix for the twin, socketcan on a rig; others are untried")
]
BusChannel = Annotated[str, Quantity("its channel: can0; of bowden_unix a folder, or a bare name")]
"""A bare name is a folder in the user's temporary one."""
BusBitrate = Annotated[int, Quantity("of the bus; SocketCAN takes its interface's own", "bit/s", gt=0)]
AnswerTimeout = Annotated[float, Quantity("longest wait for an answer at bring-up", "s", shown="ms", gt=0.0, le=1e4)]


MOST_PUSH = 0.5
"""Largest torque offset, as a share of what the largest current gives: the drive's position loop must be able to beat
it."""
_ELSEWHERE = {
    "sample_time": Quantity("", "s", shown="ms", key="bench.sample_time_ms"),
    "gear": Quantity("", key="motor.gear"),
    "torque_constant": Quantity("", "N·m/A", key="motor.torque_constant_nm_per_a"),
    "current_limit": Quantity("", "A", key="motor.current_limit_a"),
    "lowest_motor": Quantity("", "rad", key="limits.motor_low_deg"),
    "highest_motor": Quantity("", "rad", key="limits.motor_high_deg"),
}
"""Parameters that other sections of a rig say."""
Rule = tuple[str, bool, str]
"""Name of a parameter, whether it is right, and what was expected."""


def most_push(drive: Any) -> float:
    """Largest torque offset that is allowed, at the spool; infinite where no current is asked for [N·m]."""
    push: float = MOST_PUSH * drive.gear * drive.torque_constant * (drive.current_limit or math.inf)
    return push


def rules_of_limits(drive: Any) -> tuple[Rule, ...]:
    """What must hold of the limits that a rig asks a drive for, where its largest push follows from its current."""
    strongest = most_push(drive)
    at_least_0 = [name for name in ("speed_limit", "following_error", "current_limit") if hasattr(drive, name)]
    return (
        ("highest_motor", drive.lowest_motor < drive.highest_motor, "more than lowest_motor"),
        *((name, 0.0 <= getattr(drive, name) < math.inf, "0 or more") for name in at_least_0),
        (
            "torque_offset",
            0.0 <= drive.torque_offset <= strongest and math.isfinite(drive.torque_offset),
            f"0 to {strongest:.4g} N·m, half of what the largest current gives",
        ),
        ("answer_timeout", 0.01 <= drive.answer_timeout <= 10.0, "from 0.01 to 10 s"),
    )


def require(drive: Any, rules: Iterable[Rule]) -> None:
    """Refuse parameters of a drive that break a rule.

    Raises:
        ParameterError: the first that does, with what was expected.
    """
    quantities = {one.name: one.quantity for one in declared(type(drive))} | _ELSEWHERE
    for name, fine, expected in rules:
        if not fine:
            value, quantity = getattr(drive, name), quantities.get(name, Quantity(""))
            shown = f"{value / quantity.factor:.6g}" if isinstance(value, float) else repr(value)
            raise ParameterError(
                f"drive: {quantity.named(name)} is {shown}", expected=expected, do="correct it in the rig"
            )


def opening(driver: str) -> "Callable[[Any, Links], Drive]":
    """What opens a drive by a class of this package, as ``ak_drive.AkDrive``, which is imported with python-can."""
    module, _, name = driver.partition(".")

    def open_drive(parameters: Any, links: "Links") -> "Drive":
        drive: Drive = getattr(importlib.import_module(f"{__package__}.{module}"), name)(parameters, links)
        return drive

    return open_drive


def pushing(most: Callable[[Any], float] = most_push) -> "Callable[[Any, DriveNeeds], float]":
    """The largest torque offset of a rig's drive, of that of the parameters which it makes complete [N·m]."""

    def largest(parameters: Any, needs: "DriveNeeds") -> float:
        asked = {"gear": needs.gear, "torque_constant": needs.torque_constant, "current_limit": needs.current_limit}
        return most(parameters._replace(**asked))

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


OF_ALL = ""
"""In place of a key: what all nodes of a network share."""
_SHARED = frozenset({OF_ALL, "host_id", "reply_id"})
"""Keys whose frames two drives may have in common."""


class Device(NamedTuple):
    """Another device on a bus, of classic CAN, for `collision`."""

    interface: str
    channel: str
    bitrate: int
    taken: dict[int, str]
    """Identifier → key with its section."""

    def identifiers(self) -> dict[int, str]:
        """Of its frames."""
        return self.taken


def collision(one: Any, other: Any) -> str:
    """What keeps two drives from being on one bus, where they are; empty of others.

    Their frames must differ: a drive whose number is that of another one's encoder would be led by that one's joint.
    `identifiers` of their parameters says which there are: identifier → key of [drive] that it follows from.

    Args:
        one: parameters of a drive, or a `Device`.
        other: those of another, of any family.
    """
    if any(getattr(one, key, None) != getattr(other, key, "") for key in ("interface", "channel")):
        return ""
    rates = [(getattr(drive, "bitrate", 0), getattr(drive, "data_bitrate", 0)) for drive in (one, other)]
    if rates[0] != rates[1]:
        said = " and ".join(f"{slow} bit/s{f' with CAN-FD at {quick} bit/s' if quick else ''}" for slow, quick in rates)
        return f"share the bus {one.channel}, but speak at {said}: name another channel"
    ours, theirs = (drive.identifiers() if hasattr(drive, "identifiers") else {} for drive in (one, other))
    for identifier in sorted({*ours} & {*theirs}):
        keys = ours[identifier], theirs[identifier]
        if keys[0] != keys[1] or keys[0] not in _SHARED:
            said = " and ".join((key if "." in key else f"drive.{key}") if key else "the network" for key in keys)
            return f"share the bus {one.channel}, and {said} make the same frames ({identifier:03X}h)"
    return ""


def place(parameters: Any) -> "BusPlace":
    """Which bus."""
    from bowden.hardware.buses.link import BusPlace  # with python-can

    return BusPlace(parameters.interface, parameters.channel, parameters.bitrate)


def node_place(parameters: Any) -> NodePlace:
    """Where the twin of this node is."""
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
