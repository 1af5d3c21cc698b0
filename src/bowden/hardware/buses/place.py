"""Which bus, and the flags of its identifiers."""

from typing import NamedTuple

EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
"""Flags in an identifier."""


class BusPlace(NamedTuple):
    """Which bus."""

    interface: str
    """python-can's name of it."""
    channel: str
    bitrate: int
    """[bit/s]"""
    fd: bool = False
    """True if frames of CAN-FD go over it."""
    data_bitrate: int = 5_000_000
    """Of their data [bit/s]."""
    packets: str = ""
    """Of a serial line the protocol on it, of `packets.PROTOCOLS`; empty of a CAN bus."""
