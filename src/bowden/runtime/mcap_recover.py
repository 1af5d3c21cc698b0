"""Recovery: from what a kill, a full disk or a flipped bit left of a log, a file that every reader opens."""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bowden.core.errors import OutputError
from bowden.core.files import whole_file
from bowden.runtime.mcap_log import LogFile
from bowden.runtime.mcap_read import Damage, Recording, read

TAIL = 0.2
"""Most that a recorder on a healthy disk can have had in its hands when it was killed, not yet in the file [s]."""
_CHUNK = 1000  # rows


class Recovery(NamedTuple):
    """What was saved, and what is known to be lost."""

    rows: int
    """In the new file."""
    missing: int
    """Rows before the last one that are not in it."""
    missing_seconds: float
    """Those rows' share of the run [s]."""
    tail_seconds: float
    """At most so much is missing after the last row as well; 0 where the file was closed properly [s]."""
    damage: Damage


def recover(path: Path, out: Path) -> Recovery:
    """Copy every row and event that can be read into a new file; the old one stays as it is.

    Raises:
        LogError: nothing can be read.
        OutputError: the new file is the old one, is there already, or cannot be written.
    """
    if os.path.lexists(out):
        raise OutputError(f"{out} exists", expected="the name of a new file", do="choose another with --out")
    found = read(path)
    with whole_file(out) as part:
        handle = os.open(part, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o644)
        try:
            _write(handle, found, path.name)
            os.fsync(handle)
        finally:
            os.close(handle)
    return loss(found)


def loss(found: Recording) -> Recovery:
    """What is known to be lost of a log."""
    time = found["time"]
    cycle = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    tail = 0.0 if found.closing is not None else TAIL
    return Recovery(len(time), found.missing, found.missing * cycle, tail, found.damage)


def _write(handle: int, found: Recording, name: str) -> None:
    file = LogFile(handle, found.about)
    numbers = found.numbers
    for first in range(0, len(numbers), _CHUNK):
        stretch = numbers[first : first + _CHUNK]
        kept = [event for event in found.events if stretch[0] <= event.number <= stretch[-1]]
        file.write(stretch, found.rows[first : first + _CHUNK], [e for e in kept if e.number in stretch])
    closing = found.closing or {}
    file.finish({**closing, "recovered_from": name})
