"""The recorder: a process of its own that drains the ring of a run into an MCAP file.

Three threads, so that a disk that hangs holds up nothing but itself: one drains the ring into memory and shows a sign
of life, one writes a chunk 20 times a second, one syncs the disk once a second. What the disk does not take waits in
memory, up to `MOST_WAITING` rows; then rows are dropped, and counted.
"""

import contextlib
import functools
import os
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import BowdenError, OutputError
from bowden.live.events import Changes
from bowden.live.left_behind import sweep
from bowden.live.mcap_log import LogFile, Packing, about, topics
from bowden.live.provenance import provenance
from bowden.live.ring import Batch, Description, RecorderState, Report, RingReader

DRAIN_EVERY = 10_000_000
"""[ns]"""
WRITE_EVERY = 0.05
"""A kill loses the rows since the last chunk: this, and what is just being written [s]."""
SYNC_EVERY = 1.0
"""A loss of power loses what was not synced [s]."""
MOST_WAITING = 120_000
"""Rows: two minutes at 1 kHz, 60 MB with 60 columns."""
_MOST_IN_CHUNK = 2000
_SLOW_AFTER = SECOND
_ORPHANED_AFTER = 5 * SECOND
"""Without a row and without a parent: both the loop and the operator's process are gone [ns]."""
_NICE = 5
_LEAST = 60.0
"""For this time a run's log has room on the disk when it begins, or for the whole of a shorter run [s]."""
_BESIDE = 15.0
"""What arming, preflight, the way to the beginning and the release take beside it, without an operator [s]."""


@dataclass
class _Waiting:
    """Rows that are not yet on the disk, and what became of others."""

    batches: list[Batch] = field(default_factory=list)
    count: int = 0
    since: int = 0
    """Time at which the oldest of them came [ns]."""
    dropped: int = 0


class Disk:
    """The side of the recorder that may block: chunks and syncs, each in a thread of its own.

    Args:
        handle: descriptor of an empty file.
        description: of the rows.
        more: for the file's first metadata record, beside what the description says.
        clock: where time comes from.
        write: in place of `os.write`.
        there: whether the file is still under its name; asked at each sync, and at the end.

    Raises:
        OSError: the disk does not even take the file's beginning.
    """

    def __init__(
        self,
        handle: int,
        description: Description,
        more: Mapping[str, str],
        clock: TimeSource,
        write: Callable[[int, bytes], int] = os.write,
        there: Callable[[], bool] = lambda: True,
    ) -> None:
        self._handle, self._clock, self._there = handle, clock, there
        self._file = LogFile(handle, about(description, more), write)
        self._changes = Changes(description)
        self._lock, self._end, self._synced = threading.Lock(), threading.Event(), threading.Event()
        self._waiting = _Waiting()
        self._full = self._gone = False
        self._threads = [threading.Thread(target=part, daemon=True) for part in (self._write_on, self._sync_on)]
        for thread in self._threads:
            thread.start()

    def put(self, batch: Batch) -> None:
        """Take rows to be written; never waits for the disk."""
        with self._lock:
            waiting = self._waiting
            if waiting.count + len(batch.rows) > MOST_WAITING:
                waiting.dropped += len(batch.rows)
            elif len(batch.rows):
                waiting.since = waiting.since or self._clock.now()
                waiting.batches.append(batch)
                waiting.count += len(batch.rows)

    def report(self, now: int, lost: int) -> Report:
        """State of the recorder at this instant [ns]."""
        with self._lock:
            waiting = self._waiting
            slow = waiting.since and now - waiting.since > _SLOW_AFTER
            state = RecorderState.FULL if self._full else RecorderState.SLOW if slow else RecorderState.OK
            state = RecorderState.FILE_GONE if self._gone else state
            return Report(state, now, self._file.rows, lost, waiting.dropped, waiting.count)

    def finish(self, lost: int) -> int:
        """Write what waits, end the file and sync it; rows that the file does not have because the disk took no more.

        Raises:
            OSError: the disk does not take the end of the file; what is there can be recovered.
        """
        self._end.set()
        for thread in self._threads:
            thread.join()
        self._flush()
        dropped = self._waiting.dropped + self._waiting.count
        given_up = self._file.finish({"lost": str(lost), "dropped": str(dropped)})
        os.fsync(self._handle)
        self._gone = not self._there()
        return dropped + given_up

    def _write_on(self) -> None:
        while not self._end.wait(WRITE_EVERY):
            self._flush()

    def _flush(self) -> None:
        """Write all that waits, a chunk at a time; stop at the first that the disk does not take, and keep it."""
        while True:
            with self._lock:
                batches, count = [], 0
                for batch in self._waiting.batches:
                    if count and count + len(batch.rows) > _MOST_IN_CHUNK:
                        break
                    batches.append(batch)
                    count += len(batch.rows)
            if not batches:
                return
            numbers = np.concatenate([batch.numbers for batch in batches])
            rows = np.concatenate([batch.rows for batch in batches])
            events, after = self._changes.find(numbers, rows)
            try:
                self._file.write(numbers, rows, events)
            except OSError:
                self._full = True
                return
            self._changes, self._full = after, False
            with self._lock:
                del self._waiting.batches[: len(batches)]
                self._waiting.count -= count
                self._waiting.since = self._clock.now() if self._waiting.batches else 0

    def _sync_on(self) -> None:
        while not self._end.wait(SYNC_EVERY):
            with contextlib.suppress(OSError):  # a disk that cannot sync: the writes say so
                os.fsync(self._handle)
            self._gone = not self._there()


def check_room(target: Path, description: Description, length: float) -> None:
    """Refuse a run whose log would end before the run does, or within a minute: before anything moves, and not in
    mid-motion.

    Args:
        target: the file, which need not exist.
        description: of its rows, with the sample time among the settings.
        length: of the run [s].

    Raises:
        OutputError: the disk has no room, or there is no such folder.
    """
    row = Packing(topics(description.columns, description.units)).dtype.itemsize
    least = min(_LEAST, _BESIDE + length)
    needed = round(least / float(description.settings["sample_time"])) * row
    try:
        free = shutil.disk_usage(target.parent).free
    except OSError as error:
        raise OutputError(f"cannot record to {target}: {error.strerror}", do="choose another place") from error
    if free < needed:
        raise OutputError(
            f"cannot record to {target}: the disk has {free >> 20} MB left",
            expected=f"{(needed >> 20) + 1} MB, for {least:g} s of this run",
            do="make room there, or choose another place",
        )


def record(ring: Path, target: Path, rig: str = "") -> int:
    """Drain a ring into a new file until it is closed, or the recorder is asked to stop; the whole work of the process.

    Args:
        ring: where the ring lies.
        target: the file, which must not exist.
        rig: git revision of the run's rig.toml.

    Returns:
        Rows that the file does not have.

    Raises:
        LogError: no ring.
        OutputError: the file cannot be made, or not be ended, or is not under its name any more.
    """
    clock, reader = MonotonicClock(), RingReader(ring)
    try:
        handle = os.open(target, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o644)
    except OSError as error:
        raise _refused(reader, clock, target, error) from error
    try:
        try:
            _sync_name(target)
            there = functools.partial(_is_there, target, handle)
            disk = Disk(handle, reader.description, provenance(rig), clock, there=there)
        except OSError as error:
            target.unlink(missing_ok=True)
            raise _refused(reader, clock, target, error) from error
        _drain(reader, disk, clock)
        missing = disk.finish(reader.lost)
        last = disk.report(clock.now(), reader.lost)
        if last.state == RecorderState.FILE_GONE:
            reader.recorder.write(last)
            raise _gone(target, handle)
        reader.recorder.write(last._replace(state=RecorderState.ENDED))
        return missing + reader.lost
    except OSError as error:
        _give_up(reader, clock)
        do = f"make room and recover it: bowden log recover {target}"
        raise OutputError(f"{target} could not be closed: {error.strerror}", do=do) from error
    finally:
        os.close(handle)


def _drain(reader: RingReader, disk: Disk, clock: TimeSource) -> None:
    """Move rows from the ring to the disk's memory until there is an end."""
    parent, last_row = os.getppid(), clock.now()
    while True:
        ending = reader.closed or reader.recorder.stopping  # looked at before reading: nothing comes after it
        batch = reader.read()
        disk.put(batch)
        now = clock.now()
        reader.recorder.write(disk.report(now, reader.lost))
        last_row = now if len(batch.rows) else last_row
        orphaned = os.getppid() != parent and now - last_row > _ORPHANED_AFTER
        if ending or orphaned:
            return
        clock.sleep_until(now + DRAIN_EVERY)


def _sync_name(path: Path) -> None:
    """Have the disk keep the name of a new file, too: syncing the file does not."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _is_there(path: Path, handle: int) -> bool:
    """True if a name still leads to the open file."""
    try:
        return os.path.samestat(path.stat(), os.fstat(handle))
    except OSError:
        return False


def _gone(target: Path, handle: int) -> OutputError:
    """What became of a file that is not under its name any more."""
    do = "leave a log where it is until its run has ended"
    with contextlib.suppress(OSError):
        place = Path(f"/proc/self/fd/{handle}").readlink()  # where it is now; what was removed has a name of no file
        if _is_there(place, handle):
            return OutputError(f"{target} was moved during the run, which went on: its log is {place}", do=do)
    how = "replaced by another file" if target.exists() else "removed"
    return OutputError(f"{target} was {how} during the run, which went on: what it held is lost", do=do)


def _refused(reader: RingReader, clock: TimeSource, target: Path, error: OSError) -> OutputError:
    _give_up(reader, clock)
    return OutputError(f"cannot record to {target}: {error.strerror}", do="choose another place, or make room there")


def _give_up(reader: RingReader, clock: TimeSource) -> None:
    reader.recorder.write(reader.recorder.read()._replace(state=RecorderState.FULL, heartbeat_ns=clock.now()))


def main(arguments: Sequence[str]) -> int:
    """``python -m bowden.live.recorder RING FILE [REVISION]``, with the git revision of the rig.toml."""
    ring, file, *rig = arguments
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the operator's process ends the run
    with contextlib.suppress(OSError):
        os.nice(_NICE)
    try:
        reader = RingReader(Path(ring))
        signal.signal(signal.SIGTERM, lambda *_: reader.recorder.stop())
        record(Path(ring), Path(file), *rig)
    except BowdenError as error:
        print(f"bowden: {error}", file=sys.stderr)
        return 2
    finally:
        sweep()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
