"""Recovery: from what a kill, a full disk or a flipped bit left of a log, a file that every reader opens."""

import os
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

import numpy as np

from bowden.core.errors import LogError, OutputError
from bowden.core.files import whole_file
from bowden.live.figures import Damage, Recovery
from bowden.live.mcap_log import LogFile
from bowden.live.mcap_read import LogReader, missing_of

TAIL = 0.2
"""Most that a recorder on a healthy disk can have had in its hands when it was killed, not yet in the file [s]."""
_ENOUGH = 10  # cycles from which the length of one is known


def recover(path: Path, out: Path, more: Sequence[Path] = ()) -> Recovery:
    """Copy every row and event that can be read into a new file; the old ones stay as they are.

    Args:
        path: of the log.
        out: the new file.
        more: files of the same run, of recorders that went on where another one had ended; rows that two of them have
            are written once.

    Raises:
        LogError: nothing can be read, or the files are not of one run.
        OutputError: the new file is an old one, is there already, or cannot be written.
    """
    if os.path.lexists(out):
        raise OutputError(f"{out} exists", expected="the name of a new file", do="choose another with --out")
    logs = sorted((LogReader(one) for one in dict.fromkeys((path, *more))), key=LogReader.first_number)
    for log in logs[1:]:
        if any(log.about.get(key) != logs[0].about.get(key) for key in _OF_A_RUN):
            raise LogError(f"{path} and {log.path} are of two runs", do="recover each of them separately")
    with whole_file(out) as part:
        handle = os.open(part, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o644)
        try:
            saved = _copy(handle, logs)
            os.fsync(handle)
        finally:
            os.close(handle)
    return saved


_OF_A_RUN = ("columns", "units", "settings", "start_utc_ns", "start_monotonic_ns")
"""What two files of one run say alike."""


def _copy(handle: int, logs: Sequence[LogReader]) -> Recovery:
    """Write every piece of a run's logs, and say what is missing of it."""
    file, time = LogFile(handle, logs[0].about), logs[0].columns.index("time")
    steps, last, count = np.empty(0), -1, 0
    for log in logs:
        for piece in log:
            new = piece.numbers > last
            numbers, rows = piece.numbers[new], piece.rows[new]
            if len(numbers):
                file.write(numbers, rows, [event for event in piece.events if event.number in numbers])
                steps = np.diff(rows[:, time]) if len(steps) < _ENOUGH else steps
                last, count = int(numbers[-1]), count + len(numbers)
    end = logs[-1]
    closing = end.closing or {}
    if len(logs) > 1:  # a later recorder has not lost what another one has written
        reported = missing_of(-1, 0, {**closing, "lost": "0"})
        closing = closing | {"lost": str(max(0, last + 1 - count - reported))}
    file.finish({**closing, "recovered_from": " ".join(log.path.name for log in logs)})
    missing = missing_of(last, count, closing)
    cycle, tail = float(np.median(steps)) if len(steps) else 0.0, 0.0 if end.closing is not None else TAIL
    damage = Damage(*(sum(parts) for parts in zip(*(astuple(log.damage) for log in logs), strict=True)))
    return Recovery(count, missing, round(missing * cycle, 6), tail, damage)
