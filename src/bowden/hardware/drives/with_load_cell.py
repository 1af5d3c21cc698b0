"""A drive of any family with a load cell beside it, as one `Drive`: on the drive's bus, or on one of its own."""

from typing import cast

from bowden.core.signals import DriveReading
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.place import BusPlace
from bowden.hardware.buses.unix_bus import ERROR, REMOTE
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.load_cell import LoadCellReader
from bowden.hardware.ports import BrakedDrive, Drive, Power, TorqueLeft, serial_of
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
            self._port = self._links.join(self._place, cell.node, cell.wants, synced=cell.synced, sends=cell.sends)
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
