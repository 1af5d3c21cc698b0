"""What the twin's process needs of the drive that it plays, of whatever family: a node on a CAN bus."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.plant import TwinPlant

Send = Callable[[int, bytes], None]
"""Puts a frame on the bus: identifier, with the flags of `buses.unix_bus`, and data."""

Journal = Callable[[float, str, str], None]
"""Takes what happened: time [s], event, detail. Every family says ``torque_on`` and ``torque_off``."""


class BesideNode(Protocol):
    """A device beside the drive, in the same process."""

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """A frame from its bus; an extended identifier has the flag of `buses.unix_bus`."""
        ...

    def tick(self, now: float) -> None:
        """Let time pass."""
        ...


class TwinNode(Protocol):
    """One drive. Frames come in and go out as numbers and bytes, and time is an argument."""

    bench: TwinPlant
    """Behind the drive."""
    faults: Faults
    """What has been injected."""
    scenario_noted: bool
    """Whether the sheath's motion has begun, or somebody has said when it does."""
    patience: float
    """How long a silent host is waited for while there is torque [s]; 0: no longer than the drive itself does."""
    lacks: Mapping[str, str]
    """Faults that a drive of this family cannot have, as ``reboot`` or ``encoder_nan motor`` → why."""

    def receive(self, identifier: int, data: bytes, now: float) -> None:
        """A frame from the bus; an extended identifier, and a remote frame, have the flags of `buses.unix_bus`."""
        ...

    def tick(self, now: float) -> None:
        """Let time pass."""
        ...

    def status(self) -> dict[str, Any]:
        """What the drive knows of itself, for `bowden twin --status`.

        ``state``, a name of `core.signals.DriveState`; ``torque``, whether the motor may have it; ``error_code``, 0 for
        none; ``last_heartbeat``, when the host last sent something [s] or None; and what else this family has.
        """
        ...
