"""Recovery: from what a kill, a full disk or a flipped bit left of a log, a file that every reader opens."""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bowden.core.errors import OutputError
from bowden.core.files import whole_file
from bowden.live.mcap_log import LogFile
from bowden.live.mcap_reader import Damage, LogReader

TAIL = 0.2
"""Most that a recorder on a healthy disk can have had in its hands when it was killed, not yet in the file [s]."""
_ENOUGH = 10  # cycles from which the length of one is known


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
    log = LogReader(path)
    with whole_file(out) as part:
        handle = os.open(part, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o644)
        try:
            saved = _copy(handle, log, path.name)
            os.fsync(handle)
        finally:
            os.close(handle)
    return saved


def _copy(handle: int, log: LogReader, name: str) -> Recovery:
    """Write every piece of a log, and say what is missing of it."""
    file, time = LogFile(handle, log.about), log.columns.index("time")
    steps = np.empty(0)
    for piece in log:
        numbers = piece.numbers
        if len(numbers):
            file.write(numbers, piece.rows, [event for event in piece.events if event.number in numbers])
            steps = np.diff(piece.rows[:, time]) if len(steps) < _ENOUGH else steps
    file.finish({**(log.closing or {}), "recovered_from": name})
    cycle, tail = float(np.median(steps)) if len(steps) else 0.0, 0.0 if log.closing is not None else TAIL
    return Recovery(log.count, log.missing, log.missing * cycle, tail, log.damage)
