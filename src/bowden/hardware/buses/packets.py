"""Packets of serial servos, as frames: Dynamixel's protocol 2.0, and that of Feetech's STS series. Pure.

    Dynamixel   FF FF FD 00   number   length 16   instruction   parameters                       CRC 16
                FF FF FD 00   number   length 16   55            error, parameters                CRC 16
    Feetech     FF FF         number   length 8    instruction   parameters                       checksum
                FF FF         number   length 8                  error, parameters                checksum

A frame is the servo's number, `ALL` for every servo, and data: an instruction with its parameters, or `STATUS`, an
error, and what was asked for. Numbers of more than one byte begin with the lowest.

Sources: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0", and DynamixelSDK 4.1 for the fast sync read; Feetech,
"Communication Protocol User Manual", and the tables of huggingface/lerobot. The tests hold the first against
DynamixelSDK.
"""

from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from typing import NamedTuple

ALL = 0xFE
"""Number to which every servo listens, and none answers but to sync reads and, of Dynamixel, to a ping."""
HIGHEST = 0xFC
"""Number of a servo."""
STATUS = 0x55
LONGEST = 512
"""Of a packet; what claims to be longer is none [bytes]."""

Frame = tuple[int, bytes]


class Instruction(IntEnum):
    """Of both protocols; Feetech has no reboot and no fast sync read."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REBOOT = 0x08
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A


class Packets(NamedTuple):
    """One of the protocols."""

    name: str
    width: int
    """Of an address and of a length, in parameters [bytes]."""
    around: int
    """Of a packet beside instruction or error, and parameters [bytes]."""
    pack: Callable[[int, bytes], bytes]
    """A frame as bytes."""
    take: Callable[[bytearray, bool], Frame | int | None]
    """``take(buffer, replies)``: the frame at the beginning of the buffer, which is taken out of it; None of one that
    is not whole yet, or of no bytes; how many bytes are none, and were taken out."""
    fast: bool = False
    """Whether servos may answer a sync read in one packet."""

    def number(self, value: int) -> bytes:
        """An address or a length."""
        return value.to_bytes(self.width, "little")

    def read(self, address: int, length: int) -> bytes:
        """Data that asks one servo."""
        return bytes((Instruction.READ,)) + self.number(address) + self.number(length)

    def write(self, address: int, value: bytes) -> bytes:
        """Data that sets something in one servo, or in all."""
        return bytes((Instruction.WRITE,)) + self.number(address) + value

    def sync_read(self, address: int, length: int, *, fast: bool = False) -> bytes:
        """Head of data that asks several servos; their numbers follow."""
        kind = Instruction.FAST_SYNC_READ if fast else Instruction.SYNC_READ
        return bytes((kind,)) + self.number(address) + self.number(length)

    def sync_write(self, address: int, length: int) -> bytes:
        """Head of data that sets something in several servos; of each follow its number and a value."""
        return bytes((Instruction.SYNC_WRITE,)) + self.number(address) + self.number(length)

    def asked(self, data: bytes) -> tuple[int, int, bytes]:
        """Address, length and the rest of a read, a sync read or a sync write; of a cut one zeros."""
        one, two = 1 + self.width, 1 + 2 * self.width
        return int.from_bytes(data[1:one], "little"), int.from_bytes(data[one:two], "little"), data[two:]


def _crc_table() -> tuple[int, ...]:
    found = []
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = crc << 1 ^ (0x8005 if crc & 0x8000 else 0)
        found.append(crc & 0xFFFF)
    return tuple(found)


_CRC = _crc_table()


def crc16(data: Iterable[int]) -> int:
    """CRC-16 of Dynamixel's packets: polynomial 8005h, from 0, the highest bit first.

    >>> hex(crc16(bytes.fromhex("fffffd000107000284000400")))
    '0x151d'
    """
    crc = 0
    for byte in data:
        crc = (crc << 8 ^ _CRC[crc >> 8 ^ byte]) & 0xFFFF
    return crc


_HEADER = b"\xff\xff\xfd\x00"


def _pack_dynamixel(number: int, data: bytes) -> bytes:
    stuffed = data.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")  # so that no header is in it
    head = _HEADER + bytes((number,)) + (len(stuffed) + 2).to_bytes(2, "little") + stuffed
    return head + crc16(head).to_bytes(2, "little")


def _start(buffer: bytearray, header: bytes) -> int:
    """How many bytes at the beginning are of no packet: those before a header, or what may become one."""
    at = buffer.find(header)
    if at >= 0:
        return at
    kept = next((n for n in range(len(header) - 1, 0, -1) if buffer.endswith(header[:n])), 0)
    return len(buffer) - kept


def _dropped(buffer: bytearray, count: int) -> int:
    del buffer[:count]
    return count


def _take_dynamixel(buffer: bytearray, replies: bool) -> Frame | int | None:
    if noise := _start(buffer, _HEADER):
        return _dropped(buffer, noise)
    if len(buffer) < 7:
        return None
    end = 7 + int.from_bytes(buffer[5:7], "little")
    if not 10 <= end <= LONGEST:
        return _dropped(buffer, 4)
    if len(buffer) < end:
        again = -1 if replies else buffer.find(_HEADER, 4)  # a fast answer is not stuffed, and may hold a header
        return _dropped(buffer, again) if again > 0 else None
    if crc16(buffer[: end - 2]) != int.from_bytes(buffer[end - 2 : end], "little"):
        return _dropped(buffer, 4)
    number, data = buffer[4], bytes(buffer[7 : end - 2])
    del buffer[:end]
    if number != ALL or data[0] != STATUS:
        data = data.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
    return number, data


def _take_feetech(buffer: bytearray, replies: bool) -> Frame | int | None:
    if noise := _start(buffer, b"\xff\xff"):
        return _dropped(buffer, noise)
    if len(buffer) < 4:
        return None
    end = 4 + buffer[3]
    if buffer[2] > ALL or buffer[3] < 2:
        return _dropped(buffer, 1)
    if len(buffer) < end:
        return None
    if ~sum(buffer[2 : end - 1]) & 0xFF != buffer[end - 1]:
        return _dropped(buffer, 1)
    number, data = buffer[2], bytes(buffer[4 : end - 1])
    del buffer[:end]
    return number, bytes((STATUS,)) + data if replies else data


def _pack_feetech(number: int, data: bytes) -> bytes:
    said = data[1:] if data[0] == STATUS else data
    body = bytes((number, len(said) + 1)) + said
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


DYNAMIXEL = Packets("Dynamixel protocol 2.0", 2, 9, _pack_dynamixel, _take_dynamixel, fast=True)
FEETECH = Packets("Feetech STS", 1, 5, _pack_feetech, _take_feetech)
PROTOCOLS = {"dynamixel": DYNAMIXEL, "feetech": FEETECH}
"""Name in a `BusPlace` → protocol."""


class PacketReader:
    """Frames from bytes as they come.

    Args:
        packets: the protocol.
        replies: whether servos are listened to, rather than their host.
    """

    def __init__(self, packets: Packets, *, replies: bool) -> None:
        self._packets, self._replies, self._buffer = packets, replies, bytearray()
        self.garbled = 0
        """Runs of bytes that were of no packet."""

    def forget(self) -> None:
        """What is not whole yet never will be."""
        self.garbled += bool(self._buffer)
        self._buffer.clear()

    def feed(self, data: bytes, length: int = 0) -> list[Frame]:
        """The frames that are whole with these bytes; a fast answer as one of each servo, of so many bytes each."""
        self._buffer += data
        found: list[Frame] = []
        noise = False
        while True:
            taken = self._packets.take(self._buffer, self._replies)
            if isinstance(taken, int):
                noise = True
                continue
            if taken is None:
                self.garbled += noise
                return found
            self.garbled, noise = self.garbled + noise, False
            number, said = taken
            if self._packets.fast and number == ALL and said[0] == STATUS:
                found += _apart(said, length)
            else:
                found.append(taken)


def _apart(said: bytes, length: int) -> list[Frame]:
    """A fast answer, of several servos: of each its error, its number, what was asked for, and a CRC."""
    size = length + 4
    blocks = [said[i : i + size - 2] for i in range(1, len(said), size)]
    return [(one[1], bytes((STATUS, one[0])) + one[2:]) for one in blocks if len(one) == size - 2]


def fast_answer(replies: Sequence[Frame]) -> bytes:
    """The answers of several servos to a fast sync read as one packet, in their order.

    Args:
        replies: of each servo its number, and `STATUS`, error and what was asked for.
    """
    length = 1 + sum(len(data) + 2 for _, data in replies)
    said = _HEADER + bytes((ALL,)) + length.to_bytes(2, "little") + bytes((STATUS,))
    for number, data in replies:
        said += bytes((data[1], number)) + data[2:]
        said += crc16(said).to_bytes(2, "little")
    return said
