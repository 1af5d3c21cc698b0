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
- **step disturbance**: a swing of the loop's own hardly grows more than fourfold in a half-wave. What is more than four
  times as large as the half-wave before, outside a trial, is taken to come from outside, and the correction may go
  twice as fast (`observer`).

| mode | becomes | when |
|---|---|---|
| watching | trial | 3.9 are counted, of 1 a half-wave that keeps its size and up to 2 one that grows |
| trial | watching, the wearer's | > 0.6 of the suspect swing in its last three half-waves; no such load is known |
| trial | watching, own | seven half-waves are over |

The fast part is d̂ less its slow part; a half-wave lasts from one change of its sign to the next.
"""

import math
from typing import Annotated, NamedTuple

from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity

SLOWEST = 0.25
"""Half-wave beyond which nothing swings: an arm on a cable has 2 Hz and more [s]."""

ALIKE = 1.6
"""Ratio of two times up to which they are of one swing: of half-waves, or of what is tried and a load known [–]."""

SUSTAINED, GROWN = 0.8, 1.3
"""Sizes over the half-wave's before: from the first a swing does not decay, from the second it grows [–]."""

GROWTH, MOST_GROWTH = 2.0, 2.0
"""Weight of a half-wave that has grown to r times the one before: 1 + 2·(r − 1), at most 2 [–]."""

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

PERSISTING = 0.6
"""Ratio from which a swing is the wearer's: size at the trial's end over that of the swing before it. A load alone has
0.37 after four half-waves at a damping of 0.08; a tremor that goes on has 0.65 to 0.8, since the part of it that is
followed meanwhile goes through a load that is none [–]."""

STEP_RATIO = 4.0
"""Growth in a half-wave that a swing of the loop's own hardly reaches: an unknown load with a damping of 0.15 grows
by at most 4.1 at 2 Hz on the 81 rigs of ``results/law_margins_grid.toml``, 3.8 at 3 Hz, 2.9 at 8 Hz [–]."""

RETURN = 1.5
"""Time constant at which κ comes back after a swing of its own [s]."""

FORGOTTEN = 30.0
"""Time constant of the size of a wearer's swing [s]."""

SLOWER = 1.15
"""Time of a swing's radian to that of the load: a load that is assumed 15 % too slow costs nothing, one 15 % too quick
half of what is gained [–]."""


class OscillationMonitor(NamedTuple):
    """State of the oscillation monitor."""

    peak: Annotated[float, Quantity("largest of the half-wave now, with its sign", "rad")]
    last_peak: Annotated[float, Quantity("largest of the one before; in a trial, at its end", "rad")]
    half_wave_time: Annotated[float, Quantity("time since the half-wave began", "s")]
    last_half_wave_time: Annotated[
        float, Quantity("time of the one before; in a trial, of the swing that is tried", "s")
    ]
    half_waves: Annotated[float, Quantity("half-waves that did not decay; below 0, those left of a trial", "1")]
    bandwidth_share: Annotated[float, Quantity("of κ that is used; 1 is all", "1")]
    load_time: Annotated[float, Quantity("T of a load that swings, 1/its frequency; 0 where none is known", "s")]
    wearer_amplitude: Annotated[float, Quantity("size of a swing that is the wearer's", "rad")]


@kernel
def no_oscillation() -> OscillationMonitor:
    """Nothing has been seen yet."""
    return OscillationMonitor(0.0, 0.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0)


@kernel
def load_of_half_wave(half_wave: float) -> float:
    """T of the load that makes half-waves of this time [s]."""
    return SLOWER / math.pi * half_wave


@kernel
def in_trial(now: OscillationMonitor) -> bool:
    """The load of the swing before is being tried."""
    return now.half_waves < 0.0


@kernel
def time_of_load(now: OscillationMonitor) -> float:
    """T of the load that the observer is to have: in a trial the one that is tried [s]."""
    return load_of_half_wave(now.last_half_wave_time) if in_trial(now) else now.load_time


@kernel
def is_step_disturbance(now: OscillationMonitor) -> bool:
    """The disturbance is larger than a swing of the loop's own will have grown to since the half-wave before.

    Of no meaning in a trial, where `last_peak` is kept for its end.
    """
    return abs(now.peak) > STEP_RATIO * now.last_peak


class HalfWave(NamedTuple):
    """The half-wave of now beside the one before."""

    turned: bool
    """It ended in this cycle, and the next one began."""
    peak: float
    """Its largest size so far [rad]."""
    signed_peak: float
    """The same with its sign; of the next one where this one ended [rad]."""
    in_time: bool
    """It lasts no longer than one of the same swing does."""
    grows: bool
    """It is larger than the one before, and in time."""
    growth: float
    """Its weight if it grows [–]."""
    news: bool
    """It is larger than the wearer's own."""


@kernel
def half_wave(before: OscillationMonitor, fast: float, least: float) -> HalfWave:
    """The half-wave with the sample of this cycle, `fast` [rad]; below `least` nothing swings [rad]."""
    turned = fast * before.peak < 0.0
    top = max(abs(fast), abs(before.peak))
    signed_peak = fast if turned else (-top if fast < 0.0 else top)
    in_time = before.half_wave_time < SLOWEST and before.half_wave_time < ALIKE * before.last_half_wave_time
    grows = in_time and before.last_peak > least and top > GROWN * before.last_peak
    growth = min(MOST_GROWTH, 1.0 + GROWTH * (top / max(least, before.last_peak) - 1.0))
    return HalfWave(turned, top, signed_peak, in_time, grows, growth, top > BEYOND * before.wearer_amplitude)


@kernel
def half_waves_counted(before: OscillationMonitor, now: HalfWave, least: float) -> float:
    """Half-waves that did not decay up to this cycle [–]."""
    if not now.turned:
        return 0.0 if before.half_wave_time > SLOWEST else before.half_waves
    alike = now.in_time and before.last_half_wave_time < ALIKE * before.half_wave_time
    sustained = now.news and now.peak > least and now.peak > SUSTAINED * before.last_peak
    if not (alike and sustained):
        return 0.0
    return before.half_waves + (now.growth if now.grows else 1.0)


@kernel
def recovered(share: float, dt: float) -> float:
    """The share of κ one cycle further on its way back to all of it [–]."""
    return min(1.0, share * (1.0 + dt / RETURN))


@kernel
def slowed(share: float, period: float, kappa: float) -> float:
    """The share of κ in a trial of half-waves of this `period` [s]."""
    frequency = math.pi / (period * kappa)  # the swing's angular frequency, over κ
    return min(SLOWED * frequency, max(SLOWEST_OWN * frequency, 0.5 * share))


@kernel
def watch(
    before: OscillationMonitor, now: HalfWave, least: float, lasts: float, wearers: float, kappa: float, dt: float
) -> OscillationMonitor:
    """One cycle outside a trial: count half-waves, and begin a trial once there are enough."""
    peak, load, counted = now.signed_peak, before.load_time, half_waves_counted(before, now, least)
    before_its_end = now.grows and now.news and before.half_waves + now.growth > ENOUGH and not now.turned
    if before_its_end or counted > ENOUGH:
        period = max(2.0 * dt, before.last_half_wave_time if before_its_end else before.half_wave_time)
        share = slowed(before.bandwidth_share, period, kappa)
        suspect = max(now.peak, before.wearer_amplitude)
        return OscillationMonitor(peak, 0.0, lasts, period, -TRIED, share, load, suspect)
    last, lasted, share = before.last_peak, before.last_half_wave_time, recovered(before.bandwidth_share, dt)
    if now.turned:
        last, lasted = now.peak, max(dt, before.half_wave_time)
    return OscillationMonitor(peak, last, lasts, lasted, counted, share, load, wearers)


@kernel
def go_on_trying(
    before: OscillationMonitor, now: HalfWave, size: float, lasts: float, wearers: float, dt: float
) -> OscillationMonitor:
    """One cycle of a trial: it ends as the wearer's at once, or as the loop's own when its half-waves are over."""
    peak, tried, load = now.signed_peak, before.last_half_wave_time, before.load_time
    left = -before.half_waves - dt / tried
    last = max(size, before.last_peak) if left <= WATCHED else before.last_peak
    load_tried, share = load_of_half_wave(tried), recovered(before.bandwidth_share, dt)
    known_load = load_tried < ALIKE * load and load < ALIKE * load_tried
    persists = last > PERSISTING * before.wearer_amplitude
    if persists and not known_load:
        return OscillationMonitor(peak, last, lasts, tried, 0.0, 1.0, load, wearers)
    if left > 0.0:
        return OscillationMonitor(peak, last, lasts, tried, -left, before.bandwidth_share, load, wearers)
    if not (persists and known_load):
        load = load_tried
    return OscillationMonitor(peak, last, lasts, tried, 0.0, share, load, 0.0)


@kernel
def update_oscillation_monitor(
    before: OscillationMonitor, fast: float, noise: float, kappa: float, dt: float
) -> OscillationMonitor:
    """One cycle.

    Args:
        before: one cycle ago.
        fast: part of d̂ [rad].
        noise: of d̂ [rad].
        kappa: κ of a loop that does not ring [1/s].
        dt: cycle [s].
    """
    least = max(LEAST, SIGMAS * noise)
    now = half_wave(before, fast, least)
    lasts = 0.0 if now.turned else min(1.0, before.half_wave_time + dt)
    wearers = before.wearer_amplitude * (1.0 - dt / FORGOTTEN)
    if in_trial(before):
        return go_on_trying(before, now, abs(fast), lasts, wearers, dt)
    return watch(before, now, least, lasts, wearers, kappa, dt)
