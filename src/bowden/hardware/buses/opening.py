"""Opening a CAN bus by name, and seeing to it that it has one master."""

import errno
import hashlib
import logging
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import can

from bowden.core.errors import DriveError
from bowden.hardware.buses.place import BusPlace
from bowden.hardware.buses.unix_bus import ERROR, EXTENDED, FRAME, REMOTE, UnixBus, bus_folder

UNIX = "bowden_unix"
"""Interface of the bus between processes."""


class BusClaim(NamedTuple):
    """A part on a bus that one process alone may play; let go of with `release`, or when the process ends."""

    holder: socket.socket

    def release(self) -> None:
        """Let another process have it."""
        self.holder.close()


def claim(interface: str, channel: str, part: str) -> BusClaim:
    """Claim a part on a bus, by an abstract Unix socket: the system forgets it with its process, however that ends.

    Args:
        interface: the bus' interface.
        channel: its channel.
        part: ``host``, or a node.

    Raises:
        DriveError: another process plays it already.
    """
    where = os.path.realpath(bus_folder(channel)) if interface == UNIX else channel
    holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        name = hashlib.sha256(f"{interface}:{where}:{part}".encode()).hexdigest()
        holder.bind(f"\0bowden-{name}")
    except OSError as error:
        holder.close()
        raise DriveError(
            f"the bus {channel} ({interface}) has a {part} already",
            expected=f"one {part} on it",
            do="end the other run first, or name another channel in [drive]",
        ) from error
    return BusClaim(holder)


def taker(bus: can.BusABC) -> Callable[[], tuple[int, bytes] | None]:
    """The quickest way to frames that are there: identifier with the flags of `unix_bus`, and data; None of none."""
    if isinstance(bus, UnixBus):
        return bus.take

    def take() -> tuple[int, bytes] | None:
        message = bus.recv(0.0)
        if message is None:
            return None
        flags = EXTENDED * message.is_extended_id | REMOTE * message.is_remote_frame | ERROR * message.is_error_frame
        return message.arbitration_id | flags, bytes(message.data)

    return take


def putter(bus: can.BusABC, *, fd: bool) -> Callable[[int, bytes], None]:
    """The quickest way to send a frame: identifier with the flags of `unix_bus`, and data, of a remote frame as many
    bytes as it asks for; it raises what `bus.send` does.

    Args:
        bus: open.
        fd: whether frames go out as those of CAN-FD, with their data at the higher bit rate.
    """
    if type(bus) is UnixBus:
        return bus.put
    made: dict[int, can.Message] = {}  # one for each identifier: to make one takes longer than to fill it

    def put(identifier: int, data: bytes) -> None:
        message = made.get(identifier)
        if message is None:
            message = made[identifier] = can.Message(
                arbitration_id=identifier & 0x1FFF_FFFF,
                is_extended_id=bool(identifier & EXTENDED),
                is_remote_frame=bool(identifier & REMOTE),
                is_fd=fd,
                bitrate_switch=fd,
            )
        message.dlc = len(data)
        if not message.is_remote_frame:
            message.data = bytearray(data)
        bus.send(message)

    return put


def quieten() -> None:
    """Let the CAN library print nothing: what it logs is raised as well, and said in our own words."""
    logger = logging.getLogger("can")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())


def open_bus(place: BusPlace, *, create: bool = False) -> can.BusABC:
    """The bus, ready to send and receive.

    Args:
        place: of the bus; its bit rates count where the interface can set them.
        create: whether a `bowden_unix` bus is made where there is none.

    Raises:
        DriveError: an unknown interface, a bus that is not there or cannot be opened, or one of classic CAN where
            CAN-FD is asked for.
    """
    quieten()
    interface, channel = place.interface, place.channel
    try:
        if interface == UNIX:
            return UnixBus(channel, create=create, fd=place.fd)
        if place.fd:
            return _open_fd(place)
        return can.Bus(channel, interface=interface, bitrate=place.bitrate)
    except DriveError:
        raise
    except Exception as error:  # python-can's interfaces raise whatever their makers' libraries do
        if interface not in (UNIX, *can.VALID_INTERFACES):
            raise DriveError(
                f"there is no CAN interface {interface!r}",
                expected="socketcan, bowden_unix, or another one of python-can's, which nobody has tried",
                do="correct [drive]",
            ) from error
        number = getattr(error, "errno", None)
        do = _REMEDIES.get(interface, _UNTRIED).format(channel=channel)
        if number == errno.EAFNOSUPPORT:
            do = "this kernel has no CAN: load its module can_raw, or use bowden_unix"
        reason = os.strerror(number) if isinstance(error, OSError) and number else str(error)
        raise DriveError(f"cannot open the bus {channel} ({interface}): {reason}", do=do) from error


def _open_fd(place: BusPlace) -> can.BusABC:
    """A bus for CAN-FD.

    Raises:
        DriveError: its interface carries classic CAN alone.
    """
    interface, channel, bitrate, _, data_bitrate = place
    if interface == "socketcan" and _longest_frame(channel) == FRAME.size:
        raise DriveError(
            f"the interface {channel} carries classic CAN alone, and the drive speaks CAN-FD",
            expected="an adapter for CAN-FD, set up for it",
            do=f"ip link set {channel} down; ip link set {channel} up type can bitrate {bitrate} "
            f"dbitrate {data_bitrate} fd on",
        )
    try:
        bus = can.Bus(channel, interface=interface, bitrate=bitrate, data_bitrate=data_bitrate, fd=True)
    except (TypeError, NotImplementedError) as error:  # whose bus has no such argument
        raise _no_fd(interface) from error
    if bus.protocol not in (can.CanProtocol.CAN_FD, can.CanProtocol.CAN_FD_NON_ISO):
        bus.shutdown()
        raise _no_fd(interface)
    return bus


def _no_fd(interface: str) -> DriveError:
    return DriveError(
        f"the interface {interface!r} of python-can carries classic CAN alone, and the drive speaks CAN-FD",
        expected="one that opens with fd=True",
        do='set interface = "socketcan" in [drive], with an adapter for CAN-FD',
    )


def _longest_frame(channel: str) -> int:
    """Size of the largest frame that a network interface carries [bytes]; 0 where there is none of that name."""
    try:
        return int(Path("/sys/class/net", channel, "mtu").read_text())
    except (OSError, ValueError):
        return 0


_REMEDIES = {
    UNIX: "start bowden twin, run with a twin of its own (--twin), or name your CAN bus in [drive]",
    "socketcan": "try: ip link set {channel} up",
}
"""Interface → what to do when its bus cannot be opened."""
_UNTRIED = (
    'check its adapter and driver; or set interface = "socketcan" and channel = "can0" in [drive], which Linux has for '
    "most adapters, and which is the only one that is meant for a rig"
)
