"""What the drivers of all families share: their end of the bus, bring-up, readings, the drive's state, and closing.

A driver packs and parses by hand, has no thread and never waits while a loop runs. What an angle, a state and an order
are on the wire is its family's.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from bowden.core.signals import DriveReading, DriveState
from bowden.hardware.buses.link import BusPlace, BusPort, Links
from bowden.hardware.buses.unix_bus import REMOTE
from bowden.hardware.drives import canopen_frames as canopen
from bowden.hardware.drives.findings import INERT, LagWatch
from bowden.hardware.drives.host_end import HostEnd
from bowden.hardware.drives.joint_encoder import JointEncoder, JointEncoderParameters
from bowden.hardware.drives.readings import Readings
from bowden.hardware.ports import Power, TorqueLeft

LOST = 0.1
"""Silence of a drive after which it may have started again, with other limits and another position [s]."""
SETTLED = 10
"""Orders to follow the target, in a row, after which a drive is expected to do it, and every answer is to one."""


class Driver(ABC):
    """The driver of one motor; see `hardware.ports.Drive`.

    Args:
        drive: parameters of the family, checked.
        place: of its bus.
        links: the buses of this process; of its own where none are given.
        joint: the joint's encoder beside the drive, or None.
        synced: whether the drive itself waits for a SYNC in each cycle.
        restore: see `BusPort.disturbed`.
    """

    def __init__(
        self,
        drive: Any,
        place: BusPlace,
        links: Links | None,
        joint: JointEncoderParameters | None = None,
        *,
        synced: bool = False,
        restore: Callable[[], None] | None = None,
    ) -> None:
        self._encoder = None if joint is None else JointEncoder(joint, drive.answer_timeout)
        self._syncs_encoder = self._encoder is not None and self._encoder.synced
        synced = synced or self._syncs_encoder
        self._host = HostEnd(place, drive.node_id, links, self._is_ours, synced=synced, restore=restore)
        self._readings, self._up = Readings(), False
        self.serial = ""
        """See `hardware.ports.serial_of`."""

    @abstractmethod
    def _concerns(self, identifier: int) -> bool:
        """Whether a frame is of this drive, or one that only its host may send."""

    @abstractmethod
    def _find(self, port: BusPort) -> str:
        """Find, check and configure the drive, and begin; who it is, in one line."""

    @abstractmethod
    def read(self, now: float) -> DriveReading:
        """See `hardware.ports.Drive.read`."""

    @abstractmethod
    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        """See `hardware.ports.Drive.write`."""

    @abstractmethod
    def _tell_off(self, number: int) -> None:
        """Order the torque off; so often has it been ordered before."""

    @abstractmethod
    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        """What a frame says of the torque; None of one that says nothing of it."""

    def bring_up(self) -> str:
        """See `hardware.ports.Drive.bring_up`; may be called again after a failure or a restart of the drive."""
        self._up = False
        return self._host.bring_up(self._find_all)

    def _find_all(self, port: BusPort) -> str:
        said = self._find(port)
        if self._encoder is not None:
            said += f"; joint: {self._encoder.bring_up(port.bus)}"
        self._up = True
        return said

    def _is_ours(self, identifier: int) -> bool:
        return self._concerns(identifier) or (self._encoder is not None and self._encoder.wants(identifier))

    def _reset_to(self, state: DriveState) -> None:
        """Nothing has been read or sent yet, and the drive is in that state."""
        self._state = self._before = state
        self._asked = False  # whether the cycle before asked for operation
        self._fell = False  # it has left operation by itself: it is not switched on again before power off is wanted
        self._lost = False  # it may have started again
        self._reset = False  # an operator's word for the fault
        self._led = 0  # orders to follow the target, in a row
        self._target = self._written = math.nan  # of the cycle before [rad], [s]
        self._readings.begin()

    def _update_state(self, state: DriveState) -> None:
        """Where the drive is in this cycle."""
        self._before, self._state = self._state, state

    def _has_fallen(self, power: Power) -> bool:
        """Whether the drive has left operation by itself and must not be switched on again as if nothing was.

        A drive whose master was silent for a moment may be without torque when the master is back; switching it on
        again would be a restart that nobody ordered. It is forgotten when the master itself has wanted the power off.
        """
        enabled = DriveState.OPERATION_ENABLED
        left = self._asked and self._before is enabled and self._state is not enabled
        self._fell = power is not Power.OFF and (self._fell or left)
        return self._fell

    def _check_inert(self, watch: LagWatch, now: float) -> None:
        """Whether the motor does not follow a target that it is to follow."""
        readings, led = self._readings, self._state is DriveState.OPERATION_ENABLED and self._led >= SETTLED
        fresh = readings.motor_age == 0.0
        if watch.inert(readings.motor, self._target, readings.current, now, led=led, fresh=fresh):
            readings.found(INERT)

    def _read_joint(self, identifier: int, data: bytes, now: float) -> None:
        """A frame that is not the drive's."""
        if self._encoder is None:
            return
        angle = self._encoder.read(identifier, data, now)
        if angle is not None:
            self._readings.turned(angle)
        elif self._encoder.foreign(identifier & ~REMOTE):
            self._readings.meant()

    def _sync_encoder(self) -> None:
        if self._syncs_encoder:
            self._host.sync(canopen.SYNC)

    def reset_fault(self) -> None:
        """See `hardware.ports.Drive.reset_fault`; without effect where the drive has no fault."""
        self._reset = True

    def close(self) -> TorqueLeft:
        """See `hardware.ports.Drive.close`; what the drive says after the second order is its word."""
        left = TorqueLeft.OFF
        if self._up:
            left = self._host.power_off(self._tell_off, self._torque_told)
            self._let_go(left)
            if self._encoder is not None:
                self._host.send(canopen.NMT, bytes((canopen.NMT_STOP, self._encoder.node_id)))
        self._up = False
        self._host.leave()
        return left

    def _let_go(self, left: TorqueLeft) -> None:
        """The last word to the drive, given what it has said; of most families there is none."""
        return
