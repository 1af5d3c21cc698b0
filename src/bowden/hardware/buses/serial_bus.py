"""A serial line of servos as a bus: what goes over it are the frames of `packets`, not bytes.

One wire carries both ways, and a servo speaks only when it is asked. So what has not become whole by our next packet
never will, and a packet that came to nothing is a frame with `place.ERROR`.
"""

import contextlib
import os
import select
from collections import deque
from pathlib import Path
from typing import Any

import can

from bowden.core.errors import DriveError
from bowden.core.extras import extra_module
from bowden.hardware.buses.packets import PROTOCOLS, Instruction, PacketReader
from bowden.hardware.buses.place import ERROR
from bowden.hardware.buses.unix_bus import bus_folder, flagged, message_of

MOST = 4096
"""Bytes that are read at once."""


def port_of(channel: str) -> str:
    """The line of the twins on a channel: a link to the host's end of a pseudo terminal."""
    return str(bus_folder(channel) / "port")


class SerialBus(can.BusABC):
    """The host's end.

    Args:
        port: its device, as ``/dev/ttyUSB0``.
        bitrate: [bit/s]
        protocol: a name in `packets.PROTOCOLS`.

    Raises:
        DriveError: no such line, one that is used, one that is not ours, or one that does not know the bit rate.
    """

    def __init__(self, port: str, bitrate: int, protocol: str) -> None:
        self.channel_info = f"serial line {port}"
        self._packets = PROTOCOLS[protocol]
        self._reader = PacketReader(self._packets, replies=True)
        self._frames: deque[tuple[int, bytes]] = deque()
        self._asked = 0  # of each servo, by the last sync read [bytes]
        self._garbled = 0
        self._port = _opened(port, bitrate)
        self._fd = self._port.fileno()
        super().__init__(channel=port)

    def put(self, identifier: int, data: bytes) -> None:
        """Send a packet; what was not whole by now is lost.

        Raises:
            can.CanOperationError: the line has gone.
        """
        self._read()
        self._reader.forget()
        if data[0] in (Instruction.SYNC_READ, Instruction.FAST_SYNC_READ):
            self._asked = self._packets.asked(data)[1]
        try:
            os.write(self._fd, self._packets.pack(identifier, data))
        except OSError as error:
            raise can.CanOperationError(f"the line has gone: {error.strerror}") from error

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """See `put`."""
        self.put(flagged(msg), bytes(msg.data))

    def take(self) -> tuple[int, bytes] | None:
        """The next frame that is there; None of none."""
        if not self._frames:
            self._read()
        return self._frames.popleft() if self._frames else None

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # nothing there, or the line has gone: silence is seen by its time
            self._frames.extend(self._reader.feed(os.read(self._fd, MOST), self._asked))
        if self._reader.garbled > self._garbled:
            self._garbled = self._reader.garbled
            self._frames.append((ERROR, b""))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        frame = self.take()
        if frame is None and timeout != 0.0:
            select.select([self._fd], [], [], timeout)
            frame = self.take()
        return None if frame is None else message_of(*frame), False

    def shutdown(self) -> None:
        """Let go of the line."""
        super().shutdown()
        self._port.close()


def _opened(port: str, bitrate: int) -> Any:
    serial = extra_module("serial", "serial", "a serial servo")
    twin = Path(port).name == "port"
    try:
        line = serial.Serial(port, bitrate, timeout=0, write_timeout=0, exclusive=True)
    except (OSError, ValueError) as error:
        reason = str(error).partition("] ")[2] or str(error)
        do = "start bowden twin, or run with a twin of its own (--twin)" if twin else "check channel and bitrate in "
        do += "" if twin else "[drive], and that you are in the group dialout; end the other program that uses it"
        raise DriveError(f"cannot open the serial line {port} at {bitrate} bit/s: {reason}", do=do) from error
    with contextlib.suppress(AttributeError, NotImplementedError, OSError, ValueError):
        line.set_low_latency_mode(True)  # else an FTDI adapter holds what it has received for up to 16 ms
    return line
