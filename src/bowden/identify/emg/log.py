"""Reading and checking recordings of EMG, and labels of contractions."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.identify.log.clock import check_finite, even_clock
from bowden.identify.log.columns import FACTORS, TIMES, split_name
from bowden.records.table import Table, read_table
from bowden.records.units import unit_of
from bowden.sensing.onset_settings import LARGEST, QUICKEST, SAFE, SLOWEST

Array = NDArray[np.float64]

_LABELS = (("onset", "start"), ("offset", "end"))
"""Names of the columns of labels."""
_SHORTEST = 2.0
"""A recording of less has no rest to speak of [s]."""
_RATE_ERROR = 0.01
"""How far the times may be from a declared rate."""
_UNIT = re.compile(r"[_\s(\[]([mµu]?V)[)\]]?$")
"""At the end of a column's name."""
_VOLTS = {"V": 1.0, "mV": 1e-3, "µV": 1e-6, "uV": 1e-6}
"""Unit → V."""
_MOST_VOLTS, _MOST = 100.0, LARGEST
"""Larger values no amplifier gives: in volts, and as numbers in no known unit, such as counts of a converter."""
_CLIPPED = 0.02
"""Share of samples at an end of the range above which a recording counts as clipped."""
_DEAD = 0.02
"""A value that lasts this long is no signal, as the detectors have it [s]."""
_COARSE, _SATURATED = 16, 0.5
"""A converter with this few steps is at an end of its range more often; above this share that is clipped, too."""


@dataclass(frozen=True)
class EmgRecording:
    """Channels of a recording, each fit to be looked at."""

    values: Array
    """In the file's unit: of channels that were read together (n, channels), of one that was read alone (n,)."""
    rate: float
    """Samples a second and channel [Hz]."""
    start: float
    """Time of the first sample [s]."""
    channels: tuple[str, ...]
    """Names of the columns."""
    unit: str
    """That all channels' names end in, such as ``mV``; empty where they do not."""
    warnings: tuple[str, ...]
    name: str = "the recording"
    """Of the recording, for messages."""

    @property
    def channel(self) -> str:
        """Name of the first."""
        return self.channels[0]


def read_emg(path: Path, channel: str | None = None, rate: float | None = None) -> EmgRecording:
    """Read one channel of a recording.

    Args:
        path: ``.csv``, ``.csv.gz``, ``.npz`` or ``.parquet`` with a column of times and one or more of EMG.
        channel: name of the column; the first that is not the time where it is not given.
        rate: samples a second, as they are declared elsewhere; a file without times needs it [Hz].

    Raises:
        LogError: no such file or column, text or NaN in it, an uneven clock, a rate that the detector does not take or
            that is not the declared one, too short, flat, clipped, or too large; one line that says where.
    """
    table = _read(path)
    others = _signals(table)
    name = others[0] if channel is None else channel
    found = _recording(table, (name,), rate)
    warnings = found.warnings
    if channel is None and len(others) > 1:
        warnings = (*warnings, f"{len(others)} channels, {name!r} is taken")
    return replace(found, values=found.values[:, 0].copy(), warnings=warnings, name=str(path))


def checked_emg(values: Array, rate: float, channel: str) -> EmgRecording:
    """One channel of samples at an even rate, checked as those of a file are; see `read_emg`.

    Args:
        values: of the channel, in any unit (n,).
        rate: samples a second [Hz].
        channel: its name, with its unit at its end where it has one.

    Raises:
        LogError: as `read_emg`.
    """
    given = np.asarray(values, dtype=np.float64)
    table = Table(
        Path("the recording"),
        (channel,),
        lambda columns, clock: [given],
        place=lambda row: f"the recording, row {row + 1}",
    )
    found = _recording(table, (channel,), rate)
    return replace(found, values=found.values[:, 0].copy())


def read_channels(path: Path, channels: Sequence[str] = (), rate: float | None = None) -> EmgRecording:
    """Read several channels of a recording, all of them where none is named; see `read_emg`.

    Raises:
        LogError: as `read_emg`, for each channel.
    """
    table = _read(path)
    return _recording(table, tuple(channels or _signals(table)), rate)


def _times(table: Table) -> list[str]:
    return [name for name in table.names if split_name(name)[0] in TIMES]


def _signals(table: Table) -> list[str]:
    """Columns that are no times, and no text where others are none."""
    times = _times(table)
    others = [name for name in table.names if name not in times]
    if not others:
        said = f"{table.path}: no channel beside {', '.join(map(repr, times))}"
        raise LogError(said, expected="a column such as emg_mV")
    return [name for name in others if name not in table.wordy] or others


def _recording(table: Table, names: tuple[str, ...], declared: float | None) -> EmgRecording:
    path, where, times = table.path, table.place, _times(table)
    if not times and declared is None:
        raise LogError(
            f"{path}: no column of times among {_listed(table.names)}",
            expected="a column such as time_s",
            do="or say how many samples a second it has with --rate",
        )
    for name in names:
        if name not in table.names or name in times:
            others = _listed(_signals(table))
            raise LogError(f"{path}: no channel {name!r} among {others}", do="name one of them with --channel")
    columns = _numbers(table, [*names, *times[:1]])
    if len(columns[0]) < 2:
        raise LogError(f"{path} has {len(columns[0])} samples", expected=f"at least {_SHORTEST:g} s of EMG")
    for name, values in zip((*times[:1], *names), (*columns[len(names) :], *columns), strict=False):
        check_finite(name, values, where)
    if times:
        time = columns.pop() * FACTORS.get(split_name(times[0])[1] or unit_of(times[0]) or "s", 1.0)
    else:
        time = np.arange(len(columns[0])) / (declared or 1.0)
    even, columns, warnings = even_clock(time, columns, where)
    rate = (len(even) - 1) / float(even[-1] - even[0])
    if declared is not None and not abs(rate / declared - 1.0) <= _RATE_ERROR:
        raise LogError(
            f"{path}: {declared:g} Hz are declared, but the times in {times[0]!r} are of {rate:.4g} Hz",
            expected=f"the same, within {100 * _RATE_ERROR:g} %",
            do="correct --rate, or the unit of the time (time_s, time_ms)",
        )
    if not SLOWEST <= rate <= QUICKEST:
        raise LogError(
            f"{path}: {rate:.4g} samples a second",
            expected=f"{SLOWEST:g} to {QUICKEST:g} Hz",
            do="check the unit of the time (time_s, time_ms), or resample",
        )
    if rate < SAFE:
        slow = f"{rate:.4g} samples a second are few: below {SAFE:g} an open input may pass for a contraction"
        warnings = [*warnings, slow]
    if len(even) < _SHORTEST * rate:
        raise LogError(f"{path}: {len(even) / rate:.3g} s", expected=f"at least {_SHORTEST:g} s of EMG")
    for name, values in zip(names, columns, strict=True):
        check_signal(name, values, rate, str(path))
    units = {channel_unit(name) for name in names}
    unit = units.pop() if len(units) == 1 else ""
    return EmgRecording(np.column_stack(columns), rate, float(even[0]), names, unit, tuple(warnings))


def read_labels(path: Path) -> list[tuple[float, float]]:
    """Onset and end of contractions, in order [s].

    Args:
        path: CSV with the columns ``onset_s`` and ``offset_s``, or ``start_s`` and ``end_s``; also in ``ms`` or ``us``,
            and in seconds where they name no unit.

    Raises:
        LogError: not readable, other columns, or times that are no contractions in order.
    """
    table = _read(path)
    times = []
    for choices in _LABELS:
        name = next((name for choice in choices for name in table.names if split_name(name)[0] == choice), None)
        unit = (split_name(name)[1] or "s") if name else ""
        if name is None or unit not in ("s", "ms", "us"):
            raise LogError(
                f"{path}: columns {_listed(table.names)}",
                expected="onset_s and offset_s, or start_s and end_s, named in the first row; _ms will do as well",
            )
        (values,) = _numbers(table, [name])
        unknown = np.flatnonzero(~np.isfinite(values))
        if len(unknown):
            row = int(unknown[0])
            raise LogError(f"{path}, row {row + 1}: {name} is {values[row]:g}", expected="a time", do="remove that row")
        times.append(values * FACTORS[unit])
    onset, end = times
    before = -np.inf
    for row, (first, last) in enumerate(zip(onset, end, strict=True)):
        if not first < last:
            problem = f"a contraction from {first:g} to {last:g} s"
        elif not before < first:
            problem = f"a contraction begins at {first:g} s, and the one before it ends at {before:g} s"
        else:
            before = last
            continue
        raise LogError(f"{path}, row {row + 1}: {problem}", expected="onset < offset < next onset")
    return [(float(first), float(last)) for first, last in zip(onset, end, strict=True)]


def channel_unit(name: str) -> str:
    """Unit at the end of a channel's name; empty where there is none, µV as uV.

    >>> [channel_unit(name) for name in ("emg_mV", "biceps (µV)", "emg")]
    ['mV', 'uV', '']
    """
    suffix = _UNIT.search(name)
    return (suffix[1] or "").replace("µ", "u") if suffix else ""


def largest(unit: str) -> float:
    """What no value of a signal exceeds, in its unit; empty where it is not known."""
    return _MOST_VOLTS / _VOLTS[unit] if unit in _VOLTS else _MOST


def check_signal(name: str, values: Array, rate: float, where: str) -> None:
    """Refuse a signal that no electrode gives.

    An end of the range that lasts is an electrode that is off for a while, which detector and levels see; a signal that
    comes back from it within `_DEAD` is clipped.

    Args:
        name: of the channel, with its unit at its end where it has one.
        values: finite (n,).
        rate: samples a second [Hz].
        where: the recording or stream, for messages.

    Raises:
        LogError: flat, clipped, or too large to be one.
    """
    low, high = float(values.min()), float(values.max())
    unit = channel_unit(name)
    most = largest(unit)
    if not max(-low, high) <= most:
        raise LogError(
            f"{where}: {name} reaches {max(-low, high):g}",
            expected=f"at most {most:g}" + (f" {unit}, which are {_MOST_VOLTS:g} V" if unit in _VOLTS else ""),
            do="look at the unit in the column's name, and at the file",
        )
    if not high > low:
        raise LogError(
            f"{where}: {name} is {low:g} in every sample", do="look at the electrode, its cable and the gain"
        )
    begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    lengths, held = np.diff(begins, append=len(values)), values[begins]
    clips = ((held == low) | (held == high)) & (lengths < _DEAD * rate)
    clipped = float(lengths[clips].sum()) / len(values)
    if clipped > (_CLIPPED if len(np.unique(values)) > _COARSE else _SATURATED):
        raise LogError(
            f"{where}: {100 * clipped:.1f} % of {name} are at an end of its range ({low:g} or {high:g})",
            expected=f"at most {100 * _CLIPPED:g} %",
            do="lower the amplifier's gain and record again",
        )


def _read(path: Path) -> Table:
    table = read_table(path)
    if table.names and all(name.isdecimal() for name in table.names):
        raise LogError(
            f"{path}: no names stand above its {len(table.names)} columns of numbers",
            expected="a row of names",
            do="add one, such as time_s,emg_mV (onset_s,offset_s of labels)",
        )
    twice = next((name for name in table.names if table.names.count(name) > 1), None)
    if twice is not None:
        raise LogError(f"{path}: two columns are named {twice!r}", expected="a name for each")
    odd = next((name for name in table.names if not name.isprintable()), None)
    if odd is not None:
        raise LogError(f"{path}: a column is named {odd[:40]!r}", expected="names that can be printed")
    return table


def _numbers(table: Table, names: Sequence[str]) -> list[Array]:
    times = _times(table)
    clock = table.names.index(times[0]) if times else None
    return table.numbers([table.names.index(name) for name in names], clock)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(repr(name) for name in islice(names, 12)) or "none"
