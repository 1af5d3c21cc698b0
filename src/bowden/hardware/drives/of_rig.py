"""The devices of a rig on their buses: its drive, and a load cell beside it, as one `Drive`."""

from typing import Any, cast

from bowden.core.errors import ParameterError
from bowden.core.signals import DriveReading
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.place import ERROR, REMOTE, BusPlace
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.load_cell import LoadCellReader, identifiers_of
from bowden.hardware.drives.on_can import Device, place
from bowden.hardware.ports import BrakedDrive, Drive, Power, TorqueLeft, serial_of
from bowden.rig.families import family_of
from bowden.rig.load_cell import LoadCellParameters


class DriveWithLoadCell:
    """The drive, whose readings have the cell's load.

    Args:
        drive: not brought up yet.
        cell: of the rig, with its bus.
        place: of the cell's bus.
        shared: whether that is the drive's.
        links: the buses of this process.
        timeout: how long an answer may take at bring-up [s].
    """

    def __init__(
        self, drive: Drive, cell: LoadCellParameters, place: BusPlace, links: Links, timeout: float, *, shared: bool
    ) -> None:
        self._drive, self._place, self._links, self._shared = drive, place, links, shared
        self._cell, self._up = LoadCellReader(cell, timeout), False
        self._port: BusPort | None = None

    def bring_up(self) -> str:
        """See `hardware.ports.Drive.bring_up`: the drive first, which listens for other masters."""
        self._up = False
        said = self._drive.bring_up()
        if self._port is None:
            cell = self._cell
            self._port = self._links.join(self._place, cell.node, cell.wants, synced=cell.synced)
        try:
            found = self._cell.bring_up(self._port)
        except BaseException:
            self._leave()
            raise
        self._up = True
        return f"{said}; load cell: {found}"

    @property
    def serial(self) -> str:
        """See `hardware.ports.serial_of`."""
        return serial_of(self._drive)

    def read(self, now: float) -> DriveReading:
        """See `hardware.ports.Drive.read`."""
        reading, cell, foreign, errors = self._drive.read(now), self._cell, 0.0, 0.0
        for identifier, data in self._port.take_all() if self._port is not None and self._up else ():
            if cell.foreign(identifier & ~REMOTE):
                foreign += 1.0
            elif not identifier & (ERROR | REMOTE):
                cell.take(identifier, data, now)
        if self._port is not None and not self._shared:  # a shared bus' are the drive's
            errors = float(self._port.errors)
        load = cell.value(now)
        tension, torque = (load, reading.joint_torque) if cell.given.measures == "tension" else (reading.tension, load)
        return reading._replace(
            tension=tension,
            joint_torque=torque,
            bus_errors=reading.bus_errors + errors,
            foreign=reading.foreign + foreign,
        )

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        """See `hardware.ports.Drive.write`."""
        self._drive.write(target, power, now, torque)
        if self._port is not None and self._up and self._cell.synced:
            self._port.sync(frames.SYNC)

    @property
    def brake_confirmed(self) -> bool:
        """See `hardware.ports.BrakedDrive.brake_confirmed`; of a drive with a brake."""
        return cast(BrakedDrive, self._drive).brake_confirmed

    def set_brake(self, engaged: bool) -> None:
        """See `hardware.ports.BrakedDrive.set_brake`; of a drive with a brake."""
        cast(BrakedDrive, self._drive).set_brake(engaged)

    def reset_fault(self) -> None:
        """See `hardware.ports.Drive.reset_fault`."""
        self._drive.reset_fault()

    def close(self) -> TorqueLeft:
        """See `hardware.ports.Drive.close`."""
        if self._port is not None:
            self._port.synced = False  # the drive's last SYNCs wait for nobody
        left = self._drive.close()
        if self._port is not None and self._cell.given.source == "cia404":
            self._port.send(frames.NMT, bytes((frames.NMT_STOP, self._cell.given.node_id)))
        self._leave()
        return left

    def _leave(self) -> None:
        self._up = False
        if self._port is not None:
            self._port.leave()
        self._port = None


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
    if not cell.enabled:
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
