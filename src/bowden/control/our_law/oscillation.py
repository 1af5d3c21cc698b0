"""Does the loop swing by itself? Half-waves that do not decay raise a suspicion; a trial decides.

Nothing in a steady swing tells a loop that rings (an arm in springs, a lag that was not given) from a wearer who
trembles or walks: correction and disturbance are tied by the law itself. So the law tries: for some half-waves the
observer has a load that swings at that frequency, and κ is low. A swing of the loop's own decays then, as the load
alone does: the load stays, and κ comes back within seconds. A wearer's goes on: the load goes, κ is whole at once, and
only a larger swing is suspect until it is forgotten. A swing at the frequency of a load that was learned is never the
wearer's: one of little damping decays so slowly that it would be taken for it.

A half-wave of d̂ less its slow part lasts from one change of sign to the next. Table: ``docs/background/our_law.md``.
"""

import math
from typing import Annotated, NamedTuple

from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity

SLOWEST = 0.25
"""Half-wave beyond which nothing swings: an arm on a cable has 2 Hz and more [s]."""
ALIKE = 1.6
"""Ratio up to which two times, or two sizes, are of one swing. A load alone has 0.37 of its size after four half-waves
at a damping of 0.08; a tremor that goes on has 0.65 to 0.8 in a trial, since the part of it that is followed meanwhile
goes through a load that is none [–]."""
ENOUGH = 4.0
"""Half-waves that are counted before a trial begins; it lasts twice as many [–]."""
WATCHED = 3.0
"""Half-waves that are looked at at a trial's end [–]."""
LOAD_DAMPING = 0.25
"""Damping of a load that swings, as the observer has it: arms have 0.1 to 0.5. In a trial κ is at most this times the
swing's angular frequency, half of what such a load bears [–]."""
FORGOTTEN = 30.0
"""Time constant of the size of a wearer's swing [s]."""


class OscillationMonitor(NamedTuple):
    """State of the oscillation monitor."""

    peak: Annotated[float, Quantity("largest of the half-wave now, with its sign", "rad")]
    last_peak: Annotated[float, Quantity("largest of the one before; in a trial, at its end", "rad")]
    half_wave_time: Annotated[float, Quantity("time since the half-wave began", "s")]
    last_half_wave_time: Annotated[float, Quantity("time of the one before; in a trial, of what is tried", "s")]
    half_waves: Annotated[float, Quantity("half-waves that did not decay; below 0, those left of a trial", "1")]
    bandwidth_share: Annotated[float, Quantity("of κ that is used; 1 is all", "1")]
    load_time: Annotated[float, Quantity("T of a load that swings, 1/its frequency; 0 where none is known", "s")]
    wearer_amplitude: Annotated[float, Quantity("size of a swing that is the wearer's", "rad")]


@kernel
def time_of_load(now: OscillationMonitor) -> float:
    """T of the load that the observer is to have: in a trial the one that is tried [s]."""
    return now.last_half_wave_time / math.pi if now.half_waves < 0.0 else now.load_time


@kernel
def go_on_trying(
    before: OscillationMonitor, peak: float, fast: float, time: float, share: float, dt: float
) -> OscillationMonitor:
    """One cycle of a trial: it ends as the wearer's at once, or as the loop's own when its half-waves are over."""
    tried, load, wearers = before.last_half_wave_time, before.load_time, before.wearer_amplitude
    left = -before.half_waves - dt / tried
    last = max(abs(fast), before.last_peak) if left <= WATCHED else before.last_peak
    load_tried = tried / math.pi
    known_load = load_tried < ALIKE * load and load < ALIKE * load_tried
    persists = ALIKE * last > wearers
    if persists and not known_load:
        return OscillationMonitor(peak, last, time, tried, 0.0, 1.0, load, wearers)
    if left > 0.0:
        return OscillationMonitor(peak, last, time, tried, -left, before.bandwidth_share, load, wearers)
    return OscillationMonitor(peak, last, time, tried, 0.0, share, load if persists else load_tried, 0.0)


@kernel
def watch(before: OscillationMonitor, fast: float, least: float, kappa: float, dt: float) -> OscillationMonitor:
    """One cycle, with d̂'s `fast` part; below `least` nothing swings [rad]; `kappa` is κ, whole [1/s]."""
    turned = fast * before.peak < 0.0
    size = max(abs(fast), abs(before.peak))
    peak = fast if turned else math.copysign(size, fast)
    time = 0.0 if turned else min(1.0, before.half_wave_time + dt)
    share = min(1.0, before.bandwidth_share * (1.0 + dt / (2.0 * ENOUGH * SLOWEST)))
    if before.half_waves < 0.0:
        return go_on_trying(before, peak, fast, time, share, dt)

    lasted, last, last_peak = before.half_wave_time, before.last_half_wave_time, before.last_peak
    in_time = lasted < SLOWEST and lasted < ALIKE * last
    suspect = in_time and size > ALIKE * before.wearer_amplitude
    grows = suspect and last_peak > least and size * size > ALIKE * last_peak * last_peak
    counted = before.half_waves + (2.0 if grows else 1.0)
    early = grows and not turned and counted >= ENOUGH
    if turned:
        sustained = suspect and last < ALIKE * lasted and size > least and ALIKE * size > last_peak
        counted = counted if sustained else 0.0
        last, last_peak = max(dt, lasted), size
    elif not early:
        counted = 0.0 if lasted > SLOWEST else before.half_waves
    wearers = before.wearer_amplitude * (1.0 - dt / FORGOTTEN)
    if counted >= ENOUGH:  # a trial begins
        last = max(2.0 * dt, last)
        share = min(before.bandwidth_share, LOAD_DAMPING * math.pi / (last * kappa))
        return OscillationMonitor(peak, 0.0, time, last, -2.0 * ENOUGH, share, before.load_time, max(size, wearers))
    return OscillationMonitor(peak, last_peak, time, last, counted, share, before.load_time, wearers)
