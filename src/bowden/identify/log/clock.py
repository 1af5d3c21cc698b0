"""The time stamps of a recording: what is no clock is refused, what is uneven is put on an even one."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, counted
from bowden.core.units import DEGREES
from bowden.identify.cable.turns import peak_speed
from bowden.plants.trust import Trust

Array = NDArray[np.float64]

_JITTER = 0.1
"""Largest scatter of the time steps (root mean square of their departure from the median, over it) that is mended by
resampling. One step may be further off, as a scheduler's hiccup is, if it is no gap."""

_GAP = 1.5
"""A step longer than this many medians is a gap, where the others do not scatter as much: a sample may be missing."""

_BRIDGED = 0.05
"""Share of the motor's or joint's range that either may move in a gap, at its peak speed, for it to be bridged: in so
little of a stroke no turn is missed, and a straight line is near to what was there."""
_MOST_BRIDGED = 0.1
"""Share of a log's time that may lie in bridged gaps: of more, the log is made of them."""

_LATE = 10
"""Rows within which a dropped one stands for a step that is longer because rows were late, and not missing."""

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


def even_clock(
    time: Array, signals: Sequence[Array], where: Callable[[int], str]
) -> tuple[Array, list[Array], list[str]]:
    """Time on the even clock closest to a log's stamps, the signals on that clock, and what is to be said of it.

    Short gaps are bridged by straight lines. A row that repeats the stamp before it (a second row within one tick) is
    dropped. A step within ten rows of k dropped ones more than are usual may be k ticks longer: rows were late until
    then, the last of them by so much as to fall into the next one's tick. Where every tick has two rows a dropped one
    means nothing, and k is 1.

    Args:
        time: (n,) finite [s].
        signals: (n,) each.
        where: sample → place, for messages.

    Returns:
        Even times (m,), the given ones where they are even already; the signals at them; warnings.

    Raises:
        LogError: time that goes back, repeats in more than half of the rows, has a long gap, or scatters by more than a
            tenth of its step.
    """
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    if len(back):
        k = int(back[0])
        raise LogError(
            f"{where(k + 1)}: time goes back ({time[k]:.9g} s, then {time[k + 1]:.9g} s)",
            expected="time stamps that increase",
            do="cut the log there, if another recording begins" if len(back) == 1 else "sort the rows by their time",
        )
    kept, warnings = _first_of_each(time, steps, where)
    dropped = np.diff(np.append(kept, len(time))) - 1
    stamps, late = time[kept], _near(dropped)
    steps = np.diff(stamps)
    middle = float(np.median(steps))
    relative = steps / middle
    longest = relative - late
    gaps = np.flatnonzero(longest > _GAP)
    away = np.where(relative > 1.0, np.maximum(longest - 1.0, 0.0), 1.0 - relative)
    away[gaps] = 0.0
    scatter = float(np.sqrt(np.mean(away**2)))
    worst = int(np.argmax(away))
    if 1.4826 * np.median(away) > _JITTER or scatter > _JITTER:
        raise LogError(
            f"{where(int(kept[worst + 1]))}: the time steps scatter by {100 * scatter:.0f} % RMS (a step of "
            f"{steps[worst]:.4g} s where {middle:.4g} s is usual)",
            expected=f"even time stamps, within {100 * _JITTER:.0f} % RMS",
            do="resample the log on an even clock",
        )
    if len(gaps):
        moving = [one[kept] for one in signals if np.ptp(one) > 0.0 and len(kept) > _READINGS]
        fastest = max((peak_speed(stamps, one) / float(np.ptp(one)) for one in moving), default=np.inf)
        widest, most = int(gaps[np.argmax(steps[gaps])]), _BRIDGED / fastest
        if steps[widest] > most or np.sum(steps[gaps]) > _MOST_BRIDGED * np.ptp(time):
            raise LogError(
                f"{where(int(kept[widest + 1]))}: time has a gap (a step of {steps[widest]:.4g} s where {middle:.4g} s "
                "is usual)",
                expected=f"gaps of {most:.2g} s at most where it is so fast, {100 * _MOST_BRIDGED:g} % of it in all",
                do="cut the log at the gap",
            )
        said = f"{counted(len(gaps), 'gap')} of up to {steps[widest]:.2g} s, {np.sum(steps[gaps]):.2g} s in all"
        warnings.append(f"time has {said}: bridged by straight lines")
    if float(np.max(np.abs(relative - 1.0))) < 1e-3:
        return stamps if len(warnings) else time, [one[kept] if len(warnings) else one for one in signals], warnings
    count = round((stamps[-1] - stamps[0]) / middle) + 1 if len(warnings) else len(stamps)
    even = np.linspace(stamps[0], stamps[-1], count)
    if away[worst] > 1e-3 or not len(gaps):
        warnings.append(
            (
                f"the time steps scatter by {100 * scatter:.2g} % RMS, {100 * away[worst]:.2g} % at worst"
                if away[worst] > 1e-3
                else "the time steps near dropped rows are longer"
            )
            + f"; the log was resampled on an even clock (accepted up to {100 * _JITTER:.0f} % RMS)"
        )
    return even, [np.interp(even, stamps, one[kept]) for one in signals], warnings


def rises_evenly(values: Array) -> bool:
    """Whether a column rises from row to row by steps that scatter no more than those of a clock may.

    >>> rises_evenly(np.arange(5.0)), rises_evenly(np.array([0.0, 1.0, 2.0, 2.0, 3.0]))
    (True, False)
    """
    steps = np.diff(values)
    return bool(np.all(steps > 0.0)) and float(np.std(steps)) <= _JITTER * float(np.mean(steps))


def _near(dropped: NDArray[np.intp]) -> NDArray[np.intp]:
    """How many rows more than usual were dropped near each step (m − 1,), of how many after each kept row (m,).

    Usual is the median over the log, which is 0 where rows are dropped now and then; 1 is left where any was.
    """
    sums = np.concatenate([[0], np.cumsum(dropped)])
    rows = np.arange(len(dropped) - 1)
    near = sums[np.minimum(rows + 1 + _LATE, len(dropped))] - sums[np.maximum(rows + 1 - _LATE, 0)]
    return np.asarray(np.maximum(near - int(np.median(near)), np.minimum(near, 1)))


def _first_of_each(time: Array, steps: Array, where: Callable[[int], str]) -> tuple[NDArray[np.intp], list[str]]:
    """The first row of each stamp."""
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


def held_rows(angle: Array) -> tuple[int, int | None]:
    """How many rows a reading is repeated, and which of them is the new one; None where they are not always as many.

    An encoder that counts repeats itself too, but goes on by one count then. One that is read more seldom than its log
    has rows goes on by many, by more than what the repeated readings dither, and by nothing else: these steps make at
    least half of its range.

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
    rows = int(np.median(np.diff(at)))
    if rows < 2:
        return 1, None
    phases = np.bincount(at % rows, minlength=rows)
    first = int(phases.argmax())
    return rows, first if phases[first] > 0.98 * len(at) else None
