"""Does the loop swing by itself? Half-waves that do not decay raise a suspicion; a trial decides.

Nothing in one steady swing tells a loop that rings (an arm in springs, a lag that nobody told) from a wearer who
trembles or walks: the law's correction and what it observes are tied by the law itself. Only an experiment does. So:

- **suspicion**: half-waves of the disturbance's fast part that are alike in time, and as large as the one before or
  larger, are counted; growth counts more, and is seen before its half-wave ends.
- **trial**: for seven half-waves the observer is slower than the swing: κ is at most 0.4 of its angular frequency, and
  half of what it was. A swing of the loop's own decays then.
- **own**: the joint follows late by more than was told; the time of half a radian of the swing is added to the lag,
  and κ comes back within seconds.
- **the wearer's**: κ comes back at once, and until it is forgotten only a swing 1.6 times as large is suspect.

| mode | becomes | when |
|---|---|---|
| watching | trial | 3.9 are counted, of 1 a half-wave that keeps its size and 1.6 one that grows by 1.3 |
| trial | watching, the wearer's | the largest of its last three half-waves is > 0.65 of that of the three before, and |
| | | > 0.45 of the swing that was suspect |
| trial | watching, own | otherwise |

The fast part is d̂ less its mean over 0.15 s; a half-wave lasts from one change of its sign to the next. Portable
subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity

SLOW_PART = 0.15
"""Time constant of what is not fast [s]."""

SLOWEST = 0.3
"""Half-wave beyond which nothing swings: an arm on a cable has 2 Hz and more [s]."""

ALIKE = 1.6
"""Ratio of two half-waves' times up to which they are of one swing [–]."""

KEPT, GROWN = 0.8, 1.3
"""Sizes over the half-wave's before: from the first a swing does not decay, from the second it grows [–]."""

GROWTH = 1.6
"""What a half-wave counts that has grown [–]."""

ENOUGH = 3.9
"""Count beyond which a trial begins: four half-waves, or three that grow [–]."""

LEAST, SIGMAS = 0.002, 6.0
"""Size below which nothing swings, and the same in standard deviations of the noise [rad, –]."""

BEYOND = 1.6
"""A swing is news that is larger than the wearer's by this [–]."""

TRIED, WATCHED = 7.0, 3.0
"""Half-waves of a trial, and of each of the two spans that are compared [–]."""

SLOWED = 0.4
"""Largest κ in a trial over the swing's angular frequency [–]."""

STILL_THERE, OF_BEFORE = 0.65, 0.45
"""What is the wearer's: sizes at the trial's end over those at its start, and over those before it [–]."""

RETURN = 1.5
"""Time constant at which κ comes back after a swing of its own [s]."""

FORGOTTEN = 30.0
"""Time constant of the size of a wearer's swing [s]."""

LATER = 0.5
"""Of the time of a swing's radian that is added to the lag [–]."""

LATEST = 0.1
"""Largest lag that is learned [s]."""


class Swing(NamedTuple):
    """What is seen of a swing."""

    slow: Annotated[float, Quantity("the disturbance's slow part", "rad")]
    top: Annotated[float, Quantity("largest of the half-wave now, with its sign", "rad")]
    last: Annotated[float, Quantity("largest of the one before", "rad")]
    time: Annotated[float, Quantity("since the half-wave began", "s")]
    last_time: Annotated[float, Quantity("time of the one before", "s")]
    counted: Annotated[float, Quantity("half-waves that did not decay", "1")]
    share: Annotated[float, Quantity("of κ that is used; 1 is all", "1")]
    lag: Annotated[float, Quantity("of the joint behind its cable", "s")]
    wearers: Annotated[float, Quantity("size of a swing that is the wearer's", "rad")]
    trial: Annotated[float, Quantity("half-waves until the trial ends; 0 while watching", "1")]
    period: Annotated[float, Quantity("half-wave of the trial's swing", "s")]
    early: Annotated[float, Quantity("largest in the trial's first span", "rad")]
    late: Annotated[float, Quantity("largest in its second", "rad")]


@kernel
def no_swing(lag: float) -> Swing:
    """Nothing has been seen yet."""
    return Swing(0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 1.0, lag, 0.0, 0.0, 0.1, 0.0, 0.0)


@kernel
def watched(before: Swing, slow_before: float, disturbance: float, noise: float, kappa: float, dt: float) -> Swing:
    """One cycle.

    Args:
        before: one cycle ago.
        slow_before: the slow part then [rad].
        disturbance: d̂ [rad].
        noise: of it [rad].
        kappa: κ of a loop that does not ring [1/s].
        dt: cycle [s].
    """
    slow = slow_before + (disturbance - slow_before) * dt / (SLOW_PART + dt)
    fast = disturbance - slow
    size, least = np.abs(fast), np.fmax(LEAST, SIGMAS * noise)
    turned = fast * before.top < 0.0
    top = np.fmax(np.abs(before.top), size)
    in_time = (before.time < SLOWEST) * (before.time < ALIKE * before.last_time) > 0.0
    alike = in_time * (before.time > before.last_time / ALIKE) > 0.0
    grows = in_time * (before.last > least) * (top > GROWN * before.last) > 0.0
    news = top > BEYOND * before.wearers
    kept = alike * news * (top > least) * (top > KEPT * before.last) > 0.0
    ended = sel(kept, before.counted + sel(grows, GROWTH, 1.0), 0.0)
    count = sel(turned, ended, sel(before.time > SLOWEST, 0.0, before.counted))
    soon = grows * news * (before.counted + GROWTH > ENOUGH) * (1.0 - turned) > 0.0
    enough = soon + (count > ENOUGH) > 0.0

    tried = before.trial > 0.0
    suspected = enough * (1.0 - tried) > 0.0
    left = before.trial - dt / before.period
    ends = tried * (left <= 0.0) > 0.0
    early = sel((left > WATCHED) * (left < 2.0 * WATCHED) > 0.0, np.fmax(before.early, size), before.early)
    late = sel(left <= WATCHED, np.fmax(before.late, size), before.late)
    theirs = ends * (late > STILL_THERE * early) * (late > OF_BEFORE * before.wearers) > 0.0
    own = ends * (1.0 - theirs) > 0.0
    later = np.fmax(before.lag, np.fmin(LATEST, before.lag + LATER * before.period / np.pi))
    period = sel(suspected, np.fmax(sel(soon, before.last_time, before.time), 2.0 * dt), before.period)
    trial = sel(suspected, TRIED, np.fmax(0.0, left))
    wearers = sel(suspected, np.fmax(before.wearers, top), sel(own, 0.0, before.wearers * (1.0 - dt / FORGOTTEN)))
    slowed = np.fmin(0.5 * before.share, SLOWED * np.pi / (period * kappa))
    back = sel(trial > 0.0, before.share, np.fmin(1.0, before.share * (1.0 + dt / RETURN)))
    return Swing(
        slow,
        sel(turned, fast, sel(fast < 0.0, -top, top)),
        sel(turned, top, before.last),
        sel(turned, 0.0, np.fmin(1.0, before.time + dt)),
        sel(turned, before.time, before.last_time),
        sel(enough, 0.0, count),
        sel(suspected, slowed, sel(theirs, 1.0, back)),
        sel(own, later, before.lag),
        wearers,
        trial,
        period,
        sel(suspected, 0.0, early),
        sel(suspected, 0.0, late),
    )


@kernel
def beside(before: Swing, by: float) -> Swing:
    """The same where the disturbance goes by −`by` at once since the plan took it over [rad]."""
    return Swing(
        before.slow - by,
        before.top,
        before.last,
        before.time,
        before.last_time,
        before.counted,
        before.share,
        before.lag,
        before.wearers,
        before.trial,
        before.period,
        before.early,
        before.late,
    )
