"""Blocks of words in shared memory, from one process to another."""

import mmap
import os
import threading
from pathlib import Path

from bowden.core.errors import LogError, OutputError


def create(path: Path, words: int) -> None:
    """Make an empty block of this many words in place of one that a killed run left.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        path.unlink(missing_ok=True)
        with os.fdopen(os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600), "wb") as file:
            file.write(bytes(8 * words))
    except OSError as error:
        raise OutputError(f"cannot make {path}: {error.strerror}", do="make room in its folder") from error


def mapped(path: Path, what: str, words: int = 0) -> mmap.mmap:
    """A block that was made before, in this process's memory; populated, so that no cycle waits for a page.

    Args:
        path: of the block.
        what: it is, for a message.
        words: of it; 0 for all that it has.

    Raises:
        LogError: there is none.
    """
    try:
        handle = os.open(path, os.O_RDWR)
        try:
            return mmap.mmap(handle, 8 * words, mmap.MAP_SHARED | mmap.MAP_POPULATE)
        finally:
            os.close(handle)
    except (OSError, ValueError) as error:
        raise LogError(f"cannot open the {what} {path}: {error}", do="start the run first") from error


class Barrier:
    """Called, it lets no access to memory move across; Python has a lock, let go and taken again, for that."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lock.acquire()

    def __call__(self) -> None:
        """See the class."""
        self._lock.release()
        self._lock.acquire()
