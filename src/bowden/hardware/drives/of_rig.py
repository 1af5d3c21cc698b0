"""The devices of a rig on their buses: its drive, and a load cell beside it."""

from typing import Any

from bowden.core.errors import ParameterError
from bowden.hardware.buses.place import BusPlace
from bowden.hardware.drives.load_cell import identifiers_of
from bowden.hardware.drives.on_can import Device, place
from bowden.hardware.drives.with_load_cell import DriveWithLoadCell
from bowden.hardware.ports import Drive
from bowden.rig.families import family_of
from bowden.rig.load_cell import LoadCellParameters


def open_drive(parameters: Any, cell: LoadCellParameters, links: Any) -> Drive:
    """The drive, with a load cell of its own beside it where there is one.

    Args:
        parameters: of the drive, whole.
        cell: of the rig.
        links: the buses of this process.

    Raises:
        ParameterError: the cell says no bus, and the drive has none.
    """
    drive = family_of(parameters).open(parameters, links)
    if not cell.there:
        return drive
    found, shared = cell_place(parameters, cell)
    timeout = getattr(parameters, "answer_timeout", CELL_TIMEOUT)
    return DriveWithLoadCell(drive, cell, found, links, timeout, shared=shared)


CELL_TIMEOUT = 0.3
"""Longest wait for an answer of a load cell beside a drive that says none [s]."""


def cell_place(parameters: Any, cell: LoadCellParameters) -> tuple[BusPlace, bool]:
    """The bus of the load cell, and whether that is the drive's.

    Raises:
        ParameterError: the cell says no bus, and the drive has none.
    """
    if not hasattr(parameters, "interface") and None in (cell.interface, cell.channel, cell.bitrate):
        raise ParameterError(
            "[load_cell] says no bus, and the drive has none that it could share",
            expected="interface, channel and bitrate",
            do="write them in [load_cell]",
        )
    own = {name: getattr(cell, name) for name in ("interface", "channel", "bitrate") if getattr(cell, name) is not None}
    found = BusPlace(*place(parameters._replace(**own) if hasattr(parameters, "interface") else cell)[:3])
    shared = hasattr(parameters, "interface") and found[:2] == place(parameters)[:2]
    return BusPlace(*place(parameters)[:3]) if shared else found, shared


def device_of(drive: Any, cell: LoadCellParameters) -> Device:
    """The load cell beside a drive, as `on_can.collision` compares it."""
    found, _ = cell_place(drive, cell)
    return Device(found.interface, found.channel, found.bitrate, identifiers_of(cell))
