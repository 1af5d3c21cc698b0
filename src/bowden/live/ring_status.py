"""What the recorder says about itself, in the first words of the ring, where loop and operator see it at no cost."""

from enum import IntEnum
from typing import NamedTuple

WORDS = 64
"""int64 words at the beginning of a ring; the recorder's are apart from the writer's, on cache lines of their own."""

_FIRST = 16
_STOP = 32
_DEAD_AFTER = 1_000_000_000
"""Age of the heartbeat at which a recorder counts as dead [ns]; it beats 100 times a second."""


class RecorderState(IntEnum):
    """State of the recorder; a new run is armed with `OK` only."""

    ABSENT = 0
    """None has begun with this ring."""
    OK = 1
    """Every row so far is on its way to the disk, and none waits longer than a second."""
    SLOW = 2
    """The disk is behind by more than a second; rows wait in memory."""
    FULL = 3
    """The disk takes nothing: full, read-only or gone. Rows are dropped, and counted."""
    DEAD = 4
    """No sign of life for a second."""
    ENDED = 5
    """It closed its file properly."""
    FILE_GONE = 6
    """Its file is no longer under its name: removed, replaced or moved."""


class Report(NamedTuple):
    """The recorder's words."""

    state: int
    """A `RecorderState`; never `DEAD`, which the dead cannot say."""
    heartbeat_ns: int
    """Monotonic clock at the last sign of life [ns]."""
    rows: int
    """Rows written to the file."""
    lost: int
    """Rows that were overwritten in the ring before the recorder came."""
    dropped: int
    """Rows that the disk did not take."""
    waiting: int
    """Rows in the recorder's memory."""


class RecorderStatus:
    """Reader's and writer's view of the recorder's words in a ring."""

    def __init__(self, words: "memoryview[int]") -> None:
        self._words = words[_FIRST : _FIRST + len(Report._fields)]
        self._stop = words[_STOP : _STOP + 1]

    def write(self, report: Report) -> None:
        """The recorder's own; the heartbeat goes last."""
        for i, value in enumerate(report[2:], 2):
            self._words[i] = value
        self._words[0] = report.state
        self._words[1] = report.heartbeat_ns

    def read(self) -> Report:
        """Last report of the recorder."""
        return Report(*self._words.tolist())

    def state(self, now_ns: int) -> int:
        """A `RecorderState` at this instant of the monotonic clock [ns]; cheap enough for the loop."""
        state = self._words[0]
        alive = state in (RecorderState.ABSENT, RecorderState.ENDED) or now_ns - self._words[1] <= _DEAD_AFTER
        return state if alive else int(RecorderState.DEAD)

    def stop(self) -> None:
        """Tell the recorder to drain what is there and to close its file."""
        self._stop[0] = 1

    @property
    def stopping(self) -> bool:
        """True if it was asked to."""
        return bool(self._stop[0])
