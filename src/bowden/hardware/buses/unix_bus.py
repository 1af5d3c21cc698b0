"""A CAN bus between processes of one machine, for the twin and the tests: where the kernel has no CAN.

A bus is a folder. Each node keeps a listening socket in it, to which a node that joins connects: a link for every two
nodes, a frame a packet. What one node sends reaches every other, sending never waits, and a node that has died or does
not read is without effect, as on a real bus. A node alone on its bus cannot send, since nobody
acknowledges. (As datagrams, frames would queue up to `net.unix.max_dgram_qlen`, ten of them; and what a node has said
before it leaves would be lost.)

Frames of CAN-FD go beside the classic ones. A node that has not joined for them receives none; a real controller of
classic CAN would destroy them with error frames, so that nobody received them.

Registered with python-can as interface ``bowden_unix``; can be made directly as well.
"""

import contextlib
import errno
import os
import select
import socket
import stat
import struct
import tempfile
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can

from bowden.hardware.buses.place import ERROR, EXTENDED, REMOTE

FRAME = struct.Struct("<IBB2x64s")
"""Identifier with its flags, length, flags of CAN-FD, data: the layout of Linux' canfd_frame, of classic frames too."""
SWITCHED, SENDER_PASSIVE, FD = 0x01, 0x02, 0x04
"""Flags of CAN-FD: data at the higher bit rate, the sender is error passive, an FD frame (Linux, `linux/can.h`)."""
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Of a CAN-FD frame's data [bytes] (ISO 11898-1, coding of the data length code)."""

LONGEST_PATH = 107
"""Of a Unix socket's name [bytes]."""

MOST_LOOKS = 64
"""At what is no frame for this node, before it says that there is none."""

LOOK_EVERY = 8
"""Frames that a node sends at most before it looks whether somebody has joined; one that reads looks by itself."""

MOST_JOINING = 128
"""Nodes that may join until one looks; more count as not there."""


def flagged(message: can.Message) -> int:
    """The identifier of a message, with `EXTENDED`, `REMOTE`, `ERROR`."""
    flags = EXTENDED * message.is_extended_id | REMOTE * message.is_remote_frame | ERROR * message.is_error_frame
    return message.arbitration_id | flags


def message_of(identifier: int, data: bytes, of_fd: int = 0) -> can.Message:
    """A message of an identifier with its flags, of data, of a remote frame as many bytes as it asks for, and of the
    flags of CAN-FD.
    """
    remote = bool(identifier & REMOTE)
    return can.Message(
        arbitration_id=identifier & 0x1FFF_FFFF,
        is_extended_id=bool(identifier & EXTENDED),
        is_remote_frame=remote,
        is_error_frame=bool(identifier & ERROR),
        is_fd=bool(of_fd & FD),
        bitrate_switch=bool(of_fd & SWITCHED),
        error_state_indicator=bool(of_fd & SENDER_PASSIVE),
        dlc=len(data),
        data=None if remote else data,
    )


def bus_folder(channel: str) -> Path:
    """The folder of a bus: the channel itself if it has a slash, otherwise one of that name in a place of this user."""
    if "/" in channel:
        return Path(channel)
    return Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / f"bowden-{os.getuid()}" / channel


def _check_own(channel: str) -> None:
    """Refuse a place of this user that is another's, or open to others: whoever may write there plays the drive.

    Raises:
        PermissionError: so it is.
    """
    if "/" in channel:
        return
    place = bus_folder(channel).parent
    found = os.lstat(place)
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise PermissionError(errno.EPERM, f"{place} belongs to other users too: remove it, or set its mode to 700")


class UnixBus(can.BusABC):
    """One node's end of the bus.

    Args:
        channel: folder of the bus, or a bare name.
        create: whether to make the folder where there is none.
        can_filters: as python-can has them.
        fd: whether this node sends and receives frames of CAN-FD.

    Raises:
        can.CanInitializationError: there is no such bus, its folder cannot be used, or its name is too long.
    """

    def __init__(
        self,
        channel: Any,
        can_filters: can.typechecking.CanFilters | None = None,
        create: bool = True,
        fd: bool = False,
        **_: object,
    ) -> None:
        folder = bus_folder(str(channel))
        self.channel_info = f"bowden_unix bus {folder}"
        self._of_fd = FD | SWITCHED if fd else 0
        self._sent = LOOK_EVERY  # since it looked who has joined
        self._links: dict[int, socket.socket] = {}
        """Descriptor → link; one whose other end has gone is kept until what it said last is read."""
        self._waiting: deque[tuple[int, int, bytes]] = deque()
        """Frames that were read and not taken yet."""
        self._mute: set[int] = set()
        """Of links whose other end has gone."""
        self._path = folder / f"{os.getpid()}-{os.urandom(4).hex()}.node"
        if len(os.fsencode(self._path)) > LONGEST_PATH:
            raise can.CanInitializationError(f"the name of the bus {folder} is too long for a socket")
        self._door = _socket()
        self._ready = select.epoll()
        try:
            if create:
                if "/" not in str(channel):
                    folder.parent.mkdir(mode=0o700, exist_ok=True)
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            _check_own(str(channel))
            with _alone(folder):
                self._join(folder)
        except OSError as error:
            self._door.close()
            self._ready.close()
            reason = "there is no such bus" if isinstance(error, FileNotFoundError) else error.strerror
            raise can.CanInitializationError(f"{folder}: {reason}") from error
        self._ready.register(self._door, select.EPOLLIN)
        super().__init__(channel=channel, can_filters=can_filters)
        self._can_protocol = can.CanProtocol.CAN_FD if fd else can.CanProtocol.CAN_20

    def _join(self, folder: Path) -> None:
        """Take a place on the bus and meet all who are there; who has died without leaving is cleared away."""
        others = sorted(folder.glob("*.node"))
        self._door.bind(str(self._path))
        self._door.listen(MOST_JOINING)
        for other in others:
            link = _socket()
            try:
                link.connect(str(other))
            except OSError as error:  # gone meanwhile, or one that has not answered the door for a long time
                link.close()
                if isinstance(error, ConnectionRefusedError):
                    other.unlink(missing_ok=True)
            else:
                self._add(link)

    def _add(self, link: socket.socket) -> None:
        self._links[link.fileno()] = link
        self._ready.register(link, select.EPOLLIN)

    def _open_door(self) -> None:
        """Take in everyone who has joined since."""
        self._sent = 0
        with contextlib.suppress(OSError):
            while True:
                link, _ = self._door.accept()
                link.setblocking(False)
                self._add(link)

    def fileno(self) -> int:
        """What becomes readable with a frame, or a node that joins."""
        return self._ready.fileno()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to all other nodes; never waits.

        Raises:
            can.CanOperationError: no other node is on the bus; or a frame of CAN-FD that this node cannot send.
        """
        of_fd = FD | SWITCHED * msg.bitrate_switch | SENDER_PASSIVE * msg.error_state_indicator
        self._hand_out(flagged(msg), bytes(msg.data), msg.dlc, of_fd * msg.is_fd)

    def put(self, identifier: int, data: bytes) -> None:
        """`send` without python-can's message, which costs as much as the rest.

        Args:
            identifier: with `EXTENDED`, `REMOTE`, `ERROR`.
            data: of a remote frame as many bytes as it asks for. On a bus of CAN-FD it goes out as a frame of CAN-FD,
                at the higher bit rate.

        Raises:
            can.CanOperationError: no other node is on the bus.
        """
        self._hand_out(identifier, data, len(data), self._of_fd)

    def _hand_out(self, identifier: int, data: bytes, length: int, of_fd: int) -> None:
        """Data of CAN-FD of a length that there is not is filled up with zeros, as controllers do."""
        if of_fd:
            if not self._of_fd:
                raise can.CanOperationError("this node is one of classic CAN")
            length = next((one for one in FD_LENGTHS if one >= len(data)), -1)
            if length < 0:
                raise can.CanOperationError(f"a frame of CAN-FD carries 64 bytes at most, not {len(data)}")
        frame = FRAME.pack(identifier, length, of_fd, data)
        self._sent += 1
        if self._sent >= LOOK_EVERY or len(self._links) == len(self._mute):
            self._open_door()
        for number, link in self._links.items():
            if number not in self._mute:
                try:
                    link.send(frame)
                except BlockingIOError:  # it does not read
                    continue
                except OSError:
                    self._mute.add(number)
        if len(self._links) == len(self._mute):
            raise can.CanOperationError("no other node on the bus acknowledges")

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame, or None after `timeout` [s]; python-can's own, without detours where there is no wait."""
        if timeout == 0.0 and self._filters is None:
            return self._recv_internal(0.0)[0]
        return super().recv(timeout)

    def take(self) -> tuple[int, bytes] | None:
        """The next frame that is there, as identifier with `EXTENDED`, `REMOTE`, `ERROR`, and data; None of none.

        `recv` without python-can's message, which costs more than the rest.
        """
        frame = self._next()
        return None if frame is None else (frame[0], frame[2])

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        frame = self._next()
        if frame is None and timeout != 0.0:
            self._ready.poll(None if timeout is None else max(0.0, timeout))
            frame = self._next()
        return None if frame is None else message_of(frame[0], frame[2], frame[1]), False

    def _next(self) -> tuple[int, int, bytes] | None:
        """Identifier, flags of CAN-FD and data of the next frame of any link; None when there is none now."""
        waiting, self._sent = self._waiting, 0  # since this looks who has joined, too
        for _ in range(0 if waiting else MOST_LOOKS):
            ready = self._ready.poll(0)
            for number, _ in ready:
                if number in self._links:
                    self._read(number)
                else:
                    self._open_door()
            if waiting or not ready:
                break
        return waiting.popleft() if waiting else None

    def _read(self, number: int) -> None:
        """The next frame of a link, to those that wait; what is of another size, or of CAN-FD where this node is not,
        is none.
        """
        try:
            frame = self._links[number].recv(FRAME.size + 1)
        except BlockingIOError:
            return
        except OSError:
            frame = b""
        if not frame:  # its end
            self._ready.unregister(number)
            self._mute.discard(number)
            self._links.pop(number).close()
        elif len(frame) == FRAME.size:
            identifier, length, of_fd, data = FRAME.unpack(frame)
            if not of_fd or self._of_fd:
                self._waiting.append((identifier, of_fd, data[:length]))

    def shutdown(self) -> None:
        """Leave the bus."""
        super().shutdown()
        self._path.unlink(missing_ok=True)
        self._door.close()
        self._ready.close()
        for link in self._links.values():
            link.close()
        self._links, self._mute = {}, set()


def _socket() -> socket.socket:
    return socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """No two nodes join at once: each would introduce itself to the other, and their frames arrive twice."""
    descriptor = os.open(folder / "door.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        import fcntl  # which Windows has not, where rigs for this bus are made and checked too

        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
