"""The line between a host and the twins of serial servos: a pseudo terminal, whose other end the twins' bus is.

The host opens it as it would a USB adapter. Bytes take the time that they would on the line; a host at another bit
rate is not understood; the answers to a sync read come in its order, to a fast one as one packet, and then all or none.
"""

import contextlib
import os
import select
import termios
import threading
import time
import tty

import can

from bowden.core.errors import DriveError
from bowden.hardware.buses.opening import claim
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


class SerialPort:
    """The line, in a thread of its own.

    Args:
        place: of the bus.
    """

    def __init__(self, place: BusPlace) -> None:
        self._claim = claim(place.interface, place.channel, "line")
        self._packets, self._bitrate = PROTOCOLS[place.packets], place.bitrate
        self._speed = getattr(termios, f"B{place.bitrate}", None)
        self._reader = PacketReader(self._packets, replies=False)
        self._bus = UnixBus(place.channel, create=True)
        self._host, self._line = os.openpty()
        tty.setraw(self._line)
        os.set_blocking(self._host, False)
        self._path = port_of(place.channel)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self._path)
        os.symlink(os.ttyname(self._line), self._path)
        self._waiting: list[int] = []
        self._replies: dict[int, Frame] = {}
        self._fast, self._until = False, 0.0
        self._open = True
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take the line away."""
        self._open = False
        self._thread.join()
        with contextlib.suppress(OSError):
            os.unlink(self._path)
        os.close(self._host)
        os.close(self._line)
        self._bus.shutdown()
        self._claim.close()

    def _run(self) -> None:
        while self._open:
            select.select([self._host, self._bus.fileno()], [], [], 1e-3 if self._waiting else 20e-3)
            self._hear_host()
            for _ in range(MOST_DATA):
                frame = self._bus.take()
                if frame is None:
                    break
                self._hear_servo(*frame)
            if self._waiting and time.monotonic() > self._until:
                self._give_up()

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
                self._waiting, self._replies = list(self._packets.asked(said)[2]), {}
                self._fast = said[0] == Instruction.FAST_SYNC_READ
                self._until = time.monotonic() + PATIENCE
            with contextlib.suppress(can.CanError):
                self._bus.put(number, said)

    def _hear_servo(self, number: int, said: bytes) -> None:
        if number & ERROR:
            self._send(NOISE)
        elif not said or said[0] != STATUS:
            return
        elif number not in self._waiting or number in self._replies:
            self._send(self._packets.pack(number, said))
        else:
            self._replies[number] = number, said
            self._answer()

    def _answer(self) -> None:
        """Those who are next, in the order in which they were asked."""
        if self._fast:
            if len(self._replies) == len(self._waiting):
                self._send(fast_answer([self._replies[number] for number in self._waiting]))
                self._waiting = []
            return
        while self._waiting and self._waiting[0] in self._replies:
            self._send(self._packets.pack(*self._replies.pop(self._waiting.pop(0))))

    def _give_up(self) -> None:
        """On those who do not answer; behind one of them nobody does in one packet."""
        if not self._fast:
            for number in [one for one in self._waiting if one in self._replies]:
                self._send(self._packets.pack(*self._replies[number]))
        self._waiting, self._replies = [], {}

    def _send(self, data: bytes) -> None:
        self._take_time(len(data))
        with contextlib.suppress(OSError):  # a host that does not read
            os.write(self._host, data)

    def _take_time(self, count: int) -> None:
        time.sleep(10.0 * count / self._bitrate)


def serial_port(place: BusPlace) -> SerialPort | None:
    """The line of a bus of serial servos; None of another bus, and where another twin has it."""
    if not place.packets:
        return None
    try:
        return SerialPort(place)
    except DriveError:
        return None
