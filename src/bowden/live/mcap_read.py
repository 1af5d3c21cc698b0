"""The log of a run in memory: whole, some of its columns, or as traces of a part of its rows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.trace import Trace
from bowden.live.mcap_layout import Event
from bowden.live.mcap_reader import Damage, LogReader, missing_of

_TRACE = 50_000  # rows


@dataclass(frozen=True)
class Recording:
    """What a log holds."""

    about: dict[str, str]
    """The first metadata record: settings, versions, host and start, as text."""
    closing: dict[str, str] | None
    """The last metadata record; None where the file was not closed properly."""
    columns: tuple[str, ...]
    units: tuple[str, ...]
    numbers: NDArray[np.int64]
    """Of each row since the run's begin, from 0 (n,)."""
    rows: NDArray[np.float64]
    """(n, width)"""
    events: list[Event]
    damage: Damage
    settings: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.rows[:, self.columns.index(name)]

    @property
    def missing(self) -> int:
        """Rows that the loop wrote and that are not here: before the last one, and after it as far as the log says."""
        return missing_of(int(self.numbers[-1]) if len(self.numbers) else -1, len(self.numbers), self.closing)

    @property
    def whole(self) -> bool:
        """Closed properly, and nothing in it changed since."""
        return self.closing is not None and self.damage == Damage(0, 0, 0)

    def trace(self) -> Trace:
        """All rows as a trace with units, settings and seed; what else the file says of its run is in ``settings.log``.

        Raises:
            LogError: there is no row.
        """
        return _trace(self, self.rows)


def read(path: Path, only: Sequence[str] | None = None) -> Recording:
    """Everything that can be read of a log; what is damaged is left out and counted, never guessed.

    Args:
        path: of the log.
        only: the columns to keep of those that it has, so that the log of hours fits into memory; all by default.

    Raises:
        LogError: no such file, none that bowden wrote, or its beginning is damaged.
    """
    log = LogReader(path, only)
    numbers, rows = np.empty(log.most, np.int64), np.empty((log.most, len(log.columns)))
    n = 0
    events: list[Event] = []
    for piece in log:
        end = n + len(piece.numbers)
        numbers[n:end], rows[n:end] = piece.numbers, piece.rows
        n = end
        events += piece.events
    numbers, rows = numbers[:n], rows[:n]
    return Recording(log.about, log.closing, log.columns, log.units, numbers, rows, events, log.damage, log.settings)


def traces(log: LogReader) -> Iterator[Trace]:
    """All rows of a log as traces of some ten thousand rows, each as `Recording.trace` has them all.

    Raises:
        LogError: there is no row.
    """
    waiting: list[NDArray[np.float64]] = []
    for piece in log:
        waiting.append(piece.rows)
        if sum(map(len, waiting)) >= _TRACE:
            yield _trace(log, np.concatenate(waiting))
            waiting = []
    if waiting or not log.count:
        yield _trace(log, np.concatenate([np.empty((0, len(log.columns))), *waiting]))


def _trace(log: Recording | LogReader, rows: NDArray[np.float64]) -> Trace:
    if not len(rows):
        raise LogError("the log has no row", do="it cannot be used")
    kept = ("columns", "units", "settings", "crc32")
    about = {name: value for name, value in log.about.items() if name not in kept}
    columns = {name: np.ascontiguousarray(rows[:, i]) for i, name in enumerate(log.columns)}
    units = dict(zip(log.columns, log.units, strict=True))
    return Trace(columns, units, {**log.settings, "log": about}, log.settings.get("seed"))
