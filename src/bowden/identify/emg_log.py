"""Reading and checking recordings of EMG, and labels of contractions."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.identify.checks import check_finite, even_time
from bowden.identify.columns import FACTORS, split_name
from bowden.identify.table import read_table
from bowden.sensing.onset import QUICKEST, SLOWEST

Array = NDArray[np.float64]

_TIMES = ("time", "t", "timestamp", "seconds", "sec", "clock")
_SHORTEST = 2.0
"""A recording of less has no rest to speak of [s]."""
_CLIPPED = 0.02
"""Share of samples at an end of the range above which a recording counts as clipped."""


@dataclass(frozen=True)
class EmgLog:
    """One channel of a recording that is fit to be looked at."""

    values: Array
    """In the file's unit (n,)."""
    rate: float
    """Samples a second [Hz]."""
    start: float
    """Time of the first sample [s]."""
    channel: str
    """Name of the column."""
    warnings: tuple[str, ...]


def read_emg(path: Path, channel: str | None = None) -> EmgLog:
    """Read one channel of a recording.

    Args:
        path: ``.csv``, ``.csv.gz`` or ``.parquet`` with a column of times and one or more of EMG.
        channel: name of the column; the first that is not the time where it is not given.

    Raises:
        LogError: no such file or column, text or NaN in it, an uneven clock, a rate that the detector does not take,
            too short, flat, or clipped; one line that says where.
    """
    table = _read(path)
    times = [name for name in table if split_name(name)[0] in _TIMES]
    if not times:
        raise LogError(f"{path}: no column of times among {_listed(table)}", expected="a column such as time_s")
    time_name, others = times[0], [name for name in table if name not in times]
    if channel is not None and channel not in others:
        raise LogError(f"{path}: no channel {channel!r} among {_listed(others)}", do="name one of them with --channel")
    if not others:
        raise LogError(f"{path}: no channel beside {time_name!r}", expected="a column such as emg_mV")
    name = channel if channel is not None else others[0]

    def where(sample: int) -> str:
        return f"{path}, row {sample + 1}"

    time = _numbers(table, time_name, path) * FACTORS.get(split_name(time_name)[1] or "s", 1.0)
    values = _numbers(table, name, path)
    if len(time) < 2:
        raise LogError(f"{path} has {len(time)} samples", expected=f"at least {_SHORTEST:g} s of EMG")
    check_finite(time_name, time, where)
    check_finite(name, values, where)
    even, warnings = even_time(time, where)
    if even is not time:
        values = np.interp(even, time, values)
    rate = (len(even) - 1) / float(even[-1] - even[0])
    if not SLOWEST <= rate <= QUICKEST:
        raise LogError(
            f"{path}: {rate:.4g} samples a second",
            expected=f"{SLOWEST:g} to {QUICKEST:g} Hz",
            do="look at the unit of the time (time_s, time_ms), or resample",
        )
    if len(values) < _SHORTEST * rate:
        raise LogError(f"{path}: {len(values) / rate:.3g} s", expected=f"at least {_SHORTEST:g} s of EMG")
    if channel is None and len(others) > 1:
        warnings = [*warnings, f"{len(others)} channels, {name!r} is taken"]
    _check_signal(name, values, path)
    return EmgLog(values, rate, float(even[0]), name, tuple(warnings))


def read_labels(path: Path) -> list[tuple[float, float]]:
    """Onset and end of contractions from a CSV with the columns ``onset_s`` and ``offset_s``, in order [s].

    Raises:
        LogError: not readable, other columns, or times that are no contractions in order.
    """
    table = _read(path)
    names = {split_name(name)[0]: name for name in table}
    if not {"onset", "offset"} <= set(names):
        raise LogError(f"{path}: columns {_listed(table)}", expected="onset_s and offset_s")
    onset, end = (_numbers(table, names[name], path) for name in ("onset", "offset"))
    order = np.ravel(np.column_stack([onset, end]))
    if not np.all(np.isfinite(order)) or not np.all(np.diff(order) > 0.0):
        bad = int(np.argmin(np.concatenate([np.diff(order) > 0.0, [False]]))) // 2
        raise LogError(
            f"{path}, row {bad + 1}: contractions overlap or are out of order", expected="onset < offset < next onset"
        )
    return [(float(first), float(last)) for first, last in zip(onset, end, strict=True)]


def _check_signal(name: str, values: Array, path: Path) -> None:
    low, high = float(values.min()), float(values.max())
    if not high > low:
        raise LogError(f"{path}: {name} is {low:g} in every sample", do="look at the electrode, its cable and the gain")
    clipped = float(np.mean((values == low) | (values == high)))
    if clipped > _CLIPPED and len(np.unique(values)) > 16:
        raise LogError(
            f"{path}: {100 * clipped:.1f} % of {name} stand at an end of its range ({low:g} or {high:g})",
            expected=f"at most {100 * _CLIPPED:g} %",
            do="lower the amplifier's gain and record again",
        )


def _read(path: Path) -> dict[str, Array]:
    table = read_table(path)
    return dict(zip(table.column_names, (column.to_numpy() for column in table.columns), strict=True))


def _numbers(table: dict[str, Array], name: str, path: Path) -> Array:
    column = table[name]
    if column.dtype.kind in "fiub":
        return np.asarray(column, dtype=np.float64)
    for row, value in enumerate(column):
        try:
            float(value)
        except (TypeError, ValueError):
            raise LogError(f"{path}, row {row + 1}: {name} is {value!r}", expected="a number") from None
    return np.asarray(column, dtype=np.float64)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(repr(name) for name in islice(names, 12)) or "none"
