"""Where a node is on a CAN bus."""

from typing import NamedTuple


class NodePlace(NamedTuple):
    """Where a node is."""

    interface: str
    """python-can's name of the bus."""
    channel: str
    bitrate: int
    """[bit/s]"""
    node_id: int
    """Its number on the bus."""
    fd: bool = False
    """Whether it speaks CAN-FD."""
    data_bitrate: int = 5_000_000
    """Of its data [bit/s]."""
