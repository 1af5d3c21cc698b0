"""Onset and end of a muscle's contraction in surface EMG: a causal detector that one can trust, any sample rate.

Four questions to each sample, in the band above 60 Hz:

1. **Is it large?** |band| above 3 σ, where σ is the size of the signal at rest. It is measured in the first half second
   of a signal without trouble, and again after half a second without any, or when hum that has stayed is gone: an
   electrode that comes back need not be as it was. σ follows the median of |band| slowly, and hardly at all during a
   contraction; after one, what the signal has calmed down to counts as rest. While little of rest has been seen, σ
   grows quicker in a contraction, so that a start that was too quiet is got over, and afterwards returns.
2. **Is it new?** Mains hum repeats itself 20 ms later, or 16.7 ms. What is left of the band after subtracting itself
   one period ago must be large too: hum of any shape passes for one period when it begins, and not when it ends.
3. **Is it broadband?** A contraction has more than a hundredth of its power above 20 Hz in that rest; movement of
   electrodes and cables, and hum, have not. It must hold its own against the peak of a swing above 5 Hz as well, which
   fades with a tenth of a second: between two of its peaks a swing may look like any noise.
4. **Is it alive?** A signal that repeats one value for 20 ms is clipped, or its electrode is off; so is one that hardly
   moves for most of the time between its largest steps, as hum does that is clipped.

Time with four times yes is evidence; other time takes some of it away again (a cumulative sum, Page 1954). A click or
the step of an electrode rings for less than the 30 ms that are needed. The second threshold, for the end, is lower:
2 σ, or a tenth of what the contraction had, missed for 150 ms. Thresholds on amplitude and on time are Bonato's (1998).
"""

import math
from typing import NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.sensing.biquad import EMPTY, Biquad, Memory, biquad, butterworth, critical_high_pass
from bowden.sensing.detector import Detector
from bowden.sensing.onset_settings import DEFAULTS, QUICKEST, SAFE, SLOWEST, OnsetSettings, of_wearer

MAINS = (50.0, 60.0)
"""[Hz]; both are looked for."""


class Onset(NamedTuple):
    """The detector at one rate; `prepare_onset` makes it. Times are in samples or per sample."""

    band: Biquad
    wide: Biquad
    swing: Biquad
    delay: tuple[int, int]
    """Whole samples of one mains period, for each of `MAINS`."""
    between: tuple[float, float]
    """The rest of it."""
    dt: float
    grow: float
    grow_early: float
    grow_active: float
    grow_unsure: float
    stay: float
    power: float
    mean: float
    peak: float
    size: float
    swung: float
    settings: OnsetSettings


class OnsetState(NamedTuple):
    """What the detector keeps."""

    origin: float
    raw: float
    inner: Memory
    outer: Memory
    wide: Memory
    slow: Memory
    past: tuple[float, ...]
    """The band's last samples, the newest first, over the longest mains period."""
    hum: float
    """Power above 20 Hz of movement and mains, averaged over a second of rest."""
    mains_seen: float
    """Share of that second with such trouble."""
    leap: float
    """Recent largest step from one sample to the next."""
    stuck: float
    """Share of recent samples without a step."""
    age: float
    """Rest that has been seen since the signal began [samples]."""
    rest: float
    """σ, in the signal's unit."""
    before: float
    """σ when the last contraction began, in the signal's unit."""
    peak: float
    swing: float
    """Square of the movement's recent peak."""
    power: float
    new: float
    mean: float
    calm: float
    size: float
    flat: float
    odd: float
    evidence: float
    quiet: float
    hold: float
    active: float
    """1 in a contraction, told or not."""
    held: float
    """How long it has lasted [s]."""


def prepare_onset(rate: float, settings: OnsetSettings = DEFAULTS) -> Onset:
    """The detector for `rate` samples a second [Hz], which must be from `SLOWEST` to `QUICKEST`."""
    assert SLOWEST <= rate <= QUICKEST
    dt, periods = 1.0 / rate, [rate / mains for mains in MAINS]
    whole = [math.floor(period) for period in periods]
    return Onset(
        critical_high_pass(settings.band_hz, rate),
        butterworth(settings.wide_hz, "high", rate),
        butterworth(settings.swing_hz, "high", rate),
        (whole[0], whole[1]),
        (periods[0] - whole[0], periods[1] - whole[1]),
        dt,
        math.exp(dt / settings.rest_time),
        math.exp(dt / settings.early_time),
        math.exp(dt / settings.active_time),
        math.exp(dt / settings.unsure_time),
        1.0 - math.exp(-dt / settings.stays),
        1.0 - math.exp(-dt / 0.015),
        1.0 - math.exp(-dt / 0.05),
        math.exp(-dt / 0.03),
        math.exp(-dt / 2.0),
        math.exp(-dt / 0.1),
        settings,
    )


def onset_start(onset: Onset, first: float) -> OnsetState:
    """Before the `first` sample, which may be NaN."""
    memories = (EMPTY, EMPTY, EMPTY, EMPTY)
    return OnsetState(first, math.nan, *memories, (0.0,) * (max(onset.delay) + 1), *([0.0] * 21))


@kernel
def onset_step(onset: Onset, state: OnsetState, value: float) -> tuple[OnsetState, float, float]:
    """One sample, in any unit; NaN where it is missing.

    Returns:
        The state, 1 in a contraction, and what is wrong with the signal: 0 nothing, 1 flat or missing, 2 movement or
        mains.
    """
    by, dt = onset.settings, onset.dt
    here = np.abs(value) < np.inf
    raw = sel(here, value, state.raw)
    origin = sel(np.abs(state.origin) < np.inf, state.origin, raw)
    x = sel(np.abs(raw) < np.inf, raw - origin, 0.0)
    inner, half = biquad(onset.band, state.inner, x)
    outer, band = biquad(onset.band, state.outer, half)
    wide, all_of_it = biquad(onset.wide, state.wide, x)
    slow, movement = biquad(onset.swing, state.slow, x)

    # what of the band is new, with a size of its own in place of twice its power
    past, left = state.past, np.inf
    for i in range(2):
        whole, part = onset.delay[i], onset.between[i]
        left = np.fmin(left, np.abs(band - (1.0 - part) * past[whole - 1] - part * past[whole]))
    left = left / np.sqrt(2.0)
    size = np.fmin(np.abs(band), left)
    peak = np.fmax(np.abs(band), state.peak * onset.peak)
    power = state.power + onset.power * (all_of_it * all_of_it - state.power)
    swing = np.fmax(movement * movement, state.swing * onset.swung)
    new = state.new + onset.power * (size * size - state.new)

    # what is wrong
    upper = by.high * state.rest
    step = sel(np.abs(state.raw) < np.inf, np.abs(raw - state.raw), 0.0)
    leap = np.fmax(step, state.leap * onset.peak)
    stuck = state.stuck + onset.power * (sel(step <= by.still * leap, 1.0, 0.0) - state.stuck)
    flat = sel(here * (raw != state.raw) > 0.0, 0.0, state.flat + dt)
    railed = (stuck > by.stuck) * (power > by.steps * leap * leap)  # rest of half a count has small steps, but rarely
    narrow = (new < by.broad * power) + (new < by.moved * swing) + railed > 0.0
    odd = sel(narrow * (power > upper * upper) > 0.0, state.odd + dt, 0.0)
    trouble = sel(flat > by.flat, 1.0, sel(odd > 0.0, 2.0, 0.0))

    # what rest is like: hum that stays belongs to it until it is gone
    idle = state.active < 0.5
    rate = sel(idle * (trouble != 1.0) > 0.0, onset.stay, 0.0)
    mains = (trouble == 2.0) * (power > by.level * swing)  # what swings slowly is movement, which does not stay
    mains_seen = state.mains_seen + rate * (sel(mains, 1.0, 0.0) - state.mains_seen)
    hum = state.hum + rate * (sel(trouble == 2.0, power, 0.0) - state.hum)
    usual = mains_seen > 0.5
    seen = (trouble == 0.0) + (trouble == 2.0) * usual > 0.0
    off = flat > sel(state.age * dt < by.settle, by.off, by.settle)
    again = off + idle * usual * (power < by.gone * hum) > 0.0
    age = sel(again, 0.0, sel(idle * seen > 0.0, state.age + 1.0, state.age))
    mains_seen, hum = sel(again, 0.0, mains_seen), sel(again, 0.0, hum)

    # rest
    settling = age * dt < by.settle
    measured = age - np.floor(by.wait / dt)
    average = state.rest + (1.6 * size - state.rest) / np.fmax(measured, 1.0)
    following = sel(age * dt < by.early, onset.grow_early, onset.grow)
    factor = sel(idle, following, sel(age * dt < by.unsure, onset.grow_unsure, onset.grow_active))
    factor = sel(size > 0.6 * state.rest, factor, 1.0 / factor)
    calm_enough = (state.active > 0.5) + (state.evidence < 0.25 * by.evidence) > 0.0
    followed = sel(calm_enough, state.rest * factor, state.rest)
    rest = sel(settling, sel(measured > 0.5, average, state.rest), followed)
    rest = np.fmax(sel(seen, rest, state.rest), by.least)
    upper = by.high * rest

    # evidence for an onset, and for an end
    mean = state.mean + onset.mean * (1.25 * size - state.mean)
    most = sel(state.active > 0.5, np.fmax(mean, state.size * onset.size), state.size)
    there = power > sel(usual, 0.5 * hum, -1.0)  # a contraction does not take from the power that stays
    yes = (size > upper) * (left > by.new * peak) * there > 0.0
    evidence = np.fmin(2.0 * by.evidence, np.fmax(0.0, state.evidence + sel(yes, dt, -by.doubt * dt)))
    hold = np.fmax(0.0, state.hold - dt)
    evidence = sel((trouble > 0.5) + (hold > 0.0) + settling > 0.0, 0.0, evidence)
    loud = size > np.fmax(by.low * rest, 2.0 * by.share * most)
    quiet = np.fmax(0.0, state.quiet + sel(loud, -2.0 * dt, dt))
    calm = sel(quiet > 0.0, np.fmin(state.calm, mean), mean)

    begins = (state.active < 0.5) * (evidence >= by.evidence) > 0.0
    ends = (state.active > 0.5) * ((quiet > by.quiet) + (odd > by.trouble) + (flat > by.flat) > 0.0) > 0.0
    rested = (state.hold > 0.0) * (hold == 0.0) * seen > 0.0
    before = sel(begins, rest, state.before)
    rest = sel(rested, np.fmax(before, calm), rest)
    active = sel(begins, 1.0, sel(ends, 0.0, state.active))
    held = sel(active > 0.5, state.held + dt, 0.0)
    reported = sel((active > 0.5) * (held > by.shortest) > 0.0, 1.0, 0.0)
    after = OnsetState(
        origin,
        raw,
        inner,
        outer,
        wide,
        slow,
        (band,) + past[:-1],  # noqa: RUF005 - Numba takes no star in a tuple
        hum,
        mains_seen,
        leap,
        stuck,
        age,
        rest,
        before,
        peak,
        swing,
        power,
        new,
        mean,
        calm,
        sel(begins, mean, most),
        flat,
        odd,
        sel(ends, 0.0, evidence),
        sel(begins, 0.0, quiet),
        sel(ends, by.refractory, hold),
        active,
        held,
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
    source="this project; thresholds on amplitude and time after Bonato (1998), evidence after Page (1954)",
)
