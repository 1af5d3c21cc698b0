"""What the EMG says, in a few words of shared memory: written by the process that reads the stream, read by the loop.

The words belong together: a contraction without the time of its sample means nothing. So they stand between two moves
of a sequence number, which is odd while they change; a reader that sees an odd one, or another one after than before,
keeps what it had (a sequence lock, as in the ring). Neither side ever waits, and a writer that dies in the middle
leaves words that grow old, which the supervisor sees.
"""

import struct
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

from bowden.hardware import shared_memory


class EmgLoss(IntEnum):
    """Cause for which the newest good sample is old."""

    NONE = 0
    READER = 1
    """The process that reads the stream does not look for samples."""
    STREAM = 2
    """It looks, and none comes."""
    DEAD = 3
    """Samples come, of a signal that is flat, railed, missing or repeated."""
    NOISY = 4
    """Samples come, full of movement or mains."""


class StreamReading(NamedTuple):
    """State of the stream at its newest sample."""

    newest: int = 0
    """Time of that sample on the monotonic clock: taken or received, the earlier; 0 before the first [ns]."""
    onset: int = 0
    """When the sample was taken with which the last contraction was detected; 0 before the first [ns]."""
    samples: int = 0
    """Number of samples, missing ones included."""
    lost: int = 0
    """Number of missing samples."""
    ends: int = 0
    """End of the stream, where it is known, as of a recording; else 0 [ns]."""
    looked: int = 0
    """When its reader last looked for samples, whether any had come or not [ns]."""
    flexor: float = 0.0
    """1 while the muscle that flexes contracts."""
    extensor: float = 0.0
    """1 while the one that extends does; 0 where there is none."""
    share: float = 0.0
    """Envelope of the flexor over that of its maximum contraction, both above rest; NaN where that is unknown [–]."""
    level: float = 0.0
    """Envelope of the flexor, in the stream's unit."""
    trouble: float = 0.0
    """What is wrong with the signals, the worse of both: 0 nothing, 1 flat, missing, repeated, 2 movement or mains."""


_FORM = struct.Struct("6q5d")
"""The fields, of which the first are whole numbers."""
_WORDS = 1 + len(StreamReading._fields)


def create(path: Path) -> None:
    """Make an empty block in place of one that a killed run left.

    Raises:
        OutputError: it cannot be made.
    """
    shared_memory.create(path, _WORDS)


class _Mapped:
    """One process's view of the block."""

    def __init__(self, path: Path) -> None:
        self._memory = shared_memory.mapped(path, "block of intent", _WORDS)
        self._sequence = memoryview(self._memory).cast("q")[:1]
        self._barrier = shared_memory.Barrier()


class IntentWriter(_Mapped):
    """The side of the process that reads the stream; there must be one only.

    Raises:
        LogError: there is no block.
    """

    def write(self, reading: StreamReading) -> None:
        """Put all words, as one."""
        self._sequence[0] += 1
        self._barrier()
        _FORM.pack_into(self._memory, 8, *reading)
        self._barrier()
        self._sequence[0] += 1


class IntentReader(_Mapped):
    """The side of the loop, or of a screen.

    Raises:
        LogError: there is no block.
    """

    _kept = StreamReading()

    def read(self) -> StreamReading:
        """The newest words; those of the last call where they are just being written."""
        before = self._sequence[0]
        self._barrier()
        words = _FORM.unpack_from(self._memory, 8)
        self._barrier()
        if before % 2 == 0 and self._sequence[0] == before:
            self._kept = StreamReading(*words)
        return self._kept
