"""What a live run needs of a drive, and of a stream of EMG."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bowden.core.signals import DriveReading
from bowden.core.signals import Power as Power  # what a drive is written


class TorqueLeft(IntEnum):
    """State of a drive's torque after its host has gone."""

    OFF = 0
    """The drive has said that it has none."""
    UNKNOWN = 1
    """It has not said so: it is silent."""
    ON = 2
    """It still has torque, as it says or as its current does."""


TORQUE_LEFT = {
    TorqueLeft.OFF: "",
    TorqueLeft.UNKNOWN: "the drive has not confirmed that its torque is off: assume it is on, press the emergency stop",
    TorqueLeft.ON: "the drive still has torque although it was switched off: press the emergency stop now",
}
"""What it means for the operator."""


def torque_left(left: TorqueLeft, *, twin: bool) -> str:
    """The same in words; of a twin, which has no motor that anybody could stop; empty where the torque is off."""
    if not twin or left == TorqueLeft.OFF:
        return TORQUE_LEFT[left]
    return "the twin has not confirmed that its torque is off; no motor has any: nothing is to be done"


def serial_of(drive: "Drive") -> str:
    """The maker's serial number of a drive that was brought up; empty of one that tells none."""
    return str(getattr(drive, "serial", ""))  # a user's own family need not have it


class Drive(Protocol):
    """A position-controlled motor drive with a motor and a joint angle."""

    def bring_up(self) -> str:
        """Find, check and configure the drive, motor without power; who it is, in one line.

        May be called again after a failure.

        Raises:
            DriveError: no bus, no drive, one that cannot do what is asked of it, or limits beyond its own.
        """
        ...

    def read(self, now: float) -> DriveReading:
        """All that has arrived since the last cycle; never waits, never raises."""
        ...

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        """Send the motor's target angle [rad], the wanted power state, and the sign of life that the drive waits for.

        `torque` is what the drive adds at the spool [N·m], where the rig has it do so, and never beyond its bound.

        Goes through the drive's states by itself, but never leaves a fault by itself, and does not switch a drive on
        again that has switched itself off before `Power.OFF` has been wanted. A target that is no number, or beyond
        what can be sent, is never sent: the torque goes off. Enabling the drive moves nothing.
        """
        ...

    def reset_fault(self) -> None:
        """Let the next cycle reset a fault; on an operator's word only."""
        ...

    def close(self) -> TorqueLeft:
        """Power off, and let go of the bus; safe to call twice.

        Returns:
            What the drive says of its torque by then; `TorqueLeft.OFF` of a drive that was never brought up.
        """
        ...


class BrakedDrive(Drive, Protocol):
    """A drive with an output for a holding brake."""

    @property
    def brake_confirmed(self) -> bool:
        """True if the drive has said that this output is as it was told."""
        ...

    def set_brake(self, engaged: bool) -> None:
        """Let the next `write` engage or release the brake; a `write` without torque releases it whatever was said."""
        ...


class EmgChunk(NamedTuple):
    """Samples of a stream since the last read."""

    values: NDArray[np.float64]
    """In the stream's unit, NaN where a sample is missing (n, channels)."""
    times: NDArray[np.float64]
    """Time of each sample, on this computer's monotonic clock; increasing (n,) [s]."""


def one_chunk(chunks: Sequence[EmgChunk], channels: int) -> EmgChunk:
    """Chunks as one, in their order."""
    empty = EmgChunk(np.empty((0, channels)), np.empty(0))
    return EmgChunk(*(np.concatenate(parts) for parts in zip(empty, *chunks, strict=True)))


class EmgStream(Protocol):
    """A source of EMG in real time: Lab Streaming Layer, a Trigno base station, a recording that is played back."""

    rate: float
    """Nominal samples a second and channel; known once it is open [Hz]."""
    channels: tuple[str, ...]
    """Names of the channels; known once it is open."""
    unit: str
    """Of the values, such as ``mV``; known once it is open."""

    def open(self) -> str:
        """Find, check and start the stream; what it is, in one line.

        Raises:
            StreamError: no such stream, more than one, or one that is not what was asked for.
        """
        ...

    def read(self, now: float) -> EmgChunk:
        """All that has arrived by `now` [s]; never waits, never raises."""
        ...

    def lost(self) -> str:
        """Why nothing comes any more; empty while the stream is alive. It may come to life again."""
        ...

    def close(self) -> None:
        """Let go of the stream; safe to call twice."""
        ...
