"""Does the loop swing by itself? Half-waves that do not decay raise a suspicion; a trial decides.

Nothing in one steady swing separates a loop that rings (an arm in springs, a lag that was not given) from a wearer who
trembles or walks: the law's correction and what it observes are tied by the law itself. Only an experiment does. So:

- **suspicion**: half-waves of the disturbance's fast part that are alike in time, and as large as the one before or
  larger, are counted; growth counts more, and is seen before its half-wave ends.
- **trial** of a hypothesis: the load swings at that frequency. For seven half-waves the observer has such a load, so
  that what the law itself makes swing is no disturbance, and is slower than the swing: κ is at most 0.3 of its angular
  frequency, and half of what it was. A swing of the loop's own decays then, as the load alone does.
- **own**: the load stays in the observer, and κ comes back within seconds.
- **the wearer's**: the load goes, κ comes back at once, and until it is forgotten only a swing 1.6 times as large is
  suspect. It is known as soon as one of the last three half-waves is large enough: what comes later changes nothing.
  A swing at the frequency of a load that was learned is never the wearer's, and the load stays as it is: one of little
  damping decays so slowly that it would be taken for it, and with κ whole at once it would grow. The price: while a
  wearer trembles at that frequency κ stays as low as in a trial. Where the swing did decay, T is learned anew.
- **leap**: a swing of the loop's own hardly grows more than fourfold in a half-wave. What is more than four times as
  large as the half-wave before, outside a trial, is taken to come from outside, and the correction may go twice as fast
  (`observer`).

| mode | becomes | when |
|---|---|---|
| watching | trial | 3.9 are counted, of 1 a half-wave that keeps its size and up to 2 one that grows |
| trial | watching, the wearer's | > 0.6 of the suspect swing in its last three half-waves; no such load is known |
| trial | watching, own | seven half-waves are over |

The fast part is d̂ less its slow part; a half-wave lasts from one change of its sign to the next. Portable
subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.extremes import larger, smaller
from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity

SLOWEST = 0.25
"""Half-wave beyond which nothing swings: an arm on a cable has 2 Hz and more [s]."""

ALIKE = 1.6
"""Ratio of two times up to which they are of one swing: of half-waves, or of what is tried and a load known [–]."""

KEPT, GROWN = 0.8, 1.3
"""Sizes over the half-wave's before: from the first a swing does not decay, from the second it grows [–]."""

GROWTH, MOST_GROWTH = 2.0, 2.0
"""What a half-wave counts that has grown to r times the one before: 1 + 2·(r − 1), at most 2 [–]."""

ENOUGH = 3.9
"""Count beyond which a trial begins: four half-waves, three that grow, or two that grow by half [–]."""

LEAST, SIGMAS = 0.002, 6.0
"""Size below which nothing swings, and the same in standard deviations of the noise [rad, –]."""

BEYOND = 1.6
"""A swing is news that is larger than the wearer's by this [–]."""

TRIED, WATCHED = 7.0, 3.0
"""Half-waves of a trial, and those at its end that are looked at [–]."""

SLOWED, SLOWEST_OWN = 0.3, 0.1
"""Largest κ in a trial over the swing's angular frequency, and what no trial takes it below: such a κ does not even
swing a load with a damping of 0.05, of which it is 2ζ [–]."""

STILL_THERE = 0.6
"""What is the wearer's: size at the trial's end over that of the swing before it. A load alone has 0.37 after four
half-waves at a damping of 0.08; a tremor that goes on has 0.65 to 0.8, since what of it is followed meanwhile goes
through a load that is none [–]."""

LEAP = 4.0
"""What a swing of the loop's own hardly grows by in a half-wave: an unknown load with a damping of 0.15 grows by at
most 4.1 at 2 Hz on the rigs of ``benchmarks/law_margins.py``, 3.8 at 3 Hz, 2.9 at 8 Hz [–]."""

RETURN = 1.5
"""Time constant at which κ comes back after a swing of its own [s]."""

FORGOTTEN = 30.0
"""Time constant of the size of a wearer's swing [s]."""

SLOWER = 1.15
"""Time of a swing's radian to that of the load: a load that is believed 15 % too slow costs nothing, one 15 % too quick
half of what is gained [–]."""


class Swing(NamedTuple):
    """What is seen of a swing."""

    top: Annotated[float, Quantity("largest of the half-wave now, with its sign", "rad")]
    last: Annotated[float, Quantity("largest of the one before; in a trial, at its end", "rad")]
    lasts: Annotated[float, Quantity("time since the half-wave began", "s")]
    lasted: Annotated[float, Quantity("time of the one before; in a trial, of the swing that is tried", "s")]
    counted: Annotated[float, Quantity("half-waves that did not decay; below 0, those left of a trial", "1")]
    share: Annotated[float, Quantity("of κ that is used; 1 is all", "1")]
    time: Annotated[float, Quantity("T of a load that swings, 1/its frequency; 0 where none is known", "s")]
    wearers: Annotated[float, Quantity("size of a swing that is the wearer's", "rad")]


@kernel
def no_swing() -> Swing:
    """Nothing has been seen yet."""
    return Swing(0.0, 0.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0)


@kernel
def of_swing(period: float) -> float:
    """T of the load that makes half-waves of this time [s]."""
    return SLOWER / np.pi * period


@kernel
def load_time(now: Swing) -> float:
    """T of the load that the observer is to have: in a trial the one that is tried [s]."""
    return sel(now.counted < 0.0, of_swing(now.lasted), now.time)


@kernel
def leaps(now: Swing) -> float:
    """Whether the disturbance is larger than a swing of the loop's own will have grown to since the half-wave before.

    Of no meaning in a trial, where `last` is kept for its end.
    """
    return np.abs(now.top) > LEAP * now.last


@kernel
def watched(before: Swing, fast: float, noise: float, kappa: float, dt: float) -> Swing:
    """One cycle.

    Args:
        before: one cycle ago.
        fast: part of d̂ [rad].
        noise: of d̂ [rad].
        kappa: κ of a loop that does not ring [1/s].
        dt: cycle [s].
    """
    size, least = np.abs(fast), np.fmax(LEAST, SIGMAS * noise)
    turned = fast * before.top < 0.0
    top = larger(np.abs(before.top), size)
    in_time = (before.lasts < SLOWEST) * (before.lasts < ALIKE * before.lasted) > 0.0
    alike = in_time * (ALIKE * before.lasts > before.lasted) > 0.0
    grows = in_time * (before.last > least) * (top > GROWN * before.last) > 0.0
    growth = smaller(1.0 + GROWTH * (top / larger(before.last, least) - 1.0), MOST_GROWTH)
    news = top > BEYOND * before.wearers
    kept = alike * news * (top > least) * (top > KEPT * before.last) > 0.0
    ended = sel(kept, before.counted + sel(grows, growth, 1.0), 0.0)
    count = sel(turned, ended, sel(before.lasts > SLOWEST, 0.0, before.counted))
    soon = grows * news * (before.counted + growth > ENOUGH) * (1.0 - turned) > 0.0
    enough = soon + (count > ENOUGH) > 0.0

    tried = before.counted < 0.0
    suspected = enough * (1.0 - tried) > 0.0
    left = -before.counted - dt / before.lasted
    late = sel(left <= WATCHED, larger(before.last, size), before.last)
    load = of_swing(before.lasted)
    known = (load < ALIKE * before.time) * (before.time < ALIKE * load)
    still = late > STILL_THERE * before.wearers
    theirs = tried * (1.0 - known) * still > 0.0
    own = tried * (left <= 0.0) * (1.0 - theirs) > 0.0
    ends = theirs + own > 0.0
    period = larger(sel(soon, before.lasted, before.lasts), 2.0 * dt)
    counted = sel(suspected, -TRIED, sel(ends, 0.0, sel(tried, -left, count)))
    wearers = sel(suspected, larger(before.wearers, top), sel(own, 0.0, before.wearers * (1.0 - dt / FORGOTTEN)))
    pace = np.pi / (period * kappa)  # the swing's angular frequency, over κ
    slowed = smaller(larger(0.5 * before.share, SLOWEST_OWN * pace), SLOWED * pace)
    back = sel(counted < 0.0, before.share, smaller(before.share * (1.0 + dt / RETURN), 1.0))
    return Swing(
        sel(turned, fast, sel(fast < 0.0, -top, top)),
        sel(suspected, 0.0, sel(tried, late, sel(turned, top, before.last))),
        sel(turned, 0.0, smaller(before.lasts + dt, 1.0)),
        sel(suspected, period, sel(turned * (1.0 - tried) > 0.0, larger(before.lasts, dt), before.lasted)),
        counted,
        sel(suspected, slowed, sel(theirs, 1.0, back)),
        sel(own * (1.0 - known * still) > 0.0, load, before.time),
        wearers,
    )
