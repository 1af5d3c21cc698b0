"""A CAN bus between processes of one machine, for the twin and the tests: where the kernel has no CAN.

A bus is a folder. Each node keeps a datagram socket in it, at which others introduce themselves: a node that joins
makes a pair of connected sockets for every node that is there, and hands one end over. From then on frames go through
the pairs alone, a frame a packet: what one node sends reaches every other, sending never waits, and a node that has
died or does not read is counted and otherwise without effect, as on a real bus. A node alone on its bus cannot send,
since nobody acknowledges. (Sent to the datagram sockets themselves, frames would queue up to
`net.unix.max_dgram_qlen`, ten of them; and what a node has said before it leaves would be lost.)

Frames of CAN-FD go beside the classic ones. A node that has not joined for them counts them and receives none; a real
controller of classic CAN would destroy them with error frames, so that nobody received them.

Registered with python-can as interface ``bowden_unix``; can be made directly as well.
"""

import array
import contextlib
import errno
import fcntl
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

FRAME = struct.Struct("<IB3x8s")
"""Identifier with its flags, length, data: the layout of Linux' can_frame."""
FD_FRAME = struct.Struct("<IBB2x64s")
"""Identifier with its flags, length, flags of CAN-FD, data: the layout of Linux' canfd_frame."""
SWITCHED, SENDER_PASSIVE, FD = 0x01, 0x02, 0x04
"""Flags of CAN-FD: data at the higher bit rate, the sender is error passive, an FD frame (Linux, `linux/can.h`)."""
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Of a CAN-FD frame's data [bytes] (ISO 11898-1, coding of the data length code)."""

EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
"""Flags in the identifier."""

LONGEST_PATH = 107
"""Of a Unix socket's name [bytes]."""

MOST_SKIPPED = 64
"""CAN-FD frames that a node of classic CAN passes over at most in one look."""

LOOK_EVERY = 8
"""Frames that a node sends at most before it looks whether somebody has joined; one that reads looks by itself."""

_CLASSIC, _TOO_LONG = FRAME.size, FRAME.size + 1
_SIZES = frozenset((FRAME.size, FD_FRAME.size))
_RIGHTS = socket.CMSG_SPACE(struct.calcsize("i"))


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
        self.undelivered = 0
        """Frames that a node which does not read, or has died, did not get."""
        self.skipped = 0
        """Frames of CAN-FD that this node, of classic CAN, did not receive."""
        self._fd = fd
        self._most = FD_FRAME.size if fd else FRAME.size + 1  # so that a longer one shows
        self._reads_since_look = LOOK_EVERY
        self._links: list[socket.socket] = []
        self._by_number: dict[int, socket.socket] = {}
        """Descriptor → link, those of `_mute` too."""
        self._waiting: deque[bytes] = deque()
        """Frames that were read and not taken yet."""
        self._mute: list[socket.socket] = []
        """Links whose other end has gone, kept until what it said last is read."""
        self._path = folder / f"{os.getpid()}-{os.urandom(4).hex()}.node"
        if len(os.fsencode(self._path)) > LONGEST_PATH:
            raise can.CanInitializationError(f"the name of the bus {folder} is too long for a socket")
        self._door = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._ready, self._knocks = select.epoll(), select.epoll()
        """Links and door, to wait for; the door alone."""
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
            self._knocks.close()
            reason = "there is no such bus" if isinstance(error, FileNotFoundError) else error.strerror
            raise can.CanInitializationError(f"{folder}: {reason}") from error
        self._ready.register(self._door, select.EPOLLIN)
        self._knocks.register(self._door, select.EPOLLIN)
        super().__init__(channel=channel, can_filters=can_filters)
        self._can_protocol = can.CanProtocol.CAN_FD if fd else can.CanProtocol.CAN_20

    def _join(self, folder: Path) -> None:
        """Take a place on the bus and meet all who are there; who has died without leaving is cleared away."""
        others = sorted(folder.glob("*.node"))
        self._door.bind(str(self._path))
        for other in others:
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
            with theirs:
                try:
                    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [theirs.fileno()]))]
                    self._door.sendmsg([b"join"], rights, 0, str(other))
                except ConnectionRefusedError:
                    ours.close()
                    other.unlink(missing_ok=True)
                except OSError:  # gone meanwhile, or one that has not answered the door for a long time
                    ours.close()
                else:
                    self._add(ours)

    def _add(self, link: socket.socket) -> None:
        self._links.append(link)
        self._by_number[link.fileno()] = link
        self._ready.register(link, select.EPOLLIN)

    def _open_door(self) -> bool:
        """Take in everyone who has joined since; whether anyone has."""
        before, self._reads_since_look = len(self._links), 0
        while True:
            try:
                _, rights, _, _ = self._door.recvmsg(16, _RIGHTS)
            except OSError:
                return len(self._links) > before
            for _, _, descriptor in rights:
                link = socket.socket(fileno=struct.unpack("i", descriptor[:4])[0])
                link.setblocking(False)
                self._add(link)

    @property
    def others(self) -> int:
        """How many other nodes are on the bus, as far as is known here."""
        self._open_door()
        return len(self._links)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to all other nodes; never waits.

        Raises:
            can.CanOperationError: no other node is on the bus; or a frame of CAN-FD that this node cannot send.
        """
        flags = EXTENDED * msg.is_extended_id | REMOTE * msg.is_remote_frame | ERROR * msg.is_error_frame
        if msg.is_fd:
            frame = self._packed_fd(msg, flags)
        else:
            frame = FRAME.pack(msg.arbitration_id | flags, msg.dlc, bytes(msg.data))
        self._hand_out(frame)

    def put(self, identifier: int, data: bytes) -> None:
        """`send` without python-can's message, which costs as much as the rest.

        Args:
            identifier: with `EXTENDED`, `REMOTE`, `ERROR`.
            data: of a length that there is; of a remote frame as many bytes as it asks for. On a bus of CAN-FD it goes
                out as a frame of CAN-FD, at the higher bit rate.

        Raises:
            can.CanOperationError: no other node is on the bus.
        """
        if self._fd:
            self._hand_out(FD_FRAME.pack(identifier, len(data), FD | SWITCHED, data))
        else:
            self._hand_out(FRAME.pack(identifier, len(data), data))

    def _hand_out(self, frame: bytes) -> None:
        self._reads_since_look += 1
        if self._reads_since_look >= LOOK_EVERY or not self._links:
            self._open_door()
        for link in tuple(self._links):
            try:
                link.send(frame)
            except BlockingIOError:
                self.undelivered += 1
            except OSError:
                self.undelivered += 1
                self._links.remove(link)
                self._mute.append(link)
        if not self._links:
            raise can.CanOperationError("no other node on the bus acknowledges")

    def _packed_fd(self, msg: can.Message, flags: int) -> bytes:
        """A frame of CAN-FD; data of a length that there is not is filled up with zeros, as controllers do."""
        if not self._fd:
            raise can.CanOperationError("this node is one of classic CAN")
        length = next((length for length in FD_LENGTHS if length >= len(msg.data)), None)
        if length is None:
            raise can.CanOperationError(f"a frame of CAN-FD carries 64 bytes at most, not {len(msg.data)}")
        of_fd = FD | SWITCHED * msg.bitrate_switch | SENDER_PASSIVE * msg.error_state_indicator
        return FD_FRAME.pack(msg.arbitration_id | flags, length, of_fd, bytes(msg.data))

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
        if frame is None:
            return None
        if len(frame) == _CLASSIC:
            identifier, length, data = FRAME.unpack(frame)
        else:
            identifier, length, _, data = FD_FRAME.unpack(frame)
        return identifier, data[:length]

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        frame = self._next()
        if frame is None and timeout != 0.0:
            self._ready.poll(None if timeout is None else max(0.0, timeout))
            frame = self._next()
        if frame is None:
            return None, False
        return _message_of(frame), False

    def _next(self) -> bytes | None:
        """The next frame of any link; None when there is none now.

        Of several links the kernel says which have one: to try each would cost an exception for every one without.
        """
        waiting = self._waiting
        if waiting:
            return waiting.popleft()
        if len(self._by_number) == 1:
            (only,) = self._by_number.values()
            frame = self._read(only)
            if frame is not None:
                return frame
            if not self._knocks.poll(0):
                self._reads_since_look = 0
                return None
        self._reads_since_look, knocked = 0, True
        while knocked and not waiting:
            knocked = False
            for number, _ in self._ready.poll(0):
                link = self._by_number.get(number)
                if link is None:
                    knocked = self._open_door()
                elif (frame := self._read(link)) is not None:
                    waiting.append(frame)
        return waiting.popleft() if waiting else None

    def _read(self, link: socket.socket) -> bytes | None:
        """The next frame of a link; None of none, and of one that has gone."""
        try:
            frame = link.recv(self._most)
            if len(frame) == _TOO_LONG:
                frame = self._skip(link)
        except BlockingIOError:
            return None
        except OSError:
            self._drop(link)
            return None
        if len(frame) in _SIZES:
            return frame
        if not frame:  # its end
            self._drop(link)
        return None

    def _skip(self, link: socket.socket) -> bytes:
        """The next frame of classic CAN of a link that has sent one of CAN-FD; raises as its `recv` does."""
        for _ in range(MOST_SKIPPED):
            self.skipped += 1
            frame = link.recv(self._most)
            if len(frame) != _TOO_LONG:
                return frame
        raise BlockingIOError

    def _drop(self, link: socket.socket) -> None:
        for links in (self._links, self._mute):
            if link in links:
                links.remove(link)
        self._by_number.pop(link.fileno(), None)
        with contextlib.suppress(OSError, ValueError):
            self._ready.unregister(link)
        link.close()

    def poll(self, timeout: float) -> None:
        """Wait for something to read, at most `timeout` [s]."""
        if not self._waiting:
            self._ready.poll(timeout)

    def shutdown(self) -> None:
        """Leave the bus."""
        super().shutdown()
        self._path.unlink(missing_ok=True)
        self._door.close()
        self._ready.close()
        self._knocks.close()
        for link in (*self._links, *self._mute):
            link.close()
        self._links, self._mute = [], []


def _message_of(frame: bytes) -> can.Message:
    fd = len(frame) != _CLASSIC
    identifier, length, *rest, data = (FD_FRAME if fd else FRAME).unpack(frame)
    flags = rest[0] if fd else 0
    length, remote = min(length, len(data)), bool(identifier & REMOTE) and not fd
    return can.Message(
        arbitration_id=identifier & 0x1FFF_FFFF,
        is_extended_id=bool(identifier & EXTENDED),
        is_remote_frame=remote,
        is_error_frame=bool(identifier & ERROR),
        is_fd=fd,
        bitrate_switch=bool(flags & SWITCHED),
        error_state_indicator=bool(flags & SENDER_PASSIVE),
        dlc=length,
        data=None if remote else data[:length],
    )


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """No two nodes join at once: each would introduce itself to the other, and their frames arrive twice."""
    descriptor = os.open(folder / "door.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
