"""The ring in shared memory: one float64 row a cycle, from a writer that never waits to a reader that may come late.

It is a file in ``/dev/shm`` that both sides map; so it outlives a killed process, and nobody but its owner removes it
(the resource tracker of `multiprocessing.shared_memory` unlinks a block when any process that opened it ends).

    words of int64 | description as JSON | capacity slots of (row number + 1, width float64 values)

A slot's number is set to 0 before its row changes and to the row's number + 1 afterwards, and the head of the ring
counts last. A reader trusts a row whose number is right both before and after it was copied (a sequence lock, Lameter,
"Effective synchronization on Linux/NUMA systems", 2005); a row overtaken by the writer is lost, and counted.
"""

import json
import mmap
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, OutputError
from bowden.hardware.shared_memory import Barrier, mapped

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


Row = NDArray[np.float64]

FOLDER = Path("/dev/shm")
CAPACITY = 32768
"""Rows that a ring holds by default: 32.8 s at 1 kHz."""

_MAGIC = int.from_bytes(b"BWDNRING", "little")
_VERSION = 1
_MAGIC_WORD, _VERSION_WORD, _CAPACITY_WORD, _WIDTH_WORD, _JSON_WORD, _HEAD_WORD, _CLOSED_WORD = range(7)
_HEADER = 8 * WORDS


@dataclass(frozen=True)
class Description:
    """Meaning of the rows of a ring."""

    columns: tuple[str, ...]
    """Names, ``time`` [s] among them; ``law.<name>`` and ``supervisor.<name>`` are the states of these two."""
    units: tuple[str, ...]
    """A unit for each column, as `records.trace.Trace` prints them."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """All that made the run, as JSON values."""
    start_utc_ns: int = 0
    """Wall clock when the column ``time`` was zero [ns since 1970]."""
    start_monotonic_ns: int = 0
    """Monotonic clock at that instant [ns]."""

    def __post_init__(self) -> None:
        if len(self.columns) != len(self.units) or len(set(self.columns)) != len(self.columns) or not self.columns:
            raise ValueError(f"{len(self.columns)} columns {self.columns} with {len(self.units)} units")
        if "time" not in self.columns:
            raise ValueError(f"no column time among {self.columns}")


class Batch(NamedTuple):
    """Rows that came out of a ring, copied."""

    numbers: NDArray[np.int64]
    """Number of each row since the run's begin, from 0; a gap is a row that was lost (n,)."""
    rows: NDArray[np.float64]
    """(n, width)"""


def create(path: Path, description: Description, capacity: int = CAPACITY) -> None:
    """Make an empty ring; the memory is taken now, so that no later write can fail for want of it.

    Raises:
        OutputError: there is such a ring already, or no room for it.
    """
    text = json.dumps(asdict(description)).encode()
    width = len(description.columns)
    size = _rows_offset(len(text)) + capacity * 8 * (width + 1)
    try:
        handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600)
    except FileExistsError as error:
        raise OutputError(
            f"{path} exists", expected="no other run of this rig", do="end it, or remove the file"
        ) from error
    except OSError as error:
        raise OutputError(f"cannot make {path}: {error.strerror}", do="make room in its folder") from error
    try:
        os.posix_fallocate(handle, 0, size)  # a file only truncated to its size would end the loop by SIGBUS when full
        with mmap.mmap(handle, size) as memory:
            words = np.frombuffer(memory, np.int64, WORDS)
            memory[_HEADER : _HEADER + len(text)] = text
            words[_VERSION_WORD : _JSON_WORD + 1] = (_VERSION, capacity, width, len(text))
            words[_MAGIC_WORD] = _MAGIC
            del words
    except OSError as error:
        path.unlink()
        raise OutputError(f"no room for {path} ({size} bytes): {error.strerror}", do="free memory") from error
    finally:
        os.close(handle)


class _Mapped:
    """One process's view of a ring."""

    def __init__(self, path: Path) -> None:
        memory = mapped(path, "ring")  # the views below keep it
        if (size := len(memory)) < _HEADER:
            raise LogError(f"{path} has {size} bytes", expected="a ring of this version of bowden")
        self.path = path
        self._words = memoryview(memory)[:_HEADER].cast("q")  # half the time of a numpy array for single words
        magic, version, capacity, width, length = self._words[: _JSON_WORD + 1].tolist()
        offset = _rows_offset(length)
        if (
            (magic, version) != (_MAGIC, _VERSION)
            or min(capacity, width) < 1
            or offset + capacity * 8 * (width + 1) > size
        ):
            raise LogError(f"{path} is no ring of this version of bowden", do="remove it")
        try:
            given: dict[str, Any] = json.loads(memory[_HEADER : _HEADER + length])
            given |= {"columns": tuple(given["columns"]), "units": tuple(given["units"])}
            self.description = Description(**given)
        except (KeyError, TypeError, ValueError) as error:
            raise LogError(f"{path} does not say what its rows are: {error}", do="remove it") from error
        self.capacity: int = capacity
        self._slots = np.frombuffer(memory, np.float64, capacity * (width + 1), offset).reshape(capacity, width + 1)
        self._numbers = self._slots.view(np.int64)[:, 0]
        self.recorder = RecorderStatus(self._words)
        self._barrier = Barrier()

    @property
    def head(self) -> int:
        """Rows published since the ring was made."""
        return self._words[_HEAD_WORD]

    @property
    def closed(self) -> bool:
        """True if the writer said that no further row will come."""
        return bool(self._words[_CLOSED_WORD])


class RingWriter(_Mapped):
    """The side of the loop; there must be one only.

    Fill what `next_row` hands out, or `bytes` from `next_place` on, and call `publish`; or hand a whole row to `write`.

    Raises:
        LogError: no such ring.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.bytes = self._slots.data.cast("B")
        """All slots; what packs numbers into them is quicker than a numpy array, and allocates nothing in the loop."""
        self._slot = self._slots.itemsize * self._slots.shape[1]
        self._places = self._numbers.data
        self._count = self.head

    def next_place(self) -> int:
        """Where in `bytes` the next row begins, which is to be filled; it still holds the row that is overwritten."""
        at = self._count % self.capacity
        self._places[at] = 0
        self._barrier()
        return at * self._slot + 8

    def next_row(self) -> Row:
        """The same as an array (width,)."""
        self.next_place()
        row: Row = self._slots[self._count % self.capacity, 1:]
        return row

    def publish(self) -> None:
        """Hand the row that was filled to the readers."""
        at = self._count % self.capacity
        self._count += 1
        self._barrier()
        self._places[at] = self._count
        self._barrier()
        self._words[_HEAD_WORD] = self._count

    def write(self, row: Row) -> None:
        """Copy a row (width,) into the ring and publish it."""
        self.next_row()[:] = row
        self.publish()

    def close(self) -> None:
        """Say that no further row will come."""
        self._words[_CLOSED_WORD] = 1


class RingReader(_Mapped):
    """The side of the recorder, the screen or a test; any number of them, none of which the writer notices.

    Each belongs to one thread: it counts what it has read, and its barrier is a lock that one thread takes.

    Args:
        path: of the ring.
        from_now: begin with the next row to come, in place of the oldest that is still there.

    Raises:
        LogError: no such ring.
    """

    def __init__(self, path: Path, *, from_now: bool = False) -> None:
        super().__init__(path)
        self.next = self.head if from_now else 0
        """Number of the row to be read next."""
        self.lost = 0
        """Rows that were overwritten before they could be read."""

    def read(self, most: int | None = None) -> Batch:
        """All rows since the last call, or the oldest `most` of them."""
        head = self.head
        self._barrier()
        first = max(self.next, head - self.capacity)
        end = head if most is None else min(head, first + most)
        wanted = np.arange(first, end)
        slots = wanted % self.capacity
        before = self._numbers[slots]
        self._barrier()
        rows = self._slots[slots, 1:]
        self._barrier()
        good = (before == wanted + 1) & (self._numbers[slots] == wanted + 1)
        self.lost += (first - self.next) + int(len(wanted) - good.sum())
        self.next = end
        return Batch(wanted[good], rows[good])

    def last(self) -> Row | None:
        """The newest row (width,), copied; None before the first, or where the writer was quicker."""
        head = self.head
        at = (head - 1) % self.capacity
        self._barrier()
        row: Row = self._slots[at, 1:].copy()
        self._barrier()
        return row if head and self._numbers[at] == head else None


def _rows_offset(json_length: int) -> int:
    """Where the slots begin: on the next page [bytes]."""
    return -(-(_HEADER + json_length) // mmap.PAGESIZE) * mmap.PAGESIZE
