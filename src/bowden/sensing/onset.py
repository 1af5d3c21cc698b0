"""Onset and end of a muscle's contraction in surface EMG: a causal likelihood ratio, in any unit at any sample rate.

The band from 40 to 400 Hz is looked at in three ways: as it is, and less itself one mains period ago, of 50 and of
60 Hz. Hum is missing in one of the latter, a muscle's noise in none; so all three must say what follows.

**What can be there without a contraction** is one power, the null:

    v₀ = exp(m + z·√(s² + u)) + λ₁·P + λ₂·B + λ₃·W² + min(λ₄·L, λ₅·S²) + (λ₆·A)²

m and s are level and spread of the log of power at rest, averaged over 0.1 s, and u is the variance of what is not
known of it: large at first, less after a contraction, which leaves another rest than it found, and e^(−t/T) of it after
t seconds of rest. P and B, powers above 20 Hz and in the band, and W, the recent peak of what is faster than 5 Hz, leak
a known share into what is new in the band, be they movement or mains. L is the power from 20 to 30 Hz and S the recent
peak from 5 to 15 Hz: a swing's spectrum falls steeply from below 20 Hz, so that L bounds what of it is in the band, and
a muscle alone has no S. A is the size of the contraction that lasts or has just ended, which leaves a tail.

**Evidence.** Noise of bandwidth B whose power r = x²/v₀ rises by ρ² gains log likelihood against rest,

    Λ ← max(0, Λ + B·dt·((1 − 1/ρ²)·min(r, K) − log ρ²))

which is Page's cumulative sum (1954) with a ratio bounded as Huber's (1965): no click weighs more than its time.
An onset is Λ ≥ h. h follows from how rarely rest may pass for a contraction, and K from the least time that one takes:
B·((1 − 1/ρ²)·K − log ρ²)·brief = h. There are two such sums, of r averaged over 5 ms, for strong contractions, and over
0.1 s, for weak ones, whose spikes are far apart. The end is the same sum with signs turned and half of log ρ².

**Rest** is learned as a mean with forgetting, anew after each contraction, of what is below v₀·ρ²·log ρ²/(ρ² − 1) while
there is little evidence, in steps of at most z standard deviations upward; more than that only at a share of the speed,
and in a contraction too, so that a step of rest is got over. What is quieter is learned at once: it cannot be a
contraction. Nothing is learned from a signal that leaks explain, or that is dead. Where an electrode was off, or mains
are gone that covered the signal, it starts again.

A signal is dead that repeats one value for 20 ms, and one on its rails hardly moves for most of the time between its
largest steps, as hum does that is clipped.
"""

import math
from typing import NamedTuple

import numpy as np

from bowden.core.kernel import exp, kernel, log, sel
from bowden.sensing.biquad import EMPTY, PASS, Biquad, Memory, biquad, butterworth, critical_high_pass
from bowden.sensing.detector import Detector
from bowden.sensing.onset_constants import (
    BAND_HZ,
    BANDWIDTH,
    BROAD,
    CHANGED,
    DOUBT,
    FALLS,
    FAMILIAR,
    FLAT,
    FORGET,
    GONE,
    LEARNT,
    LIFTED,
    MAINS_LEVEL,
    MEMORY,
    MOVED,
    MUTED,
    REPEATS,
    SILENT,
    SLOW_HZ,
    SPREAD,
    STAYS,
    STEEP,
    STEEP_HZ,
    STEPS,
    STILL,
    STUCK,
    SURE,
    SWAY,
    SWING_HZ,
    TAIL_SHARE,
    TOP_HZ,
    UNKNOWN,
    WEIGHT,
    WIDE_HZ,
)
from bowden.sensing.onset_settings import DEFAULTS, LARGEST, QUICKEST, SAFE, SLOWEST, OnsetSettings, of_wearer

MAINS = (50.0, 60.0)
"""[Hz]; both are looked for."""
_SHORT, _LONG, _POWER = 0.005, 0.1, 0.015
"""Time constants of the averages for strong and for weak contractions, and of powers [s]."""
_STEP, _SWING = 0.03, 0.1
"""In which the largest step, and movement's peak, fade [s]."""
_SIZE, _TAIL = 2.0, 0.2
"""In which a contraction's size fades while it lasts, and when it has ended [s]."""
_SETTLES = 0.05
"""Filters and the memory of a period fill in this time [s]."""
_LOOKS = 10.0
"""So often in a second rest has a chance to pass for a contraction: once in `_LONG` [Hz]."""
_LEFT = UNKNOWN * UNKNOWN * math.exp(-MEMORY / LEARNT)
"""u is never less, since rest is remembered for so long only [–]."""
_SPIKY = 3.0
"""Single samples count up to this many times K in the average over 5 ms: noise has them [–]."""


class Ways(NamedTuple):
    """A number for each way in which the band is looked at."""

    plain: float
    fifty: float
    sixty: float


NONE = Ways(0.0, 0.0, 0.0)


class Onset(NamedTuple):
    """The detector at one rate; `prepare_onset` makes it. Times are in samples or per sample."""

    band: Biquad
    top: Biquad
    wide: Biquad
    swing: Biquad
    steep: Biquad
    sway: Biquad
    delay: tuple[int, int]
    """Whole samples of one mains period, for each of `MAINS`."""
    between: tuple[tuple[float, float, float, float], ...]
    """Weights of the samples from one before that to two after."""
    dt: float
    short: float
    long: float
    power: float
    stay: float
    step: float
    swung: float
    size: float
    tail: float
    enough: float
    """h [–]."""
    rested: float
    """Evidence of rest that ends a contraction [–]."""
    most: float
    """K [–]."""
    gain: float
    """Evidence of one sample, for each unit of r [–]."""
    drift: float
    """Evidence that one sample takes away [–]."""
    even: float
    """r that leaves the evidence as it is [–]."""
    gain_of_end: float
    drift_of_end: float
    floor: float
    """m is never less while little of rest has been seen."""
    settings: OnsetSettings


class OnsetState(NamedTuple):
    """What the detector keeps."""

    origin: float
    raw: float
    inner: Memory
    outer: Memory
    top: Memory
    wide: Memory
    slow: Memory
    steep: Memory
    sway: Memory
    past: tuple[float, ...]
    """The band's last samples, the newest first, over the longest mains period."""
    power: float
    """Above 20 Hz, in the signal's unit squared, as all powers."""
    loud: float
    """Power in the band."""
    new: float
    """Least power of the three ways."""
    swing: float
    """Square of the movement's recent peak."""
    low: float
    """Power from 20 to 30 Hz."""
    swayed: float
    """Square of the recent peak from 5 to 15 Hz."""
    step: float
    """Recent largest step from one sample to the next."""
    stuck: float
    """Share of recent samples without a step."""
    flat: float
    """How long the value has been the same [s]."""
    covered: float
    """Share of recent rest that was covered by mains."""
    mains: float
    """Their power, averaged alike."""
    short: Ways
    """r, averaged over 5 ms."""
    long: Ways
    """r, averaged over 0.1 s."""
    powers: Ways
    """x², averaged over 0.1 s."""
    level: float
    """m."""
    spread: float
    """s²."""
    seen: float
    """Rest of which m is the mean; below 0 while filters fill [s]."""
    unknown: float
    """u."""
    null: float
    """v₀."""
    size: float
    """A²."""
    strong: Ways
    """Λ of `short`."""
    weak: Ways
    """Λ of `long`."""
    evidence: float
    """Λ on which all three ways agree, the larger of strong and weak."""
    calm: float
    """Evidence of rest."""
    active: float
    """1 in a contraction, reported or not."""
    held: float
    """How long it has lasted [s]."""
    rest: float
    """σ, in the signal's unit."""


def prepare_onset(rate: float, settings: OnsetSettings = DEFAULTS) -> Onset:
    """The detector for `rate` samples a second [Hz], which must be from `SLOWEST` to `QUICKEST`."""
    assert SLOWEST <= rate <= QUICKEST
    by, dt, periods = settings, 1.0 / rate, [rate / mains for mains in MAINS]
    whole = [math.floor(period) for period in periods]
    enough = math.log(by.hours * 3600.0 * _LOOKS)
    share, drift = 1.0 - by.ratio**-2, 2.0 * math.log(by.ratio)
    return Onset(
        band=critical_high_pass(BAND_HZ, rate),
        top=butterworth(TOP_HZ, "low", rate) if 0.4 * rate > TOP_HZ else PASS,
        wide=butterworth(WIDE_HZ, "high", rate),
        swing=butterworth(SWING_HZ, "high", rate),
        steep=butterworth(STEEP_HZ, "low", rate),
        sway=butterworth(SLOW_HZ, "low", rate),
        delay=(whole[0], whole[1]),
        between=(_cubic(periods[0] - whole[0]), _cubic(periods[1] - whole[1])),
        dt=dt,
        short=1.0 - math.exp(-dt / _SHORT),
        long=1.0 - math.exp(-dt / _LONG),
        power=1.0 - math.exp(-dt / _POWER),
        stay=1.0 - math.exp(-dt / STAYS),
        step=math.exp(-dt / _STEP),
        swung=math.exp(-dt / _SWING),
        size=math.exp(-dt / _SIZE),
        tail=math.exp(-dt / _TAIL),
        enough=enough,
        rested=by.quiet * BANDWIDTH * 0.5 * drift,
        most=(enough / (BANDWIDTH * by.brief) + drift) / share,
        gain=BANDWIDTH * dt * share,
        drift=BANDWIDTH * dt * drift,
        even=drift / share,
        gain_of_end=BANDWIDTH * dt * (1.0 - 1.0 / by.ratio),
        drift_of_end=BANDWIDTH * dt * 0.5 * drift,
        floor=2.0 * math.log(by.least),
        settings=by,
    )


def _cubic(part: float) -> tuple[float, float, float, float]:
    """Lagrange's weights of samples at −1, 0, 1 and 2 for the value at `part` between 0 and 1."""
    return (
        -part * (part - 1.0) * (part - 2.0) / 6.0,
        (part + 1.0) * (part - 1.0) * (part - 2.0) / 2.0,
        -(part + 1.0) * part * (part - 2.0) / 2.0,
        (part + 1.0) * part * (part - 1.0) / 6.0,
    )


def onset_start(onset: Onset, first: float) -> OnsetState:
    """Before the `first` sample, which may be NaN."""
    by, past, o = onset.settings, (0.0,) * (max(onset.delay) + 2), 0.0
    filters = (EMPTY,) * 7
    known = (onset.floor, SPREAD * SPREAD, -_SETTLES, UNKNOWN * UNKNOWN)
    signal, evidence = (o,) * 11, (o, o, o, o)
    averages = (NONE, NONE, NONE)
    return OnsetState(
        first, math.nan, *filters, past, *signal, *averages, *known, o, o, NONE, NONE, *evidence, by.least
    )


@kernel
def _before(past: tuple[float, ...], whole: int, weights: tuple[float, float, float, float]) -> float:
    """The band one mains period ago, between samples."""
    return (
        weights[0] * past[whole - 2]
        + weights[1] * past[whole - 1]
        + weights[2] * past[whole]
        + weights[3] * past[whole + 1]
    )


@kernel
def _averaged(before: Ways, values: Ways, most: float, share: float) -> Ways:
    """One sample into an average of each way, with values up to `most`."""
    return Ways(
        before.plain + share * (np.fmin(values.plain, most) - before.plain),
        before.fifty + share * (np.fmin(values.fifty, most) - before.fifty),
        before.sixty + share * (np.fmin(values.sixty, most) - before.sixty),
    )


@kernel
def _bounded(values: Ways, most: float) -> Ways:
    return Ways(np.fmin(values.plain, most), np.fmin(values.fifty, most), np.fmin(values.sixty, most))


@kernel
def _least(values: Ways) -> float:
    return np.fmin(values.plain, np.fmin(values.fifty, values.sixty))


@kernel
def _summed(onset: Onset, before: Ways, ratio: Ways, most: float) -> Ways:
    """Λ of each way, up to `most`."""
    bounded = _bounded(ratio, onset.most)
    return Ways(
        np.fmin(most, np.fmax(0.0, before.plain + onset.gain * bounded.plain - onset.drift)),
        np.fmin(most, np.fmax(0.0, before.fifty + onset.gain * bounded.fifty - onset.drift)),
        np.fmin(most, np.fmax(0.0, before.sixty + onset.gain * bounded.sixty - onset.drift)),
    )


@kernel
def onset_step(onset: Onset, state: OnsetState, value: float) -> tuple[OnsetState, float, float]:
    """One sample, in any unit; NaN, or beyond `LARGEST`, where it is missing.

    Returns:
        The state, 1 in a contraction, and what is wrong with the signal: 0 nothing, 1 flat or missing, 2 movement or
        mains.
    """
    by, dt = onset.settings, onset.dt
    here = np.abs(value) <= LARGEST
    raw = sel(here, value, state.raw)
    origin = sel(np.abs(state.origin) <= LARGEST, state.origin, raw)
    x = sel(np.abs(raw) < np.inf, raw - origin, 0.0)
    inner, half = biquad(onset.band, state.inner, x)
    outer, above = biquad(onset.band, state.outer, half)
    top, band = biquad(onset.top, state.top, above)
    wide, all_of_it = biquad(onset.wide, state.wide, x)
    slow, movement = biquad(onset.swing, state.slow, x)
    steep, low_part = biquad(onset.steep, state.steep, all_of_it)
    sway, slow_part = biquad(onset.sway, state.sway, movement)

    # the band, and what of it is new
    past, started = state.past, state.seen > 0.0
    fifty = band - _before(past, onset.delay[0], onset.between[0])
    sixty = band - _before(past, onset.delay[1], onset.between[1])
    square = Ways(band * band, 0.5 * fifty * fifty, 0.5 * sixty * sixty)
    power = state.power + onset.power * (all_of_it * all_of_it - state.power)
    loud = state.loud + onset.power * (square.plain - state.loud)
    new = state.new + onset.power * (_least(square) - state.new)
    swing = np.fmax(movement * movement, state.swing * onset.swung)
    low = state.low + onset.power * (low_part * low_part - state.low)
    swayed = np.fmax(slow_part * slow_part, state.swayed * onset.swung)
    powers = _averaged(state.powers, square, sel(started, onset.most * state.null, np.inf), onset.long)

    # what is wrong
    step = sel(np.abs(state.raw) < np.inf, np.abs(raw - state.raw), 0.0)
    largest = np.fmax(step, state.step * onset.step)
    stuck = state.stuck + onset.power * (sel(step <= STILL * largest, 1.0, 0.0) - state.stuck)
    flat = sel(here * (raw != state.raw) > 0.0, 0.0, state.flat + dt)
    dead = flat > FLAT
    railed = (stuck > STUCK) * (power > STEPS * largest * largest)  # rest of half a count has small steps
    usual = state.rest * state.rest
    narrow = (new < BROAD * power) + (new < MOVED * swing) + railed > 0.0
    trouble = sel(dead, 1.0, sel(narrow * (power > 9.0 * usual) > 0.0, 2.0, 0.0))

    # rest
    idle, alive = state.active < 0.5, 1.0 - dead
    swinging = MOVED * swing + np.fmin(STEEP * low, SWAY * swayed)
    beside = REPEATS * loud + BROAD * power + swinging + TAIL_SHARE * TAIL_SHARE * state.size
    seen = np.fmax(state.seen, 0.0)
    deviation = np.sqrt(state.spread + state.unknown)
    strange = state.unknown > FAMILIAR
    unsure = strange * idle > 0.0  # in a contraction rest is forgotten, and a level that rises would end it
    bound = sel(unsure, by.least, SILENT)
    heard = _least(powers)
    there = np.fmax(heard, bound * bound)
    off = log(there) - state.level
    off = sel(off > 0.0, np.fmax(0.0, off - log(1.0 + beside / usual)), off)
    lid, count = SURE * deviation, seen + _LONG
    hidden = beside > there
    calm = sel(there < onset.even * state.null, sel(state.evidence < 0.25 * onset.enough, 1.0, 0.0), DOUBT)
    calm = calm * idle * alive
    upward = sel(idle, calm * (1.0 - hidden) * np.fmin(off, lid), DOUBT * alive * off) / count
    downward = sel(off < -lid, alive * off / np.fmin(count, FALLS), idle * alive * off / count)
    level = sel(started, state.level + dt * sel(off < 0.0, downward, upward), sel(dead, state.level, log(there)))
    level = sel(unsure, np.fmax(level, onset.floor), level)
    varied = sel(state.seen > 1.0, calm * (1.0 - hidden) * dt / (count + WEIGHT), 0.0)
    spread = state.spread + varied * (np.fmin(off * off, lid * lid) - state.spread)

    # mains that covered it and are gone, an electrode that was off: another rest
    rate = sel(idle * alive > 0.0, onset.stay, 0.0)
    by_mains = hidden * (power > MAINS_LEVEL * swing)  # what swings slowly is movement
    covered = state.covered + rate * (sel(by_mains, 1.0, 0.0) - state.covered)
    mains = state.mains + rate * (sel(hidden, power, 0.0) - state.mains)
    gone = idle * (covered > 0.5) * (power < GONE * mains) > 0.0
    covered, mains = sel(gone, 0.0, covered), sel(gone, 0.0, mains)
    known = sel(idle, np.fmin(state.seen + calm * dt, MEMORY), np.fmax(0.0, state.seen - dt * FORGET))
    forgotten = gone + (flat > LIFTED) > 0.0
    known = sel(forgotten, -_SETTLES, known)
    doubted = np.fmin(UNKNOWN * UNKNOWN, state.unknown * (1.0 + dt * FORGET / LEARNT))
    muted = heard < MUTED * MUTED * by.least * by.least
    settled = np.fmax(_LEFT, state.unknown * (1.0 - sel(started * (1.0 - muted) > 0.0, calm, 0.0) * dt / LEARNT))
    unknown = sel(idle, settled, doubted)
    unknown = sel(forgotten, UNKNOWN * UNKNOWN, unknown)

    # evidence for an onset, and for an end
    null = exp(level + lid) + beside
    ratio = Ways(square.plain / null, square.fifty / null, square.sixty / null)
    short = _averaged(state.short, ratio, _SPIKY * onset.most, onset.short)
    long = _averaged(state.long, ratio, onset.most, onset.long)
    most = sel(dead + railed + (largest <= 0.0) > 0.0, 0.0, 2.0 * onset.enough)
    strong = _summed(onset, state.strong, short, most)
    weak = _summed(onset, state.weak, long, most)
    evidence = np.fmax(_least(strong), _least(weak))
    quiet = onset.drift_of_end - onset.gain_of_end * np.fmin(_least(short), onset.most)
    rested = np.fmax(0.0, state.calm + quiet)
    begins = idle * (evidence >= onset.enough) > 0.0
    ends = (1.0 - idle) * ((rested > onset.rested) + dead > 0.0) > 0.0

    active = sel(begins, 1.0, sel(ends, 0.0, state.active))
    follows = sel(strange, np.fmax(known, LEARNT), np.fmin(known + LEARNT, MEMORY))  # a level that is to outlast it
    known = sel(begins, follows, sel(ends, np.fmin(known, _LONG), known))
    unknown = sel(ends, np.fmax(unknown, CHANGED * CHANGED), unknown)
    forgets, left = sel(ends + dead + railed > 0.0, 1.0, np.inf), sel(ends, 0.0, np.inf)
    size = sel(active > 0.5, np.fmax(new, state.size * onset.size), state.size * onset.tail)
    held = sel(active > 0.5, state.held + dt, 0.0)
    reported = sel((active > 0.5) * (held > by.shortest) > 0.0, 1.0, 0.0)
    after = OnsetState(
        origin,
        raw,
        inner,
        outer,
        top,
        wide,
        slow,
        steep,
        sway,
        (band,) + past[:-1],  # noqa: RUF005 - Numba takes no star in a tuple
        power,
        loud,
        new,
        swing,
        low,
        swayed,
        largest,
        stuck,
        flat,
        covered,
        mains,
        _bounded(short, forgets),
        _bounded(long, forgets),
        _bounded(powers, forgets * null),
        level,
        spread,
        known,
        unknown,
        null,
        size,
        _bounded(strong, left),
        _bounded(weak, left),
        np.fmin(evidence, left),
        sel(begins, 0.0, rested),
        active,
        held,
        exp(0.5 * level),
    )
    return after, reported, trouble


@kernel
def onset_rest(state: OnsetState) -> float:
    """σ, in the signal's unit."""
    return state.rest


ONSET = Detector(
    name="onset",
    settings=DEFAULTS,
    prepare=prepare_onset,
    start=onset_start,
    step=onset_step,
    rest=onset_rest,
    of_wearer=of_wearer,
    slowest=SLOWEST,
    safe=SAFE,
    quickest=QUICKEST,
    source="this project; the cumulative sum of Page (1954) with the bounded ratio of Huber (1965)",
)
