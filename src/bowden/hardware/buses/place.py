"""Which CAN bus."""

from typing import NamedTuple


class BusPlace(NamedTuple):
    """Which bus."""

    interface: str
    """python-can's name of it."""
    channel: str
    bitrate: int
    """[bit/s]"""
    fd: bool = False
    """Whether frames of CAN-FD go over it."""
    data_bitrate: int = 5_000_000
    """Of their data [bit/s]."""
