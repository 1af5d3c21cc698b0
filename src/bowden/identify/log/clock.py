"""The time stamps of a recording: what is no clock is refused, what is uneven is put on an even one."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, counted
from bowden.core.units import DEGREES
from bowden.identify.cable.cycles import ENOUGH
from bowden.identify.cable.turns import peak_speed
from bowden.identify.log.angles import GAP
from bowden.plants.trust import Trust

Array = NDArray[np.float64]

_EVEN = 0.1
"""Scatter of a clock's steps (root mean square of their departure from the median, over it) that needs no word, and
that a column of times has."""
_GAP_OF_AN_EVEN_CLOCK, _FEW = 1.5, 0.01
"""A step longer than this many medians is a gap where so few are; where more are, the rows are delivered together, and
a gap is one of `GAP`."""
_BRIDGED = 0.1
"""Share of the motor's or joint's range that either may move in a gap, at its peak speed, for it to be bridged: in so
little of a stroke no turn is missed, and a straight line is near to what was there. A longer one cuts the log."""
_MOST_BRIDGED = 0.25
"""Share of a log's time that may lie in bridged gaps: of more, the log is made of them."""
_OUT_OF_ORDER = 10
"""Rows by which one may stand too early or too late for the rows to be sorted: beyond, another recording begins."""

_REPEATED = 0.5
"""Largest share of rows that repeat the stamp before them. Two rows within every tick are half; above it most rows say
nothing of when they were taken."""


_FASTEST = 5e3
"""Of a joint that turns back [rad/s²]. The bare rotor of a small servo motor makes 1e4 to 1e5 at its rated torque, and
a cable and a joint leave it a tenth; recordings have 300 at most, and in a wrong unit from 5e4 on."""
_SLOWEST = 0.5
"""Peak speed below which friction makes most cables stick and slip [°/s]: 1000 times less than a fast motor's."""
_ROWS_APART = (6e-5, 0.5)
"""Time between rows [s]: encoders are logged at 16 kHz at most, and a motion at 2 Hz at least. Seconds taken for ms of
a log at 17 Hz or more are beyond it, and ms taken for seconds of one at 2 kHz or less."""
_READINGS = 20
"""New readings from which on their distance tells."""
_QUIET, _BEYOND, _COUNTS = 0.4, 8.0, 2.5
"""Quantile of a reading's steps; how many times it a new reading goes, and how many counts. Where two rows have one
reading, half of the steps are noise, of which four deviations are 7.6 times that quantile."""

FEWEST_SAMPLES = 50
"""Below this a loop cannot be distinguished from noise."""


def check_finite(name: str, values: Array, where: Callable[[int], str]) -> None:
    """Refuse values that are not numbers.

    Raises:
        LogError: naming the first place and how many there are.
    """
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        more = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
        raise LogError(
            f"{where(int(bad[0]))}: {name} is {values[bad[0]]}{more}",
            expected="a number in every row",
            do="remove those rows or fill them by interpolation",
        )


def check_length(samples: int, where: str) -> None:
    """Refuse a log that is too short.

    Raises:
        LogError: fewer than fifty samples.
    """
    if samples < FEWEST_SAMPLES:
        raise LogError(
            f"{where}: {samples} samples are too short a log",
            expected=f"at least {FEWEST_SAMPLES}, over several cycles",
            do=f"record at least {ENOUGH} whole cycles",
        )


def even_clock(
    time: Array, signals: Sequence[Array], where: Callable[[int], str], *, cut: bool = False
) -> tuple[Array, list[Array], list[str]]:
    """Time on the even clock closest to a log's stamps, the signals on that clock, and what is to be said of it.

    Rows that stand a little out of order are sorted, of rows with one stamp the first is taken, short gaps are bridged
    by straight lines, and signals are taken at their stamps.

    Args:
        time: (n,) finite [s].
        signals: (n,) each.
        where: sample → place, for messages.
        cut: whether a log is cut at its long gaps and the longest stretch taken, and not refused.

    Returns:
        Even times (m,), the given ones where they are even already; the signals at them; warnings.

    Raises:
        LogError: time that goes back, repeats in more than half of the rows, or has long gaps.
    """
    warnings: list[str] = []
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back):
        order = np.argsort(time, kind="stable")
        if int(np.abs(order - np.arange(len(time))).max()) > _OUT_OF_ORDER:
            k = int(back[0])
            raise LogError(
                f"{where(k + 1)}: time goes back ({time[k]:.9g} s, then {time[k + 1]:.9g} s), in "
                f"{counted(len(back), 'place')} in all",
                expected="time stamps that increase",
                do="cut the log there, if another recording begins"
                if len(back) == 1
                else "sort the rows by their time",
            )
        time, signals = time[order], [one[order] for one in signals]
        warnings.append(f"time goes back in {counted(len(back), 'place')}, by a few rows: they were sorted")
    kept, repeated = _first_of_each(time, where)
    warnings += repeated
    if len(kept) < len(time):
        time, signals = time[kept], [one[kept] for one in signals]
    steps = np.diff(time)
    middle = float(np.median(steps))
    few = np.mean(steps > _GAP_OF_AN_EVEN_CLOCK * middle) <= _FEW
    gaps = np.flatnonzero(steps > (_GAP_OF_AN_EVEN_CLOCK if few else GAP) * middle)
    if len(gaps):
        moving = [one for one in signals if np.ptp(one) > 0.0 and len(time) > _READINGS]
        fastest = max((peak_speed(time, one) / float(np.ptp(one)) for one in moving), default=np.inf)
        most = max(_BRIDGED / fastest, GAP * middle)
        long, widest = gaps[steps[gaps] > most], int(gaps[np.argmax(steps[gaps])])
        if (len(long) and not cut) or steps[gaps].sum() - steps[long].sum() > _MOST_BRIDGED * np.ptp(time):
            raise LogError(
                f"{where(int(kept[widest + 1]))}: time has a gap (a step of {steps[widest]:.4g} s where {middle:.4g} s "
                "is usual)",
                expected=f"gaps of {most:.2g} s at most where it is so fast, {100 * _MOST_BRIDGED:g} % of it in all",
                do="cut the log at the gap",
            )
        if len(long):
            bounds = np.array([0, *(long + 1), len(time)])
            at = int(np.argmax(time[bounds[1:] - 1] - time[bounds[:-1]]))
            part = slice(bounds[at], bounds[at + 1])
            warnings.append(
                f"time has {counted(len(long), 'gap')} of up to {steps[widest]:.2g} s, in which the motor may have "
                f"turned: the longest stretch was taken, {np.ptp(time[part]):.4g} of {np.ptp(time):.4g} s"
            )
            even, signals, more = even_clock(
                time[part], [one[part] for one in signals], lambda i: where(int(kept[part.start + i])), cut=True
            )
            return even, signals, [*warnings, *more]
        said = f"{counted(len(gaps), 'gap')} of up to {steps[widest]:.2g} s, {np.sum(steps[gaps]):.2g} s in all"
        warnings.append(f"time has {said}: bridged by straight lines")
    away = np.abs(np.delete(steps, gaps) / middle - 1.0)
    if not len(gaps) and float(np.max(away, initial=0.0)) < 1e-3:
        return time, list(signals), warnings
    scatter = float(np.sqrt(np.mean(away**2)))
    if float(np.max(away, initial=0.0)) > 1e-3:
        warnings.append(
            f"the time steps scatter by {100 * scatter:.2g} % RMS, {100 * away.max():.2g} % at worst; the log was "
            "resampled on an even clock"
        )
    missing = len(gaps) or repeated or scatter > _EVEN
    count = round((time[-1] - time[0]) / middle) + 1 if missing else len(time)
    even = np.linspace(time[0], time[-1], count)
    return even, [np.interp(even, time, one) for one in signals], warnings


def rises_evenly(values: Array) -> bool:
    """True if a column rises from row to row by steps that scatter no more than those of a clock may.

    >>> rises_evenly(np.arange(5.0)), rises_evenly(np.array([0.0, 1.0, 2.0, 2.0, 3.0]))
    (True, False)
    """
    steps = np.diff(values)
    return bool(np.all(steps > 0.0)) and float(np.std(steps)) <= _EVEN * float(np.mean(steps))


def _first_of_each(time: Array, where: Callable[[int], str]) -> tuple[NDArray[np.intp], list[str]]:
    """The first row of each stamp."""
    steps = np.diff(time)
    repeated = np.flatnonzero(steps == 0.0) + 1
    if not len(repeated):
        return np.arange(len(time)), []
    share = f"{len(repeated)} of {len(time)} rows repeat the time stamp of the row before them"
    if len(repeated) > min(_REPEATED * len(time), len(time) - 2):
        raise LogError(
            f"{where(int(repeated[0]))}: time repeats ({time[repeated[0]]:.9g} s); {share}, which is not a clock",
            expected=f"at most {100 * _REPEATED:g} %, as two rows within each tick have",
            do="record with a finer clock, or leave the times out and give the rows' rate (--rate, or rate= in Python)",
        )
    kept = np.flatnonzero(np.concatenate([[True], steps > 0.0]))
    return kept, [f"{share}, as two rows within one tick of the clock do, and were dropped"]


def odd_time(time: Array, motor: Array, joint: Array) -> list[Trust]:
    """Why the unit of time is perhaps another: a motion that no motor makes, or hardly any; rows too near or too far.

    The joint turns back with v²/(range/2) at least, v being its speed half way: time that is a thousand times too short
    makes a million times as much of it. A motion that is slow is one doubt, and rows far apart are another: both
    together are no slow motion but another unit.

    Args:
        time: even (n,) [s].
        motor: (n,) [rad].
        joint: (n,) [rad].
    """
    apart = float(np.median(np.diff(time)))
    took = f"{time[-1] - time[0]:.4g} s in all, a row each {apart:.3g} s"
    speed, fast = peak_speed(time, joint), peak_speed(time, motor) * DEGREES
    if speed**2 > _FASTEST * 0.5 * float(np.ptp(joint)) or apart < _ROWS_APART[0]:
        why = f"the joint moves at {speed * DEGREES:.3g}°/s and back ({took}), as no motor moves it and no log has it"
        return [Trust("no", (f"{why}: check the unit of time (a column time_ms is in ms, time_s in s)",))]
    slow, far = max(fast, speed * DEGREES) < _SLOWEST, apart > _ROWS_APART[1]
    if not (slow or far):
        return []
    why = f"the motor moves at {fast:.2g}°/s at most ({took}): is time in ms?"
    else_ = " Else stick and slip and creep hide the loop: record at 5°/s or more" if slow else ""
    return [Trust("no" if slow and far else "with care", (why + else_,))]


def in_seconds(time: Array, motor: Array, joint: Array) -> tuple[Array, list[Trust]]:
    """Times in no named unit, in seconds: as they are, unless the motion is possible in ms, µs or ns only."""
    units = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    unit = next((one for one, factor in units.items() if not odd_time(time * factor, motor, joint)), "s")
    said = f"no unit is named for the times (taken as {unit}): end the column's name in _s, _ms, _us or _ns"
    return time * units[unit], [Trust("with care", (said,))]


def held_rows(angle: Array) -> tuple[int, int | None]:
    """How many rows a reading is repeated, and which of them is the new one; None where they are not always as many.

    An encoder that counts repeats itself too, but goes on by one count then. One that is read more seldom than its log
    has rows goes on by many, by more than what the repeated readings dither, and by nothing else: these steps make at
    least half of its range, and most steps between them are a count or dither.

    >>> held_rows(np.repeat(np.sin(0.1 * np.arange(100.0)), 4)[1:])
    (4, 3)
    """
    moved = np.diff(angle)
    steps = np.abs(moved)
    count = np.quantile(steps[steps > 0.0], 0.02) if steps.any() else 0.0
    dither = np.quantile(steps, _QUIET)
    jumps = steps > max(_BEYOND * dither, _COUNTS * count)
    at = np.flatnonzero(jumps) + 1
    if len(at) < _READINGS or np.ptp(np.cumsum(np.where(jumps, moved, 0.0))) < 0.5 * np.ptp(angle):
        return 1, None
    gaps = np.diff(at)
    rows = int(np.median(gaps))
    between = [steps[a : a + gap - 1] for a, gap in zip(at[:-1], gaps, strict=True) if gap <= 2 * rows]
    if rows < 2 or np.median(np.concatenate(between)) > max(2.0 * dither, count):
        return 1, None
    phases = np.bincount(at % rows, minlength=rows)
    first = int(phases.argmax())
    return rows, first if phases[first] > 0.98 * len(at) else None
