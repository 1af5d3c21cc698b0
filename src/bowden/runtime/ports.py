"""What the live loop needs of a drive."""

from enum import IntEnum
from typing import Protocol

from bowden.core.signals import DriveReading


class Power(IntEnum):
    """What the supervisor wants of the drive, in order of caution from the last."""

    OFF = 0
    """Torque off now; the drive's disable voltage."""
    QUICK_STOP = 1
    """The drive's own quick stop, and then off."""
    READY = 2
    """Switched on without torque."""
    ON = 3
    """Operation enabled: the motor follows the target."""


class Drive(Protocol):
    """A position-controlled motor drive with a motor and a joint angle."""

    def bring_up(self) -> str:
        """Find, check and configure the drive, motor without power; who it is, in one line.

        Raises:
            DriveError: no bus, no drive, one that cannot do what is asked of it, or limits beyond its own.
        """
        ...

    def read(self, now: float) -> DriveReading:
        """All that has arrived since the last cycle; never waits, never raises."""
        ...

    def write(self, target: float, power: Power, now: float) -> None:
        """Send the motor's target angle [rad] and the wanted power state, then SYNC, and the heartbeat when it is due.

        Goes through the states of CiA 402 by itself, one step a cycle, but never leaves a fault by itself.
        """
        ...

    def reset_fault(self) -> None:
        """Let the next cycle send the fault reset; on an operator's word only."""
        ...

    def close(self) -> None:
        """Power off, NMT stop, and let go of the bus; safe to call twice."""
        ...
