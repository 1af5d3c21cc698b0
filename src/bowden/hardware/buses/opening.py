"""Opening a bus by name, and seeing to it that it has one master."""

import errno
import hashlib
import logging
import os
import socket
from collections.abc import Callable
from pathlib import Path

import can

from bowden.core.errors import DriveError
from bowden.hardware.buses.place import BusPlace
from bowden.hardware.buses.serial_bus import SerialBus, port_of
from bowden.hardware.buses.unix_bus import FD, SWITCHED, UnixBus, bus_folder, flagged, message_of

UNIX = "bowden_unix"
"""Interface of the bus between processes."""
CLASSIC = 16
"""Size of Linux' can_frame [bytes]."""


Frame = tuple[int, bytes]
"""Identifier with the flags of `place`, and data; of a remote frame that is sent as many bytes as it asks for."""


def claim(interface: str, channel: str, part: str) -> socket.socket:
    """Claim a part on a bus that one process alone may play, until it closes the socket, or ends, however that is.

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
    return holder


def received(bus: can.BusABC, timeout: float) -> Frame | None:
    """The next frame, which is waited for at most for `timeout` [s]; None of none."""
    message = bus.recv(timeout)
    return None if message is None else (flagged(message), bytes(message.data))


def taker(bus: can.BusABC) -> Callable[[], Frame | None]:
    """The quickest way to frames that are there; see `received`."""
    return bus.take if isinstance(bus, UnixBus | SerialBus) else lambda: received(bus, 0.0)


def putter(bus: can.BusABC, *, fd: bool) -> Callable[[int, bytes], None]:
    """The quickest way to send a `Frame`; it raises what `bus.send` does.

    Args:
        bus: open.
        fd: whether frames go out as those of CAN-FD, with their data at the higher bit rate.
    """
    if isinstance(bus, UnixBus | SerialBus) and type(bus).send in (
        UnixBus.send,
        SerialBus.send,
    ):  # and not one that sends otherwise
        return bus.put
    made: dict[int, can.Message] = {}  # one for each identifier: to make one takes longer than to fill it

    def put(identifier: int, data: bytes) -> None:
        message = made.get(identifier)
        if message is None:
            message = made[identifier] = message_of(identifier, data, FD | SWITCHED if fd else 0)
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
        create: whether a `bowden_unix` bus is made where there is none; of a serial line, the bus of the twins at its
            other end.

    Raises:
        DriveError: an unknown interface, a bus that is not there or cannot be opened, or one of classic CAN where
            CAN-FD is asked for.
    """
    quieten()
    interface, channel = place.interface, place.channel
    try:
        if place.packets and not create:
            return SerialBus(port_of(channel) if interface == UNIX else channel, place.bitrate, place.packets)
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
    interface, channel, bitrate, _, data_bitrate, _ = place
    if interface == "socketcan" and _longest_frame(channel) == CLASSIC:
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
