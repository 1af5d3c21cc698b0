"""The line between a host and the twins of serial servos: a pseudo terminal, whose other end the twins' bus is.

The host opens it as it would a USB adapter. Bytes take the time that they would on the line; a host at another bit
rate is not understood; the answers to a sync read come in its order, to a fast one as one packet, and then all or none.
"""

import contextlib
import os
import select
import termios
import time
import tty
from collections import deque

import can

from bowden.core.errors import DriveError
from bowden.hardware.buses.opening import claim, open_bus
from bowden.hardware.buses.packets import PROTOCOLS, STATUS, Frame, Instruction, PacketReader, fast_answer
from bowden.hardware.buses.place import ERROR, BusPlace
from bowden.hardware.buses.serial_bus import MOST, port_of
from bowden.hardware.buses.unix_bus import UnixBus

MOST_DATA = 64
"""Of a frame on the twins' bus [bytes]."""
PATIENCE = 5e-3
"""For a servo that was asked with others [s]."""
NOISE = b"\xff\xff\xfd\x00\x01\x03\x00\x55\x00\x00"
"""In place of what a bit error has destroyed."""


class LineBus(UnixBus):
    """The twins' bus, of which the twin that opens it first has the host's line at the other end.

    Args:
        place: of the bus.

    Raises:
        DriveError: another twin has the line.
    """

    def __init__(self, place: BusPlace) -> None:
        self._claim = claim(place.interface, place.channel, "line")
        self._packets, self._bitrate = PROTOCOLS[place.packets], place.bitrate
        self._speed = getattr(termios, f"B{place.bitrate}", None)
        self._reader = PacketReader(self._packets, replies=False)
        self._told: deque[Frame] = deque()  # by the host
        self._asked: list[int] = []  # in a sync read, and not answered yet
        self._replies: dict[int, Frame] = {}
        self._fast, self._until = False, 0.0
        super().__init__(place.channel, create=True)
        self._host, self._line = os.openpty()
        tty.setraw(self._line)
        os.set_blocking(self._host, False)
        self._ready.register(self._host, select.EPOLLIN)
        self._port = port_of(place.channel)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self._port)
        os.symlink(os.ttyname(self._line), self._port)

    def shutdown(self) -> None:
        """Take the line away."""
        super().shutdown()
        with contextlib.suppress(OSError):
            os.unlink(self._port)
        os.close(self._host)
        os.close(self._line)
        self._claim.close()

    def put(self, identifier: int, data: bytes) -> None:
        """An answer of this twin's servo."""
        self._hear_servo(identifier, data)

    def _next(self) -> tuple[int, int, bytes] | None:
        """What the host has said; the other twins' answers go to it."""
        self._hear_host()
        while (frame := super()._next()) is not None:
            self._hear_servo(frame[0], frame[2])
        if self._asked and time.monotonic() > self._until:
            self._give_up()
        if not self._told:
            return None
        number, said = self._told.popleft()
        return number, 0, said

    def _hear_host(self) -> None:
        try:
            data = os.read(self._host, MOST)
        except OSError:
            return
        if self._speed is not None and termios.tcgetattr(self._host)[5] != self._speed:
            return
        for number, said in self._reader.feed(data):
            if len(said) > MOST_DATA:
                continue
            self._take_time(len(self._packets.pack(number, said)))
            if said[0] in (Instruction.SYNC_READ, Instruction.FAST_SYNC_READ):
                self._asked, self._replies = list(self._packets.asked(said)[2]), {}
                self._fast = said[0] == Instruction.FAST_SYNC_READ
                self._until = time.monotonic() + PATIENCE
            self._told.append((number, said))
            with contextlib.suppress(can.CanError):  # no other twin
                super().put(number, said)

    def _hear_servo(self, number: int, said: bytes) -> None:
        if number & ERROR:
            self._send(NOISE)
        elif not said or said[0] != STATUS:
            return
        elif number not in self._asked or number in self._replies:
            self._send(self._packets.pack(number, said))
        else:
            self._replies[number] = number, said
            self._answer()

    def _answer(self) -> None:
        """Those who are next, in the order in which they were asked."""
        if self._fast:
            if len(self._replies) == len(self._asked):
                self._send(fast_answer([self._replies[number] for number in self._asked]))
                self._asked = []
            return
        while self._asked and self._asked[0] in self._replies:
            self._send(self._packets.pack(*self._replies.pop(self._asked.pop(0))))

    def _give_up(self) -> None:
        """On those who do not answer; behind one of them nobody does in one packet."""
        if not self._fast:
            for number in [one for one in self._asked if one in self._replies]:
                self._send(self._packets.pack(*self._replies[number]))
        self._asked, self._replies = [], {}

    def _send(self, data: bytes) -> None:
        self._take_time(len(data))
        with contextlib.suppress(OSError):  # a host that does not read
            os.write(self._host, data)

    def _take_time(self, count: int) -> None:
        time.sleep(10.0 * count / self._bitrate)


def bus_of_twin(place: BusPlace, *, create: bool) -> can.BusABC:
    """The bus of a twin, with the host's line where it is a serial one that no other twin has.

    Raises:
        DriveError: it cannot be used.
    """
    if not place.packets:
        return open_bus(place, create=create)
    try:
        return LineBus(place)
    except DriveError:
        return UnixBus(place.channel, create=create)
